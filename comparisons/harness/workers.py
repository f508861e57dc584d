"""Processes of this machine as an executor: one that dies costs the call it was working on, and is replaced.

`concurrent.futures.ProcessPoolExecutor` gives up every call when one of its processes dies, and its processes
share a queue whose lock a dead one may hold. Here each process has a pipe of its own, for its calls, for what
it reports meanwhile and for their results; nothing is shared, and every wait for a process has a limit.
"""

from __future__ import annotations

import contextlib
import dataclasses
import multiprocessing
import os
import queue
import signal
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any

#: Seconds that a process has for ending its call in order before it is killed; LIGGGHTS is given 2 s twice.
GRACE = 8.0
#: Seconds between two requests to end.
ASK_EVERY = 0.5
#: Names by number.
SIGNALS = {int(number): number.name for number in signal.Signals}


class WorkerDied(BrokenExecutor):
    """A process ended before its call did; the message says by which signal or exit code."""


@dataclasses.dataclass
class _Worker:
    """A process, and this end of its pipe."""

    process: BaseProcess
    pipe: Connection
    idle: bool = True
    """All that its last call has sent is read."""

    def call(self, call: Any, hear: Callable[[Any], None]) -> Any:
        """The result of a call; what it reports before goes to `hear`.

        Raises WorkerDied, or what the call raised.
        """
        self.idle = False
        kind, value = self._message(call)
        while kind == "said":
            hear(value)
            kind, value = self._message()
        self.idle = True
        if kind == "error":
            raise value
        return value

    def _message(self, *calls: Any) -> tuple[str, Any]:
        """The next message, after a call is sent to it. Raises WorkerDied."""
        try:
            for call in calls:
                self.pipe.send(call)
            if self.pipe in wait([self.pipe, self.process.sentinel]) or self.pipe.poll():
                return self.pipe.recv()
        except (EOFError, OSError):
            pass
        raise WorkerDied(self._how())

    def _how(self) -> str:
        self.process.join(GRACE)
        code = self.process.exitcode
        if code is None:
            return "its pipe is closed"
        name = SIGNALS.get(-code if code < 0 else code - 128, "")
        if code >= 0:
            return f"exit code {code}{f' ({name})' if name else ''}"
        memory = ", as the system does where memory runs out" if code == -signal.SIGKILL else ""
        return f"killed by {name or -code}{memory}"

    def end(self) -> None:
        """No further call: it ends, or is ended."""
        with contextlib.suppress(OSError):
            self.pipe.send(None)
        self.process.join(GRACE)
        stop([self.process])
        self.pipe.close()


class Workers(Executor):
    """Up to `count` processes, started afresh (a fork breaks Warp and threads) and kept for all calls.

    Args:
        count: Calls at a time.
        prepare: Called first in each process; can be pickled.
        hear: Takes in what calls report by `report`, in threads of this process.
    """

    def __init__(self, count: int, prepare: Callable[[], None], hear: Callable[[Any], None]):
        self._prepare, self._hear = prepare, hear
        self._calls: queue.SimpleQueue[tuple[Future[Any], Any] | None] = queue.SimpleQueue()
        self._starting, self._stopped = threading.Lock(), False
        self._processes: list[BaseProcess] = []
        self._threads = [threading.Thread(target=self._serve, daemon=True) for _ in range(count)]
        for thread in self._threads:
            thread.start()

    def submit(self, fn: Callable[..., Any], /, *args: Any, **options: Any) -> Future[Any]:
        """Call a function in one of the processes; function, arguments and result can be pickled."""
        future: Future[Any] = Future()
        self._calls.put((future, (fn, args, options)))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """No further call; those submitted are waited for, or cancelled if they have not begun."""
        while cancel_futures and not self._calls.empty():
            with contextlib.suppress(queue.Empty):
                call = self._calls.get_nowait()
                if call is not None:
                    call[0].cancel()
        for _ in self._threads:
            self._calls.put(None)
        for thread in self._threads if wait else ():
            thread.join()

    def stop(self) -> None:
        """Break off: end the calls under way with their processes; none goes on by itself."""
        with self._starting:
            self._stopped = True
        self.shutdown(wait=False, cancel_futures=True)
        stop(self._processes)

    def _serve(self) -> None:
        """One thread: its process gets one call after another."""
        worker: _Worker | None = None
        while (taken := self._calls.get()) is not None:
            future, call = taken
            if not future.set_running_or_notify_cancel():
                continue
            try:
                if worker is None or not worker.process.is_alive():
                    worker = self._start()
                result = worker.call(call, self._hear)
            except BaseException as error:
                if worker is not None and not worker.idle:  # what it still sends is of this call
                    stop([worker.process])
                future.set_exception(error)
            else:
                future.set_result(result)
        if worker is not None:
            worker.end()

    def _start(self) -> _Worker:
        context = multiprocessing.get_context("spawn")
        here, there = context.Pipe()
        process = context.Process(target=_work, args=(there, os.getcwd(), self._prepare))
        with self._starting, there:
            if self._stopped:
                raise WorkerDied("stopped")
            process.start()
            self._processes.append(process)
        return _Worker(process, here)


