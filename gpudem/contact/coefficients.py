"""Material pair -> the constants of the contact laws, in double precision; every equation with its source.

1/E* = (1 - nu_i^2)/E_i + (1 - nu_j^2)/E_j                                  (Hertz)
1/G* = 2 (2 - nu_i)(1 + nu_i)/E_i + 2 (2 - nu_j)(1 + nu_j)/E_j              (Mindlin)
beta = ln e / sqrt(ln^2 e + pi^2)                                           (Tsuji; Antypov & Elliott)
"""

from __future__ import annotations

import dataclasses
import math

from gpudem.scene import Material, Pair, Scene


@dataclasses.dataclass(frozen=True)
class PairCoefficients:
    """Fields of the device struct `Pair`, in its order."""

    k_normal: float
    k_tangential: float
    c_normal: float
    c_tangential: float
    friction: float
    rolling_friction: float


def young_eff(a: Material, b: Material) -> float:
    """Effective Young's modulus E* [Pa]."""
    return 1 / ((1 - a.poisson**2) / a.young + (1 - b.poisson**2) / b.young)


def shear_eff(a: Material, b: Material) -> float:
    """Effective shear modulus G* [Pa]."""
    return 1 / sum(2 * (2 - m.poisson) * (1 + m.poisson) / m.young for m in (a, b))


def damping_ratio(restitution: float) -> float:
    """|beta| [1] of a coefficient of restitution e: |ln e| / sqrt(ln^2 e + pi^2)."""
    log = math.log(restitution)
    return abs(log) / math.hypot(log, math.pi)


def _hertz(a: Material, b: Material, pair: Pair, scene: Scene) -> tuple[float, float, float, float]:
    """k_n = k q, k_t = k q; c = c sqrt(q m*): 4/3 E*, 8 G*, 2 sqrt(5/6) |beta| sqrt(2 E*), ... sqrt(8 G*)."""
    e_eff, g_eff = young_eff(a, b), shear_eff(a, b)
    c = 2 * math.sqrt(5 / 6) * damping_ratio(pair.restitution)
    return 4 / 3 * e_eff, 8 * g_eff, c * math.sqrt(2 * e_eff), c * math.sqrt(8 * g_eff)


def _hertz_stiffness(a: Material, b: Material, pair: Pair, scene: Scene) -> tuple[float, float, float, float]:
    """The constants as stated: kn, kt [N/m2], gamma_n, gamma_t [1/(m s)]."""
    constants = (pair.kn, pair.kt, pair.gamma_n, pair.gamma_t)
    if None in constants:
        raise ValueError(f"pair {pair.materials}: hertz/stiffness needs kn, kt, gamma_n, gamma_t")
    return constants  # type: ignore[return-value]


def _hooke(a: Material, b: Material, pair: Pair, scene: Scene) -> tuple[float, float, float, float]:
    """A = (16/15 E*)^(4/5) V^(2/5), so that k = A R*^(2/5) m*^(1/5); c = 2 |beta| sqrt(m* k)."""
    speed = scene.contact.characteristic_velocity
    assert speed is not None
    a_hooke = (16 / 15 * young_eff(a, b)) ** 0.8 * speed**0.4
    c = 2 * damping_ratio(pair.restitution)
    return a_hooke, a_hooke, c, c


_LAWS = {"hertz": _hertz, "hertz/stiffness": _hertz_stiffness, "hooke": _hooke}


def pair_coefficients(scene: Scene, a: str, b: str) -> PairCoefficients:
    """Constants of one pair of materials. Raises KeyError where the scene states no such pair."""
    pair = scene.pair(a, b)
    if pair is None:
        raise KeyError(f"no pair {a} / {b}")
    k_n, k_t, c_n, c_t = _LAWS[scene.contact.normal](scene.materials[a], scene.materials[b], pair, scene)
    if not scene.contact.tangential_damping:
        c_t = 0.0
    return PairCoefficients(k_n, k_t, c_n, c_t, pair.friction, pair.rolling_friction)
