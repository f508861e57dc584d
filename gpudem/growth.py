"""Dense random packings by growth: small spheres at random points grow until they have their stated size.

Spheres of a share s of their radii repel each other and the surface of the region where they overlap,

    E = sum over overlaps of d^2/2,

and move until no overlap exceeds a stated share of the smaller radius; then s is raised. Where that fails,
the increment is halved, until s = 1 or the increment is below SMALLEST: then the packing is jammed at this
s. This is the way of N. Xu, J. Blawzdziewicz, C. S. O'Hern, Phys. Rev. E 71 (2005) 061306, from random
points as in C. S. O'Hern, L. E. Silbert, A. J. Liu, S. R. Nagel, Phys. Rev. E 68 (2003) 011306, who find for
N equal spheres in a periodic box

    phi_J = 0.639 - 0.12 N^(-1/(3 nu)), nu = 0.71;

energies are minimized by FIRE: E. Bitzek et al., Phys. Rev. Lett. 97 (2006) 170201.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from gpudem.bed import Bed
from gpudem.errors import GpudemError
from gpudem.scene.insertion import surroundings
from gpudem.scene.overlaps import find_overlaps, near_pairs
from gpudem.scene.regions import Block, Cylinder, Region
from gpudem.scene.sources import InsertPack, drawn_for

if TYPE_CHECKING:
    from gpudem.scene import Scene

#: Largest overlap of the result [smaller radius].
OVERLAP = 1e-4
#: Packing fraction at which growth begins, first increment of s and the smallest one.
BEGIN, FIRST, SMALLEST = 0.4, 0.02, 2e-5
#: Steps of a minimization, at most.
STEPS = 20_000
#: Forces are in balance, so that overlaps stay: net forces over contact forces, roots of sums of squares.
BALANCED = 0.005
#: FIRE: first and longest step [sqrt(m/k)], steps downhill before it grows, factors, share of steering.
DT, LONGEST, DOWNHILL, LONGER, SHORTER, STEER, LESS = 0.1, 0.7, 5, 1.1, 0.5, 0.1, 0.99
#: Margin of the list of pairs [smallest radius].
MARGIN = 0.3


@dataclasses.dataclass(frozen=True)
class Grown(Bed):
    """A dense packing at rest."""

    fraction: float
    """Volume of the particles / volume of the region [1]."""
    overlap: float
    """Largest overlap, with each other and with the surface [smaller radius]."""
    left_out: int
    """Particles of the statement that do not fit."""


def grow(
    scene: Scene, *, full: bool = False, overlap: float = OVERLAP,
    progress: Callable[[float], None] = lambda share: None,
) -> Grown:  # fmt: skip
    """The particles of the scene's only `[[insert]]`, a `pack`, densely in its region.

    The region is the container; walls of the scene and gravity play no part. A block that reaches from side
    to side of a periodic domain is periodic there.

    Args:
        scene: With the statement.
        full: Where not all fit, as many as do, in the order drawn.
        overlap: Largest overlap [smaller radius].
        progress: Told each share of the radii that is reached.

    Raises:
        GpudemError: another statement; not all fit and not `full`.
    """
    source = _statement(scene)
    try:
        radius, material, rng = drawn_for(source, surroundings(scene, 0))
    except ValueError as error:
        raise GpudemError(f"insert[0].{error}") from None
    container, stated = _Container.of(scene, source.region), len(radius)
    while True:
        position, share = packed(container, radius, rng, overlap, progress)
        if share == 1.0:
            break
        reached = container.fraction(share * radius)
        if not full:
            wanted = container.fraction(radius)
            raise GpudemError(
                f"insert[0]: a packing fraction of {wanted:.4f} is not reached: jammed at {reached:.4f};"
                " state less, or take as many as fit (--until full)"
            )
        keep = min(len(radius) - 1, int(len(radius) * share**3))  # mutate: as_many_as_fit
        if keep < 1:
            raise GpudemError("insert[0].region: no particle fits; allowed: a larger region")
        radius, material = radius[:keep], material[:keep]
    names, none = list(scene.materials), np.zeros((len(radius), 3))
    return Grown(
        container.low + position, none, none, radius, np.array([names[k] for k in material]), 0.0, True, 0.0,
        container.fraction(radius), largest_overlap(container, position, radius), stated - len(radius),
    )  # fmt: skip


def _statement(scene: Scene) -> InsertPack:
    """Raises GpudemError: other particles than those of one pack."""
    if scene.particles is not None or len(scene.insert) != 1 or not isinstance(scene.insert[0], InsertPack):
        raise GpudemError("insert: growth wants one [[insert]] of kind 'pack' and no [particles]")
    return scene.insert[0]


#: Distance [m] of points, shape (n, 3), from a part of a surface, positive inside.
Side = Callable[[np.ndarray], np.ndarray]


def _sides(region: Region, period: np.ndarray) -> list[Side]:
    """The smooth parts of the surface of a block or cylinder; all of another one."""
    if isinstance(region, Block):
        lo, hi = region.lo, region.hi
        walls = [k for k in range(3) if period[k] == 0]  # mutate: periodic_container
        return [
            *(lambda x, k=k: x[:, k] - lo[k] for k in walls),
            *(lambda x, k=k: hi[k] - x[:, k] for k in walls),
        ]
    if isinstance(region, Cylinder):
        axis = np.array(region.axis) / np.linalg.norm(region.axis)

        def along(x: np.ndarray) -> np.ndarray:
            return (x - np.array(region.point)) @ axis

        def shell(x: np.ndarray) -> np.ndarray:
            across = x - np.array(region.point) - along(x)[:, None] * axis
            return region.radius - np.linalg.norm(across, axis=1)

        return [along, lambda x: region.length - along(x), shell]
    return [region.depth]


@dataclasses.dataclass(frozen=True)
class _Container:
    """Where spheres are packed."""

    sides: tuple[Side, ...]
    """Its surface, in smooth parts: a sphere in a corner is pushed by each of them."""
    low: np.ndarray
    high: np.ndarray
    """Corners of the box around it [m]; positions count from the lower one."""
    period: np.ndarray
    """Length along periodic axes [m], 0 along others."""
    volume: float
    """[m3]."""

    @staticmethod
    def of(scene: Scene, region: Region) -> _Container:
        low, high = region.bounds()
        lo, hi = np.array(scene.domain.lo), np.array(scene.domain.hi)
        through = np.array(scene.domain.periodic) & (low <= lo) & (high >= hi)
        through &= isinstance(region, Block)
        period = np.where(through, hi - lo, 0.0)
        return _Container(tuple(_sides(region, period)), low, high, period, region.volume)

    def depth(self, position: np.ndarray) -> np.ndarray:
        """Distance [m] from the surface, positive inside, shape (n,)."""
        depths = [side(position + self.low) for side in self.sides]
        return np.min([np.full(len(position), np.inf), *depths], axis=0)

    def fraction(self, radius: np.ndarray) -> float:
        """Volume of spheres of these radii / volume of the region [1]."""
        return float((4 / 3 * np.pi * radius**3).sum()) / self.volume

    def points(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """So many random points within."""
        found = np.empty((0, 3))
        while len(found) < count:
            points = rng.random((count, 3)) * (self.high - self.low)
            found = np.concatenate([found, points[self.depth(points) > 0]])
        return found[:count]

    def wrapped(self, position: np.ndarray) -> np.ndarray:
        """Positions from 0 to the period along periodic axes."""
        along = self.period > 0
        position = position.copy()
        position[:, along] %= self.period[along]
        position[:, along] = np.where(position >= self.period, 0.0, position)[:, along]  # a tiny one below 0
        return position


def packed(
    container: _Container, radius: np.ndarray, rng: np.random.Generator, overlap: float,
    progress: Callable[[float], None] = lambda share: None,
) -> tuple[np.ndarray, float]:  # fmt: skip
    """Positions (n, 3) [m] from the container's origin, and the share of the radii that was reached [1]."""
    share = min(1.0, (BEGIN / container.fraction(radius)) ** (1 / 3))
    position, good = _relaxed(container, container.points(rng, len(radius)), share * radius, overlap)
    while not good:  # a container whose surface is in the way of few large spheres
        share *= 0.9
        position, good = _relaxed(container, position, share * radius, overlap)
    increment = FIRST
    while share < 1.0 and increment >= SMALLEST:
        tried = min(1.0, share + increment)
        moved, good = _relaxed(container, position, tried * radius, overlap)
        if good:
            position, share = moved, tried
            progress(share)
        else:
            increment /= 2
    return position, share


