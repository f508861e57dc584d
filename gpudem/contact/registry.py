"""The contact laws by slot and name: those in the folders beside this file, and those of other packages.

Another package adds a law by an entry point of the group `gpudem.laws` that leads to its `Law` object, or at
run time by `register`:

    [project.entry-points."gpudem.laws"]
    my_spring = "my_package.my_spring:LAW"
"""

from __future__ import annotations

import functools
import importlib
import pkgutil
from typing import Any

from gpudem.contact.law import Law, Slot
from gpudem.entry_points import load_entry_points
from gpudem.errors import GpudemError

GROUP = "gpudem.laws"
SLOTS: tuple[Slot, ...] = ("normal", "tangential", "rolling", "cohesion")
#: The name of an empty slot.
OFF = "off"

_registered: dict[tuple[str, str], Law] = {}


def register(law: Law) -> None:
    """Add a law for this process. Raises GpudemError: not a law, or the name is taken by another one."""
    if not isinstance(law, Law) or getattr(law, "slot", None) not in SLOTS:
        bases = "NormalLaw, TangentialLaw, RollingLaw or CohesionLaw"
        raise GpudemError(f"{law!r} is not a contact law: derive from {bases}")
    key = (law.slot, law.name)
    known = _registered.get(key) or _built_in(*key)
    if law.name == OFF or (known is not None and known is not law):
        raise GpudemError(f"contact.{law.slot} = {law.name!r}: there is another law of this name")
    _registered[key] = law


def find(slot: str, name: str) -> Law | None:
    """The law of this name; None for an unknown one, or for "off"."""
    if name == OFF:
        return None
    found = _registered.get((slot, name)) or _built_in(slot, name)
    if found is None:
        _load_entry_points()
        found = _registered.get((slot, name))
    return found


def law(slot: str, name: str) -> Any:
    """The law of this name. Raises GpudemError: unknown; names those known."""
    found = find(slot, name)
    if found is None:
        raise GpudemError(f"contact.{slot} = {name!r}: no such law; known: {', '.join(names(slot))}")
    return found


def names(slot: str) -> list[str]:
    """Every name that the slot takes, built-in laws first; "off" where the slot may be empty."""
    _load_entry_points()
    package = importlib.import_module(f"gpudem.contact.{slot}")
    modules = sorted(m.name for m in pkgutil.iter_modules(package.__path__))
    found = [importlib.import_module(f"{package.__name__}.{name}").LAW.name for name in modules]
    found += sorted(name for s, name in _registered if s == slot and name not in found)
    return found if slot == "normal" else [OFF, *found]


@functools.cache
def _built_in(slot: str, name: str) -> Law | None:
    """The law of a file beside this one, found by its name, so that no other law is imported."""
    module = f"gpudem.contact.{slot}.{name.replace('/', '_')}"
    if not name.replace("/", "_").isidentifier():
        return None
    try:
        found = importlib.import_module(module).LAW
    except ModuleNotFoundError as error:
        if error.name != module:
            raise
        return None
    return found if found.name == name else None


@functools.cache
def _load_entry_points() -> None:
    """Those of installed packages, once."""
    load_entry_points(GROUP, register)
