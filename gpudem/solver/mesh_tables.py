"""The triangles of a scene's meshes on the device: corners, normals, shared corners, search trees."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from gpudem.errors import SimulationError
from gpudem.scene import Scene
from gpudem.scene.mesh import Mesh
from gpudem.solver.state import State

#: Device memory of a search tree, a triangle [B]: its box twice, and two nodes of 32 bytes.
TREE_BYTES = 2 * 24 + 2 * 32


class MeshTables:
    """Puts the triangles of all meshes of a scene into a struct `Walls`; holds what the device refers to.

    Raises SimulationError for a triangle too long for periodic sides (`longest_triangle`).
    """

    def __init__(self, scene: Scene, state: State):
        self.scene, self.state = scene, state
        self._trees: list[Any] = []
        self.triangles = 0
        self._arrays: dict[str, Any] = self._build() if scene.meshes else {}

    def _build(self) -> dict[str, Any]:
        elements, t = self.scene.wall_elements, self.state.types
        meshes = {w: wall.corners for w, wall in enumerate(elements) if isinstance(wall, Mesh)}
        count = np.array([len(meshes.get(w, ())) for w in range(len(elements))])
        joined = np.concatenate(list(meshes.values()))
        self.triangles = len(joined)
        self._check_lengths(meshes)
        trees = [self._tree(meshes[w]).id if w in meshes else 0 for w in range(len(elements))]
        middle, extent = bounding_spheres(joined)
        normals = unit_normals(joined)
        tables: dict[str, tuple[Any, Any]] = {
            "bvh": (np.array(trees, np.uint64), wp.uint64),
            "first_triangle": ((np.cumsum(count) - count).astype(np.int32), wp.int32),
            "triangle_wall": (np.repeat(np.arange(len(elements), dtype=np.int32), count), wp.int32),
            "corners": (joined.reshape(-1, 3), t.wide3), "facing": (normals, t.wide3),
            "middle": (middle, t.wide3), "extent": (extent, t.wide),
        }  # fmt: skip
        if self.state.spec.meshes == "liggghts":
            tables |= self._neighborhood(meshes)
        if any(self.state.spec.periodic):
            points = [meshes.get(w, np.zeros((1, 3))).reshape(-1, 3) for w in range(len(elements))]
            center = np.array([(p.min(axis=0) + p.max(axis=0)) / 2 for p in points])
            radius = [np.linalg.norm(p - c, axis=1).max() for p, c in zip(points, center, strict=True)]
            tables |= {"mesh_center": (center, t.wide3), "mesh_radius": (np.array(radius) * 1.001, t.wide)}
        device = self.state.device
        return {
            name: wp.array(values, dtype=dtype, device=device) for name, (values, dtype) in tables.items()
        }

    def _neighborhood(self, meshes: dict[int, np.ndarray]) -> dict[str, tuple[Any, Any]]:
        """What only LIGGGHTS' rule asks for: which corners agree, which features are active."""
        cosine = np.cos(np.radians(self.scene.contact.mesh_curvature))
        nodes, active, first = [], [], 0
        for triangles in meshes.values():
            own = shared_corners(moved_in(self.scene, triangles))
            nodes.append(own + 3 * first)
            active.append(active_features(own, cosine, triangles))
            first += len(own)
        return {
            "nodes": (np.concatenate(nodes).astype(np.int32), wp.vec3i),
            "active": (np.concatenate(active), wp.int32),
        }

    def _check_lengths(self, meshes: dict[int, np.ndarray]) -> None:
        allowed = longest_triangle(self.scene)
        for w, triangles in meshes.items():
            length = np.ptp(triangles, axis=1)
            if self.scene.wall_elements[w].name in self.scene.wall_paths:  # a turn may lay any side along it
                length = np.broadcast_to(np.linalg.norm(length, axis=1)[:, None], length.shape)
            if (length > allowed).any():
                k, axis = np.unravel_index(int(np.argmax(length / allowed)), length.shape)
                raise SimulationError(
                    f"walls: {self.scene.wall_elements[w].name}: triangle {k + 1} is {length[k, axis]:.4g} m "
                    f"long across the periodic sides {'xyz'[axis]}; allowed: <= {allowed[axis]:.4g} m; "
                    "divide it"
                )

    def _tree(self, triangles: np.ndarray) -> Any:
        """A tree over boxes around the triangles, in float32, rounded outwards."""
        low, high = triangles.min(axis=1).astype(np.float32), triangles.max(axis=1).astype(np.float32)
        low, high = np.nextafter(low, np.float32(-np.inf)), np.nextafter(high, np.float32(np.inf))
        lowers, uppers = (wp.array(side, dtype=wp.vec3, device=self.state.device) for side in (low, high))
        self._trees.append(wp.Bvh(lowers, uppers))
        return self._trees[-1]

    def attach(self, walls: Any) -> None:
        """Let a struct `Walls` refer to them."""
        for name, array in self._arrays.items():
            setattr(walls, name, array)

    @property
    def bytes_per_triangle(self) -> float:
        """Device memory of the tables, search trees included [B]."""
        tables = sum(a.capacity for a in self._arrays.values())
        return TREE_BYTES + tables / max(1, self.triangles)