def largest_overlap(container: _Container, position: np.ndarray, radius: np.ndarray) -> float:
    """With each other and with the surface [smaller radius]."""
    found = find_overlaps(position, radius, container.period, 0.0)
    depth = container.depth(position)
    pairs = found.overlap / float(radius[list(found.worst)].min()) if found else 0.0
    return max(pairs, float(((radius - depth) / radius).max()), 0.0)


class _Contacts:
    """Overlaps of spheres with each other and with the surface, among those that were near.

    What is near is found anew once a sphere has moved by half of the margin.
    """

    def __init__(self, container: _Container, radius: np.ndarray):
        self.container, self.radius = container, radius
        self.margin = MARGIN * float(radius.min())
        self.at: np.ndarray | None = None

    def look(self, position: np.ndarray) -> None:
        """Find what is near, where that is needed."""
        if self.at is not None:
            moved = ((position - self.at) ** 2).sum(axis=1).max()
            if moved < (self.margin / 2) ** 2:  # mutate: list_of_growth
                return
        container, self.at = self.container, position.copy()
        reach = self.radius + self.margin / 2
        near = near_pairs(container.wrapped(position), reach, container.period, 0.0)
        found = [np.stack([i, j]) for i, j, _distance in near]
        i, j = np.concatenate(found, axis=1) if found else np.empty((2, 0), int)
        order = np.lexsort((j, i))  # sums are added up in one order, whatever a search returns
        self.i, self.j = i[order], j[order]
        self.sum = self.radius[self.i] + self.radius[self.j]
        self.near = [
            np.flatnonzero(side(position + container.low) < self.radius + self.margin)
            for side in container.sides
        ]

    def pairs(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """(i, j, overlap [m], direction from j to i) of the pairs that overlap."""
        d = position[self.i] - position[self.j]
        along, period = self.container.period > 0, self.container.period
        d[:, along] -= period[along] * np.round(d[:, along] / period[along])
        distance = np.sqrt((d * d).sum(axis=1))
        hit = np.flatnonzero(distance < self.sum)
        distance = np.maximum(distance[hit], 1e-12 * self.sum[hit])
        return self.i[hit], self.j[hit], self.sum[hit] - distance, d[hit] / distance[:, None]

    def pushed(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(rows, overlap [m], direction inwards) of the spheres that overlap a part of the surface."""
        none = np.empty(0)
        rows, depths, directions = [none.astype(int)], [none], [np.empty((0, 3))]
        h = 1e-5 * float(self.radius.min())
        for side, near in zip(self.container.sides, self.near, strict=True):
            overlap = self.radius[near] - side(position[near] + self.container.low)
            hit = near[overlap > 0]
            place = position[hit] + self.container.low
            # one call for all: of a mesh it costs
            beside = np.stack([place + h * e for e in (*np.eye(3), *-np.eye(3))])
            ahead, behind = side(beside.reshape(-1, 3)).reshape(2, 3, len(place))
            slope = (ahead - behind).T
            length = np.linalg.norm(slope, axis=1, keepdims=True)
            rows.append(hit)
            depths.append(overlap[overlap > 0])
            directions.append(slope / np.where(length > 0, length, 1.0))
        return np.concatenate(rows), np.concatenate(depths), np.concatenate(directions)


def _relaxed(
    container: _Container, position: np.ndarray, radius: np.ndarray, overlap: float
) -> tuple[np.ndarray, bool]:
    """Positions after a minimization, and whether no overlap exceeds the stated share there."""
    contacts = _Contacts(container, radius)
    velocity, dt, steer, downhill = np.zeros_like(position), DT, STEER, 0
    for _step in range(STEPS):
        force, worst, typical = _forces(contacts, position)
        if worst <= overlap:
            return container.wrapped(position), True
        pull = math.sqrt((force**2).sum())
        if pull <= BALANCED * typical:
            break
        power = float((force * velocity).sum())
        if power > 0:
            speed = math.sqrt((velocity**2).sum())
            velocity = (1 - steer) * velocity + steer * speed / pull * force
            downhill += 1
            if downhill > DOWNHILL:
                dt, steer = min(LONGEST, dt * LONGER), steer * LESS
        else:
            velocity[:], dt, steer, downhill = 0.0, dt * SHORTER, STEER, 0
        velocity += dt * force
        position = position + dt * velocity
    return container.wrapped(position), False


def _forces(contacts: _Contacts, position: np.ndarray) -> tuple[np.ndarray, float, float]:
    """Forces [m], the largest overlap [smaller radius], and the root of the sum of squared overlaps [m]."""
    contacts.look(position)
    radius = contacts.radius
    i, j, depth, direction = contacts.pairs(position)
    rows, pushed, inwards = contacts.pushed(position)
    force, n = np.empty_like(position), len(position)
    for k in range(3):
        f, w = depth * direction[:, k], pushed * inwards[:, k]
        force[:, k] = np.bincount(i, f, n) - np.bincount(j, f, n) + np.bincount(rows, w, n)
    worst = float((depth / np.minimum(radius[i], radius[j])).max(initial=0.0))
    worst = max(worst, float((pushed / radius[rows]).max(initial=0.0)))
    return force, worst, math.sqrt((depth**2).sum() + (pushed**2).sum())
