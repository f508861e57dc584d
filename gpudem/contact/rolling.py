"""Rolling laws: resisting torque [N m], subtracted from i and added to j."""

from typing import Any

import warp as wp


@wp.func
def cdt(c: Any, p: Any, kn: Any):
    """Constant directional torque, T = mu_r k_n overlap R* w/|w| without its part along n (LIGGGHTS `cdt`).

    k_n overlap is the normal force without damping. At rest (w = 0) the torque is zero: it holds no slope.
    Source: Ai, Chen, Rotter & Ooi, Powder Technol. 206 (2011) 269, model A.
    """
    torque = type(c.normal)()
    speed = wp.length(c.spin)
    if speed > type(speed)(0.0):
        torque = (p.rolling_friction * kn * c.overlap * c.radius_eff / speed) * c.spin
        torque = torque - wp.dot(torque, c.normal) * c.normal
    return torque


ROLLING = {"cdt": cdt}
