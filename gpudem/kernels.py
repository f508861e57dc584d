"""The step kernel: contact forces of one particle, its second half kick, its next first half kick and drift.

One thread a particle. With a full list both sides of a contact are computed apart, so nothing is added
atomically and the result depends on neither thread count nor order. With a half list (the CPU, where a launch
takes its particles one after the other) a pair within a block of particles is computed once, by the one that
comes first, and kept for the other; pairs across blocks are computed from both sides. A block belongs to one
core, and blocks do not depend on the number of cores: neither does the result.
Built for what the scene needs (`Spec`), no more.
"""

import functools
from typing import Any

import warp as wp

from gpudem.arrays import access
from gpudem.body import body_reader, body_struct, body_writer
from gpudem.contact.law import contact_law, damping_force
from gpudem.contact.types import contact_struct
from gpudem.spec import Spec
from gpudem.state import structs
from gpudem.walls import distance_now, plane_distance

#: Mode bits. SETUP: velocities are at the full step, springs only evaluated. WRITE: keep forces, velocities.
SETUP, WRITE = wp.constant(1), wp.constant(2)


@functools.cache
def nearest_image(periodic: tuple[bool, bool, bool], precision: str) -> Any:
    """A function (d, size) -> d between nearest images; no code for sides that are not periodic."""
    t = structs(precision, False)
    vec3, real = t.wide3, t.wide
    px, py, pz = periodic

    @wp.func
    def wrap(d: real, size: real):
        half = real(0.5) * size
        if d > half:
            d = d - size
        elif d < -half:
            d = d + size
        return d

    @wp.func
    def nearest(d: vec3, size: vec3):
        x, y, z = d[0], d[1], d[2]
        if wp.static(px):
            x = wrap(x, size[0])
        if wp.static(py):
            y = wrap(y, size[1])
        if wp.static(pz):
            z = wrap(z, size[2])
        return vec3(x, y, z)

    return nearest


