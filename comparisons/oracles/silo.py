"""Silos: load on the bottom (Janssen 1895), stresses at rest (Rankine 1857), discharge (Beverloo 1961)."""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import root_scalar

#: C and k of Beverloo, Leniger and van de Velde (1961), Chem. Eng. Sci. 15, 260.
BEVERLOO_C, BEVERLOO_K = 0.58, 1.4


def beverloo(opening: float, diameter: float, density: float, gravity: float, k: float = BEVERLOO_K) -> float:
    """Mass discharged in a time [kg/s]: W = C rho_b sqrt(g) (D - k d)^(5/2).

    Args:
        opening: Diameter D of the orifice [m].
        diameter: Diameter d of the grains [m].
        density: Bulk density rho_b [kg/m3].
        gravity: g [m/s2].
        k: Width that the grains at the rim leave empty [d].
    """
    return BEVERLOO_C * density * math.sqrt(gravity) * (opening - k * diameter) ** 2.5


def bottom_share(number: float) -> float:
    """Share of the weight that the bottom carries by Janssen: (1 - exp(-x))/x, x = 4 phi K H/D.

    phi is the friction mobilized at the walls, tangential over normal force; K the ratio of horizontal to
    vertical stress; H the height; D four times the area over the circumference.
    """
    return -math.expm1(-number) / number if number > 0 else 1.0


def janssen_number(share: float) -> float:
    """The x at which the bottom carries a share of the weight. Raises ValueError for one not below 1."""
    if not 0 < share < 1:
        raise ValueError(f"share = {share:g}: must lie between 0 and 1")
    return root_scalar(lambda x: bottom_share(x) - share, bracket=(1e-12, 1 / share + 1), xtol=1e-14).root


def wall_stress(depth: np.ndarray, height: float, number: float, k: float, weight: float) -> np.ndarray:
    """Normal stress on the walls [Pa] at depths below the surface [m]: K rho g H (1 - exp(-x z/H))/x.

    Args:
        depth: z [m].
        height: H [m].
        number: x of `bottom_share`.
        k: K [1].
        weight: rho g, of the bed as a whole [N/m3].
    """
    return k * weight * height * -np.expm1(-number * depth / height) / number


def active_ratio(angle: float) -> float:
    """Rankine's K of grains about to yield under their weight: (1 - sin a)/(1 + sin a), a [rad]."""
    return (1 - math.sin(angle)) / (1 + math.sin(angle))
