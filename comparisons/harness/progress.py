"""Progress of runs: a live line on a terminal, plain lines now and then elsewhere, nothing when quiet."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import sys
import time
from collections.abc import Callable
from typing import TextIO

#: Seconds between plain lines (continuous-integration logs).
PLAIN_EVERY = 5.0


@dataclasses.dataclass
class Pace:
    """Speed and time left of one run, from calls with the number of steps done."""

    what: str
    particles: int
    steps: int
    clock: Callable[[], float] = time.monotonic
    done: int = 0
    _first: tuple[float, int] | None = None

    def update(self, done: int) -> None:
        """Note steps done. The clock starts at the first call: compiling is not slow stepping."""
        self.done = done
        if self._first is None:
            self._first = (self.clock(), done)

    @property
    def rate(self) -> float | None:
        """Particle-steps per second; None until it can be told."""
        if self._first is None or self.done <= self._first[1]:
            return None
        elapsed = self.clock() - self._first[0]
        return self.particles * (self.done - self._first[1]) / elapsed if elapsed > 0 else None

    @property
    def left(self) -> float | None:
        """Seconds to go; None until it can be told."""
        return self.particles * (self.steps - self.done) / self.rate if self.rate else None

    def __str__(self) -> str:
        parts = [f"{self.what}  {100 * self.done / self.steps:3.0f} %"]
        if self.rate:
            parts += [f"{quantity(self.rate)} particle-steps/s", f"{duration(self.left or 0.0)} left"]
        return "  ".join(parts)


class Reporter:
    """Says nothing: the quiet reporter, and the base of the others. Several runs may go on at once."""

    def begin(self, what: str, particles: int, steps: int) -> Pace:
        """A run starts: "case variant code", its particles and steps."""
        return Pace(what, particles, steps)

    def step(self, pace: Pace, done: int) -> None:
        """Steps that a run has done so far."""
        pace.update(done)

    def end(self, pace: Pace) -> None:
        """A run is over, well or not."""

    def say(self, line: str) -> None:
        """A line that stays."""

    def close(self) -> None:
        """Nothing more comes."""


class Plain(Reporter):
    """One line every few seconds."""

    def __init__(self, stream: TextIO, every: float = PLAIN_EVERY):
        self.stream, self.every, self.last = stream, every, time.monotonic()

    def step(self, pace: Pace, done: int) -> None:
        """Print if the last line is old enough."""
        super().step(pace, done)
        if time.monotonic() - self.last >= self.every:
            self.say(f"  {pace}")

    def say(self, line: str) -> None:
        """Print now."""
        self.last = time.monotonic()
        with contextlib.suppress(OSError):  # a log or pipe that is closed does not end the run
            print(line, file=self.stream, flush=True)


class Live(Reporter):
    """One line for each run under way that is redrawn, through rich."""

    def __init__(self, stream: TextIO):
        from rich.console import Console
        from rich.progress import BarColumn, Progress, SpinnerColumn, TaskID, TextColumn

        self.bar = Progress(
            SpinnerColumn(), TextColumn("{task.description}"), BarColumn(bar_width=24),
            TextColumn("{task.percentage:3.0f} %"), TextColumn("{task.fields[speed]}"),
            console=Console(file=stream), transient=True, refresh_per_second=5,
        )  # fmt: skip
        self.tasks: dict[int, TaskID] = {}
        self.bar.start()

    def begin(self, what: str, particles: int, steps: int) -> Pace:
        """Show a bar for this run."""
        pace = super().begin(what, particles, steps)
        self.tasks[id(pace)] = self.bar.add_task(what, total=steps, speed="")
        return pace

    def step(self, pace: Pace, done: int) -> None:
        """Move the bar."""
        super().step(pace, done)
        if id(pace) in self.tasks:
            rate, left = pace.rate, pace.left
            speed = f"{quantity(rate)} particle-steps/s  {duration(left or 0.0)} left" if rate else ""
            self.bar.update(self.tasks[id(pace)], completed=done, speed=speed)

    def end(self, pace: Pace) -> None:
        """Take the bar away."""
        if id(pace) in self.tasks:
            self.bar.remove_task(self.tasks.pop(id(pace)))

    def say(self, line: str) -> None:
        """Print above the bars."""
        self.bar.console.print(line, markup=False, highlight=False, soft_wrap=True)

    def close(self) -> None:
        """Give the terminal back."""
        self.bar.stop()


def reporter(quiet: bool = False, stream: TextIO | None = None) -> Reporter:
    """The reporter that fits where the output goes (default: standard error)."""
    out: TextIO = stream or sys.stderr
    if quiet:
        return Reporter()
    return Live(out) if out.isatty() else Plain(out)


def quantity(x: float) -> str:
    """1234567 -> "1.23 M"."""
    for factor, suffix in ((1e9, " G"), (1e6, " M"), (1e3, " k")):
        if abs(x) >= factor:
            return f"{x / factor:.3g}{suffix}"
    return f"{x:.3g}"


def duration(seconds: float) -> str:
    """Wall-clock time as people say it: "0.42 s", "12 s", "3 min 05 s", "2 h 10 min"."""
    if seconds < 10 or not math.isfinite(seconds):
        return f"{seconds:.2g} s"
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"
