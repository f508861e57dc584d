"""Linear spring as stiff as Hertz' at the characteristic velocity V (LIGGGHTS `hooke`)."""

import math
from typing import Any

import warp as wp

from gpudem.contact.elasticity import damping_ratio, young_eff
from gpudem.contact.law import LiggghtsWords, NormalLaw, PairInputs


@wp.func
def hooke(c: Any, p: Any):
    """Stiffness and damping of a contact.

        k_n = k_t = 16/15 sqrt(R*) E* (15 m* V^2 / (16 sqrt(R*) E*))^(1/5) = A R*^(2/5) m*^(1/5)
        c_n = c_t = 2 |beta| sqrt(m* k_n)

    The contact time does not depend on the impact speed.
    """
    # mutate: hooke_stiffness
    k = p.k_normal * wp.pow(c.radius_eff, type(c.overlap)(0.4)) * wp.pow(c.mass_eff, type(c.overlap)(0.2))
    d = wp.sqrt(c.mass_eff * k)
    return k, k, p.c_normal * d, p.c_tangential * d


@wp.func
def hooke_damping_integral(c: Any, p: Any, overlap: Any):
    """Integral of c_n over the overlap from 0 [N s]: c_n overlap."""
    _kn, _kt, cn, _ct = hooke(c, p)
    return cn * overlap  # mutate: hooke_damping_work


class Hooke(NormalLaw):
    """A = (16/15 E*)^(4/5) V^(2/5), so that k = A R*^(2/5) m*^(1/5); c = 2 |beta| sqrt(m* k)."""

    name = "hooke"
    reads = ("young", "poisson", "restitution", "characteristic_velocity")
    liggghts = LiggghtsWords(
        "hooke",
        (
            ("per_material", "youngsModulus", lambda m: m.young, 0.0),
            ("per_material", "poissonsRatio", lambda m: m.poisson, 0.0),
            ("per_pair", "coefficientRestitution", lambda p: p.restitution, 1.0),
            ("scalar", "characteristicVelocity", lambda c: c.characteristic_velocity, 0.0),
        ),
    )

    def coefficients_of(self, inputs: PairInputs) -> dict[str, float]:  # noqa: D102
        speed = inputs.contact.characteristic_velocity
        if speed is None:
            raise ValueError("contact.characteristic_velocity: missing; hooke needs it [m/s]")
        a = (16 / 15 * young_eff(inputs.a, inputs.b)) ** 0.8 * speed**0.4
        c = 2 * damping_ratio(inputs.pair.restitution)
        return dict(zip(self.coefficients, (a, a, c, c), strict=True))

    def stiffness_of(self, inputs: PairInputs, radius: float, mass: float) -> float:
        """K [N/m] of an effective radius [m] and mass [kg]."""
        return self.coefficients_of(inputs)["k_normal"] * radius**0.4 * mass**0.2

    def contact_time(self, inputs: PairInputs, radius: float, mass: float, speed: float) -> float:
        """Pi sqrt(m*/k) [s], at any speed."""
        return math.pi * math.sqrt(mass / self.stiffness_of(inputs, radius, mass))

    def release_speed(self, inputs: PairInputs, radius: float, mass: float, overlap: float) -> float:
        """Overlap times sqrt(k/m*) [m/s]."""
        return overlap * math.sqrt(self.stiffness_of(inputs, radius, mass) / mass)


LAW = Hooke(hooke, hooke_damping_integral)
