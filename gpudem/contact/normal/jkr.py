# pyright: reportArgumentType=false
"""Adhesion of elastic spheres by Johnson, Kendall and Roberts (gpudem only)."""

import math
from typing import Any

import warp as wp

from gpudem.contact.elasticity import hertz_release_speed, hertz_time, young_eff
from gpudem.contact.law import AdhesiveLaw, PairInputs, Parameter
from gpudem.contact.normal.hertz import LAW as HERTZ

WORK = Parameter("work_of_adhesion", "J/m2", 0, default=0.0)
#: Gap at which a contact breaks, by a0^2/R*: at the contact radius a = a0 6^(-2/3) the overlap is least.
BREAKING_GAP = 0.5 * 6 ** (-1 / 3)


@wp.func
def root_of_radius(size: Any):
    """sqrt(a/a0) of the overlap D = size in units of a0^2/R*: the largest root s of s^4 - 2/3 s = D.

    In closed form (Ferrari): with m the positive root of m^3 + D m = 1/18,
    s = (sqrt(2 m) + sqrt(2/3 sqrt(2 m)/m - 2 m))/2. Cardano's m is written as a quotient, so that nothing
    cancels for large D.
    """
    zero, third = type(size)(0.0), size / type(size)(3.0)
    root = wp.sqrt(wp.max(type(size)(wp.static(1 / 1296)) + third * third * third, zero))
    u = wp.cbrt(type(size)(wp.static(1 / 36)) + root)
    v = third / u
    m = type(size)(wp.static(1 / 18)) / (u * u + u * v + v * v)  # mutate: jkr_root
    first = wp.sqrt(type(size)(2.0) * m)
    rest = type(size)(wp.static(2 / 3)) * first / m - type(size)(2.0) * m
    return type(size)(0.5) * (first + wp.sqrt(wp.max(rest, zero)))


@wp.func
def jkr(c: Any, p: Any):
    """Elastic force with adhesion, stiffness and damping of a contact (F_e, k_n, k_t, c_n, c_t).

        F_e = 4 E* a^3/(3 R*) - sqrt(8 pi w E* a^3),  overlap = a^2/R* - sqrt(2 pi w a/E*)
        k_n = 4/3 E* a,  k_t = 8 G* a,  c_n, c_t those of `hertz` with a for sqrt(R* overlap)

    w is `work_of_adhesion`, a the contact radius, a0 = (9 pi w R*^2/(2 E*))^(1/3) that without force. With
    s = sqrt(a/a0), F_e = 6 pi w R* (s^6 - s^3). The largest attraction is 3/2 pi w R*. A contact begins at
    touch (overlap 0), with F_e = -4/3 pi w R*, and breaks at the gap 6^(-1/3)/2 a0^2/R*, with -5/6 pi w R*.
    Friction and rolling torque are limited by F_n + 3 pi w R* in the place of F_n.
    Source: Johnson, Kendall & Roberts, Proc. R. Soc. A 324 (1971) 301; limit: Thornton, J. Phys. D 24 (1991)
    1942; k_t: Thornton & Yin, Powder Technol. 65 (1991) 153; the damping is an assumption of gpudem.
    """
    a = wp.sqrt(wp.max(c.radius_eff * c.overlap, type(c.overlap)(0.0)))  # without adhesion
    force = p.k_normal * a * c.overlap
    if p.adhesion > type(c.overlap)(0.0):
        # mutate: jkr_radius
        a0 = p.adhesion_radius * wp.pow(c.radius_eff, type(c.overlap)(wp.static(2 / 3)))
        s = root_of_radius(c.overlap * c.radius_eff / (a0 * a0))
        cubed = s * s * s
        a = a0 * s * s
        force = p.adhesion * c.radius_eff * (cubed * cubed - cubed)  # mutate: jkr_force
    d = wp.sqrt(a * c.mass_eff)
    return force, p.k_normal * a, p.k_tangential * a, p.c_normal * d, p.c_tangential * d


@wp.func
def jkr_load(c: Any, p: Any, fn: Any):
    """What limits friction and rolling torque [N]: F_n + 3 pi w R*."""
    return fn + type(fn)(0.5) * p.adhesion * c.radius_eff  # mutate: jkr_load


@wp.func
def jkr_gap(p: Any, radius_eff: Any):
    """Gap [m] at which a contact breaks: 6^(-1/3)/2 a0^2/R*."""
    # mutate: jkr_gap
    return p.adhesion_gap * wp.pow(radius_eff, type(radius_eff)(wp.static(1 / 3)))


class Jkr(AdhesiveLaw):
    """Moduli and damping as `hertz`; work of adhesion w of the pair [J/m2]."""

    name = "jkr"
    reads = ("young", "poisson", "restitution")
    parameters = (WORK,)
    coefficients = (*HERTZ.coefficients, "adhesion", "adhesion_radius", "adhesion_gap")

    def coefficients_of(self, inputs: PairInputs) -> dict[str, float]:
        """Those of `hertz`; 6 pi w [N/m], a0/R*^(2/3) [m^(1/3)], breaking gap/R*^(1/3) [m^(2/3)]."""
        size = self.radius_scale(inputs)
        adhesion = 6 * math.pi * inputs.value(WORK)  # mutate: jkr_pull_off
        values = {"adhesion": adhesion, "adhesion_radius": size, "adhesion_gap": BREAKING_GAP * size**2}
        return HERTZ.coefficients_of(inputs) | values

    def radius_scale(self, inputs: PairInputs) -> float:
        """a0/R*^(2/3) = (9 pi w/(2 E*))^(1/3) [m^(1/3)], a0 the contact radius without force."""
        return (4.5 * math.pi * inputs.value(WORK) / young_eff(inputs.a, inputs.b)) ** (1 / 3)

    def range(self, inputs: PairInputs, radius: float) -> float:
        """The breaking gap [m] of an effective radius [m]: it grows with it."""
        return BREAKING_GAP * self.radius_scale(inputs) ** 2 * radius ** (1 / 3)

    def contact_time(self, inputs: PairInputs, radius: float, mass: float, speed: float) -> float:
        """That of `hertz`, at most half a period about the rest of what sticks: stiffness 6/5 E* a0."""
        e_eff = young_eff(inputs.a, inputs.b)
        stiffness = 1.2 * e_eff * self.radius_scale(inputs) * radius ** (2 / 3)
        stuck = math.pi * math.sqrt(mass / stiffness) if stiffness > 0 else math.inf
        return min(hertz_time(e_eff, radius, mass, speed), stuck)

    def release_speed(self, inputs: PairInputs, radius: float, mass: float, overlap: float) -> float:
        """That of `hertz`: adhesion makes it less."""
        return hertz_release_speed(young_eff(inputs.a, inputs.b), radius, mass, overlap)


LAW = Jkr(jkr, jkr_load, jkr_gap)
