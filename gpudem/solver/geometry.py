# pyright: reportInvalidTypeForm=false
"""From positions and velocities to a `Contact`, and from it to forces: one procedure for pairs and walls."""

import dataclasses
import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from gpudem.contact.composition import contact_law, damping_force
from gpudem.contact.types import WIDE, contact_struct
from gpudem.solver.spec import Spec
from gpudem.solver.state import structs


@functools.cache
def nearest_image(periodic: tuple[bool, bool, bool], precision: str) -> Any:
    """A function (d, size) -> d between nearest images; no code for sides that are not periodic."""
    real = WIDE[precision]
    vec3 = wp.types.vector(3, real)
    px, py, pz = periodic

    @wp.func
    def wrap(d: real, size: real):
        half = real(0.5) * size
        if d > half:
            d = d - size
        elif d < -half:
            d = d + size  # mutate: image_from_below
        return d

    @wp.func
    def nearest(d: vec3, size: vec3):
        x, y, z = d[0], d[1], d[2]
        if wp.static(px):  # mutate: nearest_image
            x = wrap(x, size[0])
        if wp.static(py):
            y = wrap(y, size[1])
        if wp.static(pz):
            z = wrap(z, size[2])
        return vec3(x, y, z)

    return nearest


@functools.cache
def conversions(precision: str) -> SimpleNamespace:
    """The functions to_real and to_wide between the vectors of the two precisions."""
    t = structs(precision)
    real, vec3, wide, wide3 = t.real, t.vec3, t.wide, t.wide3
    mixed = real is not wide

    @wp.func
    def to_real(a: wide3):
        if wp.static(mixed):
            b = vec3(real(a[0]), real(a[1]), real(a[2]))
        else:
            b = a
        return b

    @wp.func
    def to_wide(a: vec3):
        if wp.static(mixed):
            b = wide3(wide(a[0]), wide(a[1]), wide(a[2]))
        else:
            b = a
        return b

    return SimpleNamespace(to_real=to_real, to_wide=to_wide)


@functools.cache
def contact_geometry(spec: Spec) -> SimpleNamespace:
    """The functions sphere_contact and wall_contact of one Spec: overlap, normal, lever, effective values."""
    t = structs(spec.precision)
    real, wide, wide3 = t.real, t.wide, t.wide3
    Contact = contact_struct(real)
    mixed = real is not wide
    to_real = conversions(spec.precision).to_real

    @wp.func
    def sphere_contact(d: wide3, rsq: wide, wide_ri: wide, wide_rj: wide, mi: real, mj: real):
        c = Contact()
        ri = real(wide_ri)
        rj = real(wide_rj)
        if wp.static(mixed and spec.half_list):
            r = wp.sqrt(rsq)
            c.normal = to_real(d * (wide(1.0) / r))
            c.overlap = real(wide_ri + wide_rj - r)  # mutate: overlap_mixed_half
        elif wp.static(mixed):  # the small difference in float64, without its square root, slow on a GPU
            r = wp.sqrt(real(rsq))
            reach = wide_ri + wide_rj
            c.normal = to_real(d) * (real(1.0) / r)  # mutate: pair_normal_mixed_full
            c.overlap = real(reach * reach - rsq) / (real(reach) + r)  # mutate: overlap_mixed_full
        else:
            r = wp.sqrt(rsq)
            c.normal = d * (real(1.0) / r)  # mutate: pair_normal
            c.overlap = ri + rj - r
        c.lever = ri - real(0.5) * c.overlap  # mutate: pair_lever
        if wp.static(spec.polydisperse):
            c.radius_eff = ri * rj / (ri + rj)  # mutate: effective_radius
        else:
            c.radius_eff = real(0.5) * ri  # mutate: effective_radius_equal
        if wp.static(spec.per_particle_mass):
            c.mass_eff = mi * mj / (mi + mj)  # mutate: effective_mass
        else:
            c.mass_eff = real(0.5) * mi  # mutate: effective_mass_equal
        if wp.static(spec.cohesion != "off"):
            c.inverse_reach = real(1.0) / (ri + rj)  # mutate: inverse_reach
        if wp.static(spec.rolling_inertia):
            inertia_i, inertia_j = mi * ri * ri, mj * rj * rj
            # mutate: effective_inertia
            c.inertia_eff = real(1.4) * (inertia_i * inertia_j / (inertia_i + inertia_j))
        return c

    @wp.func
    def wall_contact(gap: wide, normal: wide3, radius: wide, mass: real, w: wide3):
        c = Contact()
        c.normal = to_real(normal)  # mutate: wall_normal
        c.overlap = real(radius - gap)
        c.lever = real(radius) - real(0.5) * c.overlap  # mutate: wall_lever
        c.radius_eff = real(radius)  # mutate: wall_effective_radius
        c.mass_eff = mass  # mutate: wall_effective_mass
        if wp.static(spec.rotation):  # the gap is far above the bound unless a guard was waived
            c.spin = (c.lever / real(wp.max(gap, wide(0.01) * radius))) * to_real(w)  # mutate: wall_spin
        if wp.static(spec.rolling_inertia):
            c.inertia_eff = real(1.4) * mass * c.radius_eff * c.radius_eff  # mutate: wall_inertia
        return c

    return SimpleNamespace(sphere_contact=sphere_contact, wall_contact=wall_contact)


