"""The cylinder: a shell of no thickness, infinite or with two open ends."""

from typing import Any

import warp as wp

from gpudem.walls.registry import WallKind
from gpudem.walls.round import about_axis


@wp.func
def cylinder(walls: Any, w: wp.int32, x: Any):
    """Distance [m] of a point from the shell, |rho - R| beside it, and the unit normal towards the point.

    direction: unit vector of the axis; point: where it begins; size: radius R and length [m], 0 for infinite.
    """
    axis = walls.direction[w]
    rho, z, outward = about_axis(x, walls.point[w], axis)
    away = rho - walls.size[w][0]
    zero = away - away
    length = walls.size[w][1]
    if length > zero:
        beyond = z - wp.clamp(z, zero, length)
        if beyond != zero:  # the nearest point lies on a rim
            gap = wp.sqrt(away * away + beyond * beyond)  # mutate: rim_of_cylinder
            return gap, (away * outward + beyond * axis) / gap
    if away < zero:
        return -away, -outward  # mutate: inside_of_cylinder
    return away, outward


KIND = WallKind("cylinder", cylinder)
