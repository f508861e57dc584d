"""Areas of cohesion, from the geometry of two spheres that overlap: no formula of a contact law is used.

The spheres meet in a circle of radius a. Its plane is at h_i = (r^2 + R_i^2 - R_j^2)/(2 r) from the center of
i, and a^2 = R_i^2 - h_i^2. A plane at the distance r cuts a sphere in a circle of a^2 = R^2 - r^2.
"""

from __future__ import annotations

import math
from typing import Any

from scipy.optimize import brentq, minimize_scalar

from comparisons.oracles.bodies import Bodies


def circle(distance: float, radius: float, other: float) -> float:
    """Area [m2] of the circle in which a sphere meets another one, at a distance [m]; radius inf: a plane."""
    height = distance if math.isinf(other) else (distance**2 + radius**2 - other**2) / (2 * distance)
    return math.pi * (radius - height) * (radius + height)


def linear(distance: float, radius: float, other: float) -> float:
    """Area [m2] of `sjkr2`: 4 pi overlap R* of two spheres, 2 pi overlap R at a plane (LIGGGHTS)."""
    if math.isinf(other):
        return 2 * math.pi * (radius - distance) * radius
    return 4 * math.pi * (radius + other - distance) / (1 / radius + 1 / other)


def pull_off(bodies: Bodies, density: float) -> float:
    """Largest attraction [N] of a Hertz contact less cohesion `density` [J/m3] times the circle.

    Without dashpot. For overlaps far below R*: 2/3 pi^3 density^3 R*^2/E*^2.
    """
    first, second = bodies.radius

    def force(overlap: float) -> float:
        distance = first - overlap + (0.0 if math.isinf(second) else second)
        return bodies.normal_constant * overlap**1.5 - density * circle(distance, first, second)

    # without the curvature of the surfaces the force is least at pi^2 density^2 R*/E*^2
    near = (math.pi * density / bodies.young_star) ** 2 * bodies.radius_star
    found: Any = minimize_scalar(force, bounds=(0.0, min(4 * near, 0.5 * first)), method="bounded",
                                 options={"xatol": 1e-6 * near})  # fmt: skip
    return -float(found.fun)


def density_for(bodies: Bodies, attraction: float) -> float:
    """The cohesion energy density [J/m3] that gives a pull-off force [N]."""
    small = (1.5 * attraction / math.pi**3 * bodies.young_star**2 / bodies.radius_star**2) ** (1 / 3)
    found: Any = brentq(
        lambda k: pull_off(bodies, k) - attraction, 0.5 * small, 2 * small, xtol=1e-10 * small
    )
    return float(found)
