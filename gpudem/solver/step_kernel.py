# pyright: reportInvalidTypeForm=false, reportOptionalCall=false
"""The step kernel: contact forces of one particle, its second half kick, its next first half kick and drift.

One thread a particle. With a full list both sides of a contact are computed separately, so nothing is added
atomically and the result depends on neither thread count nor order. With a half list (the CPU, where a launch
takes its particles one after the other) a pair within a block of particles is computed once, by the particle
that comes first, and its partial force is stored for the other; pairs across blocks are computed from both
sides. A block belongs to one core, and blocks do not depend on the number of cores: neither does the result.
Built for what the scene needs (`Spec`), no more.

Where a vector is given a new value within an `if`, Warp's C++ chooses between two vectors in memory after it:
in the loops over contacts that costs a third of a step on a CPU. So these loops leave early (`continue`)
instead, read "this or zero" by `get_if`, and functions return early.
"""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from gpudem.contact.types import pair_struct
from gpudem.scene.groups import FROZEN
from gpudem.solver.arrays import access
from gpudem.solver.body import body_reader, body_struct, body_writer
from gpudem.solver.geometry import (
    contact_geometry,
    contact_procedure,
    conversions,
    nearest_image,
    wall_procedure,
)
from gpudem.solver.held_particles import held_particles
from gpudem.solver.lanes import lane_sums
from gpudem.solver.launch_bounds import THREADS, blocks_in_flight
from gpudem.solver.list_layout import list_places
from gpudem.solver.mesh_contacts import mesh_contacts, triangle_apart, wall_entry
from gpudem.solver.spec import Spec
from gpudem.solver.state import structs
from gpudem.solver.wall_frames import wall_frame
from gpudem.solver.walls import fast_floor_gap

#: Mode bits. SETUP: velocities are at the full step, springs only evaluated. WRITE: store forces, velocities.
SETUP, WRITE = wp.constant(1), wp.constant(2)


@functools.cache
def laws_struct(spec: Spec) -> Any:
    """The struct `Laws`: coefficients of the material pairs."""
    Pair = pair_struct(structs(spec.precision).real, spec.coefficients)

    @wp.struct
    class Laws:
        pair: Pair  # of one material
        pairs: wp.array[Pair]  # by two particle materials, (materials^2,)
        wall_pairs: wp.array[Pair]  # by wall and particle material, (m materials,)

    return Laws


@functools.cache
def particle_reader(spec: Spec) -> SimpleNamespace:
    """Functions that read a property of particle j: one value for all where all are equal."""
    t = structs(spec.precision)
    Params, Particles, Laws, Body = t.Params, t.Particles, laws_struct(spec), body_struct(spec)
    velocity_of, next_velocity_of = body_reader(spec, "velocity"), body_reader(spec, "velocity_ahead")
    spin_of = body_reader(spec, "angular_velocity")
    next_spin_of = body_reader(spec, "angular_velocity_ahead")

    @wp.func
    def radius_of(params: Params, particles: Particles, j: wp.int32):
        if wp.static(spec.polydisperse):
            return particles.radius[j]
        return params.radius

    @wp.func
    def mass_of(params: Params, particles: Particles, j: wp.int32):
        if wp.static(spec.per_particle_mass):
            return particles.mass[j]  # mutate: particle_mass
        return params.mass

    @wp.func
    def material_of(particles: Particles, j: wp.int32):
        if wp.static(spec.multi_material):
            return particles.material[j]
        return wp.int32(0)

    @wp.func
    def pair_of(params: Params, particles: Particles, laws: Laws, material: wp.int32, j: wp.int32):
        if wp.static(spec.multi_material):
            # mutate: pair_coefficients
            return laws.pairs[material * params.materials + particles.material[j]]
        return laws.pair

    @wp.func
    def velocity_ahead(now: wp.array[Body], j: wp.int32, mode: wp.int32):
        """Half a step ahead (integrator "path"); at set-up the present one, for none is predicted yet."""
        if mode & SETUP:
            return velocity_of(now, j)
        return next_velocity_of(now, j)

    @wp.func
    def spin_ahead(now: wp.array[Body], j: wp.int32, mode: wp.int32):
        if mode & SETUP:
            return spin_of(now, j)
        return next_spin_of(now, j)

    return SimpleNamespace(
        radius=radius_of, mass=mass_of, material=material_of, pair=pair_of,
        velocity=velocity_of, spin=spin_of, velocity_ahead=velocity_ahead, spin_ahead=spin_ahead,
    )  # fmt: skip


