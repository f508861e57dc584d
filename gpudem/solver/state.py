# pyright: reportInvalidTypeForm=false
"""The device arrays of one run, with unit and shape for each; an array that the scene does not need is None.

n particles in sorted (cell) order, m walls. n counts all particles of the run: the first `present` places
hold those that are there, the places behind them mean nothing. Arrays that are None are null on the device:
no kernel built for this scene touches them.
"""

import functools
from types import SimpleNamespace
from typing import Any

import numpy as np
import warp as wp

from gpudem.contact.types import REAL, WIDE
from gpudem.scene import Scene
from gpudem.solver.body import body_struct
from gpudem.solver.group_motion import group_tables
from gpudem.solver.spec import Spec


@functools.cache
def structs(precision: str) -> SimpleNamespace:
    """The argument structs of the kernels in one precision: Params, Particles, Walls, StepOutput.

    `real` is the arithmetic of the contact laws, `wide` that of positions, velocities and radii: the same but
    for "mixed", where an overlap of 1e-7 m is the difference of lengths of 1 m, and a step adds 1e-7 of a
    velocity: both need float64, while float32 is enough for forces and springs, each small by itself.
    """
    real, wide = REAL[precision], WIDE[precision]
    vec3, wide3 = wp.types.vector(3, real), wp.types.vector(3, wide)
    t = SimpleNamespace(real=real, vec3=vec3, wide=wide, wide3=wide3)
    t.Params = _params_struct(real, vec3, wide, wide3)
    t.Particles = _particles_struct(real, vec3, wide, wide3)
    t.Walls = _walls_struct(wide, wide3)
    t.StepOutput = _output_struct(vec3, wide3)
    return t


def _params_struct(real: Any, vec3: Any, wide: Any, wide3: Any) -> Any:
    @wp.struct
    class Params:
        dt: real  # [s]
        dt_wide: wide  # the same, for positions [s]
        gravity: vec3  # [m/s2]
        lo: wide3  # lower corner of the domain [m]
        hi: wide3  # upper corner of the domain [m]
        size: wide3  # length of the domain [m]
        cells: wp.vec3i  # cells along x, y, z
        axes: wp.vec3i  # the axis along which sorted particles vary fastest, the middle one, the slowest
        is_periodic: wp.vec3i  # 1: that axis is periodic
        inv_cell_size: wide3  # cells per length [1/m]
        skin: wide  # [m]
        move_limit: wide  # (skin/2)^2 [m2]
        range: wide  # gap across which the normal law acts [m]
        speed_limit: wide  # squared, of the guard [m2/s2]
        merge_cosine: wide  # contacts of one mesh whose normals' cosine is above it are one
        coplanar_cosine: wide  # LIGGGHTS' rule: triangles whose normals' cosine is not below it are one face
        overlap_limit: wide  # of the guard, relative to the smaller radius [1]
        radius: wide  # of equal spheres; else the largest [m]
        mass: real  # of equal spheres of one material [kg]
        kick: real  # dt/(2 m) of equal spheres [s/kg]
        spin_kick: real  # dt/(2 I) of equal spheres [s/(kg m2)]
        n: wp.int32
        block: wp.int32  # particles of a block: within it a half list holds each pair once
        materials: wp.int32
        walls: wp.int32

    return Params


