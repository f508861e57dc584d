"""Steps of gates, outputs and the run, and the planes of boxes, from primary inputs only; at edge values.

Both codes take them from `Scene` (`segments`, `n_steps`, `stride`, the planes of boxes), so that neither can
show an error of it. Here they are written down by hand, or read from what particles do. Detects: a gate a
step early or late, one of several left out, one at the end or beyond it that ends the run early; a side of a
box at the other corner, facing outwards, or at the domain's corner in the place of its own.
"""

from typing import Any

import numpy as np
import pytest

from gpudem.driver import simulate
from gpudem.scene import Scene
from tests.reference.emulator import emulate
from tests.reference.scenes import BALL, WALL

DT = 1e-5
R = 0.003


def held(removals: list[float | None], steps: int = 40, **more: Any) -> Scene:
    """A frictionless ball pressed by gravity along x against the first of these gates."""
    gates = [
        {"kind": "plane", "name": f"gate_{k}", "material": "wall", "point": (0.02 * (k + 1), 0, 0),
         "normal": (-1, 0, 0), "removed_at": at}
        for k, at in enumerate(removals)
    ]  # fmt: skip
    return Scene(**{
        "name": "held", "materials": {"ball": BALL, "wall": WALL},
        "pairs": [{"materials": ("ball", "ball")}, {"materials": ("ball", "wall"), "restitution": 0.5}],
        "contact": {"tangential": "off"},
        "particles": {"source": "explicit", "material": "ball", "radius": R,
                      "position": [(0.02 - R + 1e-5, 0, 0)]},
        "walls": gates, "gravity": (1.0, 0, 0),
        "domain": {"lo": (-0.1,) * 3, "hi": (0.2,) * 3},
        "time": {"step": DT, "duration": steps * DT}, "output": {"trace_every": DT, "history_every": DT},
        "allow": ["time_step"],
        **more,
    })  # fmt: skip


def last_step_held(scene: Scene) -> int:
    """Last step in which the force on the ball is more than its weight: its gate is there."""
    trace = simulate(scene).trace
    assert trace is not None
    weight = scene.masses[0]
    return int(np.flatnonzero(np.abs(trace["force"][:, 0, 0] - weight) > 1e-9 * weight)[-1])


#: removed_at / DT -> last step with the gate. In steps it is the nearest one, as for every time of a scene.
REMOVALS = {7.0: 7, 7.3: 7, 7.7: 8, 1.0: 1, 39.0: 39, 12.0000001: 12, 11.9999999: 12}


@pytest.mark.parametrize(("at", "last"), REMOVALS.items(), ids=[f"{k:g}" for k in REMOVALS])
def test_last_step_of_a_gate(at, last):
    """The row of the step in which it goes still has its force; the next has none."""
    assert last_step_held(held([at * DT])) == last


def test_exact_multiples_that_no_float_holds():
    """k times 1e-5 s is rarely k 1e-5: every multiple is its own step, at its removal and in the outputs."""
    for k in (3, 6, 7, 23, 29, 57, 58, 113, 1999):
        scene = held([k * 1e-5, float(f"{k}e-5")], steps=2000)
        assert [(a, b) for a, b, _ in scene.segments] == [(0, k), (k, 2000)], k
        assert scene.n_steps == 2000
        assert scene.stride(k * 1e-5) == scene.stride(float(f"{k}e-5")) == k


@pytest.mark.parametrize("half", [7.5, 8.5])
def test_half_a_step(half):
    """Either neighbour, but one and the same for force, segments and both codes' decks."""
    scene = held([half * DT])
    last = last_step_held(scene)
    assert abs(last - half) == 0.5
    assert [(a, b) for a, b, _ in scene.segments] == [(0, last), (last, 40)]


def names(scene: Scene) -> list[tuple[int, int, list[str]]]:
    return [(a, b, [w.name for w in walls]) for a, b, walls in scene.segments]


def test_several_gates():
    """At one time, in any order, one that stays."""
    scene = held([9 * DT, 4 * DT, None, 9 * DT])
    every = [f"gate_{k}" for k in range(4)]
    assert names(scene) == [
        (0, 4, every), (4, 9, ["gate_0", "gate_2", "gate_3"]), (9, 40, ["gate_2"]),
    ]  # fmt: skip
    assert last_step_held(scene) == 9
    ours, theirs = simulate(scene).trace, emulate(scene)
    assert ours is not None
    for column in ("position", "velocity", "force"):
        scale = np.abs(theirs[column]).max()
        assert np.abs(ours[column] - theirs[column]).max() < 1e-12 * scale, column


