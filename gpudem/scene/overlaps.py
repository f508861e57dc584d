"""Overlaps of particles at the start, searched by size class. NumPy and SciPy only.

A search of all particles within the reach of the largest has a cost of n (R_max/R_min)^3. Here particles are
sorted into classes of radii within a factor of sqrt(2), and pairs of classes are searched within the reach of
their largest: n times the number of classes, whatever the sizes.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from gpudem.scene import laws
from gpudem.scene.groups import FREE, FROZEN

if TYPE_CHECKING:
    from scipy.spatial import KDTree

    from gpudem.contact.law import NormalLaw
    from gpudem.scene.model import Scene

#: Overlap at the start beyond this share of the smaller radius is an error (a settled bed has about 1 %).
MAX_START_OVERLAP = 0.1
#: Overlaps below this share of the smaller radius are rounding.
TOUCHING = 1e-9

#: Pairs in one piece of a crowded search: some 30 MB.
PIECE = 300_000
#: Points whose pairs are counted at once in a crowded search.
BLOCK = 200
#: Pairs within reach for each particle, beyond which a search is crowded (without overlap: below 40).
CROWD = 60
#: Points sampled to decide whether it is.
SAMPLE = 500
#: Overlapping pairs after which the search ends: the scene is unusable.
ENOUGH = 200_000


@dataclasses.dataclass(frozen=True)
class Overlaps:
    """Pairs that overlap by more than a share of the smaller radius."""

    count: int
    complete: bool
    """False: the search ended at ENOUGH pairs; there may be more."""
    worst: tuple[int, int]
    """Rows i < j of the pair with the largest share."""
    overlap: float
    """Its overlap [m]."""


def lattice_within(scene: Scene) -> bool:
    """A lattice is without overlap as it is made, also through periodic sides where it lies within them.

    A search of a million spheres takes most of a second.
    """
    particles, domain = scene.particles, scene.domain
    return (
        particles is not None
        and particles.source == "lattice"
        and all(a <= b for a, b in zip((*domain.lo, *particles.hi), (*particles.lo, *domain.hi), strict=True))
    )


def largest_start_overlap(scene: Scene) -> float:
    """The largest overlap at the start, as a share of the smaller radius, of particles or at a wall [1]."""
    state, lo = scene.particles_at_start, np.array(scene.domain.lo)
    free = scene.held[: len(state)] == FREE
    walls = [
        float((w.overlap(state.position, state.radius) / state.radius)[free].max(initial=0.0))
        for w in scene.walls_at_start
    ]
    share = max([0.0, *walls])
    if len(state) < 2 or lattice_within(scene):
        return share
    period = np.where(scene.domain.periodic, np.array(scene.domain.hi) - lo, 0.0)
    found = find_overlaps(state.position - lo, state.radius, period, max(share, TOUCHING), free)
    return found.overlap / float(state.radius[list(found.worst)].min()) if found else share


def start_elastic_energy(scene: Scene) -> float:
    """Elastic energy [J] of all overlaps at the start, by the normal law: m* v^2/2 of each release."""
    state, lo, energy = scene.particles_at_start, np.array(scene.domain.lo), 0.0
    names, mass = list(scene.materials), scene.masses
    free = scene.held[: len(state)] == FREE

    def released(law: NormalLaw, a: int, partner: str, r: float, m: float, overlap: float) -> float:
        inputs = scene.inputs(names[state.material[a]], partner)
        return 0.5 * m * law.release_speed(inputs, r, m, overlap) ** 2

    for wall in scene.walls_at_start:
        law = laws.stated_laws(scene, wall).normal_law
        overlap = wall.overlap(state.position, state.radius)
        for i in np.flatnonzero(free & (overlap > TOUCHING * state.radius)).tolist():
            energy += released(law, i, wall.material, state.radius[i], mass[i], overlap[i])
    if len(state) < 2 or lattice_within(scene):
        return energy
    period = np.where(scene.domain.periodic, np.array(scene.domain.hi) - lo, 0.0)
    for i, j, distance in _meeting(near_pairs(state.position - lo, state.radius, period, TOUCHING), free):
        sum_radii = state.radius[i] + state.radius[j]
        for k in np.flatnonzero(distance < sum_radii).tolist():
            a, b = int(i[k]), int(j[k])
            r = state.radius[a] * state.radius[b] / sum_radii[k]
            m = mass[a] * mass[b] / (mass[a] + mass[b])
            if FROZEN in (scene.held[a], scene.held[b]):
                m = mass[a] if free[a] else mass[b]
            energy += released(
                scene.normal_law, a, names[state.material[b]], r, m, sum_radii[k] - distance[k]
            )
    return energy


def find_overlaps(
    position: np.ndarray,
    radius: np.ndarray,
    period: np.ndarray,
    limit: float,
    free: np.ndarray | None = None,
) -> Overlaps | None:
    """Pairs of spheres whose overlap R_i + R_j - distance exceeds `limit` times the smaller radius.

    Args:
        position: (n, 3) centres [m], from 0 to `period` along periodic axes.
        radius: (n,) [m].
        period: (3,) length [m] of the domain along periodic axes, above twice the largest reach; 0 elsewhere.
        limit: Share of the smaller radius [1].
        free: (n,) which of them move freely: two others have no contact; default: all.

    Returns:
        What was found; None: no such pair.
    """
    count, share, worst, deepest = 0, limit, (0, 0), 0.0
    for i, j, distance in _meeting(near_pairs(position, radius, period, limit), free):
        overlap = radius[i] + radius[j] - distance
        shares = overlap / np.minimum(radius[i], radius[j])
        bad = shares > limit
        count += int(np.count_nonzero(bad))
        if bad.any() and shares.max() > share:
            k = int(np.argmax(shares))
            share, deepest = float(shares[k]), float(overlap[k])
            worst = (int(min(i[k], j[k])), int(max(i[k], j[k])))
        if count >= ENOUGH:
            return Overlaps(count, False, worst, deepest)
    return Overlaps(count, True, worst, deepest) if count else None


Pairs = Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]


def _tree(points: np.ndarray) -> KDTree:
    from scipy.spatial import KDTree

    return KDTree(points, balanced_tree=False, compact_nodes=False)


class SizeClasses:
    """Spheres sorted into classes of size, each with a search tree of its centers."""

    def __init__(self, position: np.ndarray, radius: np.ndarray):
        self.position, self.radius = position, radius
        classes = np.floor(2 * np.log2(radius / radius.max(initial=0.0))).astype(int)
        self.rows = {int(c): np.flatnonzero(classes == c) for c in np.unique(classes)}
        """Rows of each class, from the smallest."""
        self.trees = {c: _tree(position[own]) for c, own in self.rows.items()}
        self.largest = {c: float(radius[own].max()) for c, own in self.rows.items()}
        """Largest radius of each class [m]."""


def touched(one: SizeClasses, other: SizeClasses, period: np.ndarray) -> np.ndarray:
    """Which spheres of `one` overlap one of the others, shape (n,); positions as of `find_overlaps`."""
    found = np.zeros(len(one.radius), bool)
    for a, own in one.rows.items():
        for b, theirs in other.rows.items():
            reach = one.largest[a] + other.largest[b]
            k, place = _images(one.position[own], reach, period)
            every = np.concatenate([np.arange(len(own)), k])
            tree = _tree(np.concatenate([one.position[own], place])) if len(k) else one.trees[a]
            for i, j, distance in _pairs_between(tree, other.trees[b], reach):
                rows = own[every[i]]
                hit = distance < one.radius[rows] + other.radius[theirs[j]]
                found[rows[hit]] = True  # mutate: overlap_with_earlier
    return found


def _meeting(pairs: Pairs, free: np.ndarray | None) -> Pairs:
    """Those of which one at least is free."""
    for i, j, distance in pairs:
        keep = np.ones(len(i), bool) if free is None else free[i] | free[j]  # mutate: overlaps_of_held
        yield i[keep], j[keep], distance[keep]


def near_pairs(position: np.ndarray, radius: np.ndarray, period: np.ndarray, limit: float) -> Pairs:
    """(i, j, distance [m]) of pairs that may overlap by more than the limit, each pair once, in pieces.

    Arguments as of `find_overlaps`. i and j are in no order.
    """
    sized = SizeClasses(position, radius)
    rows, trees, largest = sized.rows, sized.trees, sized.largest
    for large, own in rows.items():
        for small in (c for c in rows if c <= large):
            # R_i + R_j - limit R_j of the largest: farther apart none overlaps by more than the limit
            reach = largest[large] + (1 - limit) * largest[small]
            k, place = _images(position[own], reach, period)
            if small == large:
                for i, j, distance in _pairs_within(trees[large], reach):
                    yield own[i], own[j], distance
            else:
                k, place = np.concatenate([np.arange(len(own)), k]), np.concatenate([position[own], place])
            if len(k) == 0:
                continue
            for i, j, distance in _pairs_between(_tree(place), trees[small], reach):
                i, j = own[k[i]], rows[small][j]
                once = i < j if small == large else np.ones(len(i), bool)  # images meet from both sides
                yield i[once], j[once], distance[once]


def _pairs_within(tree: KDTree, reach: float) -> Pairs:
    """(i, j, distance) of the points of a tree nearer than `reach`, i < j."""
    if _crowded(tree, tree, reach):
        for i, j, distance in _pairs_by_pieces(tree, tree, reach):
            yield i[i < j], j[i < j], distance[i < j]
        return
    pairs = tree.query_pairs(reach, output_type="ndarray")
    i, j = pairs[:, 0], pairs[:, 1]
    yield i, j, np.linalg.norm(tree.data[i] - tree.data[j], axis=1)


def _pairs_between(one: KDTree, other: KDTree, reach: float) -> Pairs:
    """(i, j, distance) of the points i of one tree and j of the other nearer than `reach`."""
    if _crowded(one, other, reach):
        yield from _pairs_by_pieces(one, other, reach)
        return
    found = one.sparse_distance_matrix(other, reach, output_type="ndarray")
    yield found["i"], found["j"], found["v"]


def _crowded(one: KDTree, other: KDTree, reach: float) -> bool:
    """Whether there are far more pairs than particles without overlap have, from a sample of the points."""
    sample = one.data[:: max(1, one.n // SAMPLE)]
    mean = float(np.mean(other.query_ball_point(sample, reach, return_length=True)))
    return mean * one.n > CROWD * (one.n + other.n) + PIECE


def _pairs_by_pieces(one: KDTree, other: KDTree, reach: float) -> Pairs:
    """As `_pairs_between`, some PIECE pairs at a time: slower, and for any number of pairs."""
    for first in range(0, one.n, BLOCK):
        points = one.data[first : first + BLOCK]
        ends = np.cumsum(other.query_ball_point(points, reach, return_length=True))
        start = 0
        while start < len(points):
            before = int(ends[start - 1]) if start else 0
            stop = max(start + 1, int(np.searchsorted(ends, before + PIECE, side="right")))
            lists = other.query_ball_point(points[start:stop], reach)
            i = first + np.repeat(np.arange(start, stop), [len(found) for found in lists])
            j = np.concatenate([np.array(found, np.int64) for found in lists])
            yield i, j, np.linalg.norm(one.data[i] - other.data[j], axis=1)
            start = stop


def _images(position: np.ndarray, reach: float, period: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(row, place) of the periodic images within `reach` of the domain, the points themselves left out."""
    row, place = np.arange(len(position)), position
    for k in np.flatnonzero(period):
        shift = period[k] * (np.arange(3) == k)
        low, high = place[:, k] < reach, place[:, k] > period[k] - reach
        place = np.concatenate([place, place[low] + shift, place[high] - shift])
        row = np.concatenate([row, row[low], row[high]])
    return row[len(position) :], place[len(position) :]
