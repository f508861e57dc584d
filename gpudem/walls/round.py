"""What cylinder and cone share: a point in cylindrical coordinates about an axis."""

from typing import Any

import warp as wp


@wp.func
def about_axis(x: Any, point: Any, axis: Any):
    """(distance rho [m] of x from the axis, height z [m] above `point` along it, unit vector away from it).

    On the axis itself every direction away from it is as near; one that is perpendicular is taken.
    """
    d = x - point
    z = wp.dot(d, axis)
    radial = d - z * axis
    rho = wp.length(radial)
    zero = z - z
    if rho > zero:
        return rho, z, radial / rho
    aside = type(axis)(zero, axis[2], -axis[1])
    if axis[0] * axis[0] > axis[1] * axis[1]:
        aside = type(axis)(-axis[2], zero, axis[0])
    return rho, z, wp.normalize(aside)
