"""Effective moduli and damping of two materials, from primary inputs; every equation with its source.

1/E* = (1 - nu_i^2)/E_i + (1 - nu_j^2)/E_j                                  (Hertz)
1/G* = 2 (2 - nu_i)(1 + nu_i)/E_i + 2 (2 - nu_j)(1 + nu_j)/E_j              (Mindlin)
beta = ln e / sqrt(ln^2 e + pi^2)                                           (Tsuji; Antypov & Elliott)
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gpudem.scene.sections import Material

#: Duration of Hertz' elastic impact by (m*^2/(R* E*^2 v))^(1/5):
#: (4/5) sqrt(pi) Gamma(2/5)/Gamma(9/10) (15/16)^(2/5) = 2.868...
HERTZ_TIME = 0.8 * math.sqrt(math.pi) * math.gamma(0.4) / math.gamma(0.9) * (15 / 16) ** 0.4


def young_eff(a: Material, b: Material) -> float:
    """Effective Young's modulus E* [Pa]."""
    return 1 / ((1 - a.poisson**2) / a.young + (1 - b.poisson**2) / b.young)  # mutate: effective_young


def shear_eff(a: Material, b: Material) -> float:
    """Effective shear modulus G* [Pa]."""
    return 1 / sum(2 * (2 - m.poisson) * (1 + m.poisson) / m.young for m in (a, b))  # mutate: effective_shear


def damping_ratio(restitution: float) -> float:
    """|beta| [1] of a coefficient of restitution e: |ln e| / sqrt(ln^2 e + pi^2)."""
    log = math.log(restitution)
    return abs(log) / math.hypot(log, math.pi)  # mutate: damping_ratio


def hertz_time(e_eff: float, radius: float, mass: float, speed: float) -> float:
    """Duration [s] of Hertz' elastic impact of effective radius [m], effective mass [kg], at `speed` [m/s].

    Infinite where nothing moves, or without stiffness.
    """
    if not (speed > 0 and e_eff > 0):
        return math.inf
    return HERTZ_TIME * (mass**2 / (radius * e_eff**2 * speed)) ** 0.2


def hertz_release_speed(e_eff: float, radius: float, mass: float, overlap: float) -> float:
    """Speed [m/s] of an elastic rebound from an overlap [m]: m* v^2/2 = (8/15) E* sqrt(R*) overlap^(5/2)."""
    return math.sqrt(16 / 15 * e_eff * math.sqrt(radius) * overlap**2.5 / mass)
