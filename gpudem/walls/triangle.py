"""The nearest point of a triangle, and which of its features it lies on."""

from typing import Any

import warp as wp

#: Features: the face, edge k from corner k to the next, corner k.
FACE, EDGE, CORNER = wp.constant(0), wp.constant(1), wp.constant(4)


@wp.func
def nearest_of_triangle(x: Any, a: Any, b: Any, c: Any):
    """(point of the triangle a, b, c nearest to x, feature: FACE, EDGE + k or CORNER + k).

    By the Voronoi regions of its features: Ericson, Real-Time Collision Detection, 2005, section 5.1.5. A
    point over an edge is one of the face.
    """
    zero = x[0] - x[0]
    ab, ac, ax = b - a, c - a, x - a
    d1, d2 = wp.dot(ab, ax), wp.dot(ac, ax)
    if d1 <= zero and d2 <= zero:
        return a, wp.int32(CORNER)
    bx = x - b
    d3, d4 = wp.dot(ab, bx), wp.dot(ac, bx)
    if d3 >= zero and d4 <= d3:
        return b, wp.int32(CORNER + 1)
    vc = d1 * d4 - d3 * d2
    if vc < zero and d1 >= zero and d3 <= zero:
        return a + (d1 / (d1 - d3)) * ab, wp.int32(EDGE)
    cx = x - c
    d5, d6 = wp.dot(ab, cx), wp.dot(ac, cx)
    if d6 >= zero and d5 <= d6:
        return c, wp.int32(CORNER + 2)
    vb = d5 * d2 - d1 * d6
    if vb < zero and d2 >= zero and d6 <= zero:
        return a + (d2 / (d2 - d6)) * ac, wp.int32(EDGE + 2)
    va = d3 * d6 - d5 * d4
    if va < zero and d4 - d3 >= zero and d5 - d6 >= zero:
        return b + ((d4 - d3) / ((d4 - d3) + (d5 - d6))) * (c - b), wp.int32(EDGE + 1)
    scale = va + vb + vc
    if scale <= zero:  # three corners on a line, which a scene refuses: no division by zero
        return a, wp.int32(CORNER)
    return a + (vb / scale) * ab + (vc / scale) * ac, wp.int32(FACE)
