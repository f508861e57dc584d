# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false, reportIndexIssue=false, reportInvalidTypeForm=false, reportOperatorIssue=false, reportOptionalCall=false
"""Kernels of a rebuild: cells, sorted order, list of neighbors and walls with skin, contact history.

Rebuilding: cell of each particle -> stable sort -> particle arrays re-ordered -> entries counted, offsets
summed, list filled from the 27 cells around and from the walls -> history of the contacts found again. All on
the device. Of each particle the list holds first its neighbors, those in contact before the others, then its
walls. It is full (i holds j and j holds i), or half within each block of particles (the first holds the
other) and full across blocks.
"""

import functools
from typing import Any

import warp as wp

from gpudem.solver.arrays import access
from gpudem.solver.body import body_struct
from gpudem.solver.class_grids import grid_functions, grid_struct
from gpudem.solver.geometry import nearest_image
from gpudem.solver.held_particles import held_particles
from gpudem.solver.list_layout import list_places, place_in_slices
from gpudem.solver.mesh_search import mesh_search
from gpudem.solver.reports import (
    DEEP_IN_WALL,
    LOST,
    NO_REPORT,
    NOT_A_NUMBER,
    SLOTS,
    TOO_DEEP,
    TOO_FAST,
    write_report,
)
from gpudem.solver.spec import Spec
from gpudem.solver.state import structs
from gpudem.solver.wall_frames import wall_frame
from gpudem.solver.walls import wall_surface

#: Entries of a particle that the count stores for the fill, at most; a particle with more is searched again.
CACHE_SIZE = 24
#: As many must fit into the memory of a body for the count to store them there.
ENTRIES_IN_BODY = 16


def cache_in_bodies(spec: Spec) -> bool:
    """Whether the memory of the bodies before the sort, free at a rebuild, can be the cache."""
    return wp.types.type_size_in_bytes(body_struct(spec)) // 4 >= ENTRIES_IN_BODY


def cache_size(spec: Spec) -> int:
    """Entries of a particle that the count stores for the fill."""
    words = wp.types.type_size_in_bytes(body_struct(spec)) // 4
    return min(words, CACHE_SIZE) if cache_in_bodies(spec) else CACHE_SIZE


@wp.func
def first_cell(c: wp.int32, n: wp.int32, periodic: wp.int32):
    """First of the cells to visit around c along one axis."""
    if periodic != 0:
        if n < 3:
            return 0
        return c - 1
    return wp.max(c - 1, 0)


@wp.func
def last_cell(c: wp.int32, n: wp.int32, periodic: wp.int32):
    """Last of the cells to visit; may lie outside 0..n-1 where the axis is periodic."""
    if periodic != 0:
        if n < 3:
            return n - 1  # mutate: last_cell_of_two
        return c + 1
    return wp.min(c + 1, n - 1)  # mutate: last_cell


@wp.func
def wrapped_cell(c: wp.int32, n: wp.int32):
    """Cell c, at most one outside 0..n-1, of a periodic axis."""
    if c < 0:
        return c + n
    if c >= n:
        return c - n
    return c


@functools.cache
def periodic_wrap(wide: Any) -> Any:
    """A function (x, lo, hi) -> (x within lo <= x < hi, crossings): 1 through the upper face, -1 the lower.

    Both faces are one place: what is on the upper one, or rounded to it, stands at lo.
    """

    @wp.func
    def wrap(x: wide, lo: wide, hi: wide):
        if x >= hi:
            return wp.max(x - (hi - lo), lo), wp.int32(1)
        if x < lo:
            y = x + (hi - lo)  # mutate: periodic_entry
            if y >= hi:
                return lo, wp.int32(0)
            return y, wp.int32(-1)
        return x, wp.int32(0)

    return wrap


