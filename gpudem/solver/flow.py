# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportIndexIssue=false, reportInvalidTypeForm=false, reportOperatorIssue=false
"""Flow through faces of limited size: crossings of each particle, counted in every step on the device."""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp

from gpudem.scene import Scene, flow
from gpudem.scene.regions import Disc, Rectangle
from gpudem.scene.sections import FlowPlane
from gpudem.solver.body import body_reader, body_struct
from gpudem.solver.device import compile_kernels
from gpudem.solver.geometry import nearest_image
from gpudem.solver.spec import Spec
from gpudem.solver.state import State, structs
from gpudem.solver.thread_pool import CpuThreadPool


@functools.cache
def face_struct(precision: str) -> Any:
    """The struct `FlowFace`."""
    wide, wide3 = structs(precision).wide, structs(precision).wide3

    @wp.struct
    class FlowFace:
        middle: wide3  # [m]
        normal: wide3  # unit vector, along the flow that counts as positive [1]
        first: wide3  # of a rectangle: along its first edge, of length 2 / its length [1/m]; of a disc: 0
        second: wide3  # likewise
        radius: wide  # of a disc [m]; of a rectangle: 0

    return FlowFace


@functools.cache
def crossing_kernel(spec: Spec) -> Any:
    """Counts, by face and row of the scene, the particles whose last step crossed a face.

    The side of each face on which a particle is stays in memory: rounding cannot count a crossing twice or
    leave it out. With `only_sides`, and for a particle that has just come, nothing is counted.
    """
    t = structs(spec.precision)
    wide, FlowFace = t.wide, face_struct(spec.precision)
    position_of, velocity_of = body_reader(spec, "position"), body_reader(spec, "velocity")
    nearest = nearest_image(spec.periodic, spec.precision)

    @wp.func
    def is_within(face: FlowFace, d: t.wide3):
        if face.radius > wide(0.0):
            return wp.dot(d, d) <= face.radius * face.radius
        # mutate: within_rectangle
        return wp.abs(wp.dot(d, face.first)) <= wide(1.0) and wp.abs(wp.dot(d, face.second)) <= wide(1.0)

    @wp.kernel(module="unique", enable_backward=False)
    def count_crossings(
        # params
        params: t.Params,
        begin: wp.int32,
        launch: wp.int32,
        only_sides: wp.int32,
        # in
        faces: wp.array[FlowFace],
        particles: t.Particles,
        now: wp.array[body_struct(spec)],
        # in and out
        side: wp.array2d[wp.int32],
        crossed: wp.array2d[wp.int32],
    ):
        i = begin + wp.tid()
        if particles.rebuild_pending[launch] != 0:  # the bodies are those of an earlier step
            return
        row = particles.id[i]
        x, v = position_of(now, i), velocity_of(now, i)
        for f in range(faces.shape[0]):
            face = faces[f]
            distance, speed = wp.dot(x - face.middle, face.normal), wp.dot(v, face.normal)
            here = wp.where(distance > wide(0.0), wp.int32(1), wp.int32(-1))
            before = side[f, row]
            side[f, row] = here
            if here == before or before == 0 or only_sides != 0:
                continue
            since = wide(0.0)  # the crossing [s]
            if speed != wide(0.0):
                since = wp.clamp(distance / speed, wide(0.0), params.dt_wide)
            place = x - since * v  # mutate: place_of_crossing
            if is_within(face, nearest(place - face.middle, params.size)):
                crossed[f, row] = crossed[f, row] + here  # mutate: count_of_crossing

    return count_crossings


class FlowCounter:
    """The faces of `output.flow` on the device. It must be launched once in each step, before its forces, and
    before a rebuild of the list in which particles may leave; a second launch in a step changes nothing.
    """

    def __init__(self, scene: Scene, state: State, params: Any, pool: CpuThreadPool):
        self._state, self._params, self._pool = state, params, pool
        self._stated, device, precision = flow.faces(scene), state.device, state.spec.precision
        kind = face_struct(precision)
        self._faces = wp.array(
            [_on_device(plane, kind, precision) for plane in self._stated], dtype=kind, device=device
        )
        shape = (len(self._stated), state.n)
        self._side, self._crossed = (wp.zeros(shape, dtype=wp.int32, device=device) for _ in range(2))
        self._launches: dict[tuple[int, int, int, bool], Callable[[], None]] = {}
        self._kernel = crossing_kernel(state.spec)
        compile_kernels(device, [self._kernel])

    def forget_launches(self) -> None:
        """Arrays or the number of particles have changed."""
        self._launches.clear()

    def count(self, launch: int = 0, only_sides: bool = False) -> None:
        """Count in the present step.

        only_sides: it is a set-up, before which particles may have been put elsewhere.
        """
        state = self._state
        key = (id(state.now), state.side, launch, only_sides)
        if key not in self._launches:
            inputs = [launch, int(only_sides), self._faces, state.particles, state.now]
            outputs = [self._side, self._crossed]
            self._launches[key] = self._pool.record_launch(self._kernel, self._params, inputs, outputs)
        self._launches[key]()

    def crossings(self) -> dict[str, np.ndarray]:
        """Net crossings of each face since the start by row of the scene, (n,), by name."""
        found = self._crossed.numpy()
        return {plane.name: found[k] for k, plane in enumerate(self._stated)}

    def memory_bytes(self) -> dict[str, int]:
        """Bytes of its arrays of particles, by name."""
        return {"flow.side": 4 * self._side.size, "flow.crossed": 4 * self._crossed.size}

    def saved(self) -> dict[str, np.ndarray]:
        """For a restart file."""
        return {"flow_side": self._side.numpy().copy(), "flow_crossed": self._crossed.numpy().copy()}

    def load(self, saved: dict[str, np.ndarray]) -> None:
        """Take over what `saved` gave."""
        self._side.assign(saved["flow_side"])  # mutate: side_at_restart
        self._crossed.assign(saved["flow_crossed"])


def _on_device(plane: FlowPlane, kind: Any, precision: str) -> Any:
    """A face as the struct `kind`."""
    wide3, found, face = structs(precision).wide3, kind(), plane.face
    found.middle, found.normal = wide3(*plane.origin), wide3(*plane.direction)
    if isinstance(face, Disc):
        found.radius = face.radius
    else:
        assert isinstance(face, Rectangle)
        first, second = (2 * np.array(edge) / np.dot(edge, edge) for edge in face.edges)
        found.first, found.second = wide3(*first), wide3(*second)
    return found
