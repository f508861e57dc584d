"""Runs side by side: the same results as one after another, timed ones alone, and no process left behind."""

from __future__ import annotations

import dataclasses
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import Executor, Future
from pathlib import Path

import pytest

from comparisons.harness import codes, execute, jobs, results
from comparisons.harness.case import Check, Variant
from gpudem.errors import GpudemError
from tests.comparisons import fake, waiting_codes

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[2]


def plain(case, timed=()):
    """A case without figures, its variants timed or not."""

    def variants(tier):
        return [dataclasses.replace(v, timed=v.label in timed) for v in case.variants(tier)]

    return dataclasses.replace(case, figures=(), tables=(), variants=variants)


def facts(comparison):
    """All of it that must not depend on how it was run."""
    runs = [dataclasses.asdict(run) for run in comparison.runs]
    for run in runs:
        del run["notes"]["arrays"]  # their size goes by the number of threads
    cases = [dataclasses.replace(case, wall_s=0.0) for case in comparison.cases]
    labels = [(t.case, t.variant, t.code, t.particles, t.steps) for t in comparison.timings]
    return comparison.checks, runs, cases, labels


def test_side_by_side_gives_the_results_of_one_after_another(tmp_path):
    """Would detect: results in the order in which runs end, threads that change a bit, options not sent."""
    cases = [plain(fake.case(name), timed=("dt_2e-05",)) for name in ("first", "second")]
    found = []
    for workers in (1, 2):
        (tmp_path / str(workers)).mkdir()
        session = execute.Session(
            cases, tmp_path / str(workers), selected=("gpudem",), workers=workers,
            options=codes.Options(precision="mixed"),
        )  # fmt: skip
        found.append(session.run())
    one, two = (facts(comparison) for comparison in found)
    assert one == two
    assert two == facts(results.load(tmp_path / "2"))
    assert {t.precision for t in found[1].timings} == {"mixed"}
    assert [t.shared for t in found[0].timings] == [False] * 6
    assert [t.shared for t in found[1].timings] == [True, False, True] * 2
    assert {t.cores for t in found[1].timings if t.shared} == {1}
    page = (tmp_path / "2" / "report.html").read_text()
    assert page.count(">shared</span>") == 4


def test_what_is_timed_runs_before_all_others_and_a_case_that_times_is_judged_then(tmp_path, monkeypatch):
    """Would detect: a timing with a worker busy beside it."""
    events = []

    class Watching(Executor):
        def submit(self, fn, /, *args, **options):
            events.append(("sent", *args[0].key[:2]))
            done = Future()
            done.set_result(perform(args[0], lambda message: None))
            return done

    perform = jobs.perform

    def here(job, tell):
        events.append(("here", *job.key[:2]))
        return perform(job, tell)

    monkeypatch.setattr(jobs, "perform", here)
    monkeypatch.setattr(jobs.Job, "can_be_sent", lambda job: True)
    monkeypatch.setitem(codes.CODES, "gpudem", fake.code("gpudem"))

    def times_itself(found):
        events.append(("judged", "second", ""))
        return 0.0

    check = Check("c", times_itself, 1.0, "1", "x", "X", "r", "c")
    second = dataclasses.replace(plain(fake.case("second")), timed=True, checks=(check,))
    first = plain(fake.case("first"), timed=("dt_1e-05",))
    first = dataclasses.replace(first, checks=first.checks[:1])
    session = execute.Session([first, second], tmp_path, selected=("gpudem",), executor=Watching())
    assert session.run().exit_code() == 0
    labels = ["dt_4e-05", "dt_2e-05", "dt_1e-05"]
    timed = [("here", "first", labels[2]), *(("here", "second", label) for label in labels)]
    assert events[:5] == [*timed, ("judged", "second", "")]
    assert events[5:7] == [("sent", "first", label) for label in labels[:2]]
    assert [case.status for case in session.comparison.cases] == ["done", "done"]


@pytest.mark.parametrize("workers", [1, 2])
def test_times_of_a_run_that_is_not_timed_cannot_be_read(tmp_path, fake_codes, workers):
    """Would detect: a table of speeds from runs that shared the machine, also before it is run that way."""
    check = Check("c", lambda r: r["dt_1e-05", "gpudem"].timing.rate, 1e9, "1", "x", "X", "r", "c")
    steps = Check("s", lambda r: r["dt_1e-05", "gpudem"].timing.steps, 1e9, "1", "x", "X", "r", "c")
    case = dataclasses.replace(plain(fake.case()), checks=(check, steps))
    comparison = execute.Session([case], tmp_path, selected=("gpudem",), workers=workers).run()
    assert [c.status for c in comparison.checks] == ["error", "pass"]
    assert "timed=True" in comparison.checks[0].why


