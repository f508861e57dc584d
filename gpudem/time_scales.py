"""Times that limit a time step: Rayleigh wave and contact. Primary inputs only, for any code."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from gpudem.scene import Scene

#: What is usual in the field at most: shares of the Rayleigh time and of the contact time (20 steps).
USUAL_RAYLEIGH, USUAL_CONTACT = 0.2, 0.05


def rayleigh_time(scene: Scene) -> float:
    """Smallest Rayleigh time [s] of the particles, pi R sqrt(rho/G) / (0.1631 nu + 0.8766).

    G = E / (2 (1 + nu)) [Pa] is the shear modulus.
    Source: LIGGGHTS manual, fix check/timestep/gran.
    """
    times = []
    for name, index in scene.material_index.items():
        mine = scene.state.radius[scene.state.material == index]
        if len(mine):
            m = scene.materials[name]
            shear = m.young / (2 * (1 + m.poisson))
            times.append(math.pi * mine.min() * math.sqrt(m.density / shear) / (0.1631 * m.poisson + 0.8766))
    return float(min(times))


def top_speed(scene: Scene) -> float:
    """Largest speed [m/s] to expect: the largest at the start, and a fall through the domain.

    Over a vibrating plane twice its speed more, which an elastic hit adds.
    """
    size = np.abs(np.array(scene.domain.hi) - np.array(scene.domain.lo))
    fall = math.sqrt(2 * float(np.abs(scene.gravity) @ size))
    own = max(float(np.linalg.norm(scene.state.velocity, axis=1).max()), fall if scene.walls else 0.0)
    return own + 2 * max((plane.speed for plane in scene.planes), default=0.0)


def contact_time(scene: Scene) -> float:
    """Shortest contact time [s] by the scene's normal law, of the smallest particles of each material pair.

        hertz             2.868266 (m*^2 / (R* E*^2 v))^(1/5)
        hertz/stiffness   the same with E* = 3/4 kn
        hooke             pi sqrt(m*/k), at any speed

    v is the top speed between particle and wall, twice that between particles; infinite for Hertz where
    nothing moves. Damping lengthens a contact: it counts for nothing here.
    Source: Hertz' elastic impact; the constant is (4/5) sqrt(pi) Gamma(2/5)/Gamma(9/10) (15/16)^(2/5).
    """
    from gpudem.contact.coefficients import pair_coefficients

    speed, times, state = top_speed(scene), [math.inf], scene.state
    walls = sorted({w.material for w in scene.walls})
    smallest = {
        name: float(state.radius[state.material == scene.material_index[name]].min())
        for name in scene.particle_materials
    }

    def mass(name: str) -> float:
        return scene.materials[name].density * 4 / 3 * math.pi * smallest[name] ** 3

    for name, radius in smallest.items():
        for wall, partners in ((False, scene.particle_materials), (True, walls)):
            for partner in partners:
                r = radius if wall else radius * smallest[partner] / (radius + smallest[partner])
                m = mass(name) if wall else mass(name) * mass(partner) / (mass(name) + mass(partner))
                v = speed if wall else 2 * speed
                k = pair_coefficients(scene, name, partner).k_normal
                if scene.contact.normal == "hooke":
                    times.append(math.pi * math.sqrt(m / (k * r**0.4 * m**0.2)))
                elif v > 0 and k > 0:  # k = 4/3 E*
                    times.append(2.868266 * (m**2 / (r * (0.75 * k) ** 2 * v)) ** 0.2)
    return min(times)


def steps_a_contact(scene: Scene, accuracy: float) -> float:
    """Steps a contact needs for a largest position error of `accuracy` times its largest overlap.

        half_step   max(1.5 / sqrt(accuracy), (|ln e| + 0.1) / accuracy)
        path        2.5 / sqrt(accuracy)

    e is the smallest restitution of the pairs that can meet; `hertz/stiffness`, whose damping states none,
    counts as e = 1/3 where it damps at all, which is a guess, not a fit. Fitted from above to what the case
    work_precision measures on normal and oblique impacts, e = 0.3 to 1, accuracy 1e-2 to 1e-3, under a law
    without jumps (no tangential dashpot, or no friction); with the uncapped dashpot it is a guide alone.
    """
    elastic = 1.5 / math.sqrt(accuracy)
    if scene.solver.integrator == "path":
        return 2.5 / math.sqrt(accuracy)
    if not scene.needs.damping:
        return elastic
    if scene.contact.normal == "hertz/stiffness":
        return 1.2 / accuracy
    least = min(pair.restitution for pair in scene.contact_pairs)
    return max(elastic, (abs(math.log(least)) + 0.1) / accuracy)


def step_for(scene: Scene, accuracy: float) -> float:
    """The time step [s] of `step = "auto"`: contact time / steps_a_contact, at most the usual limits."""
    contact = contact_time(scene) / max(steps_a_contact(scene, accuracy), 1 / USUAL_CONTACT)
    return contact if scene.contact.normal == "hertz/stiffness" else min(
        contact, USUAL_RAYLEIGH * rayleigh_time(scene)
    )  # fmt: skip
