"""Bad statements of what leaves: rows for test_bad_scenes.py."""

from __future__ import annotations

from tests.bad_scenes import Bad

DOMAIN = "periodic = [false, false, false]\n"


def opened(
    name: str, sides: str, *expected: str, more: dict[str, str] | None = None, problems: int = 1
) -> Bad:
    """The good scene with these sides of the domain."""
    return Bad(name, {DOMAIN: f"{DOMAIN}sides = {sides}\n", **(more or {})}, expected, problems)


REMOVE = """name = "bottom"
every = 0.01
region = { kind = "block", lo = [-0.1, -0.1, 0.0], hi = [0.1, 0.1, 0.02] }
"""
REGION = REMOVE[REMOVE.index("region") :]
PLANE = "point = [0.0, 0.0, 0.02]\nnormal = [0.0, 0.0, -1.0]\n"


def removed(name: str, old: str, new: str, *expected: str, problems: int = 1) -> Bad:
    """The good scene with a removal, in which `old` is replaced by `new`."""
    assert REMOVE.count(old) == 1, f"{old!r} must stand in the removal exactly once"
    return Bad(name, {"[domain]": f"[[remove]]\n{REMOVE.replace(old, new)}[domain]"}, expected, problems)


HISTORY = "history_every = 0.01\n"
FLOW = """[[output.flow]]
name = "floor"
point = [0.0, 0.0, 0.1]
normal = [0.0, 0.0, -1.0]
"""
FACE = 'face = { kind = "disc", center = [0.0, 0.0, 0.1], axis = [0.0, 0.0, 1.0], radius = 0.01 }\n'
SKEW = (
    'face = { kind = "rectangle", corner = [0.0, 0.0, 0.1], edges = [[0.01, 0.0, 0.0], [0.01, 0.01, 0.0]] }\n'
)


def through(face: str) -> str:
    """FLOW through a face in the place of its plane."""
    return FLOW[: FLOW.index("point")] + face


