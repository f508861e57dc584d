"""How rounding differences grow in a scene, and until when two codes can be compared particle by particle."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

#: Growth below this factor in a whole run is called none: it is no more than what a few contacts do.
NO_GROWTH = 1e3
#: The exponential fit needs so many decades between its ends.
LEAST_DECADES = 2.0


@dataclasses.dataclass(frozen=True)
class Growth:
    """Growth of a difference in time."""

    factor: float
    """Last over first value of the envelope."""
    rate: float | None
    """Exponential rate [1/s], least-squares fit of log(difference) over time; None: no growth to fit."""
    correlation: float
    """Square of the correlation of that fit; near 1 for exponential growth."""

    @property
    def decade(self) -> float:
        """Time [s] in which the difference grows by a factor of ten; infinite without growth."""
        return math.log(10) / self.rate if self.rate else math.inf


def running_envelope(differences: list[np.ndarray], floor: np.ndarray) -> np.ndarray:
    """Largest difference so far over several runs, at least `floor`: each (t,) -> (t,), never falling."""
    largest = np.max([np.asarray(d, float) for d in differences], axis=0)
    return np.maximum.accumulate(np.maximum(largest, floor))


def horizon(time: np.ndarray, allowed: np.ndarray, limit: float) -> float:
    """First time [s] at which the allowed difference reaches `limit`; infinite if it never does."""
    beyond = np.flatnonzero(allowed >= limit)
    return float(time[beyond[0]]) if len(beyond) else math.inf


def growth(time: np.ndarray, envelope: np.ndarray, limit: float) -> Growth:
    """Exponential rate of an envelope (t,) between its first rise and `limit`, fitted by least squares."""
    factor = float(envelope[-1] / envelope[0])
    part = (envelope > 3 * envelope[0]) & (envelope < limit)
    if factor < NO_GROWTH or part.sum() < 5:
        return Growth(factor, None, 0.0)
    t, y = time[part], np.log(envelope[part])
    if (y[-1] - y[0]) < LEAST_DECADES * math.log(10):
        return Growth(factor, None, 0.0)
    slope = float(np.polyfit(t, y, 1)[0])
    return Growth(factor, slope if slope > 0 else None, float(np.corrcoef(t, y)[0, 1] ** 2))


def first_beyond(difference: np.ndarray, allowed: np.ndarray) -> int | None:
    """First index at which a difference (t,) exceeds what is allowed (t,), or is no number; None: never."""
    beyond = np.flatnonzero(~(difference <= allowed))
    return int(beyond[0]) if len(beyond) else None