@functools.cache
def contact_procedure(spec: Spec) -> SimpleNamespace:
    """What a step does with a contact, of two particles or at a wall: resolve and damping_apart.

    resolve(contact, relative velocity of the centres half a step behind and ahead, angular velocities of i
    and j likewise, lever of j, pair, spring, last rolling torque, dt, step)
    -> (force on i, n x F_t, spring after the step, rolling torque, what is stored of it); the torque on i is
    -(lever (n x F_t) + rolling torque), that on j is rolling torque - lever_j (n x F_t).
    damping_apart(contact, velocities likewise, pair, dt) -> force on i, of bodies that do not overlap at the
    step itself (integrator "path").
    """
    t = structs(spec.precision)
    real, vec3, wide3 = t.real, t.vec3, t.wide3
    Contact = contact_struct(real)
    to_real = conversions(spec.precision).to_real
    law = contact_law(
        spec.law_names[0], spec.limit_force, spec.tangential_reduce, spec.torsion, spec.path
    )  # fmt: skip
    damping = damping_force(spec.normal, spec.limit_force)

    @wp.func
    def set_relative_motion(c: Contact, v: vec3, v_next: vec3, dt: real):
        """Velocities of the contact point, i against j: half a step behind and ahead; dt = 0 at set-up."""
        mean = v
        if wp.static(spec.path):
            mean = real(0.5) * (v + v_next)
        c.normal_velocity = wp.dot(mean, c.normal)
        c.tangential_velocity = mean - c.normal_velocity * c.normal
        c.slide = dt * c.tangential_velocity
        if wp.static(spec.path):
            closing = -wp.dot(v, c.normal)
            closing_next = -wp.dot(v_next, c.normal)
            c.overlap_minus_half = wp.max(c.overlap - real(0.5) * dt * closing, real(0.0))
            c.overlap_plus_half = wp.max(c.overlap + real(0.5) * dt * closing_next, real(0.0))
            share = real(1.0)
            # mutate: first_share
            if c.overlap <= dt * closing:  # first step of the contact: it slides only since the contact began
                share = c.overlap / (dt * closing)
            c.slide = (share * dt) * (v + closing * c.normal)
        return c

    @wp.func
    def contact_point_velocity(c: Contact, v: wide3, w_i: wide3, w_j: wide3, lever_j: real):
        """Relative velocity of the contact point from that of the centres and the angular velocities."""
        if wp.static(spec.rotation):
            # mutate: contact_point_velocity
            return to_real(v) - wp.cross(c.lever * to_real(w_i) + lever_j * to_real(w_j), c.normal)
        return to_real(v)

    @wp.func
    def resolve(
        c: Contact, v: wide3, v_next: wide3, w_i: wide3, w_i_next: wide3, w_j: wide3, w_j_next: wide3,
        lever_j: real, pair: Any, spring: vec3, last: vec3, dt: real, step: real,
    ):  # fmt: skip
        v_point = contact_point_velocity(c, v, w_i, w_j, lever_j)
        v_point_next = v_point
        if wp.static(spec.path):
            v_point_next = contact_point_velocity(c, v_next, w_i_next, w_j_next, lever_j)
        c = set_relative_motion(c, v_point, v_point_next, dt)
        force, n_cross_ft, rolling, spring_new, stored = law(c, pair, spring, last, dt, step)
        return force, n_cross_ft, spring_new, rolling, stored

    @wp.func
    def damping_apart(c: Contact, v: wide3, v_next: wide3, pair: Any, dt: real):
        c = set_relative_motion(c, to_real(v), to_real(v_next), dt)
        return damping(c, pair, dt)

    return SimpleNamespace(resolve=resolve, damping_apart=damping_apart)


