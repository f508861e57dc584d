"""Decks that differ from `render`'s in one named way: what LIGGGHTS does without our guards, for the report.

A closed list. Nothing but the report's findings comes here; a run for comparison is `reference.liggghts.run`.
"""

from __future__ import annotations

import dataclasses
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gpudem.errors import GpudemError
from gpudem.output.directory import begin
from gpudem.output.run import Run, Timing
from gpudem.scene import Scene
from reference.liggghts import binary as program
from reference.liggghts import dump
from reference.liggghts.console import Console
from reference.liggghts.deck import LOG, RAW, TRACE, Deck, render
from reference.liggghts.runner import command, environment, execute

#: Wall-clock limit of a run that nobody watches [s].
PATIENCE = 120.0


@dataclasses.dataclass(frozen=True)
class Deviation:
    """One way to differ."""

    what: str
    edit: Callable[[Deck], Deck]
    watched: bool = True
    """Followed and believed as any run; else run blindly, and its end told as the binary tells it."""


def _without(words: str) -> Callable[[Deck], Deck]:
    def edit(deck: Deck) -> Deck:
        if deck.text.count(words) != 1:
            raise GpudemError(f"the deck says {words!r} {deck.text.count(words)} times, not once")
        return dataclasses.replace(deck, text=deck.text.replace(words, ""))

    return edit


def _in_two_runs(deck: Deck) -> Deck:
    """Three eighths of the steps, then the rest."""
    (whole,) = deck.segments
    middle = whole.first + 3 * (whole.last - whole.first) // 8
    parts = (
        dataclasses.replace(whole, last=middle),
        dataclasses.replace(whole, first=middle),
    )
    head, found, tail = deck.text.rpartition(f"run             {whole.last - whole.first}\n")
    if not found or tail:
        raise GpudemError("the deck does not end with its run")
    runs = "".join(f"run             {s.last - s.first}\n" for s in parts)
    return dataclasses.replace(deck, text=head + runs, segments=parts)


DEVIATIONS = {
    "default_contact_distance_factor": Deviation(
        "no `contact_distance_factor 1.01`: LIGGGHTS' default, 1.0", _without(" contact_distance_factor 1.01")
    ),
    "two_runs": Deviation("`run 300` and `run 500` for `run 800`", _in_two_runs),
    "unguarded": Deviation(
        "no `lost error`: LIGGGHTS' default, ignore; nobody reads what is printed",
        _without("lost error "),
        watched=False,
    ),
    "raw_frames": Deviation("the same deck; the VTK files stay as LIGGGHTS wrote them", lambda deck: deck),
}


def run(
    scene: Scene, directory: Path, deviation: str, progress: Callable[[int], None] | None = None
) -> Run:  # fmt: skip
    """Run a scene with a deck of the list; raw dumps are left as they are.

    The notes of an unwatched run tell its end: exit_status, steps, particles, lost, nan, errors.

    Raises:
        GpudemError: a deviation that is not in the list, no binary, or (watched) a run that failed.
    """
    if deviation not in DEVIATIONS:
        raise GpudemError(f"deviation = {deviation!r}: unknown; known: {', '.join(DEVIATIONS)}")
    chosen, directory = DEVIATIONS[deviation], Path(directory)
    deck, binary = chosen.edit(render(scene)), program.find_liggghts()
    notes: dict[str, Any] = {"deck_hash": deck.hash, "deviation": f"{deviation}: {chosen.what}"}
    traced, history = None, None
    begin(directory, scene)
    began = time.monotonic()
    if chosen.watched:
        outcome = execute(deck, directory, binary, progress=progress)
        console, loop_s = outcome.console, outcome.loop_s
        if scene.output.trace_every is not None:
            traced = dump.trace(scene, directory / TRACE)
        if len(deck.segments) == len(scene.segments):
            history = dump.history(scene, console.blocks, directory / RAW)
    else:
        console, status = _blindly(deck, directory, binary)
        loop_s = sum(seconds for seconds, _, _ in console.loops)
        notes |= _end(console, status, len(scene.state))
    timing = Timing(
        particles=scene.mean_count(scene.n_steps), steps=scene.n_steps,
        stepping_s=max(0.0, loop_s - console.output_s),
        setup_s=max(0.0, time.monotonic() - began - loop_s), output_s=console.output_s,
    )  # fmt: skip
    result = Run(
        "liggghts", console.version, scene, directory, timing, list(console.warnings), notes, traced, history
    )
    result.save()
    return result


def _blindly(deck: Deck, directory: Path, binary: str) -> tuple[Console, int]:
    """Run to whatever end; (what was printed, exit status)."""
    deck.write(directory)
    try:
        with environment(1) as variables:
            done = subprocess.run(
                command(binary, 1), cwd=directory, env=variables, stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
                timeout=PATIENCE, check=False,
            )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise GpudemError(f"LIGGGHTS did not end within {PATIENCE:g} s in {directory}") from None
    (directory / LOG).write_text(done.stdout)
    console = Console(deck.text.splitlines(), lambda step: None)
    for line in done.stdout.splitlines():
        console.feed(line)
    return console, done.returncode


def _end(console: Console, status: int, particles: int) -> dict[str, Any]:
    """How an unwatched run ended, by its exit status and its last lines."""
    left = console.loops[-1][2] if console.loops else -1
    return {
        "exit_status": status, "steps": console.step, "particles": left, "lost": particles - left,
        "nan": console.nan_step is not None, "errors": console.errors,
    }  # fmt: skip
