"""Shear springs with history, in plain NumPy: each rule as a statement of its own, on rows of contacts.

spring, slide, velocity, normal: (rows, 3); k_t, c_t, limit = mu |F_n|: (rows,). Each returns the force on i
[N] and what is stored: the displacement of the spring [m], of `incremental` its force [N]. Sources: Cundall
and Strack, Geotechnique 29 (1979) 47; Thornton, Cummins and Cleary, Powder Technol. 233 (2013) 30; Walton and
Braun, J. Rheol. 30 (1986) 949; Luding, Granul. Matter 10 (2008) 235.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from comparisons.oracles.bodies import Bodies

Rows = np.ndarray
Rule = Callable[[Rows, Rows, Rows, Rows, Rows, Rows, Rows], tuple[Rows, Rows]]


def size(a: Rows) -> Rows:
    """Length of each row, (rows, 1)."""
    return np.linalg.norm(a, axis=1)[:, None]


def projected(a: Rows, normal: Rows) -> Rows:
    """The part in the tangent plane."""
    return a - np.sum(a * normal, axis=1)[:, None] * normal


def cut(a: Rows, limit: Rows) -> tuple[Rows, Rows]:
    """(each row at most as long as its limit, whether it was longer (rows, 1))."""
    length = size(a)
    longer = length > limit[:, None]
    return np.where(longer, a * (limit[:, None] / np.where(longer, length, 1.0)), a), longer


def history(spring: Rows, slide: Rows, velocity: Rows, normal: Rows, kt: Rows, ct: Rows, limit: Rows):
    """Displacement, projected; the spring's force is capped, and a sticking contact has a dashpot."""
    pull, slips = cut(kt[:, None] * projected(spring + slide, normal), limit)
    stored = pull / np.where(kt > 0, kt, 1.0)[:, None]
    return -pull - np.where(slips, 0.0, ct[:, None]) * velocity, stored


def rotated(spring: Rows, slide: Rows, velocity: Rows, normal: Rows, kt: Rows, ct: Rows, limit: Rows):
    """The same with a spring that keeps its length while it is brought into the tangent plane."""
    flat = projected(spring, normal)
    length = size(flat)
    unit = flat / np.where(length > 0, length, 1.0)
    return history(size(spring) * unit, slide, velocity, normal, kt, ct, limit)


def incremental(spring: Rows, slide: Rows, velocity: Rows, normal: Rows, kt: Rows, ct: Rows, limit: Rows):
    """Force, added up with the stiffness of each step."""
    pull, slips = cut(projected(spring + kt[:, None] * slide, normal), limit)
    return -pull - np.where(slips, 0.0, ct[:, None]) * velocity, pull


def capped(spring: Rows, slide: Rows, velocity: Rows, normal: Rows, kt: Rows, ct: Rows, limit: Rows):
    """Displacement; spring and dashpot are capped together, and the spring is what gives that force."""
    s = projected(spring + slide, normal)
    dashpot = ct[:, None] * velocity
    force, slips = cut(-kt[:, None] * s - dashpot, limit)
    return force, np.where(slips, -(force + dashpot) / np.where(kt > 0, kt, 1.0)[:, None], s)


#: Name of a tangential law with history -> its rule.
RULES: dict[str, Rule] = {
    "history": history, "history_rotated": rotated, "history_incremental": incremental,
    "history_capped": capped,
}  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Motion:
    """One contact in time, at every step: what a law sees of it; row 0 is the set-up of the run."""

    overlap: Rows
    """[m], (steps,)"""
    normal: Rows
    """To the first body, (steps, 3)"""
    velocity: Rows
    """Of the first body's point of contact against the other's, half a step before [m/s], (steps, 3)"""


def spheres(bodies: Bodies, trace: dict[str, Rows], rows: tuple[int, int], dt: float) -> Motion:
    """The contact of two spheres of a trace of every step."""
    i, j = rows
    apart = trace["position"][:, i] - trace["position"][:, j]
    distance = size(apart)
    normal, overlap = apart / distance, sum(bodies.radius) - distance[:, 0]
    velocity = half_step(trace, i, bodies.mass[0], dt) - half_step(trace, j, bodies.mass[1], dt)
    turning = np.zeros_like(velocity)
    for k, inertia, radius in zip(rows, bodies.inertia, bodies.radius, strict=True):
        spin = half_step(trace, k, inertia, dt, ("angular_velocity", "torque"))
        turning = turning + (radius - overlap / 2)[:, None] * spin
    return Motion(overlap, normal, velocity - np.cross(turning, normal))


def half_step(
    trace: dict[str, Rows],
    row: int,
    inertia: float,
    dt: float,
    names: tuple[str, str] = ("velocity", "force"),
) -> Rows:
    """Velocity of a particle half a step before each step; at the start the one that is stated."""
    speed, force = (trace[name][:, row] for name in names)
    back = np.full((len(speed), 1), dt / (2 * inertia))
    back[0] = 0.0
    return speed - back * force


def forces(bodies: Bodies, motion: Motion, rule: Rule, dt: float) -> tuple[Rows, Rows, Rows]:
    """(normal force [N] (steps,), tangential force on the first body [N], unit normal) of Hertz spheres whose
    motion is known: nothing is integrated but the spring.
    """
    depth = np.maximum(motion.overlap, 0.0)
    along = np.sum(motion.velocity * motion.normal, axis=1)
    slip = motion.velocity - along[:, None] * motion.normal
    push = bodies.normal_constant * depth**1.5 - bodies.normal_damping * depth**0.25 * along
    push = np.where(motion.overlap > 0, push, 0.0)
    kt, ct = bodies.tangential_constant * np.sqrt(depth), bodies.tangential_damping * depth**0.25
    spring, shear = np.zeros((1, 3)), np.zeros_like(slip)
    for k in range(len(depth)):
        if motion.overlap[k] <= 0:
            spring = np.zeros((1, 3))
            continue
        here, limit = slice(k, k + 1), bodies.friction * np.abs(push[k : k + 1])
        slide = slip[here] * (dt if k else 0.0)
        shear[here], after = rule(spring, slide, slip[here], motion.normal[here], kt[here], ct[here], limit)
        spring = after if k else spring
    return push, shear, motion.normal