@functools.cache
def effective_mass(spec: Spec) -> Any:
    """A function (params, particles, i, j, mass of i, effective mass of two free ones) -> that of a contact.

    Of a frozen particle and a free one it is the free one's, as LIGGGHTS' fix freeze has it.
    """
    t = structs(spec.precision)
    real, Params, Particles = t.real, t.Params, t.Particles
    mass_of, get_int = particle_reader(spec).mass, access(wp.int32).get

    @wp.func
    def effective(params: Params, particles: Particles, i: wp.int32, j: wp.int32, mass: real, usual: real):
        if get_int(particles.held, i) == wp.static(FROZEN):
            return mass_of(params, particles, j)
        if get_int(particles.held, j) == wp.static(FROZEN):
            return mass  # mutate: mass_against_frozen
        return usual

    return effective


@functools.cache
def entry_access(spec: Spec) -> SimpleNamespace:
    """Functions for entry k of the list: its partner, and the contact history stored in it."""
    t = structs(spec.precision)
    Particles, vec3 = t.Particles, t.vec3
    vectors, put_int = access(vec3), access(wp.int32).put
    get_if, put = vectors.get_if, vectors.put

    @wp.func
    def partner(entry: wp.int32):
        """The particle, or n + the wall, of an entry; a negative one was in contact in the last step."""
        if wp.static(spec.contact_history):
            if entry < 0:
                return -entry - 1
        return entry

    @wp.func
    def part(particles: Particles, k: wp.int32, entry: wp.int32, other: wp.int32):
        """Mark that the two of an entry are not in contact."""
        if wp.static(spec.contact_history):
            if entry < 0:
                put_int(particles.neighbor, k, other)  # mutate: forget_contact

    @wp.func
    def spring(particles: Particles, k: wp.int32, entry: wp.int32):
        if wp.static(spec.spring_history):
            return get_if(particles.spring, k, entry < 0)
        return vec3()

    @wp.func
    def rolling(particles: Particles, k: wp.int32, entry: wp.int32):
        if wp.static(spec.rolling_history):
            return get_if(particles.rolling_torque, k, entry < 0)
        return vec3()

    @wp.func
    def store(
        particles: Particles, k: wp.int32, entry: wp.int32, other: wp.int32,
        spring: vec3, rolling: vec3, mode: wp.int32,
    ):  # fmt: skip
        """The history after the step; nothing at set-up."""
        if wp.static(spec.contact_history):
            if not (mode & SETUP):
                if wp.static(spec.spring_history):
                    put(particles.spring, k, spring)
                if wp.static(spec.rolling_history):
                    put(particles.rolling_torque, k, rolling)
                if entry >= 0:  # mutate: remember_contact
                    put_int(particles.neighbor, k, -other - 1)

    return SimpleNamespace(partner=partner, part=part, spring=spring, rolling=rolling, store=store)


@functools.cache
def contact_reach(spec: Spec) -> SimpleNamespace:
    """Functions for the distance within which two bodies are in contact.

    pair(params, particles, laws, material of i, j, entry, radii of i and j)
    wall(params, pair, entry, radius)

    The sum of the radii (a wall's is 0), and the range of a law across gaps; with adhesion, for those that
    were in contact in the last step, the gap at which their contact breaks.
    """
    t = structs(spec.precision)
    real, wide, Params, Particles, Laws = t.real, t.wide, t.Params, t.Particles, laws_struct(spec)
    pair_of, gap = particle_reader(spec).pair, getattr(spec.law_names[0].normal_law, "gap", None)

    @wp.func
    def of_pair(
        params: Params, particles: Particles, laws: Laws, material: wp.int32, j: wp.int32, entry: wp.int32,
        radius_i: wide, radius_j: wide,
    ):  # fmt: skip
        reach = radius_i + radius_j
        if wp.static(spec.adhesive):
            if entry >= 0:  # mutate: adhesion_from_touch
                return reach
            pair = pair_of(params, particles, laws, material, j)
            return reach + wide(
                wp.static(gap)(pair, real(radius_i * radius_j / reach))
            )  # mutate: pair_breaks
        if wp.static(spec.long_range):
            reach += params.range
        return reach

    @wp.func
    def of_wall(params: Params, pair: Any, entry: wp.int32, radius: wide):
        if wp.static(spec.adhesive):
            if entry >= 0:
                return radius
            return radius + wide(wp.static(gap)(pair, real(radius)))  # mutate: wall_contact_breaks
        return radius + params.range

    return SimpleNamespace(pair=of_pair, wall=of_wall)


