"""Two codes as two samples: is their difference more than the spread within each, over several metrics at
once?
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Mapping, Sequence

import numpy as np
from scipy import stats


@dataclasses.dataclass(frozen=True)
class Comparison:
    """One metric of two codes over their seeds."""

    mean: tuple[float, float]
    spread: tuple[float, float]
    """Sample standard deviations."""
    difference: float
    """Mean of the first less mean of the second."""
    half_width: float
    """Half width of the confidence interval of the difference (Welch)."""
    p: float
    """Two-sided p of Welch's t test of equal means."""
    corrected: float = math.nan
    """p corrected for all metrics that are compared at once, by `largest_gap`."""

    @property
    def bound(self) -> float:
        """Largest |difference| inside the confidence interval: what the seeds leave possible."""
        return abs(self.difference) + self.half_width


def welch(
    a: Sequence[float] | np.ndarray, b: Sequence[float] | np.ndarray, level: float = 0.95
) -> Comparison:
    """Means of two samples by Welch's t (unequal variances), with its confidence interval.

    For the interval; the verdict on equality over several metrics is `largest_gap`. Raises ValueError for
    fewer than three values or a NaN.
    """
    a, b = np.asarray(a, float), np.asarray(b, float)
    if min(len(a), len(b)) < 3 or not (np.isfinite(a).all() and np.isfinite(b).all()):
        raise ValueError("Welch's test needs three or more finite values on each side")
    return welch_of(*((float(x.mean()), float(x.std(ddof=1)), len(x)) for x in (a, b)), level=level)


def welch_of(a: tuple[float, float, int], b: tuple[float, float, int], level: float = 0.95) -> Comparison:
    """The same for two samples of which mean, sample standard deviation and number are known."""
    variances = [spread**2 / count for _, spread, count in (a, b)]
    spread, mean = (a[1], b[1]), (a[0], b[0])
    total, difference = sum(variances), a[0] - b[0]
    if total == 0:
        return Comparison(mean, spread, difference, 0.0, 1.0 if difference == 0 else 0.0)
    freedom = total**2 / sum(v**2 / (x[2] - 1) for v, x in zip(variances, (a, b), strict=True))
    half = float(stats.t.ppf((1 + level) / 2, freedom)) * math.sqrt(total)
    p = float(2 * stats.t.sf(abs(difference) / math.sqrt(total), freedom))
    return Comparison(mean, spread, difference, half, p)


def largest_gap(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Corrected p (m,) of m metrics from samples a (n, m) and b (n, m): permutation of the largest gap.

    The gap of a metric is |mean a - mean b| over the standard deviation of all 2n values. Labels are
    exchanged in all ways that split the 2n runs in two halves; p of a metric is the share of splits whose
    largest gap over *all* metrics reaches its own (Westfall and Young 1993, single step). It assumes no
    distribution, keeps the metrics' correlation, and is exact: the chance that any p falls to alpha, where
    the codes do not differ, is at most alpha. The smallest p is 2/binomial(2n, n): 0.008 for five runs a
    side. Raises ValueError where that could not fall below 0.01, beyond 10 runs a side (one would sample
    the splits) or for a NaN.
    """
    a, b = np.asarray(a, float), np.asarray(b, float)
    n = len(a)
    if a.shape != b.shape or not 5 <= n <= 10 or not np.isfinite([a, b]).all():
        raise ValueError(f"needs 5 to 10 finite values a side, equally many; got {a.shape} and {b.shape}")
    pool = np.vstack([a, b])
    spread = pool.std(axis=0)
    scaled = (pool - pool.mean(axis=0)) / np.where(spread > 0, spread, 1.0)
    splits = np.array(list(itertools.combinations(range(2 * n), n)))
    member = np.zeros((len(splits), 2 * n))
    np.put_along_axis(member, splits, 1.0, axis=1)
    gaps = 2 / n * np.abs(member @ scaled)  # means of halves of a centred pool are opposite
    observed = 2 / n * np.abs(scaled[:n].sum(axis=0))
    return (gaps.max(axis=1)[:, None] >= observed - 1e-12).mean(axis=0)


def compare(a: Mapping[str, np.ndarray], b: Mapping[str, np.ndarray]) -> dict[str, Comparison]:
    """Metric -> comparison of its values in two samples {metric: values}, with p corrected for all metrics.

    Raises ValueError as `welch` and `largest_gap` do.
    """
    p = largest_gap(*(np.array([values[name] for name in a]).T for values in (a, b)))
    return {
        name: dataclasses.replace(welch(a[name], b[name]), corrected=float(q))
        for name, q in zip(a, p, strict=True)
    }
