"""The folder of a run tells the truth: it holds one run, all of it, wherever it stands."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from gpudem import driver
from gpudem.driver import resume, simulate
from gpudem.errors import GpudemError, SceneError, SimulationError
from gpudem.output import directory
from gpudem.output.atomic import WriteError
from gpudem.output.restart import Restart
from gpudem.output.run import Run, Timing
from gpudem.scene import Scene
from tests.gpudem.beds import falling_bed

OUTPUT = {"frames_every": 1e-3, "trace_every": 1e-3, "history_every": 1e-3, "restart_every": 1e-3}


def scene(path: Path | None = None, output: dict | None = None, **changes) -> Scene:
    """Ten balls, from a file if one is given; 4 ms."""
    data = {"time": {"step": 2e-5, "duration": 4e-3}, "output": OUTPUT if output is None else output}
    if path is not None:
        data["particles"] = {"source": "file", "path": str(path), "material": "ball"}
    return falling_bed(10, **{**data, **changes})


def particle_file(path: Path, radius: float = 0.003) -> Path:
    x = np.arange(10.0)[:, None] * [0.009, 0, 0] + [0.005, 0.02, 0.004]
    np.savez(path, position=x, velocity=0.1 * np.cos(1000 * x), radius=np.full(10, radius))
    return path


def stopped(one: Scene, folder: Path, at: int = 100) -> None:
    """Interrupts a run after its restart file of step `at`."""

    class Stopping(Restart):
        def save(self, directory):
            super().save(directory)
            if self.step >= at:
                raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(driver, "Restart", Stopping)
        with pytest.raises(KeyboardInterrupt):
            simulate(one, folder)


# -- a second run in the same folder -------------------------------------------------------------------------


def test_nothing_of_an_older_run_is_left(tmp_path):
    """Catches a table, frame, wall or restart of the first run that passes for the second's."""
    simulate(scene(particle_file(tmp_path / "p.npz")), tmp_path / "run")
    for name in ("notes.txt", "frames/picture.png", "frames/p_old.vtu.bak"):
        (tmp_path / "run" / name).write_text("mine")
    second = scene(output={}, gravity=(0, 0, -1))
    simulate(second, tmp_path / "run")
    frames = {"frames/p_000000000.vtu", "frames/p_000000200.vtu", "frames/walls_0.vtu"}
    mine = {"notes.txt", "frames/picture.png", "frames/p_old.vtu.bak"}
    found = {str(p.relative_to(tmp_path / "run")) for p in (tmp_path / "run").rglob("*") if p.is_file()}
    assert found == {"scene.json", "run.json", "run.pvd"} | frames | mine
    loaded = Run.load(tmp_path / "run")
    assert loaded.scene == second
    assert loaded.trace is None
    assert loaded.history is None
    with pytest.raises(GpudemError, match=r"restart\.npz: no such file"):
        resume(tmp_path / "run")


def test_a_save_removes_the_tables_of_an_older_one(tmp_path):
    """Also where a code saves a run without starting one here."""
    one = scene()
    Run("x", "0", one, tmp_path, Timing(1, 1, 1.0), trace={"time": np.zeros(3)}).save()
    Run("x", "0", one, tmp_path, Timing(1, 1, 1.0)).save()
    assert not (tmp_path / "trace.npz").exists()
    assert Run.load(tmp_path).trace is None


def test_a_run_that_cannot_start_touches_nothing(tmp_path):
    """Catches a folder that is made, or an older run that is removed, before the device is found."""
    with pytest.raises(SimulationError, match="cuda:99"):
        simulate(scene(), tmp_path / "new", device="cuda:99")
    assert not (tmp_path / "new").exists()
    first = simulate(scene(), tmp_path / "old")
    with pytest.raises(SimulationError, match="cuda:99"):
        simulate(scene(gravity=(0, 0, -1)), tmp_path / "old", device="cuda:99")
    assert Run.load(tmp_path / "old").scene == first.scene


@pytest.mark.parametrize("below", ["", "run"])
def test_a_file_in_the_place_of_the_folder(below, tmp_path, monkeypatch):
    """Known before the solver is set up, which may take minutes."""
    monkeypatch.setattr(driver, "Solver", None)
    (tmp_path / "file").write_text("mine")
    with pytest.raises(WriteError, match="file is not a folder") as error:
        simulate(scene(), tmp_path / "file" / below)
    assert error.value.exit_code == 2
    assert (tmp_path / "file").read_text() == "mine"


