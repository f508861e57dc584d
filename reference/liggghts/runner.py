"""Starts LIGGGHTS, follows it, ends it when it must; believes it only if everything shows that it finished.

LIGGGHTS exits with status 0 after a signal, with NaN everywhere, or with all atoms lost; success is
therefore read from what it printed, never from the exit status alone.
"""

from __future__ import annotations

import contextlib
import dataclasses
import os
import selectors
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from gpudem.extras import from_extra
from reference.liggghts.console import Console
from reference.liggghts.deck import DECK, LOG, Deck
from reference.liggghts.errors import LiggghtsFailed, LiggghtsNotStarted, LiggghtsTimeout

#: Time between SIGTERM and SIGKILL [s].
GRACE = 2.0
#: Time for a run that has closed its output to end by itself [s].
FAREWELL = 20.0
#: Between looks at clock and memory [s].
TICK = 0.1
#: Memory is read from the system at most this often [s].
MEMORY_EVERY = 0.05
#: At the start it is read as soon as this share of the time of the run so far has passed.
MEMORY_SHARE = 0.02


@dataclasses.dataclass(frozen=True)
class Outcome:
    """A finished, believed run of the binary."""

    console: Console
    wall_s: float
    peak_memory_bytes: int

    @property
    def loop_s(self) -> float:
        """Sum of the `Loop time` lines [s]: stepping and output."""
        return sum(seconds for seconds, _, _ in self.console.loops)


def execute(
    deck: Deck, directory: Path, binary: str, *, ranks: int = 1, timeout: float | None = None,
    progress: Callable[[int], None] | None = None,
) -> Outcome:  # fmt: skip
    """Write deck and data into `directory`, run them there, follow to the end.

    Args:
        deck: What to run.
        directory: Where to; deck, data, log and the folder of raw dumps are written there.
        binary: Path of LIGGGHTS.
        ranks: MPI processes.
        timeout: Wall-clock limit [s]; the whole process group is ended after it.
        progress: Called with the number of steps done.

    Raises:
        LiggghtsNotStarted: the binary or MPI ended before the first command of the deck.
        LiggghtsFailed: unwritable directory, ERROR line, signal, NaN, lost particles, or an end before
            the last step.
        LiggghtsTimeout: not done within `timeout`.
    """
    try:
        deck.write(directory)
        log = open(directory / LOG, "w", errors="replace")
    except OSError as error:
        raise LiggghtsFailed(f"{directory}: cannot be written: {error}") from error
    console = Console(deck.text.splitlines(), progress or (lambda step: None))
    start = time.monotonic()
    with log, environment(ranks) as variables:
        process = subprocess.Popen(
            command(binary, ranks), cwd=directory, env=variables,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            start_new_session=True,
        )  # fmt: skip
        memory = _Memory(process.pid, ranks)
        finished = False
        try:
            finished = _follow(process, console, log, memory, None if timeout is None else start + timeout)
        except _Late:
            raise LiggghtsTimeout(
                f"LIGGGHTS did not end within {timeout:g} s: ended at step {console.step} of"
                f" {deck.segments[-1].last}\n  log: {directory / LOG}"
            ) from None
        finally:
            _end(process, FAREWELL if finished else 0.0)
    _believe(console, deck, directory, process.returncode)
    return Outcome(console, time.monotonic() - start, memory.peak)


#: mpirun refuses to start as root (in a container) without these.
MPI_AS_ROOT = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
#: One rank talks to nobody: without a daemon and a search for networks Open MPI starts three times as fast.
MPI_ALONE = {"OMPI_MCA_ess_singleton_isolated": "1", "OMPI_MCA_btl": "self", "OMPI_MCA_pml": "ob1"}
#: A rank that waits lets others have its core: on a machine with other work, ranks that spin keep one another
#: from running (0.27 instead of 7 million particle-steps/s were seen).
MPI_YIELDS = {"OMPI_MCA_mpi_yield_when_idle": "1"}


@contextlib.contextmanager
def environment(ranks: int) -> Iterator[dict[str, str]]:
    """Environment variables of a run, until it is over; what the user has set of Open MPI's stays.

    Open MPI's session files get a folder of their own: by default all runs of a user share one, and a run
    that ends removes it while another one starts, which then cannot (once in some thousand starts).
    """
    chosen = MPI_YIELDS if ranks > 1 else MPI_ALONE
    with tempfile.TemporaryDirectory(prefix="gpudem-mpi-", ignore_cleanup_errors=True) as session:
        yield MPI_AS_ROOT | chosen | {"OMPI_MCA_orte_tmpdir_base": session} | dict(os.environ)


