"""Runs side by side: the same results as one after another, timed ones alone, and no process left behind."""

from __future__ import annotations

import dataclasses
import math
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import Executor, Future
from pathlib import Path

import pytest

from comparisons.harness import codes, execute, jobs, results, workers
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
    for count in (1, 2):
        (tmp_path / str(count)).mkdir()
        session = execute.Session(
            cases, tmp_path / str(count), selected=("gpudem",), workers=count,
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
    monkeypatch.setattr(jobs.Job, "why_not_sent", lambda job: "")
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


def test_a_worker_that_dies_costs_its_run_alone(tmp_path, monkeypatch):
    """Detects a dead worker that takes other runs with it, is not replaced, or whose end is not named."""
    monkeypatch.setitem(codes.CODES, "falls", waiting_codes.FALLS)
    labels = ("killed_1", "v1", "exits_1", "killed_2", "v2", "ended_1", "v3", "v4")
    case = waiting_codes.case(waiting_codes.FALLS, *labels)
    comparison = execute.Session([case], tmp_path, selected=("falls",), workers=2).run()
    assert comparison.exit_code() == 3
    assert [run.variant for run in comparison.runs] == list(labels)
    why = {run.variant: run.why for run in comparison.runs if run.status == "error"}
    assert set(why) == {"killed_1", "killed_2", "exits_1", "ended_1"}
    assert {run.status for run in comparison.runs if run.variant not in why} == {"ok"}
    for label, end in (
        ("killed_1", "killed by SIGKILL, as the system does where memory runs out"),
        ("exits_1", "exit code 7"), ("ended_1", "exit code 143 (SIGTERM)"),
    ):  # fmt: skip
        assert f"the worker process ended before its run did: {end}; --jobs 1" in why[label]
    assert not [child for child in multiprocessing.active_children() if child.is_alive()]


def test_a_code_that_cannot_be_sent_is_named_once(tmp_path, fake_codes):
    """Detects runs that go one after another in the main process without a word."""
    cases = [plain(fake.case(name)) for name in ("first", "second")]
    cases = [
        dataclasses.replace(case, variants=lambda tier: [Variant("dt_1e-05", fake.scene())], checks=())
        for case in cases
    ]
    comparison = execute.Session(cases, tmp_path, workers=2).run()
    assert [run.status for run in comparison.runs] == ["ok"] * 4
    assert [line.partition(":")[0] for line in comparison.notices] == [
        f"{title} runs in the main process, one run after another" for title in ("gpudem", "LIGGGHTS")
    ]
    assert "its run function cannot be sent to another process" in comparison.notices[0]
    assert (tmp_path / "report.html").read_text().count("gpudem runs in the main process") == 1
    assert results.load(tmp_path).notices == comparison.notices


class Unreadable:
    """Can be pickled and not be read again."""

    def __reduce__(self):
        return int, ("x",)


def unreadable() -> Unreadable:
    return Unreadable()


def test_calls_whose_results_cannot_be_sent_or_read_leave_the_next_ones_right():
    """Detects a result that is taken for that of the next call, and a wait without end."""
    with workers.workers(1, list) as pool:
        calls = [(math.sqrt, 4.0), (math.sqrt, "x"), (threading.Lock,), (unreadable,), (os.getpid,)]
        made = [pool.submit(*call) for call in calls]
        assert made[0].result(60) == 2.0
        with pytest.raises(TypeError, match="must be real number"):
            made[1].result(60)
        with pytest.raises(TypeError, match="cannot be sent to the parent"):
            made[2].result(60)
        with pytest.raises(ValueError, match="invalid literal"):
            made[3].result(60)
        pid = made[4].result(60)
        os.kill(pid, signal.SIGKILL)  # one that dies between two calls costs none
        assert wait_until(lambda: not alive(pid), 10.0)
        assert pool.submit(os.getpid).result(60) != pid


def stubborn(begun: Path) -> None:
    """A call that does not end when it is asked to."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    begun.touch()
    time.sleep(120.0)


def test_workers_that_do_not_end_are_killed_in_time(monkeypatch, tmp_path):
    """Detects a comparison that waits for a worker for ever."""
    monkeypatch.setattr(workers, "GRACE", 0.5)

    def stopped():
        with workers.workers(2, list) as pool:
            pool.submit(stubborn, tmp_path / "begun")
            late = pool.submit(time.sleep, 60.0)
            assert wait_until(lambda: (tmp_path / "begun").exists(), 60.0)
            since.append(time.monotonic())
            started.extend(pool._processes)
            calls.append(late)
            raise KeyboardInterrupt

    started, calls, since = [], [], []
    with pytest.raises(KeyboardInterrupt):
        stopped()
    assert time.monotonic() - since[0] < 20.0
    assert wait_until(lambda: not any(process.is_alive() for process in started), 5.0)
    with pytest.raises(workers.WorkerDied):
        calls[0].result(10.0)


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
    assert wait_until(lambda: not any(map(alive, started)), 2 * workers.GRACE)
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
    assert job.why_not_sent() == ""


def test_a_worker_that_misses_a_request_to_end_is_asked_again(monkeypatch):
    """Catches a worker killed for one lost signal: the child of its run would go on without it."""
    monkeypatch.setattr(workers, "ASK_EVERY", 0.0)
    said = []

    class Worker:
        def is_alive(self):
            return said.count("end") < 2

        def terminate(self):
            said.append("end")

        def kill(self):
            said.append("kill")

        def join(self, seconds):
            assert seconds <= workers.GRACE

    workers.stop([Worker()])
    assert said == ["end", "end"]
