"""What a user can cause ends in one line with exit code 2 or 3, and what is on disk stays whole.

Each catches a traceback, an exit code 1 (that of a failed check), or a folder that is left half made.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from comparisons import cli
from comparisons.harness import codes, provenance
from gpudem.errors import GpudemError
from tests.comparisons.test_cli import ROOT, SCENE
from tests.test_atomic import disk_full

pytestmark = pytest.mark.long

OUTPUT = "[output]\nframes_every = 1e-4\nhistory_every = 1e-4\nrestart_every = 1e-4\n"


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(SCENE + OUTPUT)
    return tmp_path


def one_line(err: str, *words: str) -> None:
    assert "Traceback" not in err
    lines = [line for line in err.splitlines() if line.startswith("error: ")]
    assert len(lines) == 1, err
    for word in words:
        assert word in lines[0]


def command(*arguments: str, **options) -> subprocess.Popen:
    """The real command, in a process of its own."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **options.pop("env", {})}
    return subprocess.Popen(
        [sys.executable, "-m", "comparisons", *arguments],
        stderr=subprocess.PIPE, text=True, env=environment, **options,
    )  # fmt: skip


# -- an output that takes nothing ----------------------------------------------------------------------------


@pytest.mark.parametrize("arguments", [["deck", "scene.toml"], ["run", "--help"]], ids=["output", "help"])
def test_closed_pipe(here, arguments):
    """`gpudem deck scene.toml | head -1`."""
    read, write = os.pipe()
    os.close(read)
    process = command(*arguments, stdout=write, cwd=here)
    os.close(write)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 3
    one_line(err, "the output was closed")
    assert "Exception ignored" not in err


def test_everything_closed(here):
    """`gpudem deck scene.toml 2>&1 | true`: nowhere to say it, and still no exit code 0, 1 or 120."""
    read, write = os.pipe()
    os.close(read)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-m", "comparisons", "deck", "scene.toml"],
        cwd=here, stdout=write, stderr=write, env=environment, timeout=60, check=False,
    )  # fmt: skip
    os.close(write)
    assert done.returncode == 3


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
def test_full_device(here):
    with open("/dev/full", "w") as full:
        process = command("deck", "scene.toml", stdout=full, cwd=here)
        _, err = process.communicate(timeout=60)
    assert process.returncode == 3
    one_line(err, "No space left on device")


def test_closed_log_does_not_end_a_run():
    """Progress into a pipe whose reader has gone: a long run goes on without it."""
    from comparisons.harness.progress import Plain

    read, write = os.pipe()
    os.close(read)
    stream = os.fdopen(write, "w")
    reporter = Plain(stream, every=0.0)
    pace = reporter.begin("drop", 1, 100)
    for step in range(3):
        reporter.step(pace, step)
    reporter.close()
    with pytest.raises(BrokenPipeError):
        stream.close()


# -- disk full -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [200, 3000, 20_000])
def test_disk_full(here, capsys, size):
    """At the scene, at a frame, at a table: exit code 3, and every file that is there is whole."""
    long = SCENE.replace("[[0.05, 0.05, 0.05]]", str([[0.05, 0.05, 0.006 + 0.011 * k] for k in range(8)]))
    (here / "scene.toml").write_text(long + OUTPUT + "trace_every = 2e-5\n")
    with disk_full(size):
        code = cli.main(["run", "scene.toml", "-q", "--out", "r"])
    assert code == 3
    one_line(capsys.readouterr().err, "cannot be written: File too large")
    found = [p for p in (here / "r").rglob("*") if p.is_file()] if (here / "r").exists() else []
    assert not [p for p in found if p.name.endswith(".part")]
    for path in found:
        if path.suffix == ".json":
            json.loads(path.read_text())
    assert (size == 200) == (not found), "a folder in which nothing could be written is not left behind"


# -- no place for kernels ------------------------------------------------------------------------------------


@pytest.mark.parametrize("code", ["gpudem", "event_driven"])
def test_no_place_for_kernels(here, code):
    """No folder is left that would block the second run, with a place for kernels."""
    (here / "scene.toml").write_text(SCENE)
    (here / "file").write_text("")
    env = {"WARP_CACHE_PATH": str(here / "file" / "cache")}
    process = command("run", "scene.toml", "-q", "--code", code, "--out", "r", cwd=here, env=env)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 3
    one_line(err, str(here / "file" / "cache"), "WARP_CACHE_PATH")
    assert not (here / "r").exists()


def test_no_place_for_kernels_when_hardware_is_listed(monkeypatch):
    import warp

    def fails():
        raise PermissionError(13, "Permission denied", "/root/.cache/warp")

    monkeypatch.setattr(warp, "init", fails)
    assert cli.main(["info"]) == 3


