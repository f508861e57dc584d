"""Adhesive contact of Johnson, Kendall and Roberts: from the contact radius, by root finding and quadrature.

F(a) = 4 E* a^3/(3 R*) - sqrt(8 pi w E* a^3),  overlap(a) = a^2/R* - sqrt(2 pi w a/E*)

on the branch where the overlap grows with a. Source: Johnson, Kendall and Roberts, Proc. R. Soc. A 324 (1971)
301; sticking: Thornton and Ning, Powder Technol. 99 (1998) 154.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

from comparisons.oracles.bodies import Bodies


@dataclasses.dataclass(frozen=True)
class Adhesion:
    """Two bodies and their work of adhesion w [J/m2]."""

    bodies: Bodies
    work: float

    def force(self, a: float) -> float:
        """Force [N] at a contact radius [m], positive when repulsive."""
        e, r = self.bodies.young_star, self.bodies.radius_star
        return 4 * e * a**3 / (3 * r) - math.sqrt(8 * math.pi * self.work * e * a**3)

    def overlap(self, a: float) -> float:
        """Overlap [m] at a contact radius [m]."""
        pull = math.sqrt(2 * math.pi * self.work * a / self.bodies.young_star)
        return a**2 / self.bodies.radius_star - pull

    @property
    def last_radius(self) -> float:
        """Contact radius [m] at which the contact breaks: the overlap is least, d overlap/da = 0."""
        e, r = self.bodies.young_star, self.bodies.radius_star
        return (math.pi * self.work * r**2 / (8 * e)) ** (1 / 3)

    @property
    def gap(self) -> float:
        """Gap [m] at which the contact breaks."""
        return -self.overlap(self.last_radius)

    @property
    def pull_off(self) -> float:
        """Largest attraction [N]: 3/2 pi w R*."""
        return 1.5 * math.pi * self.work * self.bodies.radius_star

    def radius(self, overlap: float) -> float:
        """Contact radius [m] at an overlap [m] of at least -gap."""
        low, high = self.last_radius, 2 * self.last_radius
        while self.overlap(high) < overlap:
            high *= 2
        found: Any = brentq(lambda a: self.overlap(a) - overlap, low, high, xtol=1e-16 * high)
        return float(found)

    def force_at(self, overlap: float) -> float:
        """Force [N] at an overlap [m]."""
        return self.force(self.radius(overlap))

    @property
    def lost(self) -> float:
        """Energy [J] that a contact costs: the work against the attraction from touch to the gap."""
        step = 1e-6

        def share(a: float) -> float:
            slope = (self.overlap(a * (1 + step)) - self.overlap(a * (1 - step))) / (2 * step * a)
            return -self.force(a) * slope

        return float(quad(share, self.last_radius, self.radius(0.0), epsabs=0, epsrel=1e-10)[0])

    @property
    def sticking_speed(self) -> float:
        """Largest impact speed [m/s] from which two bodies do not part again, without damping."""
        return math.sqrt(2 * self.lost / self.bodies.mass_star)

    def motion(self, speed: float, times: np.ndarray, damping: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Overlap [m] and its rate [m/s] after the touch [s], head-on; NaN after the contact has broken.

        `damping` C: dashpot C sqrt(m* a) overlap' [N s/m1.5 kg0.5].
        """
        done = self._solved(speed, float(times[-1]), damping, times)
        found = np.full((2, len(times)), np.nan)
        found[:, : done.y.shape[1]] = done.y
        return found[0], found[1]

    def restitution(self, speed: float, duration: float, damping: float = 0.0) -> float:
        """Speed at which the bodies part by that of the impact [1]; 0 if they have not by `duration` [s]."""
        done = self._solved(speed, duration, damping)
        return float(-done.y_events[0][0, 1] / speed) if len(done.t_events[0]) else 0.0

    def _solved(self, speed: float, duration: float, damping: float, times: np.ndarray | None = None) -> Any:
        m = self.bodies.mass_star

        def slope(_: float, y: np.ndarray) -> list[float]:
            a = self.radius(max(float(y[0]), -self.gap))
            return [float(y[1]), -(self.force(a) + damping * math.sqrt(m * a) * float(y[1])) / m]

        def broken(_: float, y: np.ndarray) -> float:
            return float(y[0]) + self.gap * (1 - 1e-12)

        broken.terminal, broken.direction = True, -1.0  # type: ignore[attr-defined]
        return solve_ivp(
            slope, (0.0, duration), [0.0, speed], t_eval=times, events=broken, rtol=1e-9, atol=1e-15
        )
