"""Positions of particles in a region without overlap: random sequential addition, on the host.

Each particle is placed at a point drawn uniformly that lies in the region and overlaps none placed before, or
is left out after so many attempts (B. Widom, J. Chem. Phys. 44 (1966) 3888). Attempts are made in rounds, in
each of which the largest particles come first. Spheres of one size fill at most 0.38 of a large volume, discs
0.55 of a plane.

Particles that were inserted earlier are where free flight has taken them; contacts on their way are not known
before the run.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from gpudem.scene.overlaps import SizeClasses, near_pairs, touched
from gpudem.scene.packing import InitialState
from gpudem.scene.regions import Region

#: Distances of centers exceed the sum of radii by this share: rounding makes no contact.
CLEARANCE = 1e-6
#: Points tried at once, at most.
BATCH = 200_000


@dataclasses.dataclass
class Flight:
    """Particles in free flight, and the domain in which they move."""

    lo: np.ndarray
    """Lower corner of the domain [m]."""
    period: np.ndarray
    """Length along periodic axes [m], 0 along others."""
    gravity: np.ndarray
    """Acceleration [m/s2], of each phase, shape (p, 3)."""
    step: float
    """Time step [s]: within its step an inserted particle gets half a kick."""
    changes: np.ndarray = dataclasses.field(default_factory=lambda: np.empty(0))
    """When gravity changes [s], ascending: start of each phase but the first, shape (p - 1,)."""
    start: InitialState = dataclasses.field(default_factory=InitialState.none)
    """Particles at the start: they are where they are stated in the first step; later ones are not known."""
    position: np.ndarray = dataclasses.field(default_factory=lambda: np.empty((0, 3)))
    velocity: np.ndarray = dataclasses.field(default_factory=lambda: np.empty((0, 3)))
    radius: np.ndarray = dataclasses.field(default_factory=lambda: np.empty(0))
    time: np.ndarray = dataclasses.field(default_factory=lambda: np.empty(0))

    def add(self, state: InitialState, time: np.ndarray) -> None:
        """More particles, each from its time [s]."""
        self.position = np.concatenate([self.position, state.position])
        self.velocity = np.concatenate([self.velocity, state.velocity])
        self.radius = np.concatenate([self.radius, state.radius])
        self.time = np.concatenate([self.time, time])

    def near(self, region: Region, reach: float, time: float) -> tuple[np.ndarray, np.ndarray]:
        """(positions [m], radii [m]) at a time [s] of the particles that come within `reach` of a region."""
        t = np.where(self.time <= time, time - self.time, np.nan)[:, None]
        place = self.position + self.velocity * t + self._fallen(time)
        periodic = self.period > 0
        place[:, periodic] = self.lo[periodic] + (place - self.lo)[:, periodic] % self.period[periodic]
        low, high = region.bounds()
        margin = (reach + self.radius)[:, None]
        near = ((place > low - margin) & (place < high + margin)) | (periodic & (t >= 0))
        keep = near.all(axis=1)
        first = len(self.start) if time <= self.step else 0
        return (np.concatenate([self.start.position[:first], place[keep]]),
                np.concatenate([self.start.radius[:first], self.radius[keep]]))  # fmt: skip

    def _fallen(self, time: float) -> np.ndarray:
        """How far gravity has moved each particle up to a time [m], (n, 3); NaN of those that come later.

        An inserted particle gets half a kick in its own step. In a phase in which it is from a to b of its
        flight to t it falls by g ((t - a)^2 - (t - b)^2)/2, and by g t dt/2 more for that half kick.
        """
        t = np.where(self.time <= time, time - self.time, np.nan)[:, None]
        if not len(self.changes):
            return self.gravity[0] * (t * t + t * self.step) / 2
        edges = np.array([-np.inf, *self.changes, np.inf])
        begin = np.clip(edges[:-1, None], self.time, time)  # (p, n): since when each phase acts on each
        end = np.clip(edges[1:, None], self.time, time)
        way = ((time - begin) ** 2 - (time - end) ** 2) / 2  # mutate: fall_of_phase
        first = np.searchsorted(self.changes, self.time, side="left")
        return way.T @ self.gravity + self.gravity[first] * t * self.step / 2

    def pull(self, direction: np.ndarray, begin: float, end: float) -> float:
        """The least gravity along a direction [m/s2] in the phases of a span of time [s]."""
        first = int(np.searchsorted(self.changes, begin, side="right"))
        last = max(first, int(np.searchsorted(self.changes, end, side="left")))
        return float((self.gravity[first : last + 1] @ direction).min())


def place(
    region: Region, radius: np.ndarray, rng: np.random.Generator, attempts: int, flight: Flight, time: float,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Positions in a region for spheres of these radii, shape (n,), at a time [s].

    Returns:
        (positions [m], shape (n, 3); whether each was placed, shape (n,)).
    """
    position, placed = np.zeros((len(radius), 3)), np.zeros(len(radius), bool)
    if not len(radius):
        return position, placed
    taken = _Taken(flight, *flight.near(region, float(radius.max()), time))
    order = np.argsort(-radius, kind="stable")
    tried = 0
    while tried < attempts and len(order):
        each = min(attempts - tried, max(1, len(radius) // len(order)), max(1, BATCH // len(order)))
        row = np.repeat(order, each)
        points = region.points(rng.random((len(row), 3)))
        within = region.depth(points) >= radius[row]
        row, points = row[within], points[within]
        free = ~taken.in_the_way(points, radius[row])
        row, points = row[free], points[free]
        good = _without_overlap(points, radius[row], row, flight)
        position[row[good]], placed[row[good]] = points[good], True
        taken.add(points[good], radius[row[good]])
        order = order[~placed[order]]
        tried += each
    return position, placed


class _Taken:
    """Spheres that are in the way, in pieces with search trees of their own.

    A piece that is added is joined with those before it that are not twice as large, so that there are few
    pieces, and a sphere is sorted into a tree a few times only, however often spheres are added.
    """

    def __init__(self, flight: Flight, position: np.ndarray, radius: np.ndarray):
        self.flight = flight
        self.pieces: list[SizeClasses] = []
        self.add(position, radius)

    def add(self, position: np.ndarray, radius: np.ndarray) -> None:
        """More of them."""
        if not len(radius):
            return
        position, radius = position - self.flight.lo, radius * (1 + CLEARANCE)
        while self.pieces and len(self.pieces[-1].radius) < 2 * len(radius):
            last = self.pieces.pop()
            position, radius = (
                np.concatenate([last.position, position]), np.concatenate([last.radius, radius])
            )  # fmt: skip
        self.pieces.append(SizeClasses(position, radius))

    def in_the_way(self, points: np.ndarray, radius: np.ndarray) -> np.ndarray:
        """Whether a sphere at each of these points would overlap one of them, shape (n,)."""
        rest = np.arange(len(points))
        found = np.zeros(len(points), bool)
        for piece in self.pieces:  # the largest first: what it blocks need not be looked for in the others
            tried = SizeClasses(points[rest] - self.flight.lo, radius[rest] * (1 + CLEARANCE))
            found[rest] = touched(tried, piece, self.flight.period)
            rest = np.flatnonzero(~found)
        return found


def _without_overlap(points: np.ndarray, radius: np.ndarray, row: np.ndarray, flight: Flight) -> np.ndarray:
    """The points to take, ascending: each free of overlap with those taken before it.

    row: the particle of each point; a particle takes the first that is free.
    """
    if not len(points):
        return np.empty(0, np.int64)
    reach = radius * (1 + CLEARANCE)
    pairs = [np.empty((0, 2), np.int64)]
    for i, j, distance in near_pairs(points - flight.lo, reach, flight.period, 0.0):
        hit = distance < reach[i] + reach[j]
        pairs.append(np.stack([np.minimum(i, j)[hit], np.maximum(i, j)[hit]], axis=1))
    return _first_come(np.concatenate(pairs), row)


def _first_come(pairs: np.ndarray, row: np.ndarray) -> np.ndarray:
    """Points taken in their order: in no pair with one taken before, one a particle."""
    pairs = pairs[np.argsort(pairs[:, 1], kind="stable")]
    ends = np.searchsorted(pairs[:, 1], np.arange(len(row) + 1)).tolist()
    lower: list[Any] = pairs[:, 0].tolist()
    taken, done, found = np.zeros(len(row), bool).tolist(), set(), []
    for k, particle in enumerate(row.tolist()):
        if particle in done or any(taken[i] for i in lower[ends[k] : ends[k + 1]]):
            continue
        taken[k] = True
        done.add(particle)
        found.append(k)
    return np.array(found, np.int64)
