"""Restarts where the order of sorting is not the initial one, and of every kind of state; bit for bit.

At the removal of a gate the particles are sorted anew, along axes that fit where they are by then, and in
blocks of another size. Detects: an order or a block size worked out anew from the initial state; springs of
walls, radii, masses or materials of particles stored in one order and read in another; a history or trace
with a row twice, missing or of another time after a restart within an output interval.
"""

from typing import Any

import numpy as np
import pytest

from gpudem.driver import simulate
from gpudem.scene import Scene
from gpudem.solver.solver import Solver
from tests.gpudem.beds import falling_bed, finish, same
from tests.gpudem.test_restart import stopped_and_resumed
from tests.gpudem.test_vibration import shaken_bed

COUNT = 320
HEAVY = {"young": 5e6, "poisson": 0.25, "density": 4000.0}


def spreading(**changes: Any) -> Scene:
    """A tall narrow column on the floor that flies apart sideways; a gate far away goes at 8 ms, when the
    longest extent is sideways. Two radii and two materials, friction at the walls."""
    rng = np.random.default_rng(5)
    index = np.arange(COUNT)
    place = np.stack([index % 4, index // 4 % 4, index // 16], axis=1)
    position = 0.0061 * place + rng.uniform(-5e-5, 5e-5, (COUNT, 3)) + np.array([0.19, 0.0031, 0.0029])
    velocity = rng.normal(0, 0.3, (COUNT, 3)) + np.stack(
        [8.0 * (place[:, 0] - 1.5), np.zeros(COUNT), np.full(COUNT, -1.0)], axis=1
    )
    base = falling_bed(10)
    pairs = [{"materials": p, "restitution": 0.7, "friction": mu} for p, mu in (
        (("ball", "ball"), 0.4), (("ball", "heavy"), 0.5), (("heavy", "heavy"), 0.2), (("ball", "wall"), 0.6),
        (("heavy", "wall"), 0.3))]  # fmt: skip
    return Scene(**{
        "name": "spreading",
        "materials": {k: m.model_dump() for k, m in base.materials.items()} | {"heavy": HEAVY},
        "pairs": pairs,
        "particles": {
            "source": "explicit", "position": position, "velocity": velocity,
            "radius": np.where(index % 3 == 0, 0.0025, 0.003),
            "material": ["heavy" if k % 2 else "ball" for k in index],
        },
        "gravity": (0, 0, -9.81),
        "walls": [
            {"kind": "box", "name": "box", "material": "wall", "lo": (0, 0, 0), "hi": (0.4, 0.0255, 0.4)},
            {"kind": "plane", "name": "gate", "material": "wall", "point": (0.399, 0, 0),
             "normal": (-1, 0, 0), "removed_at": 0.008},
        ],
        "domain": {"lo": (-0.01, -0.01, -0.01), "hi": (0.41, 0.04, 0.41)},
        "time": {"step": 1e-5, "duration": 0.011}, "allow": ["time_step"],
        **changes,
    })  # fmt: skip


def order(solver: Solver) -> tuple[int, ...]:
    """Block size and axes of sorting."""
    return int(solver.params.block), *(int(a) for a in solver.params.axes)


def in_two_parts(scene: Scene, at: int, **options: Any) -> tuple[dict[str, np.ndarray], bool]:
    """The last frame of a run that a second solver takes over at step `at`; whether the order is new."""
    first, second = Solver(scene, **options), Solver(scene, **options)
    initial, changed, now = order(first), False, first
    for begin, end, walls in scene.segments:
        now.start(walls)
        if begin < at < end:
            first.advance(at - begin)
            changed, now = order(first)[1:] != initial[1:], second
            second.load_state_dict(first.state_dict(), walls)
            assert order(second) == order(first)
        now.advance(end - max(begin, at if now is second else 0) - 1)
        now.write_step(last=True)
    first.close()
    second.close()
    return second.frame(), changed


KINDS: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "half list": ({}, {}),
    "full list": ({}, {"half_list": False}),
    "mixed": ({"solver": {"precision": "mixed"}}, {}),
    "mixed, full list": ({"solver": {"precision": "mixed"}}, {"half_list": False}),
    "path": ({"solver": {"integrator": "path"}}, {}),
}


@pytest.mark.parametrize("kind", KINDS)
def test_after_a_gate_changed_the_order(kind):
    """300 steps to go, with contacts and rebuilds, from a state whose order is not that of the start."""
    changes, options = KINDS[kind]
    scene = spreading(**changes)
    whole = finish(Solver(scene, **options))
    parts, changed = in_two_parts(scene, 850, **options)
    assert changed
    same(whole, parts)
    assert np.abs(whole["angular_velocity"]).max() > 1.0


def test_with_springs_at_the_walls():
    """Before the gate goes, while most lie on the floor: springs of wall contacts are carried over."""
    scene = spreading()
    parts, _ = in_two_parts(scene, 500)
    same(finish(Solver(scene)), parts)


#: Intervals in steps of 2e-5 s: restarts every 137 steps lie within those of histories, traces and frames.
OUTPUT = {"history_every": 0.001, "trace_every": 0.0014, "frames_every": 0.01, "restart_every": 137 * 2e-5}


@pytest.mark.parametrize("stop", [600, 1490, 1730], ids=["before", "just before", "after the gate"])
def test_in_the_middle_of_an_output_interval(tmp_path, stop):
    """Every row of history and trace, and every frame, is there once and equal to the last bit."""
    scene = falling_bed(300, output=OUTPUT)
    whole = simulate(scene, tmp_path / "whole")
    parts = stopped_and_resumed(scene, tmp_path / "parts", at=stop)
    begun = parts.notes["resumed_at_step"]
    assert begun == stop // 137 * 137
    for seconds in (0.001, 0.0014, 0.01):
        assert begun % scene.stride(seconds) != 0
    assert whole.history is not None
    assert parts.history is not None
    assert list(parts.history) == list(whole.history)
    assert whole.history.equals(parts.history)
    assert np.array_equal(parts.history["step"], np.arange(0, scene.n_steps + 1, 50))
    assert whole.trace is not None
    assert parts.trace is not None
    for column in whole.trace:
        assert np.array_equal(whole.trace[column], parts.trace[column]), column
    assert np.array_equal(whole.frames.times, parts.frames.times)
    for a, b in zip(whole.frames, parts.frames, strict=True):
        same(a, b)


def test_columns_of_moving_walls_after_a_restart(tmp_path):
    """The work of the walls goes on from where it was, row by row."""
    scene = shaken_bed(300, 0.0007, time={"step": 4e-5, "duration": 0.03},
                       output={"history_every": 0.001, "restart_every": 0.0077})  # fmt: skip
    whole = simulate(scene)
    parts = stopped_and_resumed(scene, tmp_path, at=600)
    assert whole.history is not None
    assert parts.history is not None
    assert "work" in parts.history
    assert whole.history.equals(parts.history)
    assert whole.history["work"].iloc[-1] != whole.history["work"].iloc[len(whole.history) // 2]
