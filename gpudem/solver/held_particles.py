# pyright: reportInvalidTypeForm=false
"""Particles of groups on the device: which they are."""

import functools
from types import SimpleNamespace

import warp as wp

from gpudem.scene.groups import FREE
from gpudem.solver.arrays import access
from gpudem.solver.spec import Spec
from gpudem.solver.state import structs


@functools.cache
def held_particles(spec: Spec) -> SimpleNamespace:
    """Functions for scenes with groups.

    one(particles, i) and both(particles, i, j): whether contacts do not move i, neither i nor j.
    """
    Particles = structs(spec.precision).Particles
    get_int = access(wp.int32).get

    @wp.func
    def one(particles: Particles, i: wp.int32):
        return get_int(particles.held, i) != wp.static(FREE)

    @wp.func
    def both(particles: Particles, i: wp.int32, j: wp.int32):
        return one(particles, i) and one(particles, j)

    return SimpleNamespace(one=one, both=both)
