"""Hertz stiffness with damping that gives the restitution e at any speed (LIGGGHTS `hertz`)."""

import math
from typing import Any

import warp as wp

from gpudem.contact.elasticity import damping_ratio, hertz_release_speed, hertz_time, shear_eff, young_eff
from gpudem.contact.law import LiggghtsWords, NormalLaw, PairInputs


@wp.func
def hertz(c: Any, p: Any):
    """Stiffness and damping of a contact.

        q = sqrt(R* overlap);  k_n = 4/3 E* q,  k_t = 8 G* q
        c_n = 2 sqrt(5/6) |beta| sqrt(2 E* q m*),  c_t = 2 sqrt(5/6) |beta| sqrt(8 G* q m*)

    k_t is the present one, applied to the whole spring: no Mindlin unloading history.
    Source: Tsuji, Tanaka & Ishida, Powder Technol. 71 (1992) 239; Antypov & Elliott, EPL 94 (2011) 50004.
    """
    q = wp.sqrt(c.radius_eff * c.overlap)
    d = wp.sqrt(q * c.mass_eff)  # mutate: hertz_damping_root
    return p.k_normal * q, p.k_tangential * q, p.c_normal * d, p.c_tangential * d


@wp.func
def hertz_damping_integral(c: Any, p: Any, overlap: Any):
    """Integral of c_n over the overlap from 0 [N s]: 4/5 c_n overlap."""
    q = wp.sqrt(c.radius_eff * overlap)
    return type(overlap)(0.8) * p.c_normal * wp.sqrt(q * c.mass_eff) * overlap  # mutate: hertz_damping_work


class Hertz(NormalLaw):
    """k = 4/3 E*, 8 G*; c = 2 sqrt(5/6) |beta| sqrt(2 E*), 2 sqrt(5/6) |beta| sqrt(8 G*)."""

    name = "hertz"
    reads = ("young", "poisson", "restitution")
    liggghts = LiggghtsWords(
        "hertz",
        (
            ("per_material", "youngsModulus", lambda m: m.young, 0.0),
            ("per_material", "poissonsRatio", lambda m: m.poisson, 0.0),
            ("per_pair", "coefficientRestitution", lambda p: p.restitution, 1.0),
        ),
    )

    def coefficients_of(self, inputs: PairInputs) -> dict[str, float]:  # noqa: D102
        e_eff, g_eff = young_eff(inputs.a, inputs.b), shear_eff(inputs.a, inputs.b)
        c = 2 * math.sqrt(5 / 6) * damping_ratio(inputs.pair.restitution)  # mutate: hertz_damping
        # mutate: hertz_constants
        values = (4 / 3 * e_eff, 8 * g_eff, c * math.sqrt(2 * e_eff), c * math.sqrt(8 * g_eff))
        return dict(zip(self.coefficients, values, strict=True))

    def contact_time(self, inputs: PairInputs, radius: float, mass: float, speed: float) -> float:  # noqa: D102
        return hertz_time(young_eff(inputs.a, inputs.b), radius, mass, speed)

    def release_speed(self, inputs: PairInputs, radius: float, mass: float, overlap: float) -> float:  # noqa: D102
        return hertz_release_speed(young_eff(inputs.a, inputs.b), radius, mass, overlap)


LAW = Hertz(hertz, hertz_damping_integral)