@functools.cache
def partial_sums(spec: Spec) -> SimpleNamespace:
    """Functions for the sums of a half list; with a full list they do nothing.

    take(particles, i) -> (force, torque) that the particles before i in its block have left for it.
    add(particles, i, j, end of the block, force on i, torque on j) -> 1 if j is in the block, and its force
    and torque were added to its sums, else 0.
    """
    t = structs(spec.precision)
    Particles, vec3 = t.Particles, t.vec3
    vectors = access(vec3)
    get, put, subtract = vectors.get, vectors.put, vectors.subtract

    @wp.func
    def take(particles: Particles, i: wp.int32):
        if wp.static(not spec.half_list):
            return vec3(), vec3()
        force, torque = get(particles.partial_force, i), vec3()
        put(particles.partial_force, i, vec3())  # mutate: force_of_block_taken
        if wp.static(spec.rotation):
            torque = get(particles.partial_torque, i)
            put(particles.partial_torque, i, vec3())
        return force, torque

    @wp.func
    def add(
        particles: Particles, i: wp.int32, j: wp.int32, block_end: wp.int32, force: vec3, torque_j: vec3
    ):  # fmt: skip
        if wp.static(spec.half_list):
            if j > i and j < block_end:
                subtract(particles.partial_force, j, force)  # mutate: partner_force
                if wp.static(spec.rotation):
                    subtract(particles.partial_torque, j, -torque_j)
                return 1
        return 0

    return SimpleNamespace(take=take, add=add)


@functools.cache
def wall_action(spec: Spec) -> SimpleNamespace:
    """Functions for what a wall does to a particle: its force for the output, its work.

    note(particles, mode, k, force, couple, point): for entry k in a step whose forces on walls are wanted.
    act(params, walls, particles, launch, mode, k, wall, i, force, couple, point, velocity): the same, and
    the work force . velocity dt of the wall's point, and couple . spin dt; none at set-up.
    """
    t = structs(spec.precision)
    Params, Particles, Walls, vec3, wide3 = t.Params, t.Particles, t.Walls, t.vec3, t.wide3
    to_wide, power_of_wall = conversions(spec.precision).to_wide, wall_frame(spec).power

    @wp.func
    def note(particles: Particles, mode: wp.int32, k: wp.int32, force: vec3, couple: vec3, point: wide3):
        if wp.static(spec.wall_forces):
            if wp.static(spec.servo) or mode & WRITE != 0:
                particles.wall_force[k] = force
                particles.wall_point[k] = point
                particles.wall_couple[k] = couple

    @wp.func
    def act(
        params: Params, walls: Walls, particles: Particles, launch: wp.int32, mode: wp.int32, k: wp.int32,
        wall: wp.int32, i: wp.int32, force: vec3, couple: vec3, point: wide3, velocity: wide3,
    ):  # fmt: skip
        note(particles, mode, k, force, couple, point)
        if wp.static(spec.moving_walls):
            if mode & SETUP:
                return
            here = launch * params.walls + wall
            power = power_of_wall(walls, here, to_wide(force), velocity, to_wide(-couple))
            at = walls.work_row[wall] * params.n + i  # mutate: row_of_work
            particles.wall_work[at] += wp.float64(power * params.dt_wide)  # mutate: work_of_floor

    return SimpleNamespace(note=note, act=act)


@functools.cache
def group_action(spec: Spec) -> Any:
    """A function: adds up the work of the group of a particle with a motion on the others.

    By the force and torque of its contacts, at its velocities in the step; none at set-up.
    """
    t = structs(spec.precision)
    Params, Particles, vec3, wide3 = t.Params, t.Particles, t.vec3, t.wide3
    to_wide = conversions(spec.precision).to_wide

    @wp.func
    def act(
        params: Params, particles: Particles, mode: wp.int32, i: wp.int32, force: vec3, torque: vec3,
        v: wide3, w: wide3,
    ):  # fmt: skip
        if wp.static(spec.moved_groups):
            if mode & SETUP or particles.held[i] < 1:
                return
            power = wp.dot(to_wide(force), v)
            if wp.static(spec.rotation):
                power += wp.dot(to_wide(torque), w)  # mutate: work_of_torque_on_group
            at = (particles.held[i] - 1) * params.n + i
            particles.group_work[at] -= wp.float64(power * params.dt_wide)  # mutate: work_of_group

    return act


