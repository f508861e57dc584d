"""Linear spring and dashpot with constants given directly (LIGGGHTS `hooke/stiffness`)."""

import math
from typing import Any

import warp as wp

from gpudem.contact.law import CONSTANT_WORDS, LiggghtsWords, PairInputs, StatedConstants


@wp.func
def hooke_stiffness(c: Any, p: Any):
    """Stiffness and damping of a contact.

        k_n = kn,  k_t = kt,  c_n = gamma_n m*,  c_t = gamma_t m*

    Source: LIGGGHTS manual, gran_model_hooke_stiffness; Cundall & Strack, Geotechnique 29 (1979) 47.
    """
    m = c.mass_eff  # mutate: hooke_stiffness_mass
    return p.k_normal, p.k_tangential, p.c_normal * m, p.c_tangential * m


@wp.func
def hooke_stiffness_damping_integral(c: Any, p: Any, overlap: Any):
    """Integral of c_n over the overlap from 0 [N s]: c_n overlap."""
    return p.c_normal * c.mass_eff * overlap  # mutate: hooke_stiffness_damping_work


class HookeStiffness(StatedConstants):
    """The constants as stated: kn, kt [N/m], gamma_n, gamma_t [1/s]; the moduli do not act."""

    name = "hooke/stiffness"
    liggghts = LiggghtsWords("hooke/stiffness", CONSTANT_WORDS)

    def contact_time(self, inputs: PairInputs, radius: float, mass: float, speed: float) -> float:
        """Pi sqrt(m*/kn) [s], at any speed; infinite without stiffness."""
        kn = inputs.pair.kn
        return math.pi * math.sqrt(mass / kn) if kn else math.inf

    def release_speed(self, inputs: PairInputs, radius: float, mass: float, overlap: float) -> float:
        """Overlap times sqrt(kn/m*) [m/s]."""
        return overlap * math.sqrt((inputs.pair.kn or 0.0) / mass)

    def restitution(self, inputs: PairInputs, radius: float, mass: float, speed: float) -> float:
        """exp(-pi b/sqrt(1 - b^2)), b = gamma_n/2 sqrt(m*/kn), at any speed; 0 where b reaches 1."""
        pair = inputs.pair
        if not (pair.kn and pair.gamma_n):
            return 1.0
        b = 0.5 * pair.gamma_n * math.sqrt(mass / pair.kn)
        return math.exp(-math.pi * b / math.sqrt(1 - b * b)) if b < 1 else 0.0


LAW = HookeStiffness(hooke_stiffness, hooke_stiffness_damping_integral)
