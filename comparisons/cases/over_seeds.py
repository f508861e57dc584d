"""Chaotic runs of two codes over seeds: checks and table of the comparison of their metrics."""

from __future__ import annotations

from collections.abc import Mapping

from comparisons import kit
from comparisons.metrics.statistics import Comparison

#: Significance level of the tests: runs are deterministic, so that a false alarm would stay.
ALPHA = 0.01


def smallest_p(found: Mapping[str, Comparison], seeds: int) -> kit.Measured:
    """Smallest corrected p over the metrics: below ALPHA, the codes differ significantly."""
    name, c = min(found.items(), key=lambda item: item[1].corrected)
    note = f"{len(found)} metrics, {seeds} seeds per code; smallest at {name}: {c.mean[0]:.4g} and"
    note += f" {c.mean[1]:.4g}, standard deviations {c.spread[0]:.2g} and {c.spread[1]:.2g}"
    return kit.Measured(c.corrected, note=note)


def bounds(found: Mapping[str, Comparison], part: str) -> dict[str, kit.Measured]:
    """Largest |difference of means| within the 95 % confidence interval, of metrics whose name has `part`."""
    return {
        name: kit.Measured(c.bound, note=f"difference {c.difference:.3g} +- {c.half_width:.3g}")
        for name, c in found.items()
        if part in name
    }


def rows(found: Mapping[str, Comparison], first: str, second: str) -> kit.Rows:
    """Every metric: mean and spread of each side, difference, its interval, p before and after correction."""
    return [
        {"metric": name,
         f"{first}: mean": c.mean[0], f"{first}: standard deviation": c.spread[0],
         f"{second}: mean": c.mean[1], f"{second}: standard deviation": c.spread[1],
         "difference of means": c.difference, "half of its 95 % interval": c.half_width,
         "p (Welch)": c.p, "p (corrected)": c.corrected}
        for name, c in found.items()
    ]  # fmt: skip
