"""Bad groups of particles: rows for test_bad_scenes.py."""

from __future__ import annotations

from tests.bad_scenes import GOOD, Bad

GROUP = """name = "base"
ids = [1]
frozen = true
"""


def grouped(name: str, old: str, new: str, *expected: str, problems: int = 1) -> Bad:
    """The good scene with a group, in which `old` is replaced by `new`."""
    assert GROUP.count(old) == 1, f"{old!r} must stand in the group exactly once"
    return Bad(name, {"[domain]": f"[[groups]]\n{GROUP.replace(old, new)}[domain]"}, expected, problems)


MOVED = "motion = [{ type = 'linear', velocity = [0.0, 0.0, 1.0] }]"
TWICE = f"[[groups]]\n{GROUP}[[groups]]\n{GROUP}"
MOVING = "velocity = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]"
assert MOVING in GOOD
GROUPS = [
    grouped("group without name", 'name = "base"\n', "", "groups[0].name: missing"),
    grouped("group of nothing", "ids = [1]\n", "", "groups[0].material: missing; a group states material, ids or region"),
    grouped("group that nothing holds", "frozen = true\n", "", "groups[0].frozen: missing; what holds the particles"),
    grouped("group that is not frozen", "true", "false", "groups[0].frozen: missing"),
    grouped("group with an unknown key", "frozen", "frozn = true\nfrozen", "groups[0].frozn: unknown key; did you mean 'frozen'?"),
    grouped("group frozen by a number", "true", "1", "groups[0].frozen = 1: must be true or false"),
    grouped("id 0", "[1]", "[0]", "groups[0].ids = [0]: row 1 is 0; must be ids, whole numbers from 1"),
    grouped("half an id", "[1]", "[1, 1.5]", "row 2 is 1.5; must be ids, whole numbers from 1"),
    grouped("id of no particle", "[1]", "[1, 7]", "groups[0].ids: 7: no such particle; allowed: 1 to 2, those at the start"),
    Bad("id of an inserted particle", {"[domain]": f"""[[insert]]
kind = "list"
time = 0.01
position = [[0.0, 0.0, 0.1]]
radius = 0.003
material = "ps"
[[groups]]
{GROUP.replace("[1]", "[3]")}[domain]"""}, ("groups[0].ids: 3: is inserted during the run, and stays free; allowed: 1 to 2",)),
    grouped("no ids", "[1]", "[]", "groups[0]: no particle at the start is in group 'base'"),
    grouped("unknown material of a group", "ids = [1]", 'material = "sp"', "groups[0].material = 'sp': no such material; known: acrylic, ps"),
    grouped("group of a material of no particle", "ids = [1]", 'material = "acrylic"', "no particle at the start is in group 'base'"),
    grouped("everything frozen", "[1]", "[1, 2]", "groups: every particle is in one; at least one must be free"),
    grouped("group named as a wall", '"base"', '"floor"', "groups[0].name = 'floor': a wall has this name"),
    Bad("two groups of one name", {"[domain]": TWICE.replace("[1]", "[2]", 1) + "[domain]"},
        ("groups[1].name = 'base': there is another group of this name",)),
    Bad("particle in two groups", {"[domain]": TWICE.replace("base", "other", 1) + "[domain]"},
        ("groups[1]: particle 1 is in group 'other' already; allowed: one group",)),
    grouped("group of an unknown region", "ids = [1]", 'region = { kind = "ball" }', "groups[0].region.kind = 'ball': unknown"),
    grouped("group of an empty region", "ids = [1]", 'region = { kind = "sphere", center = [0.0, 0.0, 0.1], radius = 0.01 }',
        "groups[0]: no particle at the start is in group 'base'"),
    Bad("force on an unknown group", {"[output]": '[output]\nhistory_every = 0.01\ngroup_forces = ["bed"]'},
        ("output.group_forces: 'bed' is no group",)),
    Bad("force on a group without history", {"[domain]": f"[[groups]]\n{GROUP}[domain]", "[output]": '[output]\ngroup_forces = ["base"]'},
        ("output.group_forces: has no effect without output.history_every [s]",)),
    grouped("frozen with a motion", "true", "true\nmotion = [{ type = 'linear', velocity = [0.0, 0.0, 1.0] }]",
        "groups[0].frozen: beside motion; state one of the two"),
    grouped("unknown motion of a group", "frozen = true", "motion = [{ type = 'shake' }]", "groups[0].motion[0].type = 'shake': unknown"),
    grouped("servo of a group", "frozen = true", "motion = [{ type = 'servo', axis = [0.0, 0.0, 1.0], target = 1.0, velocity_limit = 1.0 }]",
        "groups[0].motion: a group has no servo; walls have"),
    Bad("path and a motion", {"[domain]": f"[solver]\nintegrator = 'path'\n[[groups]]\n{GROUP.replace('frozen = true', MOVED)}[domain]"},
        ("groups[0].motion: solver.integrator = 'path' knows no such motion; use 'half_step'",)),
    Bad("frozen and moving", {"[domain]": f"[[groups]]\n{GROUP}[domain]", MOVING: MOVING.replace("0.0", "0.5", 1)},
        ("groups[0]: particle 1 has velocity (0.5, 0.0, 0.0) m/s of its own; must be 0",)),
]  # fmt: skip
