"""Bad statements of what leaves: rows for test_bad_scenes.py."""

from __future__ import annotations

from tests.bad_scenes import Bad

DOMAIN = "periodic = [false, false, false]\n"


def opened(
    name: str, sides: str, *expected: str, more: dict[str, str] | None = None, problems: int = 1
) -> Bad:
    """The good scene with these sides of the domain."""
    return Bad(name, {DOMAIN: f"{DOMAIN}sides = {sides}\n", **(more or {})}, expected, problems)


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
]  # fmt: skip
