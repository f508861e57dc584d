"""Recorded output stands in for the binary, for exactly the deck it was recorded from, and says so."""

from __future__ import annotations

import numpy as np
import pytest

from reference import liggghts as code
from reference.liggghts import recorded
from reference.liggghts.deck import render
from reference.liggghts.errors import LiggghtsNotFound
from tests.reference.emulator import emulate
from tests.reference.scenes import recorded_scene
from tests.reference.test_deck import GOLDEN
from tests.reference.test_insertion import pouring


@pytest.fixture
def no_binary(monkeypatch):
    monkeypatch.setenv("GPUDEM_LIGGGHTS", "/nowhere/liggghts")
    monkeypatch.setattr(recorded, "FOLDER", GOLDEN)


def test_recorded_run_without_the_binary(tmp_path, no_binary):
    """To renew after a change of the deck: python -m tests.reference.renew."""
    scene = recorded_scene()
    run = code.run(scene, tmp_path)
    assert run.notes["recorded"] is True
    assert run.notes["deck_hash"] == render(scene).hash
    assert {"recorded", "machine", "version"} <= set(run.notes["provenance"])
    assert any("LIGGGHTS was not run here" in w for w in run.warnings)
    ours = emulate(scene)
    for name in ("position", "velocity", "force", "torque"):
        assert np.abs(run.trace[name] - ours[name]).max() <= 1e-12 * np.abs(ours[name]).max()
    assert len(run.frames) == 2
    assert run.history["contacts"].to_numpy().max() == 1


def test_another_scene_is_not_taken_for_it(tmp_path, no_binary):
    with pytest.raises(LiggghtsNotFound, match="no output is recorded"):
        code.run(recorded_scene().replace(gravity=(0, 0, -1.0)), tmp_path)
    with pytest.raises(LiggghtsNotFound):
        code.run(recorded_scene(), tmp_path, use_recorded=False)


def test_packed_columns_come_back_to_the_last_bit():
    """Would detect: a sign of zero, a NaN or an overflow of the differences lost in the packing."""
    values = np.random.default_rng(1).normal(size=(40, 3, 3)) * 10.0 ** np.arange(-150, 150, 100)
    values[3], values[5, 0], values[7], values[9, 1] = -0.0, np.nan, -np.inf, 5e-324
    for column in (values, values[:, 0, 0].copy(), values[:1], values[:0]):
        again = recorded._unpacked(recorded._packed(column))
        assert again.shape == column.shape
        assert again.tobytes() == column.tobytes()


@pytest.mark.liggghts
@pytest.mark.parametrize(
    ("scene", "dtype"),
    [(recorded_scene(), "float64"), (recorded_scene(), "float32"), (pouring(), "float64")],
    ids=["float64", "float32", "particles that come"],
)
def test_record_and_recall(scene, dtype, tmp_path, liggghts):
    """Detects: rows lost, frames of another number of particles, digits lost."""
    run = code.run(scene, tmp_path / "live")
    recorded.record(run, tmp_path, dtype)
    again = recorded.recall(run.notes["deck_hash"], scene, tmp_path / "again", tmp_path)
    assert run.trace is not None
    assert again.trace is not None
    assert run.history is not None
    for name in run.trace:  # exact whatever the frames are kept as
        assert np.array_equal(run.trace[name], again.trace[name], equal_nan=True)
    assert run.history.equals(again.history)
    for a, b in zip(run.frames, again.frames, strict=True):
        assert np.array_equal(a["id"], b["id"])
        assert np.allclose(a["position"], b["position"], rtol=0 if dtype == "float64" else 1e-6, atol=0)
    assert again.notes["provenance"]["frame_dtype"] == dtype
