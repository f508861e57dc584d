"""The codes that a scene can go through, by name: gpudem's two engines, every folder of `reference/` with a
module `code`, and those of other packages (entry-point group `gpudem.codes`).
"""

from __future__ import annotations

import dataclasses
import difflib
import importlib
import importlib.util
import pkgutil
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import reference
from gpudem.entry_points import load_entry_points
from gpudem.errors import GpudemError
from gpudem.output.run import Run
from gpudem.scene import Scene
from reference.code import Code, Options, Progress, Role

ENTRY_POINTS = "gpudem.codes"

#: Roles whose runs are compared step by step.
STEPPED: tuple[Role, ...] = ("under_test", "reference")


def _gpudem(
    scene: Scene, directory: Path, options: Options, progress: Progress, extra: dict[str, Any]
) -> Run:
    from gpudem import driver

    arguments = dataclasses.asdict(options)
    del arguments["ranks"]
    arguments |= extra
    return driver.simulate(scene, directory, progress=progress, **arguments)


def _threads(cores: int) -> dict[str, Any]:
    return {"threads": cores}


def _event_driven(
    scene: Scene, directory: Path, options: Options, progress: Progress, extra: dict[str, Any]
) -> Run:
    from gpudem import event_driven  # one thread, float64, no steps: the options do not concern it

    return event_driven.run(scene, directory, progress=progress, **extra)


CODES: dict[str, Code] = {}


def register(code: Any) -> None:
    """Add a code. Raises GpudemError: not a `Code`, or its name is taken by another."""
    if not isinstance(code, Code):
        raise GpudemError(f"{ENTRY_POINTS}: {code!r} is no reference.code.Code")
    if CODES.setdefault(code.name, code) is not code:
        raise GpudemError(f"{ENTRY_POINTS}: two codes are called {code.name!r}; names must differ")


def _register_all() -> None:
    style = {"color": "#0072b2", "linestyle": "-", "linewidth": 1.8, "zorder": 3}
    register(Code("gpudem", "gpudem", _gpudem, on_cores=_threads, style=style))
    for module in pkgutil.iter_modules(reference.__path__):
        if module.ispkg and importlib.util.find_spec(f"reference.{module.name}.code"):
            register(importlib.import_module(f"reference.{module.name}.code").CODE)
    style = {"color": "#009e73", "linestyle": "--", "linewidth": 1.5, "zorder": 2}
    register(Code("event_driven", "event-driven", _event_driven, role="engine", style=style))
    load_entry_points(ENTRY_POINTS, register)


_register_all()


def register_command(command: str, name: str, timeout: float) -> str:
    """Register a code behind a command, under test; its name. Raises GpudemError: not usable."""
    from reference.process import code_of

    register(code_of(command, name, timeout))
    return name


def select(names: Iterable[str]) -> tuple[str, ...]:
    """The names, each once, checked. Raises GpudemError for one that is no code, with the nearest known."""
    chosen = tuple(dict.fromkeys(name.strip() for name in names if name.strip()))
    for name in chosen:
        if name not in CODES:
            near = difflib.get_close_matches(name, CODES, n=1)
            hint = f"did you mean {near[0]!r}? " if near else ""
            raise GpudemError(f"no code {name!r}; {hint}known: {', '.join(CODES)}")
    if not chosen:
        raise GpudemError(f"no code is named; known: {', '.join(CODES)}")
    return chosen


def title(code: str) -> str:
    """The name to show for a code."""
    return CODES[code].title if code in CODES else code


def missing(code: str) -> str:
    """Why a code cannot run on this machine and how to get it; empty if it can, or is not known."""
    return CODES[code].missing() if code in CODES else ""


def unit(code: str) -> str:
    """What a code's `Timing.cores` counts: core, rank."""
    return CODES[code].unit if code in CODES else "core"


def stepped(selected: Sequence[str]) -> tuple[str, ...]:
    """Those of the selected codes that advance a scene step by step."""
    return tuple(name for name in selected if name in CODES and CODES[name].role in STEPPED)


def references(selected: Sequence[str]) -> tuple[str, ...]:
    """Those of the selected codes that others are compared with."""
    return tuple(name for name in stepped(selected) if CODES[name].role == "reference")


def brought(code: str) -> bool:
    """Whether a code to be tested is not gpudem's own."""
    return code != "gpudem" and code in CODES and CODES[code].role == "under_test"


def built_in() -> tuple[str, ...]:
    """Every code but those that a user brought: those that a case of gpudem is written for."""
    return tuple(name for name in CODES if not brought(name))


def pairs(selected: Sequence[str]) -> list[tuple[str, str]]:
    """(code under test, code it is compared with) of the selected ones.

    Each code under test is compared with each reference; one that a user brought (any but gpudem) is
    compared with gpudem where that is selected, which is compared with the references itself.
    """
    chosen = stepped(selected)
    found = []
    for name in chosen:
        if CODES[name].role == "under_test":
            against = ["gpudem"] if brought(name) and "gpudem" in chosen else references(chosen)
            found += [(name, other) for other in against]
    return found
