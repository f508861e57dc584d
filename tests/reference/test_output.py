"""LIGGGHTS output in the common form: frames, trace, history; and what a broken dump does."""

from __future__ import annotations

import numpy as np
import pytest

from gpudem.output.run import HISTORY_COLUMNS, Run
from reference import liggghts as code
from reference.liggghts import dump
from reference.liggghts.deck import RAW, TRACE, render
from reference.liggghts.errors import LiggghtsOutputError
from reference.liggghts.runner import execute
from tests.reference.scenes import AGREEMENT, R, gate_removal, scene, two_spheres

pytestmark = pytest.mark.liggghts


def test_frames_and_trace_tell_the_same(tmp_path, liggghts):
    s = two_spheres(output={"frames_every": 4e-4})
    run = code.run(s, tmp_path)
    assert run.frames.times == pytest.approx([0, 4e-4, 8e-4, 1.2e-3])
    for k, frame in enumerate(run.frames):
        for name in ("position", "velocity", "angular_velocity", "force", "torque"):
            assert np.array_equal(frame[name], run.trace[name][400 * k]), name  # to the last bit: trap 7
        assert frame["position"].dtype == frame["radius"].dtype == np.float64
        assert frame["id"].tolist() == [1, 2]
        assert frame["material"].tolist() == [0, 0]
    assert not (tmp_path / RAW).exists()
    assert {"deck.in", "particles.data", "log.liggghts", "run.pvd", "run.json"} <= {
        p.name for p in tmp_path.iterdir()
    }
    again = Run.load(tmp_path)
    assert np.array_equal(again.trace["force"], run.trace["force"])
    assert again.notes["deck_hash"] == render(s).hash


def test_initial_state_is_read_exactly(tmp_path, liggghts):
    s = AGREEMENT["periodic_bed"]()
    first = code.run(s, tmp_path).frames[0]
    for name in ("position", "velocity", "radius"):
        assert np.array_equal(first[name], getattr(s.state, name)), name


def test_history_is_that_of_the_trace(tmp_path, liggghts):
    s = AGREEMENT["periodic_bed"]()
    run = code.run(s, tmp_path)
    h, t = run.history, run.trace
    mass = 1768.0 * 4 / 3 * np.pi * R**3
    assert tuple(h.columns) == HISTORY_COLUMNS
    assert h["step"].tolist() == t["step"].tolist()
    assert h["time"].tolist() == t["time"].tolist()
    assert h["kinetic_energy"].to_numpy() == pytest.approx(
        0.5 * mass * (t["velocity"] ** 2).sum((1, 2)), rel=1e-12
    )
    spin = 0.5 * 0.4 * mass * R**2 * (t["angular_velocity"] ** 2).sum((1, 2))
    assert h["rotational_energy"].to_numpy() == pytest.approx(spin, rel=1e-12, abs=1e-25)
    assert h["centre_z"].to_numpy() == pytest.approx(t["position"][..., 2].mean(1), rel=1e-12)
    assert h["potential_energy"].to_numpy() == pytest.approx(
        27 * mass * 9.81 * t["position"][..., 2].mean(1), rel=1e-12
    )
    assert h["contacts"].tolist() == [_contacts(x) for x in t["position"]]
    assert h["contacts"].max() > 10


def _contacts(x: np.ndarray) -> int:
    d = x[:, None] - x
    d[..., :2] -= 0.02 * np.round(d[..., :2] / 0.02)
    pairs = (np.triu(np.linalg.norm(d, axis=-1) < 2 * R, 1)).sum()
    return int(pairs + (x[:, 2] <= R).sum())


def test_a_gap_is_no_contact(tmp_path, liggghts):
    """`contact_distance_factor 1.01` makes LIGGGHTS look at pairs up to 1 % apart; it does not count them."""
    s = scene("gap", [[0, 0, 0], [0.00603, 0, 0]], [[0, 0, 0], [0, 0, 0]], steps=2)
    assert code.run(s, tmp_path).history["contacts"].tolist() == [0, 0, 0]


def test_gate_removal_gives_each_step_once(tmp_path, liggghts):
    """A new `run` sets the forces up anew and prints the step again (trap 10): the one before is kept."""
    s = gate_removal().replace(output={"frames_every": 1e-3})
    run = code.run(s, tmp_path)
    assert run.history["step"].tolist() == run.trace["step"].tolist() == list(range(0, 5001, 5))
    at = list(run.history["step"]).index(2000)
    assert np.abs(run.trace["force"][at, 0, 0]) < np.abs(
        run.trace["force"][at + 1, 0, 0]
    )  # the gate still held it
    assert run.trace["position"][-1, 0, 0] > 0.0021
    assert np.array_equal(run.frames[2]["force"], run.trace["force"][at])
    assert np.array_equal(run.frames[2]["id"], [1, 2])
    assert len(run.frames) == 6


def test_history_and_frames_only_when_asked(tmp_path, liggghts):
    run = code.run(two_spheres(output={"trace_every": None, "history_every": None}), tmp_path)
    assert run.trace is None
    assert run.history is None
    assert len(run.frames) == 2


@pytest.fixture
def raw(tmp_path, liggghts):
    """A run not yet converted."""
    s = two_spheres(output={"frames_every": 6e-4, "trace_every": 1e-5})
    execute(render(s), tmp_path, liggghts)
    return s, tmp_path


@pytest.mark.parametrize("harm", ["truncated", "corrupted", "empty", "missing"])
def test_broken_frame(raw, harm):
    s, directory = raw
    path = directory / RAW / "p_000000600.vtu"
    _harm(path, harm)
    with pytest.raises(LiggghtsOutputError, match=r"(?s)600.*") as error:
        dump.frames(s, directory)
    assert "p_000000600.vtu" in str(error.value)


@pytest.mark.parametrize("harm", ["truncated", "corrupted", "empty", "missing"])
def test_broken_trace(raw, harm):
    s, directory = raw
    _harm(directory / TRACE, harm)
    with pytest.raises(LiggghtsOutputError, match=r"trace.bin.*step") as error:
        dump.trace(s, directory / TRACE)
    assert "no such" in str(error.value) if harm == "missing" else "step" in str(error.value)


def _harm(path, harm: str) -> None:
    content = path.read_bytes()
    middle = len(content) // 2
    new = {
        "truncated": content[:middle],
        "corrupted": content[: middle - 40] + b"\xff" * 80 + content[middle + 40 :],
        "empty": b"",
    }
    path.unlink()
    if harm != "missing":
        path.write_bytes(new[harm])
