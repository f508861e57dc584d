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


FLOOR, NORMAL = 'name = "floor"\n', "normal = [0.0, 0.0, 1.0]\n"


def walls(name: str, *changes: str, wall: str = "", problems: int = 1, expected: tuple[str, ...]) -> Bad:
    """The good scene with phases at 0.02 s, 0.03 s, ... that change the floor, to whose keys `wall` adds."""
    phases = "".join(
        f"[[phases]]\nstart = {0.02 + 0.01 * k:g}\n[[phases.walls]]\n{'' if change.startswith('name') else FLOOR}{change}\n"
        for k, change in enumerate(changes)
    )
    edits = {"[domain]": f"{phases}[domain]"} | (
        {"normal = [0.0, 0.0, 1.0]\n": f"{NORMAL}{wall}\n"} if wall else {}
    )
    return Bad(name, edits, expected, problems)


SLIDE = 'motion = [{ type = "linear", velocity = [1.0, 0.0, 0.0] }]'
SERVO = 'motion = [{ type = "servo", axis = [0, 0, 1], target = 1.0, velocity_limit = 0.1 }]'
OF_WALLS = [
    walls(
        "phase of an unknown wall",
        'name = "flor"\npresent = false',
        expected=("phases[0].walls[0].name = 'flor': is no wall; did you mean 'floor'?",),
    ),
    walls(
        "phase with a wall twice",
        'present = false\n[[phases.walls]]\nname = "floor"\nmotion = []',
        expected=("phases[0].walls[1].name = 'floor': given twice in this phase",),
    ),
    walls(
        "phase in which nothing of a wall changes",
        "",
        expected=(
            "phases[0].walls[0].present: missing; states present, motion, surface_velocity or material",
        ),
    ),
    walls(
        "misspelt key of a wall that changes",
        "presnt = false",
        expected=("phases[0].walls[0].presnt: unknown key; did you mean 'present'?",),
    ),
    walls(
        "phase that moves a wall to another place",
        "point = [0.0, 0.0, 0.1]",
        expected=("phases[0].walls[0].point: unknown key",),
    ),
    walls(
        "phase with a motion without a type",
        "motion = [{ velocity = [1.0, 0.0, 0.0] }]",
        expected=("phases[0].walls[0].motion[0].type: missing",),
    ),
    walls(
        "phase that stops a wall at rest",
        "motion = []",
        expected=("phases[0].walls[0].motion = []: the wall is at rest already",),
    ),
    walls(
        "phase that stops a wall twice",
        SLIDE,
        "motion = []",
        "motion = []",
        expected=("phases[2].walls[0].motion = []: the wall is at rest already",),
    ),
    walls(
        "phase that stops a belt that there is not",
        "surface_velocity = [0.0, 0.0, 0.0]",
        expected=("phases[0].walls[0].surface_velocity = [0, 0, 0]: the wall has no belt",),
    ),
    walls(
        "belt of a phase in two numbers",
        "surface_velocity = [1.0, 0.0]",
        expected=("phases[0].walls[0].surface_velocity = [1.0, 0.0]: must be three numbers [m/s]",),
    ),
    walls(
        "phase with a servo beside another motion",
        f"{SLIDE[:-1]}, {SERVO[len('motion = [') :]}",
        expected=(
            "phases[0].walls[0].motion = [{'type': ",
            "a servo beside other motions; a servo must be the only one",
        ),
    ),
    walls(
        "phase that stops a servo twice",
        "motion = []",
        "motion = []",
        wall=SERVO,
        expected=("phases[1].walls[0].motion = []: the wall is at rest already",),
    ),
    walls(
        "phase that moves a plane with a vibration",
        SLIDE,
        wall="vibration = { speed = 0.1, amplitude = 0.001 }",
        expected=("phases[0].walls[0].motion: the wall has a vibration; state one of the two",),
    ),
    walls(
        "phase with a wall of an unknown material",
        'material = "wood"',
        expected=("phases[0].walls[0].material = 'wood': no such material; known: acrylic, ps",),
    ),
    walls(
        "phase with the material that a wall has",
        'material = "acrylic"',
        expected=("phases[0].walls[0].material = 'acrylic': it is this one already",),
    ),
    walls(
        "phase with a wall that comes and is there",
        "present = true",
        expected=("phases[0].walls[0].present = true: it is there already",),
    ),
    walls(
        "phase with a wall that goes twice",
        "present = false",
        "present = false",
        expected=("phases[1].walls[0].present = false: it is not there at 0.03 s anyway",),
    ),
    walls(
        "phase with a wall that goes before it comes",
        "present = false",
        wall="present = [0.05]",
        expected=(
            "phases[0].walls[0].present = false: the wall comes at 0.05 s; a phase can change that only later",
        ),
    ),
    walls(
        "phase with a wall that has an end",
        "present = false",
        wall="removed_at = 0.05",
        expected=(
            "phases[0].walls[0].present = false: the wall states its end itself, 0.05 s; state one of the two",
        ),
    ),
    walls("presence in a phase as text", 'present = "no"', expected=("phases[0].walls[0].present = 'no'",)),
    walls(
        "wall too fast in a phase",
        SLIDE.replace("1.0", "1000.0"),
        expected=(
            "walls: floor.motion: moves up to 1e+03 m/s within the domain, 0.01 m in a step",
            "allow = ['speed']",
        ),
    ),
    walls(
        "wall with a short period in a phase",
        'motion = [{ type = "oscillate", amplitude = [1e-6, 0, 0], period = 5e-5 }]',
        expected=("walls: floor.motion.period = 5e-05 s: is 5 time steps; allowed: >= 10",),
    ),
    Bad(
        "material of a wall in a phase without a pair",
        {
            "[contact]": "[materials.ice]\nyoung = 3.2e7\npoisson = 0.3\ndensity = 900.0\n[contact]",
            "[domain]": f'[[phases]]\nstart = 0.05\n[[phases.walls]]\n{FLOOR}material = "ice"\n[domain]',
        },
        ("pairs: ps / ice can meet, and no pair gives their restitution and friction",),
    ),
]
PHASES = [
    *OF_WALLS,
    phased("phase without start", "start = 0.05\n", "", "phases[0].start: missing [s]"),
    phased("phase at the start of the run", "0.05", "0.0", "phases[0].start = 0.0: out of range; allowed: 0 < value [s]"),
    phased("phase within the first step", "0.05", "1e-6", "phases[0].start = 1e-06 s: not a time step after the start of the run"),
    phased("phase that changes nothing", PHASE[PHASE.index("gravity") :], "", "phases[0].gravity: missing; a phase states gravity, pairs or walls"),
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
