"""How means over runs tend to a limit as a parameter tends to zero, with their standard errors."""

from __future__ import annotations

import dataclasses
import math

import numpy as np


def block_mean(values: np.ndarray, size: int) -> tuple[float, float]:
    """(mean, its standard error) of a series, from the means of its blocks of `size` values.

    A block must be longer than the correlation time; values after the last whole block are left out.
    """
    blocks = len(values) // size
    means = values[: blocks * size].reshape(blocks, size).mean(axis=1)
    return float(means.mean()), float(means.std(ddof=1) / math.sqrt(blocks))


@dataclasses.dataclass(frozen=True)
class Approach:
    """A quantity at several values of a small parameter by its value at the limit, less one."""

    parameters: np.ndarray
    excess: np.ndarray
    errors: np.ndarray
    """Standard errors, without that of the limit."""
    limit_error: float
    """Standard error of the value at the limit, which all share."""

    def up_to(self, longest: float) -> Approach:
        """Those with a parameter no larger than this."""
        short = self.parameters <= longest
        return Approach(self.parameters[short], self.excess[short], self.errors[short], self.limit_error)

    def slope(self) -> tuple[float, float]:
        """(p, its standard error) of |excess| = C parameter^p, weighted least squares."""
        from scipy import optimize

        total = np.hypot(self.errors, self.limit_error)
        scaled = self.parameters / self.parameters.max()
        size = float(self.excess[np.argmax(self.parameters)])
        fit = optimize.curve_fit(
            lambda t, c, p: c * t**p, scaled, self.excess / size, (1.0, 1.0), total / abs(size),
            absolute_sigma=True,
        )  # fmt: skip
        return float(fit[0][1]), float(np.sqrt(fit[1][1, 1]))

    def limit(self) -> tuple[float, float]:
        """(excess at parameter 0, its standard error): Richardson by a weighted fit of the second degree."""
        t = self.parameters / self.parameters.max()
        weighted = np.vander(t, min(3, len(t)), increasing=True) / self.errors[:, None]
        inverse = np.linalg.inv(weighted.T @ weighted)
        found = float((inverse @ weighted.T @ (self.excess / self.errors))[0])
        return found, math.hypot(math.sqrt(inverse[0, 0]), self.limit_error)
