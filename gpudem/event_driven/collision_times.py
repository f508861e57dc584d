# pyright: reportInvalidTypeForm=false
"""Closed-form times to the next contact of sphere and plane, sphere and sphere, without cancellation."""

import warp as wp

from gpudem.event_driven.event_state import NEVER, real, vec3


@wp.func
def time_to_plane(h: real, w: real, a: real):
    """First t >= 0 [s] at which h + w t + a t^2/2 falls through zero; NEVER if it does not.

    h: height of the surface over the plane [m]; w, a: velocity and acceleration away from it [m/s, m/s2].
    """
    if h <= real(0.0) and w < real(0.0):
        return real(0.0)
    if a < real(0.0):
        s = wp.sqrt(wp.max(w * w - real(2.0) * a * h, real(0.0)))
        if w >= real(0.0):
            return (w + s) / (-a)
        return real(2.0) * h / (s - w)
    if w >= real(0.0):
        return NEVER
    q = w * w - real(2.0) * a * h
    if q < real(0.0):
        return NEVER
    return real(2.0) * h / (wp.sqrt(q) - w)


@wp.func
def time_to_pair_collision(r: vec3, u: vec3, d: real):
    """First t >= 0 [s] at which |r + u t| falls through d; NEVER if it does not (Bannerman et al. 2014).

    r, u: relative position [m] and velocity [m/s]; d: sum of the radii [m]. Touching and approaching: 0.
    """
    b = wp.dot(r, u)
    if b >= real(0.0):
        return NEVER
    c = wp.dot(r, r) - d * d
    if c <= real(0.0):
        return real(0.0)
    q = b * b - wp.dot(u, u) * c  # mutate: meeting_discriminant
    if q <= real(0.0):
        return NEVER
    return c / (wp.sqrt(q) - b)  # mutate: meeting_root
