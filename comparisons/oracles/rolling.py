"""Rigid-body motion of a rolling sphere with its centre an arm a = R - overlap/2 above the contact point.

The arm of the contact law instead of R: for a = R these are the textbook forms (2/5, 2/7, 5/7, 7/2).
Signs: u along the motion [m/s], w [rad/s] the spin that goes with it, so that slip is u - a w.
"""

from __future__ import annotations

import dataclasses
import math

from comparisons.oracles.bodies import Bodies


@dataclasses.dataclass(frozen=True)
class Arm:
    """A sphere on a plane at its static overlap (m g_n/k)^(2/3), g_n [m/s2] the gravity onto the plane."""

    radius: float
    arm: float
    overlap: float

    @classmethod
    def of(cls, c: Bodies, gravity: float) -> Arm:
        """Static arm of the first body."""
        overlap = (c.mass[0] * gravity / c.normal_constant) ** (2 / 3)
        return cls(c.radius[0], c.radius[0] - overlap / 2, overlap)

    @property
    def inertia(self) -> float:
        """I/(m a^2) [1]: 2/5 for a = R."""
        return 0.4 * (self.radius / self.arm) ** 2


def sticking_limit(arm: Arm, slope: float) -> float:
    """Friction [1] needed to roll down a slope [rad]: tan(slope)/(1 + m a^2/I), 2/7 tan(slope)."""
    return math.tan(slope) / (1 + 1 / arm.inertia)


def down_slope(arm: Arm, slope: float, friction: float, gravity: float) -> tuple[float, float]:
    """(du/dt, a dw/dt) [m/s2] from rest on a slope [rad].

    Rolls with g sin/(1 + I/(m a^2)) if mu reaches the sticking limit (5/7 g sin(slope)), else slides with
    g (sin - mu cos) and spins up with mu g cos m a^2/I (5/2 mu g cos).
    """
    along, onto = gravity * math.sin(slope), gravity * math.cos(slope)
    if friction >= sticking_limit(arm, slope):
        rate = along / (1 + arm.inertia)
        return rate, rate
    return along - friction * onto, friction * onto / arm.inertia


def resisted(arm: Arm, slope: float, rolling_friction: float, gravity: float) -> float:
    """du/dt [m/s2] of a sphere rolling down a slope against a torque mu_r N R; negative on the flat.

    (g sin - mu_r g cos R/a)/(1 + I/(m a^2)); for a = R: 5/7 g (sin - mu_r cos).
    """
    torque = rolling_friction * gravity * math.cos(slope) * arm.radius / arm.arm
    return (gravity * math.sin(slope) - torque) / (1 + arm.inertia)
