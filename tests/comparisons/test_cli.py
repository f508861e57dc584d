import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from comparisons import cli
from comparisons.harness import discover
from gpudem import driver
from tests.comparisons import fake

ROOT = Path(__file__).parent.parent.parent

SCENE = """
name = "drop"
gravity = [0, 0, -9.81]
walls = [{ kind = "plane", name = "floor", material = "glass", point = [0, 0, 0], normal = [0, 0, 1] }]
pairs = [{ materials = ["glass", "glass"], restitution = 0.9 }]
domain = { lo = [0, 0, 0], hi = [0.1, 0.1, 0.1] }
time = { step = 1e-5, duration = 0.001 }
[materials.glass]
young = 1e7
poisson = 0.25
density = 2500
[particles]
source = "explicit"
position = [[0.05, 0.05, 0.05]]
radius = 0.005
material = "glass"
"""


@pytest.fixture
def here(tmp_path, monkeypatch, fake_codes):
    """An empty folder with a scene, fake codes and one fake case."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("GPUDEM_NO_RENDER", "1")
    (tmp_path / "scene.toml").write_text(SCENE)
    monkeypatch.setattr(discover, "find_cases", lambda: [fake.case()])
    return tmp_path


def test_compare_writes_and_says_where(here, capsys):
    assert cli.main(["compare", "-q"]) == 0
    out = capsys.readouterr().out.splitlines()
    assert out[0].startswith("4 pass, 0 fail, 0 error, 0 left out in ")
    assert (here / out[1]).is_file()
    assert (here / "runs" / "latest" / "results.json").is_file()


def test_exit_codes(here, monkeypatch, fake_codes, capsys):
    monkeypatch.setattr(discover, "find_cases", lambda: [fake.case(tolerance=1e-12)])
    assert cli.main(["compare", "-q", "--codes", "gpudem"]) == 1
    fake_codes(gpudem={"fails": "the device is gone"})
    assert cli.main(["compare", "--out", "new"]) == 3
    assert "ERROR gpudem on throw dt_4e-05: the device is gone" in capsys.readouterr().err


def test_report_is_rebuilt(here, capsys):
    cli.main(["compare", "-q", "--out", "c"])
    (here / "c" / "report.html").unlink()
    assert cli.main(["report", "c"]) == 0
    assert (here / "c" / "report.html").is_file()


def test_run_reports_speed_and_where(here, capsys, monkeypatch):
    from comparisons.harness import codes

    def run(scene, directory, options, progress, extra):
        from gpudem.output.run import Run, Timing

        progress(scene.n_steps)
        return Run("gpudem", "0", scene, directory, Timing(1, scene.n_steps, 1e-4), warnings=["watch out"])

    monkeypatch.setitem(codes.CODES, "gpudem", codes.Code("gpudem", "gpudem", run))
    assert cli.main(["run", "scene.toml", "--out", "r"]) == 0
    out, err = capsys.readouterr()
    assert "100 steps of 1 particles in 0.0001 s: 1 M particle-steps/s on cpu" in out
    assert "warning: watch out" in err
    assert json.loads((here / "r" / "scene.json").read_text())["name"] == "drop"


def test_run_interrupted(here, capsys, monkeypatch):
    from comparisons.harness import codes

    def run(scene, directory, options, progress, extra):
        progress(7)
        raise KeyboardInterrupt

    monkeypatch.setitem(codes.CODES, "gpudem", codes.Code("gpudem", "gpudem", run))
    assert cli.main(["run", "scene.toml", "-q", "--out", "r"]) == 130
    assert capsys.readouterr().err == "interrupted at step 7\n"
    assert not (here / "r").exists(), "nothing was written: the folder does not block the next run"


def test_interrupted_and_resumed(tmp_path, capsys, monkeypatch):
    """Ctrl-C says how to go on; the end is that of a run in one."""
    from gpudem.output.run import Run

    monkeypatch.chdir(tmp_path)
    stated = SCENE + "[output]\nhistory_every = 1e-5\nrestart_every = 1e-5\n"
    (tmp_path / "scene.toml").write_text(stated)
    assert cli.main(["run", "scene.toml", "-q", "--out", "whole"]) == 0

    class Interrupted(driver.Restart):
        def save(self, directory):
            super().save(directory)
            if self.step >= 50:
                raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(driver, "Restart", Interrupted)
        assert cli.main(["run", "scene.toml", "-q", "--out", "r"]) == 130
    assert "continue with: gpudem resume r" in capsys.readouterr().err
    assert cli.main(["resume", "r", "-q"]) == 0
    out, err = capsys.readouterr()
    assert "from step 50" in err
    assert "100 steps of 1 particles" in out
    whole, parts = Run.load(tmp_path / "whole").history, Run.load(tmp_path / "r").history
    assert whole is not None
    assert whole.equals(parts)
    assert cli.main(["resume", "nowhere", "-q"]) == 2
    assert "restart.npz: no such file" in capsys.readouterr().err


def test_run_that_fails_is_exit_3(here, capsys, fake_codes):
    fake_codes(gpudem={"fails": "particle 3 left the domain"})
    assert cli.main(["run", "scene.toml", "-q"]) == 3
    assert "gpudem could not run scene.toml: particle 3 left the domain" in capsys.readouterr().err


def test_validate_says_what_a_scene_amounts_to(here, capsys):
    assert cli.main(["validate", "scene.toml"]) == 0
    out = capsys.readouterr().out
    for text in ("scene.toml: valid", "Rayleigh", "gravity", "steps", "frames"):
        assert text in out


def test_cases_are_listed(here, capsys):
    assert cli.main(["cases"]) == 0
    assert capsys.readouterr().out == "throw    4 checks  Balls thrown upwards\n"


BAD = {
    "unknown case": (["compare", "thro"], "no case 'thro'; did you mean 'throw'?"),
    "unknown code": (
        ["compare", "--codes", "gpudem,yade"],
        "--codes: no code 'yade'; known: gpudem, liggghts",
    ),
    "no code": (["compare", "--codes", ","], "known: gpudem, liggghts"),
    "unknown tier": (["compare", "--tier", "huge"], "'huge' is not one of"),
    "ranks 0": (["compare", "--ranks", "0"], "0 is not in the range x>=1"),
    "threads a word": (["run", "scene.toml", "--threads", "many"], "'many' is not a valid integer"),
    "precision": (["run", "scene.toml", "--precision", "float16"], "'float16' is not one of"),
    "folder not empty": (["compare", "--out", "."], "not empty; runs never overwrite"),
    "folder is a file": (["compare", "--out", "scene.toml"], "scene.toml: cannot write there"),
    "no such scene": (["validate", "gone.toml"], "gone.toml"),
    "no such results": (["report", "gone"], "gone: results.json is missing"),
    "no such command": (["simulate"], "No such command 'simulate'"),
    "no scene": (["run"], "Missing argument 'SCENE'"),
}


@pytest.mark.parametrize(("arguments", "message"), BAD.values(), ids=BAD)
def test_bad_input_is_exit_2_with_a_message_and_no_traceback(here, capsys, arguments, message):
    assert cli.main(arguments) == 2
    err = capsys.readouterr().err
    assert message in err
    assert "Traceback" not in err


def test_a_wrong_scene_lists_its_problems_as_they_are(here, capsys):
    (here / "scene.toml").write_text(SCENE.replace("radius = 0.005", "radius = -1").replace("young", "yuong"))
    assert cli.main(["run", "scene.toml"]) == 2
    err = capsys.readouterr().err
    assert err.startswith("scene.toml: ")
    assert "particles.radius" in err
    assert "young" in err
    assert not (here / "runs").exists()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupting_the_command_keeps_the_results(tmp_path, number):
    """The real command in a process of its own, stopped while a code runs."""
    program = f"""
