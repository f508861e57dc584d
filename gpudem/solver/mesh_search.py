# pyright: reportArgumentType=false, reportCallIssue=false, reportIndexIssue=false, reportInvalidTypeForm=false, reportOperatorIssue=false
"""The search for the triangles near a particle, at a rebuild of the list."""

import functools
from typing import Any

import warp as wp

from gpudem.solver.arrays import access
from gpudem.solver.mesh_entries import mesh_entry, triangle_surface
from gpudem.solver.reports import DEEP_IN_WALL, write_report
from gpudem.solver.spec import Spec
from gpudem.solver.state import structs
from gpudem.solver.wall_frames import wall_frame

get_entry, put_entry = access(wp.int32).get, access(wp.int32).put


@functools.cache
def sort_entries(distance: int) -> Any:
    """A function: puts entries from place `begin` on, so far distance, in ascending order.

    Shell's sort: of few entries it is insertion, of thousands near n log n.
    """

    @wp.func
    def sort(out: wp.array[wp.int32], begin: wp.int32, count: wp.int32):
        stride, end = wp.int32(distance), begin + wp.static(distance) * count
        while 3 * stride + wp.static(distance) < end - begin:
            stride = 3 * stride + wp.static(distance)
        while stride > 0:
            for k in range(begin + stride, end, wp.static(distance)):
                entry, at = get_entry(out, k), wp.int32(0) + k
                while at >= begin + stride:
                    before = get_entry(out, at - stride)
                    if before <= entry:  # mutate: entries_ascend
                        break
                    put_entry(out, at, before)
                    at -= stride
                put_entry(out, at, entry)
            stride = stride // wp.static(3 * distance) * wp.static(distance)

    return sort


@functools.cache
def image_range(spec: Spec) -> Any:
    """A function (params, walls, w, x, within, axis) -> (first, last) shift [sides] of x that may be near
    mesh w.
    """
    t = structs(spec.precision)
    wide, to_space = t.wide, wall_frame(spec).to_space

    @wp.func
    def shifts(
        params: t.Params, walls: t.Walls, w: wp.int32, x: t.wide3, within: wide, axis: wp.int32
    ):  # fmt: skip
        if wp.static(any(spec.periodic)):
            if params.is_periodic[axis] != 0:
                center = to_space(walls, w, walls.mesh_center[w])
                if wp.static(spec.moving_walls):
                    center = center + walls.displacement[w]
                around = walls.mesh_radius[w] + within
                away, side = center[axis] - x[axis], params.size[axis]
                first = wp.int32(wp.ceil((away - around) / side))
                return first, wp.int32(wp.floor((away + around) / side))
        return wp.int32(0), wp.int32(0)

    return shifts


@functools.cache
def mesh_search(spec: Spec) -> Any:
    """A function: appends the triangles near particle i to its `count` entries, in ascending order.

    Of a mesh that moves, where it is in the first launch; `WallMotion` says how long that holds.
    """
    t = structs(spec.precision)
    Params, Particles, Walls, wide, wide3 = t.Params, t.Particles, t.Walls, t.wide, t.wide3
    triangle, sort = triangle_surface(spec), sort_entries(spec.list_slice)
    to_wall, coded, shifts = wall_frame(spec).to_wall, mesh_entry(spec).coded, image_range(spec)

    @wp.func
    def search_image(
        params: Params, particles: Particles, walls: Walls, w: wp.int32, i: wp.int32, x: wide3,
        sides: wp.vec3i, radius: wide, within: wide, found: wp.int32,
        out: wp.array[wp.int32], base: wp.int32, room: wp.int32, status: wp.array[wp.int64],
    ):  # fmt: skip
        """Triangles of mesh w near x, shifted by so many sides."""
        count = wp.int32(0) + found
        shift = wide3(wide(sides[0]), wide(sides[1]), wide(sides[2]))
        place = to_wall(walls, w, x + wp.cw_mul(shift, params.size))
        center = wp.vec3(wp.float32(place[0]), wp.float32(place[1]), wp.float32(place[2]))
        slack = wp.float32(within) * wp.float32(1.00001) + wp.float32(1.0e-6) * wp.length(center)
        half = wp.vec3(slack, slack, slack)
        query = wp.bvh_query_aabb(walls.bvh[w], center - half, center + half)
        local = wp.int32(0)
        while wp.bvh_query_next(query, local):
            e = walls.first_triangle[w] + local
            gap, _normal, _feature = triangle(walls, e, place)
            if gap < within:
                if gap < radius - params.overlap_limit * radius:  # mutate: deep_in_mesh
                    write_report(status, i // params.block, wp.int32(DEEP_IN_WALL), particles.id[i], w)
                if count < room:
                    put_entry(
                        out,
                        base + wp.static(spec.list_slice) * count,
                        params.n + params.walls + coded(particles, i, e, sides),
                    )
                count += 1
        return count

    @wp.func
    def search(
        params: Params, particles: Particles, walls: Walls, i: wp.int32, x: wide3, radius: wide,
        found: wp.int32, out: wp.array[wp.int32], base: wp.int32, room: wp.int32, status: wp.array[wp.int64],
    ):  # fmt: skip
        count = wp.int32(0) + found
        within = radius + params.range + params.skin  # mutate: triangle_range
        for k in range(walls.present.shape[0]):
            w = walls.present[k]
            if walls.kind[w] >= 0:
                continue
            first_x, last_x = shifts(params, walls, w, x, within, 0)
            first_y, last_y = shifts(params, walls, w, x, within, 1)
            first_z, last_z = shifts(params, walls, w, x, within, 2)
            for sx in range(first_x, last_x + 1):
                for sy in range(first_y, last_y + 1):
                    for sz in range(first_z, last_z + 1):
                        count = search_image(
                            params, particles, walls, w, i, x, wp.vec3i(sx, sy, sz), radius, within, count,
                            out, base, room, status,
                        )  # fmt: skip
        if count <= room:  # else it is searched for again, with room
            sort(out, base + wp.static(spec.list_slice) * found, count - found)
        return count

    return search
