# pyright: reportArgumentType=false, reportGeneralTypeIssues=false, reportIndexIssue=false, reportInvalidTypeForm=false, reportOperatorIssue=false
"""Collision rules of hard spheres, with work, dissipation, counts and the collision log.

Smooth spheres: J_n = (1 + e) m* u_n along the line of centers, m* the reduced mass. Rough spheres (Walton, in
Particulate Two-Phase Flow, ed. Roco, 1993, 884) have a tangential impulse at the contact point as well: the
smaller of the impulse that turns the sliding velocity g into -beta0 g and that of Coulomb sliding, mu J_n.
All particles are spheres with inertia 2/5 m R^2: the tangential mass is 2/7 m*. A collision that the TC model
(Luding and McNamara, Granular Matter 1 (1998) 113) makes elastic has no tangential impulse: it loses nothing.
This is not the hard limit of Mindlin's contact, whose tangential restitution depends on the angle of impact.
"""

import functools
from typing import Any

import warp as wp

from gpudem.event_driven.event_state import (
    DISSIPATED,
    GUARDED,
    MAX_OVERLAP,
    PAIR_COLLISIONS,
    RESTING_ON_WALL,
    VIRIAL,
    WALL_COLLISIONS,
    WALL_PARTNER,
    WORK,
    EventState,
    advance_particle,
    real,
    report_error,
    vec3,
)


@wp.func
def within_guard(s: EventState, i: int, t: real):
    """TC model: less than t_c has passed since the last collision of i, so that this one is elastic."""
    return t - s.last_collision_time[i] < s.guard


@wp.func
def log_collision(s: EventState, i: int, partner: int, t: real, guarded: bool):
    """Append a collision of i to the log and count it for i; guarded: the TC model changed its outcome."""
    done = wp.int32(s.counts[PAIR_COLLISIONS] + s.counts[WALL_COLLISIONS])
    if done < s.log_capacity:
        s.log[done] = wp.vec2i(i, partner)
        s.log_time[done] = t
    if guarded:
        s.counts[GUARDED] = s.counts[GUARDED] + wp.int64(1)
    s.collision_count[i] = s.collision_count[i] + 1
    s.last_collision_time[i] = t


@wp.func
def tangential_impulse(s: EventState, g: vec3, reduced_mass: real, limit: real):
    """Impulse [N s] against the sliding velocity g [m/s], at most `limit` = mu J_n; adds its dissipation."""
    slide = wp.length(g)
    impulse = vec3()
    if slide > real(0.0):
        mass = real(2.0) / real(7.0) * reduced_mass  # mutate: tangential_mass
        # mutate: tangential_impulse
        size = wp.min((real(1.0) + s.tangential_restitution) * mass * slide, limit)
        impulse = (-size / slide) * g
        s.sums[DISSIPATED] = s.sums[DISSIPATED] + size * (slide - real(0.5) * size / mass)
    return impulse


@wp.func
def apply_angular_impulse(s: EventState, i: int, normal: vec3, impulse: vec3):
    """Change of the angular velocity of i by an impulse at its contact point, -R normal from its center."""
    # mutate: spin_after_collision
    s.angular_velocity[i] = s.angular_velocity[i] - (real(2.5) / (s.mass[i] * s.radius[i])) * wp.cross(
        normal, impulse
    )


