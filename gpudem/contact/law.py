"""The whole contact law of a scene, put together from its slots at build time."""

import functools
from typing import Any

import warp as wp

from gpudem.contact.normal import DAMPING_WORK, NORMAL
from gpudem.contact.rolling import ROLLING
from gpudem.contact.tangential import TANGENTIAL


@functools.cache
def mean_damping(normal: str) -> Any:
    """A function (contact, pair, dt) -> damping force [N], its mean over the step from `before` to `after`.

    (W(after) - W(before))/dt with W the integral of c_n over the overlap: exact for that path, also where c_n
    starts like overlap^(1/4).
    """
    damping_work = DAMPING_WORK[normal]

    @wp.func
    def mean(c: Any, p: Any, dt: Any):
        return (wp.static(damping_work)(c, p, c.after) - wp.static(damping_work)(c, p, c.before)) / dt

    return mean


@functools.cache
def contact_law(normal: str, tangential: str, rolling: str, limit_force: bool, path: bool) -> Any:
    """A function (contact, pair, spring, kept, dt, step) -> (force [N], turn [N], rolling [N m], spring).

    The force is that on i; with turn = n x F_t the torques are -lever turn - rolling on i and
    -lever_j turn + rolling on j. `spring` [m] is that of the tangential law, `kept` [N m] the torque
    `rolling` of the last step, of a law in `KEEPS_TORQUE`; dt is 0 at set-up, `step` the time step always.
    Slots that are "off" leave no code. Antisymmetric in i and j: both sides of a contact computed apart give
    opposite forces.

    With `path` and dt > 0 the damping force is `mean_damping`, and the tangential dashpot takes the mean of
    its coefficient likewise.
    """
    normal_law = NORMAL[normal]
    damping_over_step = mean_damping(normal)
    tangential_law = TANGENTIAL.get(tangential)
    rolling_law = ROLLING.get(rolling)

    @wp.func
    def law(c: Any, p: Any, spring: Any, kept: Any, dt: Any, step: Any):
        kn, kt, cn, ct = wp.static(normal_law)(c, p)
        damping = -cn * c.normal_velocity
        if wp.static(path):
            if dt > type(dt)(0.0):
                damping = wp.static(damping_over_step)(c, p, dt)
                travel = c.after - c.before
                if wp.abs(travel) > type(dt)(0.001) * c.overlap and cn > type(dt)(0.0):
                    ct = ct * (damping * dt / (travel * cn))
        fn = kn * c.overlap + damping
        if wp.static(limit_force):
            fn = wp.max(fn, type(fn)(0.0))
        force = fn * c.normal
        turn = type(c.normal)()
        if wp.static(tangential_law is not None):
            ft, spring_new = wp.static(tangential_law)(c, p, kt, ct, fn, spring)
            force = force + ft
            turn = wp.cross(c.normal, ft)
        else:
            spring_new = spring
        rolling_torque = type(c.normal)()
        if wp.static(rolling_law is not None):
            rolling_torque = wp.static(rolling_law)(c, p, kn, kt, fn, kept, step)
        return force, turn, rolling_torque, spring_new

    return law


@functools.cache
def damping_force(normal: str, limit_force: bool) -> Any:
    """A function (contact, pair, dt) -> mean damping force on i [N] over the step from `before` to `after`.

    For pairs apart at the step itself, whose path reaches into contact half a step before or ahead: the
    windows of consecutive steps join, so nothing of the damping's integral is lost or counted twice.
    """
    damping_over_step = mean_damping(normal)

    @wp.func
    def force(c: Any, p: Any, dt: Any):
        if c.before > type(dt)(0.0) or c.after > type(dt)(0.0):
            fn = wp.static(damping_over_step)(c, p, dt)
            if wp.static(limit_force):
                fn = wp.max(fn, type(fn)(0.0))
            return fn * c.normal
        return type(c.normal)()

    return force
