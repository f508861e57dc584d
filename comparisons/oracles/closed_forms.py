"""Closed forms of a normal or grossly sliding impact under the Hertz law with LIGGGHTS' damping.

The damped law m* x'' = -k x^1.5 - sqrt(5) b sqrt(m* k) x^(1/4) x' is a linear oscillator in disguise
(Antypov and Elliott 2011): in units of L = (m* v^2/k)^(2/5) and T = L/v, with y = 2/sqrt(5) x^(5/4) and
dtau = sqrt(5)/2 x^(1/4) dt it reads y' = u, u' = -y - 2 b u, where u is the speed. Hence all forms below.
"""

from __future__ import annotations

import functools
import math

from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import gamma

from comparisons.oracles.bodies import Bodies

#: t_c = HERTZ_TIME (m*^2/(R* E*^2 v))^(1/5), 2.868266. The 2.94 often quoted goes with peak overlap / v.
HERTZ_TIME = 4 / 5 * math.sqrt(math.pi) * gamma(2 / 5) / gamma(9 / 10) * (15 / 16) ** (2 / 5)


def length_scale(c: Bodies, speed: float) -> float:
    """L [m] = (m* v^2/k)^(2/5)."""
    return (c.mass_star * speed**2 / c.normal_constant) ** 0.4


def peak_overlap(c: Bodies, speed: float) -> float:
    """Largest overlap [m]: L (sqrt(5)/2 exp(-(b/w) atan(w/b)))^(4/5), w = sqrt(1 - b^2).

    For e = 1 it is Hertz' (5 m* v^2/(4 k))^(2/5). Exact for sphere on plane and head-on spheres, without
    gravity.
    """
    b = c.damping_ratio
    w = math.sqrt(1 - b * b)
    return length_scale(c, speed) * (math.sqrt(5) / 2 * math.exp(-b / w * math.atan2(w, b))) ** 0.8


def elastic_peak_force(c: Bodies, speed: float) -> float:
    """Largest force [N] of an undamped impact: k delta_max^1.5; 1/2 m* v^2 = 2/5 F_max delta_max."""
    return c.normal_constant * (1.25 * c.mass_star * speed**2 / c.normal_constant) ** 0.6


def elastic_contact_time(c: Bodies, speed: float) -> float:
    """Contact time [s] of an undamped impact: 2.868266 (m*^2/(R* E*^2 v))^(1/5)."""
    return HERTZ_TIME * (c.mass_star**2 / (c.radius_star * c.young_star**2 * speed)) ** 0.2


def _phase(c: Bodies, limit_force: bool) -> float:
    """End of the contact in w tau: zero overlap (pi), or with `limit_force` zero force (y + 2 b u = 0)."""
    b = c.damping_ratio
    w = math.sqrt(1 - b * b)
    return math.pi - math.atan2(2 * b * w, w * w - b * b) if limit_force else math.pi


def restitution(c: Bodies, limit_force: bool) -> float:
    """Speed after / before: e itself; with `limit_force` the larger value of Schwager and Poeschel (2007).

    A contact cut where the force reaches zero keeps exp(-(b/w) theta), theta = pi - atan2(2 b w, w^2 -
    b^2), of the speed: 0.5 becomes 0.550283. What it is not: the rebound of a law corrected for the cut.
    """
    b = c.damping_ratio
    return math.exp(-b / math.sqrt(1 - b * b) * _phase(c, limit_force))


def restitution_to_put_in(wanted: float) -> float:
    """Restitution e that comes out as `wanted` with `limit_force`: 0.5 takes 0.4348. At most 1, above
    exp(-2).

    Both are functions of the damping ratio b alone: the one put in is exp(-b pi/w), the one that comes out
    exp(-b theta/w).
    """

    def left(b: float) -> float:
        w = math.sqrt(1 - b * b)
        return math.exp(-b / w * (math.pi - math.atan2(2 * b * w, w * w - b * b))) - wanted

    b = float(brentq(left, 0.0, 1 - 1e-9, xtol=1e-15))  # type: ignore[arg-type]
    return math.exp(-b / math.sqrt(1 - b * b) * math.pi)


