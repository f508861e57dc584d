"""Where meshes come during a run: LIGGGHTS ends one in which the center of a triangle is beyond its box."""

from __future__ import annotations

import functools
from collections.abc import Iterator

import numpy as np

from gpudem.scene import Scene

#: States of the run at which a mesh that moves is looked at; fewer for meshes of many triangles.
SAMPLES = 500
#: Centers of triangles that are moved for them, at most.
MOST = 2_000_000


@functools.lru_cache(maxsize=16)
def of_mesh(scene: Scene, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Bounds [m] of the centers of a mesh's triangles at some times of the run, lowest and highest, (k, 3).

    One row for a mesh at rest. Where a servo moves it is not known before, and left out.
    """
    mesh = next(mesh for mesh in scene.meshes if mesh.name == name)
    centers = mesh.corners.mean(axis=1)
    path = scene.paths_of_walls(False).get(name)
    if path is None:
        return centers.min(axis=0)[None], centers.max(axis=0)[None]
    count = max(20, min(SAMPLES, MOST // len(centers)))
    lo, hi = [], []
    for step in np.unique(np.linspace(0, scene.n_steps, count).astype(int)).tolist():
        pose = path.at(step, 1)
        moved = centers @ pose.rotation[0].T + pose.shift[0]
        lo.append(moved.min(axis=0))
        hi.append(moved.max(axis=0))
    return np.array(lo), np.array(hi)


def beyond(scene: Scene) -> dict[str, float]:
    """Closed side, `xlo` to `zhi` -> how far [m] centers of triangles come beyond it, where they do.

    With a margin for what lies between the times looked at: the longest way between two of them.
    """
    found: dict[str, float] = {}
    for mesh in scene.meshes:
        lo, hi = of_mesh(scene, mesh.name)
        between = max(np.abs(np.diff(bound, axis=0)).max(initial=0.0) for bound in (lo, hi))
        for k, axis in enumerate("xyz"):
            ways = {
                f"{axis}lo": scene.domain.lo[k] - lo[:, k].min(),
                f"{axis}hi": hi[:, k].max() - scene.domain.hi[k],
            }
            for side, way in ways.items():
                if way + between > 0 and not scene.domain.periodic[k] and side not in scene.domain.sides:
                    found[side] = max(found.get(side, 0.0), float(way + between))
    return found


def problems(scene: Scene, name: str) -> Iterator[str]:
    """Open sides that centers of a mesh's triangles come beyond, after the name of the mesh."""
    lo, hi = of_mesh(scene, name)
    for k, axis in enumerate("xyz"):
        ends = {f"{axis}lo": (lo[:, k].min(), -1), f"{axis}hi": (hi[:, k].max(), 1)}
        for side, (place, sign) in ends.items():
            bound = (scene.domain.lo if sign < 0 else scene.domain.hi)[k]
            if side in scene.domain.sides and sign * (place - bound) > 0:
                yield (
                    f": the center of a triangle comes to {axis} = {place:.6g} m, beyond the open side"
                    f" {side}: LIGGGHTS loses it; allowed: {'>=' if sign < 0 else '<='} {bound:g} m (smaller"
                    " triangles at the side, or a larger domain)"
                )
