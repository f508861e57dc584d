"""As `history`, with a spring that keeps its length while the normal turns (gpudem only)."""

from typing import Any

import warp as wp

from gpudem.contact.tangential.history import History


@wp.func
def history_rotated(c: Any, p: Any, kt: Any, ct: Any, fn: Any, spring: Any):
    """Force on i in the tangent plane [N], and the shear spring after the step [m].

        s -= (s.n) n,  then stretched to the length it had;  s += slide
        slip,  k_t |s| > mu |F_n|:           F_t = -mu |F_n| s/|s|,  s = -F_t/k_t,  no dashpot
        stick, else:                         F_t = -k_t s - c_t v_t  (the dashpot is not capped)

    `history` projects without stretching: a normal that turns by an angle a in each step shortens its spring
    by cos(a) each time, in all by a part that is proportional to the step. A turn about the normal itself
    does not turn the spring.
    Source: Thornton, Cummins & Cleary, Powder Technol. 233 (2013) 30.
    """
    along = wp.dot(spring, c.normal)
    s = spring - along * c.normal
    left = wp.dot(s, s)
    # 1 to the last bit where nothing turns; a quotient of two lengths would add noise in every step
    one = type(left)(1.0)
    stretch = wp.sqrt(one + along * along / wp.where(left > type(left)(0.0), left, one))
    s = stretch * s + c.slide  # mutate: spring_length
    limit = p.friction * wp.abs(fn)
    trial_squared = kt * kt * wp.dot(s, s)
    if trial_squared > limit * limit:
        slipped = (limit / wp.sqrt(trial_squared)) * s
        return -kt * slipped, slipped
    return -kt * s - ct * c.tangential_velocity, s


class HistoryRotated(History):
    """Coulomb friction mu of the pair."""

    name = "history_rotated"
    liggghts = None


LAW = HistoryRotated(history_rotated)