@functools.lru_cache(4096)
def _integral(c: Bodies, limit_force: bool, power: int) -> float:
    """Integral of u^power dt over the contact, in scaled units; the end singularities y^(-1/5) are
    substituted away.
    """
    b = c.damping_ratio
    w = math.sqrt(1 - b * b)
    end = _phase(c, limit_force)

    def integrand(angle: float) -> float:
        y = math.exp(-b * angle / w) * math.sin(angle) / w
        u = math.exp(-b * angle / w) * (math.cos(angle) - b / w * math.sin(angle))
        return u**power * 2 / math.sqrt(5) * (math.sqrt(5) / 2 * y) ** -0.2 / w

    half = end / 2  # angle = s^5 near 0 and pi - s^5 near pi make the integrand smooth
    rise = quad(lambda s: integrand(s**5) * 5 * s**4 if s else 0.0, 0, half**0.2, epsabs=0, epsrel=1e-13)[0]
    lo, hi = (math.pi - end) ** 0.2, (math.pi - half) ** 0.2
    return (
        rise
        + quad(lambda s: integrand(math.pi - s**5) * 5 * s**4 if s else 0.0, lo, hi, epsabs=0, epsrel=1e-13)[
            0
        ]
    )


def _at_end(c: Bodies, limit_force: bool) -> tuple[float, float]:
    """Scaled (overlap, parting speed) where the force ends; the overlap is 0 without `limit_force`."""
    b = c.damping_ratio
    w, end = math.sqrt(1 - b * b), _phase(c, limit_force)
    y = math.exp(-b * end / w) * math.sin(end) / w if limit_force else 0.0
    u = math.exp(-b * end / w) * (math.cos(end) - b / w * math.sin(end))
    return (math.sqrt(5) / 2 * max(y, 0.0)) ** 0.8, -u


def contact_time(c: Bodies, speed: float, limit_force: bool = False) -> float:
    """Time [s] from touching to zero overlap again, damping included: T times the integral of dt.

    For e = 1 equal to `elastic_contact_time`. With `limit_force` the force ends before the overlap; the
    rest is flown at constant speed.
    """
    overlap, parting = _at_end(c, limit_force)
    return length_scale(c, speed) / speed * (_integral(c, limit_force, 0) + overlap / parting)


def sliding_deficit(c: Bodies, speed: float, limit_force: bool) -> float:
    """Integral of overlap times normal force over the contact [N m s]: what the arm R - overlap/2 costs.

    Since F dt = m* dv with v the parting speed, it is m* (integral of v^2 dt + overlap v at the end), for a
    sphere on a plane.
    """
    overlap, parting = _at_end(c, limit_force)
    return c.mass_star * speed * length_scale(c, speed) * (_integral(c, limit_force, 2) + overlap * parting)


def sliding_rebound(c: Bodies, normal_speed: float, slip: float, limit_force: bool) -> tuple[float, float]:
    """Change of (tangential velocity [m/s], spin [rad/s]) of a sphere that slides on a plane through all of
    an impact.

    |dv_t| = mu (1 + e_out) v_n exactly, against the slip velocity v_t + R w; the spin changes by 5/2
    dv_t/R, less the share that the lever arm R - overlap/2 of LIGGGHTS' law costs. It holds where friction
    is mu F_n at every instant: no tension (e = 1, or `limit_force`), and slip from the first touch. With e
    < 1 the normal dashpot makes F_n/k_t infinite at the first touch, the spring is loaded from zero, and
    the line is missed by some 0.1 %.
    """
    mu, radius = c.friction, c.radius[0]
    sign = -math.copysign(1.0, slip)
    push = mu * (1 + restitution(c, limit_force)) * normal_speed
    lever = mu * sliding_deficit(c, normal_speed, limit_force) / (2 * c.inertia[0])
    return sign * push, sign * (2.5 * push / radius - lever)


def slip_time(speed: float, friction: float, gravity: float) -> float:
    """Time [s] until a sphere thrown flat along a floor without spin rolls: 2 u0/(7 mu g)."""
    return 2 * speed / (7 * friction * gravity)


def slide_to_roll(
    time: float, speed: float, friction: float, gravity: float, radius: float
) -> tuple[float, float]:
    """(velocity [m/s], spin [rad/s]) of that sphere at `time`: u0 - mu g t and 5/2 mu g t/R, then 5/7 u0
    and u/R.
    """
    t = min(time, slip_time(speed, friction, gravity))
    return speed - friction * gravity * t, 2.5 * friction * gravity * t / radius


def static_overlap(c: Bodies, gravity: float) -> float:
    """Overlap [m] at which a sphere rests on a plane: (m g/k)^(2/3)."""
    return (c.mass[0] * gravity / c.normal_constant) ** (2 / 3)


def free_fall(time: float, height: float, speed: float, gravity: float) -> float:
    """Height [m] of a free body: h + v t - g t^2/2; velocity Verlet has it exactly."""
    return height + speed * time - gravity * time**2 / 2
