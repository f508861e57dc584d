"""Attraction in proportion to an area that grows linearly with the overlap (LIGGGHTS `sjkr2`)."""

import math
from typing import Any

import warp as wp

from gpudem.contact.law import DENSITY_WORDS, AreaCohesion, LiggghtsWords


@wp.func
def sjkr2(c: Any, p: Any):
    """Attraction F_c = k A [N]; k is the cohesion energy density [J/m3], A = 2 pi overlap 2 R*.

    At a wall A = 2 pi overlap R: as LIGGGHTS computes it, half of what its manual's formula gives there.
    Source: LIGGGHTS manual, gran_cohesion_sjkr2; walls as measured with LIGGGHTS 3.8.0.
    """
    # mutate: sjkr2_wall
    factor = wp.where(c.inverse_reach > type(c.overlap)(0.0), 4.0, 2.0)
    pi = type(c.overlap)(wp.static(math.pi))
    return p.cohesion * (type(c.overlap)(factor) * pi * c.overlap * c.radius_eff)


class Sjkr2(AreaCohesion):
    """Cohesion energy density k of the pair [J/m3]."""

    name = "sjkr2"
    liggghts = LiggghtsWords("sjkr2", DENSITY_WORDS)


LAW = Sjkr2(sjkr2)
