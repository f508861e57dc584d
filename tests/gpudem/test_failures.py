"""What a run says when it goes wrong, and what is kept."""

import numpy as np
import pytest

from gpudem.driver import simulate as run
from gpudem.errors import GpudemError, SimulationError
from gpudem.event_driven.driver import run as run_events
from gpudem.output.frames import Frames, FrameWriter
from gpudem.output.run import Run
from gpudem.output.vtu import Frame
from gpudem.scene import Scene
from gpudem.solver.solver import Solver
from tests.gpudem.beds import MATERIALS, PAIRS, falling_bed, finish
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

    def add(self: FrameWriter, step: int, frame: Frame, *more: object) -> None:
        frames.append(step)
        if len(frames) > good:
            raise OSError(28, "No space left on device")
        write(self, step, frame, *more)

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
    bed = bed.replace(
        time={"duration": 10 * bed.time.duration}
    )  # a fast machine reports few steps of a short run

    def interrupt(step: int) -> None:
        if step > 100:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(bed, tmp_path, progress=interrupt)
    kept = Run.load(tmp_path)
    assert 100 < kept.notes["interrupted_at_step"] < bed.n_steps
    assert len(kept.frames) >= 1
    assert np.isfinite(kept.frames[-1]["position"]).all()
    assert len(kept.history) >= 1


@pytest.mark.parametrize("threads", [1, 2])
def test_of_several_lost_particles_the_first_is_named(threads, monkeypatch):
    """Two that leave in one step, of other slices: catches a message of parts of both, or of the last one."""
    monkeypatch.setattr("gpudem.solver.solver.block_size", lambda n, layers: 50)
    x, v, rows = np.full((200, 3), 0.05), np.zeros((200, 3)), np.array([20, 180])
    x[:, 2] += 0.01 * np.arange(200)
    v[rows, 0] = -50.0
    scene = falling_bed(
        walls=(), gravity=(0, 0, 0), time={"step": 2e-5, "duration": 0.1},
        particles={"source": "explicit", "material": "ball", "radius": 0.003, "position": x, "velocity": v},
        domain={"lo": (0, 0, 0), "hi": (0.1, 0.1, 2.1)},
    )  # fmt: skip
    with pytest.raises(SimulationError, match=f"^particle {rows.min() + 1} left the domain"):
        finish(Solver(scene, threads=threads))


def test_a_centre_on_the_far_side_of_a_wall_stays_finite():
    """Rolling at a wall divides by the gap: catches an infinite or reversed spin where guards are waived."""
    scene = Scene(
        name="deep", materials=MATERIALS, pairs=[{**p, "rolling_friction": 0.1} for p in PAIRS],
        contact={"rolling": "epsd2"}, allow=["overlap", "large_overlap", "time_step"],
        particles={"source": "explicit", "material": "ball", "radius": 0.003,
                   "position": [[0, 0, 0.0], [0.02, 0, -1e-4]], "angular_velocity": [[1.0, 0, 0]] * 2},
        walls=[
            {"kind": "plane", "name": "floor", "material": "wall", "point": (0, 0, 0), "normal": (0, 0, 1)}
        ],
        domain={"lo": (-0.1, -0.1, -0.1), "hi": (0.1, 0.1, 0.1)}, time={"step": 1e-6, "duration": 2e-6},
    )  # fmt: skip
    frame = finish(Solver(scene))
    assert np.isfinite(frame["torque"]).all()
    assert (np.abs(frame["force"][:, 2]) > 0).all()