# -- folders and devices -------------------------------------------------------------------------------------

BAD = {
    "device": (["run", "scene.toml", "--device", "cuda:42", "--out", "r"], 3, "cuda:42"),
    "a file": (["run", "scene.toml", "--out", "scene.toml"], 2, "scene.toml: cannot write there"),
    "below a file": (["run", "scene.toml", "--out", "scene.toml/r"], 2, "cannot write there"),
    "no such place": (["run", "scene.toml", "--out", "/proc/nobody/r"], 2, "cannot write there"),
    "compare": (["compare", "--out", "/proc/nobody/r"], 2, "cannot write there"),
    "resume a file": (["resume", "scene.toml"], 2, "no such file"),
    "report of a file": (["report", "scene.toml"], 2, "scene.toml: results.json is missing"),
    "scene is a folder": (["deck", "."], 2, ""),
    "animate nothing": (["animate", "."], 2, "scene.json"),
}


@pytest.mark.parametrize(("arguments", "code", "message"), BAD.values(), ids=BAD)
def test_folders_and_devices(here, capsys, arguments, code, message):
    assert cli.main([*arguments]) == code
    err = capsys.readouterr().err
    assert message in err
    assert "Traceback" not in err
    assert sorted(p.name for p in here.iterdir()) == ["scene.toml"], "nothing half made is left"


def test_a_failed_run_leaves_no_empty_folder_and_no_link(here, capsys, monkeypatch):
    def run(*arguments):
        raise GpudemError("not this scene")

    monkeypatch.setitem(codes.CODES, "gpudem", codes.Code("gpudem", "gpudem", run))
    assert cli.main(["run", "scene.toml", "-q"]) == 3
    assert list((here / "runs").iterdir()) == []
    (here / "mine").mkdir()
    assert cli.main(["run", "scene.toml", "-q", "--out", "mine"]) == 3
    assert (here / "mine").is_dir(), "a folder that the user has made stays"


def test_no_permission(here, capsys, monkeypatch):
    """Root may write anywhere, so the answer of the system is put in its place."""
    access = os.access
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path).is_file() and access(path, mode))
    assert cli.main(["run", "scene.toml", "-q", "--out", "r"]) == 3
    one_line(capsys.readouterr().err, "r: cannot be written: Permission denied")


def test_not_enough_memory(here, capsys, monkeypatch):
    def run(*arguments):
        raise MemoryError("Unable to allocate 3 TiB")

    monkeypatch.setitem(codes.CODES, "gpudem", codes.Code("gpudem", "gpudem", run))
    assert cli.main(["run", "scene.toml", "-q", "--out", "r"]) == 3
    one_line(capsys.readouterr().err, "not enough memory: Unable to allocate 3 TiB")


# -- stopped -------------------------------------------------------------------------------------------------


def wait_for(path: Path, process: subprocess.Popen) -> None:
    for _ in range(600):
        if path.is_file():
            return
        assert process.poll() is None, process.communicate()
        time.sleep(0.05)
    raise AssertionError(f"no {path}")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGHUP])
def test_a_stopped_run_is_whole_and_says_how_to_continue(here, number):
    """The background's ignored SIGINT is given back to the child: what a terminal would give it."""
    (here / "scene.toml").write_text(SCENE.replace("duration = 0.001", "duration = 100.0") + OUTPUT)
    process = command(
        "run", "scene.toml", "-q", "--out", "r", cwd=here,
        preexec_fn=lambda: [signal.signal(n, signal.SIG_DFL) for n in (signal.SIGINT, signal.SIGHUP)],
    )  # fmt: skip
    wait_for(here / "r" / "restart.npz", process)
    process.send_signal(number)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in err
    assert "continue with: gpudem resume r" in err
    notes = json.loads((here / "r" / "run.json").read_text())["notes"]
    assert notes["interrupted_at_step"] >= 10
    assert f"interrupted at step {notes['interrupted_at_step']};" in err
    assert not list((here / "r").rglob(".*.part"))


def test_in_the_background_sigint_is_not_for_us_and_sigterm_is(here):
    """As the shell has it: `gpudem run ... &` goes on when the terminal's Ctrl-C ends something else."""
    (here / "scene.toml").write_text(SCENE.replace("duration = 0.001", "duration = 100.0") + OUTPUT)
    process = command(
        "run", "scene.toml", "-q", "--out", "r", cwd=here,
        preexec_fn=lambda: [signal.signal(n, signal.SIG_IGN) for n in (signal.SIGINT, signal.SIGHUP)],
    )  # fmt: skip
    wait_for(here / "r" / "restart.npz", process)
    process.send_signal(signal.SIGINT)
    process.send_signal(signal.SIGHUP)
    time.sleep(0.3)
    (here / "r" / "restart.npz").unlink()
    wait_for(here / "r" / "restart.npz", process)  # it still advances
    process.send_signal(signal.SIGTERM)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "interrupted at step" in err


