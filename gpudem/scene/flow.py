"""Flow through planes: which particles have passed, from where they came and where they are, or left."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from gpudem.scene.sections import FlowPlane
from gpudem.scene.walls import box_corners

if TYPE_CHECKING:
    from gpudem.scene.model import Scene


def beyond(plane: FlowPlane, position: np.ndarray) -> np.ndarray:
    """Whether centers, shape (n, 3) [m], are on the side of the plane's normal, shape (n,)."""
    return (position - np.array(plane.point)) @ np.array(plane.normal) > 0


def passed(scene: Scene, plane: FlowPlane, rows: np.ndarray, position: np.ndarray) -> tuple[int, float]:
    """Net number and mass [kg] of particles that have passed a plane along its normal since they came.

    rows, position: of the scene's particles where they are, or were when they left [m]; others have not come.
    """
    first, last = beyond(plane, scene.state.position[rows]), beyond(plane, position)
    mass = scene.masses[rows]
    forth, back = last & ~first, first & ~last  # mutate: sides_of_flow
    return int(forth.sum() - back.sum()), float(mass[forth].sum() - mass[back].sum())


def problems(scene: Scene) -> list[str]:
    """Planes that nothing can pass, or whose sides a periodic side joins."""
    planes, found = scene.output.flow, []
    if planes and scene.output.history_every is None:
        found.append("output.flow: has no effect without output.history_every")
    names = Counter(plane.name for plane in planes)
    found += [f"output.flow: name {name!r} given twice" for name, count in names.items() if count > 1]
    corners = box_corners(np.array(scene.domain.lo), np.array(scene.domain.hi))
    for plane in planes:
        across = [a for a, n, p in zip("xyz", plane.normal, scene.domain.periodic, strict=True) if n and p]
        if across:
            axis = across[0]
            found.append(
                f"output.flow: {plane.name}.normal: {axis} is periodic: both sides of a plane are one"
            )
        side = beyond(plane, corners)
        if side.all() or not side.any():
            found.append(f"output.flow: {plane.name}.point: the domain lies on one side of the plane")
    return found