REMOVALS = [
    opened("open side of an unknown name", '{ zlow = "outflow" }', "domain.sides.zlow"),
    opened("open side of an unknown kind", '{ xlo = "open" }', "domain.sides.xlo = 'open'", "outflow"),
    opened("open sides as a list", '["xlo"]', "domain.sides"),
    Bad("open side that is periodic",
        {DOMAIN: 'periodic = [true, false, false]\nsides = { xlo = "outflow" }\n'},
        ("domain.sides.xlo = 'outflow': x is periodic; a side is one of both",)),
    opened("open side where a plane stands", '{ zlo = "outflow" }',
        "domain.sides.zlo = 'outflow': wall floor stands there to the end"),
    opened("open side where a box stands", '{ xhi = "outflow", ylo = "outflow" }',
        "domain.sides.xhi = 'outflow': wall floor_xhi stands there to the end", "domain.sides.ylo",
        problems=2,
        more={'kind = "plane"\nname = "floor"': 'kind = "box"\nname = "floor"',
              'point = [0.0, 0.0, 0.0]\nnormal = [0.0, 0.0, 1.0]\n': ""}),
    *(
        Bad(name, {"frames_every = 0.01\n": f"frames_every = 0.01\n{history}{flow}"}, expected)
        for name, history, flow, expected in [
            ("flow without history", "", FLOW, ("output.flow: has no effect without output.history_every",)),
            ("flow outside the domain", HISTORY, FLOW.replace("0.1]", "0.3]"),
                ("output.flow: floor.point: the domain lies on one side of the plane",)),
            ("flow without direction", HISTORY, FLOW.replace("-1.0", "0.0"), ("output.flow[0].normal", "has no direction")),
            ("flow through neither plane nor face", HISTORY, FLOW.replace(FLOW[FLOW.index("point"):], ""),
                ("output.flow[0]", "point: missing; a plane has point and normal, and a face of limited size has face")),
            ("flow through a plane and a face", HISTORY, FLOW + FACE,
                ("output.flow[0]", "face: beside point and normal; state a face, or the point and normal of a plane")),
            ("flow through a face that reaches out", HISTORY, through(FACE.replace("0.01", "0.3")),
                ("output.flow: floor.face: reaches from (-0.3, -0.3, 0.1) to (0.3, 0.3, 0.1) m, outside the domain",)),
            ("flow through a face without size", HISTORY, through(FACE.replace(", radius = 0.01", "")),
                ("output.flow[0].face", "radius: missing [m]")),
            ("flow through a face of size zero", HISTORY, through(FACE.replace("0.01", "0.0")),
                ("output.flow[0].face", "radius = 0.0: out of range; allowed: 0 < value [m]")),
            ("flow through an unknown face", HISTORY, through(FACE.replace('"disc"', '"square"')),
                ("output.flow[0].face.kind = 'square': unknown", "disc", "rectangle")),
            ("flow through a skew face", HISTORY, through(SKEW), ("output.flow[0].face", "not at a right angle")),
            ("flow through a face in the top of the domain", HISTORY, through(FACE.replace("0.1]", "0.2]")),
                ("output.flow: floor.face: the domain lies on one side of the face",)),
            ("two flows of one name", HISTORY, 2 * FLOW, ("output.flow: name 'floor' given twice",)),
        ]
    ),
    Bad("flow along a periodic axis",
        {"frames_every = 0.01\n": f"frames_every = 0.01\n{HISTORY}{FLOW}".replace("[0.0, 0.0, -1.0]", "[1.0, 0.0, 0.0]"),
         DOMAIN: "periodic = [true, false, false]\n"},
        ("output.flow: floor.normal: x is periodic: both sides of a plane are one",)),
    Bad("flow through a face across a periodic axis",
        {"frames_every = 0.01\n": f"frames_every = 0.01\n{HISTORY}{through(FACE)}".replace("axis = [0.0, 0.0, 1.0]", "axis = [1.0, 0.0, 0.0]"),
         DOMAIN: "periodic = [true, false, false]\n"},
        ("output.flow: floor.face: x is periodic: both sides of a face are one",)),
    removed("removal without a name", 'name = "bottom"\n', "", "remove[0].name: missing"),
    removed("removal without interval", "every = 0.01\n", "", "remove[0].every: missing [s]"),
    removed("removal at interval zero", "0.01\n", "0.0\n", "remove[0].every = 0.0: out of range; allowed: 0 < value [s]"),
    removed("removal at an interval beyond the end", "0.01\n", "0.2\n",
        "remove[0].every = 0.2 s: longer than time.duration = 0.1 s"),
    removed("removal without a rule", REGION, "", "remove[0]", "one of point and normal, region, age must be stated, not none"),
    removed("removal with two rules", REGION, REGION + PLANE, "must be stated, not point, region"),
    removed("removal by a plane without normal", REGION, PLANE[: PLANE.index("normal")], "normal: missing; a plane has both"),
    removed("removal beyond a plane that is nowhere", REGION, PLANE.replace("0.02", "-0.02"),
        "remove[0].point: no part of the domain is beyond the plane"),
    removed("removal of all", REGION, PLANE.replace("0.02", "0.5"), "remove[0].point: all of the domain is beyond"),
    removed("removal from a region outside", "[-0.1, -0.1, 0.0], hi = [0.1, 0.1, 0.02]", "[1.0, 0.0, 0.0], hi = [2.0, 1.0, 1.0]",
        "remove[0].region: outside the domain"),
    removed("removal from an unknown region", '"block"', '"cube"', "remove[0].region.kind = 'cube': unknown"),
    removed("removal of age zero", REGION, "age = 0.0\n", "remove[0].age = 0.0: out of range; allowed: 0 < value [s]"),
    removed("removal by age where nothing comes", REGION, "age = 0.05\n", "remove[0].age: only inserted particles have an age"),
    removed("removal with an unknown key", "every", "interval = 1.0\nevery", "remove[0].interval: unknown key"),
    Bad("two removals of one name", {"[domain]": f"[[remove]]\n{REMOVE}[[remove]]\n{REMOVE}[domain]"},
        ("remove: name 'bottom' given twice",)),
    Bad("removal named as an open side",
        {"[domain]": "[[remove]]\n" + REMOVE.replace("bottom", "xlo") + "[domain]",
         DOMAIN: DOMAIN + 'sides = { xlo = "outflow" }\n'}, ("remove: name 'xlo' given twice; sides have their names",)),
]  # fmt: skip
