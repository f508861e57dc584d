"""Cells, sorted order, neighbour list with skin, shear springs carried over, overflow and lost particles.

Rebuilding: cell of each particle -> stable sort -> particle arrays re-ordered -> neighbours counted, offsets
summed, list filled from the 27 cells around -> springs of touching pairs found again. All on the device.
The list is compact, touching pairs first; full (i holds j and j holds i), or half within each block of
particles (the first holds the other) and full across blocks.
"""

import functools
from typing import Any

import warp as wp

from gpudem.solver.arrays import access
from gpudem.solver.body import body_struct
from gpudem.solver.geometry import nearest_image
from gpudem.solver.spec import Spec
from gpudem.solver.state import structs
from gpudem.solver.wall_table import plane_distance

#: Neighbours of a particle that the count remembers for the fill; one with more is searched again.
HITS = wp.constant(24)
#: What `status[0]` says; status[1] is the particle's row in the scene, status[2] its partner's or the plane.
OK, LOST, NOT_A_NUMBER, TOO_FAST, TOO_DEEP, DEEP_IN_WALL = 0, 1, 2, 3, 4, 5


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
            return n - 1
        return c + 1
    return wp.min(c + 1, n - 1)


@wp.func
def wrapped(c: wp.int32, n: wp.int32):
    """Cell c, at most one outside 0..n-1, of a periodic axis."""
    if c < 0:
        return c + n
    if c >= n:
        return c - n
    return c


@functools.cache
def cell_kernel(spec: Spec) -> Any:
    """Wraps periodic positions, writes the cell of each particle, reports lost particles and NaN."""
    t = structs(spec.precision, spec.vibration)
    wide3 = t.wide3
    Params, Particles = t.Params, t.Particles
    Body = body_struct(spec)
    px, py, pz = spec.periodic

    @wp.func
    def wrap(x: t.wide, lo: t.wide, size: t.wide):
        if x < lo:
            x = x + size
        elif x >= lo + size:
            x = x - size
        return x

    @wp.kernel(module="unique", enable_backward=False)
    def cells(
        # params
        params: Params,
        begin: wp.int32,
        # in
        particles: Particles,
        # in and out
        now: wp.array[Body],
        # out
        key: wp.array[wp.int32],
        order: wp.array[wp.int32],
        status: wp.array[wp.int32],
    ):
        i = begin + wp.tid()
        p = now[i].position
        x, y, z = p[0], p[1], p[2]
        if wp.static(px):
            x = wrap(x, params.lo[0], params.size[0])
        if wp.static(py):
            y = wrap(y, params.lo[1], params.size[1])
        if wp.static(pz):
            z = wrap(z, params.lo[2], params.size[2])
        p = wide3(x, y, z)
        now[i].position = p
        cell = wp.vec3i()
        for a in range(3):
            s = p[a] - params.lo[a]
            if not (s >= t.wide(0.0) and s <= params.size[a]):
                code = wp.int32(LOST)
                if s != s:
                    code = wp.int32(NOT_A_NUMBER)
                status[1] = particles.id[i]
                status[0] = code
                s = t.wide(0.0)
            cell[a] = wp.min(wp.int32(s * params.cell_rate[a]), params.cells[a] - 1)
        v = now[i].velocity
        if wp.dot(v, v) > params.speed_limit:
            status[1] = particles.id[i]
            status[0] = wp.int32(TOO_FAST)
        fast, middle, slow = params.axes[0], params.axes[1], params.axes[2]
        key[i] = (cell[slow] * params.cells[middle] + cell[middle]) * params.cells[fast] + cell[fast]
        order[i] = i

    return cells


