"""As `history`, with Coulomb's limit on spring and dashpot together (gpudem only)."""

from typing import Any

import warp as wp

from gpudem.contact.tangential.history import History


@wp.func
def history_capped(c: Any, p: Any, kt: Any, ct: Any, fn: Any, spring: Any):
    """Force on i in the tangent plane [N], and the shear spring after the step [m].

        s += slide;  s -= (s.n) n;           F = -k_t s - c_t v_t
        slip,  |F| > mu |F_n|:               F_t = mu |F_n| F/|F|,  s = -(F_t + c_t v_t)/k_t
        stick, else:                         F_t = F

    `history` tests the spring alone and adds the dashpot after the test. Without stiffness (k_t = 0) the
    spring has no force and stays as it is.
    Source: Luding, Granul. Matter 10 (2008) 235.
    """
    s = spring + c.slide
    s = s - wp.dot(s, c.normal) * c.normal
    dashpot = ct * c.tangential_velocity
    trial = -kt * s - dashpot
    limit = p.friction * wp.abs(fn)
    squared = wp.dot(trial, trial)
    if squared > limit * limit:  # mutate: total_force_limit
        force = (limit / wp.sqrt(squared)) * trial
        if kt > type(kt)(0.0):
            return force, -(force + dashpot) / kt  # mutate: capped_spring
        return force, s
    return trial, s


class HistoryCapped(History):
    """Coulomb friction mu of the pair."""

    name = "history_capped"
    liggghts = None


LAW = HistoryCapped(history_capped)
