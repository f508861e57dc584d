"""Classes of particle sizes, for neighbor searches whose cost does not depend on the largest particle."""

from __future__ import annotations

import numpy as np

#: Largest ratio of two radii in one class.
CLASS_RATIO = 2.0


def class_radii(radius: np.ndarray) -> np.ndarray:
    """Largest radius of each size class [m], ascending; radius: (n,) [m], n > 0.

    The first class starts at the smallest radius and ends at `CLASS_RATIO` times that; the next one starts at
    the smallest radius beyond it. No class is empty, and a class's largest radius is that of a particle.
    """
    values, largest = np.unique(radius), []
    while len(values):
        # mutate: class_limit
        count = int(np.searchsorted(values, CLASS_RATIO * values[0], side="right"))
        largest.append(values[count - 1])
        values = values[count:]
    return np.array(largest)


def default_skin(radius: np.ndarray) -> float:
    """Verlet skin [m]: 0.3 of the largest radius in one size class, 0.3 of the mean radius in several.

    The largest radius would give small particles a skin of many diameters, and a list of thousands. The mean
    is near the small radii wherever small particles are dense enough to have many neighbors; where it is
    above them they are few, and a wider skin saves rebuilds.
    """
    several = float(radius.max()) > CLASS_RATIO * float(radius.min())
    return 0.3 * float(radius.mean() if several else radius.max())
