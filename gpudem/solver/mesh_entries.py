# pyright: reportInvalidTypeForm=false, reportIndexIssue=false, reportOperatorIssue=false
"""Triangles in the list: what an entry means, where the particle is as its mesh sees it, the surface there.

The entry of triangle e is n + (number of walls) + e. With periodic sides one triangle may be near a particle
in several images (a floor of two triangles spans the domain), so the entry is n + (number of walls) +
images e + image, with three images to each periodic direction. The image says by how many sides the particle
is shifted, counted from its place without wrapping and modulo 3: then neither wrapping at a rebuild nor a
mesh that moves on through the sides changes the entry of a contact.
"""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from gpudem.solver.arrays import access
from gpudem.solver.spec import Spec
from gpudem.solver.state import structs
from gpudem.solver.wall_frames import wall_frame
from gpudem.walls.triangle import CORNER, FACE, nearest_of_triangle

#: LIGGGHTS counts a place as one of the face up to barycentric coordinates of minus this length [m], divided
#: by the distance of the farthest corner from the centroid; measured (tests/reference/test_walls.py).
FACE_MARGIN = 5e-9
#: Rounding of a gap, as a share of it.
BEYOND_EDGE = {"float64": 2.0**-51, "mixed": 2.0**-51, "float32": 2.0**-22}


@wp.func
def modulo_3(a: wp.int32):
    """0, 1 or 2, of negative numbers too."""
    return ((a % 3) + 3) % 3


@functools.cache
def mesh_entry(spec: Spec) -> SimpleNamespace:
    """Functions of the entries of triangles; a code is an entry less n and the number of walls.

    code(params, particles, k) -> that of entry k of the list; negative for anything but a triangle.
    triangle(code) -> its triangle.
    coded(particles, i, e, sides) -> the code of triangle e for particle i shifted by so many sides.
    shifted(params, walls, particles, i, at, code, x) -> x shifted to the image that the code means [m].
    """
    t = structs(spec.precision)
    Params, Particles, Walls, wide, wide3 = t.Params, t.Particles, t.Walls, t.wide, t.wide3
    get_int, frame = access(wp.int32).get, wall_frame(spec)
    to_space, images, periodic = frame.to_space, spec.mesh_images, spec.periodic

    @wp.func
    def code(params: Params, particles: Particles, k: wp.int32):
        entry = get_int(particles.neighbor, k)
        if entry < 0:
            entry = -entry - 1
        return entry - params.n - params.walls

    @wp.func
    def triangle(code: wp.int32):
        if wp.static(images > 1):
            return code // wp.static(images)
        return code

    @wp.func
    def coded(particles: Particles, i: wp.int32, e: wp.int32, sides: wp.vec3i):
        code = wp.int32(0) + e
        if wp.static(periodic[0]):
            code = 3 * code + modulo_3(sides[0] - particles.image[i][0])
        if wp.static(periodic[1]):
            code = 3 * code + modulo_3(sides[1] - particles.image[i][1])  # mutate: image_of_entry
        if wp.static(periodic[2]):
            code = 3 * code + modulo_3(sides[2] - particles.image[i][2])
        return code

    @wp.func
    def sides_of(away: wide, digit: wp.int32, crossings: wp.int32):
        """The number nearest to `away` [sides] that leaves digit + crossings when divided by 3."""
        nearest = wp.int32(wp.floor(away + wide(0.5)))
        return nearest + modulo_3(digit + crossings - nearest + 1) - 1  # mutate: sides_of_entry

    @wp.func
    def shifted(
        params: Params, walls: Walls, particles: Particles, i: wp.int32, at: wp.int32, code: wp.int32,
        x: wide3,
    ):  # fmt: skip
        if wp.static(any(periodic)):
            middle = to_space(walls, at, walls.middle[triangle(code)])
            if wp.static(spec.moving_walls):
                middle = middle + walls.displacement[at]
            rest = code % wp.static(images)
            image = particles.image[i]
            sx, sy, sz = wide(0.0), wide(0.0), wide(0.0)
            if wp.static(periodic[2]):
                sz = wide(sides_of((middle[2] - x[2]) / params.size[2], rest % 3, image[2]))
                rest = rest // 3
            if wp.static(periodic[1]):
                sy = wide(sides_of((middle[1] - x[1]) / params.size[1], rest % 3, image[1]))
                rest = rest // 3
            if wp.static(periodic[0]):
                sx = wide(sides_of((middle[0] - x[0]) / params.size[0], rest % 3, image[0]))
            return x + wide3(sx * params.size[0], sy * params.size[1], sz * params.size[2])
        return x

    return SimpleNamespace(code=code, triangle=triangle, coded=coded, shifted=shifted)


