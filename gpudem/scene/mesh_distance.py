"""Distance of points from a mesh, on the host, in float64: NumPy and SciPy only.

Triangles are sorted into classes of sizes within a factor of 2, each with a k-d tree of their centers. The
triangle of a near center gives an upper bound of the distance; all triangles whose centers lie within that
bound and their own size are then measured, some CHUNK at a time, so that memory is bounded whatever the mesh.
"""

from __future__ import annotations

import numpy as np

#: Pairs of a point and a triangle that are measured at once: some 100 MB.
CHUNK = 200_000


def distance_to_triangles(points: np.ndarray, corners: np.ndarray, limit: float = np.inf) -> np.ndarray:
    """Distance [m] of points, shape (n, 3), from the nearest of k triangles, shape (k, 3, 3).

    limit: points farther away than this [m] need no exact distance; they get some value above it.
    """
    found = np.full(len(points), np.inf)
    center = corners.mean(axis=1)
    size = np.linalg.norm(corners - center[:, None], axis=2).max(axis=1)
    classes = np.floor(np.log2(np.maximum(size / size.max(), 1e-300))).astype(int)
    for c in np.unique(classes)[::-1].tolist():
        own = np.flatnonzero(classes == c)
        low, high = corners[own].min(axis=(0, 1)), corners[own].max(axis=(0, 1))
        apart = np.maximum(np.maximum(low - points, points - high), 0.0)
        near = np.flatnonzero(np.linalg.norm(apart, axis=1) <= np.minimum(found, limit))
        if len(near):
            _measure_class(found, near, points, corners[own], center[own], float(size[own].max()), limit)
    return found


def _measure_class(
    found: np.ndarray, near: np.ndarray, points: np.ndarray, corners: np.ndarray, center: np.ndarray,
    reach: float, limit: float,
) -> None:  # fmt: skip
    """Lower the distances `found` of the points in rows `near` to those from triangles of one size class."""
    from scipy.spatial import KDTree

    tree = KDTree(center)
    # any near center gives a bound: eps = 1 spares the search among many that are about as far
    bound = 2 * (limit + reach)
    away, nearest = map(np.asarray, tree.query(points[near], eps=1.0, distance_upper_bound=bound))
    some = np.isfinite(away)
    near, nearest = near[some], nearest[some]
    found[near] = np.minimum(found[near], pair_distance(points[near], corners[nearest]))
    search = np.minimum(found[near], limit) + reach  # mutate: reach_of_triangles
    search *= 1 + 1e-12
    counts = tree.query_ball_point(points[near], search, return_length=True)
    for part in _parts(counts):
        rows = near[part]
        lists = tree.query_ball_point(points[rows], search[part])
        ends = np.concatenate([[0], np.cumsum(counts[part])])
        some = np.flatnonzero(counts[part])
        if len(some):
            triangles = np.concatenate([np.array(lists[k], np.int64) for k in some])
            measured = pair_distance(points[np.repeat(rows, counts[part])], corners[triangles])
            lowest = np.minimum.reduceat(measured, ends[some])
            found[rows[some]] = np.minimum(found[rows[some]], lowest)


def _parts(counts: np.ndarray) -> list[np.ndarray]:
    """Rows in order, in parts with about CHUNK pairs each, at least one row."""
    part = np.cumsum(counts) // CHUNK
    return np.split(np.arange(len(counts)), np.flatnonzero(np.diff(part)) + 1)


def pair_distance(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Distance [m] of each point, shape (n, 3), from the triangle beside it, shape (n, 3, 3).

    Above a triangle that of its plane, else that of the nearest side: no case is left to rounding, as both
    are computed and the plane's counts only where the foot lies within all sides.
    """
    edge = np.roll(corners, -1, axis=1) - corners
    to_point = points[:, None] - corners
    length2 = np.einsum("nki,nki->nk", edge, edge)
    share = np.einsum("nki,nki->nk", to_point, edge) / np.maximum(length2, 1e-300)
    foot = to_point - np.clip(share, 0, 1)[..., None] * edge
    found = np.sqrt(np.einsum("nki,nki->nk", foot, foot).min(axis=1))
    normal = np.cross(edge[:, 0], -edge[:, 2])
    within = (np.einsum("nki,ni->nk", np.cross(edge, to_point), normal) >= 0).all(axis=1)
    area = np.linalg.norm(normal, axis=1)
    within &= area > 0
    height = np.abs(np.einsum("ni,ni->n", to_point[:, 0], normal)) / np.maximum(area, 1e-300)
    return np.where(within, np.minimum(height, found), found)
