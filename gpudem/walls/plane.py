"""The infinite plane."""

from typing import Any

import warp as wp

from gpudem.walls.registry import WallKind


@wp.func
def plane(walls: Any, w: wp.int32, x: Any):
    """Gap [m] of a point from plane w, positive on the side that its normal points to, and that normal.

    direction: the normal; size[0]: normal . point of the plane [m].
    """
    normal = walls.direction[w]
    return wp.dot(normal, x) - walls.size[w][0], normal  # mutate: plane_distance


KIND = WallKind("plane", plane)
