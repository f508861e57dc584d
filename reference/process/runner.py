"""Runs a command on a scene: writes its input, starts it, ends it when it must, makes a run of its output."""

from __future__ import annotations

import dataclasses
import os
import shlex
import shutil
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

from gpudem.errors import GpudemError
from gpudem.output.atomic import WriteError
from gpudem.output.run import Run, Timing
from gpudem.scene import Scene, checks
from gpudem.solver import guards
from reference.code import Code, Options, Progress
from reference.errors import CannotState, CodeTimeout
from reference.process import contacts, contract, statement, states

#: Folders in the directory of a run: what the command is given, and what it writes.
GIVEN, WRITTEN = "given", "written"
STDOUT, STDERR = "stdout.txt", "stderr.txt"
#: Time between SIGTERM and SIGKILL [s].
GRACE = 2.0
#: Wall-clock limit of one run where the user states none [s].
TIME_LIMIT = 600.0
#: Lines and characters of a command's output that an error shows.
SHOWN_LINES, SHOWN_CHARACTERS = 12, 2000


class CommandFailed(GpudemError):
    """The command ended with an error, or could not be started: status, last lines, log."""


@dataclasses.dataclass(frozen=True)
class Process:
    """A code behind a command, for `Code.run`; it can be pickled."""

    command: str
    """Split as by a shell, without one; `{scene}` and `{out}` become paths."""
    name: str
    timeout: float = TIME_LIMIT
    """Wall-clock limit of one run [s]."""

    def __post_init__(self) -> None:
        words = self.words(Path("scene.json"), Path("out"))
        if not words:
            raise GpudemError(f"--with {self.command!r}: no command")
        missing = [part for part in ("{scene}", "{out}") if part not in self.command]
        if missing:
            raise GpudemError(f"--with {self.command!r}: must hold {' and '.join(missing)}")
        if not self.timeout > 0:
            raise GpudemError(f"--with-timeout = {self.timeout:g}: must be above 0 [s]")

    def words(self, scene: Path, out: Path) -> list[str]:
        """The command line. Raises GpudemError: a quotation that does not end."""
        try:
            parts = shlex.split(self.command)
        except ValueError as error:
            raise GpudemError(f"--with {self.command!r}: {error}") from None
        return [part.replace("{scene}", str(scene)).replace("{out}", str(out)) for part in parts]

    def __call__(
        self, scene: Scene, directory: Path, options: Options, progress: Progress, extra: dict[str, Any]
    ) -> Run:
        """Run a scene.

        Raises:
            CannotState: the contract or the command has no words for the scene; the reason is the command's.
            CodeTimeout: it did not end within the time limit.
            CommandFailed: it ended with an error.
            OutputError: what it wrote is not what the contract asks for.
        """
        directory = Path(directory).absolute()
        given, written = directory / GIVEN, directory / WRITTEN
        try:
            for folder in (given, written):
                shutil.rmtree(folder, ignore_errors=True)
                folder.mkdir(parents=True)
        except OSError as error:
            raise WriteError(directory, error) from error
        path = statement.write(scene, given)
        wall = self._execute(self.words(path, written), directory)
        progress(scene.n_steps)
        about, warnings = states.about(written)
        found = states.read(scene, written, statement.wanted_steps(scene))
        table = written / contract.CONTACTS
        if table.is_file():
            contacts.read(scene, table)
        trace, history = states.record(scene, directory, found, about)
        stepping = about.stepping_s or 0.0
        timing = Timing(
            particles=len(scene.state), steps=scene.n_steps, stepping_s=stepping,
            setup_s=max(0.0, wall - stepping), cores=about.threads,
        )  # fmt: skip
        notes: dict[str, Any] = {
            "command": self.command,
            "scheme": about.scheme,
            "time_step": about.time_step or scene.time.step,
            "digits": found.digits,
            "not_written": found.not_written,
            "contacts": f"{WRITTEN}/{table.name}" if table.is_file() else "",
        }
        warnings = [*checks.warnings(scene), *warnings, *found.warnings]
        version = " ".join(text for text in (about.name, about.version) if text)
        run = Run(self.name, version, scene, directory, timing, warnings, notes, trace, history)
        run.warnings += guards.overlap_warnings(run)
        run.save()
        return run

    def _execute(self, words: list[str], directory: Path) -> float:
        """Wall-clock time [s] of the command. Raises as `__call__` does."""
        begin = time.monotonic()
        with open(directory / STDOUT, "wb") as out, open(directory / STDERR, "wb") as err:
            try:
                process = subprocess.Popen(
                    words, stdin=subprocess.DEVNULL, stdout=out, stderr=err, start_new_session=True
                )
            except OSError as error:
                raise CommandFailed(f"{words[0]}: cannot be started: {error.strerror}") from None
            try:
                status = process.wait(self.timeout)
            except subprocess.TimeoutExpired:
                what = f"{self.name} did not end within {self.timeout:g} s (--with-timeout)"
                raise CodeTimeout(f"{what}\n  {directory / STDERR}") from None
            finally:
                _end(process)
        if status == contract.CANNOT_STATE:
            reason = _tail(directory / STDERR) or _tail(directory / STDOUT) or "it does not say why"
            raise CannotState(reason)
        if status:
            raise CommandFailed(_failure(self.name, status, directory))
        return time.monotonic() - begin


def code_of(command: str, name: str = "own_code", timeout: float = TIME_LIMIT) -> Code:
    """A command as a code under test, to be registered. Raises GpudemError: an unusable command or name."""
    if not (name.isidentifier() and name.isascii()):
        raise GpudemError(f"--with-name = {name!r}: letters, digits and _ only, a letter first")
    style = {"color": "#cc79a7", "linestyle": "-.", "linewidth": 1.6, "zorder": 5}
    return Code(name=name, title=name, run=Process(command, name, timeout), style=style)


def _end(process: subprocess.Popen[bytes]) -> None:
    """End what is left of the process group, also children of a command that has ended."""
    for sign in (signal.SIGTERM, signal.SIGKILL):
        try:
            os.killpg(process.pid, sign)
        except (ProcessLookupError, PermissionError):
            break
        try:
            process.wait(GRACE)
        except subprocess.TimeoutExpired:
            continue


def _failure(name: str, status: int, directory: Path) -> str:
    how = f"was killed by {signal.Signals(-status).name}" if status < 0 else f"ended with status {status}"
    last = _tail(directory / STDERR) or _tail(directory / STDOUT)
    shown = "\n".join(f"  | {line}" for line in last.splitlines()) or "  | (no output)"
    return f"{name} {how}; its last lines:\n{shown}\n  {directory / STDERR}\n  {directory / STDOUT}"


def _tail(path: Path) -> str:
    """The last lines of a log, without what a terminal would act on."""
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - SHOWN_CHARACTERS))
        text = file.read().decode(errors="replace")
    lines = ["".join(c for c in line if c.isprintable()) for line in text.strip().splitlines()]
    return "\n".join(lines[-SHOWN_LINES:])
