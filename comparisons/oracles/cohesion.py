"""Areas of cohesion, from the geometry of two spheres that overlap: no formula of a contact law is used.

The spheres meet in a circle of radius a. Its plane is at h_i = (r^2 + R_i^2 - R_j^2)/(2 r) from the center of
i, and a^2 = R_i^2 - h_i^2. A plane at the distance r cuts a sphere in a circle of a^2 = R^2 - r^2.
"""

from __future__ import annotations

import math


def circle(distance: float, radius: float, other: float) -> float:
    """Area [m2] of the circle in which a sphere meets another one, at a distance [m]; radius inf: a plane."""
    height = distance if math.isinf(other) else (distance**2 + radius**2 - other**2) / (2 * distance)
    return math.pi * (radius - height) * (radius + height)


def linear(distance: float, radius: float, other: float) -> float:
    """Area [m2] of `sjkr2`: 4 pi overlap R* of two spheres, 2 pi overlap R at a plane (LIGGGHTS)."""
    if math.isinf(other):
        return 2 * math.pi * (radius - distance) * radius
    return 4 * math.pi * (radius + other - distance) / (1 / radius + 1 / other)
