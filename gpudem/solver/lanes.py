# pyright: reportInvalidTypeForm=false, reportIndexIssue=false
"""Several threads ("lanes") for one particle: each takes every so many of its list entries.

A step lasts as long as its longest thread, which follows its entries one after the other. Where particles
are too few to keep a GPU busy, lanes shorten that. Each lane leaves its sums in memory; the last one of a
particle does the walls, adds the sums up in order of the lanes, and ends the step. So results repeat to the
last bit; from those of one thread they differ by rounding, for the order of the sum is another. The lanes of
a particle are neighboring threads of one warp; a CPU runs them one after the other.
"""

import functools
from typing import Any

import warp as wp

from gpudem.solver.arrays import access
from gpudem.solver.spec import Spec
from gpudem.solver.state import structs

#: What is possible: lanes of a particle must lie within a warp of 32.
LANES = (1, 2, 4, 8, 16, 32)


def lanes_for(particles: int) -> int:
    """How many lanes a particle gets on a GPU, of so many particles.

    One: several are built and tested, but no GPU has measured from how few particles on they pay.
    `Solver(lanes=...)` and tools/gpu ask for others.
    """
    return 1


@functools.cache
def wait_for_lanes(lanes: int) -> Any:
    """A function (lane): what the lanes of a particle wrote before it can be read by all of them after it."""
    code = f"""
#if defined(__CUDA_ARCH__)
__syncwarp({(1 << lanes) - 1}u << ((threadIdx.x & 31u) - (unsigned int)lane));
#endif
"""

    @wp.func_native(code)
    def wait(lane: wp.int32): ...

    return wait


@functools.cache
def lane_sums(spec: Spec, lanes: int) -> Any:
    """A function (particles, output, n, i, lane, counts, force, torque, contacts) -> the last three, summed.

    Of all lanes of particle i, for the last of them. `counts` is not 0 where contacts are
    wanted: then `output.contacts` holds them.
    """
    t = structs(spec.precision)
    Particles, StepOutput, vec3 = t.Particles, t.StepOutput, t.vec3
    vectors, integers, wait = access(vec3), access(wp.int32), wait_for_lanes(lanes)
    get, put, get_int, put_int = vectors.get, vectors.put, integers.get, integers.put

    @wp.func
    def alone(
        particles: Particles, output: StepOutput, n: wp.int32, i: wp.int32, lane: wp.int32,
        counts: wp.int32, force: vec3, torque: vec3, contacts: wp.int32,
    ):  # fmt: skip
        return force, torque, contacts

    @wp.func
    def add_up(
        particles: Particles, output: StepOutput, n: wp.int32, i: wp.int32, lane: wp.int32,
        counts: wp.int32, force: vec3, torque: vec3, contacts: wp.int32,
    ):  # fmt: skip
        at = lane * n + i  # mutate: place_of_lane
        put(particles.partial_force, at, force)
        if wp.static(spec.rotation):
            put(particles.partial_torque, at, torque)
        if counts != 0:
            put_int(output.contacts, at, contacts)
        wait(lane)
        total_force, total_torque = get(particles.partial_force, i), vec3()
        for k in range(1, wp.static(lanes)):  # mutate: lanes_added
            total_force += get(particles.partial_force, k * n + i)
        if wp.static(spec.rotation):
            for k in range(wp.static(lanes)):
                total_torque += get(particles.partial_torque, k * n + i)  # mutate: torque_of_lane
        touching = wp.int32(0)
        if counts != 0:
            for k in range(wp.static(lanes)):
                touching += get_int(output.contacts, k * n + i)
        return total_force, total_torque, touching

    return add_up if lanes > 1 else alone
