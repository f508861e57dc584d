"""What a code is to the harness: its name, its role and one function that runs a scene.

A reference code is one folder below `reference/` with a module `code` that holds `CODE`; other packages add
theirs by the entry-point group `gpudem.codes`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

from gpudem.output.run import Run
from gpudem.scene import Scene

#: Called with the number of steps done.
Progress = Callable[[int], None]

#: under_test: its results are judged; reference: others are compared with it; engine: another method, such
#: as event-driven hard spheres, for which checks step by step mean nothing.
Role = Literal["under_test", "reference", "engine"]


@dataclasses.dataclass(frozen=True)
class Options:
    """How codes run, as the command line says; each code takes what concerns it."""

    device: str = "cpu"
    precision: str | None = None
    """Overrides the scene's; None keeps it."""
    threads: int | None = None
    """Cores of gpudem's CPU device; None: all."""
    ranks: int = 1
    """MPI ranks of a code that has them."""


def no_options(cores: int) -> dict[str, Any]:
    """For a code whose number of cores cannot be set."""
    return {}


#: (scene, directory, options, progress, keyword arguments of the variant) -> run.
RunFunction = Callable[[Scene, Path, Options, Progress, dict[str, Any]], Run]


def never_missing() -> str:
    """For a code that is always at hand."""
    return ""


@dataclasses.dataclass(frozen=True)
class Code:
    """A code that a scene can go through."""

    name: str
    """As in `--codes`; lower-case letters, digits and `_`."""
    title: str
    """The name people know it by."""
    run: RunFunction
    """(scene, directory, options, progress, keyword arguments of the variant) -> run.

    Raises CodeMissing, CannotState or CodeTimeout of `reference.errors` for these, another GpudemError for
    a run that failed.
    """
    role: Role = "under_test"
    unit: str = "core"
    """What `Timing.cores` counts: core, rank."""
    on_cores: Callable[[int], dict[str, Any]] = no_options
    """Keyword arguments of a run that is timed on so many cores; no output of an earlier run stands in."""
    missing: Callable[[], str] = never_missing
    """Why the code cannot run on this machine and how to get it; empty if it can."""
    style: dict[str, Any] = dataclasses.field(default_factory=dict)
    """Arguments of matplotlib's `plot` that draw it in figures."""