@functools.cache
def gather_kernel(spec: Spec) -> Any:
    """Copies the particle arrays into scratch arrays in the new order; marks the planes near a particle."""
    t = structs(spec.precision, spec.vibration)
    Params, Particles, Walls = t.Params, t.Particles, t.Walls
    Body = body_struct(spec)
    walls_with_memory = spec.walls and spec.memory

    @wp.kernel(module="unique", enable_backward=False)
    def gather(
        # params
        params: Params,
        begin: wp.int32,
        # in
        order: wp.array[wp.int32],
        walls: Walls,
        now: wp.array[Body],
        particles: Particles,
        # out
        moved: wp.array[Body],
        moved_particles: Particles,
        status: wp.array[wp.int32],
    ):
        i = begin + wp.tid()
        o = order[i]
        moved[i] = now[o]
        moved_particles.built_at[i] = now[o].position
        moved_particles.id[i] = particles.id[o]
        if wp.static(spec.several_radii):
            moved_particles.radius[i] = particles.radius[o]
        if wp.static(spec.several_masses):
            moved_particles.mass[i] = particles.mass[o]
        if wp.static(spec.several_materials):
            moved_particles.material[i] = particles.material[o]
        if wp.static(spec.walls):
            reach = params.radius
            if wp.static(spec.several_radii):
                reach = particles.radius[o]
            near = wp.int32(0)
            for k in range(params.planes):
                distance = plane_distance(now[o].position, walls.normal[k], walls.offset[k])
                within = reach + params.skin
                if wp.static(spec.vibration):
                    floor = walls.floor[k]
                    if floor < 0:  # found now, and until the next rebuild wherever in its stroke
                        distance = distance - particles.wall_shift[k]
                        within = within + (walls.stroke[k] - particles.wall_shift[k])
                    else:
                        rise = particles.wall_rise[floor * params.n + o]
                        moved_particles.wall_rise[floor * params.n + i] = rise
                        if rise >= t.wide(0.0):
                            distance = distance - rise
                            within = wp.max(within, distance + params.skin)  # until they part
                if distance < within:
                    near = near | (1 << k)
                    if distance < reach - params.overlap_limit * reach:
                        status[1] = particles.id[o]
                        status[2] = k
                        status[0] = wp.int32(DEEP_IN_WALL)
            moved_particles.wall_near[i] = near
        if wp.static(walls_with_memory):
            touch = particles.wall_touch[o]
            moved_particles.wall_touch[i] = touch
            for k in range(params.planes):
                if touch & (1 << k):
                    here, there = k * params.n + i, k * params.n + o
                    if wp.static(spec.history):
                        moved_particles.wall_spring[here] = particles.wall_spring[there]
                    if wp.static(spec.rolling_history):
                        moved_particles.wall_rolling[here] = particles.wall_rolling[there]

    return gather


@wp.kernel(enable_backward=False)
def cell_starts(
    # in
    n: wp.int32,
    key: wp.array[wp.int32],
    # out
    start: wp.array[wp.int32],
):
    """First particle whose cell is c or later, by bisection of the sorted keys."""
    c = wp.tid()
    lo = wp.int32(0)
    hi = wp.int32(0) + n
    while lo < hi:
        mid = (lo + hi) // 2
        if key[mid] < c:
            lo = mid + 1
        else:
            hi = mid
    start[c] = lo


@wp.kernel(enable_backward=False)
def decide(
    # in
    n: wp.int32,
    capacity: wp.int32,
    start: wp.array[wp.int32],
    status: wp.array[wp.int32],
    # out
    fits: wp.array[wp.int32],
    inside: wp.array[wp.int32],
):
    """Whether a rebuild within a graph may go on to its list; counts it, or says that it stopped here."""
    fits[0] = 0
    if status[0] == OK and start[n] <= capacity:
        fits[0] = 1
        inside[0] = inside[0] + 1
    else:
        inside[1] = 1


