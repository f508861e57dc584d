"""The triangles of a scene's meshes on the device: corners, normals, shared corners, search trees."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import warp as wp

from gpudem.scene import Scene
from gpudem.solver.state import State


class MeshTables:
    """Puts the triangles of all meshes of a scene into a struct `Walls`; holds what the device refers to."""

    def __init__(self, scene: Scene, state: State):
        self.scene, self.state = scene, state
        self._trees: list[Any] = []
        self._arrays: dict[str, Any] = self._build() if scene.meshes else {}

    def _build(self) -> dict[str, Any]:
        elements, device, t = self.scene.wall_elements, self.state.device, self.state.types
        owner, corners, nodes, active = [], [], [], []
        bvh, first = np.zeros(len(elements), np.uint64), np.zeros(len(elements), np.int32)
        cosine = np.cos(np.radians(self.scene.contact.mesh_curvature))
        for w, wall in enumerate(elements):
            if wall not in self.scene.meshes:
                continue
            triangles = wall.corners  # type: ignore[attr-defined]
            first[w] = sum(map(len, corners))
            own = shared_corners(triangles)
            corners.append(triangles)
            nodes.append(own + sum(len(n) * 3 for n in nodes))
            active.append(active_features(own, unit_normals(triangles), cosine))
            owner.append(np.full(len(triangles), w, np.int32))
            bvh[w] = self._tree(triangles).id
        joined = np.concatenate(corners)

        def table(values: np.ndarray, dtype: Any) -> Any:
            return wp.array(values, dtype=dtype, device=device)

        return {
            "bvh": table(bvh, wp.uint64), "first_triangle": table(first, wp.int32),
            "triangle_wall": table(np.concatenate(owner), wp.int32),
            "corners": table(joined.reshape(-1, 3), t.wide3), "facing": table(unit_normals(joined), t.wide3),
            "nodes": table(np.concatenate(nodes).astype(np.int32), wp.vec3i),
            "active": table(np.concatenate(active), wp.int32),
        }  # fmt: skip

    def _tree(self, triangles: np.ndarray) -> Any:
        """A tree over boxes around the triangles, in float32, rounded outwards."""
        low, high = triangles.min(axis=1).astype(np.float32), triangles.max(axis=1).astype(np.float32)
        low, high = np.nextafter(low, np.float32(-np.inf)), np.nextafter(high, np.float32(np.inf))
        boxes = [wp.array(side, dtype=wp.vec3, device=self.state.device) for side in (low, high)]
        self._trees.append(wp.Bvh(*boxes))
        return self._trees[-1]

    def attach(self, walls: Any) -> None:
        """Let a struct `Walls` refer to them."""
        for name, array in self._arrays.items():
            setattr(walls, name, array)

    @property
    def bytes_per_triangle(self) -> float:
        """Device memory of the tables, search trees included [B]."""
        tables = sum(a.capacity for name, a in self._arrays.items())
        count = len(self._arrays["triangle_wall"]) if self._arrays else 0
        return (tables + 88 * count) / max(1, count)  # a tree: boxes twice, and two nodes of 32 bytes


def unit_normals(triangles: np.ndarray) -> np.ndarray:
    """Unit normals, by the right-hand rule of the corners: shape (k, 3)."""
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return normal / np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]


def shared_corners(triangles: np.ndarray) -> np.ndarray:
    """A number for each place of a corner, shape (k, 3): equal where triangles meet."""
    points = triangles.reshape(-1, 3)
    size = max(float(np.ptp(points, axis=0).max()), 1e-300)
    _, number = np.unique(np.round(points / (1e-9 * size)).astype(np.int64), axis=0, return_inverse=True)
    return number.reshape(-1, 3)


def active_features(nodes: np.ndarray, normals: np.ndarray, cosine: float) -> np.ndarray:
    """Which edges (bits 0 to 2) and corners (bits 3 to 5) of each triangle count by LIGGGHTS' rule: (k,).

    An edge of one triangle is active; one that coplanar triangles share is not; else it is for the triangle
    that comes last. A corner is active for the last triangle there, unless no edge at it is active.
    Source: black-box runs of LIGGGHTS 3.8.0 (docs, "meshes").
    """
    count = len(nodes)
    active = np.zeros((count, 6), bool)
    edges: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for e in range(count):
        for k in range(3):
            a, b = sorted((int(nodes[e, k]), int(nodes[e, (k + 1) % 3])))
            edges.setdefault((a, b), []).append((e, k))
    at_active: set[int] = set()
    for (a, b), users in edges.items():
        flat = len(users) > 1 and all(
            normals[d] @ normals[e] >= cosine for (d, _), (e, _) in itertools.pairwise(users)
        )
        if not flat:
            active[max(users)] = True
            at_active |= {a, b}
    last = np.zeros(int(nodes.max()) + 1, np.int64)
    np.maximum.at(last, nodes.ravel(), np.repeat(np.arange(count), 3))
    for e in range(count):
        for k in range(3):
            active[e, 3 + k] = last[nodes[e, k]] == e and int(nodes[e, k]) in at_active
    return (active @ (1 << np.arange(6))).astype(np.int32)
