"""Equal spheres with linear springs in a turning drum of facets: the force on each of them and the energy
that they dissipate, worked out in NumPy from positions and velocities at every step.

A contact has F_n = k d - c v_n, and across it a spring s with F_t = -k s - c v_t, or friction |F_n| along s
where k |s| would exceed that. Per step it dissipates

    dashpots  c v_n^2 dt, and c v_t^2 dt while it sticks
    sliding   k |s| times the length by which the spring is shortened to the limit
    parting   k s^2/2 of a spring whose contact ends

and stores k d^2/2 + k s^2/2. With kinetic and potential energy E and the work W of the drum on the spheres,
W = change of (E + stored) + dissipated.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np
from scipy.integrate import cumulative_trapezoid


@dataclasses.dataclass(frozen=True)
class Spring:
    """A contact: normal and tangential stiffness k [N/m] and dashpot c [N s/m] are equal, as in `hooke`."""

    stiffness: float
    dashpot: float
    friction: float


@dataclasses.dataclass(frozen=True)
class Drum:
    """Facets about the y axis that touch a cylinder from outside, smooth ends that stand still, spheres."""

    radius: float
    """Of the cylinder that the facets touch [m]."""
    facets: int
    spin: float
    """Angular velocity about y [rad/s], right-handed."""
    first: float
    """Angle from x towards z of the middle of the first facet at the start [rad]."""
    length: float
    """Along y from 0 [m]."""
    sphere: float
    """Radius of the spheres [m]."""
    mass: float
    """Of each [kg]."""
    ball: Spring
    wall: Spring

    def gap(self, position: np.ndarray, time: float) -> tuple[np.ndarray, np.ndarray]:
        """(distance from the nearest facet [m] (n,), unit vector from it to the center (n, 3))."""
        middle = self.first - self.spin * time + 2 * np.pi * np.arange(self.facets) / self.facets
        out = np.stack([np.cos(middle), 0 * middle, np.sin(middle)], axis=1)
        along = position @ out.T
        nearest = along.argmax(axis=1)
        return self.radius - along.max(axis=1), -out[nearest]


@dataclasses.dataclass(frozen=True)
class Ledger:
    """What `follow` found at each step."""

    force: np.ndarray
    """Of all contacts on each sphere [N], (t, n, 3)."""
    torque: np.ndarray
    """Of the spheres on the drum about its axis [N m], (t,)."""
    stored: np.ndarray
    """In the springs [J], (t,)."""
    dissipated: np.ndarray
    """Since the start [J], (t,)."""
    contacts: np.ndarray
    """With the drum and of spheres, (t, 2)."""


@dataclasses.dataclass(frozen=True)
class _Rows:
    """Contacts of one step: sphere i with sphere j, with the drum, which is row n, or with an end, n + 1."""

    i: np.ndarray
    j: np.ndarray
    overlap: np.ndarray
    normal: np.ndarray
    """From j to i."""
    law: np.ndarray
    """(stiffness, dashpot, friction) of each, (rows, 3)."""

    def slip(self, drum: Drum, position: np.ndarray, velocity: np.ndarray, spin: np.ndarray) -> np.ndarray:
        """Velocity of the surface of i against that of j where they touch [m/s]; levers R - overlap/2."""
        lever, wall = (drum.sphere - self.overlap / 2)[:, None], self.j >= len(velocity)
        j = np.where(wall, 0, self.j)
        own = velocity[self.i] - lever * np.cross(spin[self.i], self.normal)
        other = velocity[j] + lever * np.cross(spin[j], self.normal)
        surface = np.cross([0.0, drum.spin, 0.0], self.place(drum, position))
        surface[self.j > len(velocity)] = 0.0
        return own - np.where(wall[:, None], surface, other)

    def place(self, drum: Drum, position: np.ndarray) -> np.ndarray:
        """The point of the drum that is nearest to i [m]; means nothing for a pair of spheres."""
        return position[self.i] - (drum.sphere - self.overlap)[:, None] * self.normal


def _touching(drum: Drum, position: np.ndarray, time: float) -> _Rows:
    from comparisons.metrics.contacts import touching

    n = len(position)
    pairs, vector = touching(position, np.full(n, drum.sphere), np.zeros(3))
    distance = np.linalg.norm(vector, axis=1)
    gap, normal = drum.gap(position, time)
    at = np.flatnonzero(gap < drum.sphere)
    from_end = np.minimum(position[:, 1], drum.length - position[:, 1])
    end = np.flatnonzero(from_end < drum.sphere)
    inwards = np.zeros((len(end), 3))
    inwards[:, 1] = np.where(position[end, 1] < drum.length / 2, 1.0, -1.0)
    smooth = dataclasses.replace(drum.wall, friction=0.0)
    kinds = ((drum.ball, pairs), (drum.wall, at), (smooth, end))
    laws = [dataclasses.astuple(spring) for spring, rows in kinds for _ in rows]
    return _Rows(
        np.concatenate([pairs[:, 0], at, end]),
        np.concatenate([pairs[:, 1], np.full(len(at), n), np.full(len(end), n + 1)]),
        np.concatenate([2 * drum.sphere - distance, drum.sphere - gap[at], drum.sphere - from_end[end]]),
        np.concatenate([vector / distance[:, None], normal[at], inwards]), np.array(laws),
    )  # fmt: skip


def _along(vectors: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Component along the normal (rows,)."""
    return (vectors * normal).sum(axis=1)


