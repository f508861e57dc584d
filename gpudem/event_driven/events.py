# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportInvalidTypeForm=false
"""What the event loop works on: its arrays, its cells, and the times at which free flight ends."""

import warp as wp

real, vec3 = wp.float64, wp.vec3d
FAR = wp.constant(wp.float64(1e300))
#: `partner` of a particle that hits nothing; a wall is WALL - side, sides in order xlo, xhi, ylo, ...
NOBODY, WALL = wp.constant(-1), wp.constant(-2)
#: Places in `counts`.
PAIRS, HITS, CROSSINGS, STALE, GUARDED = (wp.constant(k) for k in range(5))
#: Places in `sums`: work of moving walls [J], dissipation [J], virial sum of J d [J s], largest overlap [d].
WORK, DISSIPATED, VIRIAL, OVERLAP = (wp.constant(k) for k in range(4))
#: Values of `status[0]`; status[1] is the particle.
BUSY, DONE, LOST, RESTING, UNSEEN = (wp.constant(k) for k in range(5))


@wp.struct
class Events:
    """All that a run has; arrays by particle unless said otherwise."""

    gravity: wp.vec3d  # [m/s2]
    lo: wp.vec3d  # corner of cell (0, 0, 0) [m]
    edge: wp.vec3d  # of a cell [m]
    size: wp.vec3d  # period [m]
    cells: wp.vec3i
    reach: wp.vec3i  # 1 along axes with motion, 0 along the axis that a layer of disks does not leave
    periodic: wp.vec3i
    guard: wp.float64  # t_c [s]: an encounter sooner than this after the last is elastic
    tangential: wp.float64  # beta0 of rough spheres
    n: wp.int32
    leaves: wp.int32  # of the tree, a power of two
    log_size: wp.int32
    # walls, by side
    wall: wp.array(dtype=wp.int32)
    wall_at: wp.array(dtype=wp.float64)
    wall_speed: wp.array(dtype=wp.float64)  # U of a vibrating wall along its normal [m/s]
    wall_stroke: wp.array(dtype=wp.float64)  # A of its saw-tooth [m]; 0: the fast floor, or a wall at rest
    shut: wp.array(dtype=wp.int32)  # no centre can come to this side of the cells
    wall_restitution: wp.array2d(dtype=wp.float64)  # side, material
    restitution: wp.array2d(dtype=wp.float64)  # material, material
    # of rough spheres alone
    wall_friction: wp.array2d(dtype=wp.float64)  # side, material
    friction: wp.array2d(dtype=wp.float64)  # material, material
    spin: wp.array(dtype=wp.vec3d)  # by particle [rad/s]
    # particles
    x: wp.array(dtype=wp.vec3d)
    v: wp.array(dtype=wp.vec3d)
    clock: wp.array(dtype=wp.float64)  # [s]
    last: wp.array(dtype=wp.float64)  # collision [s]
    radius: wp.array(dtype=wp.float64)
    mass: wp.array(dtype=wp.float64)
    material: wp.array(dtype=wp.int32)
    # cells: doubly linked lists
    head: wp.array(dtype=wp.int32)  # by cell
    next: wp.array(dtype=wp.int32)
    previous: wp.array(dtype=wp.int32)
    cell: wp.array(dtype=wp.vec3i)
    # events
    collisions: wp.array(dtype=wp.int32)
    hit_time: wp.array(dtype=wp.float64)
    partner: wp.array(dtype=wp.int32)
    partner_collisions: wp.array(dtype=wp.int32)  # of the partner when this was predicted
    cross_time: wp.array(dtype=wp.float64)
    cross_side: wp.array(dtype=wp.int32)
    time: wp.array(dtype=wp.float64)  # of the earlier of both; by leaf
    winner: wp.array(dtype=wp.int32)  # by node of the tree, root at 1
    # whole run
    status: wp.array(dtype=wp.int32)
    now: wp.array(dtype=wp.float64)
    counts: wp.array(dtype=wp.int64)
    sums: wp.array(dtype=wp.float64)
    log: wp.array(dtype=wp.vec2i)  # the first collisions: particle, partner or wall
    log_time: wp.array(dtype=wp.float64)


@wp.func
def fall_time(h: real, w: real, a: real):
    """First t >= 0 at which h + w t + a t^2/2 falls through zero; FAR if never. No digits are lost."""
    if h <= real(0.0) and w < real(0.0):
        return real(0.0)
    if a < real(0.0):
        s = wp.sqrt(wp.max(w * w - real(2.0) * a * h, real(0.0)))
        if w >= real(0.0):
            return (w + s) / (-a)
        return real(2.0) * h / (s - w)
    if w >= real(0.0):
        return FAR
    q = w * w - real(2.0) * a * h
    if q < real(0.0):
        return FAR
    return real(2.0) * h / (wp.sqrt(q) - w)


@wp.func
def meeting_time(r: vec3, u: vec3, d: real):
    """First t >= 0 at which |r + u t| falls through d; FAR if never (Bannerman et al. 2014)."""
    b = wp.dot(r, u)
    if b >= real(0.0):
        return FAR
    c = wp.dot(r, r) - d * d
    if c <= real(0.0):
        return real(0.0)
    q = b * b - wp.dot(u, u) * c
    if q <= real(0.0):
        return FAR
    return c / (wp.sqrt(q) - b)


@wp.func
def cell_index(s: Events, c: wp.vec3i):
    """Place of a cell in `head`."""
    return (c[2] * s.cells[1] + c[1]) * s.cells[0] + c[0]


@wp.func
def link(s: Events, i: int, c: wp.vec3i):
    """Put i first into the list of cell c."""
    k = cell_index(s, c)
    first = s.head[k]
    s.next[i] = first
    s.previous[i] = -1
    if first >= 0:
        s.previous[first] = i
    s.head[k] = i
    s.cell[i] = c


@wp.func
def unlink(s: Events, i: int):
    """Take i out of the list of its cell."""
    before, after = s.previous[i], s.next[i]
    if before >= 0:
        s.next[before] = after
    else:
        s.head[cell_index(s, s.cell[i])] = after
    if after >= 0:
        s.previous[after] = before


@wp.func
def bring(s: Events, i: int, t: real):
    """Let particle i fly to time t."""
    dt = t - s.clock[i]
    v = s.v[i]
    s.x[i] = s.x[i] + dt * (v + (real(0.5) * dt) * s.gravity)
    s.v[i] = v + dt * s.gravity
    s.clock[i] = t


@wp.func
def wrapped(c: int, n: int, periodic: int):
    """Cell over a periodic side; -1 where there is none."""
    k = c
    if c < 0 or c >= n:
        k = -1
        if periodic > 0:
            k = c + n
            if c >= n:
                k = c - n
    return k
