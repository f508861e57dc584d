"""Elastic-plastic rolling spring without dashpot (LIGGGHTS `epsd2`)."""

from typing import Any

import warp as wp

from gpudem.contact.law import LiggghtsWords, PairInputs, RollingLaw


def epsd2_torque(torsion: bool) -> Any:
    """The device function, with or without the spin along n."""

    @wp.func
    def epsd2(c: Any, p: Any, kn: Any, kt: Any, fn: Any, last: Any, dt: Any):
        """Torque [N m] of a rolling spring; it holds a sphere on a slope.

            T += k_r w dt, w the relative spin without its part along n (`torsion` keeps it);  k_r = k_t R*^2
            |T| > mu_r |F_n| R*:  T is cut to that length, and stored so

        F_n counts with its damping part; the stored torque is not rotated with the normal. At the set-up of a
        run it grows by a step as in any other, but is not stored: so does LIGGGHTS.
        Source: Iwashita & Oda, J. Eng. Mech. 124 (1998) 285; Ai, Chen, Rotter & Ooi (2011), model C.
        """
        spin = c.spin
        if wp.static(not torsion):
            spin = spin - wp.dot(spin, c.normal) * c.normal  # mutate: rolling_projection
        torque = last + (kt * c.radius_eff * c.radius_eff * dt) * spin  # mutate: rolling_stiffness
        limit = p.rolling_friction * wp.abs(fn) * c.radius_eff
        squared = wp.dot(torque, torque)
        if squared > limit * limit:
            return (limit / wp.sqrt(squared)) * torque  # mutate: rolling_limit
        return torque

    return epsd2


class Epsd2(RollingLaw):
    """Rolling friction mu_r of the pair."""

    name = "epsd2"
    history = True
    reads = ("rolling_friction",)
    coefficients = ("rolling_friction",)
    liggghts = LiggghtsWords(
        "epsd2", (("per_pair", "coefficientRollingFriction", lambda p: p.rolling_friction, 0.0),)
    )

    def acts(self, inputs: PairInputs) -> bool:  # noqa: D102
        return inputs.pair.rolling_friction > 0

    def coefficients_of(self, inputs: PairInputs) -> dict[str, float]:  # noqa: D102
        return {"rolling_friction": inputs.pair.rolling_friction}


LAW = Epsd2(epsd2_torque(False), epsd2_torque(True))
