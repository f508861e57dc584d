"""The frustum of a cone: a shell of no thickness between two circles, open at both ends."""

from typing import Any

import warp as wp

from gpudem.walls.registry import WallKind
from gpudem.walls.round import about_axis


@wp.func
def cone(walls: Any, w: wp.int32, x: Any):
    """Distance [m] of a point from the shell and the unit normal towards the point.

    In the half-plane (rho, z) the shell is the segment from (R1, 0) to (R2, L), and the nearest point is that
    of a segment. direction: unit vector of the axis; point: center of the circle R1; size: R1, R2, L [m].
    """
    axis, size = walls.direction[w], walls.size[w]
    rho, z, outward = about_axis(x, walls.point[w], axis)
    widening, length = size[1] - size[0], size[2]
    slant = wp.sqrt(widening * widening + length * length)
    zero, one = slant - slant, slant / slant
    share = ((rho - size[0]) * widening + z * length) / (slant * slant)
    if share > zero and share < one:
        across = (length * outward - widening * axis) / slant  # the normal of the outer side
        height = ((rho - size[0]) * length - z * widening) / slant
        if height < zero:
            return -height, -across  # mutate: inside_of_cone
        return height, across
    share = wp.clamp(share, zero, one)
    away, beyond = rho - size[0] - share * widening, z - share * length
    gap = wp.sqrt(away * away + beyond * beyond)  # mutate: rim_of_cone
    if gap > zero:
        return gap, (away * outward + beyond * axis) / gap
    return gap, outward


KIND = WallKind("cone", cone)
