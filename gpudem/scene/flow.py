"""Flow through planes and faces: which particles have passed.

Of a plane across the domain it follows from where they came and where they are, or left. Through a face of
limited size a particle passes in the step in which its center comes to the other side of the plane of the
face, if the straight line between its places before and after that step meets the plane within the face.
"""

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
    return (position - plane.origin) @ plane.direction > 0


def passed(scene: Scene, plane: FlowPlane, rows: np.ndarray, position: np.ndarray) -> tuple[int, float]:
    """Net number and mass [kg] of particles that have passed a plane along its normal since they came.

    rows, position: of the scene's particles where they are, or were when they left [m]; others have not come.
    """
    first, last = beyond(plane, scene.state.position[rows]), beyond(plane, position)
    mass = scene.masses[rows]
    forth, back = last & ~first, first & ~last  # mutate: sides_of_flow
    return int(forth.sum() - back.sum()), float(mass[forth].sum() - mass[back].sum())


def faces(scene: Scene) -> list[FlowPlane]:
    """Those of `output.flow` that are faces of limited size."""
    return [plane for plane in scene.output.flow if plane.face is not None]


def problems(scene: Scene) -> list[str]:
    """Planes that nothing can pass, or whose sides a periodic side joins; faces that leave the domain."""
    planes, found = scene.output.flow, []
    if planes and scene.output.history_every is None:
        found.append("output.flow: has no effect without output.history_every")
    names = Counter(plane.name for plane in planes)
    found += [f"output.flow: name {name!r} given twice" for name, count in names.items() if count > 1]
    lo, hi = np.array(scene.domain.lo), np.array(scene.domain.hi)
    for plane in planes:
        kind, place, way = "plane", "point", "normal"
        if plane.face is not None:
            kind, place, way = "face", "face", "face"
            low, high = plane.face.bounds()
            slack = 1e-9 * (hi - lo)
            if (low < lo - slack).any() or (high > hi + slack).any():
                found.append(
                    f"output.flow: {plane.name}.face: reaches from {tuple(low.tolist())} to"
                    f" {tuple(high.tolist())} m, outside the domain {scene.domain.lo} .. {scene.domain.hi} m"
                )
                continue
        across = [a for a, n, p in zip("xyz", plane.direction, scene.domain.periodic, strict=True) if n and p]
        if across:
            key, axis = f"output.flow: {plane.name}.{way}", across[0]
            found.append(f"{key}: {axis} is periodic: both sides of a {kind} are one")
        side = beyond(plane, box_corners(lo, hi))
        if side.all() or not side.any():
            found.append(f"output.flow: {plane.name}.{place}: the domain lies on one side of the {kind}")
    return found