@functools.cache
def triangle_surface(spec: Spec) -> Any:
    """A function of triangle e and a place in the frame of its mesh -> (gap [m], normal there, feature).

    LIGGGHTS' rule has no contact at an edge within a plane: there a point beyond it by rounding, or within
    its margin (`FACE_MARGIN`), is one of the face; beyond an obtuse corner the contact may be at the corner,
    though an edge is nearer (`corner_beyond`).
    """
    t, within_margin = structs(spec.precision), face_with_margin(spec.precision)
    beyond_corner = corner_beyond(spec.precision)
    Walls, wide, wide3, beyond = t.Walls, t.wide, t.wide3, BEYOND_EDGE[spec.precision]

    @wp.func
    def surface(walls: Walls, e: wp.int32, place: wide3):
        a = walls.corners[3 * e]
        q, feature = nearest_of_triangle(place, a, walls.corners[3 * e + 1], walls.corners[3 * e + 2])
        facing = walls.facing[e]
        if feature == FACE:
            height = wp.dot(facing, place - a)
            if height < wide(0.0):
                return -height, -facing, feature
            return height, facing, feature
        d = place - q
        gap = wp.length(d)
        if wp.static(spec.meshes == "liggghts"):
            height = wp.dot(facing, place - a)
            if gap - wp.abs(height) <= wide(beyond) * gap or within_margin(walls, e, place):
                return wp.abs(height), wp.sign(height) * facing, wp.int32(FACE)
            corner = beyond_corner(walls, e, place)
            if corner >= 0:
                feature = wp.int32(CORNER) + corner
                d = place - walls.corners[3 * e + corner]  # mutate: contact_at_the_corner
                gap = wp.length(d)
        if gap > wide(0.0):
            return gap, d / gap, feature
        return gap, facing, feature

    return surface


@functools.cache
def face_with_margin(precision: str) -> Any:
    """A function: whether a place lies over triangle e, or beyond its edges by LIGGGHTS' margin."""
    t = structs(precision)
    wide = t.wide

    @wp.func
    def within(walls: t.Walls, e: wp.int32, place: t.wide3):
        a, b, c = walls.corners[3 * e], walls.corners[3 * e + 1], walls.corners[3 * e + 2]
        facing, middle = walls.facing[e], (a + b + c) / wide(3.0)
        farthest = wp.max(wp.length(a - middle), wp.max(wp.length(b - middle), wp.length(c - middle)))
        area = wp.dot(wp.cross(b - a, c - a), facing)
        least = -(wide(FACE_MARGIN) / farthest) * area  # mutate: face_margin
        over_ab = wp.dot(wp.cross(b - a, place - a), facing)
        over_bc = wp.dot(wp.cross(c - b, place - b), facing)
        over_ca = wp.dot(wp.cross(a - c, place - c), facing)
        return over_ab >= least and over_bc >= least and over_ca >= least

    return within


@functools.cache
def corner_beyond(precision: str) -> Any:
    """A function: the corner at which LIGGGHTS has the contact whatever is nearest, 0 or 1; -1 for none.

    So where the barycentric coordinates of the other two corners are negative: at an obtuse corner an edge is
    nearer over a part of that region. At the third corner of a triangle the nearest point counts. Measured
    about meshes of obtuse triangles (tests/reference/test_walls.py).
    """
    t = structs(precision)

    @wp.func
    def corner_of(walls: t.Walls, e: wp.int32, place: t.wide3):
        a, b, c = walls.corners[3 * e], walls.corners[3 * e + 1], walls.corners[3 * e + 2]
        facing, zero = walls.facing[e], t.wide(0.0)
        over_ab = wp.dot(wp.cross(b - a, place - a), facing)
        over_bc = wp.dot(wp.cross(c - b, place - b), facing)
        over_ca = wp.dot(wp.cross(a - c, place - c), facing)
        if over_ab < zero and over_ca < zero:
            return wp.int32(0)
        if over_ab < zero and over_bc < zero:
            return wp.int32(1)
        return wp.int32(-1)

    return corner_of


@functools.cache
def triangle_reach(precision: str) -> Any:
    """A function: whether triangle e may be nearer than `limit` to a place in the frame of its mesh.

    False only where it is not: by a sphere around the triangle, then by its plane. Most triangles of a list
    are not in reach, and this is a fraction of the work for the nearest point.
    """
    t = structs(precision)
    Walls, wide, wide3 = t.Walls, t.wide, t.wide3

    @wp.func
    def may_reach(walls: Walls, e: wp.int32, place: wide3, limit: wide):
        d = place - walls.middle[e]
        around = limit + walls.extent[e]  # mutate: sphere_of_triangle
        if wp.dot(d, d) > around * around:
            return False
        # a tenth of the limit covers the rounding of a long triangle's plane in float32
        return wp.abs(wp.dot(walls.facing[e], d)) <= wide(1.1) * limit

    return may_reach