@functools.cache
def list_kernel(spec: Spec, fill: bool) -> Any:
    """Counts the neighbours of each particle, or (`fill`) writes them and finds springs of touching pairs."""
    t = structs(spec.precision, spec.vibration)
    Params, Particles = t.Params, t.Particles
    nearest = nearest_image(spec.periodic, spec.precision)
    carry = fill and spec.memory
    get, integers = access(t.wide3).get, access(wp.int32)
    get_int, put_int = integers.get, integers.put

    @wp.func
    def entry(particles: Particles, at: wp.int32, other: wp.int32):
        """Where the old list of `at` holds `other` as touching; -1: nowhere."""
        found = wp.int32(-1)
        for k in range(particles.start[at], particles.start[at + 1]):
            if get_int(particles.neighbor, k) == -other - 1:
                found = wp.int32(0) + k
                break
        return found

    @wp.kernel(module="unique", enable_backward=False)
    def build(
        # params
        params: Params,
        begin: wp.int32,
        # in
        particles: Particles,
        key: wp.array[wp.int32],
        cell_start: wp.array[wp.int32],
        order: wp.array[wp.int32],
        # in (fill) or out (count)
        start: wp.array[wp.int32],
        hits: wp.array[wp.int32],
        # out
        neighbor: wp.array[wp.int32],
        spring: wp.array[t.vec3],
        rolling: wp.array[t.vec3],
        status: wp.array[wp.int32],
    ):
        i = begin + wp.tid()
        x = particles.built_at[i]
        reach = params.radius + params.radius
        if wp.static(spec.several_radii):
            reach = particles.radius[i]
        block = wp.int32(0)  # first particle of the block
        if wp.static(spec.half_list):
            block = i // params.block * params.block
        # a, b, c: along the fastest axis of the sorted order, the middle one, the slowest
        around_a, around_b = params.around[params.axes[0]], params.around[params.axes[1]]
        around_c = params.around[params.axes[2]]
        na, nb = params.cells[params.axes[0]], params.cells[params.axes[1]]
        nc = params.cells[params.axes[2]]
        a = key[i] % na
        b = key[i] // na % nb
        c = key[i] // (na * nb)
        count = wp.int32(0)
        touching = wp.int32(0)
        first = wp.int32(0)
        lowest = first_cell(c, nc, around_c)
        highest = last_cell(c, nc, around_c)
        if wp.static(fill):
            first = start[i]
            found = start[i + 1] - first
            if found <= HITS:  # all remembered: nothing to search
                highest = lowest - 1
                for m in range(found):
                    put_int(neighbor, first + m, get_int(hits, i * HITS + m))
                count = wp.int32(0) + found
        for at_c in range(lowest, highest + 1):
            for at_b in range(first_cell(b, nb, around_b), last_cell(b, nb, around_b) + 1):
                row = (wrapped(at_c, nc) * nb + wrapped(at_b, nb)) * na
                # cells along a lie side by side in the sorted order: one run, unless they wrap round
                left = first_cell(a, na, around_a)
                right = last_cell(a, na, around_a)
                runs = wp.int32(1)
                if left < 0 or right >= na:
                    runs = right - left + 1
                for run in range(runs):
                    begin_cell = row + left
                    end_cell = row + right + 1
                    if runs > 1:
                        begin_cell = row + wrapped(left + run, na)
                        end_cell = begin_cell + 1
                    begin_j = get_int(cell_start, begin_cell)
                    if wp.static(spec.half_list):
                        if begin_j >= block:
                            begin_j = wp.max(begin_j, i + 1)
                    for j in range(begin_j, get_int(cell_start, end_cell)):
                        d = nearest(x - get(particles.built_at, j), params.size)
                        rsq = wp.dot(d, d)
                        touch = reach
                        if wp.static(spec.several_radii):
                            touch = reach + particles.radius[j]
                        limit = touch + params.skin
                        if rsq < limit * limit and j != i:
                            if wp.static(spec.half_list):
                                if j >= block and j < i:
                                    continue
                            at = wp.int32(0) + count
                            found_j = wp.int32(0) + j
                            if rsq < touch * touch:
                                if wp.static(spec.memory):
                                    found_j = -j - 1
                                at = wp.int32(0) + touching
                                touching += 1
                                smaller = params.radius
                                if wp.static(spec.several_radii):
                                    smaller = wp.min(particles.radius[i], particles.radius[j])
                                deep = touch - params.overlap_limit * smaller
                                if deep > t.wide(0.0) and rsq < deep * deep:
                                    status[1] = particles.id[i]
                                    status[2] = particles.id[j]
                                    status[0] = wp.int32(TOO_DEEP)
                            if wp.static(fill):
                                put_int(neighbor, first + count, get_int(neighbor, first + at))
                                put_int(neighbor, first + at, found_j)
                            elif count < HITS:
                                put_int(hits, i * HITS + count, get_int(hits, i * HITS + at))
                                put_int(hits, i * HITS + at, found_j)
                            count += 1
        if wp.static(not fill):
            start[i] = count
        if wp.static(carry):
            o = order[i]
            for m in range(first, first + count):
                if neighbor[m] < 0:
                    j = -neighbor[m] - 1
                    sign = t.real(1.0)
                    k = entry(particles, o, order[j])
                    if wp.static(spec.half_list):
                        if k < 0:
                            k = entry(particles, order[j], o)
                            sign = t.real(-1.0)
                    if k < 0:
                        neighbor[m] = j
                    else:
                        if wp.static(spec.history):
                            spring[m] = sign * particles.spring[k]
                        if wp.static(spec.rolling_history):
                            rolling[m] = sign * particles.rolling[k]

    return build
