"""Rigid-body motion of a rolling sphere with its centre an arm a = R - overlap/2 above the contact point.

The arm of the contact law instead of R: for a = R these are the textbook forms (2/5, 2/7, 5/7, 7/2).
Signs: u along the motion [m/s], w [rad/s] the spin that goes with it, so that slip is u - a w.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from scipy.optimize import brentq

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


def sticking_limit(arm: Arm, slope: float, rolling_friction: float = 0.0) -> float:
    """Friction [1] needed to roll down a slope [rad] against a torque mu_r N R.

    (tan(slope) I/(m a^2) + mu_r R/a)/(1 + I/(m a^2)); for a = R: 2/7 tan(slope) + 5/7 mu_r.
    """
    torque = rolling_friction * arm.radius / arm.arm
    return (math.tan(slope) * arm.inertia + torque) / (1 + arm.inertia)


def down_slope(
    arm: Arm, slope: float, friction: float, gravity: float, rolling_friction: float = 0.0
) -> tuple[float, float]:
    """(du/dt, a dw/dt) [m/s2] from rest on a slope [rad], against a torque mu_r N R below mu N a.

    Rolls as `resisted` if mu reaches the sticking limit (5/7 g (sin - mu_r cos)), else slides with
    g (sin - mu cos) and spins up with (mu - mu_r R/a) g cos m a^2/I (5/2 (mu - mu_r) g cos).
    """
    along, onto = gravity * math.sin(slope), gravity * math.cos(slope)
    if friction >= sticking_limit(arm, slope, rolling_friction):
        rate = resisted(arm, slope, rolling_friction, gravity)
        return rate, rate
    turning = friction - rolling_friction * arm.radius / arm.arm
    return along - friction * onto, turning * onto / arm.inertia


def resisted(arm: Arm, slope: float, rolling_friction: float, gravity: float) -> float:
    """du/dt [m/s2] of a sphere rolling down a slope against a torque mu_r N R; negative on the flat.

    (g sin - mu_r g cos R/a)/(1 + I/(m a^2)); for a = R: 5/7 g (sin - mu_r cos).
    """
    torque = rolling_friction * gravity * math.cos(slope) * arm.radius / arm.arm
    return (gravity * math.sin(slope) - torque) / (1 + arm.inertia)


def wound_stop(speed: float, rate: float, wind: float, damping: float) -> float:
    """Distance [m] from `speed` [m/s] to rest against an elastic-plastic rolling torque with dashpot.

    The spring yields once it is wound up by `wind` [m] of the way; until then the sphere is a damped
    oscillator of frequency sqrt(rate/wind) and damping ratio `damping`; then it slows by `rate` [m/s2]. At
    the end the spring unwinds by `wind`, while the dashpot brings it to rest. Without dashpot the distance is
    speed^2/(2 rate) - wind/2. Raises ValueError if it does not yield.
    """
    whole = math.sqrt(rate / wind)
    decay, turn = damping * whole, whole * math.sqrt(1 - damping**2)

    def way(t: float) -> float:
        return speed / turn * math.exp(-decay * t) * math.sin(turn * t)

    at: Any = brentq(lambda t: way(t) - wind, 0.0, math.atan2(turn, decay) / turn, xtol=1e-14)
    left = speed * math.exp(-decay * at) * (math.cos(turn * at) - decay / turn * math.sin(turn * at))
    return left**2 / (2 * rate)