# -- all that is needed is in the folder ---------------------------------------------------------------------


@pytest.mark.parametrize("what", ["gone", "changed", "moved"])
def test_a_run_needs_nothing_outside_its_folder(what, tmp_path):
    """Read and resumed from elsewhere, its particle file gone or of other balls: the balls that were run."""
    path, folder = particle_file(tmp_path / "p.npz"), tmp_path / "run"
    one = scene(path)
    whole = simulate(one, tmp_path / "whole")
    stopped(one, folder)
    if what == "changed":
        particle_file(path, radius=0.002)
    else:
        path.unlink()
    if what == "moved":
        folder = shutil.move(folder, tmp_path / "elsewhere")
    part = Run.load(folder)
    assert part.notes["interrupted_at_step"] == 100
    assert np.array_equal(part.scene.state.radius, np.full(10, 0.003))
    assert part.scene.hash == one.hash
    parts = resume(folder)
    assert whole.trace is not None
    assert parts.trace is not None
    assert np.array_equal(whole.trace["position"], parts.trace["position"])
    assert np.ptp(parts.trace["position"][:, :, 2], axis=0).max() > 1e-5
    again = Run.load(folder)
    assert again.notes["resumed_at_step"] == 100
    assert again.history is not None
    assert again.history.equals(whole.history)
    assert len(again.frames) == 5


@pytest.mark.parametrize("stated", [None, 0.002, 0.003])
def test_the_radius_that_was_run(stated, tmp_path):
    """A radius of the scene, of the file, or both: the folder gives the same state and hash."""
    columns = {"position": [[0.05, 0.02, 0.1], [0.06, 0.02, 0.1]]}
    if stated != 0.002:
        columns["radius"] = [0.003, 0.003]
    np.savez(tmp_path / "p.npz", **columns)
    particles = {"source": "file", "path": str(tmp_path / "p.npz"), "material": "ball", "radius": stated}
    one = scene(particles=particles)
    directory.begin(tmp_path / "run", one)
    (tmp_path / "p.npz").unlink()
    back = directory.load_scene(tmp_path / "run")
    assert back.hash == one.hash
    assert back.state.radius.tolist() == one.state.radius.tolist()


def test_the_materials_that_were_run(tmp_path):
    """Balls of two materials from one file: the folder gives each its own, without the file."""
    columns = {
        "position": [[0.05, 0.02, 0.1], [0.06, 0.02, 0.1]],
        "radius": [0.003, 0.002],
        "material": [1, 0],
    }
    np.savez(tmp_path / "p.npz", **columns)
    pairs = [{"materials": pair} for pair in (("ball", "ball"), ("ball", "wall"), ("wall", "wall"))]
    one = scene(particles={"source": "file", "path": str(tmp_path / "p.npz")}, pairs=pairs)
    directory.begin(tmp_path / "run", one)
    (tmp_path / "p.npz").unlink()
    back = directory.load_scene(tmp_path / "run")
    assert back.state.material.tolist() == [1, 0]
    assert back.hash == one.hash
    assert back == one


# -- hashes are compared -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def finished(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("finished")
    simulate(scene(particle_file(folder / "p.npz")), folder / "run")
    simulate(scene(particle_file(folder / "p.npz"), gravity=(0, 0, -1)), folder / "other")
    return folder


def test_parts_of_two_runs_are_refused(finished, tmp_path):
    """Every file that belongs to a scene, in the place of that of another run."""
    for name in ("scene.json", "run.json", "restart.npz"):
        folder = Path(shutil.copytree(finished / "run", tmp_path / name))
        shutil.copy(finished / "other" / name, folder / name)
        with pytest.raises(GpudemError, match="of another scene") as error:
            (resume if name == "restart.npz" else Run.load)(folder)
        assert ("restart.npz" if name == "restart.npz" else "run.json") in str(error.value)
    assert Run.load(folder).code == "gpudem", "the restart file is not needed for reading"