def _across(vectors: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """The part across the normal (rows, 3)."""
    return vectors - _along(vectors, normal)[:, None] * normal


@dataclasses.dataclass(frozen=True)
class _Law:
    """The law at the contacts of one step."""

    force: np.ndarray
    """On sphere i [N], (rows, 3)."""
    spring: np.ndarray
    """After the step [m], (rows, 3)."""
    damping: np.ndarray
    """Forces of the dashpots [N], (rows, 3)."""
    slid: np.ndarray
    """Energy dissipated by sliding in the step [J], (rows,)."""


def _law(rows: _Rows, slip: np.ndarray, before: np.ndarray, passed: float) -> _Law:
    """The law for velocities of slip [m/s], springs before the step [m], and the time [s] that passed."""
    stiffness, dashpot, friction = rows.law.T
    approach, sliding = _along(slip, rows.normal), _across(slip, rows.normal)
    push = stiffness * rows.overlap - dashpot * approach
    trial = _across(before + passed * sliding, rows.normal)
    size, limit = stiffness * np.linalg.norm(trial, axis=1), friction * np.abs(push)
    slides = (size > limit) | (friction == 0)
    after = np.where(slides, limit / np.where(size > 0, size, 1.0), 1.0)[:, None] * trial
    damping = -(dashpot * approach)[:, None] * rows.normal
    damping -= np.where(slides, 0.0, dashpot)[:, None] * sliding
    elastic = (stiffness * rows.overlap)[:, None] * rows.normal - stiffness[:, None] * after
    slid = stiffness * ((before + after) / 2 * (trial - after)).sum(axis=1)
    return _Law(elastic + damping, after, damping, slid)


def follow(drum: Drum, dt: float, trace: Mapping[str, np.ndarray]) -> Ledger:
    """Forces, energy in the springs and dissipated energy along a trace of every step [s].

    The law sees velocities half a step before each state, as LIGGGHTS' scheme has it; at the start, where all
    springs are new, those of the state, and no spring is stretched. Powers are of velocities at the state.
    """
    position, velocity, spin = (trace[k] for k in ("position", "velocity", "angular_velocity"))
    steps, n, _ = position.shape
    inertia = 0.4 * drum.mass * drum.sphere**2
    force, springs = np.zeros_like(position), np.zeros((n, n + 2, 3))
    torque, stored, damped, lost = np.zeros((4, steps))
    counts = np.zeros((steps, 2), int)
    for k in range(steps):
        rows = _touching(drum, position[k], k * dt)
        stiffness = rows.law[:, 0]
        v, w = velocity[k], spin[k]
        if k:
            v = velocity[k - 1] + dt / 2 * trace["force"][k - 1] / drum.mass
            w = spin[k - 1] + dt / 2 * trace["torque"][k - 1] / inertia
        law = _law(rows, rows.slip(drum, position[k], v, w), springs[rows.i, rows.j], dt if k else 0.0)
        now = rows.slip(drum, position[k], velocity[k], spin[k])
        damped[k] = -(law.damping * now).sum()

        springs[rows.i, rows.j] = 0.0  # what is left has parted
        parted = drum.ball.stiffness * springs[:, :n] ** 2, drum.wall.stiffness * springs[:, n] ** 2
        lost[k] = law.slid.sum() + sum(p.sum() for p in parted) / 2
        springs[:] = 0.0
        springs[rows.i, rows.j] = law.spring
        stored[k] = (stiffness * (rows.overlap**2 + (law.spring**2).sum(axis=1)) / 2).sum()

        pair, wall = rows.j < n, rows.j == n
        np.add.at(force[k], rows.i, law.force)
        np.subtract.at(force[k], rows.j[pair], law.force[pair])
        torque[k] = np.cross(rows.place(drum, position[k]), -law.force)[wall, 1].sum()
        counts[k] = wall.sum(), pair.sum()
    dissipated = cumulative_trapezoid(damped, dx=dt, initial=0.0) + np.cumsum(lost)
    return Ledger(force, torque, stored, dissipated, counts)
