"""Times that limit a time step: Rayleigh wave and contact. Primary inputs only, for any code."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from gpudem.scene.model import Scene

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


def _meetings(scene: Scene) -> Iterator[tuple[str, str, float, float, float]]:
    """(material, partner, R* [m], m* [kg], speed [m/s]): the smallest particles of pairs that can meet.

    The speed is the top speed between particle and wall, twice that between particles.
    """
    speed, state = top_speed(scene), scene.state
    walls = sorted({w.material for w in scene.walls})
    smallest = {
        name: float(state.radius[state.material == scene.material_index[name]].min())
        for name in scene.particle_materials
    }

    def mass(name: str) -> float:
        return scene.materials[name].density * 4 / 3 * math.pi * smallest[name] ** 3

    for name, radius in smallest.items():
        for partner in scene.particle_materials:
            r = radius * smallest[partner] / (radius + smallest[partner])
            yield name, partner, r, mass(name) * mass(partner) / (mass(name) + mass(partner)), 2 * speed
        for partner in walls:
            yield name, partner, radius, mass(name), speed


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

    times = [math.inf]
    for name, partner, r, m, v in _meetings(scene):
        k = pair_coefficients(scene, name, partner).k_normal
        if scene.contact.normal == "hooke":
            times.append(math.pi * math.sqrt(m / (k * r**0.4 * m**0.2)))
        elif v > 0 and k > 0:  # k = 4/3 E*
            times.append(2.868266 * (m**2 / (r * (0.75 * k) ** 2 * v)) ** 0.2)
    return min(times)


def least_restitution(scene: Scene) -> float:
    """Smallest coefficient of restitution [1] of the pairs that can meet.

    As stated; `hertz/stiffness` states none: there that of an impact at the top speed, from the law itself,
    m* d'' = -sqrt(R* d) (kn d + gamma_n m* d'), which falls as the speed grows.
    """
    if scene.contact.normal != "hertz/stiffness":
        return min(pair.restitution for pair in scene.contact_pairs)
    found = [1.0]
    for name, partner, r, m, v in _meetings(scene):
        pair = scene.pair(name, partner)
        if v > 0 and pair is not None and pair.kn and pair.gamma_n:
            a, b = pair.kn * math.sqrt(r) / m, pair.gamma_n * math.sqrt(r)
            found.append(_rebound(b * (v**2 / a) ** 0.6 / v))
    return min(found)


def _rebound(damping: float) -> float:
    """-x' as x'' = -x^1.5 - damping x^0.5 x' comes back to 0 from x' = 1: one number for any impact."""
    from scipy.integrate import solve_ivp

    def slope(_: float, y: np.ndarray) -> list[float]:
        x = max(float(y[0]), 0.0)
        return [float(y[1]), -(x**1.5) - damping * math.sqrt(x) * float(y[1])]

    def back(_: float, y: np.ndarray) -> float:
        return float(y[0])

    back.terminal, back.direction = True, -1.0  # type: ignore[attr-defined]
    end = solve_ivp(slope, (0.0, 1e3), [1e-9, 1.0], events=back, rtol=1e-8, atol=1e-12)
    return float(-end.y[1, -1]) if end.t_events[0].size else 0.0


def steps_a_contact(scene: Scene, accuracy: float) -> float:
    """Steps a contact needs for a largest position error of `accuracy` times its largest overlap.

        half_step   max(1.5 / sqrt(accuracy), (|ln e| + 0.1) / accuracy)
        path        2.5 / sqrt(accuracy)

    e is the smallest restitution of pairs that can meet (`least_restitution`). Fitted from above to what
    the case work_precision measures on normal and oblique impacts, e = 0.3 to 1, accuracy 1e-2 to 1e-3,
    under a law without jumps (no tangential dashpot, or no friction); with the uncapped dashpot it is a
    guide alone.
    """
    elastic = 1.5 / math.sqrt(accuracy)
    if scene.solver.integrator == "path":
        return 2.5 / math.sqrt(accuracy)
    if not scene.needs.damping:
        return elastic
    least = max(least_restitution(scene), 0.01)  # 0 has no logarithm
    return max(elastic, (abs(math.log(least)) + 0.1) / accuracy)


def step_for(scene: Scene, accuracy: float) -> float:
    """The time step [s] of `step = "auto"`: contact time / steps_a_contact, at most the usual limits."""
    contact = contact_time(scene) / max(steps_a_contact(scene, accuracy), 1 / USUAL_CONTACT)
    return contact if scene.contact.normal == "hertz/stiffness" else min(
        contact, USUAL_RAYLEIGH * rayleigh_time(scene)
    )  # fmt: skip
