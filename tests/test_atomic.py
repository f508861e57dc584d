"""Files are whole or absent under their names, whatever happens while they are written."""

from __future__ import annotations

import contextlib
import errno
import pickle
import resource
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from gpudem.driver import simulate
from gpudem.output import atomic, directory, vtu
from gpudem.output.atomic import WriteError
from gpudem.output.restart import Restart
from gpudem.output.run import Run, Timing
from tests.gpudem.beds import falling_bed

SCENE = falling_bed(50)
#: Larger than any limit below, so that a write stops in the middle.
NUMBERS = np.arange(3000.0).reshape(-1, 3)


@contextlib.contextmanager
def disk_full(size: int = 512) -> Iterator[None]:
    """No file of this process may grow beyond `size` bytes: a write stops in the middle with an OSError."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def _history(folder: Path) -> None:
    import pandas

    table = pandas.DataFrame({"time": NUMBERS[:, 0]})
    Run("gpudem", "0", SCENE, folder, Timing(1, 1, 1.0), history=table).save()


def _run(folder: Path) -> None:
    Run("gpudem", "0", SCENE, folder, Timing(1, 1, 1.0), notes={"long": "x" * 5000}).save()


WRITERS = {
    "text": lambda folder: atomic.write_text(folder / "a.txt", "x" * 5000),
    "npz": lambda folder: atomic.write_npz(folder / "a.npz", {"x": NUMBERS}),
    "vtu": lambda folder: vtu.write_vtu(folder / "a.vtu", {"position": NUMBERS}),
    "pvd": lambda folder: vtu.write_pvd(folder / "a.pvd", [(float(k), 0, "a.vtu") for k in range(100)]),
    "scene": lambda folder: directory.save_scene(folder, SCENE),
    "history": _history,
    "run.json": _run,
    "restart": lambda folder: Restart(SCENE, 1, {"now": NUMBERS}, {}, {}).save(folder),
}


def files(folder: Path) -> dict[str, bytes]:
    return {p.name: p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.mark.parametrize("write", WRITERS.values(), ids=WRITERS)
def test_disk_full_in_the_middle(write, tmp_path):
    """One error that names the file, no part of it and no temporary one. Catches a writer of its own."""
    with (
        disk_full(),
        pytest.raises(WriteError, match=f"{tmp_path}/.*: cannot be written: File too large") as e,
    ):
        write(tmp_path)
    assert e.value.exit_code == 3
    for name, content in files(tmp_path).items():  # what was written before the one that failed is whole
        assert name == "scene.json"
        assert content == SCENE.to_json().encode()


def test_the_old_file_stays(tmp_path):
    path = tmp_path / "a.txt"
    atomic.write_text(path, "old")
    with disk_full(), pytest.raises(WriteError):
        atomic.write_text(path, "x" * 5000)
    assert files(tmp_path) == {"a.txt": b"old"}


def test_an_interrupt_leaves_the_old_file(tmp_path):
    atomic.write_text(tmp_path / "a", "old")

    def stopped() -> None:
        with atomic.replacing(tmp_path / "a") as partial:
            partial.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stopped()
    assert files(tmp_path) == {"a": b"old"}


def test_every_file_of_a_run_is_renamed_into_place(tmp_path, monkeypatch):
    """Catches any file that is opened under its final name: a kill at that moment would leave half of it."""
    written, replace = set(), Path.replace

    def note(path, target):
        written.add(Path(target))
        return replace(path, target)

    monkeypatch.setattr(Path, "replace", note)
    output = {"frames_every": 0.002, "trace_every": 1e-3, "history_every": 1e-3, "restart_every": 1e-3}
    np.savez(tmp_path / "p.npz", position=[[0.05, 0.02, 0.1]], radius=[0.003])
    particles = {"source": "file", "path": str(tmp_path / "p.npz"), "material": "ball"}
    time = {"step": 2e-5, "duration": 4e-3}
    simulate(falling_bed(particles=particles, time=time, output=output), tmp_path / "run")
    found = {p for p in (tmp_path / "run").rglob("*") if p.is_file()}
    assert found == written
    names = {p.name for p in found}
    assert {"scene.json", "particles.npz", "run.json", "run.pvd", "history.csv", "trace.npz"} <= names
    assert {"restart.npz", "p_000000000.vtu", "walls_0.vtu"} <= names


def test_temporary_files_of_a_killed_run_are_removed_at_the_next_start(tmp_path):
    (tmp_path / "frames").mkdir()
    for name in (".trace.npz.part", "frames/.p_000000100.vtu.part", "mine.part", ".hidden"):
        (tmp_path / name).write_text("half")
    directory.begin(tmp_path, SCENE)
    assert set(files(tmp_path)) == {"scene.json", "mine.part", ".hidden"}
    (tmp_path / ".restart.npz.part").write_text("half")
    directory.begin_again(tmp_path, 0)
    assert set(files(tmp_path)) == {"scene.json", "mine.part", ".hidden"}


def test_who_is_to_blame_decides_the_exit_code():
    """Permissions are the user's (2), a full disk is the machine's (3); both survive a process pool."""
    for number, code in ((errno.EACCES, 2), (errno.ENOSPC, 3), (errno.EDQUOT, 3), (errno.ENOTDIR, 2)):
        error = pickle.loads(pickle.dumps(WriteError(Path("a"), OSError(number, "no"))))
        assert error.exit_code == code
        assert str(error) == "a: cannot be written: no"
