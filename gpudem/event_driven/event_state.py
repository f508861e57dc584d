# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false
"""State of the event loop: arrays by particle, cells, the event tree and counters. All times in s."""

import warp as wp

real, vec3 = wp.float64, wp.vec3d
#: Time of an event that does not happen [s].
NEVER = wp.constant(wp.float64(1e300))
#: `partner` of a particle: its index, NO_PARTNER, or WALL_PARTNER - side, xlo, xhi, ylo, ... = 0..5.
NO_PARTNER, WALL_PARTNER = wp.constant(-1), wp.constant(-2)
#: Indices into `counts`.
PAIR_COLLISIONS, WALL_COLLISIONS, CELL_CROSSINGS, STALE_EVENTS, GUARDED = (wp.constant(k) for k in range(5))
#: Indices into `sums`: work of walls [J], dissipation [J], virial sum of J d [J s], largest overlap [d].
WORK, DISSIPATED, VIRIAL, MAX_OVERLAP = (wp.constant(k) for k in range(4))
#: Values of `status[0]`; `status[1]` is the particle that the error concerns.
RUNNING, STOP_TIME_REACHED, LEFT_DOMAIN, RESTING_ON_WALL, SAWTOOTH_ROOT_NOT_FOUND = (
    wp.constant(k) for k in range(5)
)


@wp.struct
class EventState:
    """All data of the event loop; arrays have one entry a particle unless stated otherwise."""

    gravity: wp.vec3d  # [m/s2]
    lo: wp.vec3d  # lower corner of the domain and of cell (0, 0, 0) [m]
    cell_edge: wp.vec3d  # edges of a cell [m]
    domain_size: wp.vec3d  # hi - lo, the period of periodic axes [m]
    n_cells: wp.vec3i
    search_range: (
        wp.vec3i
    )  # neighbor cells to search each way: 1; 0 along the axis normal to a layer of disks
    periodic: wp.vec3i
    guard: wp.float64  # t_c of the TC model [s]; 0: off
    tangential_restitution: wp.float64  # beta0 of rough spheres [1]
    n: wp.int32
    n_leaves: wp.int32  # of the event tree, a power of two
    log_capacity: wp.int32
    # walls, by side
    wall_present: wp.array(dtype=wp.int32)
    wall_position: wp.array(dtype=wp.float64)  # along the axis of the side [m]
    wall_speed: wp.array(dtype=wp.float64)  # U of a vibrating wall along its inward normal [m/s]
    wall_amplitude: wp.array(dtype=wp.float64)  # A of its sawtooth [m]; 0: zero-amplitude limit, or at rest
    side_closed: wp.array(dtype=wp.int32)  # 1: a wall keeps every center inside this side of the domain
    wall_restitution: wp.array2d(dtype=wp.float64)  # side, material
    restitution: wp.array2d(dtype=wp.float64)  # material, material
    # rough spheres only
    wall_friction: wp.array2d(dtype=wp.float64)  # side, material
    friction: wp.array2d(dtype=wp.float64)  # material, material
    angular_velocity: wp.array(dtype=wp.vec3d)  # [rad/s]
    # particles
    x: wp.array(dtype=wp.vec3d)  # position at local_time [m]
    v: wp.array(dtype=wp.vec3d)  # velocity at local_time [m/s]
    local_time: wp.array(dtype=wp.float64)  # the time x and v belong to [s]
    last_collision_time: wp.array(dtype=wp.float64)  # [s]
    radius: wp.array(dtype=wp.float64)  # [m]
    mass: wp.array(dtype=wp.float64)  # [kg]
    material: wp.array(dtype=wp.int32)
    image: wp.array(dtype=wp.vec3i)  # passages through periodic sides, + upwards; only in periodic domains
    # cells: doubly linked lists
    head: wp.array(dtype=wp.int32)  # by cell
    next: wp.array(dtype=wp.int32)
    previous: wp.array(dtype=wp.int32)
    cell: wp.array(dtype=wp.vec3i)
    # predicted events
    collision_count: wp.array(dtype=wp.int32)
    collision_time: wp.array(dtype=wp.float64)
    partner: wp.array(dtype=wp.int32)
    partner_count: wp.array(dtype=wp.int32)  # collision_count of the partner at the time of the prediction
    crossing_time: wp.array(dtype=wp.float64)
    crossing_side: wp.array(dtype=wp.int32)
    event_time: wp.array(dtype=wp.float64)  # the earlier of collision and crossing; by leaf
    tree: wp.array(dtype=wp.int32)  # tournament winner (particle) by node, root at 1
    # whole run
    status: wp.array(dtype=wp.int32)
    current_time: wp.array(dtype=wp.float64)
    counts: wp.array(dtype=wp.int64)
    sums: wp.array(dtype=wp.float64)
    log: wp.array(dtype=wp.vec2i)  # the first collisions: particle, partner
    log_time: wp.array(dtype=wp.float64)


@wp.func
def advance_particle(s: EventState, i: int, t: real):
    """Ballistic flight of particle i from its local time to t: x + v dt + g dt^2/2."""
    dt = t - s.local_time[i]
    v = s.v[i]
    s.x[i] = s.x[i] + dt * (v + (real(0.5) * dt) * s.gravity)
    s.v[i] = v + dt * s.gravity
    s.local_time[i] = t


@wp.func
def report_error(s: EventState, status: int, i: int):
    """End the event loop with an error that concerns particle i."""
    s.status[0] = status
    s.status[1] = i
