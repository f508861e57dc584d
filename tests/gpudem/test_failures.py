"""What a run says when it goes wrong, and what is kept."""

import numpy as np
import pytest

from gpudem.driver import simulate as run
from gpudem.errors import GpudemError, SimulationError
from gpudem.event_driven.driver import run as run_events
from gpudem.output.frames import Frames, FrameWriter
from gpudem.output.run import Run
from gpudem.output.vtu import Frame
from tests.gpudem.beds import falling_bed
from tests.reference.scenes import FACING, scene


def escaping():
    """Leaves the 60 mm cube through x after 27 mm at 1 m/s."""
    return scene("escaping", [[0.003, 0, 0]], [[1.0, 0, 0]], steps=60000, output={"frames_every": 5e-3})


def test_lost_particle_is_named_with_time_and_frames_are_kept(tmp_path):
    with pytest.raises(SimulationError, match=r"particle 1 left the domain .* at t = 0\.027\d* s"):
        run(escaping(), tmp_path)
    assert len(Frames.open(tmp_path)) == 6
    kept = Run.load(tmp_path)
    assert "left the domain" in kept.notes["failed"]
    assert len(kept.trace["step"]) > 1000


def test_nan_is_found():
    """Two spheres at one place: no direction to push; waived overlap check, so the solver must say it."""
    coincident = scene(
        "coincident", [[0, 0, 0], [0, 0, 0]], [[0, 0, 0], [0, 0, 0]], steps=100, allow=["overlap"]
    )
    with pytest.raises(SimulationError, match=r"particle \d .*not a number \(NaN\) at t = "):
        run(coincident)


def test_unknown_device():
    with pytest.raises(SimulationError, match=r"device = 'cuda:7': not here; found: cpu"):
        run(scene("two", **FACING, steps=10), device="cuda:7")


def test_directory_that_cannot_be_made(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(GpudemError, match="cannot be written"):
        run(scene("two", **FACING, steps=10), tmp_path / "file" / "inside")


@pytest.mark.parametrize("code", [run, run_events], ids=["time_stepping", "event_driven"])
@pytest.mark.parametrize("good", [1, 10])
def test_a_frame_that_cannot_be_written(tmp_path, monkeypatch, code, good):
    """Disk full at a frame in the middle, or at the last: catches an error lost in the thread that writes."""
    off = {"tangential": "off"}
    bed = scene("two", **FACING, steps=1000, output={"frames_every": 1e-4}, contact=off)
    write, frames = FrameWriter.add, []

    def add(self: FrameWriter, step: int, frame: Frame) -> None:
        frames.append(step)
        if len(frames) > good:
            raise OSError(28, "No space left on device")
        write(self, step, frame)

    monkeypatch.setattr(FrameWriter, "add", add)
    with pytest.raises(OSError, match="No space left"):
        code(bed, tmp_path)
    kept = Run.load(tmp_path)
    assert "No space left" in kept.notes["failed"]
    assert len(kept.frames) == good
    assert len(frames) == good + 1


def test_interrupt_keeps_what_there_is(tmp_path):
    """Ctrl-C in the middle: KeyboardInterrupt goes on, the run so far is on disk."""
    bed = falling_bed(2500, output={"frames_every": 0.002, "history_every": 0.001})

    def interrupt(step: int) -> None:
        if step > 100:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(bed, tmp_path, progress=interrupt)
    kept = Run.load(tmp_path)
    assert 100 < kept.notes["interrupted_at_step"] < 2000
    assert len(kept.frames) >= 1
    assert np.isfinite(kept.frames[-1]["position"]).all()
    assert len(kept.history) >= 1
