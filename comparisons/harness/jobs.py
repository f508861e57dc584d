"""One scene through one code as a unit of work that can be sent to another process, and the local workers."""

from __future__ import annotations

import concurrent.futures
import contextlib
import dataclasses
import multiprocessing
import os
import pickle
import queue
import signal
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Literal

from comparisons.harness import provenance
from comparisons.harness.evaluate import describe
from comparisons.harness.progress import Pace, Reporter
from gpudem.errors import GpudemError
from gpudem.output.run import Run
from gpudem.scene import Scene
from gpudem.solver.device import find_device
from reference.code import Options, RunFunction
from reference.errors import CannotState, CodeMissing, CodeNotStarted, CodeTimeout

#: (case, variant, code).
Key = tuple[str, str, str]

#: What a job says while it runs: its key and what, particles and steps at its start; steps done; None: ended.
Message = tuple[Key, "tuple[str, int, int] | int | None"]

#: Seconds between two messages of a worker on the steps it has done.
EVERY = 0.2
#: Seconds that a worker has for ending its run in order before it is killed; LIGGGHTS is given 2 s twice.
GRACE = 8.0

#: Seconds between two requests to end.
ASK_EVERY = 0.5

#: How a job can end without a run: the code is not on this machine, cannot be given the scene, was stopped
#: after its time, gave up with an error of ours, or failed otherwise.
End = Literal["ok", "missing", "cannot_state", "timeout", "gave_up", "failed"]
#: By kind of error; the first that fits.
ENDS: dict[type[Exception], End] = {
    CodeMissing: "missing", CodeNotStarted: "failed", CannotState: "cannot_state",
    CodeTimeout: "timeout", GpudemError: "gave_up",
}  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Job:
    """What to run; all of it can be pickled if the code's function can."""

    key: Key
    title: str
    """For progress: "case variant code"."""
    scene: Scene
    run: RunFunction
    """Of its code; nothing else of the code is sent."""
    directory: Path
    options: Options
    extra: dict[str, Any]
    """Keyword arguments of the code's run function, of the variant."""

    def can_be_sent(self) -> bool:
        """Whether another process can be given it: a code made of a closure can run in this one only."""
        try:
            pickle.dumps((self.run, self.extra))
        except (pickle.PicklingError, AttributeError, TypeError):
            return False
        return True


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What came of a job."""

    end: End
    wall_s: float
    run: Run | None = None
    why: str = ""
    traceback: str = ""
    state_hash: str = ""
    seed: int | None = None


def perform(job: Job, tell: Callable[[Message], None] | None = None) -> Outcome:
    """Run a job in this process; an error is part of the outcome. `tell`: default, the worker's channel."""
    tell, began, last = tell or _tell, time.monotonic(), 0.0

    def progress(done: int) -> None:
        nonlocal last
        if time.monotonic() - last >= EVERY or done == job.scene.n_steps:
            last = time.monotonic()
            tell((job.key, done))

    facts: dict[str, Any] = {}
    try:
        facts = {"state_hash": provenance.state_hash(job.scene), "seed": provenance.seed(job.scene)}
        tell((job.key, (job.title, len(job.scene.state), job.scene.n_steps)))
        job.directory.mkdir(parents=True)
        run = job.run(job.scene, job.directory, job.options, progress, job.extra)
    except Exception as error:
        wall, text = time.monotonic() - began, traceback.format_exc()
        return Outcome(_end(error), wall, why=describe(error), traceback=text, **facts)
    finally:
        tell((job.key, None))
    return Outcome("ok", time.monotonic() - began, run, **facts)


def _end(error: Exception) -> End:
    for kind, end in ENDS.items():
        if isinstance(error, kind):
            return end
    return "failed"


class Display:
    """Shows messages of jobs through a reporter."""

    def __init__(self, reporter: Reporter):
        self._reporter = reporter
        self._paces: dict[Key, Pace] = {}

    def __call__(self, message: Message) -> None:
        """Take in one message."""
        key, said = message
        if isinstance(said, tuple):
            self._paces[key] = self._reporter.begin(*said)
        elif key in self._paces:
            if said is None:
                self._reporter.end(self._paces.pop(key))
            else:
                self._reporter.step(self._paces[key], said)


# -- local workers -------------------------------------------------------------------------------------------


@contextlib.contextmanager
def local_workers(count: int, display: Display) -> Iterator[concurrent.futures.Executor]:
    """Processes of this machine, started afresh (a fork breaks Warp and threads) and kept for all jobs.

    On an exception, Ctrl-C among them, the runs under way are ended with their processes; none goes on alone.
    """
    context = multiprocessing.get_context("spawn")
    channel = context.Queue()
    before = set(multiprocessing.active_children())
    pool = concurrent.futures.ProcessPoolExecutor(
        count, mp_context=context, initializer=_start, initargs=(channel, os.getcwd())
    )
    over = threading.Event()
    listener = threading.Thread(target=_listen, args=(channel, over, display), daemon=True)
    listener.start()
    try:
        yield pool
        pool.shutdown()
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        _stop([child for child in multiprocessing.active_children() if child not in before])
        raise
    finally:
        over.set()  # not by a message: a worker that was killed may have taken the channel's lock with it
        listener.join(1.0)


def _listen(channel: Any, over: threading.Event, display: Display) -> None:
    while not over.is_set():
        with contextlib.suppress(queue.Empty):
            display(channel.get(timeout=EVERY))


def _stop(workers: list[Any]) -> None:
    """Ask all to end until they do, kill those that do not; a second Ctrl-C kills at once.

    Once is not enough: a signal that comes while the main thread has another one to handle may be given to
    another thread of the worker, and a main thread that waits for a child then hears nothing of it.
    """
    try:
        deadline = time.monotonic() + GRACE
        while any(worker.is_alive() for worker in workers) and time.monotonic() < deadline:
            for worker in workers:
                worker.terminate()
            for worker in workers:
                worker.join(ASK_EVERY)
    finally:
        for worker in workers:
            if worker.is_alive():
                worker.kill()


# In a worker:

_channel: Any = None


def _start(channel: Any, directory: str) -> None:
    """Set up a worker: its channel, its folder, and its end when it is told so or its parent is gone."""
    global _channel
    _channel = channel
    os.chdir(directory)
    signal.signal(signal.SIGINT, lambda number, frame: None)  # Ctrl-C: the parent says what to do
    signal.signal(signal.SIGTERM, _leave)
    threading.Thread(target=_follow_parent, daemon=True).start()
    with _silent_stderr():  # what Warp says of missing drivers, the parent has said
        find_device("cpu")


@contextlib.contextmanager
def _silent_stderr() -> Iterator[None]:
    kept, null = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(null)


def _leave(number: int, frame: Any) -> None:
    signal.signal(number, signal.SIG_IGN)  # the run ends in order: further requests must not break that off
    raise SystemExit(128 + number)


def _follow_parent() -> None:
    """A parent that was killed has told nobody: end the run, then this process."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        deadline = time.monotonic() + GRACE
        while time.monotonic() < deadline:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(ASK_EVERY)
        os._exit(1)


def _tell(message: Message) -> None:
    if _channel is not None:
        _channel.put(message)


def in_worker(job: Job) -> Outcome:
    """`perform` in a worker process: told to end, it ends the run in order and leaves."""
    try:
        return perform(job)
    except SystemExit as error:  # the pool would take it for the job's result and go on
        os._exit(error.code if isinstance(error.code, int) else 1)
