"""Meshes to try rules of contact on, and random positions about them; corners [m], shape (k, 3, 3)."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from comparisons.oracles.mesh_contacts import nearest_features


def rectangle(a: ArrayLike, u: ArrayLike, v: ArrayLike, cells: tuple[int, int] = (1, 1)) -> np.ndarray:
    """The rectangle a, a + u, a + u + v, a + v in cells of two triangles; normal along u x v."""
    a, u, v = np.asarray(a, float), np.asarray(u, float), np.asarray(v, float)
    found = []
    for i in range(cells[0]):
        for j in range(cells[1]):
            low, high = a + u * (i / cells[0]), a + u * ((i + 1) / cells[0])
            back, front = v * (j / cells[1]), v * ((j + 1) / cells[1])
            p, q, r, s = low + back, high + back, high + front, low + front
            found += [(p, q, r), (p, r, s)]
    return np.array(found)


def corner(angle: float, size: float = 1.0) -> np.ndarray:
    """Floor z = 0 for x < 0, and a face that leaves it at x = 0, turned up by `angle` [rad]."""
    floor = rectangle((-size, -size, 0), (size, 0, 0), (0, 2 * size, 0))
    slope = rectangle((0, -size, 0), (size * np.cos(angle), 0, size * np.sin(angle)), (0, 2 * size, 0))
    return np.concatenate([floor, slope])


def cube(size: float = 0.2) -> np.ndarray:
    """A closed cube about the origin, normals outwards: 12 triangles."""
    faces = []
    for axis in range(3):
        u, v, w = np.roll(np.eye(3), axis, axis=1)
        for side in (-1, 1):
            begin = size / 2 * (side * w - u - v)
            faces.append(rectangle(begin, size * (u if side > 0 else v), size * (v if side > 0 else u)))
    return np.concatenate(faces)


def faceted_sphere(radius: float = 0.2, levels: int = 1) -> np.ndarray:
    """An icosahedron whose triangles are divided in four `levels` times, all corners on the sphere."""
    g = (1 + 5**0.5) / 2
    points = np.array([p for a in (-1, 1) for b in (-g, g) for p in ((0, a, b), (a, b, 0), (b, 0, a))])
    edge = np.linalg.norm(points[:, None] - points, axis=2)
    near = (edge > 0.1) & (edge < 2.1)
    n = len(points)
    rows = [(i, j, k) for i in range(n) for j in range(i) for k in range(j)
            if near[i, j] and near[j, k] and near[i, k]]  # fmt: skip
    triangles = points[np.array(rows)]
    inwards = np.linalg.det(triangles) < 0
    triangles[inwards] = triangles[inwards][:, [0, 2, 1]]
    for _ in range(levels):
        a, b, c = triangles.transpose(1, 0, 2)
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        triangles = np.concatenate([np.stack(part, axis=1) for part in parts])
        triangles /= np.linalg.norm(triangles, axis=2, keepdims=True)
    return radius * triangles / np.linalg.norm(triangles, axis=2, keepdims=True)


def faceted_cylinder(
    facets: int, radius: float = 0.15, length: float = 0.2, cells: int = 1, turned: float = 0.0
) -> np.ndarray:
    """A cylinder about the y axis without ends, normals inwards; its facets touch the cylinder inside.

    So the deepest gap is that of the cylinder at the middle of a facet. turned: of the first corner [rad].
    """
    angle = turned + 2 * np.pi * np.arange(facets + 1) / facets
    outer = radius / np.cos(np.pi / facets)
    ring = outer * np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=1) - [0, length / 2, 0]
    along = np.array([0, length, 0])
    sides = [rectangle(p, q - p, along, (1, cells)) for p, q in itertools.pairwise(ring)]
    return np.concatenate(sides)


def revolved(profile: ArrayLike, facets: int) -> np.ndarray:
    """The surface of a profile of rows (radius, z) [m] turned about z, normals away from it.

    Its horizontal sections are polygons that have the area of the circles.
    """
    outer = np.sqrt(2 * np.pi / facets / np.sin(2 * np.pi / facets))
    angle = 2 * np.pi * np.arange(facets + 1) / facets
    ring = np.stack([outer * np.cos(angle), outer * np.sin(angle)], axis=1)
    points = np.array([np.column_stack([r * ring, np.full(facets + 1, z)]) for r, z in np.asarray(profile)])
    found = []
    for low, high in itertools.pairwise(points):
        for j in range(facets):
            p, q, r, s = low[j], low[j + 1], high[j + 1], high[j]
            found += [(p, q, r), (p, r, s)]
    return np.array(found)


def shuffled(corners: np.ndarray, seed: int, renumber: bool = True) -> np.ndarray:
    """The triangles in another order and, with `renumber`, each from another corner on."""
    rng = np.random.default_rng(seed)
    found = corners[rng.permutation(len(corners))]
    if renumber:
        first = rng.integers(0, 3, len(found))
        found = np.stack([np.roll(t, -f, axis=0) for t, f in zip(found, first, strict=True)])
    return found


def divided(corners: np.ndarray, seed: int, times: int) -> np.ndarray:
    """So many triangles, chosen at random, cut in two at a point of their longest edge.

    Their neighbors stay whole: the cuts make T-junctions.
    """
    rng = np.random.default_rng(seed)
    rows = list(corners)
    for _ in range(times):
        k = int(rng.integers(len(rows)))
        t = rows.pop(k)
        length = ((np.roll(t, -1, axis=0) - t) ** 2).sum(axis=1)
        a, b, c = np.roll(t, -int(np.argmax(length)), axis=0)
        m = a + rng.uniform(0.3, 0.7) * (b - a)
        rows += [np.array((a, m, c)), np.array((m, b, c))]
    return np.array(rows)


def flattened(seed: int = 1) -> np.ndarray:
    """A flat ellipsoid of 80 triangles, many of them obtuse, wound and numbered at random."""
    corners = shuffled(faceted_sphere(0.3), seed) * [1, 1, 0.15]
    turned = np.random.default_rng(seed).random(len(corners)) < 0.5
    return np.where(turned[:, None, None], corners[:, ::-1], corners)


def folds(angle: float = np.radians(0.1)) -> np.ndarray:
    """A triangle folded back upon another but for an angle [rad], and two that are one plane but for it.

    The two that are one plane are wound against each other.
    """
    rim = np.array([[0.2, -0.2, 0], [0.2, 0.2, 0]])
    seam, high = rim - [0.4, 0, 0], 0.2 * np.sin(angle)
    fold = [[*rim, (0, 0, 0)], [*rim, (0, 0, high)]]
    return np.array([*fold, [*seam, (-0.05, 0, 0)], [*seam, (-0.35, 0, -high)]], float)


def positions_near(corners: np.ndarray, radius: float, count: int, seed: int) -> np.ndarray:
    """Random places [m] nearer than `radius` to a mesh, none of them in the reach of a guard."""
    rng, found = np.random.default_rng(seed), np.empty((0, 3))
    low, high = corners.min(axis=(0, 1)) - radius, corners.max(axis=(0, 1)) + radius
    while len(found) < count:
        tried = rng.uniform(low, high, (count, 3))
        gap = np.array([nearest_features(x, corners)[2].min() for x in tried])
        found = np.concatenate([found, tried[(gap < 0.999 * radius) & (gap > 0.55 * radius)]])
    return found[:count]


def census(seed: int = 1) -> Iterator[tuple[str, np.ndarray, float]]:
    """(name, corners, radius of the ball [m]) of the meshes of the census of both rules."""
    yield "square", rectangle((-0.1, -0.1, 0), (0.2, 0, 0), (0, 0.2, 0)), 0.05
    yield "floor and wall", corner(np.pi / 2, 0.1), 0.05
    yield "cube", cube(), 0.05
    yield "cube, shuffled", shuffled(cube(), seed), 0.05
    yield "faceted sphere", faceted_sphere(), 0.05
    yield "faceted sphere, shuffled", shuffled(faceted_sphere(), seed), 0.05