@functools.cache
def step_end(spec: Spec) -> Any:
    """A function: second half kick to the full step (not at set-up), first half kick and drift of the next.

    Requests a rebuild where the particle has moved more than half the skin since the last one.
    """
    t = structs(spec.precision)
    real, wide3, vec3 = t.real, t.wide3, t.vec3
    Params, Particles, StepOutput, Body = t.Params, t.Particles, t.StepOutput, body_struct(spec)
    put_body, get_wide, to_wide = body_writer(spec), access(wide3).get, conversions(spec.precision).to_wide
    is_held, pose_of = held_particles(spec).one, held_particles(spec).pose

    @wp.func
    def end_step(
        params: Params, mode: wp.int32, launch: wp.int32, i: wp.int32, x: wide3, v: wide3, w: wide3,
        radius: t.wide, mass: real, force: vec3, torque: vec3, contacts: wp.int32,
        particles: Particles, after: wp.array[Body], output: StepOutput,
    ):  # fmt: skip
        if wp.static(spec.gravity):
            force += mass * params.gravity  # mutate: gravity
        kick = params.kick
        spin_kick = params.spin_kick
        if wp.static(spec.per_particle_mass):
            kick = real(0.5) * params.dt / mass  # mutate: half_kick
            # mutate: half_spin_kick
            spin_kick = real(0.5) * params.dt / (real(0.4) * real(radius) * real(radius) * mass)
        if wp.static(spec.held):
            if is_held(particles, i):
                kick = real(0.0)  # mutate: kick_of_held
                spin_kick = real(0.0)
        second_kick = kick
        second_spin_kick = spin_kick  # mutate: second_spin_kick
        if mode & SETUP:
            second_kick = real(0.0)  # mutate: no_kick_at_setup
            second_spin_kick = real(0.0)
        v = v + to_wide(second_kick * force)  # mutate: second_kick
        if wp.static(spec.rotation):
            w = w + to_wide(second_spin_kick * torque)
        if mode & WRITE:
            output.velocity[i] = v  # mutate: velocity_of_frame
            output.force[i] = force
            output.contacts[i] = contacts
            if wp.static(spec.rotation):
                output.angular_velocity[i] = w
                output.torque[i] = torque
        v = v + to_wide(kick * force)  # mutate: first_kick
        x = x + params.dt_wide * v
        if wp.static(spec.rotation):
            w = w + to_wide(spin_kick * torque)
        if wp.static(spec.moved_groups):
            if particles.held[i] > 0:
                x, v, w = pose_of(params, particles, launch, i)
        v_next = v
        w_next = w
        if wp.static(spec.path):
            v_next = v + to_wide(real(2.0) * kick * force)  # mutate: velocity_ahead
            if wp.static(spec.rotation):
                w_next = w + to_wide(real(2.0) * spin_kick * torque)
        put_body(after, i, x, v, w, v_next, w_next)
        shift = x - get_wide(particles.x_at_rebuild, i)
        if not (wp.dot(shift, shift) <= params.move_limit):  # true for NaN too
            particles.rebuild_pending[launch + 1] = 1  # mutate: ask_rebuild

    return end_step


