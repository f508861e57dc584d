"""Constant directional torque (LIGGGHTS `cdt`)."""

from typing import Any

import warp as wp

from gpudem.contact.law import LiggghtsWords, PairInputs, RollingLaw


def cdt_torque(torsion: bool) -> Any:
    """The device function, with or without the part along n."""

    @wp.func
    def cdt(c: Any, p: Any, kn: Any, kt: Any, fn: Any, last: Any, dt: Any):
        """T = mu_r k_n overlap R* w/|w| [N m] without its part along n, which `torsion` keeps.

        k_n overlap is the normal force without damping. At rest (w = 0) the torque is zero: it holds no
        slope.
        Source: Ai, Chen, Rotter & Ooi, Powder Technol. 206 (2011) 269, model A.
        """
        speed = wp.length(c.spin)
        if speed > type(speed)(0.0):
            torque = (p.rolling_friction * kn * c.overlap * c.radius_eff / speed) * c.spin
            if wp.static(torsion):
                return torque
            return torque - wp.dot(torque, c.normal) * c.normal  # mutate: cdt_projection
        return type(c.normal)()

    return cdt


class Cdt(RollingLaw):
    """Rolling friction mu_r of the pair."""

    name = "cdt"
    reads = ("rolling_friction",)
    coefficients = ("rolling_friction",)
    liggghts = LiggghtsWords(
        "cdt", (("per_pair", "coefficientRollingFriction", lambda p: p.rolling_friction, 0.0),)
    )

    def acts(self, inputs: PairInputs) -> bool:  # noqa: D102
        return inputs.pair.rolling_friction > 0

    def coefficients_of(self, inputs: PairInputs) -> dict[str, float]:  # noqa: D102
        return {"rolling_friction": inputs.pair.rolling_friction}


LAW = Cdt(cdt_torque(False), cdt_torque(True))
