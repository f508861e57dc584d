# pyright: reportInvalidTypeForm=false
"""Walls where they are in a step: from space to the wall's frame and back, velocities of points."""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from gpudem.solver.spec import Spec
from gpudem.solver.state import structs
from gpudem.solver.walls import wall_surface


@functools.cache
def wall_frame(spec: Spec) -> SimpleNamespace:
    """Functions of the wall at place `at` = launch m + w of the tables of poses.

    to_wall(walls, at, x) -> the point in the wall's frame, that of its place at the start.
    to_space(walls, at, direction) -> a direction of the wall's frame in space.
    velocity(walls, at, w, q, normal) -> velocity [m/s] of the wall's point at q in space.
    power(walls, at, force, velocity of the point, rolling torque) -> power [W] of the wall on a particle.
    """
    t = structs(spec.precision)
    Walls, wide, wide3 = t.Walls, t.wide, t.wide3

    @wp.func
    def to_wall(walls: Walls, at: wp.int32, x: wide3):
        if wp.static(spec.turning_walls):
            return wp.transpose(walls.rotation[at]) * (x - walls.displacement[at])
        if wp.static(spec.moving_walls):
            return x - walls.displacement[at]  # mutate: wall_displacement
        return x

    @wp.func
    def to_space(walls: Walls, at: wp.int32, direction: wide3):
        if wp.static(spec.turning_walls):
            return walls.rotation[at] * direction  # mutate: normal_of_turned_wall
        return direction

    @wp.func
    def belt_velocity(walls: Walls, w: wp.int32, normal: wide3):
        """The surface velocity along the surface at this normal, its magnitude kept."""
        stated = walls.surface_velocity[w]
        along = stated - wp.dot(stated, normal) * normal
        size = wp.length(along)
        if size > wide(0.0):
            return (wp.length(stated) / size) * along
        return wide3()

    @wp.func
    def velocity(walls: Walls, at: wp.int32, w: wp.int32, q: wide3, normal: wide3):
        if wp.static(spec.turning_walls):
            turning = wp.cross(walls.spin[at], q - walls.center[at])  # mutate: wall_spin_velocity
            return walls.velocity[at] + turning + belt_velocity(walls, w, normal)
        if wp.static(spec.moving_walls):
            return walls.velocity[w]
        return wide3()

    @wp.func
    def power(walls: Walls, at: wp.int32, force: wide3, velocity: wide3, rolling: wide3):
        """The wall's power on a particle: by the force at a point of this velocity, and by the torque."""
        if wp.static(spec.turning_walls and spec.rotation):
            return wp.dot(force, velocity) - wp.dot(rolling, walls.spin[at])  # mutate: work_of_rolling_torque
        return wp.dot(force, velocity)

    return SimpleNamespace(to_wall=to_wall, to_space=to_space, velocity=velocity, power=power)


@functools.cache
def element_surface(spec: Spec) -> Any:
    """A function of wall w, not a mesh -> (gap [m] of x, normal)."""
    t = structs(spec.precision)
    frame = wall_frame(spec)
    to_wall, to_space = frame.to_wall, frame.to_space
    primitive = wall_surface(spec.walls)

    @wp.func
    def surface(params: t.Params, walls: t.Walls, launch: wp.int32, w: wp.int32, x: t.wide3):
        at = launch * params.walls + w
        gap, normal = primitive(walls, w, to_wall(walls, at, x))
        return gap, to_space(walls, at, normal)

    return surface
