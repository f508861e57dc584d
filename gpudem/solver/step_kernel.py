"""The step kernel: contact forces of one particle, its second half kick, its next first half kick and drift.

One thread a particle. With a full list both sides of a contact are computed apart, so nothing is added
atomically and the result depends on neither thread count nor order. With a half list (the CPU, where a launch
takes its particles one after the other) a pair within a block of particles is computed once, by the one that
comes first, and kept for the other; pairs across blocks are computed from both sides. A block belongs to one
core, and blocks do not depend on the number of cores: neither does the result.
Built for what the scene needs (`Spec`), no more.

Where a vector is given a new value within an `if`, Warp's C++ chooses between two vectors in memory after it:
in the loops over contacts that cost a third of a step on a CPU. So these loops leave early (`continue`)
instead, read "this or zero" by `get_if`, and use no name twice.
"""

import functools
from typing import Any

import warp as wp

from gpudem.contact.law import contact_law, damping_force
from gpudem.solver.arrays import access
from gpudem.solver.body import body_reader, body_struct, body_writer
from gpudem.solver.geometry import contact_geometry, nearest_image
from gpudem.solver.spec import Spec
from gpudem.solver.state import structs
from gpudem.solver.wall_table import distance_now, plane_distance

#: Mode bits. SETUP: velocities are at the full step, springs only evaluated. WRITE: keep forces, velocities.
SETUP, WRITE = wp.constant(1), wp.constant(2)


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
    vectors, integers, get_wide = access(vec3), access(wp.int32), access(wide3).get
    get, get_if, put, subtract = vectors.get, vectors.get_if, vectors.put, vectors.subtract
    get_int, put_int = integers.get, integers.put
    geometry = contact_geometry(spec)
    narrow, widen, set_motion = geometry.narrow, geometry.widen, geometry.set_motion
    pair_contact, wall_contact, turned = geometry.pair_contact, geometry.wall_contact, geometry.turned
    law = contact_law(spec.normal, spec.tangential, spec.rolling, spec.limit_force, spec.path)
    edge = damping_force(spec.normal, spec.limit_force)
    nearest = nearest_image(spec.periodic, spec.precision)
    moving = distance_now(spec.precision)

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
        if get_int(particles.moved, launch) != 0:  # an earlier launch of this chunk made the list out of date
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
            if not (rsq < reach * reach):
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
                continue
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
            if wp.static(spec.history):
                spring = get_if(particles.spring, k, entry < 0)
            if wp.static(spec.rolling_history):
                kept = get_if(particles.rolling, k, entry < 0)
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

        # walls
        if wp.static(spec.walls):
            touch = wp.int32(0)
            touched = wp.int32(0)
            if wp.static(spec.memory):
                touched = get_int(particles.wall_touch, i)
            near = get_int(particles.wall_near, i)
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
                if not (distance <= radius):
                    if wp.static(spec.path):
                        if not (mode & SETUP):
                            at_wall = wall_contact(distance, normal, radius, mass)
                            at_wall = set_motion(at_wall, narrow(v), narrow(v_ahead), dt)
                            force += edge(at_wall, walls.pairs[k * params.materials + material], dt)
                    continue
                at_wall = wall_contact(distance, normal, radius, mass)
                if wp.static(spec.rotation):
                    at_wall.spin = (at_wall.lever / real(distance)) * narrow(w)
                v_point = turned(at_wall, v, w, wide3(), real(0.0))
                if wp.static(spec.vibration):
                    v_point = v_point - narrow(walls.speed[k] * normal)
                v_point_ahead = turned(at_wall, v_ahead, w_ahead, wide3(), real(0.0))
                at_wall = set_motion(at_wall, v_point, v_point_ahead, dt)
                wall_spring = vec3()
                wall_kept = vec3()
                held = (touched & (1 << k)) != 0
                if wp.static(spec.history):
                    wall_spring = get_if(particles.wall_spring, k * params.n + i, held)
                if wp.static(spec.rolling_history):
                    wall_kept = get_if(particles.wall_rolling, k * params.n + i, held)
                wall_pair = walls.pairs[k * params.materials + material]
                push, wall_turn, wall_rolling, wall_spring_new = law(
                    at_wall, wall_pair, wall_spring, wall_kept, dt, params.dt
                )
                force += push
                if wp.static(spec.vibration):
                    if not (mode & SETUP):
                        work = wp.float64(wp.dot(push, at_wall.normal))
                        particles.wall_work[i] += work * wp.float64(walls.speed[k] * params.drift)
                torque -= at_wall.lever * wall_turn + wall_rolling
                contacts += 2  # a contact with a particle is counted from both sides
                if wp.static(spec.memory):
                    if not (mode & SETUP):
                        if wp.static(spec.history):
                            put(particles.wall_spring, k * params.n + i, wall_spring_new)
                        if wp.static(spec.rolling_history):
                            put(particles.wall_rolling, k * params.n + i, wall_rolling)
                        touch = touch | (1 << k)
            if wp.static(spec.memory):
                if touch != touched and not (mode & SETUP):
                    put_int(particles.wall_touch, i, touch)

        if wp.static(spec.gravity):
            force += mass * params.gravity

        # second half kick to the full step, first half kick and drift of the next
        kick = params.kick
        spin_kick = params.spin_kick
        if wp.static(spec.several_masses):
            kick = real(0.5) * params.dt / mass
            spin_kick = real(0.5) * params.dt / (real(0.4) * real(radius) * real(radius) * mass)
        behind_kick = kick
        behind_spin_kick = spin_kick
        if mode & SETUP:  # velocities are at the full step already
            behind_kick = real(0.0)
            behind_spin_kick = real(0.0)
        v = v + widen(behind_kick * force)
        if wp.static(spec.rotation):
            w = w + widen(behind_spin_kick * torque)
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
        shift = x - get_wide(particles.built_at, i)
        if not (wp.dot(shift, shift) <= params.move_limit):  # true for NaN too
            particles.moved[launch + 1] = 1
            particles.asked[launch + 1] = 1

    return step