@pytest.mark.parametrize("at", [40.0, 40.4, 1000.0], ids=["at the end", "rounded to it", "beyond"])
def test_a_gate_until_the_end_makes_one_segment(at):
    scene = held([at * DT])
    assert names(scene) == [(0, 40, ["gate_0"])]
    assert last_step_held(scene) == 40
    assert simulate(scene).timing.steps == 40


def test_a_gate_one_step_before_the_end():
    scene = held([39 * DT])
    assert names(scene) == [(0, 39, ["gate_0"]), (39, 40, [])]
    done = simulate(scene)
    assert done.trace is not None
    assert done.trace["step"].tolist() == list(range(41))
    assert done.history is not None
    assert done.history["step"].tolist() == list(range(41))


#: (duration, frames_every or None) in steps -> (steps of the run, steps between frames)
RUNS = {(40, None): (40, 40), (40, 10): (40, 10), (40, 13): (52, 13), (41, 40): (80, 40), (1, None): (1, 1),
        (39.6, 10): (40, 10), (30, 0.4): (30, 1)}  # fmt: skip


@pytest.mark.parametrize(("given", "wanted"), RUNS.items(), ids=[str(k) for k in RUNS])
def test_steps_of_the_run(given, wanted):
    """The duration in whole steps, up to whole frames."""
    duration, frames = given
    scene = held([None], time={"step": DT, "duration": duration * DT},
                 output={"frames_every": None if frames is None else frames * DT})  # fmt: skip
    assert (scene.n_steps, scene.frame_stride) == wanted


def test_rows_of_outputs():
    """Trace every 7 steps, history every 10, over 40: at 0, 7, ... and 0, 10, ...; time = step DT."""
    done = simulate(held([None], output={"trace_every": 7 * DT, "history_every": 10 * DT}))
    assert done.trace is not None
    assert done.history is not None
    assert done.trace["step"].tolist() == [0, 7, 14, 21, 28, 35]
    assert done.history["step"].tolist() == [0, 10, 20, 30, 40]
    assert np.allclose(done.trace["time"], DT * done.trace["step"], rtol=1e-15, atol=0)


LO, HI = (-0.02, -0.03, 0.01), (0.04, 0.05, 0.09)
#: side -> (point on it, normal into the box)
SIDES = {
    "xlo": ((-0.02, 0, 0.05), (1, 0, 0)), "xhi": ((0.04, 0, 0.05), (-1, 0, 0)),
    "ylo": ((0.01, -0.03, 0.05), (0, 1, 0)), "yhi": ((0.01, 0.05, 0.05), (0, -1, 0)),
    "zlo": ((0.01, 0, 0.01), (0, 0, 1)), "zhi": ((0.01, 0, 0.09), (0, 0, -1)),
}  # fmt: skip


@pytest.mark.parametrize("own", [True, False], ids=["corners of its own", "corners of the domain"])
@pytest.mark.parametrize("side", SIDES)
def test_each_side_of_a_box_pushes_inwards(side, own):
    """A ball 10 um into one side, and only that side stated, feels its Hertz force along the normal."""
    point, normal = (np.array(v, float) for v in SIDES[side])
    lo, hi = np.array(LO), np.array(HI)
    domain = {"lo": lo - 0.01, "hi": hi + 0.02} if own else {"lo": lo, "hi": hi}
    box = {"kind": "box", "name": "box", "material": "wall", "sides": [side]}
    corners = {"lo": LO, "hi": HI} if own else {}
    scene = held(
        [], steps=1, walls=[box | corners], gravity=(0, 0, 0),
        domain={k: tuple(v) for k, v in domain.items()}, output={"trace_every": DT},
        particles={"source": "explicit", "material": "ball", "radius": R,
                   "position": [tuple(point + (R - 1e-5) * normal)]},
    )  # fmt: skip
    trace = simulate(scene).trace
    assert trace is not None
    young = 1 / sum((1 - m["poisson"] ** 2) / m["young"] for m in (BALL, WALL))
    force = 4 / 3 * young * np.sqrt(R) * 1e-5**1.5 * normal
    assert np.abs(trace["force"][0, 0] - force).max() < 1e-9 * np.abs(force).max()
    wall = scene.planes[0]
    assert wall.name == f"box_{side}"


def test_a_box_has_all_its_sides_unless_told():
    """Six, each once."""
    scene = held([], walls=[{"kind": "box", "name": "box", "material": "wall"}])
    assert sorted(w.name for w in scene.planes) == sorted(f"box_{side}" for side in SIDES)
