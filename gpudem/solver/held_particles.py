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
    pose(params, particles, launch, i) -> position, velocity, spin of a particle with a motion after a launch.
    """
    t = structs(spec.precision)
    Params, Particles, wide, wide3 = t.Params, t.Particles, t.wide, t.wide3
    get_int = access(wp.int32).get

    @wp.func
    def one(particles: Particles, i: wp.int32):
        return get_int(particles.held, i) != wp.static(FREE)

    @wp.func
    def both(particles: Particles, i: wp.int32, j: wp.int32):
        return one(particles, i) and one(particles, j)

    @wp.func
    def pose(params: Params, particles: Particles, launch: wp.int32, i: wp.int32):
        k = particles.held[i] - 1
        x = particles.group_rotation[launch, k] * particles.origin[i] + particles.group_shift[launch, k]
        spin = particles.group_spin[launch, k]
        arm = x - particles.group_center[launch, k]
        v = particles.group_velocity[launch, k] + wp.cross(spin, arm)  # mutate: velocity_of_group
        if wp.static(any(spec.periodic)):
            crossed = particles.image[i]
            x = wide3(
                x[0] - wide(crossed[0]) * params.size[0],
                x[1] - wide(crossed[1]) * params.size[1],
                x[2] - wide(crossed[2]) * params.size[2],
            )
        return x, v, spin

    return SimpleNamespace(one=one, both=both, pose=pose)