def _particles_struct(real: Any, vec3: Any, wide: Any, wide3: Any) -> Any:
    @wp.struct
    class Particles:
        id: wp.array[wp.int32]  # row in the scene, (n,)
        radius: wp.array[wide]  # [m], (n,)
        mass: wp.array[real]  # [kg], (n,)
        material: wp.array[wp.int32]  # index into the scene's particle materials, (n,)
        held: wp.array[wp.int32]  # `Scene.held`, (n,)
        origin: wp.array[
            wide3
        ]  # position at the start [m], (n,); of groups with a motion, as is what follows:
        group_rotation: wp.array2d[wp.types.matrix((3, 3), wide)]  # after launch l, of the k-th, (chunk, k)
        group_shift: wp.array2d[wide3]  # what is at X at the start is at rotation X + shift [m], likewise
        group_velocity: wp.array2d[wide3]  # of what is at the center [m/s], likewise
        group_spin: wp.array2d[wide3]  # [rad/s], likewise
        group_center: wp.array2d[wide3]  # [m], likewise
        image: wp.array[wp.vec3i]  # crossings of the periodic sides since the start, (n,)
        x_at_rebuild: wp.array[wide3]  # position at the last rebuild [m], (n,)
        # first list entry of each particle of a half list, (n + 1,), or of each slice of a full one
        start: wp.array[wp.int32]
        count: wp.array[wp.int32]  # list entries, (n,); full list only
        wall_start: wp.array[wp.int32]  # first of them that is a wall, (n,)
        neighbor: wp.array[wp.int32]  # particle j or wall n + w; -that - 1: in contact in the last step
        spring: wp.array[vec3]  # shear spring of each entry [m], (capacity,)  # mutate: spring_array
        # mutate: rolling_torque_array
        rolling_torque: wp.array[vec3]  # stored for each entry [N m], (capacity,)
        # mutate: rise_array
        rise: wp.array[wide]  # of a fast floor since the contact began [m], -1 apart, (capacity,)
        mesh_near: wp.array[wp.int32]  # a particle's triangles within reach, from wall_start on, (capacity,)
        mesh_leader: wp.array[wp.int32]  # entry whose contact a triangle is part of; < 0: none, (capacity,)
        mesh_gap: wp.array[wide]  # from the nearest point of a triangle within reach [m], (capacity,)
        mesh_normal: wp.array[wide3]  # from there to the particle, (capacity,)
        wall_force: wp.array[vec3]  # of a wall on the particle in the written step [N], (capacity,)
        wall_couple: wp.array[vec3]  # rolling torque on the particle, likewise [N m], (capacity,)
        wall_point: wp.array[wide3]  # where the force acts, likewise [m], (capacity,)
        partial_force: wp.array[vec3]  # from particles before it in its block [N], (n,); by lane, (lanes n,)
        partial_torque: wp.array[vec3]  # [N m], (n,), likewise
        group_work: wp.array[wp.float64]  # by moving group k on particles, noted at place i [J], at k n + i
        wall_work: wp.array[wp.float64]  # by moving wall s on the particles at place i [J], at s n + i
        rebuild_pending: wp.array[wp.int32]  # k: the launches from k on wait for a rebuild, (chunk + 1,)

    return Particles


def _walls_struct(wide: Any, wide3: Any) -> Any:
    @wp.struct
    class Walls:
        present: wp.array[wp.int32]  # the walls that are there, ascending
        kind: wp.array[wp.int32]  # position of its kind in Spec.walls, -1: a mesh, (m,)
        law: wp.array[wp.int32]  # 0: the laws between particles, k: those k of Spec.wall_laws, from 1, (m,)
        direction: wp.array[wide3]  # normal of a plane, axis, ...: the kind says, (m,)
        point: wp.array[wide3]  # [m], (m,)
        size: wp.array[wide3]  # [m], (m,)
        displacement: wp.array[wide3]  # in launch l, at l m + w [m], (chunk m,)
        velocity: wp.array[wide3]  # [m/s], (m,); of walls with motions in launch l at l m + w, (chunk m,)
        work_row: wp.array[wp.int32]  # its number among the walls that move, (m,)
        stroke: wp.array[wide]  # the farthest that a saw-tooth's displacement may reach [m], (m,)
        fast: wp.array[wp.int32]  # 1: a fast floor, (m,)
        rotation: wp.array[wp.types.matrix((3, 3), wide)]  # in launch l, at l m + w, (chunk m,)
        spin: wp.array[wide3]  # angular velocity, likewise [rad/s]
        center: wp.array[wide3]  # the point whose velocity is `velocity`, likewise [m]
        surface_velocity: wp.array[wide3]  # of a belt [m/s], (m,)
        bvh: wp.array[wp.uint64]  # of the triangles of a mesh, in its place at the start, (m,)
        mesh_center: wp.array[wide3]  # of a sphere around a mesh, at the start [m], (m,); periodic sides only
        mesh_radius: wp.array[wide]  # of that sphere [m], (m,)
        first_triangle: wp.array[wp.int32]  # of a mesh, (m,)
        triangle_wall: wp.array[wp.int32]  # its mesh, (k,)
        corners: wp.array[wide3]  # three of each triangle, at the start [m], (3 k,)
        facing: wp.array[wide3]  # its unit normal, at the start, (k,)
        middle: wp.array[wide3]  # center of a sphere around it, at the start [m], (k,)
        extent: wp.array[wide]  # radius of that sphere [m], (k,)
        nodes: wp.array[wp.vec3i]  # numbers of its corners: equal where triangles share them, (k,)
        active: wp.array[wp.int32]  # bits 0..2: edges, 3..5: corners that count by LIGGGHTS' rule, (k,)

    return Walls