@functools.cache
def cell_kernel(spec: Spec) -> Any:
    """Wraps periodic positions, writes the cell of each particle, reports lost particles and NaN."""
    t = structs(spec.precision)
    Params, Particles, Body, wide3 = t.Params, t.Particles, body_struct(spec), t.wide3
    px, py, pz = spec.periodic
    wrap = periodic_wrap(t.wide)
    Grid, functions = grid_struct(spec.precision), grid_functions(spec)
    key_of, sorted_axes = functions.key_of, functions.sorted_axes

    @wp.kernel(module="unique", enable_backward=False)
    def cells(
        # params
        params: Params,
        begin: wp.int32,
        # in
        grids: wp.array[Grid],
        # in and out
        particles: Particles,
        now: wp.array[Body],
        # out
        key: wp.array[wp.int32],
        order: wp.array[wp.int32],
        status: wp.array[wp.int64],
    ):
        i = begin + wp.tid()
        p = now[i].position
        x, y, z = p[0], p[1], p[2]
        cx, cy, cz = wp.int32(0), wp.int32(0), wp.int32(0)
        if wp.static(px):
            x, cx = wrap(x, params.lo[0], params.hi[0])
        if wp.static(py):
            y, cy = wrap(y, params.lo[1], params.hi[1])
        if wp.static(pz):
            z, cz = wrap(z, params.lo[2], params.hi[2])
        p = wide3(x, y, z)
        if wp.static(px or py or pz):
            now[i].position = p
            particles.image[i] = particles.image[i] + wp.vec3i(cx, cy, cz)  # mutate: periodic_crossings
        slot = i // params.block
        cell = wp.vec3i()
        for a in range(3):
            s = p[a] - params.lo[a]
            if not (p[a] >= params.lo[a] and p[a] <= params.hi[a]):
                what = wp.int32(LOST)
                if s != s:
                    what = wp.int32(NOT_A_NUMBER)
                write_report(status, slot, what, particles.id[i], 0)
                s = t.wide(0.0)
            cell[a] = wp.min(wp.int32(s * params.inv_cell_size[a]), params.cells[a] - 1)
        v = now[i].velocity
        if wp.dot(v, v) > params.speed_limit:  # mutate: too_fast
            write_report(status, slot, wp.int32(TOO_FAST), particles.id[i], 0)
        fast, middle, slow = params.axes[0], params.axes[1], params.axes[2]  # mutate: sort_axes
        key[i] = (cell[slow] * params.cells[middle] + cell[middle]) * params.cells[fast] + cell[fast]
        if wp.static(spec.size_classes):
            key[i] = key_of(grids, sorted_axes(params, p), particles.radius[i])
        order[i] = i

    return cells


@functools.cache
def gather_kernel(spec: Spec) -> Any:
    """Copies the particle arrays into scratch arrays in the new order."""
    t = structs(spec.precision)
    Params, Particles, Body = t.Params, t.Particles, body_struct(spec)

    @wp.kernel(module="unique", enable_backward=False)
    def gather(
        # params
        params: Params,
        begin: wp.int32,
        # in
        order: wp.array[wp.int32],
        now: wp.array[Body],
        particles: Particles,
        # out
        sorted_bodies: wp.array[Body],
        sorted_particles: Particles,
    ):
        i = begin + wp.tid()
        o = order[i]
        sorted_bodies[i] = now[o]
        sorted_particles.x_at_rebuild[i] = now[o].position
        sorted_particles.id[i] = particles.id[o]
        if wp.static(spec.polydisperse):
            sorted_particles.radius[i] = particles.radius[o]  # mutate: radius_at_rebuild
        if wp.static(spec.per_particle_mass):
            sorted_particles.mass[i] = particles.mass[o]  # mutate: mass_at_rebuild
        if wp.static(spec.multi_material):
            sorted_particles.material[i] = particles.material[o]  # mutate: material_at_rebuild
        if wp.static(spec.held):
            sorted_particles.held[i] = particles.held[o]  # mutate: held_at_rebuild
        if wp.static(spec.moved_groups):
            sorted_particles.origin[i] = particles.origin[o]  # mutate: origin_at_rebuild
        if wp.static(any(spec.periodic)):
            sorted_particles.image[i] = particles.image[o]  # mutate: image_at_rebuild

    return gather


#: Consecutive cells whose starts one thread of `cell_starts` writes at most, but for those of one gap.
CELL_GROUP = wp.constant(32)


