"""Tangential laws: force on i in the tangent plane [N], and the shear spring after the step [m]."""

from typing import Any

import warp as wp


@wp.func
def history(c: Any, p: Any, kt: Any, ct: Any, fn: Any, spring: Any):
    """Spring with memory and Coulomb slip (LIGGGHTS `history`).

        s += slide;  s -= (s.n) n            slide = v_t dt; projected on the present plane, not stretched
        slip,  k_t |s| > mu |F_n|:           F_t = -mu |F_n| s/|s|,  s = -F_t/k_t,  no dashpot
        stick, else:                         F_t = -k_t s - c_t v_t  (the dashpot is not capped)

    F_n counts with its damping part. With no slide the spring is only evaluated (set-up of a run).
    Source: LIGGGHTS manual, gran_tangential_history; Cundall & Strack, Geotechnique 29 (1979) 47.
    """
    s = spring + c.slide
    s = s - wp.dot(s, c.normal) * c.normal
    limit = p.friction * wp.abs(fn)
    trial_squared = kt * kt * wp.dot(s, s)
    if trial_squared > limit * limit:
        slipped = (limit / wp.sqrt(trial_squared)) * s
        return -kt * slipped, slipped
    return -kt * s - ct * c.tangential_velocity, s


@wp.func
def no_history(c: Any, p: Any, kt: Any, ct: Any, fn: Any, spring: Any):
    """Viscous friction without memory, F_t = -min(c_t, mu |F_n|/|v_t|) v_t (LIGGGHTS `no_history`)."""
    speed = wp.length(c.tangential_velocity)
    coefficient = ct
    limit = p.friction * wp.abs(fn)
    if ct * speed > limit:
        coefficient = limit / speed
    return -coefficient * c.tangential_velocity, spring


TANGENTIAL = {"history": history, "no_history": no_history}
