"""Bad statements of what is inserted: rows for test_bad_scenes.py."""

from __future__ import annotations

from tests.bad_scenes import EXPLICIT, Bad

INSERT = """kind = "list"
time = [0.01, 0.02]
position = [[0.0, 0.0, 0.1], [0.02, 0.0, 0.1]]
velocity = [[0.0, 0.0, -1.0], [0.0, 0.0, -1.0]]
radius = 0.003
material = "ps"
"""


def inserted(name: str, old: str, new: str, *expected: str, problems: int = 1) -> Bad:
    """The good scene with an insertion, in which `old` is replaced by `new`."""
    assert INSERT.count(old) == 1, f"{old!r} must stand in the insertion exactly once"
    text = INSERT.replace(old, new)
    return Bad(name, {"[domain]": f"[[insert]]\n{text}[domain]"}, expected, problems)


TOUCHING = INSERT.replace("[0.01, 0.02]", "0.01").replace("[0.02, 0.0, 0.1]", "[0.001, 0.0, 0.1]")
FILE = INSERT[INSERT.index("time") : INSERT.index("radius")]
INSERTIONS = [
    inserted("insertion of unknown kind", '"list"', '"rain"', "insert[0].kind = 'rain': unknown; known: list"),
    inserted("insertion without kind", 'kind = "list"\n', "", "insert[0].kind: missing"),
    inserted("insertion with an unknown key", "radius", "radii = 1\nradius", "insert[0].radii: unknown key; did you mean 'radius'?"),
    inserted("insertion without time", "time = [0.01, 0.02]\n", "", "insert[0].time: missing [s]; or state a path"),
    inserted("insertion without position", INSERT[INSERT.index("position") : INSERT.index("velocity")], "",
        "insert[0].position: missing [m]; or state a path"),
    inserted("insertion without radius", "radius = 0.003\n", "", "insert[0].radius: missing [m]; or state a path"),
    inserted("insertion without material", 'material = "ps"\n', "", "insert[0].material: missing; or state a path"),
    inserted("insertion before the start", "0.01,", "-0.01,", "insert[0].time", "row 1 = -0.01", "0 <= value [s]"),
    inserted("insertion at no time", "0.01,", "nan,", "insert[0].time", "row 1 is not a finite number [s]"),
    inserted("too few times", "[0.01, 0.02]", "[0.01]", "insert[0].time has 1 rows; must have one for each of the 2 particles"),
    inserted("too few velocities", "velocity = [[0.0, 0.0, -1.0], ", "velocity = [", "insert[0].velocity has 1 rows"),
    inserted("radius of an insertion zero", "0.003", "0.0", "insert[0].radius = 0.0: out of range; allowed: 0 < value [m]"),
    inserted("radius of an insertion negative", "0.003", "[0.003, -0.003]", "insert[0].radius", "row 2 = -0.003"),
    inserted("radius of an insertion in mm", "0.003", "3.0", "insert: radius = 3 m: 3 mm is 0.003 m"),
    inserted("material of an insertion unknown", '"ps"', '"sp"', "insert[0].material = 'sp': no such material; known: acrylic, ps"),
    inserted("insertion outside the domain", "[0.0, 0.0, 0.1]", "[0.0, 0.0, 0.3]", "particles: 1 outside the domain", "particle 3"),
    Bad("two in one place", {"[domain]": f"[[insert]]\n{TOUCHING}[domain]"},
        ("insert: 1 pairs inserted in step 1000 (0.01 s) overlap, the worst: 3 and 4 by 0.005 m",)),
    inserted("insertion in the floor", "[0.0, 0.0, 0.1]", "[0.0, 0.0, 0.001]",
        "insert: 1 outside wall floor at insertion; particle 3 reaches 0.002 m into it (allowed: 0.1 radii)"),
    inserted("file and list of an insertion", "time", 'path = "rain.csv"\ntime', "insert[0].time: stands in the file that path names; state one of both"),
    inserted("file of an insertion that is not there", FILE, 'path = "rain.csv"\n', "insert[0].path = ", "rain.csv': no such file"),
    inserted("file of an insertion that is the scene", FILE, 'path = "scene.toml"\n', "scene.toml': unknown suffix; known: .csv, .npz, .vtu"),
    Bad("neither particles nor insertions", {"[particles]\n" + EXPLICIT + 'material = "ps"\n': ""},
        ("particles: missing; or state what is inserted ([[insert]])",)),
]  # fmt: skip
