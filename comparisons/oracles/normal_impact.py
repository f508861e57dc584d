"""A normal impact under a power law m x'' = -K x^p - C x^q x', integrated to rounding; the viscoelastic law.

In units of L = (m v^2/K)^(1/(p + 1)), T = L/v it reads x'' = -x^p - c x^q x', c = C L^(q + 1)/(m v): the
restitution depends on c alone. Hertz with constant restitution p = 3/2, q = 1/4; linear 1, 0; viscoelastic
(Kuwabara and Kono 1987; Brilliantov, Spahn, Hertzsch and Poeschel 1996) 3/2, 1/2.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.integrate import solve_ivp


def restitution(p: float, q: float, c: float, limit_force: bool, rtol: float = 1e-12) -> float:
    """Speed after / before; the contact ends at zero overlap, with `limit_force` where the force is zero.

    Raises ValueError where the contact does not end within 1000 T.
    """

    def derivative(_t: float, y: np.ndarray) -> tuple[float, float]:
        x = max(y[0], 0.0)
        return y[1], -(x**p) - c * x**q * y[1]

    def end(_t: float, y: np.ndarray) -> float:
        return max(y[0], 0.0) ** (p - q) + c * y[1] if limit_force and c > 0 else y[0]

    ends: Any = end
    ends.terminal, ends.direction = True, -1
    found = solve_ivp(
        derivative, (0.0, 1000.0), (0.0, 1.0), "DOP853", events=ends, rtol=rtol, atol=rtol * 1e-2,
        first_step=1e-8, max_step=0.05,
    )  # fmt: skip
    if found.status != 1:
        raise ValueError(f"the contact does not end: {found.message}")
    return float(-found.y[1, -1])


def viscoelastic_velocity(
    kn: float, gamma_n: float, radius_star: float, mass_star: float, speed: float
) -> float:
    """v* [1] of `hertz/stiffness`, k_n = kn q, c_n = gamma_n m* q, q = sqrt(R* overlap), at a speed [m/s].

    In F = K (x^1.5 + 3/2 A x^0.5 x') it is K = kn sqrt(R*), 3/2 A = gamma_n m*/kn, and v* = beta^(1/2)
    v^(1/10) with beta = 3/2 A (K/m*)^(2/5): c of `restitution` is v*^2. (Mueller and Poeschel 2011.)
    """
    beta = gamma_n * mass_star / kn * (kn * radius_star**0.5 / mass_star) ** 0.4
    return beta**0.5 * speed**0.1


def gamma_for(v_star: float, kn: float, radius_star: float, mass_star: float) -> float:
    """gamma_n [1/(m s)] that gives v* at 1 m/s: the inverse of `viscoelastic_velocity`."""
    return v_star**2 * kn / mass_star * (mass_star / (kn * radius_star**0.5)) ** 0.4


def pade(v_star: float) -> float:
    """Restitution of the viscoelastic law, force cut at zero (Mueller and Poeschel 2011): (1 + c1 v)/(1 + b1
    v + ... + b4 v^4).

    Good to 2e-4 up to v* = 0.4, to 0.009 at v* = 2.
    """
    c1, b = 0.501086, (0.501086, 1.15345, 0.577977, 0.532178)
    return (1 + c1 * v_star) / (1 + sum(x * v_star ** (k + 1) for k, x in enumerate(b)))
