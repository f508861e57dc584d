"""Normal laws: stiffness and damping of a contact, (k_n, k_t [N/m], c_n, c_t [N s/m]).

The force is F_n = k_n overlap - c_n v_n, positive when repulsive; the tangential law uses k_t and c_t.
Each is a pure function of one contact; `coefficients.py` prepares the constants k and c of the pair.
"""

from typing import Any

import warp as wp


@wp.func
def hertz(c: Any, p: Any):
    """Hertz stiffness with damping that gives restitution e at any speed (LIGGGHTS `hertz`).

        q = sqrt(R* overlap);  k_n = 4/3 E* q,  k_t = 8 G* q
        c_n = 2 sqrt(5/6) |beta| sqrt(2 E* q m*),  c_t = 2 sqrt(5/6) |beta| sqrt(8 G* q m*)

    k_t is the present one, applied to the whole spring: no Mindlin unloading history.
    Source: Tsuji, Tanaka & Ishida, Powder Technol. 71 (1992) 239; Antypov & Elliott, EPL 94 (2011) 50004.
    """
    q = wp.sqrt(c.radius_eff * c.overlap)
    d = wp.sqrt(q * c.mass_eff)
    return p.k_normal * q, p.k_tangential * q, p.c_normal * d, p.c_tangential * d


@wp.func
def hertz_stiffness(c: Any, p: Any):
    """Hertz form with constants given directly (LIGGGHTS `hertz/stiffness`).

    q = sqrt(R* overlap);  k_n = kn q,  k_t = kt q,  c_n = gamma_n m* q,  c_t = gamma_t m* q
    """
    q = wp.sqrt(c.radius_eff * c.overlap)
    d = q * c.mass_eff
    return p.k_normal * q, p.k_tangential * q, p.c_normal * d, p.c_tangential * d


@wp.func
def hooke(c: Any, p: Any):
    """Linear spring as stiff as Hertz' at the characteristic velocity V (LIGGGHTS `hooke`).

        k_n = k_t = 16/15 sqrt(R*) E* (15 m* V^2 / (16 sqrt(R*) E*))^(1/5) = A R*^(2/5) m*^(1/5)
        c_n = c_t = 2 |beta| sqrt(m* k_n)

    The contact time does not depend on the impact speed.
    """
    k = p.k_normal * wp.pow(c.radius_eff, type(c.overlap)(0.4)) * wp.pow(c.mass_eff, type(c.overlap)(0.2))
    d = wp.sqrt(c.mass_eff * k)
    return k, k, p.c_normal * d, p.c_tangential * d


@wp.func
def hertz_damping_work(c: Any, p: Any, overlap: Any):
    """Integral of c_n over the overlap from 0 [N s], for `hertz`: 4/5 c_n overlap."""
    q = wp.sqrt(c.radius_eff * overlap)
    return type(overlap)(0.8) * p.c_normal * wp.sqrt(q * c.mass_eff) * overlap


@wp.func
def hertz_stiffness_damping_work(c: Any, p: Any, overlap: Any):
    """Integral of c_n over the overlap from 0 [N s], for `hertz/stiffness`: 2/3 c_n overlap."""
    q = wp.sqrt(c.radius_eff * overlap)
    return p.c_normal * q * c.mass_eff * overlap / type(overlap)(1.5)


@wp.func
def hooke_damping_work(c: Any, p: Any, overlap: Any):
    """Integral of c_n over the overlap from 0 [N s], for `hooke`: c_n overlap."""
    _kn, _kt, cn, _ct = hooke(c, p)
    return cn * overlap


NORMAL = {"hertz": hertz, "hertz/stiffness": hertz_stiffness, "hooke": hooke}
DAMPING_WORK = {
    "hertz": hertz_damping_work,
    "hertz/stiffness": hertz_stiffness_damping_work,
    "hooke": hooke_damping_work,
}
