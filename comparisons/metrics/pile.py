"""Measures on a pile of grains: height profile, run-out, centre of mass, far wall, packing, coordination."""

from __future__ import annotations

import numpy as np

from comparisons.metrics import contacts

#: Grains count as touching up to this gap, in diameters: settled grains overlap, and float noise must not
#: part them.
TOUCH_GAP = 0.01


def _pairs(position: np.ndarray, radius: np.ndarray, period: float | None) -> np.ndarray:
    """Rows of touching pairs (pairs, 2), with y periodic of length `period` [m] or not."""
    return contacts.touching(position, radius, np.array([0.0, period or 0.0, 0.0]), TOUCH_GAP)[0]


def main_mass(position: np.ndarray, radius: np.ndarray, period: float | None = None) -> np.ndarray:
    """Whether each grain belongs to the largest cluster of touching grains, (n,) bool: the pile without
    stray grains.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    pairs, n = _pairs(position, radius, period), len(radius)
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    return label == np.bincount(label).argmax()


def height(
    position: np.ndarray,
    radius: np.ndarray,
    at: np.ndarray,
    depth: tuple[float, float],
    period: float | None = None,
    window: float = 3.0,
) -> np.ndarray:
    """Height of the pile [m] at the places `at` along x (m,): what a ruler at the side of the box would read.

    In each strip of the depth y (one diameter wide) the highest top z + R of a grain of the main mass
    within `window`/2 diameters of the place; then the mean over the strips; 0 for an empty strip. It is not
    the volume per base area: that hangs on the local packing, which a side view does not show. Stray grains
    on their way do not count; averaging strips keeps a single proud grain from setting the height. `window`
    below two diameters may find only the dips between grains.
    """
    keep = main_mass(position, radius, period)
    x, y, top = position[keep, 0], position[keep, 1], position[keep, 2] + radius[keep]
    size = 2 * float(radius.max())
    strips = max(1, round((depth[1] - depth[0]) / size))
    inside = (y - depth[0]) % period + depth[0] if period else y
    strip = np.clip(((inside - depth[0]) / (depth[1] - depth[0]) * strips).astype(int), 0, strips - 1)
    heights = np.zeros((len(at), strips))
    for k, place in enumerate(np.asarray(at, float)):
        near = np.abs(x - place) <= window * size / 2
        np.maximum.at(heights[k], strip[near], top[near])
    return heights.mean(axis=1)


def run_out(position: np.ndarray, radius: np.ndarray, period: float | None = None) -> tuple[float, float]:
    """(front of the main mass, front of any grain) [m]: largest x + R; the first is the run-out of the
    pile.
    """
    front = position[:, 0] + radius
    return float(front[main_mass(position, radius, period)].max()), float(front.max())


def centre_of_mass(position: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Centre of mass [m] (3,) of spheres of one density."""
    weight = radius**3
    return (weight[:, None] * position).sum(axis=0) / weight.sum()


def arrival(time: np.ndarray, front: np.ndarray, place: float) -> float:
    """First time [s] at which a front [m] reaches a place, linear between samples; NaN if it never does."""
    there = front >= place
    if not there.any():
        return float("nan")
    k = int(np.argmax(there))
    if k == 0:
        return float(time[0])
    return float(time[k - 1] + (time[k] - time[k - 1]) * (place - front[k - 1]) / (front[k] - front[k - 1]))


def profile_distance(x: np.ndarray, a: np.ndarray, b: np.ndarray) -> float:
    """Mean |a - b| [m] of two height profiles over x: the L1 distance by length."""
    return float(np.trapezoid(np.abs(a - b), x) / (x[-1] - x[0]))


def packing_fraction(position: np.ndarray, radius: np.ndarray, lo, hi) -> float:
    """Solid share of the box lo..hi, grains counted by their centres: for boxes many diameters wide."""
    inside = ((position >= np.asarray(lo)) & (position <= np.asarray(hi))).all(axis=1)
    return float((4 / 3 * np.pi * radius[inside] ** 3).sum() / np.prod(np.asarray(hi) - np.asarray(lo)))


def coordination(position: np.ndarray, radius: np.ndarray, period: float | None = None) -> float:
    """Mean number of touching neighbours per grain, walls not counted."""
    return 2 * len(_pairs(position, radius, period)) / len(radius)


def largest_overlap(position: np.ndarray, radius: np.ndarray, period: float | None = None) -> float:
    """Largest overlap [m] of two grains; 0 where none touch."""
    pairs = _pairs(position, radius, period)
    d = position[pairs[:, 0]] - position[pairs[:, 1]]
    if period:
        d[:, 1] -= period * np.round(d[:, 1] / period)
    return max(0.0, float((radius[pairs].sum(axis=1) - np.linalg.norm(d, axis=1)).max(initial=0.0)))
