"""Rolling laws: resisting torque [N m], subtracted from i and added to j.

All have one signature; a law in `KEEPS_TORQUE` finds its torque of the last step in `kept` and its result is
kept. At the set-up of a run it turns by a step as in any other, but is not kept: so does LIGGGHTS.
"""

from typing import Any

import warp as wp


@wp.func
def cdt(c: Any, p: Any, kn: Any, kt: Any, fn: Any, kept: Any, dt: Any):
    """Constant directional torque, T = mu_r k_n overlap R* w/|w| without its part along n (LIGGGHTS `cdt`).

    k_n overlap is the normal force without damping. At rest (w = 0) the torque is zero: it holds no slope.
    Source: Ai, Chen, Rotter & Ooi, Powder Technol. 206 (2011) 269, model A.
    """
    speed = wp.length(c.spin)
    if speed > type(speed)(0.0):
        torque = (p.rolling_friction * kn * c.overlap * c.radius_eff / speed) * c.spin
        return torque - wp.dot(torque, c.normal) * c.normal
    return type(c.normal)()


@wp.func
def epsd2(c: Any, p: Any, kn: Any, kt: Any, fn: Any, kept: Any, dt: Any):
    """Elastic-plastic rolling spring without dashpot (LIGGGHTS `epsd2`); it holds a sphere on a slope.

        T += k_r w dt, w the relative spin without its part along n;  k_r = k_t R*^2
        |T| > mu_r |F_n| R*:  T is cut to that length, and kept so

    F_n counts with its damping part; the torque kept is not turned with the normal.
    Source: Iwashita & Oda, J. Eng. Mech. 124 (1998) 285; Ai, Chen, Rotter & Ooi (2011), model C.
    """
    spin = c.spin - wp.dot(c.spin, c.normal) * c.normal
    torque = kept + (kt * c.radius_eff * c.radius_eff * dt) * spin
    limit = p.rolling_friction * wp.abs(fn) * c.radius_eff
    squared = wp.dot(torque, torque)
    if squared > limit * limit:
        return (limit / wp.sqrt(squared)) * torque
    return torque


ROLLING = {"cdt": cdt, "epsd2": epsd2}
KEEPS_TORQUE = ("epsd2",)
