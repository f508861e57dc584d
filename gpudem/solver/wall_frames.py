# pyright: reportInvalidTypeForm=false
"""Walls where they are in a step: from space to the wall's frame and back, velocities of points."""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from gpudem.solver.geometry import nearest_image
from gpudem.solver.spec import Spec
from gpudem.solver.state import structs
from gpudem.solver.walls import wall_surface
from gpudem.walls.triangle import FACE, nearest_of_triangle


@functools.cache
def wall_frame(spec: Spec) -> SimpleNamespace:
    """Functions of the wall at place `at` = launch m + w of the tables of poses.

    to_wall(walls, at, x) -> the point in the wall's frame, that of its place at the start.
    to_space(walls, at, direction) -> a direction of the wall's frame in space.
    velocity(walls, at, w, q, normal) -> velocity [m/s] of the wall's point at q in space.
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

    return SimpleNamespace(to_wall=to_wall, to_space=to_space, velocity=velocity)


@functools.cache
def triangle_surface(spec: Spec) -> Any:
    """A function of triangle k of a mesh at place `at` -> (gap [m] of x, normal towards x, feature)."""
    t = structs(spec.precision)
    Params, Walls, wide, wide3 = t.Params, t.Walls, t.wide, t.wide3
    frame, nearest = wall_frame(spec), nearest_image(spec.periodic, spec.precision)
    to_wall, to_space = frame.to_wall, frame.to_space

    @wp.func
    def place_of(params: Params, walls: Walls, at: wp.int32, k: wp.int32, x: wide3):
        """x, or its periodic image nearest to the triangle, in the wall's frame."""
        if wp.static(any(spec.periodic)):
            middle = (walls.corners[3 * k] + walls.corners[3 * k + 1] + walls.corners[3 * k + 2]) / wide(3.0)
            here = to_space(walls, at, middle)
            if wp.static(spec.moving_walls):
                here = here + walls.displacement[at]
            return to_wall(walls, at, here + nearest(x - here, params.size))
        return to_wall(walls, at, x)

    @wp.func
    def surface(params: Params, walls: Walls, at: wp.int32, k: wp.int32, x: wide3):
        place = place_of(params, walls, at, k, x)
        a = walls.corners[3 * k]
        q, feature = nearest_of_triangle(place, a, walls.corners[3 * k + 1], walls.corners[3 * k + 2])
        facing = walls.facing[k]
        height = wp.dot(facing, place - a)
        if feature == FACE:
            if height < wide(0.0):
                return -height, to_space(walls, at, -facing), feature
            return height, to_space(walls, at, facing), feature
        d = place - q
        gap = wp.length(d)
        if gap > wide(0.0):
            return gap, to_space(walls, at, d / gap), feature
        return gap, to_space(walls, at, facing), feature

    return surface


@functools.cache
def element_surface(spec: Spec) -> Any:
    """A function of element e, a wall or, from m on, a triangle -> (its wall, gap [m] of x, normal)."""
    t = structs(spec.precision)
    Params, Walls, wide3 = t.Params, t.Walls, t.wide3
    frame = wall_frame(spec)
    to_wall, to_space = frame.to_wall, frame.to_space
    primitive = wall_surface(spec.walls) if spec.walls else None
    triangle = triangle_surface(spec) if spec.meshes else None

    @wp.func
    def surface(params: Params, walls: Walls, launch: wp.int32, e: wp.int32, x: wide3):
        if wp.static(bool(spec.meshes)):
            if e >= params.walls:
                k = e - params.walls
                w = walls.triangle_wall[k]
                gap, normal, _feature = triangle(params, walls, launch * params.walls + w, k, x)
                return w, gap, normal
        if wp.static(bool(spec.walls)):
            at = launch * params.walls + e
            gap, normal = primitive(walls, e, to_wall(walls, at, x))
            return e, gap, to_space(walls, at, normal)
        return e, type(x[0])(1.0e30), x

    return surface
