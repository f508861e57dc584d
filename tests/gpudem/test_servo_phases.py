"""Servos that begin and end by phases: a press that comes down, holds a force, rests, and goes up again."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gpudem
from comparisons.scene_case.analysis import walls_work
from gpudem.output.vtu import read_vtu_and_cells
from gpudem.scene import Scene
from gpudem.scene.placed import walls_at
from tests.gpudem.test_restart import stopped_and_resumed
from tests.gpudem.test_wall_forces import DT, FLAT, R, floor, scene

DOWN, UP = ({"type": "linear", "velocity": (0.0, 0.0, v)} for v in (-0.1, 0.05))
TURN = {"type": "rotate", "axis": (0, 1, 0), "point": (-0.5, 0, 0.1), "period": 2.0}
TOP, LIMIT, GAIN = 2 * R + 1e-4, 0.2, 0.4
REFERENCE = (0.1, 0.2, TOP)


def servo(target: float, **gains: float) -> dict[str, Any]:
    """Pressing down with a force [N]."""
    axis = (0.0, 0.0, -2.0)
    return {"type": "servo", "axis": axis, "target": target, "velocity_limit": LIMIT, "kp": GAIN, **gains}


def press(*motions: list[dict[str, Any]], steps: int, **output: Any) -> Scene:
    """A plate over a ball on a floor; each of these motions lasts so many steps."""
    plate = {"kind": "mesh", "name": "plate", **FLAT, "move": (0, 0, TOP), "motion": motions[0],
             "reference": REFERENCE}  # fmt: skip
    phases = [
        {"start": k * steps * DT, "walls": [{"name": "plate", "motion": motion}]}
        for k, motion in enumerate(motions) if k
    ]  # fmt: skip
    count = steps * len(motions)
    return scene(
        [floor("plane"), plate], [[0.02, 0.01, R - 1e-5]], steps=count, phases=phases,
        output={"history_every": DT, **output},
    )  # fmt: skip


def test_each_servo_begins_anew_where_the_wall_is():
    """Places from the forces of the history: down, a force, at rest, another force, up.

    Detects: a servo that acts before or after its phase, one that keeps the integral, the last error or the
    place of the one before, a wall that does not stay where a servo has left it.
    """
    steps, targets = 300, {1: 40.0, 3: 20.0}
    whole = press([DOWN], [servo(40.0, ki=0.5)], [], [servo(20.0, ki=0.5, kd=1e-6)], [UP], steps=steps)
    history = gpudem.simulate(whole).history
    assert history is not None
    force, z = history.force_plate_z.to_numpy(), history.position_plate_z.to_numpy()
    velocity = np.repeat([-0.1, 0.0, 0.0, 0.0, 0.05], steps)  # of the steps from 1 on
    for part, target in targets.items():
        first = part * steps
        error = 1 - force[first + 1 : first + steps] / target
        pushed = GAIN * error + 0.5 * np.cumsum(error) * DT
        pushed += (1e-6 if part == 3 else 0.0) * np.diff(error, prepend=1.0) / DT
        velocity[first + 1 : first + steps] = -LIMIT * np.clip(pushed, -1, 1)  # at rest in its first step
    assert z[1:] - TOP == pytest.approx(np.cumsum(velocity) * DT, abs=1e-12)
    assert np.abs(velocity[steps : 2 * steps]).max() > 0.01
    assert np.abs(np.diff(z[2 * steps :])).max() > 1e-7
    work = np.cumsum(-force[1:] * velocity) * DT
    assert history.work_plate.to_numpy()[1:] == pytest.approx(work, abs=1e-9 * np.abs(work).max())


@pytest.mark.parametrize("stop", [150, 250, 300])
def test_two_parts_are_one_run(tmp_path, stop):
    """Detects: the place, sum or last error of a servo that acts, or has ended, not in the restart file."""
    every = {"restart_every": stop * DT, "frames_every": 100 * DT}
    gains = {"ki": 0.5, "kd": 1e-6}
    whole = press([DOWN], [servo(40.0, **gains)], [TURN], [servo(20.0, **gains)], steps=100, **every)
    once = gpudem.simulate(whole, tmp_path / "whole", threads=1)
    parts = stopped_and_resumed(whole, tmp_path / "parts", at=stop, threads=1)
    assert once.history is not None
    assert once.history.equals(parts.history)


def test_output_has_the_wall_where_it_is(tmp_path):
    """Frames, `walls_at` and metrics of a scene, with turns before and after a servo, as the history says.

    Detects: a plate that is drawn or looked at where it would be without its servo, a way of the servo that
    the turn after it does not turn.
    """
    whole = press([TURN], [servo(40.0)], [TURN], [], steps=200, frames_every=100 * DT, trace_every=100 * DT)
    run = gpudem.simulate(whole, tmp_path)
    assert run.history is not None
    assert run.trace is not None
    history = run.history.set_index("step")
    _, ways, missing = walls_work(run, run.trace)
    assert not missing
    assert np.linalg.norm(ways["plate"][:3], axis=1).max() < 1e-12
    for k, step in enumerate(range(0, 801, 100)):
        place = history.loc[step, [f"position_plate_{axis}" for axis in "xyz"]].to_numpy(float)
        points, _ = read_vtu_and_cells(tmp_path / "frames" / f"walls_{step:09d}.vtu")
        a, b, c = points["points"][-6:-3]
        assert abs(np.dot(np.cross(b - a, c - a), place - a)) < 1e-12, step
        found = {wall.name: wall for wall in walls_at(whole, step * DT, {"plate": ways["plate"][k]})}
        assert abs(found["plate"].gap(place[None])[0]) < 1e-12
        known = "plate" in {wall.name for wall in walls_at(whole, step * DT)}
        assert known == (step <= 200)
    assert np.linalg.norm(ways["plate"][-1]) > 1e-5
    assert whole.wall_speeds[1] > LIMIT
