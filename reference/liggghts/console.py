"""What LIGGGHTS prints, line by line: thermo rows, errors, warnings, times, where in the deck it is."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable

LOOP = re.compile(r"Loop time of (\S+) on \d+ procs for (\d+) steps with (\d+) atoms")
OUTPUT = re.compile(r"Outpt time \(%\) = (\S+)")
COUNTS = {"Neighbor list builds": "neighbour_list_builds", "Dangerous builds": "dangerous_builds"}
BANNER = re.compile(r"LIGGGHTS \(Version (LIGGGHTS-\S+ [^,]+),")
#: Printed when LIGGGHTS catches a signal; it then ends with exit status 0 as if all were well.
INTERRUPTED = ("SIGINT/SIGTERM", "restart_forced")
#: Warnings about what a deck means to do: contacts with primitives are counted by another way than those with
#: meshes.
EXPECTED = ("Compute wall/gran/local detected primitive wall",)
#: How many deck lines ahead an echoed line is looked for (comments and blanks lie between).
LOOK_AHEAD = 4


@dataclasses.dataclass
class Console:
    """Reads the output of `liggghts -echo screen`, fed line by line."""

    deck: list[str]
    """Lines of the deck, to know which command is being carried out."""
    on_step: Callable[[int], None]
    """Called with the step of each thermo row."""
    version: str = ""
    blocks: list[list[str]] = dataclasses.field(default_factory=list)
    """Thermo rows of each `run`, as printed."""
    errors: list[str] = dataclasses.field(default_factory=list)
    warnings: list[str] = dataclasses.field(default_factory=list)
    loops: list[tuple[float, int, int]] = dataclasses.field(default_factory=list)
    """(seconds, steps, atoms) of each finished `run`."""
    output_s: float = 0.0
    counts: dict[str, int] = dataclasses.field(default_factory=dict)
    interrupted: bool = False
    nan_step: int | None = None
    """First step at which a thermo value was not a number."""
    deck_line: int = 0
    """Number of the deck line being carried out, from 1; 0 before the first."""
    _in_rows: bool = False
    _warning: list[str] | None = None

    @property
    def step(self) -> int:
        """Last step printed."""
        return next((int(b[-1].split()[0]) for b in reversed(self.blocks) if b), 0)

    def feed(self, line: str) -> None:
        """Take in one line."""
        if self._warning is not None:
            self._continue_warning(self._warning, line)
            return
        if self._in_rows and self._row(line):
            return
        if self._echo(line):
            return
        words = line.split()
        if words and words[0] == "Step":
            self.blocks.append([])
            self._in_rows = True
        elif line.startswith("ERROR"):
            self.errors.append(line.strip())
        elif "WARNING" in line:
            self._start_warning(line)
        elif any(text in line for text in INTERRUPTED):
            self.interrupted = True
        elif match := LOOP.match(line):
            self.loops.append((float(match[1]), int(match[2]), int(match[3])))
            self._in_rows = False
        elif match := OUTPUT.match(line):
            self.output_s += float(match[1])
        elif match := BANNER.match(line):
            self.version = match[1]
        elif key := COUNTS.get(line.partition("=")[0].strip()):
            self.counts[key] = self.counts.get(key, 0) + int(line.partition("=")[2])

    def _row(self, line: str) -> bool:
        words = line.split(maxsplit=1)
        if not words or not words[0].isdigit():
            return False
        self.blocks[-1].append(line)
        if self.nan_step is None and ("nan" in line or "inf" in line):
            self.nan_step = int(words[0])
        self.on_step(int(words[0]))
        return True

    def _echo(self, line: str) -> bool:
        wanted = line.rstrip()
        for number in range(self.deck_line, min(self.deck_line + LOOK_AHEAD, len(self.deck))):
            if wanted and wanted == self.deck[number].rstrip():
                self.deck_line = number + 1
                self._in_rows = False
                return True
        return False

    def _start_warning(self, line: str) -> None:
        text = line.partition("WARNING")[2].lstrip(": ").strip()
        if text:
            self._add_warning(text)
        else:  # the text follows on lines of its own, up to a blank one
            self._warning = []

    def _continue_warning(self, text: list[str], line: str) -> None:
        if line.strip():
            text.append(line.strip())
        else:
            self._add_warning(" ".join(text))
            self._warning = None

    def _add_warning(self, text: str) -> None:
        if text not in self.warnings and not any(known in text for known in EXPECTED):
            self.warnings.append(text)
