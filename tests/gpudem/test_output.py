"""Frames, trace and history of a run: right steps, right numbers, the same from memory and from disk."""

import numpy as np
import pytest

from gpudem.driver import simulate as run
from gpudem.output.run import HISTORY_COLUMNS, Run
from tests.gpudem.beds import falling_bed

#: Walls at the end: the gate has gone.
PRESENT = [p for p in falling_bed(1).planes if p.removed_at is None]


@pytest.fixture(scope="module")
def bed_run(tmp_path_factory):
    output = {"frames_every": 0.01, "trace_every": 0.005, "history_every": 0.002}
    return run(falling_bed(300, output=output), tmp_path_factory.mktemp("bed"))


def test_every_interval_once(bed_run):
    """Also across the gate removal. Catches steps written twice at a segment's end, or left out."""
    assert np.allclose(bed_run.frames.times, [0, 0.01, 0.02, 0.03, 0.04], rtol=0, atol=1e-12)
    assert bed_run.trace["step"].tolist() == list(range(0, 2001, 250))
    assert bed_run.history.step.tolist() == list(range(0, 2001, 100))
    assert tuple(bed_run.history.columns) == HISTORY_COLUMNS


def test_frame_trace_and_history_agree(bed_run):
    """Frames are in order of id, in float64. Catches sorted rows, half-step velocities, a wrong mass."""
    frame, row = bed_run.frames[-1], bed_run.history.iloc[-1]
    assert np.array_equal(frame["position"], bed_run.trace["position"][-1])
    assert np.array_equal(frame["velocity"], bed_run.trace["velocity"][-1])
    mass = bed_run.scene.masses
    assert row.kinetic_energy == pytest.approx(0.5 * mass @ (frame["velocity"] ** 2).sum(axis=1), rel=1e-14)
    assert row.potential_energy == pytest.approx(9.81 * mass @ frame["position"][:, 2], rel=1e-13)
    d = frame["position"][:, None] - frame["position"][None]
    pairs = ((np.sqrt((d**2).sum(axis=2)) < 0.006).sum() - 300) // 2
    normal, point = np.array([w.normal for w in PRESENT]), np.array([w.point for w in PRESENT])
    distance = frame["position"] @ normal.T - (normal * point).sum(axis=1)
    assert row.contacts == pairs + (distance <= 0.003).sum() > 50


def test_frame_zero_is_the_stated_state(bed_run):
    assert np.array_equal(bed_run.frames[0]["position"], bed_run.scene.state.position)
    assert np.array_equal(bed_run.frames[0]["velocity"], bed_run.scene.state.velocity)


def test_load_gives_back_what_was_saved(bed_run):
    loaded = Run.load(bed_run.directory)
    assert loaded.timing == bed_run.timing
    assert loaded.scene.hash == bed_run.scene.hash
    assert np.array_equal(loaded.history.to_numpy(), bed_run.history.to_numpy())
    assert np.array_equal(loaded.trace["force"], bed_run.trace["force"])


def test_timing_counts_stepping_alone(bed_run):
    assert bed_run.timing.steps == 2000
    assert bed_run.timing.particles == 300
    assert 0 < bed_run.timing.stepping_s
    assert bed_run.timing.rate == pytest.approx(600_000 / bed_run.timing.stepping_s)
