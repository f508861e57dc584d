"""Hertz form with constants given directly (LIGGGHTS `hertz/stiffness`)."""

import math
from typing import Any

import numpy as np
import warp as wp

from gpudem.contact.elasticity import hertz_release_speed, hertz_time
from gpudem.contact.law import CONSTANT_WORDS, LiggghtsWords, PairInputs, StatedConstants


@wp.func
def hertz_stiffness(c: Any, p: Any):
    """Q = sqrt(R* overlap);  k_n = kn q,  k_t = kt q,  c_n = gamma_n m* q,  c_t = gamma_t m* q."""
    q = wp.sqrt(c.radius_eff * c.overlap)
    d = q * c.mass_eff  # mutate: hertz_stiffness_damping
    return p.k_normal * q, p.k_tangential * q, p.c_normal * d, p.c_tangential * d


@wp.func
def hertz_stiffness_damping_integral(c: Any, p: Any, overlap: Any):
    """Integral of c_n over the overlap from 0 [N s]: 2/3 c_n overlap."""
    q = wp.sqrt(c.radius_eff * overlap)
    return p.c_normal * q * c.mass_eff * overlap / type(overlap)(1.5)  # mutate: hertz_stiffness_damping_work


def rebound(damping: float) -> float:
    """-x' as x'' = -x^1.5 - damping x^0.5 x' comes back to 0 from x' = 1: one number for any impact."""
    from scipy.integrate import solve_ivp

    def slope(_: float, y: np.ndarray) -> list[float]:
        x = max(float(y[0]), 0.0)
        return [float(y[1]), -(x**1.5) - damping * math.sqrt(x) * float(y[1])]

    def back(_: float, y: np.ndarray) -> float:
        return float(y[0])

    back.terminal, back.direction = True, -1.0  # type: ignore[attr-defined]
    end = solve_ivp(slope, (0.0, 1e3), [1e-9, 1.0], events=back, rtol=1e-8, atol=1e-12)
    return float(-end.y[1, -1]) if end.t_events[0].size else 0.0


class HertzStiffness(StatedConstants):
    """The constants as stated: kn, kt [N/m2], gamma_n, gamma_t [1/(m s)]; the moduli do not act."""

    name = "hertz/stiffness"
    liggghts = LiggghtsWords("hertz/stiffness", CONSTANT_WORDS)

    def contact_time(self, inputs: PairInputs, radius: float, mass: float, speed: float) -> float:
        """That of `hertz` with E* = 3/4 kn."""
        return hertz_time(0.75 * (inputs.pair.kn or 0.0), radius, mass, speed)

    def release_speed(self, inputs: PairInputs, radius: float, mass: float, overlap: float) -> float:
        """That of `hertz` with E* = 3/4 kn."""
        return hertz_release_speed(0.75 * (inputs.pair.kn or 0.0), radius, mass, overlap)

    def restitution(self, inputs: PairInputs, radius: float, mass: float, speed: float) -> float:
        """From the law itself, m* d'' = -sqrt(R* d) (kn d + gamma_n m* d'): it falls as the speed grows."""
        pair = inputs.pair
        if not (speed > 0 and pair.kn and pair.gamma_n):
            return 1.0
        a, b = pair.kn * math.sqrt(radius) / mass, pair.gamma_n * math.sqrt(radius)
        return rebound(b * (speed**2 / a) ** 0.6 / speed)


LAW = HertzStiffness(hertz_stiffness, hertz_stiffness_damping_integral)
