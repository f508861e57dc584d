"""Bad phases of a run: rows for test_bad_scenes.py."""

from __future__ import annotations

from tests.bad_scenes import Bad

PHASE = """start = 0.05
gravity = [0.0, 0.0, -5.0]
[[phases.pairs]]
materials = ["acrylic", "ps"]
friction = 0.1
"""
PAIR = PHASE[PHASE.index("[[phases") :]


def phased(name: str, old: str, new: str, *expected: str, problems: int = 1) -> Bad:
    """The good scene with a phase, in which `old` is replaced by `new`."""
    assert PHASE.count(old) == 1, f"{old!r} must stand in the phase exactly once"
    return Bad(name, {"[domain]": f"[[phases]]\n{PHASE.replace(old, new)}[domain]"}, expected, problems)


def twice(first: str, second: str) -> dict[str, str]:
    """Edits that state two phases of these starts."""
    one, two = (f"[[phases]]\n{PHASE.replace('0.05', start)}" for start in (first, second))
    return {"[domain]": f"{one}{two}[domain]"}


PHASES = [
    phased("phase without start", "start = 0.05\n", "", "phases[0].start: missing [s]"),
    phased("phase at the start of the run", "0.05", "0.0", "phases[0].start = 0.0: out of range; allowed: 0 < value [s]"),
    phased("phase within the first step", "0.05", "1e-6", "phases[0].start = 1e-06 s: not a time step after the start of the run"),
    phased("phase that changes nothing", PHASE[PHASE.index("gravity") :], "", "phases[0].gravity: missing; a phase states gravity or pairs"),
    phased("phase with a key that cannot change", "gravity", "young = 1e7\ngravity", "phases[0].young: unknown key"),
    phased("misspelt key of a phase", "gravity", "gravty", "phases[0].gravty: unknown key; did you mean 'gravity'?"),
    phased("gravity of a phase in two numbers", "[0.0, 0.0, -5.0]", "[0.0, -5.0]", "phases[0].gravity = [0.0, -5.0]: must be three numbers [m/s2]"),
    phased("gravity of a phase in mm/s2", "-5.0]", "-9810.0]", "phases[0].gravity = 9810 m/s2: 9810 mm/s2 is 9.81 m/s2"),
    phased("change of an unstated pair", '"ps"', '"sp"', "phases[0].pairs[0].materials: no [[pairs]] of acrylic / sp, which could change"),
    phased("change of no property", "friction = 0.1\n", "", "phases[0].pairs[0].friction: missing; a change of a pair states one property"),
    phased("change of a pair twice", PAIR, PAIR + PAIR, "phases[0].pairs[1].materials: acrylic / ps given twice"),
    phased("restitution of a phase too large", "friction = 0.1", "restitution = 1.5", "phases[0].pairs[0].restitution = 1.5: out of range; allowed: 0 < value <= 1 [1]"),
    phased("friction of a phase in percent", "friction = 0.1", "friction = 40.0", "phases[0].pairs[0].friction = 40 [1]: unusual, above 10 [1]"),
    phased("unknown property of a pair that changes", "friction = 0.1", "fricton = 0.1", "phases[0].pairs[0].fricton: unknown key; did you mean 'friction'?"),
    Bad("phases that do not ascend", twice("0.05", "0.04"),
        ("phases[1].start = 0.04 s: not a time step after the one before, 0.05 s; phases must ascend",)),
    Bad("phases at one time", twice("0.05", "0.05"), ("phases[1].start = 0.05 s: not a time step after the one before",)),
]  # fmt: skip
