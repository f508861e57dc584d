"""Elastic-plastic rolling spring with dashpot (LIGGGHTS `epsd`)."""

from typing import Any

import warp as wp

from gpudem.contact.law import LiggghtsWords, PairInputs, Parameter, RollingLaw

VISCOUS = Parameter("rolling_viscous_damping", "1", 0)
FRICTION_WORDS = (
    ("per_pair", "coefficientRollingFriction", lambda p: p.rolling_friction, 0.0),
    ("per_pair", "coefficientRollingViscousDamping", VISCOUS.or_zero, 0.0),
)


def epsd_torque(torsion: bool) -> Any:
    """The device function, with or without the spin along n."""

    @wp.func
    def epsd(c: Any, p: Any, kn: Any, kt: Any, fn: Any, last: Any, dt: Any):
        """Torque [N m] of a rolling spring with dashpot, and what is stored of it.

            T += k_r w dt, w the relative spin without its part along n (`torsion` keeps it)
            k_r = s k_n mu_r^2 R*^2;  s = 2.25 for epsd, `rolling_stiffness` for epsd3
            |T| > mu_r |F_n| R*:  T is cut to that length, and stored so; no dashpot
            else:                 T is stored; the torque is T + 2 eta sqrt(I k_r) w

        eta is `rolling_viscous_damping`; 1/I = 1/(7/5 m_i R_i^2) + 1/(7/5 m_j R_j^2), at a wall one term. F_n
        counts with its damping part; the stored torque is not rotated with the normal. At the set-up of a run
        it grows by a step as in any other, but is not stored: so does LIGGGHTS.
        Source: Ai, Chen, Rotter & Ooi, Powder Technol. 206 (2011) 269, model C; LIGGGHTS manual,
        gran_rolling_friction_epsd.
        """
        spin = c.spin
        if wp.static(not torsion):
            spin = spin - wp.dot(spin, c.normal) * c.normal  # mutate: epsd_projection
        arm = p.rolling_friction * c.radius_eff
        stiffness = p.rolling_stiffness * kn * arm * arm  # mutate: epsd_stiffness
        torque = last + (stiffness * dt) * spin
        limit = arm * wp.abs(fn)
        squared = wp.dot(torque, torque)
        if squared > limit * limit:
            cut = (limit / wp.sqrt(squared)) * torque  # mutate: epsd_limit
            return cut, cut
        dashpot = p.rolling_damping * wp.sqrt(c.inertia_eff * stiffness)  # mutate: epsd_dashpot
        return torque + dashpot * spin, torque  # mutate: epsd_stored

    return epsd


class Epsd(RollingLaw):
    """Rolling friction mu_r and viscous damping eta of the pair."""

    name = "epsd"
    history = True
    damped = True
    uses_inertia = True
    reads = ("rolling_friction",)
    parameters = (VISCOUS,)
    coefficients = ("rolling_friction", "rolling_stiffness", "rolling_damping")
    liggghts = LiggghtsWords("epsd", FRICTION_WORDS)

    def acts(self, inputs: PairInputs) -> bool:  # noqa: D102
        return inputs.pair.rolling_friction > 0

    def stiffness_factor(self, inputs: PairInputs) -> float:
        """Factor s of k_r = s k_n mu_r^2 R*^2 [1]."""
        return 2.25

    def coefficients_of(self, inputs: PairInputs) -> dict[str, float]:  # noqa: D102
        pair = inputs.pair
        values = (pair.rolling_friction, self.stiffness_factor(inputs), 2 * VISCOUS.or_zero(pair))
        return dict(zip(self.coefficients, values, strict=True))


LAW = Epsd(epsd_torque(False), epsd_torque(True))
