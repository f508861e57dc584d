"""Classes of particle sizes, for neighbor searches whose cost does not depend on the largest particle."""

from __future__ import annotations

import numpy as np

#: Radii that differ by no more than this factor are one class.
CLASS_RATIO = 2.0
#: Time to look up a row of cells, relative to that of one distance.
ROW_COST = 20.0
#: Solid fraction of a bed, for an estimate of how many particles a cell holds.
SOLID_FRACTION = 0.6


def class_radii(radius: np.ndarray, margin: float) -> np.ndarray:
    """Largest radius of each size class [m], ascending.

    radius: (n,) [m], n > 0; margin [m]: how far beyond a contact the neighbors of a particle are searched.
    One class where no two radii differ by more than `CLASS_RATIO`. Else radii are put into bins of that
    ratio, from the smallest on, and neighboring bins are merged where that makes a search cheaper: more
    classes are more rows of cells to look up, fewer are more distances to compute.
    """
    if float(radius.max()) <= CLASS_RATIO * float(radius.min()):  # mutate: class_limit
        return np.array([radius.max()])
    values = np.sort(radius)
    ends = [0]
    while ends[-1] < len(values):
        ends.append(int(np.searchsorted(values, CLASS_RATIO * values[ends[-1]], side="right")))
    cost: list[float] = [0.0]  # of the classes up to the end of each bin, at best
    begin: list[int] = []  # of the last of these classes
    for k in range(1, len(ends)):
        choices = [cost[m] + _search_cost(values, ends, m, k, margin) for m in range(k)]
        begin.append(int(np.argmin(choices)))
        cost.append(choices[begin[-1]])
    last, largest = len(begin), []
    while last > 0:
        largest.append(values[ends[last] - 1])
        last = begin[last - 1]
    return np.array(largest[::-1])


def _search_cost(values: np.ndarray, ends: list[int], first: int, last: int, margin: float) -> float:
    """Estimated time in which all particles search the cells of a class, bins `first` to `last` - 1."""
    volume = 4 / 3 * np.pi * float((values**3).sum()) / SOLID_FRACTION
    top = float(values[ends[last] - 1])
    density = (ends[last] - ends[first]) / volume
    edge = 2 * top + margin
    counts = np.diff(ends)
    means = np.add.reduceat(values, ends[:-1]) / counts
    cells = 2 * (means + top + margin) / edge + 1  # along each axis
    return float((counts * (ROW_COST * cells**2 + density * (cells * edge) ** 3)).sum())


def default_skin(radius: np.ndarray) -> float:
    """Verlet skin [m]: 0.3 of the largest radius; where radii differ by more than `CLASS_RATIO`, of the mean.

    The largest radius would give small particles a skin of many diameters, and a list of thousands. The mean
    is near the small radii wherever small particles are dense enough to have many neighbors; where it is
    above them they are few, and a wider skin saves rebuilds.
    """
    several = float(radius.max()) > CLASS_RATIO * float(radius.min())
    return 0.3 * float(radius.mean() if several else radius.max())
