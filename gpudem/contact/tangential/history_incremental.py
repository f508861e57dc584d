"""Shear spring that adds up force with the stiffness of each step (gpudem only)."""

from typing import Any

import warp as wp

from gpudem.contact.tangential.history import History


@wp.func
def history_incremental(c: Any, p: Any, kt: Any, ct: Any, fn: Any, spring: Any):
    """Force on i in the tangent plane [N], and the force of the shear spring after the step, reversed [N].

        q += k_t slide;  q -= (q.n) n        k_t of this step; what was added before keeps its size
        slip,  |q| > mu |F_n|:               q = mu |F_n| q/|q|,  F_t = -q,  no dashpot
        stick, else:                         F_t = -q - c_t v_t  (the dashpot is not capped)

    `history` applies the present k_t to the whole displacement; here a change of the overlap alone changes no
    tangential force, on loading or unloading. To unload before the shear is taken back then creates energy
    (so does, in `history`, to load while there is shear). No rescaling on unloading.
    Source: Walton & Braun, J. Rheol. 30 (1986) 949; energy: Elata & Berryman, Mech. Mater. 24 (1996) 229.
    """
    q = spring + kt * c.slide  # mutate: incremental_stiffness
    q = q - wp.dot(q, c.normal) * c.normal
    limit = p.friction * wp.abs(fn)
    squared = wp.dot(q, q)
    if squared > limit * limit:
        slipped = (limit / wp.sqrt(squared)) * q  # mutate: incremental_limit
        return -slipped, slipped
    return -q - ct * c.tangential_velocity, q


class HistoryIncremental(History):
    """Coulomb friction mu of the pair."""

    name = "history_incremental"
    liggghts = None


LAW = HistoryIncremental(history_incremental)