def _output_struct(vec3: Any, wide3: Any) -> Any:
    @wp.struct
    class StepOutput:
        velocity: wp.array[wide3]  # at the full step [m/s], (n,)
        angular_velocity: wp.array[wide3]  # [rad/s], (n,)
        force: wp.array[vec3]  # with gravity [N], (n,)
        torque: wp.array[vec3]  # [N m], (n,)
        contacts: wp.array[wp.int32]  # with particles + 2 x with walls, (n,), and of each lane but the first

    return StepOutput


class State:
    """All device arrays of a run: `now` and `next`, read and written in turn; `particles`; `output`."""

    def __init__(self, scene: Scene, spec: Spec, device: Any, chunk: int, lanes: int = 1):
        self.types = t = structs(spec.precision)
        self.spec, self.device, self.n, self.lanes = spec, device, len(scene.state), lanes
        self.present = scene.start_count
        self.walls = len(scene.wall_elements)
        self._stated = self._properties(scene)
        body, whole = body_struct(spec), -(-self.n // spec.list_slice) * spec.list_slice
        self._memory: list[Any] = [wp.zeros(whole, dtype=body, device=device) for _ in range(2)]
        """Of the bodies now and next, in whole slices of the list: see `words_of_next`."""
        self.now: Any
        self.next: Any
        self.now, self.next = (memory[: self.n] for memory in self._memory)
        self.now.assign(self._bodies(scene, 0, self.n))
        self.particles = self._particles(scene, chunk, t)
        self.side = 0
        """Which of two sets the sorted arrays (bit 0) and the list (bit 1) in `particles` are."""
        self.output: Any = None
        self._views: dict[int, np.ndarray] = {}

    def _bodies(self, scene: Scene, first: int, end: int) -> np.ndarray:
        """The bodies of these rows of the scene as they come."""
        bodies = np.zeros(end - first, dtype=body_struct(self.spec).numpy_dtype())
        for name in ("position", "velocity", *(["angular_velocity"] * self.spec.rotation)):
            rows = getattr(scene.state, name)[first:end]
            bodies[name] = rows  # pyright: ignore[reportCallIssue, reportArgumentType]
        return bodies

    def _particles(self, scene: Scene, chunk: int, t: SimpleNamespace) -> Any:
        """The struct `Particles` at the start; the list's own arrays belong to `NeighborList`."""
        spec, device, n = self.spec, self.device, self.n

        def zeros(count: int | tuple[int, int], dtype: Any, need: bool = True) -> Any:
            return wp.zeros(count, dtype=dtype, device=device) if need else None

        p = t.Particles()
        for name, values in self._stated.items():
            dtype = {"image": wp.vec3i, "radius": t.wide, "mass": t.real, "origin": t.wide3}.get(
                name, wp.int32
            )
            setattr(p, name, wp.array(values, dtype=dtype, device=device))
        for name, dtype in group_tables(t.wide).items() if spec.moved_groups else ():
            setattr(p, name, zeros((chunk, int(scene.held.max())), dtype))
        p.x_at_rebuild = zeros(n, t.wide3)
        p.start = zeros(-(-n // spec.list_slice) + 1, wp.int32)
        p.count = zeros(n, wp.int32, not spec.half_list)
        p.wall_start = zeros(n, wp.int32, spec.has_walls)
        partial = spec.half_list or self.lanes > 1
        p.partial_force = zeros(n * self.lanes, t.vec3, partial)
        p.partial_torque = zeros(n * self.lanes, t.vec3, partial and spec.rotation)
        p.group_work = zeros(n * max(0, int(scene.held.max(initial=0))), wp.float64, spec.moved_groups)
        p.wall_work = zeros(n * len(scene.moving_walls), wp.float64, spec.moving_walls)
        p.rebuild_pending = zeros(chunk + 1, wp.int32)
        return p

    def insert(self, scene: Scene, first: int, end: int) -> None:
        """Writes the particles of these rows of the scene behind those that are there."""
        place = slice(self.present, self.present + end - first)
        for name, values in self._stated.items():
            getattr(self.particles, name)[place].assign(values[first:end])  # mutate: inserted_properties
        bodies = self._bodies(scene, first, end)
        for name in ("velocity", "angular_velocity"):
            if f"{name}_ahead" in (bodies.dtype.names or ()):
                bodies[f"{name}_ahead"] = bodies[name]  # mutate: inserted_velocity_ahead
        self.now[place].assign(bodies)

    def _properties(self, scene: Scene) -> dict[str, np.ndarray]:
        """What a particle has beside its body, in order of the rows of the scene."""
        spec, t = self.spec, self.types
        found: dict[str, np.ndarray] = {"id": np.arange(self.n, dtype=np.int32)}
        if spec.polydisperse:
            found["radius"] = scene.state.radius.astype(wp.dtype_to_numpy(t.wide))
        if spec.per_particle_mass:
            found["mass"] = scene.masses.astype(wp.dtype_to_numpy(t.real))
        if spec.multi_material:
            index = {scene.material_index[name]: k for k, name in enumerate(scene.particle_materials)}
            found["material"] = np.array([index[m] for m in scene.state.material.tolist()], np.int32)
        if spec.held:
            found["held"] = scene.held.astype(np.int32)
        if spec.moved_groups:
            found["origin"] = scene.state.position.astype(wp.dtype_to_numpy(t.wide))
        if any(spec.periodic):
            found["image"] = np.zeros((self.n, 3), np.int32)
        return found

    def words_of_next(self) -> wp.array:
        """The memory of `next` and its padding as integers: a step writes `next` before it is read."""
        memory = next(m for m in self._memory if m.ptr == self.next.ptr)
        words = memory.size * wp.types.type_size_in_bytes(memory.dtype) // 4
        return wp.array(ptr=memory.ptr, dtype=wp.int32, shape=(words,), device=self.device, copy=False)

    def allocate_output(self) -> None:
        """The arrays that output needs, on first use."""
        if self.output is None:
            t, spec = self.types, self.spec
            self.output = t.StepOutput()
            kinds = {"velocity": t.wide3, "force": t.vec3}
            if spec.rotation:
                kinds |= {"angular_velocity": t.wide3, "torque": t.vec3}
            for name, dtype in kinds.items():
                setattr(self.output, name, wp.zeros(self.n, dtype=dtype, device=self.device))
            self.output.contacts = wp.zeros(self.n * self.lanes, dtype=wp.int32, device=self.device)

    def swap(self) -> None:
        """What was written, by a step or by a rebuild, becomes the present."""
        self.now, self.next = self.next, self.now

    def host(self, array: wp.array) -> np.ndarray:
        """Numbers of an array that lasts as long as this state: a copy; on the CPU a view, made once."""
        if self.device.is_cuda:
            return array.numpy()
        if array.ptr not in self._views:
            self._views[array.ptr] = array.numpy()  # pyright: ignore[reportArgumentType]
        return self._views[array.ptr]  # pyright: ignore[reportArgumentType]

    def arrays(self) -> dict[str, wp.array]:
        """Every array there is, by name: what a scene costs in memory."""
        groups = {"particles": self.particles}
        if self.output is not None:
            groups["output"] = self.output
        found: dict[str, wp.array] = {"now": self._memory[0], "next": self._memory[1]}
        for group, struct in groups.items():
            for name in struct._cls.vars:
                value = getattr(struct, name)
                if isinstance(value, wp.array) and value.size:
                    found[f"{group}.{name}"] = value
        return found
