"""How well two kinds of equal particles are mixed."""

from __future__ import annotations

import numpy as np

#: Particles of a sample: some layer of neighbors.
SAMPLE = 12


def lacey(position: np.ndarray, labels: np.ndarray, sample: int = SAMPLE) -> float:
    """Lacey index [1]: 0 for separate kinds, 1 for a random mixture.

        M = (s0^2 - s^2)/(s0^2 - sr^2),  s0^2 = p (1 - p),  sr^2 = s0^2/n

    s^2 is the variance about p of the share of one kind in samples of n particles, p its share of all. There
    is one sample a particle, of it and its nearest neighbors, so that no grid has a part in it; samples at
    the interface of separate kinds make M a little larger than 0. Lacey, J. Appl. Chem. 4 (1954) 257.

    Args:
        position: (n, 3) centers [m].
        labels: (n,) bool, the kind.
        sample: Particles of a sample.
    """
    from scipy.spatial import KDTree

    _, near = KDTree(position).query(position, k=sample)
    p = float(labels.mean())
    apart = p * (1 - p)
    variance = float(((labels[near].mean(axis=1) - p) ** 2).mean())
    return (apart - variance) / (apart - apart / sample)