def test_signal_handlers_are_those_of_before(here, capsys):
    """A program that calls `main` keeps its own; a thread, which may not set any, can call it too."""
    before = [signal.getsignal(n) for n in cli.STOPS]
    assert cli.main(["cases"]) == 0
    assert [signal.getsignal(n) for n in cli.STOPS] == before
    found = []
    thread = threading.Thread(target=lambda: found.append(cli.main(["cases"])))
    thread.start()
    thread.join()
    assert found == [0]


# -- where it comes from -------------------------------------------------------------------------------------


def git(folder: Path, *arguments: str) -> str:
    identity = ["-c", "user.name=t", "-c", "user.email=t@t", "-c", "commit.gpgsign=false"]
    done = subprocess.run(
        ["git", "-C", str(folder), *identity, *arguments], capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


def test_commit_of_a_package_within_another_repository(tmp_path, monkeypatch):
    """In a virtual environment of somebody's project: not that project's commit."""
    git(tmp_path, "init", "-q")
    package = tmp_path / "venv" / "lib" / "comparisons" / "harness"
    package.mkdir(parents=True)
    (package / "provenance.py").write_text("")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-qm", "theirs")
    monkeypatch.setattr(provenance, "__file__", str(package / "provenance.py"))
    assert provenance.commit() == ("unknown", False)
    monkeypatch.setenv("GIT_DIR", str(tmp_path / ".git"))
    monkeypatch.setenv("GIT_WORK_TREE", str(package.parent))
    assert provenance.commit() == ("unknown", False), "nor what a git hook's environment says"


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """checkout(folder, **files): a repository with a tree of the project in it, whose commit is asked for."""

    def make(folder: Path, project: str = "gpudem", tracked: bool = True) -> str:
        harness = folder / "comparisons" / "harness"
        harness.mkdir(parents=True)
        git(folder, "init", "-q")
        (folder / "pyproject.toml").write_text(f'[project]\nname = "{project}"\n' if project else "")
        (harness / "provenance.py").write_text("")
        git(folder, "add", "." if tracked else "pyproject.toml")
        git(folder, "commit", "-qm", "a tree")
        monkeypatch.setattr(provenance, "__file__", str(harness / "provenance.py"))
        return git(folder, "rev-parse", "--short", "HEAD")

    return make


def test_commit_of_a_checkout(tmp_path, checkout, monkeypatch):
    short = checkout(tmp_path)
    monkeypatch.setenv("GIT_DIR", "/nowhere")
    monkeypatch.setenv("GIT_COMMON_DIR", "/nowhere")
    assert provenance.commit() == (short, False)
    (tmp_path / "comparisons" / "harness" / "provenance.py").write_text("changed")
    assert provenance.commit() == (short, True)


@pytest.mark.parametrize(
    ("project", "tracked"),
    [("theirs", True), ("", True), ("gpudem", False)],
    ids=["copied into their tree", "no project", "installed into the root"],
)
def test_commit_of_a_tree_at_the_root_of_another_repository(tmp_path, checkout, project, tracked):
    """Copied, or installed by `pip install --target .`: the commit there is not that of the package."""
    checkout(tmp_path, project, tracked)
    assert provenance.commit() == ("unknown", False)


def test_commit_of_a_worktree_and_of_a_submodule(tmp_path, checkout, monkeypatch):
    """Their own commit, not that of the main tree or of the repository around."""
    first = checkout(tmp_path / "main")
    git(tmp_path / "main", "worktree", "add", "-q", str(tmp_path / "other"), "-b", "other")
    git(tmp_path / "main", "commit", "-q", "--allow-empty", "-m", "later")
    file = tmp_path / "other" / "comparisons" / "harness" / "provenance.py"
    monkeypatch.setattr(provenance, "__file__", str(file))
    assert provenance.commit() == (first, False)

    around = tmp_path / "around"
    around.mkdir()
    git(around, "init", "-q")
    add = ("-c", "protocol.file.allow=always", "submodule", "add", "-q", str(tmp_path / "main"), "gpudem")
    git(around, *add)
    git(around, "commit", "-qm", "theirs")
    file = around / "gpudem" / "comparisons" / "harness" / "provenance.py"
    monkeypatch.setattr(provenance, "__file__", str(file))
    assert provenance.commit() == (git(tmp_path / "main", "rev-parse", "--short", "HEAD"), False)