@functools.cache
def collision_rules(sawtooth: bool, rough: bool) -> tuple[Any, Any]:
    """(collide_with_wall, collide_pair): velocities, sums and counts after a collision; they predict nothing.

    Args:
        sawtooth: At least one wall vibrates with a finite amplitude.
        rough: Collisions have a tangential impulse.
    """

    @wp.func
    def collide_with_wall(s: EventState, i: int, side: int, t: real):
        """Normal velocity v' = (1 + e) U - e v, with the wall velocity U (0: a wall at rest)."""
        advance_particle(s, i, t)
        axis = side // 2
        sign = real(1 - 2 * (side % 2))
        v = s.v[i]
        speed = s.wall_speed[side]
        w = sign * v[axis]  # mutate: wall_normal_speed
        can_rest = speed <= real(0.0)  # mutate: wall_at_rest
        if wp.static(sawtooth):
            can_rest = can_rest or s.wall_amplitude[side] > real(0.0)
        if can_rest and w >= speed:
            report_error(s, RESTING_ON_WALL, i)
            return
        e = s.wall_restitution[side, s.material[i]]
        elastic = within_guard(s, i, t)
        e_used = e
        if elastic:
            e_used = real(1.0)
        dw = (real(1.0) + e_used) * (speed - w)
        lost = real(0.5) * s.mass[i] * (real(1.0) - e_used * e_used) * (w - speed) * (w - speed)
        s.sums[WORK] = s.sums[WORK] + s.mass[i] * dw * speed  # mutate: floor_work
        s.sums[DISSIPATED] = s.sums[DISSIPATED] + lost
        if wp.static(rough):
            if not elastic:
                normal = vec3()
                normal[axis] = sign
                g = v - s.radius[i] * wp.cross(s.angular_velocity[i], normal)
                g[axis] = real(0.0)
                limit = s.wall_friction[side, s.material[i]] * s.mass[i] * dw
                impulse = tangential_impulse(s, g, s.mass[i], limit)
                apply_angular_impulse(s, i, normal, impulse)
                v = v + impulse / s.mass[i]
        v[axis] = v[axis] + sign * dw
        s.v[i] = v
        log_collision(s, i, WALL_PARTNER - side, t, elastic and (wp.static(rough) or e != real(1.0)))
        s.counts[WALL_COLLISIONS] = s.counts[WALL_COLLISIONS] + wp.int64(1)

    @wp.func
    def collide_pair(s: EventState, i: int, j: int, t: real):
        """Impulse along the line of centers and, between rough spheres, across it."""
        advance_particle(s, i, t)
        advance_particle(s, j, t)
        r = s.x[i] - s.x[j]
        for axis in range(3):
            if s.periodic[axis] > 0:
                r[axis] = r[axis] - s.domain_size[axis] * wp.round(r[axis] / s.domain_size[axis])
        distance = wp.length(r)
        normal = r / distance
        u = s.v[i] - s.v[j]
        w = wp.dot(normal, u)  # mutate: pair_normal_speed
        d = s.radius[i] + s.radius[j]
        e = s.restitution[s.material[i], s.material[j]]
        elastic = within_guard(s, i, t) or within_guard(s, j, t)  # mutate: guard_of_pair
        e_used = e
        if elastic:
            e_used = real(1.0)
        reduced_mass = s.mass[i] * s.mass[j] / (s.mass[i] + s.mass[j])
        # grazing: rounding must not make the impulse attractive
        impulse = wp.max(-(real(1.0) + e_used) * reduced_mass * w, real(0.0))
        s.v[i] = s.v[i] + (impulse / s.mass[i]) * normal
        s.v[j] = s.v[j] - (impulse / s.mass[j]) * normal
        if w < real(0.0):
            lost = real(0.5) * reduced_mass * (real(1.0) - e_used * e_used) * w * w
            s.sums[DISSIPATED] = s.sums[DISSIPATED] + lost
        if wp.static(rough):
            if not elastic:
                spin = s.radius[i] * s.angular_velocity[i] + s.radius[j] * s.angular_velocity[j]
                g = u - w * normal - wp.cross(spin, normal)
                mu = s.friction[s.material[i], s.material[j]]
                across = tangential_impulse(s, g, reduced_mass, mu * impulse)  # mutate: coulomb_impulse
                s.v[i] = s.v[i] + across / s.mass[i]
                s.v[j] = s.v[j] - across / s.mass[j]
                apply_angular_impulse(s, i, normal, across)
                apply_angular_impulse(s, j, normal, across)
        s.sums[VIRIAL] = s.sums[VIRIAL] + impulse * d
        s.sums[MAX_OVERLAP] = wp.max(s.sums[MAX_OVERLAP], (d - distance) / d)
        log_collision(s, i, j, t, elastic and (wp.static(rough) or e != real(1.0)))
        s.collision_count[j] = s.collision_count[j] + 1
        s.last_collision_time[j] = t
        s.counts[PAIR_COLLISIONS] = s.counts[PAIR_COLLISIONS] + wp.int64(1)

    return collide_with_wall, collide_pair