def cell_start_threads(n: int, cells: int) -> int:
    """Threads of `cell_starts`."""
    return max(n + 1, cells // CELL_GROUP + 1)


@wp.kernel(module="unique", enable_backward=False)
def cell_starts(
    # in
    n: wp.int32,
    cells: wp.int32,
    key: wp.array[wp.int32],
    # out
    start: wp.array[wp.int32],
):
    """First particle whose cell is c or later, for c = 0 .. cells, from the sorted keys.

    Thread i writes those of the cells after the one of particle i - 1, up to the one of particle i. Where
    particles are far apart that may be most of the domain, so of such a gap it writes only what lies in a
    group of cells with one of the two particles. Groups without particles are found by bisection, thread g
    for group g.
    """
    i = wp.tid()
    if i <= n:
        first, last, near = wp.int32(0), wp.int32(0) + cells, wp.int32(0)
        if i < n:
            last = wp.min(key[i], last)
        if i > 0:
            first = wp.min(key[i - 1], wp.int32(0) + cells) + 1
            near = wp.min(((first - 1) // CELL_GROUP + 1) * CELL_GROUP, last + 1)
        for c in range(first, near):
            start[c] = i  # mutate: start_before_gap
        for c in range(wp.max(wp.max(first, near), last // CELL_GROUP * CELL_GROUP), last + 1):
            start[c] = i  # mutate: start_after_gap
    begin = i * CELL_GROUP
    if begin <= cells:
        lo = wp.int32(0)
        hi = wp.int32(0) + n
        while lo < hi:
            mid = (lo + hi) // 2
            if key[mid] < begin:
                lo = mid + 1
            else:
                hi = mid
        empty = lo == n
        if lo < n:
            empty = key[lo] >= begin + CELL_GROUP
        if empty:  # mutate: start_in_gap
            for c in range(begin, wp.min(begin + CELL_GROUP, cells + 1)):
                start[c] = lo


@wp.kernel(module="unique", enable_backward=False)
def check_rebuild(
    # in
    present: wp.int32,
    capacity: wp.int32,
    total: wp.array[wp.int32],
    staying: wp.array[wp.int32],
    status: wp.array[wp.int64],
    # out
    rebuild_pending: wp.array[wp.int32],
):
    """Whether the list may be filled without the host: if not, what follows waits for it."""
    reports = wp.int32(0)
    for k in range(SLOTS):
        if status[k] != wp.int64(NO_REPORT):
            reports += 1
    for k in range(rebuild_pending.shape[0]):
        rebuild_pending[k] = 0
    if staying[0] < present:  # the host lets particles go  # mutate: leaving_in_graph
        reports += 1
    if reports > 0 or total[0] > capacity:  # mutate: list_fits
        rebuild_pending[0] = 1


@functools.cache
def entry_search(spec: Spec) -> Any:
    """A function: where the old list of a particle holds a partner; -1: nowhere.

    `partner` is an old place of a particle, or n + a wall. Only a contact of the last step counts, but for
    walls (`any_wall`), whose entry may hold what a fast floor has risen.
    """
    t = structs(spec.precision)
    get_int, first_of, end_of = access(wp.int32).get, list_places(spec).first, list_places(spec).end

    @wp.func
    def find(particles: t.Particles, at: wp.int32, partner: wp.int32, any_wall: bool):
        found = wp.int32(-1)
        for k in range(first_of(particles, at), end_of(particles, at), wp.static(spec.list_slice)):
            entry = get_int(particles.neighbor, k)
            if entry == -partner - 1 or (any_wall and entry == partner):
                found = wp.int32(0) + k  # a copy: Warp would name the loop's own variable
                break
        return found

    return find


@functools.cache
def wall_entry_search(spec: Spec) -> Any:
    """The `entry_search` of a wall or triangle, in contact or not.

    With meshes, of which a large particle has thousands of entries, by bisection: partners of a list that are
    not particles ascend, and come after the particles.
    """
    t = structs(spec.precision)
    find, get_int = entry_search(spec), access(wp.int32).get
    first_of, length_of = list_places(spec).first, list_places(spec).length

    @wp.func
    def other_of(particles: t.Particles, k: wp.int32):
        entry = get_int(particles.neighbor, k)
        if entry < 0:
            return -entry - 1
        return entry

    @wp.func
    def bisect(particles: t.Particles, at: wp.int32, partner: wp.int32):
        first, length = first_of(particles, at), length_of(particles, at)
        low, high = wp.int32(0), wp.int32(0) + length
        while low < high:
            middle = (low + high) // 2
            if other_of(particles, first + wp.static(spec.list_slice) * middle) < partner:
                low = middle + 1
            else:
                high = middle
        if low < length:
            k = first + wp.static(spec.list_slice) * low  # mutate: wall_by_bisection
            if other_of(particles, k) == partner:
                return k
        return wp.int32(-1)

    @wp.func
    def walk(particles: t.Particles, at: wp.int32, partner: wp.int32):
        return find(particles, at, partner, True)

    return bisect if spec.meshes else walk


@functools.cache
def pair_search(spec: Spec) -> Any:
    """A function: where the old lists hold the contact of two old places, and the sign of its history there.

    -1: nowhere. With several size classes the shorter list is searched first: a large particle has thousands
    of entries, and would search them all for each of its contacts.
    """
    t = structs(spec.precision)
    find, length_of = entry_search(spec), list_places(spec).length

    @wp.func
    def search(particles: t.Particles, o: wp.int32, partner: wp.int32):
        p, q = wp.int32(0) + o, wp.int32(0) + partner
        sign = t.real(1.0)
        if wp.static(spec.size_classes):
            if length_of(particles, q) < length_of(particles, p):
                p, q = wp.int32(0) + partner, wp.int32(0) + o
                sign = t.real(-1.0)  # mutate: sign_in_shorter_list
        k = find(particles, p, q, False)
        if wp.static(spec.half_list):
            if k < 0:
                k = find(particles, q, p, False)
                sign = -sign  # mutate: spring_sign
        return k, sign

    return search


@functools.cache
def overlap_check(spec: Spec) -> Any:
    """A function: reports a pair whose overlap exceeds the guard's limit; `touch`: where laws act."""
    t = structs(spec.precision)
    wide = t.wide

    @wp.func
    def check(
        params: t.Params, particles: t.Particles, i: wp.int32, j: wp.int32, rsq: wide, touch: wide,
        status: wp.array[wp.int64],
    ):  # fmt: skip
        smaller = params.radius
        if wp.static(spec.polydisperse):
            smaller = wp.min(particles.radius[i], particles.radius[j])  # mutate: smaller_radius
        deep = touch - params.range - params.overlap_limit * smaller
        if deep > wide(0.0) and rsq < deep * deep:
            write_report(status, i // params.block, wp.int32(TOO_DEEP), particles.id[i], particles.id[j])

    return check


@functools.cache
def span_search(spec: Spec) -> Any:
    """A function: writes the neighbors of particle i among the sorted particles from begin_j to end_j.

    x: position of i, reach: its radius and the range of the law (of equal spheres: of the pair), block: first
    particle of its block. Returns how many neighbors there are so far, and how many of them are in contact.
    """
    t = structs(spec.precision)
    check_overlap, both_held = overlap_check(spec), held_particles(spec).both
    nearest = nearest_image(spec.periodic, spec.precision)
    get, integers = access(t.wide3).get, access(wp.int32)
    get_int, put_int = integers.get, integers.put

    @wp.func
    def search(
        params: t.Params, particles: t.Particles, i: wp.int32, x: t.wide3, reach: t.wide, block: wp.int32,
        begin_j: wp.int32, end_j: wp.int32, count: wp.int32, touching: wp.int32,
        out: wp.array[wp.int32], base: wp.int32, room: wp.int32, status: wp.array[wp.int64],
    ):  # fmt: skip
        first, neighbors, contacts = wp.int32(0) + begin_j, wp.int32(0) + count, wp.int32(0) + touching
        if wp.static(spec.half_list):
            if first >= block:
                first = wp.max(first, i + 1)  # mutate: span_within_block
        for j in range(first, end_j):
            d = nearest(x - get(particles.x_at_rebuild, j), params.size)  # mutate: image_in_list
            rsq = wp.dot(d, d)
            touch = reach
            if wp.static(spec.polydisperse):
                touch = reach + particles.radius[j]  # mutate: pair_reach
            limit = touch + params.skin  # mutate: list_range
            if rsq < limit * limit and j != i:
                if wp.static(spec.half_list):
                    if j >= block and j < i:  # mutate: pair_within_block
                        continue
                if wp.static(spec.held):
                    if both_held(particles, i, j):  # mutate: pair_of_held
                        continue
                at, entry = wp.int32(0) + neighbors, wp.int32(0) + j
                if rsq < touch * touch:
                    if wp.static(spec.contact_history):
                        entry = -j - 1
                    at = wp.int32(0) + contacts
                    contacts += 1
                    check_overlap(params, particles, i, j, rsq, touch, status)
                if neighbors < room:
                    here = base + wp.static(spec.list_slice) * at
                    put_int(out, base + wp.static(spec.list_slice) * neighbors, get_int(out, here))
                    put_int(out, here, entry)
                neighbors += 1
        return neighbors, contacts

    return search


@functools.cache
def neighbor_search(spec: Spec) -> Any:
    """A function: writes the neighbors of particle i, those in contact first; returns how many there are.

    They go to `out` from `base` on, `spec.list_slice` apart, as many as there is `room` for.
    """
    if spec.size_classes:
        return class_search(spec)
    t = structs(spec.precision)
    Params, Particles, Grid = t.Params, t.Particles, grid_struct(spec.precision)
    get_int, search_span = access(wp.int32).get, span_search(spec)

    @wp.func
    def search(
        params: Params, particles: Particles, grids: wp.array[Grid], cell: wp.int32,
        cell_start: wp.array[wp.int32], i: wp.int32,
        out: wp.array[wp.int32], base: wp.int32, room: wp.int32, status: wp.array[wp.int64],
    ):  # fmt: skip
        x = particles.x_at_rebuild[i]
        reach = params.radius + params.radius + params.range
        if wp.static(spec.polydisperse):
            reach = particles.radius[i] + params.range
        block = wp.int32(0)  # first particle of the block
        if wp.static(spec.half_list):
            block = i // params.block * params.block
        # a, b, c: along the fastest axis of the sorted order, the middle one, the slowest
        around_a, around_b = params.is_periodic[params.axes[0]], params.is_periodic[params.axes[1]]
        around_c = params.is_periodic[params.axes[2]]
        na, nb, nc = params.cells[params.axes[0]], params.cells[params.axes[1]], params.cells[params.axes[2]]
        a, b, c = cell % na, cell // na % nb, cell // (na * nb)
        count, touching = wp.int32(0), wp.int32(0)
        for at_c in range(first_cell(c, nc, around_c), last_cell(c, nc, around_c) + 1):
            for at_b in range(first_cell(b, nb, around_b), last_cell(b, nb, around_b) + 1):
                row = (wrapped_cell(at_c, nc) * nb + wrapped_cell(at_b, nb)) * na  # mutate: cell_row
                # cells along a lie side by side in the sorted order: one span, unless they wrap round
                left, right = first_cell(a, na, around_a), last_cell(a, na, around_a)
                spans = wp.int32(1)
                if left < 0 or right >= na:
                    spans = right - left + 1
                for span in range(spans):
                    begin_cell, end_cell = row + left, row + right + 1
                    if spans > 1:
                        begin_cell = row + wrapped_cell(left + span, na)
                        end_cell = begin_cell + 1
                    count, touching = search_span(
                        params, particles, i, x, reach, block, get_int(cell_start, begin_cell),
                        get_int(cell_start, end_cell), count, touching, out, base, room, status,
                    )  # fmt: skip
        return count

    return search


@functools.cache
def class_search(spec: Spec) -> Any:
    """The `neighbor_search` of several size classes: class by class the cells within reach."""
    t = structs(spec.precision)
    Params, Particles, Grid = t.Params, t.Particles, grid_struct(spec.precision)
    get_int, search_span, functions = access(wp.int32).get, span_search(spec), grid_functions(spec)
    layer_of, covered, sorted_axes = functions.layer, functions.covered, functions.sorted_axes

    @wp.func
    def search(
        params: Params, particles: Particles, grids: wp.array[Grid], cell: wp.int32,
        cell_start: wp.array[wp.int32], i: wp.int32,
        out: wp.array[wp.int32], base: wp.int32, room: wp.int32, status: wp.array[wp.int64],
    ):  # fmt: skip
        x = particles.x_at_rebuild[i]
        reach = particles.radius[i] + params.range
        block = wp.int32(0)  # first particle of the block
        if wp.static(spec.half_list):
            block = i // params.block * params.block
        count, touching = wp.int32(0), wp.int32(0)
        for g in range(grids.shape[0]):
            grid, p = grids[g], sorted_axes(params, x)
            # a, b, c: along the fastest axis of the sorted order, the middle one, the slowest
            na, nb, nc = grid.cells[0], grid.cells[1], grid.cells[2]
            around = reach + grid.radius + params.skin  # mutate: reach_to_class
            left, right = covered(grid, 0, p, around)
            first_b, last_b = covered(grid, 1, p, around)
            first_c, last_c = covered(grid, 2, p, around)
            for at_c in range(first_c, last_c + 1):
                layer = layer_of(grid, wrapped_cell(at_c, nc))
                for at_b in range(first_b, last_b + 1):
                    row = layer + wrapped_cell(at_b, nb) * na
                    # cells along a lie side by side in the sorted order: one span, two where they wrap round
                    spans = wp.int32(1)
                    if left < 0 or right >= na:
                        spans = wp.int32(2)
                    for span in range(spans):
                        begin_cell, end_cell = row + left, row + right + 1
                        if spans == 2:
                            begin_cell, end_cell = row + wrapped_cell(left, na), row + na
                            if span == 1:
                                begin_cell, end_cell = row, row + wrapped_cell(right, na) + 1
                        count, touching = search_span(
                            params, particles, i, x, reach, block, get_int(cell_start, begin_cell),
                            get_int(cell_start, end_cell), count, touching, out, base, room, status,
                        )  # fmt: skip
        return count

    return search


@functools.cache
def wall_search(spec: Spec) -> Any:
    """A function: appends the walls near particle i to its `count` entries; returns the new number.

    A moving wall is looked for once for its whole stroke; under a fast floor a particle stays in its list
    until they part.
    """
    t = structs(spec.precision)
    Params, Particles, Walls = t.Params, t.Particles, t.Walls
    put_int, find = access(wp.int32).put, wall_entry_search(spec)
    is_held = held_particles(spec).one
    surface = wall_surface(spec.walls) if spec.walls else None
    to_wall = wall_frame(spec).to_wall
    mesh_of = mesh_search(spec) if spec.meshes else None

    @wp.func
    def search(
        params: Params, particles: Particles, walls: Walls, i: wp.int32, old: wp.int32, count: wp.int32,
        out: wp.array[wp.int32], base: wp.int32, room: wp.int32, status: wp.array[wp.int64],
    ):  # fmt: skip
        if wp.static(spec.held):
            if is_held(particles, i):  # mutate: walls_of_held
                return count
        x = particles.x_at_rebuild[i]
        radius = params.radius
        if wp.static(spec.polydisperse):
            radius = particles.radius[i]  # mutate: reach_to_walls
        if wp.static(bool(spec.walls)):
            for k in range(walls.present.shape[0]):
                w = walls.present[k]  # mutate: present_wall
                if wp.static(bool(spec.meshes)):
                    if walls.kind[w] < 0:
                        continue
                place = x
                if wp.static(spec.turning_walls):
                    place = to_wall(walls, w, x)
                gap, _normal = surface(walls, w, place)
                within = radius + params.range + params.skin  # mutate: wall_range
                if wp.static(spec.moving_walls):
                    within = within + walls.stroke[w]  # mutate: stroke_in_range
                near = gap < within
                if wp.static(spec.moving_walls):
                    gap, _normal_now = surface(walls, w, to_wall(walls, w, x))
                if wp.static(spec.fast_floors):
                    if walls.fast[w] != 0:
                        at = find(particles, old, params.n + w)
                        if at >= 0 and particles.rise[at] >= t.wide(0.0):
                            gap = gap - particles.rise[at]
                            near = True  # mutate: near_fast_floor
                if near:
                    if gap < radius - params.overlap_limit * radius:  # mutate: deep_in_wall
                        write_report(status, i // params.block, wp.int32(DEEP_IN_WALL), particles.id[i], w)
                    if count < room:
                        put_int(out, base + wp.static(spec.list_slice) * count, params.n + w)
                    count += 1
        if wp.static(bool(spec.meshes)):
            count = mesh_of(params, particles, walls, i, x, radius, count, out, base, room, status)
        return count

    return search


@functools.cache
def count_kernel(spec: Spec) -> Any:
    """Counts the entries of each particle, and stores as many of them as its cache holds."""
    t = structs(spec.precision)
    Params, Particles, Walls = t.Params, t.Particles, t.Walls
    neighbors, Grid = neighbor_search(spec), grid_struct(spec.precision)
    walls_of = wall_search(spec) if spec.has_walls else None
    first_of_equal = place_in_slices(spec.list_slice).first_of_equal
    room = wp.constant(cache_size(spec))

    @wp.kernel(module="unique", enable_backward=False)
    def count_entries(
        # params
        params: Params,
        begin: wp.int32,
        # in
        particles: Particles,
        walls: Walls,
        grids: wp.array[Grid],
        key: wp.array[wp.int32],
        cell_start: wp.array[wp.int32],
        order: wp.array[wp.int32],
        # out
        count: wp.array[wp.int32],
        neighbor_count: wp.array[wp.int32],
        cache: wp.array[wp.int32],
        status: wp.array[wp.int64],
    ):
        i = begin + wp.tid()
        base = first_of_equal(i, room)
        found = neighbors(params, particles, grids, key[i], cell_start, i, cache, base, room, status)
        if wp.static(spec.has_walls):
            neighbor_count[i] = found  # mutate: neighbor_count
            found = walls_of(params, particles, walls, i, order[i], found, cache, base, room, status)
        count[i] = found

    return count_entries


@functools.cache
def fill_kernel(spec: Spec) -> Any:
    """Writes the entries of each particle, and carries the history of its contacts over from the old list."""
    t = structs(spec.precision)
    Params, Particles, Walls, vec3 = t.Params, t.Particles, t.Walls, t.vec3
    neighbors, Grid = neighbor_search(spec), grid_struct(spec.precision)
    find, find_pair = wall_entry_search(spec), pair_search(spec)
    walls_of = wall_search(spec) if spec.has_walls else None
    get_int, put_int = access(wp.int32).get, access(wp.int32).put
    places = place_in_slices(spec.list_slice)
    first_in, first_of_equal = places.first, places.first_of_equal
    cached = wp.constant(cache_size(spec))

    @wp.func
    def carry(
        params: Params, particles: Particles, walls: Walls, order: wp.array[wp.int32], o: wp.int32,
        m: wp.int32, neighbor: wp.array[wp.int32], spring: wp.array[vec3], rolling_torque: wp.array[vec3],
        rise: wp.array[t.wide],
    ):  # fmt: skip
        """The history of the entry at m, of the particle that was at o: a wall, a neighbor now in contact."""
        other = neighbor[m]
        if other >= 0 and other < params.n:
            return
        sign = t.real(1.0)
        if other >= params.n:
            k = find(particles, o, other)  # mutate: wall_entry_at_rebuild
            if wp.static(spec.fast_floors):
                rise[m] = t.wide(-1.0)
                if k >= 0:
                    rise[m] = particles.rise[k]  # mutate: rise_at_rebuild
        else:
            other = -other - 1
            k, sign = find_pair(particles, o, order[other])  # mutate: partner_at_rebuild
        if wp.static(spec.contact_history):
            neighbor[m] = other
            if k >= 0 and get_int(particles.neighbor, k) < 0:
                neighbor[m] = -other - 1
                if wp.static(spec.spring_history):
                    spring[m] = sign * particles.spring[k]  # mutate: spring_at_rebuild
                if wp.static(spec.rolling_history):
                    rolling_torque[m] = sign * particles.rolling_torque[k]  # mutate: rolling_at_rebuild

    @wp.kernel(module="unique", enable_backward=False)
    def fill_entries(
        # params
        params: Params,
        begin: wp.int32,
        # in
        walls: Walls,
        grids: wp.array[Grid],
        key: wp.array[wp.int32],
        cell_start: wp.array[wp.int32],
        order: wp.array[wp.int32],
        start: wp.array[wp.int32],
        count: wp.array[wp.int32],
        neighbor_count: wp.array[wp.int32],
        cache: wp.array[wp.int32],
        # in and out
        particles: Particles,
        # out
        neighbor: wp.array[wp.int32],
        spring: wp.array[vec3],
        rolling_torque: wp.array[vec3],
        rise: wp.array[t.wide],
        status: wp.array[wp.int64],
    ):
        i = begin + wp.tid()
        if get_int(particles.rebuild_pending, 0) != 0:  # the host fills it  # mutate: unfilled_list
            return
        first, room = first_in(start, i), count[i]
        end = first + wp.static(spec.list_slice) * room
        if room <= cached:  # all of them are in the cache: nothing to search
            shift = first_of_equal(i, cached) - first
            for m in range(first, end, wp.static(spec.list_slice)):
                put_int(neighbor, m, get_int(cache, m + shift))
        else:
            found = neighbors(
                params, particles, grids, key[i], cell_start, i, neighbor, first, room, status
            )  # fmt: skip
            if wp.static(spec.has_walls):
                walls_of(params, particles, walls, i, order[i], found, neighbor, first, room, status)
        if wp.static(spec.has_walls):
            particles.wall_start[i] = first + wp.static(spec.list_slice) * neighbor_count[i]
        if wp.static(spec.contact_history or spec.moving_walls):
            for m in range(first, end, wp.static(spec.list_slice)):
                # mutate: history_at_rebuild
                carry(params, particles, walls, order, order[i], m, neighbor, spring, rolling_torque, rise)

    return fill_entries
