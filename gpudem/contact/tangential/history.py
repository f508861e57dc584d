"""Shear spring with history and Coulomb slip (LIGGGHTS `history`)."""

from typing import Any

import warp as wp

from gpudem.contact.law import LiggghtsWords, PairInputs, TangentialLaw


@wp.func
def history(c: Any, p: Any, kt: Any, ct: Any, fn: Any, spring: Any):
    """Force on i in the tangent plane [N], and the shear spring after the step [m].

        s += slide;  s -= (s.n) n            slide = v_t dt; projected on the present plane, not stretched
        slip,  k_t |s| > mu |F_n|:           F_t = -mu |F_n| s/|s|,  s = -F_t/k_t,  no dashpot
        stick, else:                         F_t = -k_t s - c_t v_t  (the dashpot is not capped)

    F_n counts with its damping part. With no slide the spring is only evaluated (set-up of a run).
    Source: LIGGGHTS manual, gran_tangential_history; Cundall & Strack, Geotechnique 29 (1979) 47.
    """
    s = spring + c.slide
    s = s - wp.dot(s, c.normal) * c.normal  # mutate: spring_projection
    limit = p.friction * wp.abs(fn)  # mutate: coulomb_limit
    trial_squared = kt * kt * wp.dot(s, s)
    if trial_squared > limit * limit:
        slipped = (limit / wp.sqrt(trial_squared)) * s  # mutate: slipped_spring
        return -kt * slipped, slipped  # mutate: slip
    return -kt * s - ct * c.tangential_velocity, s  # mutate: stick


class History(TangentialLaw):
    """Coulomb friction mu of the pair."""

    name = "history"
    history = True
    acts_by = ("k_tangential", "c_tangential")
    reads = ("friction", "tangential_damping")
    coefficients = ("friction",)
    liggghts = LiggghtsWords("history")

    def acts(self, inputs: PairInputs) -> bool:  # noqa: D102
        return inputs.pair.friction > 0

    def coefficients_of(self, inputs: PairInputs) -> dict[str, float]:  # noqa: D102
        return {"friction": inputs.pair.friction}


LAW = History(history)
