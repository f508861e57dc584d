"""The codes that a scene can go through: name -> run function with the command line's options.

A new code is one function and one line in `CODES`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gpudem.output.run import Run
from gpudem.scene import Scene

#: Called with the number of steps done.
Progress = Callable[[int], None]


@dataclasses.dataclass(frozen=True)
class Options:
    """What the command line says about how codes run; each code takes what concerns it."""

    device: str = "cpu"
    precision: str | None = None
    """Overrides the scene's; None keeps it."""
    threads: int | None = None
    """Cores of gpudem's CPU device; None: all."""
    ranks: int = 1
    """MPI ranks of LIGGGHTS."""


@dataclasses.dataclass(frozen=True)
class Code:
    """One code: the name people know it by, and how to run it."""

    title: str
    run: Callable[[Scene, Path, Options, Progress, dict[str, Any]], Run]


def _gpudem(
    scene: Scene, directory: Path, options: Options, progress: Progress, extra: dict[str, Any]
) -> Run:
    from gpudem import driver

    arguments = dataclasses.asdict(options)
    del arguments["ranks"]
    arguments |= extra
    return driver.simulate(scene, directory, progress=progress, **arguments)


def _liggghts(
    scene: Scene, directory: Path, options: Options, progress: Progress, extra: dict[str, Any]
) -> Run:
    from reference import liggghts
    from reference.liggghts import deviations

    if "deviation" in extra:  # a deck of the closed list of the report's findings
        return deviations.run(scene, directory, progress=progress, **extra)
    arguments: dict[str, Any] = {"ranks": options.ranks} | extra
    return liggghts.run(scene, directory, progress=progress, **arguments)


def _event_driven(
    scene: Scene, directory: Path, options: Options, progress: Progress, extra: dict[str, Any]
) -> Run:
    from gpudem import event_driven  # one thread, float64, no steps: the options do not concern it

    return event_driven.run(scene, directory, progress=progress, **extra)


CODES: dict[str, Code] = {
    "gpudem": Code("gpudem", _gpudem),
    "liggghts": Code("LIGGGHTS", _liggghts),
    "event_driven": Code("event-driven", _event_driven),
}


def title(code: str) -> str:
    """The name to show for a code."""
    return CODES[code].title if code in CODES else code
