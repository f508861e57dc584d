"""A ball that bounces on a plate y = A sin(w t): impacts in no time, v - u after = -e (v - u) before."""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import brentq


def thresholds(e: float) -> tuple[float, float]:
    """Largest acceleration of the plate by g from which on a ball can bounce once a period, and up to which
    this is stable: pi (1 - e)/(1 + e) and sqrt((pi (1 - e)/(1 + e))^2 + (2 (1 + e^2)/(1 + e)^2)^2).

    Flights of one period T leave at v = g T/2 = (1 + e) u + e g T/2, so u = (1 - e)/(1 + e) g T/2, at most
    A w. A deviation (dt, dv) of a start gives one of the flight (1 + e) dv/g, so the next is
    dt' = dt + (1 + e)/g dv, dv' = (1 + e) y'' dt' + e^2 dv: determinant e^2, trace 1 + e^2 + (1 + e)^2 y''/g.
    An eigenvalue is -1 where -y''/g = 2 (1 + e^2)/(1 + e)^2; u and y'' make the sides of a right angle.
    """
    begin = math.pi * (1 - e) / (1 + e)
    return begin, math.hypot(begin, 2 * (1 + e * e) / (1 + e) ** 2)


def map_heights(e: float, strength: float, impacts: int = 300, last: int = 8) -> np.ndarray:
    """Heights of the last flights above the middle of the plate by g T^2/8, that of a flight of one period T.

    strength: A w^2/g, above the first of the `thresholds`. Times by T, lengths by g T^2.
    """
    w = 2 * math.pi
    size, time, velocity = strength / w**2, math.acos(thresholds(e)[0] / strength) / w, 0.501
    heights = []
    for _ in range(impacts):

        def gap(flown: float, t: float = time, v: float = velocity) -> float:
            away = size * (math.sin(w * t) - math.sin(w * (t + flown)))
            return away + v * flown - flown**2 / 2

        beyond = 0.01
        while gap(beyond) > 0:
            beyond += 0.01
        flown = float(brentq(gap, beyond - 0.01, beyond, xtol=1e-14))  # type: ignore[arg-type]
        heights.append(8 * (size * math.sin(w * time) + velocity**2 / 2))
        time += flown
        velocity = (1 + e) * size * w * math.cos(w * time) - e * (velocity - flown)
    return np.array(heights[-last:])
