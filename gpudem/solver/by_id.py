# pyright: reportAttributeAccessIssue=false, reportIndexIssue=false, reportInvalidTypeForm=false
"""Arrays of particles in order of id, to and from the sorted order of the solver, on the device."""

import functools
from typing import Any

import warp as wp

from gpudem.solver.body import body_reader, body_struct
from gpudem.solver.neighbor_kernels import periodic_wrap
from gpudem.solver.spec import Spec
from gpudem.solver.state import structs


@functools.cache
def gather_by_id(dtype: Any) -> Any:
    """A kernel: out[id] = values of the particle with that id."""

    @wp.kernel(module="unique", enable_backward=False)
    def gather(
        # in
        id: wp.array[wp.int32],
        values: wp.array[dtype],
        # out
        out: wp.array[dtype],
    ):
        i = wp.tid()
        out[id[i]] = values[i]  # mutate: read_by_id

    return gather


@functools.cache
def scatter_by_id(dtype: Any) -> Any:
    """A kernel: values of the particle with an id = given[id]."""

    @wp.kernel(module="unique", enable_backward=False)
    def scatter(
        # in
        id: wp.array[wp.int32],
        given: wp.array[dtype],
        # out
        values: wp.array[dtype],
    ):
        i = wp.tid()
        values[i] = given[id[i]]

    return scatter


@functools.cache
def position_by_id(spec: Spec) -> Any:
    """A kernel: out[id] = position, within the domain on periodic sides."""
    t = structs(spec.precision)
    position_of, wrap = body_reader(spec, "position"), periodic_wrap(t.wide)
    px, py, pz = spec.periodic

    @wp.kernel(module="unique", enable_backward=False)
    def gather(
        # params
        params: t.Params,
        # in
        id: wp.array[wp.int32],
        bodies: wp.array[body_struct(spec)],
        # out
        out: wp.array[t.wide3],
    ):
        i = wp.tid()
        p = position_of(bodies, i)
        x, y, z = p[0], p[1], p[2]
        if wp.static(px):
            x, _x = wrap(x, params.lo[0], params.hi[0])
        if wp.static(py):
            y, _y = wrap(y, params.lo[1], params.hi[1])
        if wp.static(pz):
            z, _z = wrap(z, params.lo[2], params.hi[2])
        out[id[i]] = t.wide3(x, y, z)  # mutate: read_position_by_id

    return gather


@functools.cache
def set_body_by_id(spec: Spec, field: str) -> Any:
    """A kernel: one vector of the Body of each particle = given[id]."""
    t = structs(spec.precision)

    @wp.kernel(module="unique", enable_backward=False)
    def scatter(
        # in
        id: wp.array[wp.int32],
        given: wp.array[t.wide3],
        # out
        bodies: wp.array[body_struct(spec)],
    ):
        i = wp.tid()
        if wp.static(field == "position"):
            bodies[i].position = given[id[i]]
        elif wp.static(field == "velocity"):
            bodies[i].velocity = given[id[i]]  # mutate: write_velocity_by_id
        else:
            bodies[i].angular_velocity = given[id[i]]

    return scatter
