"""The folder of a run holds one run, whichever code made it."""

import numpy as np
import pytest

import gpudem
from gpudem.errors import GpudemError
from gpudem.output.run import Run
from reference import liggghts as code
from tests.reference.scenes import two_spheres


@pytest.mark.liggghts
def test_liggghts_after_gpudem_in_one_folder(tmp_path, liggghts):
    """Catches a restart or table of the first code that passes for the second's; the scene's columns only."""
    every = {"history_every": 1e-4, "restart_every": 1e-4, "trace_every": 1e-4}
    first = two_spheres().replace(output=every)
    gpudem.simulate(first, tmp_path)
    chosen = {"restart_every": None, "trace_every": None, "history": ("contacts", "momentum_x", "centre_x")}
    second = first.replace(output=chosen)
    run = code.run(second, tmp_path)
    assert run.history is not None
    assert list(run.history) == ["step", "time", "contacts", "centre_x"]
    assert "history column 'momentum_x' is left out: LIGGGHTS does not compute it" in run.warnings
    loaded = Run.load(tmp_path)
    assert loaded.code == "liggghts"
    assert loaded.trace is None
    assert loaded.scene == second
    with pytest.raises(GpudemError, match=r"restart\.npz: no such file"):
        gpudem.resume(tmp_path)


@pytest.mark.liggghts
def test_a_run_of_liggghts_is_whole(tmp_path, liggghts):
    """From a particle file that is gone afterwards, in a folder that is moved."""
    state = two_spheres().state
    np.savez(tmp_path / "p.npz", position=state.position, velocity=state.velocity, radius=state.radius)
    material = next(iter(two_spheres().materials))
    particles = {"source": "file", "path": str(tmp_path / "p.npz"), "material": material}
    one = two_spheres().replace(particles=particles)
    code.run(one, tmp_path / "run")
    (tmp_path / "p.npz").unlink()
    moved = (tmp_path / "run").rename(tmp_path / "moved")
    back = Run.load(moved)
    assert back.scene.hash == one.hash
    assert np.array_equal(back.scene.state.velocity, state.velocity)
    assert len(back.frames) > 0