import signal, sys, time; sys.path.insert(0, {str(ROOT)!r})
signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where the tests run in the background
from comparisons import cli
from comparisons.harness import codes, discover
from tests.comparisons import fake
def run(scene, directory, options, progress, extra):
    print("running", flush=True); time.sleep(60)
made = fake.codes()
codes.CODES["gpudem"] = made["gpudem"]
codes.CODES["liggghts"] = codes.Code("liggghts", "LIGGGHTS", run)
discover.find_cases = lambda: [fake.case()]
sys.exit(cli.main(["compare", "--out", "c", "-q"]))
"""
    process = subprocess.Popen(
        [sys.executable, "-c", program],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "GPUDEM_NO_RENDER": "1"},
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "running\n"
    time.sleep(0.2)
    process.send_signal(number)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "interrupted: what was done so far is in the report" in err
    stored = json.loads((tmp_path / "c" / "results.json").read_text())
    assert stored["state"] == "interrupted"
    assert [r["code"] for r in stored["runs"]] == ["gpudem"]
    assert (tmp_path / "c" / "report.html").is_file()


def test_progress_of_a_resumed_run_counts_from_its_restart(tmp_path, capsys, monkeypatch):
    """Rate and time left are those of the steps done now; the last line counts all steps and their time."""
    from comparisons.harness import progress
    from gpudem.output.restart import Restart

    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(SCENE + "[output]\nrestart_every = 5e-4\n")
    assert cli.main(["run", "scene.toml", "-q", "--out", "r"]) == 0
    first = Restart.load(tmp_path / "r")
    assert first.step == 50
    seen, clock = [], iter(range(1000))

    class Watching(progress.Reporter):
        def begin(self, what, particles, steps):
            return progress.Pace(what, particles, steps, clock=lambda: float(next(clock)))

        def step(self, pace, done):
            super().step(pace, done)
            seen.append((done, pace.rate))

    class Eager(driver.PhaseTimer):
        def __exit__(self, *error):
            self._reported = -1.0
            super().__exit__(*error)

    monkeypatch.setattr(progress, "reporter", lambda quiet: Watching())
    monkeypatch.setattr(driver, "PhaseTimer", Eager)
    monkeypatch.setattr(driver, "CHUNK", 10)
    assert cli.main(["resume", "r"]) == 0
    assert seen[0] == (50, None), "the clock starts with what was done before"
    rates = [rate for done, rate in seen if rate is not None]
    assert seen[-1][0] == 100
    assert max(rates) <= 10.0, "ten steps a tick of the clock at most: not 60"
    out = capsys.readouterr().out
    assert "100 steps of 1 particles" in out
    timing = json.loads((tmp_path / "r" / "run.json").read_text())["timing"]
    assert timing["steps"] == 100
    assert timing["stepping_s"] > first.seconds["stepping_s"] > 0


def test_a_run_interrupted_before_its_first_step_after_a_restart(tmp_path, capsys, monkeypatch):
    """Not "interrupted at step 0": nothing of what was done is lost."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(SCENE + "[output]\nrestart_every = 5e-4\n")
    assert cli.main(["run", "scene.toml", "-q", "--out", "r"]) == 0

    def stop(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr(driver, "Solver", stop)
    capsys.readouterr()
    (tmp_path / "r" / "run.json").unlink()
    assert cli.main(["resume", "r", "-q"]) == 130
    assert "interrupted at step 50; what is on disk stays: r" in capsys.readouterr().err
