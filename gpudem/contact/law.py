"""The whole contact law of a scene, put together from its slots at build time."""

import functools
from typing import Any

import warp as wp

from gpudem.contact.normal import NORMAL
from gpudem.contact.rolling import ROLLING
from gpudem.contact.tangential import TANGENTIAL


@functools.cache
def contact_law(normal: str, tangential: str, rolling: str, limit_force: bool) -> Any:
    """A function (contact, pair, spring, dt) -> (force on i [N], torque on i [N m], spring [m]).

    Slots that are "off" leave no code. Antisymmetric in i and j, so that both sides of a contact
    computed apart give opposite forces.
    """
    normal_law = NORMAL[normal]
    tangential_law = TANGENTIAL.get(tangential)
    rolling_law = ROLLING.get(rolling)

    @wp.func
    def law(c: Any, p: Any, spring: Any, dt: Any):
        kn, kt, cn, ct = wp.static(normal_law)(c, p)
        fn = kn * c.overlap - cn * c.normal_velocity
        if wp.static(limit_force):
            fn = wp.max(fn, type(fn)(0.0))
        force = fn * c.normal
        torque = type(c.normal)()
        if wp.static(tangential_law is not None):
            ft, spring_new = wp.static(tangential_law)(c, p, kt, ct, fn, spring, dt)
            force = force + ft
            torque = -c.lever * wp.cross(c.normal, ft)
        else:
            spring_new = spring
        if wp.static(rolling_law is not None):
            torque = torque - wp.static(rolling_law)(c, p, kn)
        return force, torque, spring_new

    return law
