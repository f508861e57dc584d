"""Spheres side by side, each of a material of its own, so that each has its own restitution and friction."""

from __future__ import annotations

from typing import Any

from gpudem.scene import Pair, Plane


def every_pair(names: list[str], stated: list[Pair], **others: Any) -> list[Pair]:
    """The pairs stated, and all others of these materials, which never meet: both codes want the whole table.

    `others`: properties of the others; e = 1 without friction if none are given.
    """
    known = {frozenset(p.materials) for p in stated}
    rest = [(a, b) for k, a in enumerate(names) for b in names[k:] if frozenset((a, b)) not in known]
    return [*stated, *(Pair(materials=pair, **others) for pair in rest)]


def floor(material: str = "floor") -> Plane:
    """The plane z = 0, named "floor"."""
    return Plane(name="floor", material=material, point=(0, 0, 0), normal=(0, 0, 1))
