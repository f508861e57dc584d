"""run(): its history, trace and frames, at exact times, in the columns that every code has."""

from __future__ import annotations

import numpy as np
import pytest

from gpudem import event_driven
from gpudem.errors import SimulationError
from gpudem.output.run import HISTORY_COLUMNS, Run
from gpudem.scene import Output
from tests.event_driven import scenes


def thrown(**more):
    """A ball under gravity, elastic floor, written at times that are no collision."""
    return scenes.scene(
        [[0, 0, 0.5]], [[0.1, 0, 0]], gravity=(0, 0, -1), sides=("zlo",), lo=(-1, -1, 0), duration=2.0,
        output=Output(history_every=0.1, frames_every=0.5, trace_every=0.25), **more,
    )  # fmt: skip


def test_history_trace_and_frames(tmp_path):
    # detects: a row written at the time of the last event instead of its own, a column missing or swapped
    steps = []
    run = event_driven.run(thrown(), tmp_path, progress=steps.append)
    back = Run.load(tmp_path)
    assert list(back.history)[: len(HISTORY_COLUMNS)] == list(HISTORY_COLUMNS)
    t = back.history["time"].to_numpy()
    np.testing.assert_allclose(t, np.arange(21) / 10)
    hit = np.sqrt(2 * 0.48)
    flight = np.abs((t + hit) % (2 * hit) - hit)
    np.testing.assert_allclose(back.history["centre_z"], 0.5 - flight**2 / 2, atol=1e-12)
    np.testing.assert_allclose(back.history["kinetic_energy"], 0.005 + flight**2 / 2, atol=1e-12)
    np.testing.assert_array_equal(back.history["collisions"], (t > hit).astype(int))
    assert run.trace["position"].shape == (9, 1, 3)
    np.testing.assert_allclose(run.trace["position"][:, 0, 0], 0.1 * run.trace["time"], atol=1e-15)
    assert len(back.frames) == 5
    np.testing.assert_allclose(back.frames[4]["position"][0], run.trace["position"][-1, 0], atol=1e-15)
    assert back.code == "event_driven"
    assert back.timing.steps == steps[-1] == 2000


def test_what_there_is_is_saved_when_a_run_fails(tmp_path):
    # detects: a failed run that leaves no files, or looks complete
    with pytest.raises(SimulationError, match="budget of 1 events"):
        event_driven.run(thrown(), tmp_path, budget=1)
    back = Run.load(tmp_path)
    assert "budget" in back.notes["failed"]
    assert 1 <= len(back.history) < 21


def test_ctrl_c_keeps_what_there_is(tmp_path):
    # detects: an interrupt that is swallowed, or loses the rows so far
    def stop(step: int) -> None:
        if step >= 1000:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        event_driven.run(thrown(), tmp_path, progress=stop)
    back = Run.load(tmp_path)
    assert back.notes["interrupted_at_step"] == 1000 or back.notes["interrupted_at_step"] == 900
    assert 9 < len(back.history) < 13