def test_a_worker_that_dies_is_an_error_of_its_run_that_says_so(tmp_path, monkeypatch):
    monkeypatch.setitem(codes.CODES, "dies", waiting_codes.DIES)
    case = waiting_codes.case(waiting_codes.DIES, 1)
    comparison = execute.Session([case], tmp_path, selected=("dies",), workers=2).run()
    assert comparison.exit_code() == 3
    assert "a worker process ended before its run did" in comparison.runs[0].why
    assert "--jobs 1" in comparison.runs[0].why


def pids(directory: Path) -> list[int]:
    return [int(pid) for path in directory.glob("throw/*/waits/pids") for pid in path.read_text().split()]


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def wait_until(holds, seconds: float) -> bool:
    end = time.monotonic() + seconds
    while not holds() and time.monotonic() < end:
        time.sleep(0.1)
    return holds()


@pytest.mark.parametrize("how", ["ctrl-c", "term", "kill"])
def test_no_process_stays_when_the_comparison_is_stopped(tmp_path, how):
    """Ctrl-C goes to all processes of the terminal, SIGTERM to the first only, SIGKILL tells nobody."""
    out = tmp_path / "c"
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.comparisons.waiting_codes", str(out)], cwd=ROOT,
        stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    if not wait_until(lambda: len(pids(out)) == 4, 60):
        process.kill()
        pytest.fail(f"the workers did not start: {process.communicate()[1]}")
    started = pids(out)
    assert len(set(started)) == 4
    if how == "ctrl-c":
        os.killpg(process.pid, signal.SIGINT)
    else:
        process.send_signal(signal.SIGTERM if how == "term" else signal.SIGKILL)
    _, errors = process.communicate(timeout=60)
    assert wait_until(lambda: not any(map(alive, started)), 2 * jobs.GRACE)
    if how != "kill":
        assert process.returncode == 130
        assert "Traceback" not in errors
        stored = results.load(out)
        assert stored.state == "interrupted"
        assert [c.status for c in stored.checks] == ["left_out"]


def test_default_number_of_workers(monkeypatch):
    monkeypatch.setattr(execute, "cores", lambda: 8)
    Options = codes.Options
    assert execute.default_workers(Options()) == 8
    assert execute.default_workers(Options(threads=3)) == 2
    assert execute.default_workers(Options(ranks=16)) == 1
    assert execute.default_workers(Options(device="cuda:0")) == 1


def test_untimed_timing_still_says_what_ran():
    timing = execute.Untimed(particles=3, steps=10, stepping_s=1.0)
    assert (timing.particles, timing.steps, timing.cores) == (3, 10, 1)
    for name in ("stepping_s", "rate", "setup_s", "output_s", "compile_s"):
        with pytest.raises(GpudemError, match=f"timing.{name}"):
            getattr(timing, name)


def test_variants_are_not_timed_unless_they_say_so():
    assert Variant("v", fake.scene()).timed is False


@pytest.mark.parametrize("name", ["gpudem", "liggghts", "event_driven"])
def test_the_codes_can_be_sent_to_other_processes(name, tmp_path):
    """Catches a run function that is a closure: its runs would be done in the parent, one after another."""
    options = codes.Options()
    job = jobs.Job(
        ("case", "variant", name), "title", fake.scene(), codes.CODES[name].run, tmp_path, options, {}
    )
    assert job.can_be_sent()


def test_a_worker_that_misses_a_request_to_end_is_asked_again(monkeypatch):
    """Catches a worker killed for one lost signal: the child of its run would go on without it."""
    monkeypatch.setattr(jobs, "ASK_EVERY", 0.0)
    said = []

    class Worker:
        def is_alive(self):
            return said.count("end") < 2

        def terminate(self):
            said.append("end")

        def kill(self):
            said.append("kill")

        def join(self, seconds):
            assert seconds <= jobs.GRACE

    jobs._stop([Worker()])
    assert said == ["end", "end"]
