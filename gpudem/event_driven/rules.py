# pyright: reportArgumentType=false, reportGeneralTypeIssues=false, reportIndexIssue=false, reportInvalidTypeForm=false, reportOperatorIssue=false
"""The rules of collision of hard spheres, and their books: work, dissipation, counts, the log.

Smooth spheres: J_n = (1 + e) m* u_n along the line of centres. Rough ones (Walton, in Particulate Two-Phase
Flow, ed. Roco, 1993, 884): also a tangential impulse at the point of contact, the lesser of that which turns
the sliding velocity g into -beta0 g and that of Coulomb sliding, mu J_n. Spheres always, inertia 2/5 m R^2:
the tangential mass is 2/7 m*. An encounter that the TC model makes elastic is smooth as well: no loss.
This is not the hard limit of Mindlin's contact, whose tangential restitution depends on the angle of impact.
"""

import functools
from typing import Any

import warp as wp

from gpudem.event_driven.events import (
    DISSIPATED,
    GUARDED,
    HITS,
    OVERLAP,
    PAIRS,
    RESTING,
    VIRIAL,
    WALL,
    WORK,
    Events,
    bring,
    real,
    vec3,
)


@wp.func
def soon(s: Events, i: int, t: real):
    """TC model: is the last collision of i so recent that this one is elastic?"""
    return t - s.last[i] < s.guard


@wp.func
def note(s: Events, i: int, partner: int, t: real, changed: bool):
    """Log and count a collision of i."""
    done = wp.int32(s.counts[PAIRS] + s.counts[HITS])
    if done < s.log_size:
        s.log[done] = wp.vec2i(i, partner)
        s.log_time[done] = t
    if changed:
        s.counts[GUARDED] = s.counts[GUARDED] + wp.int64(1)
    s.collisions[i] = s.collisions[i] + 1
    s.last[i] = t


@wp.func
def rub(s: Events, g: vec3, reduced: real, most: real):
    """Tangential impulse [N s] against the sliding velocity g, at most mu J_n; books what it costs."""
    slide = wp.length(g)
    impulse = vec3()
    if slide > real(0.0):
        mass = real(2.0) / real(7.0) * reduced
        size = wp.min((real(1.0) + s.tangential) * mass * slide, most)
        impulse = (-size / slide) * g
        s.sums[DISSIPATED] = s.sums[DISSIPATED] + size * (slide - real(0.5) * size / mass)
    return impulse


@wp.func
def turn(s: Events, i: int, normal: vec3, impulse: vec3):
    """Spin of i after an impulse at its surface, at -R normal."""
    s.spin[i] = s.spin[i] - (real(2.5) / (s.mass[i] * s.radius[i])) * wp.cross(normal, impulse)


@functools.cache
def rules(saw: bool, rough: bool) -> tuple[Any, Any]:
    """(of a wall, of a pair): velocities, spins and books after a collision; predict nothing."""

    @wp.func
    def of_wall(s: Events, i: int, side: int, t: real):
        """Along the normal v' = (1 + e) U - e v by the wall's true velocity; U = 0 is a wall at rest."""
        bring(s, i, t)
        axis = side // 2
        sign = real(1 - 2 * (side % 2))
        v = s.v[i]
        speed = s.wall_speed[side]
        w = sign * v[axis]
        lasting = speed <= real(0.0)
        if wp.static(saw):
            lasting = lasting or s.wall_stroke[side] > real(0.0)
        if lasting and w >= speed:
            s.status[0] = RESTING
            s.status[1] = i
            return
        e = s.wall_restitution[side, s.material[i]]
        elastic = soon(s, i, t)
        used = e
        if elastic:
            used = real(1.0)
        dw = (real(1.0) + used) * (speed - w)
        lost = real(0.5) * s.mass[i] * (real(1.0) - used * used) * (w - speed) * (w - speed)
        s.sums[WORK] = s.sums[WORK] + s.mass[i] * dw * speed
        s.sums[DISSIPATED] = s.sums[DISSIPATED] + lost
        if wp.static(rough):
            if not elastic:
                normal = vec3()
                normal[axis] = sign
                g = v - s.radius[i] * wp.cross(s.spin[i], normal)
                g[axis] = real(0.0)
                most = s.wall_friction[side, s.material[i]] * s.mass[i] * dw
                impulse = rub(s, g, s.mass[i], most)
                turn(s, i, normal, impulse)
                v = v + impulse / s.mass[i]
        v[axis] = v[axis] + sign * dw
        s.v[i] = v
        note(s, i, WALL - side, t, elastic and (wp.static(rough) or e != real(1.0)))
        s.counts[HITS] = s.counts[HITS] + wp.int64(1)

    @wp.func
    def of_pair(s: Events, i: int, j: int, t: real):
        """Impulses along the line of centres and, between rough spheres, across it."""
        bring(s, i, t)
        bring(s, j, t)
        r = s.x[i] - s.x[j]
        for axis in range(3):
            if s.periodic[axis] > 0:
                r[axis] = r[axis] - s.size[axis] * wp.round(r[axis] / s.size[axis])
        distance = wp.length(r)
        normal = r / distance
        u = s.v[i] - s.v[j]
        w = wp.dot(normal, u)
        d = s.radius[i] + s.radius[j]
        e = s.restitution[s.material[i], s.material[j]]
        elastic = soon(s, i, t) or soon(s, j, t)
        used = e
        if elastic:
            used = real(1.0)
        reduced = s.mass[i] * s.mass[j] / (s.mass[i] + s.mass[j])
        impulse = wp.max(-(real(1.0) + used) * reduced * w, real(0.0))  # grazing: rounding must not pull
        s.v[i] = s.v[i] + (impulse / s.mass[i]) * normal
        s.v[j] = s.v[j] - (impulse / s.mass[j]) * normal
        if w < real(0.0):
            lost = real(0.5) * reduced * (real(1.0) - used * used) * w * w
            s.sums[DISSIPATED] = s.sums[DISSIPATED] + lost
        if wp.static(rough):
            if not elastic:
                g = u - w * normal - wp.cross(s.radius[i] * s.spin[i] + s.radius[j] * s.spin[j], normal)
                across = rub(s, g, reduced, s.friction[s.material[i], s.material[j]] * impulse)
                s.v[i] = s.v[i] + across / s.mass[i]
                s.v[j] = s.v[j] - across / s.mass[j]
                turn(s, i, normal, across)
                turn(s, j, normal, across)
        s.sums[VIRIAL] = s.sums[VIRIAL] + impulse * d
        s.sums[OVERLAP] = wp.max(s.sums[OVERLAP], (d - distance) / d)
        note(s, i, j, t, elastic and (wp.static(rough) or e != real(1.0)))
        s.collisions[j] = s.collisions[j] + 1
        s.last[j] = t
        s.counts[PAIRS] = s.counts[PAIRS] + wp.int64(1)

    return of_wall, of_pair
