# pyright: reportInvalidTypeForm=false
"""Walls on the device: their table, their surface as one function, and how far a fast floor has risen."""

import functools
from typing import Any

import numpy as np
import warp as wp

from gpudem.scene import Scene
from gpudem.scene.walls import Wall
from gpudem.solver.state import State, structs
from gpudem.walls import registry


@functools.cache
def wall_surface(kinds: tuple[str, ...]) -> Any:
    """A function (walls, w, x) -> (gap [m], normal) over the kinds that a scene has; one kind: no branch."""
    first = registry.kind(kinds[0]).surface
    if len(kinds) == 1:
        return first
    return _chain(kinds, 0)


def _chain(kinds: tuple[str, ...], index: int) -> Any:
    here = registry.kind(kinds[index]).surface
    if index == len(kinds) - 1:
        return here
    rest = _chain(kinds, index + 1)

    @wp.func
    def surface(walls: Any, w: wp.int32, x: Any):
        if walls.kind[w] == wp.static(index):
            return here(walls, w, x)
        return rest(walls, w, x)

    return surface


@wp.func
def risen(rise: Any, overlap: Any, velocity: Any, speed: Any, dt: Any):
    """How far a fast floor has risen under a particle since their contact began [m]; -1 apart.

    Args:
        rise: A step ago, likewise.
        overlap: With the floor at rest [m].
        velocity: Of the particle along the normal in the step that led here [m/s].
        speed: U of the floor [m/s].
        dt: Time step [s]; 0 at set-up. If the contact began within it, the floor has moved since then.
    """
    if rise >= type(rise)(0.0):
        rise = rise + speed * dt  # mutate: floor_rise
    elif overlap >= type(rise)(0.0):
        since = dt
        if overlap < -velocity * dt:
            since = overlap / -velocity  # mutate: time_since_touch
        rise = speed * since
    return rise


@functools.cache
def fast_floor_gap(precision: str) -> Any:
    """A function of list entry k at wall w -> the gap [m] where the fast floor is now.

    dt [s] is 0 at set-up; else how far it has risen is stored in the entry, or -1 when they part: it snaps
    back. Other walls: the gap as it is.
    """
    t = structs(precision)
    wide, wide3 = t.wide, t.wide3

    @wp.func
    def gap_now(
        params: t.Params, walls: t.Walls, particles: t.Particles, k: wp.int32, w: wp.int32,
        gap: wide, normal: wide3, radius: wide, v: wide3, dt: t.real,
    ):  # fmt: skip
        if walls.fast[w] == 0:
            return gap
        elapsed = params.dt_wide
        if dt == t.real(0.0):
            elapsed = wide(0.0)
        speed = wp.dot(walls.velocity[w], normal)
        rise = risen(particles.rise[k], radius - gap, wp.dot(v, normal), speed, elapsed)
        left = gap - wp.max(rise, wide(0.0))
        if dt > t.real(0.0):
            if left > radius:
                rise = wide(-1.0)  # mutate: floor_snaps_back
            particles.rise[k] = rise
        return left

    return gap_now


def wall_table(state: State, scene: Scene, chunk: int, present: list[Wall], phase: Scene) -> Any:
    """The struct `Walls` of a scene in a phase; only those `present` get into contact."""
    elements, device, t = scene.wall_elements, state.device, state.types
    walls = t.Walls()
    if not elements:
        return walls
    names = {wall.name for wall in present}
    here = [w for w, wall in enumerate(elements) if wall.name in names]  # mutate: walls_present

    def table(values: Any, dtype: Any) -> Any:
        return wp.array(np.asarray(values), dtype=dtype, device=device)

    walls.present = table(np.array(here, np.int32), wp.int32)
    if len(state.spec.walls) > 1 or state.spec.meshes:
        kinds = [-1 if wall.kind == "mesh" else state.spec.walls.index(wall.kind) for wall in elements]
        walls.kind = table(np.array(kinds, np.int32), wp.int32)
    if state.spec.wall_laws:
        own, number = scene.wall_laws, {names: k for k, names in enumerate(state.spec.wall_laws, 1)}
        laws = [number[own[wall.name]] if wall.name in own else 0 for wall in elements]
        walls.law = table(np.array(laws, np.int32), wp.int32)
    for name, column in zip(
        ("direction", "point", "size"), zip(*(wall.shape() for wall in elements), strict=True), strict=True
    ):
        setattr(walls, name, table(np.array(column, float), t.wide3))
    m = len(elements)
    if state.spec.moving_walls:
        walls.displacement = table(np.zeros((m * chunk, 3)), t.wide3)
        velocity = np.array([wall.velocity for wall in elements])
        walls.velocity = table(np.tile(velocity, (chunk if state.spec.turning_walls else 1, 1)), t.wide3)
        rows = np.cumsum([wall.name in scene.moving_walls for wall in elements]) - 1
        walls.work_row = table(np.maximum(rows, 0).astype(np.int32), wp.int32)
        walls.stroke = table([wall.stroke for wall in elements], t.wide)
    if state.spec.fast_floors:
        walls.fast = table(np.array([wall.fast_floor for wall in elements], np.int32), wp.int32)
    if state.spec.turning_walls:
        walls.rotation = table(np.tile(np.eye(3), (m * chunk, 1, 1)), wp.types.matrix((3, 3), t.wide))
        walls.spin = table(np.zeros((m * chunk, 3)), t.wide3)
        walls.center = table(np.zeros((m * chunk, 3)), t.wide3)
        belts = [wall.surface_velocity or (0.0, 0.0, 0.0) for wall in phase.wall_elements]
        walls.surface_velocity = table(belts, t.wide3)
    return walls
