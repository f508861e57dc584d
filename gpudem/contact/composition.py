"""The complete contact law of a scene, composed from its slots when the kernel is built."""

import functools
from typing import Any

import warp as wp

from gpudem.contact import registry
from gpudem.contact.law import AdhesiveLaw
from gpudem.contact.names import LawNames


@functools.cache
def mean_damping(normal: str) -> Any:
    """A function (contact, pair, dt) -> mean damping force [N] over the step around the present position.

    (W(overlap_plus_half) - W(overlap_minus_half))/dt with W the integral of c_n over the overlap: exact for
    that path, also where c_n starts like overlap^(1/4).
    """
    integral = registry.law("normal", normal).damping_integral

    @wp.func
    def mean(c: Any, p: Any, dt: Any):
        return (
            wp.static(integral)(c, p, c.overlap_plus_half) - wp.static(integral)(c, p, c.overlap_minus_half)
        ) / dt

    return mean


@functools.cache
def contact_law(names: LawNames, limit_force: bool, reduce: bool, torsion: bool, path: bool) -> Any:
    """A function (contact, pair, spring, last, dt, step)
    -> (force [N], n x F_t [N], rolling [N m], spring [m], what is stored of the rolling torque [N m]).

    The force is that on i; the torques are -lever (n x F_t) - rolling on i and -lever_j (n x F_t) + rolling
    on j. `spring` [m] is that of the tangential law, `last` [N m] the rolling torque of the last step, of a
    law with history; dt is 0 at set-up, `step` the time step always. Slots that are "off" leave no code.
    Antisymmetric in i and j: both sides of a contact, computed separately, give opposite forces.

    Cohesion is subtracted from the normal force; the limits of friction and rolling torque are of the normal
    force without it, or with `reduce` of what is left.

    With `path` and dt > 0 the damping force is `mean_damping`.
    """
    normal_law = registry.law("normal", names.normal)
    stiffness, adhesive = normal_law.stiffness, isinstance(normal_law, AdhesiveLaw)
    limiting_load = normal_law.load if adhesive else None
    damping_over_step = mean_damping(names.normal)
    tangential_law: Any = registry.find("tangential", names.tangential)
    rolling_law: Any = registry.find("rolling", names.rolling)
    cohesion_law: Any = registry.find("cohesion", names.cohesion)
    tangential_force = tangential_law.force if tangential_law else None
    rolling_torque_of = (rolling_law.with_torsion if torsion else rolling_law.torque) if rolling_law else None
    damped = rolling_law is not None and rolling_law.damped
    attraction = cohesion_law.attraction if cohesion_law else None

    @wp.func
    def law(c: Any, p: Any, spring: Any, last: Any, dt: Any, step: Any):
        if wp.static(adhesive):
            elastic, kn, kt, cn, ct = wp.static(stiffness)(c, p)
        else:
            kn, kt, cn, ct = wp.static(stiffness)(c, p)
            elastic = kn * c.overlap
        damping = -cn * c.normal_velocity
        if wp.static(path):
            if dt > type(dt)(0.0):
                damping = wp.static(damping_over_step)(c, p, dt)
        fn = elastic + damping  # mutate: normal_force
        if wp.static(limit_force):
            fn = wp.max(fn, type(fn)(0.0))  # mutate: no_attraction
        force = fn * c.normal
        if wp.static(attraction is not None):
            left = fn - wp.static(attraction)(c, p)  # mutate: cohesion
            force = left * c.normal
            if wp.static(reduce):
                fn = left  # mutate: tangential_reduce
        if wp.static(adhesive):
            fn = wp.static(limiting_load)(c, p, fn)
        n_cross_ft = type(c.normal)()
        if wp.static(tangential_force is not None):
            ft, spring_new = wp.static(tangential_force)(c, p, kt, ct, fn, spring)  # mutate: tangential_law
            force = force + ft
            n_cross_ft = wp.cross(c.normal, ft)  # mutate: friction_torque
        else:
            spring_new = spring
        rolling_torque = type(c.normal)()
        stored = rolling_torque
        if wp.static(damped):
            rolling_torque, stored = wp.static(rolling_torque_of)(c, p, kn, kt, fn, last, step)
        elif wp.static(rolling_torque_of is not None):
            rolling_torque = wp.static(rolling_torque_of)(c, p, kn, kt, fn, last, step)
            stored = rolling_torque
        return force, n_cross_ft, rolling_torque, spring_new, stored

    return law


@functools.cache
def damping_force(normal: str, limit_force: bool) -> Any:
    """A function (contact, pair, dt) -> mean damping force on i [N] over the step around this position.

    For bodies that do not overlap at the step itself, but half a step before or after it: the windows of
    consecutive steps join, so no part of the damping's integral is lost or counted twice.
    """
    damping_over_step = mean_damping(normal)

    @wp.func
    def force(c: Any, p: Any, dt: Any):
        if c.overlap_minus_half > type(dt)(0.0) or c.overlap_plus_half > type(dt)(0.0):
            fn = wp.static(damping_over_step)(c, p, dt)
            if wp.static(limit_force):
                fn = wp.max(fn, type(fn)(0.0))
            return fn * c.normal
        return type(c.normal)()

    return force