@contextlib.contextmanager
def workers(
    count: int, prepare: Callable[[], None], hear: Callable[[Any], None] = lambda said: None
) -> Iterator[Workers]:
    """Workers for a block. On an exception, Ctrl-C among them, they are stopped with what they do."""
    made = Workers(count, prepare, hear)
    try:
        yield made
        made.shutdown()
    except BaseException:
        made.stop()
        raise


def stop(processes: list[BaseProcess]) -> None:
    """Ask all to end until they do, kill those that do not; a second Ctrl-C kills at once.

    Once is not enough: a signal that comes while the main thread has another one to handle may be given to
    another thread of the process, and a main thread that waits for a child then hears nothing of it.
    """
    try:
        deadline = time.monotonic() + GRACE
        while any(process.is_alive() for process in processes) and time.monotonic() < deadline:
            for process in processes:
                process.terminate()
            for process in processes:
                process.join(ASK_EVERY)
    finally:
        for process in processes:
            if process.is_alive():
                process.kill()


# In a worker:

_pipe: Connection | None = None
_sending = threading.Lock()


def report(said: Any) -> None:
    """Send something to the parent during a call; nothing where this process is no worker."""
    if _pipe is not None:
        _send("said", said)


def _send(kind: str, value: Any) -> None:
    assert _pipe is not None
    with _sending:
        _pipe.send((kind, value))


def _work(pipe: Connection, directory: str, prepare: Callable[[], None]) -> None:
    """A worker: calls until there are no more, it is told to end, or its parent is gone."""
    global _pipe
    _pipe = pipe
    os.chdir(directory)
    signal.signal(signal.SIGINT, lambda number, frame: None)  # Ctrl-C: the parent says what to do
    signal.signal(signal.SIGTERM, _leave)
    threading.Thread(target=_follow_parent, daemon=True).start()
    try:
        prepare()
        while _answer(pipe):
            pass
    except SystemExit as error:  # at once: threads of the call may wait for something
        os._exit(error.code if isinstance(error.code, int) else 1)


def _answer(pipe: Connection) -> bool:
    """Do one call and send what came of it; False if there are no more, or the parent is gone."""
    try:
        call = pipe.recv()
    except (EOFError, OSError):
        return False
    except Exception as error:  # a call that cannot be read here
        call = _raise, (error,), {}
    if call is None:
        return False
    function, arguments, options = call
    try:
        answer = "result", function(*arguments, **options)
    except Exception as error:
        answer = "error", error
    try:
        _send(*answer)
    except OSError:
        return False
    except Exception as error:  # pickle has many ways of saying that it cannot
        _send("error", TypeError(f"what came of the call cannot be sent to the parent: {error}"))
    return True


def _raise(error: Exception) -> None:
    raise error


def _leave(number: int, frame: Any) -> None:
    signal.signal(number, signal.SIG_IGN)  # the call ends in order: further requests must not break that off
    raise SystemExit(128 + number)


def _follow_parent() -> None:
    """A parent that was killed has told nobody: end the call, then this process."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        deadline = time.monotonic() + GRACE
        while time.monotonic() < deadline:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(ASK_EVERY)
        os._exit(1)
