"""The contact law of Park, Jun, Sohn and Lee (2014) as printed, in the terms of a scene.

(6) F = 2/3 E~ sqrt(R_eff) h^1.5, E~ = E/(1 - nu^2): Hertz for two balls; kn = 4/3 E* of `hertz/stiffness`
(7) damping gamma sqrt(R_eff h) v (viscoelastic: gamma_n = gamma/m*), or, the print allows it,
    gamma sqrt(R_eff) h v, which a scene cannot state
(11, 12) gamma = sqrt(4 m' k/(1 + beta^2)), beta = pi/ln e, k = 2/3 E~ sqrt(R_eff): a linear spring's formula
(8) friction min(k_s |dv_t| dt + v_s |v_t|, mu |F_n|): the displacement of one step. A viscous coefficient
    k_s dt + v_s, so `no_history` with gamma_t = (kt dt)/m* + gamma_n, where k_s = 8 G* sqrt(R* h)
    (Mindlin) and v_s as in (7), neither of which is printed.
"""

from __future__ import annotations

import math

from comparisons.cases.dam_break import scenes as dam
from comparisons.cases.side_by_side import traced
from comparisons.oracles import normal_impact
from comparisons.oracles.bodies import star
from gpudem.scene import Contact, Explicit, Material, Pair, Scene

#: Restitution put into equation 11 for balls, and the speeds of the impacts [m/s].
PUT_IN, SPEEDS = 0.9, (0.1, 1.0, 3.0)
MASS_STAR, RADIUS_STAR = dam.MASS / 2, dam.RADIUS / 2
#: v* at which the viscoelastic law gives 0.9 (by the ODE, the contact may pull).
V_STAR = 0.303728
FLIGHT, DURATION = 3e-6, 1.6e-4
HEAP = dam.Dam(radius=0.010, opens=0.25, flows=1.5)


def stiffness(a: Material, b: Material) -> tuple[float, float]:
    """(kn, kt) [N/m2] of `hertz/stiffness`: 4/3 E*, 8 G*."""
    young, shear = star(a, b)
    return 4 / 3 * young, 8 * shear


def gamma(restitution: float, mass: float, stiffness_constant: float) -> float:
    """Equation 11: sqrt(4 m' k/(1 + (pi/ln e)^2)); taken as SI; its unit fits no reading."""
    return math.sqrt(4 * mass * stiffness_constant / (1 + (math.pi / math.log(restitution)) ** 2))


def restitution(speed: float, printed: bool) -> float:
    """Restitution that results at a speed [m/s], by the ODE: reading 2 of equation 7, or as printed."""
    kn, _ = stiffness(dam.BALL, dam.BALL)
    k = kn * math.sqrt(RADIUS_STAR)
    power = 1.0 if printed else 0.5
    length = (MASS_STAR * speed**2 / k) ** 0.4
    dash = gamma(PUT_IN, MASS_STAR, k) * math.sqrt(RADIUS_STAR)
    return normal_impact.restitution(1.5, power, dash * length ** (power + 1) / (MASS_STAR * speed), False)


def impacts(dt: float) -> Scene:
    """Pairs of balls head-on, one a speed, under equations 6 and 7."""
    kn, kt = stiffness(dam.BALL, dam.BALL)
    g = gamma(PUT_IN, MASS_STAR, kn * math.sqrt(RADIUS_STAR)) / MASS_STAR
    sides = [(k, v, side) for k, v in enumerate(SPEEDS) for side in (1.0, -1.0)]
    position = [(0.02 * k, 0.0, side * (dam.RADIUS + 0.5 * v * FLIGHT)) for k, v, side in sides]
    velocity = [(0.0, 0.0, -side * 0.5 * v) for _, v, side in sides]
    return traced(
        "paper_law", Explicit(position=position, velocity=velocity, radius=dam.RADIUS, material="ball"),
        step=dt, duration=DURATION, lo=(-0.02, -0.02, -0.02), hi=(0.07, 0.02, 0.02),
        title=f"balls head-on under equations 6 and 7, step {dt:.3g} s", materials={"ball": dam.BALL},
        pairs=[Pair(materials=("ball", "ball"), kn=kn, kt=kt, gamma_n=g, gamma_t=g)],
        contact=Contact(normal="hertz/stiffness", tangential="no_history"),
    )  # fmt: skip


def heap(memory: bool, printed_damping: bool) -> Scene:
    """A small dam break under the paper's normal law, friction with or without memory.

    printed_damping: gamma of equation 11; else a viscoelastic one that gives 0.9 at 1 m/s.
    """
    base, pairs = HEAP.scene(), []
    mass = base.materials["polystyrene"].density * 4 / 3 * math.pi * HEAP.radius**3
    for p in base.pairs:
        a, b = (base.materials[m] for m in p.materials)
        kn, kt = stiffness(a, b)
        wall = "acrylic" in p.materials
        m, r = (mass, HEAP.radius) if wall else (mass / 2, HEAP.radius / 2)
        g = gamma(p.restitution, m, kn * math.sqrt(r)) / m
        if not printed_damping:
            g = normal_impact.gamma_for(V_STAR, kn, r, m)
        spring = 0.0 if memory else kt * base.time.step / m
        pairs.append(p.model_copy(update={"kn": kn, "kt": kt, "gamma_n": g, "gamma_t": spring + g}))
    contact = Contact(normal="hertz/stiffness", tangential="history" if memory else "no_history")
    return base.replace(
        name="paper_law", title=f"{base.title}, {contact.tangential}", contact=contact.model_dump(),
        pairs=[p.model_dump() for p in pairs],
    )  # fmt: skip