@functools.cache
def step_kernel(spec: Spec, plain: bool = False, lanes: int = 1) -> Any:
    """The step kernel of one Spec; `plain`: without what only set-up and output need, for steps of mode 0.

    Launched with `lanes` threads a particle, side by side (`gpudem.solver.lanes`). The plain
    one, for CUDA, keeps to the registers that `launch_bounds` leaves a thread.
    """
    options: dict[str, Any] = {} if spec.half_list else {"module_options": {"block_dim": THREADS}}
    if plain:
        options |= {"launch_bounds": (THREADS, blocks_in_flight(spec)), "enable_cuda_smem_spilling": True}
    t = structs(spec.precision)
    real, vec3, wide, wide3 = t.real, t.vec3, t.wide, t.wide3
    Params, Particles, Walls, StepOutput, Laws = (
        t.Params,
        t.Particles,
        t.Walls,
        t.StepOutput,
        laws_struct(spec),
    )
    Body, position_of, end_step = body_struct(spec), body_reader(spec, "position"), step_end(spec)
    of, entry_of = particle_reader(spec), entry_access(spec)
    reach_of, reach_of_wall = contact_reach(spec).pair, contact_reach(spec).wall
    radius_of, mass_of, material_of, pair_of = of.radius, of.mass, of.material, of.pair
    velocity_of, spin_of, velocity_ahead, spin_ahead = of.velocity, of.spin, of.velocity_ahead, of.spin_ahead
    partner, part, spring_of, rolling_of = entry_of.partner, entry_of.part, entry_of.spring, entry_of.rolling
    store = entry_of.store
    get_int, sums = access(wp.int32).get, partial_sums(spec)
    list_of, add_lanes = list_places(spec), lane_sums(spec, lanes)
    first_of, first_wall_of, end_of = list_of.first, list_of.first_wall, list_of.end
    take_partial_sums, add_to_partner = sums.take, sums.add
    geometry, procedure, convert = (
        contact_geometry(spec),
        contact_procedure(spec),
        conversions(spec.precision),
    )
    to_real = convert.to_real
    sphere_contact, wall_contact = geometry.sphere_contact, geometry.wall_contact
    resolve, damping_apart, at_wall = procedure.resolve, procedure.damping_apart, wall_procedure(spec)
    resolve_at_wall, damping_at_wall = at_wall.resolve, at_wall.damping_apart
    nearest = nearest_image(spec.periodic, spec.precision)
    velocity_of_wall = wall_frame(spec).velocity
    decide_on_triangles, makes_no_contact = mesh_contacts(spec), triangle_apart(spec)
    contact_of = wall_entry(spec) if spec.has_walls else None
    fast_gap = fast_floor_gap(spec.precision)
    note, act = wall_action(spec).note, wall_action(spec).act
    mass_at, work_of_group = effective_mass(spec), group_action(spec)

    @wp.func
    def time_of_springs(params: Params, mode: wp.int32):
        """By which springs and their histories go on: none at set-up."""
        if mode & SETUP:
            return real(0.0)  # mutate: no_time_at_setup
        return params.dt

    @wp.kernel(module="unique", enable_backward=False, **options)
    def step(
        # params
        params: Params,
        begin: wp.int32,
        asked_mode: wp.int32,
        launch: wp.int32,
        # in
        laws: Laws,
        walls: Walls,
        now: wp.array[Body],
        # in and out
        particles: Particles,
        # out
        after: wp.array[Body],
        output: StepOutput,
    ):
        i, lane = begin + wp.tid() // wp.static(lanes), wp.tid() % wp.static(lanes)
        mode = asked_mode & wp.static(0 if plain else SETUP | WRITE)
        if get_int(particles.rebuild_pending, launch) != 0:  # an earlier launch made the list out of date
            if i == 0:
                particles.rebuild_pending[launch + 1] = 1  # mutate: launch_after_trip
            return
        x, v, w = position_of(now, i), velocity_of(now, i), spin_of(now, i)
        radius, mass = radius_of(params, particles, i), mass_of(params, particles, i)
        material = material_of(particles, i)
        dt = time_of_springs(params, mode)
        v_next, w_next = v, w
        if wp.static(spec.path):
            v_next, w_next = velocity_ahead(now, i, mode), spin_ahead(now, i, mode)
        force, torque = take_partial_sums(particles, i)
        contacts, block_end = wp.int32(0), (i // params.block + 1) * params.block
        first, first_wall, last = first_of(particles, i), first_wall_of(particles, i), end_of(particles, i)
        begin_k = first + wp.static(spec.list_slice) * lane  # mutate: first_of_lane
        for k in range(begin_k, first_wall, wp.static(spec.list_slice * lanes)):  # particles
            entry = get_int(particles.neighbor, k)
            j = partner(entry)
            d = nearest(x - position_of(now, j), params.size)
            rsq = wp.dot(d, d)
            radius_j = radius_of(params, particles, j)
            reach = reach_of(params, particles, laws, material, j, entry, radius, radius_j)
            if not (rsq < reach * reach):
                part(particles, k, entry, j)  # mutate: forget_partner
                if wp.static(spec.path):  # may overlap half a step before or after
                    reach += wide(0.5) * params.skin  # mutate: path_reach
                    if rsq < reach * reach and not (mode & SETUP):
                        # mutate: pair_at_edge
                        c = sphere_contact(d, rsq, radius, radius_j, mass, mass_of(params, particles, j))
                        if wp.static(spec.held):
                            c.mass_eff = mass_at(params, particles, i, j, mass, c.mass_eff)
                        v_rel, v_rel_next = v - velocity_of(now, j), v_next - velocity_ahead(now, j, mode)
                        pair = pair_of(params, particles, laws, material, j)  # mutate: edge_coefficients
                        f = damping_apart(c, v_rel, v_rel_next, pair, dt)  # mutate: pair_edge_force
                        force += f
                        add_to_partner(particles, i, j, block_end, f, vec3())  # mutate: partner_edge_force
                continue
            c = sphere_contact(d, rsq, radius, radius_j, mass, mass_of(params, particles, j))
            if wp.static(spec.held):
                c.mass_eff = mass_at(params, particles, i, j, mass, c.mass_eff)
            lever_j = real(radius_j) - real(0.5) * c.overlap  # mutate: partner_lever
            v_rel, w_j = v - velocity_of(now, j), spin_of(now, j)
            v_rel_next, w_j_next = v_rel, w_j
            if wp.static(spec.path):
                v_rel_next, w_j_next = v_next - velocity_ahead(now, j, mode), spin_ahead(now, j, mode)
            if wp.static(spec.rotation):
                c.spin = to_real(w - w_j)
            f, n_cross_ft, spring, rolling, stored = resolve(
                c, v_rel, v_rel_next, w, w_next, w_j, w_j_next, lever_j,
                pair_of(params, particles, laws, material, j), spring_of(particles, k, entry),
                rolling_of(particles, k, entry), dt, params.dt,
            )  # fmt: skip
            force += f
            torque -= c.lever * n_cross_ft + rolling  # mutate: pair_torque
            torque_j = rolling - lever_j * n_cross_ft  # mutate: partner_torque
            contacts += 1 + add_to_partner(particles, i, j, block_end, f, torque_j)
            store(particles, k, entry, j, spring, stored, mode)

        if wp.static(spec.has_walls):
            last = wp.where(lane == wp.static(lanes - 1), last, first_wall)  # mutate: walls_of_lane
            decide_on_triangles(params, walls, particles, launch, i, x, radius, first_wall, last)
            for k in range(first_wall, last, wp.static(spec.list_slice)):
                entry = get_int(particles.neighbor, k)
                other = partner(entry)
                note(particles, mode, k, vec3(), vec3(), x)
                if makes_no_contact(params, particles, k, other):
                    part(particles, k, entry, other)  # mutate: part_from_triangle
                    continue
                wall, gap, normal, point = contact_of(params, walls, particles, launch, i, k, other, x)
                v_wall = velocity_of_wall(walls, launch * params.walls + wall, wall, point, normal)
                if wp.static(spec.fast_floors):
                    gap = fast_gap(params, walls, particles, k, wall, gap, normal, radius, v, dt)
                wall_pair = laws.wall_pairs[wall * params.materials + material]  # mutate: wall_coefficients
                if not (gap <= reach_of_wall(params, wall_pair, entry, radius)):
                    part(particles, k, entry, other)  # mutate: forget_wall
                    if wp.static(spec.path):
                        if not (mode & SETUP):
                            c = wall_contact(gap, normal, radius, mass, w)
                            f = damping_at_wall(c, v - v_wall, v_next - v_wall, wall_pair, dt, walls, wall)
                            force += f  # mutate: wall_edge_force
                            act(params, walls, particles, launch, mode, k, wall, i, f, vec3(), point, v_wall)
                    continue
                c = wall_contact(gap, normal, radius, mass, w)
                # mutate: wall_forces
                f, n_cross_ft, spring, rolling, stored = resolve_at_wall(
                    c, v - v_wall, v_next - v_wall, w, w_next, wide3(), wide3(), real(0.0), wall_pair,
                    spring_of(particles, k, entry), rolling_of(particles, k, entry), dt, params.dt,
                    walls, wall,
                )  # fmt: skip
                force += f  # mutate: sum_over_walls
                torque -= c.lever * n_cross_ft + rolling  # mutate: wall_torque
                contacts += 2  # those of particles count at both  # mutate: wall_contact_count
                act(params, walls, particles, launch, mode, k, wall, i, f, -rolling, point, v_wall)
                store(particles, k, entry, other, spring, stored, mode)
        force, torque, contacts = add_lanes(
            particles, output, params.n, i, lane, mode & WRITE, force, torque, contacts
        )
        if lane != wp.static(lanes - 1):
            return
        work_of_group(params, particles, mode, i, force, torque, v, w)
        end_step(params, mode, launch, i, x, v, w, radius, mass, force, torque, contacts,
                 particles, after, output)  # fmt: skip

    return step