def longest_triangle(scene: Scene) -> np.ndarray:
    """Allowed length of a triangle along x, y, z [m]; infinite but across periodic sides.

    An entry of the list tells three images of a triangle apart (`gpudem.solver.mesh_entries`): a particle is
    then within 1.5 sides of the middle of each image that it can reach.
    """
    size = np.array(scene.domain.hi) - np.array(scene.domain.lo)
    reach = float(scene.state.radius.max()) + scene.contact_range + 2 * scene.skin
    return np.where(scene.domain.periodic, 2 * (1.5 * size - reach) / 1.01, np.inf)


def bounding_spheres(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(centers [m], radii [m]) of spheres around triangles, shapes (k, 3), (k,): about the longest edge.

    The radius is rounded upwards by more than float32 rounds the coordinates.
    """
    ends = np.roll(triangles, -1, axis=1)
    longest = np.argmax(((ends - triangles) ** 2).sum(axis=2), axis=1)
    row = np.arange(len(triangles))
    center = (triangles[row, longest] + ends[row, longest]) / 2
    radius = np.linalg.norm(triangles - center[:, None], axis=2).max(axis=1)
    return center, radius + 1e-6 * (radius + np.abs(center).max(axis=1))


def unit_normals(triangles: np.ndarray) -> np.ndarray:
    """Unit normals, by the right-hand rule of the corners: shape (k, 3)."""
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return normal / np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]


def _numbered(rows: np.ndarray) -> np.ndarray:
    """A number for each row of integers, the same for equal rows, from 0 in their order: shape (k,)."""
    order = np.lexsort(rows.T[::-1])
    ordered = rows[order]
    found = np.zeros(len(rows), np.int64)
    found[order] = np.concatenate([[0], np.cumsum((ordered[1:] != ordered[:-1]).any(axis=1))])
    return found


def moved_in(scene: Scene, triangles: np.ndarray) -> np.ndarray:
    """Triangles, (k, 3, 3), each corner by itself moved in across periodic sides, where ends meet."""
    lo, size = np.array(scene.domain.lo), np.array(scene.domain.hi) - np.array(scene.domain.lo)
    sides = np.floor((triangles - lo) / size + 1e-9)  # a corner on the upper side is on the lower one
    return triangles - np.where(scene.domain.periodic, sides * size, 0.0)  # mutate: joined_across_sides


def shared_corners(triangles: np.ndarray) -> np.ndarray:
    """A number for each place of a corner, shape (k, 3): equal where triangles meet."""
    points = triangles.reshape(-1, 3)
    size = max(float(np.ptp(points, axis=0).max()), 1e-300)
    return _numbered(np.round(points / (1e-9 * size)).astype(np.int64)).reshape(-1, 3)


def active_features(nodes: np.ndarray, cosine: float, corners: np.ndarray) -> np.ndarray:
    """Which edges (bits 0 to 2) and corners (bits 3 to 5) of each triangle count by LIGGGHTS' rule: (k,).

    An edge of one triangle is active; one at which triangles go on in one plane is not, however they wind,
    and one at which a triangle is folded back upon another is; else it is for the triangle that comes last.
    A corner is active for the last triangle there, unless no edge at it is active or one
    goes on straight as another (`straight_nodes`).
    Source: black-box runs of LIGGGHTS 3.8.0 (docs, "meshes").
    """
    count = len(nodes)
    ends = np.sort(np.stack([nodes, np.roll(nodes, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edge = _numbered(ends)
    order = np.argsort(edge, kind="stable")  # users of an edge side by side, in the order of the triangles
    of = edge[order]
    same = of[1:] == of[:-1]
    into = _into_triangles(corners).reshape(-1, 3)[order]
    parallel = -np.einsum("ij,ij->i", into[1:], into[:-1]) >= cosine  # mutate: coplanar_edge
    edges = int(edge.max()) + 1
    users = np.bincount(edge, minlength=edges)
    bent = np.bincount(of[1:][same & ~parallel], minlength=edges) > 0
    last = np.append(~same, True)  # mutate: last_of_edge
    active = np.zeros((count, 6), bool)
    chosen = order[last & ((users == 1) | bent)[of]]
    active[chosen // 3, chosen % 3] = True
    at_active = np.zeros(int(nodes.max()) + 1, bool)
    at_active[ends[chosen]] = True
    latest = np.zeros(len(at_active), np.int64)
    np.maximum.at(latest, nodes.ravel(), np.repeat(np.arange(count), 3))
    active[:, 3:] = (latest[nodes] == np.arange(count)[:, None]) & at_active[nodes]
    active[:, 3:] &= ~straight_nodes(nodes, corners, cosine)[nodes]
    return (active @ (1 << np.arange(6))).astype(np.int32)


def _into_triangles(corners: np.ndarray) -> np.ndarray:
    """Unit vectors from edge j of each triangle, at right angles to it, to the third corner: (k, 3, 3)."""
    edge = np.roll(corners, -1, axis=1) - corners
    other = np.roll(corners, -2, axis=1) - corners
    share = np.einsum("kij,kij->ki", other, edge) / np.maximum(np.einsum("kij,kij->ki", edge, edge), 1e-300)
    into = other - share[:, :, None] * edge
    return into / np.maximum(np.linalg.norm(into, axis=2, keepdims=True), 1e-300)


def straight_nodes(nodes: np.ndarray, corners: np.ndarray, cosine: float) -> np.ndarray:
    """Whether an edge at each node goes on in a straight line as another one, active or not: (number,).

    Args:
        nodes: Numbers of the corners of each triangle, (k, 3).
        corners: Their places, (k, 3, 3).
        cosine: Of the angle up to which two edges are in one line.
    """
    ends = np.stack([nodes, np.roll(nodes, -1, axis=1)], axis=2).reshape(-1, 2)
    way = (np.roll(corners, -1, axis=1) - corners).reshape(-1, 3)
    way = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-300)
    at, away = np.concatenate([ends[:, 0], ends[:, 1]]), np.concatenate([way, -way])
    order = np.argsort(at, kind="stable")
    at, away = at[order], away[order]
    number, first, count = np.unique(at, return_index=True, return_counts=True)
    straight = np.zeros(int(nodes.max()) + 1, bool)
    for size in np.unique(count):  # nodes with so many edges
        rows = first[count == size][:, None] + np.arange(size)
        opposite = np.einsum("nik,njk->nij", away[rows], away[rows]) <= -cosine  # mutate: straight_edges
        straight[number[count == size]] = opposite.any(axis=(1, 2))
    return straight
