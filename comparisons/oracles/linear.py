"""Exact motion under a linear spring and dashpot, F = k d - c v: bouncing sphere, column between two walls.

`hooke` has k = 16/15 sqrt(R*) E* (15 m* V^2/(16 sqrt(R*) E*))^(1/5) = (16/15 E*)^(4/5) R*^(2/5) m*^(1/5)
V^(2/5), so that any k wanted fixes E* for a given R*, m* and V.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from scipy.linalg import expm
from scipy.optimize import root_scalar


def young_star(stiffness: float, radius_star: float, mass_star: float, speed: float) -> float:
    """E* [Pa] with which `hooke` at characteristic velocity `speed` has the stiffness wanted [N/m]."""
    return 15 / 16 * (stiffness / (radius_star**0.4 * mass_star**0.2 * speed**0.4)) ** 1.25


def damping(stiffness: float, mass_star: float, restitution: float) -> float:
    """Dashpot c [N s/m] that keeps e of the speed: 2 sqrt(m* k) |ln e|/sqrt(pi^2 + ln^2 e)."""
    log = abs(math.log(restitution))
    return 2 * math.sqrt(mass_star * stiffness) * log / math.hypot(math.pi, log)


@dataclasses.dataclass(frozen=True)
class Phase:
    """One stretch of flight or contact: from `start` to `end` [s], height above touching and velocity."""

    contact: bool
    start: float
    end: float
    gap: float
    """Height of the lowest point at the start [m]: 0 but for the first phase."""
    speed: float
    """Vertical velocity at the start [m/s]."""


@dataclasses.dataclass(frozen=True)
class Bouncer:
    """A sphere dropped on a floor with k, c under gravity; exact phase by phase.

    Contact (MFIX-DEM verification case 01): b = c/(2 sqrt(k m)), w0 = sqrt(k/m), w = w0 sqrt(1 - b^2),

        gap = -g/w0^2 + exp(-b w0 t) (g/w0^2 cos w t + (v + b w0 g/w0^2)/w sin w t),  v < 0 at the touch

    and flight again as soon as the gap is zero: the force may pull before that, as in LIGGGHTS' law.
    """

    mass: float
    stiffness: float
    restitution: float
    gravity: float
    drop: float
    """Height of the lowest point at t = 0, at rest [m]."""

    def _contact(self, speed: float, t: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
        c = damping(self.stiffness, self.mass, self.restitution)
        w0, b = math.sqrt(self.stiffness / self.mass), c / (2 * math.sqrt(self.stiffness * self.mass))
        w, sink = w0 * math.sqrt(1 - b * b), self.gravity / w0**2
        sine = (speed + b * w0 * sink) / w
        fade, cos, sin = np.exp(-b * w0 * t), np.cos(w * t), np.sin(w * t)
        gap = -sink + fade * (sink * cos + sine * sin)
        return gap, fade * ((w * sine - b * w0 * sink) * cos - (w * sink + b * w0 * sine) * sin)

    def phases(self, until: float) -> list[Phase]:
        """Flights and contacts up to a time [s]; the last contact may be one that does not end."""
        found: list[Phase] = []
        time, gap, speed = 0.0, self.drop, 0.0
        half = math.pi * math.sqrt(self.mass / self.stiffness)
        while time < until:
            if len(found) % 2 == 0:
                flight = (speed + math.sqrt(speed**2 + 2 * self.gravity * gap)) / self.gravity
                found.append(Phase(False, time, time + flight, gap, speed))
                time, gap, speed = time + flight, 0.0, speed - self.gravity * flight
                continue
            grid = np.linspace(1e-3, 4.0, 4000) * half
            out = np.flatnonzero(self._contact(speed, grid)[0] > 0)
            if not len(out):  # it comes to rest
                found.append(Phase(True, time, math.inf, 0.0, speed))
                break
            before = speed
            last = root_scalar(
                lambda t, v=before: float(self._contact(v, t)[0]),
                bracket=(grid[max(out[0] - 1, 0)], grid[out[0]]), xtol=1e-16,
            ).root  # fmt: skip
            found.append(Phase(True, time, time + last, 0.0, speed))
            time, speed = time + last, float(self._contact(speed, last)[1])
        return found

    def at(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(height of the lowest point [m], velocity [m/s]) at the times [s]."""
        gap, speed = np.empty_like(time), np.empty_like(time)
        for p in self.phases(float(time.max()) + 1e-12):
            here = (time >= p.start) & (time <= p.end)
            t = time[here] - p.start
            if p.contact:
                gap[here], speed[here] = self._contact(p.speed, t)
            else:
                gap[here] = p.gap + p.speed * t - self.gravity * t * t / 2
                speed[here] = p.speed - self.gravity * t
        return gap, speed

    def tops(self, until: float) -> list[float]:
        """Height of the lowest point [m] at the top of each flight after a bounce, of those that end by
        then.
        """
        return [
            p.speed**2 / (2 * self.gravity)
            for p in self.phases(until)
            if not p.contact and p.start > 0 and p.start + p.speed / self.gravity < until
        ]


def hard_sphere_top(drop: float, restitution: float, bounce: int) -> float:
    """Height [m] after bounce n of a hard sphere dropped from `drop`: drop e^(2n), the limit of large k."""
    return drop * restitution ** (2 * bounce)


def squeezed_column(
    time: np.ndarray,
    height: Sequence[float],
    radius: float,
    masses: Sequence[float],
    roof: float,
    stiffness: float,
    restitution: float,
    gravity: float,
) -> np.ndarray:
    """Heights [m] (t, 2) of two spheres between a floor at 0 and a roof, all three contacts closed, from
    rest.

    m_i y_i'' = sum of k d - c d' over its contacts - m_i g: linear, so y = y_eq + exp(A t)(y_0 - y_eq) with
    A the 4 x 4 matrix of positions and velocities (MFIX-DEM verification case 03).
    """
    m = np.array(masses)
    star = (m[0], m[0] * m[1] / m.sum(), m[1])
    links = np.array([[-1.0, 0.0], [1.0, -1.0], [0.0, 1.0]])  # overlap = rest + link . y
    rest = np.array([radius, 2 * radius, radius - roof])
    dashpots = np.array([damping(stiffness, s, restitution) if restitution < 1 else 0.0 for s in star])
    push = -(links.T / m[:, None])  # acceleration of each sphere by each contact force, upwards
    spring, drag = push @ (stiffness * links), (push * dashpots) @ links
    constant = push @ (stiffness * rest) - gravity
    balance = np.linalg.solve(spring, -constant)
    matrix = np.block([[np.zeros((2, 2)), np.eye(2)], [spring, drag]])
    start = np.concatenate([np.array(height) - balance, np.zeros(2)])
    return balance + np.array([(expm(matrix * t) @ start)[:2] for t in time])
