"""Times that limit a time step: Rayleigh wave and Hertz contact. Primary inputs only, for any code."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from gpudem.scene import Scene


def rayleigh_time(scene: Scene) -> float:
    """Smallest Rayleigh time [s] of the particles, pi R sqrt(rho/G) / (0.1631 nu + 0.8766).

    G = E / (2 (1 + nu)) [Pa] is the shear modulus.
    Source: LIGGGHTS manual, fix check/timestep/gran.
    """
    times = []
    for name, index in scene.material_index.items():
        mine = scene.state.radius[scene.state.material == index]
        if len(mine):
            m = scene.materials[name]
            shear = m.young / (2 * (1 + m.poisson))
            times.append(math.pi * mine.min() * math.sqrt(m.density / shear) / (0.1631 * m.poisson + 0.8766))
    return float(min(times))


def top_speed(scene: Scene) -> float:
    """Largest speed [m/s] to expect: the largest at the start, and a fall through the domain."""
    size = np.abs(np.array(scene.domain.hi) - np.array(scene.domain.lo))
    fall = math.sqrt(2 * float(np.abs(scene.gravity) @ size))
    return max(float(np.linalg.norm(scene.state.velocity, axis=1).max()), fall if scene.walls else 0.0)


def hertz_time(scene: Scene) -> float:
    """Shortest Hertz contact time [s] at twice the top speed, 2.868266 (m*^2 / (R* E*^2 v))^(1/5).

    Infinite where nothing moves. Of each material the smallest particle counts, against its like.
    Source: Hertz' elastic impact; the constant is (4/5) sqrt(pi) Gamma(2/5)/Gamma(9/10) (15/16)^(2/5).
    """
    speed = 2 * top_speed(scene)
    if speed == 0:
        return math.inf
    times = []
    for name, index in scene.material_index.items():
        mine = scene.state.radius[scene.state.material == index]
        if len(mine):
            m, r = scene.materials[name], mine.min()
            mass = m.density * 4 / 3 * math.pi * r**3
            modulus = m.young / (2 * (1 - m.poisson**2))
            times.append(2.868266 * ((mass / 2) ** 2 / (r / 2 * modulus**2 * speed)) ** 0.2)
    return float(min(times))
