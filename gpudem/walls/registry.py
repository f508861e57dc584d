"""The kinds of walls by name: those in the files beside this one, and those of other packages.

Another package adds a kind by an entry point of the group `gpudem.walls` that leads to its `WallKind`, or at
run time by `register`. Its section is a `gpudem.scene.walls.Wall`: what a scene file says of such a wall,
and its geometry on the host.
"""

from __future__ import annotations

import dataclasses
import functools
import importlib
from typing import Any

from gpudem.entry_points import load_entry_points
from gpudem.errors import GpudemError

GROUP = "gpudem.walls"


@dataclasses.dataclass(frozen=True)
class WallKind:
    """One kind of wall.

    surface(walls, w, x) -> (gap [m] of the point x from wall w, positive on the particles' side; unit normal
    at the nearest point of the wall, towards x), a `wp.func`. It reads `walls.direction`, `walls.point` and
    `walls.size`, three vectors for each wall, which `section.shape()` gives.
    """

    name: str
    surface: Any
    section: Any = None
    """The scene's section class; None for those that come with gpudem."""


_registered: dict[str, WallKind] = {}


def register(kind: WallKind) -> None:
    """Add a kind for this process. Raises GpudemError: not a kind, or the name is taken by another one."""
    if not isinstance(kind, WallKind):
        raise GpudemError(f"{kind!r} is not a WallKind")
    known = _registered.get(kind.name) or _built_in(kind.name)
    if kind.name == "box" or (known is not None and known is not kind):
        raise GpudemError(f"walls: there is another kind named {kind.name!r}")
    _registered[kind.name] = kind


def find(name: str) -> WallKind | None:
    """The kind of this name; None for an unknown one."""
    found = _registered.get(name) or _built_in(name)
    if found is None:
        _load_entry_points()
        found = _registered.get(name)
    return found


def sections() -> dict[str, Any]:
    """Section classes of the kinds of other packages, by name."""
    _load_entry_points()
    return {name: kind.section for name, kind in _registered.items() if kind.section is not None}


def kind(name: str) -> WallKind:
    """The kind of this name. Raises GpudemError: unknown."""
    found = find(name)
    if found is None:
        raise GpudemError(f"walls: no kind named {name!r}")
    return found


@functools.cache
def _built_in(name: str) -> WallKind | None:
    module = f"gpudem.walls.{name}"
    if not name.isidentifier() or name == "registry":
        return None
    try:
        return getattr(importlib.import_module(module), "KIND", None)
    except ModuleNotFoundError as error:
        if error.name != module:
            raise
        return None


@functools.cache
def _load_entry_points() -> None:
    """Those of installed packages, once."""
    load_entry_points(GROUP, register)
