"""Walls: geometry and motion of each kind, and their device table; with `removed_at`, a gate."""

from __future__ import annotations

import functools
import itertools
from typing import Any

import numpy as np
import warp as wp

from gpudem.contact.coefficients import pair_coefficients
from gpudem.scene import Plane, Scene
from gpudem.solver.state import State, structs

#: Bits of one int32 mark which planes a particle touches.
MAX_PLANES = 31


@wp.func
def plane_distance(position: Any, normal: Any, offset: Any):
    """Distance [m] of a point from a plane, positive on the side the normal points to."""
    return wp.dot(normal, position) - offset


@wp.func
def risen(rise: Any, overlap: Any, velocity: Any, speed: Any, dt: Any):
    """How far a fast floor has risen under a particle since they touched [m]; -1 apart.

    Args:
        rise: A step ago, likewise.
        overlap: With the floor at rest [m].
        velocity: Of the particle along the normal in the step that led here [m/s].
        speed: U of the floor [m/s].
        dt: Time step [s]; 0 at set-up. Who touched within it finds a floor that has moved since the touch.
    """
    if rise >= type(rise)(0.0):
        rise = rise + speed * dt
    elif overlap >= type(rise)(0.0):
        since = dt
        if overlap < -velocity * dt:
            since = overlap / -velocity
        rise = speed * since
    return rise


@functools.cache
def distance_now(precision: str) -> Any:
    """A function of a particle and a plane k -> its distance from where the plane is now [m].

    `at` is where wall_shift holds a saw-tooth's place, `distance` that from the plane at rest, dt [s] 0 at
    set-up; else what a fast floor has risen is kept, or forgotten where they part: it snaps back.
    """
    t = structs(precision, True)
    wide = t.wide

    @wp.func
    def moved(
        params: t.Params, walls: t.Walls, particles: t.Particles, i: wp.int32, k: wp.int32, at: wp.int32,
        distance: wide, radius: wide, velocity: wide, dt: t.real,
    ):  # fmt: skip
        floor = walls.floor[k]
        if floor < 0:
            return distance - particles.wall_shift[at]
        slot = floor * params.n + i
        elapsed = params.drift
        if dt == t.real(0.0):
            elapsed = wide(0.0)
        rise = risen(particles.wall_rise[slot], radius - distance, velocity, walls.speed[k], elapsed)
        left = distance - wp.max(rise, wide(0.0))
        if dt > t.real(0.0):
            if left > radius:
                rise = wide(-1.0)
            particles.wall_rise[slot] = rise
        return left

    return moved


def pair_entries(state: State, scene: Scene, partners: list[str]) -> list[Any]:
    """Structs `Pair`, by (partner, particle material)."""
    table = []
    for partner in partners:
        for name in scene.particle_materials:
            c = pair_coefficients(scene, name, partner)
            entry = state.types.Pair()
            for field, value in vars(c).items():
                setattr(entry, field, value)
            table.append(entry)
    return table


def pair_table(state: State, scene: Scene, partners: list[str]) -> wp.array:
    """`pair_entries` as a device array."""
    return wp.array(pair_entries(state, scene, partners), dtype=state.types.Pair, device=state.device)


def wall_table(state: State, scene: Scene, present: list[Plane]) -> Any:
    """The planes of a scene as device arrays; one that is not present lies infinitely far away.

    Raises ValueError for more planes than MAX_PLANES.
    """
    planes = scene.planes
    if len(planes) > MAX_PLANES:
        raise ValueError(f"walls: {len(planes)} planes; at most {MAX_PLANES}")
    walls = state.types.Walls()
    if not planes:
        return walls
    names = {p.name for p in present}
    normals = np.array([p.normal for p in planes])
    offsets = np.einsum("ij,ij->i", normals, np.array([p.point for p in planes]))
    offsets[[p.name not in names for p in planes]] = -1e30
    walls.normal = wp.array(normals, dtype=state.types.wide3, device=state.device)
    walls.offset = wp.array(offsets, dtype=state.types.wide, device=state.device)
    walls.pairs = pair_table(state, scene, [p.material for p in planes])
    if state.spec.vibration:
        strokes = [p.vibration.amplitude if p.vibration else 0.0 for p in planes]
        count = itertools.count()
        floors = [next(count) if p.fast_floor else -1 for p in planes]
        walls.speed = wp.array([p.speed for p in planes], dtype=state.types.wide, device=state.device)
        walls.stroke = wp.array(strokes, dtype=state.types.wide, device=state.device)
        walls.floor = wp.array(floors, dtype=wp.int32, device=state.device)
    return walls
