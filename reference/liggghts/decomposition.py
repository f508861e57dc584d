"""How the box is cut among MPI ranks: never across the direction in which the particles are gathered."""

from __future__ import annotations

import itertools
import math

import numpy as np

from gpudem.scene import Plane, Scene
from gpudem.scene.walls import Wall

#: A wall is flat along an axis if its extent is at most this share of its largest one.
FLAT = 1e-6


def processors(scene: Scene, ranks: int) -> tuple[int, int, int]:
    """Bricks along x, y, z for `ranks` ranks.

    Left to itself LIGGGHTS cuts the longest side, which in a dam break leaves all grains with one rank.
    Rule: do not cut across a gate, a plane or flat mesh that goes (the grains stand behind it), nor along
    gravity (they sink to the floor); of the cuts left, take the one whose fullest brick holds fewest
    particles at the start, and of equal ones the smallest cut area. Where everything is excluded, all cuts
    compete.
    """
    gated = {k for wall in scene.wall_elements if scene.goes(wall) for k in _thin(wall)}
    falling = {k for k in range(3) if any(phase.gravity[k] != 0 for phase in scene.phase_scenes)}
    counts = range(1, ranks + 1)
    grids = [g for g in itertools.product(counts, counts, counts) if math.prod(g) == ranks]
    allowed = [g for g in grids if all(g[k] == 1 for k in gated | falling)]
    return min(allowed or grids, key=lambda g: (_fullest(scene, g), _cut_area(scene, g), g))


def _thin(wall: Wall) -> list[int]:
    """The axes across a plane, or across a wall that is flat along them."""
    if isinstance(wall, Plane):
        return [k for k in range(3) if wall.normal[k] != 0]
    bounds = wall.bounds()
    extent = np.ones(3) if bounds is None else np.ptp(bounds, axis=0)
    return np.flatnonzero(extent <= FLAT * extent.max()).tolist()


def _fullest(scene: Scene, grid: tuple[int, int, int]) -> int:
    """Particles in the fullest brick at the start."""
    lo, hi, n = np.array(scene.domain.lo), np.array(scene.domain.hi), np.array(grid)
    brick = np.clip(((scene.state.position - lo) / (hi - lo) * n).astype(int), 0, n - 1)
    return int(np.bincount(np.ravel_multi_index(tuple(brick.T), grid)).max())


def _cut_area(scene: Scene, grid: tuple[int, int, int]) -> float:
    """Area of all cuts [m2]: what the ranks have to exchange grows with it."""
    size = np.array(scene.domain.hi) - np.array(scene.domain.lo)
    return float(sum((grid[k] - 1) * np.prod(np.delete(size, k)) for k in range(3)))
