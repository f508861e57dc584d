"""Particles that leave while a scene runs: through open sides of the domain.

A particle leaves at the first rebuild of the neighbor list that finds its center beyond an open side: before
the forces of that step, in contact until then. So it is in LIGGGHTS. Its id is not used again.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from gpudem.scene.types import Vector

if TYPE_CHECKING:
    from gpudem.scene.model import Scene


@dataclasses.dataclass(frozen=True)
class Exit:
    """Where particles leave: beyond a plane."""

    name: str
    """Of the columns of a history: removed_NAME, ..."""
    point: Vector
    """Of the plane [m]."""
    inwards: Vector
    """Its unit normal, away from where particles leave."""


def exits(scene: Scene) -> list[Exit]:
    """The open sides of a scene, in the order xlo, xhi, ylo, ...: of several beyond, the first counts."""
    found = []
    for side in sorted(scene.domain.sides, key=lambda s: (s[0], s != f"{s[0]}lo")):
        axis, sign = "xyz".index(side[0]), 1.0 if side.endswith("lo") else -1.0
        point = scene.domain.lo if sign > 0 else scene.domain.hi
        x, y, z = (sign * (k == axis) for k in range(3))
        found.append(Exit(side, point, (x, y, z)))
    return found


def search_box(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """(lo, hi) [m] of where particles can be at a rebuild: the domain, and a margin beyond its open sides.

    Between two rebuilds a particle moves half the skin, and in the step before the second one its radius at
    most, to which the guard of the speed holds it.
    """
    lo, hi = np.array(scene.domain.lo), np.array(scene.domain.hi)
    for side in scene.domain.sides:
        axis, margin = "xyz".index(side[0]), scene.skin + float(scene.state.radius.max())
        if side.endswith("lo"):
            lo[axis] -= margin
        else:
            hi[axis] += margin  # mutate: margin_beyond_side
    return lo, hi


def problems(scene: Scene) -> list[str]:
    """Open sides that are periodic, or closed by a wall that stays."""
    found = []
    for side in scene.domain.sides:
        axis = "xyz".index(side[0])
        key = f"domain.sides.{side} = 'outflow'"
        if scene.domain.periodic[axis]:
            found.append(f"{key}: {side[0]} is periodic; a side is one of both")
        low = side.endswith("lo")
        place = (scene.domain.lo if low else scene.domain.hi)[axis]
        for plane in scene.planes:
            normal = [0.0, 0.0, 0.0]
            normal[axis] = 1.0 if low else -1.0
            beside = (place - plane.point[axis]) * normal[axis] <= 0
            if list(plane.normal) == normal and beside and plane.end is None and not plane.moves:
                found.append(f"{key}: wall {plane.name} stands there to the end; nothing can leave")
    return found
