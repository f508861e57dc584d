"""Times that limit a time step: Rayleigh wave and contact. Primary inputs only, for any code."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from gpudem.contact import registry
from gpudem.scene import groups, laws
from gpudem.scene.overlaps import MAX_START_OVERLAP

if TYPE_CHECKING:
    from gpudem.contact.law import NormalLaw, PairInputs
    from gpudem.scene.model import Scene

#: What is usual in the field at most: shares of the Rayleigh time and of the contact time (20 steps).
USUAL_RAYLEIGH, USUAL_CONTACT = 0.2, 0.05


def position_spacing(scene: Scene) -> tuple[float, float]:
    """(distance of neighboring floating-point numbers [m], coordinate [m]) where positions are coarsest."""
    corner = max(abs(c) for c in (*scene.domain.lo, *scene.domain.hi))
    kind = np.float32 if scene.solver.precision == "float32" else np.float64
    return float(np.spacing(kind(corner))), corner


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

    At a moving wall twice its speed more, which an elastic hit adds.
    """
    size = np.abs(np.array(scene.domain.hi) - np.array(scene.domain.lo))
    fall = math.sqrt(2 * max(float(np.abs(at.gravity) @ size) for at in scene.phase_scenes))
    own = max(float(np.linalg.norm(scene.state.velocity, axis=1).max()), fall if scene.walls else 0.0)
    own = max(own, groups.top_speed(scene))
    return own + 2 * max(scene.wall_speeds, default=0.0)  # mutate: hit_by_moving_wall


def _contact_pairs(scene: Scene) -> Iterator[tuple[NormalLaw, PairInputs, float, float, float]]:
    """(law, inputs, R* [m], m* [kg], speed [m/s]): the smallest particles of pairs that can touch.

    The speed is the top speed between particle and wall, twice that between particles; at least that at which
    the largest overlap at the start, relative to the smaller radius, drives the two apart.
    """
    speed, state, usual = top_speed(scene), scene.state, scene.normal_law
    stated = [w for at in scene.phase_scenes for w in at.walls]
    walls = sorted({(w.material, laws.stated_laws(scene, w).normal) for w in stated})
    deepest = 2.0 if {"overlap", "large_overlap"} & set(scene.allow) else MAX_START_OVERLAP
    smallest = {
        name: float(state.radius[state.material == scene.material_index[name]].min())
        for name in scene.particle_materials
    }

    def mass(name: str) -> float:
        return scene.materials[name].density * 4 / 3 * math.pi * smallest[name] ** 3

    def at_least_released(
        law: NormalLaw, inputs: PairInputs, r: float, m: float, radius: float, v: float
    ) -> float:
        if law.release_speed(inputs, r, m, deepest * radius) <= v:  # without a search for overlaps
            return v
        return max(v, law.release_speed(inputs, r, m, scene.start_overlap * radius))

    for name, radius in smallest.items():
        for partner in scene.particle_materials:
            r = radius * smallest[partner] / (radius + smallest[partner])
            m = mass(name) * mass(partner) / (mass(name) + mass(partner))
            smaller = min(radius, smallest[partner])
            for inputs in (at.inputs(name, partner) for at in scene.phase_scenes):
                yield usual, inputs, r, m, at_least_released(usual, inputs, r, m, smaller, 2 * speed)
        for partner, normal in walls:
            law, m = registry.law("normal", normal), mass(name)
            for inputs in (at.inputs(name, partner) for at in scene.phase_scenes):
                yield law, inputs, radius, m, at_least_released(law, inputs, radius, m, radius, speed)


def contact_time(scene: Scene) -> float:
    """Shortest contact time [s] by the scene's normal laws, of the smallest particles of each material pair.

    At the top speed between particle and wall, twice that between particles, or that at which overlaps at the
    start drive them apart; infinite where nothing moves and the law's contact time depends on the speed.
    Damping lengthens a contact: it is not counted.
    """
    times = [law.contact_time(inputs, r, m, v) for law, inputs, r, m, v in _contact_pairs(scene)]
    return min([math.inf, *times])


def min_restitution(scene: Scene) -> float:
    """Smallest coefficient of restitution [1] of the pairs that can touch.

    As stated; where the law states none, that of an impact at the top speed.
    """
    found = [law.restitution(inputs, r, m, v) for law, inputs, r, m, v in _contact_pairs(scene)]
    return min([1.0, *found])


def steps_per_contact(scene: Scene, accuracy: float) -> float:
    """Steps a contact needs for a largest position error of `accuracy` times its largest overlap.

        half_step   max(1.5 / sqrt(accuracy), (|ln e| + 0.1) / accuracy)
        path        2.5 / sqrt(accuracy)

    e is the smallest restitution of pairs that can meet (`min_restitution`). Fitted from above to what
    the case work_precision measures on normal and oblique impacts, e = 0.3 to 1, accuracy 1e-2 to 1e-3,
    under a law without jumps (no tangential dashpot, or no friction); with the uncapped dashpot it is a
    guide only.
    """
    elastic = 1.5 / math.sqrt(accuracy)
    if scene.solver.integrator == "path":
        return 2.5 / math.sqrt(accuracy)
    if not scene.needs.damping:
        return elastic
    least = max(min_restitution(scene), 0.01)  # 0 has no logarithm
    return max(elastic, (abs(math.log(least)) + 0.1) / accuracy)


def step_for(scene: Scene, accuracy: float) -> float:
    """The time step [s] of `step = "auto"`: contact time / steps_per_contact, at most the usual limits."""
    contact = contact_time(scene) / max(steps_per_contact(scene, accuracy), 1 / USUAL_CONTACT)
    return min(contact, USUAL_RAYLEIGH * rayleigh_time(scene)) if uses_moduli(scene) else contact


def uses_moduli(scene: Scene) -> bool:
    """Whether the moduli of the materials act in a contact, so that the Rayleigh time limits the step."""
    return any(names.normal_law.uses_moduli for names in scene.contact_groups)
