"""Contacts found from positions and radii only, in the same way for every code."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from gpudem.scene.placed import Surface


@dataclasses.dataclass(frozen=True)
class Contacts:
    """Contacts of one state; of particles with one another, and with walls."""

    pairs: np.ndarray
    """Rows (i, j), i < j, shape (pairs, 2)."""
    overlap: np.ndarray
    """Overlap [m] of each pair."""
    normal: np.ndarray
    """Unit vector from j to i of each pair, shape (pairs, 3)."""
    wall_pairs: np.ndarray
    """Rows (particle, index of the wall), shape (wall pairs, 2)."""
    wall_overlap: np.ndarray
    """Overlap [m] of each of these."""

    def __len__(self) -> int:
        return len(self.pairs) + len(self.wall_pairs)

    def largest_overlap(self, radius: np.ndarray) -> float:
        """Largest overlap as a share of the smaller radius [1]; 0 without a contact."""
        between = self.overlap / radius[self.pairs].min(axis=1) if len(self.pairs) else np.zeros(0)
        walls = self.wall_overlap / radius[self.wall_pairs[:, 0]] if len(self.wall_pairs) else np.zeros(0)
        return float(max(between.max(initial=0.0), walls.max(initial=0.0)))


def nearest_image(difference: np.ndarray, period: np.ndarray) -> np.ndarray:
    """Differences of positions (..., 3) [m] to the nearest image; period (3,) [m], 0 along other axes."""
    safe = np.where(period > 0, period, 1.0)
    return difference - period * np.round(difference / safe)


def touching(
    position: np.ndarray, radius: np.ndarray, period: np.ndarray, gap: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """(rows (pairs, 2), vectors from j to i (pairs, 3) [m]) of spheres closer than `gap` sums of radii.

    Args:
        position: (n, 3) centers [m]; along periodic axes any image.
        radius: (n,) [m].
        period: (3,) length [m] of the domain along periodic axes, 0 along others.
        gap: Largest gap as a share of the sum of radii.
    """
    from scipy.spatial import KDTree

    shifted = position - position.min(axis=0)
    wrapped = period > 0
    shifted[:, wrapped] = position[:, wrapped] % period[wrapped]
    shifted[:, wrapped] = np.where(shifted[:, wrapped] < period[wrapped], shifted[:, wrapped], 0.0)
    reach = 2 * float(radius.max()) * (1 + gap)
    pairs = KDTree(shifted, boxsize=period).query_pairs(reach, output_type="ndarray")
    vector = nearest_image(shifted[pairs[:, 0]] - shifted[pairs[:, 1]], period)
    near = np.linalg.norm(vector, axis=1) <= radius[pairs].sum(axis=1) * (1 + gap)
    return pairs[near], vector[near]


def find(
    position: np.ndarray,
    radius: np.ndarray,
    period: np.ndarray,
    walls: Sequence[Surface] = (),
    free: np.ndarray | None = None,
) -> Contacts:
    """All contacts of a state; `walls` are elementary walls where they are then (`walls_at`).
    Arguments as in `touching`; particles whose place is NaN are not there. Those that are not `free`, (n,),
    touch free ones only; by default all are.
    """
    free = np.ones(len(position), bool) if free is None else free
    there = np.isfinite(position).all(axis=1)
    if not there.all():
        rows = np.flatnonzero(there)
        if not len(rows):
            none = np.zeros((0, 2), int)
            return Contacts(none, np.zeros(0), np.zeros((0, 3)), none, np.zeros(0))
        found = find(position[rows], radius[rows], period, walls, free[rows])
        walled = np.column_stack([rows[found.wall_pairs[:, 0]], found.wall_pairs[:, 1]])
        return dataclasses.replace(found, pairs=rows[found.pairs], wall_pairs=walled)
    pairs, vector = touching(position, radius, period)
    meet = free[pairs].any(axis=1)
    pairs, vector = pairs[meet], vector[meet]
    distance = np.linalg.norm(vector, axis=1)
    overlap = radius[pairs].sum(axis=1) - distance if len(pairs) else np.zeros(0)
    rows, depths = [], []
    for k, wall in enumerate(walls):
        depth = radius - wall.gap(position)
        inside = np.flatnonzero(free & (depth > 0))
        rows.append(np.stack([inside, np.full(len(inside), k)], axis=1))
        depths.append(depth[inside])
    return Contacts(
        pairs=pairs, overlap=overlap, normal=vector / np.where(distance > 0, distance, 1.0)[:, None],
        wall_pairs=np.concatenate(rows) if rows else np.zeros((0, 2), int),
        wall_overlap=np.concatenate(depths) if depths else np.zeros(0),
    )  # fmt: skip