def test_changed_particles_are_refused(finished, tmp_path):
    folder = Path(shutil.copytree(finished / "run", tmp_path / "run"))
    with np.load(folder / "particles.npz") as data:
        columns = dict(data)
    columns["radius"] = np.nextafter(columns["radius"], 1)
    np.savez(folder / "particles.npz", **columns)
    for read in (Run.load, resume):
        with pytest.raises(GpudemError, match="of another scene"):
            read(folder)


@pytest.mark.parametrize("name", ["particles.npz", "history.csv", "trace.npz", "scene.json", "run.json"])
def test_a_missing_file_is_named(name, finished, tmp_path):
    """Not: a run without a trace, as if it had not been asked for."""
    folder = Path(shutil.copytree(finished / "run", tmp_path / "run"))
    (folder / name).unlink()
    with pytest.raises(GpudemError, match=name.replace(".", r"\.")):
        Run.load(folder)


def test_tables_come_back_to_the_last_bit(tmp_path):
    """Types too: a column of zeros is no column of whole numbers. And what is not a number."""
    import pandas

    table = pandas.DataFrame({"time": [0.0, 0.0], "n": [1, 2], "x": [np.nextafter(0.3, 1), np.nan]})
    Run("x", "0", scene(), tmp_path, Timing(1, 1, 1.0), history=table).save()
    back = Run.load(tmp_path).history
    assert back is not None
    assert back.equals(table)
    (tmp_path / "history.csv").write_text("time,n\n0,1\n")
    with pytest.raises(GpudemError, match=r"history\.csv: columns time, n; run\.json states time, n, x"):
        Run.load(tmp_path)


@pytest.mark.parametrize("facts", ["[]", "{}", '{"format": 1}', '{"format": 2}', "[" * 100_000, '"text"'])
def test_a_run_file_of_another_kind(facts, finished, tmp_path):
    folder = Path(shutil.copytree(finished / "run", tmp_path / "run"))
    (folder / "run.json").write_text(facts)
    with pytest.raises(GpudemError, match="not a complete run"):
        Run.load(folder)


def test_a_scene_with_problems_says_which(finished, tmp_path):
    folder = Path(shutil.copytree(finished / "run", tmp_path / "run"))
    data = json.loads((folder / "scene.json").read_text())
    (folder / "scene.json").write_text(json.dumps({**data, "gravity": 3}))
    with pytest.raises(SceneError, match=r"scene\.json: 1 problem\n  - gravity"):
        Run.load(folder)


# -- a resumed run -------------------------------------------------------------------------------------------


def test_frames_after_the_restart_are_removed_when_it_goes_on(tmp_path):
    """The list of frames is that of the steps done, also where run.pvd is missing."""
    stopped(scene(), tmp_path)
    late = tmp_path / "frames" / "p_000000150.vtu"
    late.write_text("of the run that was stopped later")
    (tmp_path / "run.pvd").unlink()

    def failing(simulation, saved, planes):
        assert not late.exists()
        assert len(Run("", "", simulation.scene, tmp_path, Timing(1, 1, 1.0)).frames) == 3
        raise SimulationError("no more")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(driver.Solver, "load_state_dict", failing)
        with pytest.raises(SimulationError, match="no more"):
            resume(tmp_path)
    assert len(resume(tmp_path).frames) == 5


def test_restarts_do_not_write_the_scene_again(tmp_path, monkeypatch):
    """1e5 particles as text at every restart would cost seconds."""
    calls, plain = [], Scene.to_json
    monkeypatch.setattr(Scene, "to_json", lambda self: calls.append(1) or plain(self))
    simulate(scene(output={"restart_every": 2e-4}), tmp_path)
    assert len(calls) <= 2


def test_results_that_cannot_be_saved_do_not_hide_why_the_run_failed(tmp_path, monkeypatch):
    def full(run):
        raise WriteError(tmp_path, OSError(28, "No space left on device"))

    def fails(*arguments, **options):
        raise SimulationError("particle 3 left the domain")

    monkeypatch.setattr(Run, "save", full)
    with monkeypatch.context() as patch:
        patch.setattr(driver, "_segments", fails)
        with pytest.raises(SimulationError, match="particle 3") as error:
            simulate(scene(), tmp_path)
    assert "No space left on device" in error.value.__notes__[0]
    with pytest.raises(WriteError, match="No space left on device"):
        simulate(scene(), tmp_path)
