"""What is wrong with the triangles of a mesh: repaired with a note, or refused, by name.

    vertices nearer than 1e-9 of the size of the mesh     one vertex, with a note
    vertices of no triangle                               left out, with a note
    triangles without an area (also with equal corners)   left out, with a note
    triangles with the corners of an earlier one          left out, with a note
    rows that name no vertex, numbers that are not finite, nothing left   refused

Harmless, and left as they are: open rims, gaps and T-junctions, triangles whose neighbors face the other way
(a mesh is touched from both sides), long and narrow ones. `oddities` tells of extremes.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from gpudem.scene.types import LARGEST

#: Vertices nearer than this share of the size of the mesh are one.
WELD = 1e-9
#: A triangle that is less high than this share of its longest side has no area.
FLAT = 1e-12
#: A triangle this many times as long as high is told of.
SLIVER = 1e4
#: Triangles of a scene at most: corners are numbered, three each, with 32-bit integers beside the particles.
MAX_TRIANGLES = 2**29


@dataclasses.dataclass(frozen=True)
class Surface:
    """The triangles of a mesh after repair, in the unit in which they are stated."""

    points: np.ndarray
    """Vertices, shape (p, 3)."""
    rows: np.ndarray
    """The three vertices of each triangle, shape (k, 3)."""
    notes: tuple[str, ...]
    """What was repaired, one sentence each."""


def repaired(points: np.ndarray, rows: np.ndarray) -> Surface:
    """The surface of triangles `rows`, shape (k, 3), of points, shape (p, 3), in any unit.

    Raises:
        ValueError: naming row or vertex.
    """
    _require_sound(points, rows)
    notes: list[str] = []
    used = np.unique(rows)
    if len(used) < len(points):
        notes.append(f"{len(points) - len(used)} of {len(points)} vertices belong to no triangle; left out")
    number, moved = _welded(points[used])
    if moved:
        notes.append(f"{moved} of {len(used)} vertices lie within {WELD:g} of its size of another; joined")
    rows = used[number][np.searchsorted(used, rows)]
    keep = heights(points[rows]) > FLAT * _longest(points[rows])  # mutate: triangles_without_area
    if not keep.all():
        notes.append(f"{_of(keep)} have no area; left out")
        rows = rows[keep]
    if len(rows) == 0:
        raise ValueError("triangles: none of them has an area")
    _, first = np.unique(np.sort(rows, axis=1), axis=0, return_index=True)
    if len(first) < len(rows):
        again = len(rows) - len(first)
        notes.append(f"{again} of {len(rows)} triangles have the corners of an earlier one; left out")
        rows = rows[np.sort(first)]  # mutate: duplicate_triangles
    return Surface(points, rows, tuple(notes))


def _of(keep: np.ndarray) -> str:
    return f"{int(np.count_nonzero(~keep))} of {len(keep)} triangles"


def _require_sound(points: np.ndarray, rows: np.ndarray) -> None:
    if len(rows) == 0:
        raise ValueError("triangles: none given")
    if len(rows) > MAX_TRIANGLES:
        raise ValueError(
            f"triangles: {len(rows)} are too many for 32-bit indices; allowed: <= {MAX_TRIANGLES}"
        )
    outside = ((rows < 0) | (rows >= len(points))).any(axis=1)
    if outside.any():
        row = int(np.argmax(outside))
        named = ", ".join(map(str, rows[row].tolist()))
        raise ValueError(
            f"triangles: row {row + 1} names vertices {named}; must be rows of the {len(points)} vertices,"
            f" 0 to {len(points) - 1}"
        )
    bad = np.asarray(~(np.abs(points) <= LARGEST).all(axis=1))  # also of NaN
    bad[np.setdiff1d(np.flatnonzero(bad), rows)] = False
    if bad.any():
        row = int(np.argmax(bad))
        stated = ", ".join(f"{c:g}" for c in points[row])
        raise ValueError(f"vertices: {row + 1} is ({stated}); must be finite, at most {LARGEST:g}")


def _welded(points: np.ndarray) -> tuple[np.ndarray, int]:
    """(for each point the first of those that are one with it, number of points that differed from it)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    distinct, first, number = np.unique(points, axis=0, return_index=True, return_inverse=True)
    number = number.reshape(-1)
    reach = WELD * float(np.ptp(points, axis=0).max())
    pairs = KDTree(distinct).query_pairs(reach, output_type="ndarray")
    if len(pairs) == 0:
        return first[number], 0
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(distinct),) * 2)
    group = connected_components(links, directed=False)[1]
    leader = np.full(group.max() + 1, len(points))
    np.minimum.at(leader, group, first)
    return leader[group][number], len(distinct) - len(leader)


def _longest(corners: np.ndarray) -> np.ndarray:
    """Longest side [m] of triangles, shape (k, 3, 3)."""
    return np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)


def heights(corners: np.ndarray) -> np.ndarray:
    """Smallest height [m] of triangles, shape (k, 3, 3): above the longest side; 0 without any area."""
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    longest = _longest(corners)
    return np.divide(area, longest, out=np.zeros(len(area)), where=longest > 0)


def oddities(corners: np.ndarray, smallest_radius: float) -> list[str]:
    """What is unusual about triangles and still right, one sentence each."""
    longest, found = _longest(corners), []
    narrow = longest > SLIVER * heights(corners)
    if narrow.any():
        found.append(f"{_of(~narrow)} are more than {SLIVER:g} times as long as high: nearest points on them"
                     " lose digits")  # fmt: skip
    tiny = longest < 1e-3 * smallest_radius
    if tiny.any():
        found.append(f"{_of(~tiny)} are smaller than 0.001 of the smallest radius, {smallest_radius:g} m:"
                     " they cost time and memory")  # fmt: skip
    return found