@functools.cache
def wall_procedure(spec: Spec) -> SimpleNamespace:
    """The functions of `contact_procedure` for contacts at walls, each of which may have laws of its own.

    resolve and damping_apart take two arguments more, last: the struct `Walls` and the wall.
    """
    own = [
        contact_procedure(dataclasses.replace(spec, **laws._asdict(), wall_laws=()))
        for laws in spec.law_names
    ]
    return SimpleNamespace(
        resolve=_resolve_by_law(spec.precision, [p.resolve for p in own], 0),
        damping_apart=_damping_by_law(spec.precision, [p.damping_apart for p in own], 0),
    )


def _resolve_by_law(precision: str, procedures: list[Any], index: int) -> Any:
    """`resolve` of the laws of a wall: those at `index` or after it; the last need no test."""
    t = structs(precision)
    real, vec3, wide3, Walls = t.real, t.vec3, t.wide3, t.Walls
    Contact = contact_struct(real)
    here, last_one = procedures[index], index == len(procedures) - 1
    rest = here if last_one else _resolve_by_law(precision, procedures, index + 1)

    @wp.func
    def resolve(
        c: Contact, v: wide3, v_next: wide3, w_i: wide3, w_i_next: wide3, w_j: wide3, w_j_next: wide3,
        lever_j: real, pair: Any, spring: vec3, last: vec3, dt: real, step: real,
        walls: Walls, wall: wp.int32,
    ):  # fmt: skip
        if wp.static(not last_one):
            if walls.law[wall] != wp.static(index):  # mutate: law_of_wall
                f, n_cross_ft, spring_new, rolling, stored = rest(
                    c, v, v_next, w_i, w_i_next, w_j, w_j_next, lever_j, pair, spring, last, dt, step,
                    walls, wall,
                )  # fmt: skip
                return f, n_cross_ft, spring_new, rolling, stored
        f, n_cross_ft, spring_new, rolling, stored = here(
            c, v, v_next, w_i, w_i_next, w_j, w_j_next, lever_j, pair, spring, last, dt, step
        )
        return f, n_cross_ft, spring_new, rolling, stored

    return resolve


def _damping_by_law(precision: str, procedures: list[Any], index: int) -> Any:
    """`damping_apart`, likewise."""
    t = structs(precision)
    real, wide3, Walls = t.real, t.wide3, t.Walls
    Contact = contact_struct(real)
    here, last_one = procedures[index], index == len(procedures) - 1
    rest = here if last_one else _damping_by_law(precision, procedures, index + 1)

    @wp.func
    def damping_apart(
        c: Contact, v: wide3, v_next: wide3, pair: Any, dt: real, walls: Walls, wall: wp.int32
    ):  # fmt: skip
        if wp.static(not last_one):
            if walls.law[wall] != wp.static(index):
                return rest(c, v, v_next, pair, dt, walls, wall)
        return here(c, v, v_next, pair, dt)

    return damping_apart
