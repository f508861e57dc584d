"""Largest stable step of LIGGGHTS' scheme on contacts at rest: eigenvalues of one step, linearised.

The scheme sees the dashpot with velocities half a step old:

    v' = v + h (-K x - C v)/m,   x' = x + h v'

For one mode of frequency w and damping ratio b it is stable up to h = (2/w)(sqrt(1 + b^2) - b).
Frictional contacts of a sphere have a second mode, faster than the first: slip at the contact stretches
the spring by displacement and by spin, and 1/m + R^2/I = 3.5/m.
"""

from __future__ import annotations

import math

import numpy as np

from comparisons.oracles import linear
from comparisons.oracles.bodies import Bodies


def one_mode(frequency: float, damping_ratio: float) -> float:
    """Largest stable step [s] of a mode, (2/w)(sqrt(1 + b^2) - b), w [rad/s]."""
    return 2 / frequency * (math.sqrt(1 + damping_ratio**2) - damping_ratio)


def hooke_stiffness(c: Bodies, speed: float) -> float:
    """Stiffness [N/m] of `hooke` at a characteristic velocity [m/s]: the inverse of `linear.young_star`."""
    unit = linear.young_star(1.0, c.radius_star, c.mass_star, speed)
    return (c.young_star / unit) ** 0.8


def rest(c: Bodies, load: float, hooke_speed: float | None = None) -> tuple[float, float, float]:
    """(overlap [m], dF/doverlap [N/m], k_t [N/m]) of a contact that carries a load [N].

    Hertz, or `hooke` at its characteristic velocity, where k_t = k_n.
    """
    if hooke_speed is not None:
        k = hooke_stiffness(c, hooke_speed)
        return load / k, k, k
    overlap = (load / c.normal_constant) ** (2 / 3)
    root = math.sqrt(overlap)
    return overlap, 1.5 * c.normal_constant * root, c.tangential_constant * root


def single(c: Bodies, load: float, hooke_speed: float | None = None) -> float:
    """Largest stable step [s] of a sphere at rest on a plane, the lower of its normal and its friction mode.

    Dashpots: Hertz c_n = 2 sqrt(5/6) b sqrt(m* dF/dd), c_t = 2 sqrt(5/6) b sqrt(m* k_t); `hooke` without
    the factor sqrt(5/6).
    """
    _, kn, kt = rest(c, load, hooke_speed)
    b = c.damping_ratio * (1.0 if hooke_speed is not None else math.sqrt(5 / 6))
    normal = one_mode(math.sqrt(kn / c.mass_star), b)
    if not c.friction:
        return normal
    return min(normal, one_mode(math.sqrt(3.5 * kt / c.mass_star), math.sqrt(3.5) * b))


def column(
    count: int, floor: Bodies, pair: Bodies, gravity: float, hooke_speed: float | None = None
) -> float:
    """Largest stable step [s] of a column of equal spheres without friction at rest under its own weight.

    By bisection on the spectral radius of the step; contacts as in `single`.
    """
    mass = floor.mass[0]
    stiff, drag = np.zeros((count, count)), np.zeros((count, count))
    for k in range(count):
        c = floor if k == 0 else pair
        load = (count - k) * mass * gravity
        _, kn, _ = rest(c, load, hooke_speed)
        b = c.damping_ratio * (1.0 if hooke_speed is not None else math.sqrt(5 / 6))
        link = np.zeros(count)
        link[k] = 1.0
        if k:
            link[k - 1] = -1.0
        stiff += kn / mass * np.outer(link, link)
        drag += 2 * b * math.sqrt(c.mass_star * kn) / mass * np.outer(link, link)
    eye = np.eye(count)

    def growth(h: float) -> float:
        kick = eye - h * drag
        step = np.block([[kick, -h * stiff], [h * kick, eye - h * h * stiff]])
        return float(np.abs(np.linalg.eigvals(step)).max())

    hi = 2 / math.sqrt(float(np.linalg.eigvalsh(stiff).max()))
    lo = 0.0
    for _ in range(50):
        middle = (lo + hi) / 2
        lo, hi = (middle, hi) if growth(middle) <= 1 + 1e-9 else (lo, middle)
    return hi


def rayleigh_time(radius: float, young: float, poisson: float, density: float) -> float:
    """T_R = pi R sqrt(rho/G)/(0.1631 nu + 0.8766) [s], G = E/(2 (1 + nu)) (LIGGGHTS manual)."""
    shear = young / (2 * (1 + poisson))
    return math.pi * radius * math.sqrt(density / shear) / (0.1631 * poisson + 0.8766)
