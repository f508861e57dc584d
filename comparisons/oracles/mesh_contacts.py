"""Which triangles of a mesh a ball touches, by two rules, in plain NumPy and by brute force.

Independent of the solver, which walks the triangles from the deepest on and asks whether nearest points lie
on others: here the contacts are the local minima of the distance, found feature by feature from what meets at
each edge and corner (`Surface`), and LIGGGHTS' rule is stated as measured from its binary (`LiggghtsRule`).
"""

from __future__ import annotations

import itertools
from collections import defaultdict

import numpy as np

#: Features: the face, edge k from corner k to the next, corner k.
FACE, EDGE, CORNER = 0, 1, 4


def nearest_features(x: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(nearest point of each triangle (k, 3), feature that it lies on (k,), distance (k,)) of one point x.

    The face where the foot of the perpendicular is inside all three edges, else the nearest edge.
    """
    edges = np.roll(corners, -1, axis=1) - corners
    normal = np.cross(edges[:, 0], edges[:, 1])
    away = x - corners
    share = np.clip(np.einsum("kij,kij->ki", away, edges) / (edges**2).sum(axis=2), 0, 1)
    foot = corners + share[..., None] * edges
    k, rows = np.argmin(((x - foot) ** 2).sum(axis=2), axis=1), np.arange(len(corners))
    point, at = foot[rows, k], share[rows, k]
    feature = np.where(at <= 0, CORNER + k, np.where(at >= 1, CORNER + (k + 1) % 3, EDGE + k))
    inside = (np.einsum("kij,kj->ki", np.cross(edges, away), normal) > 0).all(axis=1)
    unit = normal / np.linalg.norm(normal, axis=1)[:, None]
    height = np.einsum("kj,kj->k", away[:, 0], unit)
    point = np.where(inside[:, None], x - height[:, None] * unit, point)
    feature = np.where(inside, FACE, feature)
    return point, feature, np.linalg.norm(x - point, axis=1)


def numbered_nodes(corners: np.ndarray) -> np.ndarray:
    """A number for each corner, shape (k, 3): equal where corners agree to 1e-9 of the mesh's size."""
    size = float(np.ptp(corners.reshape(-1, 3), axis=0).max())
    rows = np.round(corners.reshape(-1, 3) / (1e-9 * size)).astype(np.int64)
    return np.unique(rows, axis=0, return_inverse=True)[1].reshape(-1, 3)


class Surface:
    """A conforming mesh, by its features: faces, edges with the triangles that meet there, corners."""

    def __init__(self, corners: np.ndarray):
        self.corners, nodes = corners, numbered_nodes(corners)
        users, spokes = defaultdict(list), defaultdict(list)
        for k, j in itertools.product(range(len(corners)), range(3)):
            a, b, c = (corners[k, (j + i) % 3] for i in range(3))
            users[tuple(sorted((int(nodes[k, j]), int(nodes[k, (j + 1) % 3]))))].append((a, b, c))
            spokes[int(nodes[k, j])] += [(a, b - a), (a, c - a)]
        self.edges = np.array([those[0][:2] for those in users.values()])
        into = [
            (row, (c - a) - ((c - a) @ (b - a)) / ((b - a) @ (b - a)) * (b - a))
            for row, those in enumerate(users.values()) for a, b, c in those
        ]  # fmt: skip
        self.edge_of, self.into = (np.array(column) for column in zip(*into, strict=True))
        self.points = np.array([those[0][0] for those in spokes.values()])
        away = [(row, d) for row, those in enumerate(spokes.values()) for _, d in those]
        self.point_of, self.spokes = (np.array(column) for column in zip(*away, strict=True))

    def minima(self, x: np.ndarray) -> list[tuple[float, np.ndarray]]:
        """(distance [m], unit normal) of each local minimum of the distance of x.

        A point of a feature is one if no triangle that meets there leads nearer: of an edge, if d = x - q has
        no part into any of its triangles; of a corner, if d has none along any edge that leaves it.
        """
        point, feature, _distance = nearest_features(x, self.corners)
        found = list(x - point[feature == FACE])
        a, along = self.edges[:, 0], self.edges[:, 1] - self.edges[:, 0]
        share = np.einsum("ij,ij->i", x - a, along) / np.einsum("ij,ij->i", along, along)
        d = x - (a + share[:, None] * along)
        nearer = np.einsum("ij,ij->i", d[self.edge_of], self.into) > 0
        found += list(d[(share > 0) & (share < 1) & (np.bincount(self.edge_of, nearer) == 0)])
        d = x - self.points
        nearer = np.einsum("ij,ij->i", d[self.point_of], self.spokes) > 0
        found += list(d[np.bincount(self.point_of, nearer) == 0])
        return [(float(np.linalg.norm(d)), d / np.linalg.norm(d)) for d in found]

    def unique_contacts(
        self, x: np.ndarray, radius: float, merge_angle: float
    ) -> list[tuple[float, np.ndarray]]:
        """(distance [m], unit normal) of the contacts of a ball at x by the rule "unique", the deepest first.

        Local minima within the radius; of those whose normals differ by less than merge_angle [rad] from that
        of a deeper contact, none.
        """
        kept: list[tuple[float, np.ndarray]] = []
        for gap, normal in sorted(self.minima(x), key=lambda found: found[0]):
            if gap < radius and all(normal @ other <= np.cos(merge_angle) for _, other in kept):
                kept.append((gap, normal))
        return kept


class LiggghtsRule:
    """LIGGGHTS' rule for one ball at one mesh, with its memory of the last step.

    Source: black-box runs of LIGGGHTS 3.8.0, random positions about squares, corners, cubes, faceted spheres
    and folds.
    """

    def __init__(self, corners: np.ndarray, curvature: float):
        """Of a mesh; curvature [rad]: triangles that meet and differ by no more are coplanar."""
        self.corners, self.nodes, self.curvature = corners, numbered_nodes(corners), curvature
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        unit = normal / np.linalg.norm(normal, axis=1)[:, None]
        self.flat = np.abs(unit @ unit.T) >= np.cos(curvature)
        self.active = self._active()
        self.touching: set[int] = set()

    def _active(self) -> dict[tuple[int, int], bool]:
        """(triangle, feature) -> whether it counts; see rules 2 and 3 of `contacts`."""
        users = defaultdict(list)
        for k, j in itertools.product(range(len(self.nodes)), range(3)):
            users[tuple(sorted(self.nodes[k, [j, (j + 1) % 3]].tolist()))].append((k, j))
        active: dict[tuple[int, int], bool] = {}
        alive: set[int] = set()
        for ends, those in users.items():
            hidden = len(those) > 1 and all(
                self.flat[d[0], e[0]] and not self._folded(d, e) for d, e in itertools.pairwise(sorted(those))
            )
            for k, j in those:
                active[k, EDGE + j] = not hidden and (k, j) == max(those)
            alive |= set() if hidden else set(ends)
        for k, j in itertools.product(range(len(self.nodes)), range(3)):
            node = int(self.nodes[k, j])
            last = int(np.flatnonzero((self.nodes == node).any(axis=1)).max())
            active[k, CORNER + j] = k == last and node in alive and not self._straight(node)
        return active

    def _folded(self, one: tuple[int, int], other: tuple[int, int]) -> bool:
        """Whether two triangles (number, edge) lie on the same side of the edge that they share."""
        (a, b, c), (_, _, d) = (np.roll(self.corners[k], -j, axis=0) for k, j in (one, other))
        return float(np.cross(b - a, c - a) @ np.cross(b - a, d - a)) > 0

    def _corner_beyond(self, k: int, x: np.ndarray) -> int | None:
        """The corner of triangle k that is its contact whatever is nearest: see rule 5 of `contacts`."""
        corners = self.corners[k]
        along = np.roll(corners, -1, axis=0) - corners
        over = np.cross(along, x - corners) @ np.cross(along[0], along[1])
        return next((j for j in (0, 1) if over[j] < 0 and over[j - 1] < 0), None)

    def _straight(self, node: int) -> bool:
        """Whether two edges at a node, active or not, are in one line."""
        ways = [
            self.corners[k, (j + step) % 3] - self.corners[k, j]
            for k, j in np.argwhere(self.nodes == node).tolist()
            for step in (1, 2)
        ]
        ways = [way / np.linalg.norm(way) for way in ways]
        return any(a @ b <= -np.cos(self.curvature) for a, b in itertools.combinations(ways, 2))

    def contacts(self, x: np.ndarray, radius: float) -> list[tuple[float, np.ndarray]]:
        """(distance [m], unit normal) of each contact of a ball at x, which are then those of the last step.

        1. Triangles that share an edge or a corner and whose planes differ by no more than the
        curvature are coplanar, however they wind. 2. An edge of one triangle counts; one that coplanar
        triangles share does not, unless one is folded back upon the other; any other counts for the
        last of its triangles. 3. A corner counts for the last of
        its triangles, unless no edge at it counts, or two edges at it are in one line, up to the
        curvature. 4. A nearest point inside a face counts, unless a coplanar triangle before it has
        such a contact in this step; a triangle in contact in the last step keeps its own. 5. One on
        an edge or a corner counts where that does. Where the barycentric coordinates of two corners are
        negative, and the third corner is the first or the second of the triangle, the contact is at that
        corner, though a point of an edge may be nearer. 6. All contacts act.
        """
        point, feature, distance = nearest_features(x, self.corners)
        faces: list[int] = []
        found: dict[int, tuple[float, np.ndarray]] = {}
        for k in np.flatnonzero(distance <= radius).tolist():
            gap, away = float(distance[k]), x - point[k]
            if feature[k] == FACE:
                shared = [d for d in faces if self.flat[d, k] and np.isin(self.nodes[d], self.nodes[k]).any()]
                if shared and k not in self.touching:
                    continue
                faces.append(k)
            else:
                corner = self._corner_beyond(k, x)
                if corner is not None:
                    away = x - self.corners[k, corner]
                    gap = float(np.linalg.norm(away))
                if gap > radius or not self.active[k, int(feature[k]) if corner is None else CORNER + corner]:
                    continue
            found[k] = (gap, away / gap)
        self.touching = set(found)
        return list(found.values())
