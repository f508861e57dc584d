"""One scene through one code as a unit of work that can be sent to another process, and the local workers."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import pickle
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, Literal

from comparisons.harness import provenance, workers
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

    def why_not_sent(self) -> str:
        """Why it cannot be sent to another process; empty if it can. A closure runs in this process only."""
        for what, value in (("its run function", self.run), ("an option of its run", self.extra)):
            try:
                pickle.dumps(value)
            except (pickle.PicklingError, AttributeError, TypeError) as error:
                return f"{what} cannot be sent to another process: {error}"
        return ""


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


def perform(job: Job, tell: Callable[[Message], None] = workers.report) -> Outcome:
    """Run a job in this process; an error is part of the outcome. `tell`: default, the worker's parent."""
    began, last = time.monotonic(), 0.0

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
    """Shows messages of jobs through a reporter; may be called from several threads."""

    def __init__(self, reporter: Reporter):
        self._reporter = reporter
        self._paces: dict[Key, Pace] = {}
        self._lock = threading.Lock()

    def __call__(self, message: Message) -> None:
        """Take in one message."""
        key, said = message
        with self._lock:
            if isinstance(said, tuple):
                self._paces[key] = self._reporter.begin(*said)
            elif key in self._paces:
                if said is None:
                    self._reporter.end(self._paces.pop(key))
                else:
                    self._reporter.step(self._paces[key], said)


# -- local workers -------------------------------------------------------------------------------------------


def local_workers(count: int, display: Display) -> AbstractContextManager[Executor]:
    """Processes of this machine that do jobs, for a block."""
    return workers.workers(count, _prepare, display)


def _prepare() -> None:
    """In a worker: what Warp says of missing drivers, the parent has said."""
    with _silent_stderr():
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