@functools.cache
def step_kernel(spec: Spec) -> Any:
    """The step kernel of one Spec."""
    t = structs(spec.precision, spec.vibration)
    real, vec3, wide, wide3 = t.real, t.vec3, t.wide, t.wide3
    Params, Particles, Walls, Full = t.Params, t.Particles, t.Walls, t.Full
    Body = body_struct(spec)
    position_of, velocity_of = body_reader(spec, "position"), body_reader(spec, "velocity")
    angular_velocity_of = body_reader(spec, "angular_velocity")
    velocity_ahead_of = body_reader(spec, "velocity_ahead")
    angular_velocity_ahead_of = body_reader(spec, "angular_velocity_ahead")
    put_body = body_writer(spec)
    get, put, subtract = access(vec3)
    get_int, put_int, _ = access(wp.int32)
    Pair = t.Pair
    Contact = contact_struct(real)
    law = contact_law(spec.normal, spec.tangential, spec.rolling, spec.limit_force, spec.path)
    edge_law = damping_force(spec.normal, spec.limit_force)
    nearest = nearest_image(spec.periodic, spec.precision)
    moving = distance_now(spec.precision)
    mixed = real is not wide

    @wp.func
    def narrow(a: wide3):
        if wp.static(mixed):
            b = vec3(real(a[0]), real(a[1]), real(a[2]))
        else:
            b = a
        return b

    @wp.func
    def widen(a: vec3):
        if wp.static(mixed):
            b = wide3(wide(a[0]), wide(a[1]), wide(a[2]))
        else:
            b = a
        return b

    @wp.func
    def set_motion(c: Contact, v: vec3, v_ahead: vec3, dt: real):
        """Velocities of the contact point, i against j: half a step behind and ahead; dt = 0 at set-up."""
        mean = v
        if wp.static(spec.path):
            mean = real(0.5) * (v + v_ahead)
        c.normal_velocity = wp.dot(mean, c.normal)
        c.tangential_velocity = mean - c.normal_velocity * c.normal
        c.slide = dt * c.tangential_velocity
        if wp.static(spec.path):
            closing = -wp.dot(v, c.normal)
            closing_ahead = -wp.dot(v_ahead, c.normal)
            c.before = wp.max(c.overlap - real(0.5) * dt * closing, real(0.0))
            c.after = wp.max(c.overlap + real(0.5) * dt * closing_ahead, real(0.0))
            share = real(1.0)
            if c.overlap <= dt * closing:  # first step of the contact: it slides from the touch on
                share = c.overlap / (dt * closing)
            c.slide = (share * dt) * (v + closing * c.normal)
        return c

    @wp.func
    def edge(c: Contact, pair: Pair, dt: real):
        """Force of a pair apart now that touches within half a step before or ahead."""
        force = vec3()
        if c.before > real(0.0) or c.after > real(0.0):
            force = edge_law(c, pair, dt) * c.normal
        return force

    @wp.func
    def pair_contact(d: wide3, rsq: wide, wide_ri: wide, wide_rj: wide, mi: real, mj: real):
        c = Contact()
        ri = real(wide_ri)
        rj = real(wide_rj)
        if wp.static(mixed):  # the small difference in float64, without its square root
            r = wp.sqrt(real(rsq))
            reach = wide_ri + wide_rj
            c.normal = narrow(d) * (real(1.0) / r)
            c.overlap = real(reach * reach - rsq) / (real(reach) + r)
        else:
            r = wp.sqrt(rsq)
            c.normal = d * (real(1.0) / r)
            c.overlap = ri + rj - r
        c.lever = ri - real(0.5) * c.overlap
        if wp.static(spec.several_radii):
            c.radius_eff = ri * rj / (ri + rj)
        else:
            c.radius_eff = real(0.5) * ri
        if wp.static(spec.several_masses):
            c.mass_eff = mi * mj / (mi + mj)
        else:
            c.mass_eff = real(0.5) * mi
        return c

    @wp.func
    def wall_contact(distance: wide, normal: wide3, radius: wide, mass: real):
        c = Contact()
        c.normal = narrow(normal)
        c.overlap = real(radius - distance)
        c.lever = real(radius) - real(0.5) * c.overlap
        c.radius_eff = real(radius)
        c.mass_eff = mass
        return c

    @wp.func
    def turned(c: Contact, v: wide3, wi: wide3, wj: wide3, lever_j: real):
        """Velocity of the contact point from that of the centres and the spins."""
        if wp.static(spec.rotation):
            return narrow(v) - wp.cross(c.lever * narrow(wi) + lever_j * narrow(wj), c.normal)
        return narrow(v)

    @wp.kernel(module="unique", enable_backward=False)
    def step(
        # params
        params: Params,
        begin: wp.int32,
        mode: wp.int32,
        launch: wp.int32,
        # in
        walls: Walls,
        now: wp.array[Body],
        # in and out
        particles: Particles,
        # out
        after: wp.array[Body],
        full: Full,
    ):
        i = begin + wp.tid()
        if particles.moved[launch] != 0:  # an earlier launch of this chunk made the list out of date
            particles.moved[launch + 1] = 1
            return
        x = position_of(now, i)
        v = velocity_of(now, i)
        w = wide3()
        if wp.static(spec.rotation):
            w = angular_velocity_of(now, i)
        radius = params.radius
        if wp.static(spec.several_radii):
            radius = particles.radius[i]
        mass = params.mass
        if wp.static(spec.several_masses):
            mass = particles.mass[i]
        material = wp.int32(0)
        if wp.static(spec.several_materials):
            material = particles.material[i]
        dt = params.dt
        if mode & SETUP:
            dt = real(0.0)
        v_ahead = v
        w_ahead = w
        if wp.static(spec.path):
            if not (mode & SETUP):
                v_ahead = velocity_ahead_of(now, i)
                if wp.static(spec.rotation):
                    w_ahead = angular_velocity_ahead_of(now, i)

        force = vec3()
        torque = vec3()
        contacts = wp.int32(0)
        block_end = wp.int32(0)
        if wp.static(spec.half_list):
            block_end = (i // params.block + 1) * params.block
            force = get(particles.force_so_far, i)
            put(particles.force_so_far, i, vec3())
            if wp.static(spec.rotation):
                torque = get(particles.torque_so_far, i)
                put(particles.torque_so_far, i, vec3())

        # particles
        for k in range(get_int(particles.start, i), get_int(particles.start, i + 1)):
            entry = get_int(particles.neighbor, k)
            j = entry
            if wp.static(spec.memory):
                if entry < 0:
                    j = -entry - 1
            d = nearest(x - position_of(now, j), params.size)
            rsq = wp.dot(d, d)
            radius_j = params.radius
            if wp.static(spec.several_radii):
                radius_j = particles.radius[j]
            reach = radius + radius_j
            if rsq < reach * reach:
                mass_j = params.mass
                if wp.static(spec.several_masses):
                    mass_j = particles.mass[j]
                c = pair_contact(d, rsq, radius, radius_j, mass, mass_j)
                lever_j = real(radius_j) - real(0.5) * c.overlap
                v_j = velocity_of(now, j)
                w_j = wide3()
                if wp.static(spec.rotation):
                    w_j = angular_velocity_of(now, j)
                    c.spin = narrow(w - w_j)
                behind = turned(c, v - v_j, w, w_j, lever_j)
                ahead = behind
                if wp.static(spec.path):
                    if not (mode & SETUP):
                        v_j = velocity_ahead_of(now, j)
                        if wp.static(spec.rotation):
                            w_j = angular_velocity_ahead_of(now, j)
                        ahead = turned(c, v_ahead - v_j, w_ahead, w_j, lever_j)
                c = set_motion(c, behind, ahead, dt)
                pair = params.pair
                if wp.static(spec.several_materials):
                    pair = particles.pairs[material * params.materials + particles.material[j]]
                spring = vec3()
                kept = vec3()
                if entry < 0:
                    if wp.static(spec.history):
                        spring = get(particles.spring, k)
                    if wp.static(spec.rolling_history):
                        kept = get(particles.rolling, k)
                f, turn, rolling, spring_new = law(c, pair, spring, kept, dt, params.dt)
                force += f
                torque -= c.lever * turn + rolling
                contacts += 1
                if wp.static(spec.half_list):
                    if j > i and j < block_end:
                        subtract(particles.force_so_far, j, f)
                        if wp.static(spec.rotation):
                            subtract(particles.torque_so_far, j, lever_j * turn - rolling)
                        contacts += 1
                if wp.static(spec.memory):
                    if not (mode & SETUP):
                        if wp.static(spec.history):
                            put(particles.spring, k, spring_new)
                        if wp.static(spec.rolling_history):
                            put(particles.rolling, k, rolling)
                        if entry >= 0:
                            put_int(particles.neighbor, k, -j - 1)
            else:
                if wp.static(spec.memory):
                    if entry < 0:
                        put_int(particles.neighbor, k, j)
                if wp.static(spec.path):  # may touch within half a step before or ahead
                    reach += wide(0.5) * params.skin
                    if rsq < reach * reach and not (mode & SETUP):
                        mass_j = params.mass
                        if wp.static(spec.several_masses):
                            mass_j = particles.mass[j]
                        c = pair_contact(d, rsq, radius, radius_j, mass, mass_j)
                        behind = narrow(v - velocity_of(now, j))
                        c = set_motion(c, behind, narrow(v_ahead - velocity_ahead_of(now, j)), dt)
                        pair = params.pair
                        if wp.static(spec.several_materials):
                            pair = particles.pairs[material * params.materials + particles.material[j]]
                        f = edge(c, pair, dt)
                        force += f
                        if wp.static(spec.half_list):
                            if j > i and j < block_end:
                                subtract(particles.force_so_far, j, f)

        # walls
        if wp.static(spec.walls):
            touch = wp.int32(0)
            touched = wp.int32(0)
            if wp.static(spec.memory):
                touched = particles.wall_touch[i]
            near = particles.wall_near[i]
            for k in range(params.planes):
                if (near >> k) == 0:
                    break
                if near & (1 << k) == 0:
                    continue
                normal = walls.normal[k]
                distance = plane_distance(x, normal, walls.offset[k])
                if wp.static(spec.vibration):
                    at = launch * params.planes + k
                    distance = moving(
                        params, walls, particles, i, k, at, distance, radius, wp.dot(v, normal), dt
                    )
                if distance <= radius:
                    c = wall_contact(distance, normal, radius, mass)
                    if wp.static(spec.rotation):
                        c.spin = (c.lever / real(distance)) * narrow(w)
                    behind = turned(c, v, w, wide3(), real(0.0))
                    if wp.static(spec.vibration):
                        behind = behind - narrow(walls.speed[k] * normal)
                    c = set_motion(c, behind, turned(c, v_ahead, w_ahead, wide3(), real(0.0)), dt)
                    spring = vec3()
                    kept = vec3()
                    if touched & (1 << k):
                        if wp.static(spec.history):
                            spring = particles.wall_spring[k * params.n + i]
                        if wp.static(spec.rolling_history):
                            kept = particles.wall_rolling[k * params.n + i]
                    f, turn, rolling, spring_new = law(
                        c, walls.pairs[k * params.materials + material], spring, kept, dt, params.dt
                    )
                    force += f
                    if wp.static(spec.vibration):
                        if not (mode & SETUP):
                            push = wp.float64(wp.dot(f, c.normal))
                            particles.wall_work[i] += push * wp.float64(walls.speed[k] * params.drift)
                    torque -= c.lever * turn + rolling
                    contacts += 2  # a contact with a particle is counted from both sides
                    if wp.static(spec.memory):
                        if not (mode & SETUP):
                            if wp.static(spec.history):
                                particles.wall_spring[k * params.n + i] = spring_new
                            if wp.static(spec.rolling_history):
                                particles.wall_rolling[k * params.n + i] = rolling
                            touch = touch | (1 << k)
                elif wp.static(spec.path):
                    if not (mode & SETUP):
                        c = wall_contact(distance, normal, radius, mass)
                        c = set_motion(c, narrow(v), narrow(v_ahead), dt)
                        force += edge(c, walls.pairs[k * params.materials + material], dt)
            if wp.static(spec.memory):
                if touch != touched and not (mode & SETUP):
                    particles.wall_touch[i] = touch

        if wp.static(spec.gravity):
            force += mass * params.gravity

        # second half kick to the full step, first half kick and drift of the next
        kick = params.kick
        spin_kick = params.spin_kick
        if wp.static(spec.several_masses):
            kick = real(0.5) * params.dt / mass
            spin_kick = real(0.5) * params.dt / (real(0.4) * real(radius) * real(radius) * mass)
        if not (mode & SETUP):
            v = v + widen(kick * force)
        if wp.static(spec.rotation):
            if not (mode & SETUP):
                w = w + widen(spin_kick * torque)
        if mode & WRITE:
            full.velocity[i] = v
            full.force[i] = force
            full.contacts[i] = contacts
            if wp.static(spec.rotation):
                full.angular_velocity[i] = w
                full.torque[i] = torque
        v = v + widen(kick * force)
        x = x + params.drift * v
        if wp.static(spec.rotation):
            w = w + widen(spin_kick * torque)
        if wp.static(spec.path):
            v_ahead = v + widen(real(2.0) * kick * force)
            if wp.static(spec.rotation):
                w_ahead = w + widen(real(2.0) * spin_kick * torque)
        put_body(after, i, x, v, w, v_ahead, w_ahead)
        shift = x - particles.built_at[i]
        if not (wp.dot(shift, shift) <= params.move_limit):  # true for NaN too
            particles.moved[launch + 1] = 1

    return step
