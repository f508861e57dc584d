"""Every kind of wall with every motion, in every setting: the same balls, walls that go, a periodic side.

Detects: a pair of kind and motion that one setting forgets - the full list and graphs of a CUDA device, a
restart, a precision, a wall that goes within the run, images across a periodic side.
"""

from typing import Any

import numpy as np
import pytest

from gpudem.scene import Scene
from gpudem.solver.solver import Solver
from tests.gpudem.beds import MATERIALS, PAIRS, finish, same
from tests.gpudem.on_cpu import apart

pytestmark = pytest.mark.long

R, DT, PERIOD = 0.003, 2e-5, 0.05
KINDS: dict[str, dict[str, Any]] = {
    "plane": {"point": (0, 0, -0.03), "normal": (0, 0, 1)},
    "box": {"lo": (-0.035, -0.1, -0.035), "hi": (0.035, 0.1, 0.035), "sides": ("xlo", "xhi", "zlo", "zhi")},
    "cylinder": {"radius": 0.04, "point": (0, 0, 0), "axis": (0, 1, 0)},
    "cone": {"point": (0, 0.026, -0.04), "axis": (0, 0, 1), "length": 0.08, "radius": 0.034,
             "end_radius": 0.065},
    "mesh": {
        "vertices": [(-0.06, -0.01, -0.03), (0.01, -0.01, -0.03), (0.01, 0.06, -0.03), (-0.06, 0.06, -0.03),
                     (0.07, -0.01, -0.01), (0.07, 0.06, -0.01)],
        "triangles": [(0, 1, 2), (0, 2, 3), (1, 4, 5), (1, 5, 2)],
    },
}  # fmt: skip
MOTIONS: dict[str, list[dict[str, Any]]] = {
    "linear": [{"type": "linear", "velocity": (0.1, 0, 0.2)}],
    "oscillate": [{"type": "oscillate", "amplitude": (0.002, 0, 0.004), "period": 0.03}],
    "rotate": [{"type": "rotate", "axis": (0, 1, 0), "point": (0.002, 0, 0.001), "period": 0.5}],
    "swing": [{"type": "swing", "axis": (0, 1, 0), "point": (-0.05, 0, 0), "amplitude": 0.1, "period": 0.06}],
    "table": [{"type": "table", "time": [0.0, 0.01], "velocity": [(0, 0, 0.1), (0.1, 0, 0.3)]}],
    "two": [{"type": "swing", "axis": (0, 1, 0), "point": (0, 0, 0), "amplitude": 0.05, "period": 0.04},
            {"type": "oscillate", "amplitude": (0.001, 0, 0.002), "period": 0.02}],
}  # fmt: skip
#: Largest difference of a position [R]. A rounded position is off by 1e-6 R in float32, and each of a few
#: collisions multiplies that by ten and more; a missed contact moves a ball by some R. Mixed precision rounds
#: forces only.
TOLERANCE = {"mixed": 1e-3, "float32": 0.1}
REHEARSED = {"half_list": False, "chunk": 32, "rebuild_in_graph": True}
#: Of the 30 pairs, those that stand in the default suite.
FAST = {("box", "rotate"), ("mesh", "two")}
PAIRS_OF = [
    pytest.param(kind, motion, marks=() if (kind, motion) in FAST else pytest.mark.slow)
    for kind in KINDS
    for motion in MOTIONS
]


def cloud(kind: str, motion: str, **changes: Any) -> Scene:
    """A hundred balls that fly at random over or within a wall; a second wall goes after 10 ms."""
    rng = np.random.default_rng(3)
    grid = np.stack(np.meshgrid(*[np.arange(n) for n in (5, 4, 5)], indexing="ij"), -1).reshape(-1, 3)
    position = (grid - (2, 0, 2)) * 0.0105 + (0, 0.01, 0) + rng.uniform(-1e-3, 1e-3, grid.shape)
    moving = {"kind": kind, "name": "moving", "material": "wall", "motion": MOTIONS[motion], **KINDS[kind]}
    gate = {"kind": "plane", "name": "gate", "material": "wall", "point": (0.026, 0, 0), "normal": (-1, 0, 0),
            "removed_at": 0.01}  # fmt: skip
    periodic = kind != "cone"  # which has no images
    depth = (0.0, PERIOD) if periodic else (-0.2, 0.2)
    data: dict[str, Any] = {
        "name": "cloud", "materials": MATERIALS, "pairs": PAIRS, "gravity": (0, 0, -9.81),
        "particles": {"source": "explicit", "material": "ball", "radius": R, "position": position,
                      "velocity": rng.normal(0, 0.4, position.shape)},
        "walls": [moving, gate],
        "domain": {"lo": (-0.2, depth[0], -0.2), "hi": (0.2, depth[1], 0.2),
                   "periodic": (False, periodic, False)},
        "time": {"step": DT, "duration": 0.025},
    }  # fmt: skip
    return Scene(**{**data, **changes})


def solve(scene: Scene, **options: Any) -> dict[str, np.ndarray]:
    solver = Solver(scene, threads=1, **options)
    solver.graphs = bool(options.get("rebuild_in_graph"))
    return finish(solver)


@pytest.mark.parametrize(("kind", "motion"), PAIRS_OF)
def test_survives(kind, motion):
    scene = cloud(kind, motion)
    solver = Solver(scene, threads=1)
    exact = finish(solver)
    assert solver.neighbors.rebuilds > 5
    assert solver.wall_work() != 0, "no ball touches the wall while it moves"
    assert apart(exact, solve(scene, **REHEARSED)) < 1e-8
    for precision, tolerance in TOLERANCE.items():
        found = solve(cloud(kind, motion, solver={"precision": precision}))
        off = np.abs(found["position"] - exact["position"])
        assert np.minimum(off, np.abs(off - PERIOD)).max() < tolerance * R, precision


@pytest.mark.parametrize(("kind", "motion"), PAIRS_OF)
@pytest.mark.parametrize("stop", [217, 800])
def test_restarts_bit_for_bit(kind, motion, stop):
    """Before and after the gate has gone."""
    scene = cloud(kind, motion)
    first, present = next((a, walls) for a, b, walls in scene.segments if a < stop < b)
    whole = Solver(scene, threads=1)
    for a, b, walls in scene.segments:
        whole.start(walls)
        whole.advance(min(b, stop) - a - 1)
        if a == first:
            break
        whole.write_step()
    other = Solver(scene, threads=1)
    other.load_state_dict(whole.state_dict(), present)
    for one in (whole, other):
        one.advance(150)
        one.write_step(last=True)
    same(whole.frame(), other.frame())
    assert whole.wall_work() == other.wall_work()
