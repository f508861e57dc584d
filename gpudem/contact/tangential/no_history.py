"""Viscous friction without history (LIGGGHTS `no_history`)."""

from typing import Any

import warp as wp

from gpudem.contact.law import LiggghtsWords, PairInputs, TangentialLaw


@wp.func
def no_history(c: Any, p: Any, kt: Any, ct: Any, fn: Any, spring: Any):
    """F_t = -min(c_t, mu |F_n|/|v_t|) v_t [N] on i; the spring passes through."""
    speed = wp.length(c.tangential_velocity)
    coefficient = ct
    limit = p.friction * wp.abs(fn)
    if ct * speed > limit:  # mutate: viscous_limit
        coefficient = limit / speed
    return -coefficient * c.tangential_velocity, spring


class NoHistory(TangentialLaw):
    """Coulomb friction mu of the pair."""

    name = "no_history"
    acts_by = ("c_tangential",)
    reads = ("friction", "tangential_damping")
    coefficients = ("friction",)
    liggghts = LiggghtsWords("no_history")

    def acts(self, inputs: PairInputs) -> bool:  # noqa: D102
        return inputs.pair.friction > 0

    def coefficients_of(self, inputs: PairInputs) -> dict[str, float]:  # noqa: D102
        return {"friction": inputs.pair.friction}


LAW = NoHistory(no_history)