def command(binary: str, ranks: int) -> list[str]:
    """The command line. Without `stdbuf -oL` the texts of fatal errors would be lost with the process."""
    launcher = ["mpirun", "--oversubscribe", "-np", str(ranks)] if ranks > 1 else ["stdbuf", "-oL"]
    return [*launcher, binary, "-in", DECK, "-echo", "screen", "-log", "none"]


class _Late(Exception):
    """The time allowed is over."""


def _follow(process, console: Console, log, memory: _Memory, deadline: float | None) -> bool:
    """Feed every line to the console until the output ends (True) or a NaN is printed (False)."""
    rest = b""
    with selectors.DefaultSelector() as selector:
        selector.register(process.stdout, selectors.EVENT_READ)
        while True:
            if deadline is not None and time.monotonic() > deadline:
                raise _Late
            memory.look()
            if not selector.select(TICK):
                continue
            chunk = os.read(process.stdout.fileno(), 1 << 16)
            *lines, rest = (rest + chunk).split(b"\n")
            if not chunk and rest:
                lines, rest = [rest], b""
            for line in lines:
                text = line.decode(errors="replace")
                log.write(text + "\n")
                console.feed(text)
            log.flush()
            if not chunk or console.nan_step is not None:
                return not chunk


def _end(process: subprocess.Popen, patience: float) -> None:
    """Wait `patience` seconds for the end; what runs on gets TERM, then KILL, with all its children."""
    if process.stdout:
        process.stdout.close()
    for sign in (None, signal.SIGTERM, signal.SIGKILL):
        if sign is not None:
            try:
                os.killpg(process.pid, sign)
            except ProcessLookupError:
                pass
        try:
            process.wait(patience if sign is None else GRACE)
            return
        except subprocess.TimeoutExpired:
            continue


def _believe(console: Console, deck: Deck, directory: Path, status: int | None) -> None:
    """Raises LiggghtsFailed unless everything shows that the run went to its end with all particles."""
    wanted = [s.last - s.first for s in deck.segments]
    if console.deck_line == 0 and status and not console.errors:
        raise LiggghtsNotStarted(f"{_status(status)}, before the first command\n  log: {directory / LOG}")
    if console.errors:
        what = console.errors[0]
    elif console.nan_step is not None:
        what = f"not a number (nan) in the output of step {console.nan_step}"
    elif console.interrupted:
        what = f"LIGGGHTS caught a signal and stopped at step {console.step}"
    elif status:
        what = _status(status) + f" at step {console.step} of {deck.segments[-1].last}"
    elif [steps for _, steps, _ in console.loops] != wanted or console.step != deck.segments[-1].last:
        what = f"LIGGGHTS ended early: {len(console.loops)} of {len(wanted)} runs done, step {console.step}"
    elif lost := [
        (n, s)
        for (*_, n), s in zip(console.loops, deck.segments, strict=True)
        if n > s.particles or (n < s.particles and not deck.may_lose)
    ]:
        left, segment = lost[-1]
        what = f"LIGGGHTS lost particles: {left} of {segment.particles} left"
    else:
        return
    lines = [what]
    if console.deck_line:
        words = " ".join(deck.text.splitlines()[console.deck_line - 1].split())
        lines.append(f"deck: {directory / DECK}, line {console.deck_line}: {words}")
    lines.append(f"log: {directory / LOG}")
    raise LiggghtsFailed("\n  ".join(lines))


def _status(status: int) -> str:
    if status < 0:
        return f"LIGGGHTS was killed by {signal.Signals(-status).name}"
    return f"LIGGGHTS ended with status {status}, without an ERROR line"


class _Memory:
    """Largest resident memory of the ranks, from the kernel's own high-water mark (VmHWM).

    Not from `wait4`: its figure starts with the size of the parent Python process at the fork.
    """

    def __init__(self, pid: int, ranks: int):
        self._pid, self._ranks, self._peaks, self._next = pid, ranks, {}, 0.0
        self._began = time.monotonic()

    def look(self) -> None:
        """Read the marks of all ranks: often at the start, since a run may take milliseconds."""
        now = time.monotonic()
        if now < self._next:
            return
        self._next = now + min(MEMORY_EVERY, MEMORY_SHARE * (now - self._began))
        for pid in self._pids():
            try:
                text = Path(f"/proc/{pid}/status").read_text()
            except OSError:
                continue
            for line in text.splitlines():
                if line.startswith("VmHWM:"):
                    self._peaks[pid] = int(line.split()[1]) * 1024

    def _pids(self) -> list[int]:
        if self._ranks == 1:
            return [self._pid]
        with from_extra():
            import psutil

        try:
            children = psutil.Process(self._pid).children(recursive=True)
        except psutil.NoSuchProcess:
            return []
        return [c.pid for c in children]

    @property
    def peak(self) -> int:
        """Sum over the ranks [bytes]; 0 where the system does not tell."""
        return sum(self._peaks.values())
