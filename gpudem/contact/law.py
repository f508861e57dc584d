"""The whole contact law of a scene, put together from its slots at build time."""

import functools
from typing import Any

import warp as wp

from gpudem.contact.normal import DAMPING_WORK, NORMAL
from gpudem.contact.rolling import ROLLING
from gpudem.contact.tangential import TANGENTIAL


@functools.cache
def contact_law(normal: str, tangential: str, rolling: str, limit_force: bool, path: bool) -> Any:
    """A function (contact, pair, spring, dt) -> (force on i [N], torque on i [N m], spring [m]).

    Slots that are "off" leave no code. Antisymmetric in i and j, so that both sides of a contact
    computed apart give opposite forces.

    With `path` and dt > 0 the damping force is its mean over the step from `before` to `after`,
    (W(after) - W(before))/dt with W the integral of c_n over the overlap: exact for that path, also where
    c_n starts like overlap^(1/4). The tangential dashpot takes the mean of its coefficient likewise.
    """
    normal_law = NORMAL[normal]
    damping_work = DAMPING_WORK[normal]
    tangential_law = TANGENTIAL.get(tangential)
    rolling_law = ROLLING.get(rolling)

    @wp.func
    def law(c: Any, p: Any, spring: Any, dt: Any):
        kn, kt, cn, ct = wp.static(normal_law)(c, p)
        damping = -cn * c.normal_velocity
        if wp.static(path):
            if dt > type(dt)(0.0):
                work = wp.static(damping_work)(c, p, c.after) - wp.static(damping_work)(c, p, c.before)
                damping = work / dt
                travel = c.after - c.before
                if wp.abs(travel) > type(dt)(0.001) * c.overlap and cn > type(dt)(0.0):
                    ct = ct * (work / (travel * cn))
        fn = kn * c.overlap + damping
        if wp.static(limit_force):
            fn = wp.max(fn, type(fn)(0.0))
        force = fn * c.normal
        torque = type(c.normal)()
        if wp.static(tangential_law is not None):
            ft, spring_new = wp.static(tangential_law)(c, p, kt, ct, fn, spring)
            force = force + ft
            torque = -c.lever * wp.cross(c.normal, ft)
        else:
            spring_new = spring
        if wp.static(rolling_law is not None):
            torque = torque - wp.static(rolling_law)(c, p, kn)
        return force, torque, spring_new

    return law
