"""Attraction in proportion to the area in which two spheres overlap (LIGGGHTS `sjkr`)."""

import math
from typing import Any

import warp as wp

from gpudem.contact.law import DENSITY_WORDS, AreaCohesion, LiggghtsWords


@wp.func
def sjkr(c: Any, p: Any):
    """Attraction F_c = k A [N]; k is the cohesion energy density [J/m3], A the area in which they overlap.

        A = pi/4 (r - R_i - R_j)(r + R_i - R_j)(r - R_i + R_j)(r + R_i + R_j)/r^2, without its sign
        at a wall A = pi (R^2 - (R - overlap)^2), its limit for R_j -> infinity

    r is the distance of the centers. F_c is a function of the overlap alone: no force before touch or after
    parting, and no work of adhesion.
    Source: LIGGGHTS manual, gran_cohesion_sjkr.
    """
    one, two = type(c.overlap)(1.0), type(c.overlap)(2.0)
    share = c.overlap * c.inverse_reach  # of the sum of the radii; 0 at a wall
    distance = one - share
    product = type(c.overlap)(4.0) * c.radius_eff - (two - share) * c.overlap  # mutate: sjkr_area
    quarter_pi = type(c.overlap)(wp.static(math.pi / 4))
    return p.cohesion * (quarter_pi * c.overlap * product * (two - share) / (distance * distance))


class Sjkr(AreaCohesion):
    """Cohesion energy density k of the pair [J/m3]."""

    name = "sjkr"
    liggghts = LiggghtsWords("sjkr", DENSITY_WORDS)


LAW = Sjkr(sjkr)
