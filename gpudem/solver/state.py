"""The device arrays of one run, with unit and shape for each; an array that the scene does not need is None.

n particles in sorted (cell) order, m planes. Arrays that are None are null on the device: no kernel built
for this scene touches them.
"""

import functools
from types import SimpleNamespace
from typing import Any

import numpy as np
import warp as wp

from gpudem.contact.types import REAL, WIDE, pair_struct
from gpudem.scene import Scene
from gpudem.solver.body import body_struct
from gpudem.solver.spec import Spec


@functools.cache
def structs(precision: str, vibration: bool) -> SimpleNamespace:
    """The argument structs of the kernels in one precision: Params, Particles, Walls, Full.

    Vibrating planes have fields of their own; without one the structs are as if there were none.

    `real` is the arithmetic of the contact laws, `wide` that of positions, velocities and radii: the same but
    for "mixed", where an overlap of 1e-7 m is the difference of lengths of 1 m, and a step adds 1e-7 of a
    velocity: both need float64, while forces and springs, each of them small by itself, do well in float32.
    """
    real, wide = REAL[precision], WIDE[precision]
    vec3, wide3 = wp.types.vector(3, real), wp.types.vector(3, wide)
    Pair = pair_struct(real)

    @wp.struct
    class Params:
        dt: real  # [s]
        drift: wide  # the same for positions [s]
        gravity: vec3  # [m/s2]
        lo: wide3  # lower corner of the domain [m]
        size: wide3  # length of the domain [m]
        cells: wp.vec3i  # cells along x, y, z
        axes: wp.vec3i  # the axis along which sorted particles vary fastest, the middle one, the slowest
        around: wp.vec3i  # 1: that axis is periodic
        cell_rate: wide3  # cells per length [1/m]
        skin: wide  # [m]
        move_limit: wide  # (skin/2)^2 [m2]
        speed_limit: wide  # squared, of the guard [m2/s2]
        overlap_limit: wide  # of the guard, by the smaller radius [1]
        radius: wide  # of equal spheres [m]
        mass: real  # of equal spheres of one material [kg]
        kick: real  # dt/(2 m) of equal spheres [s/kg]
        spin_kick: real  # dt/(2 I) of equal spheres [s/(kg m2)]
        pair: Pair  # of one material
        n: wp.int32
        block: wp.int32  # particles of a block: within it a half list holds each pair once
        materials: wp.int32
        planes: wp.int32

    class Particles:
        id: wp.array[wp.int32]  # row in the scene, (n,)
        radius: wp.array[wide]  # [m], (n,)
        mass: wp.array[real]  # [kg], (n,)
        material: wp.array[wp.int32]  # index into the scene's particle materials, (n,)
        wall_near: wp.array[wp.int32]  # bit k: plane k within reach until the next rebuild, (n,)
        wall_touch: wp.array[wp.int32]  # bit k: plane k touched in the last step, (n,)
        wall_spring: wp.array[vec3]  # [m], (m n,), plane by plane
        wall_rolling: wp.array[vec3]  # rolling torque kept [N m], (m n,), plane by plane
        built_at: wp.array[wide3]  # position at the last rebuild [m], (n,)
        start: wp.array[wp.int32]  # first list entry of each particle, (n + 1,)
        neighbor: wp.array[wp.int32]  # j, or -j - 1 where it touched in the last step, (capacity,)
        spring: wp.array[vec3]  # shear spring of each entry [m], (capacity,)
        rolling: wp.array[vec3]  # rolling torque kept of each entry [N m], (capacity,)
        pairs: wp.array[Pair]  # coefficients by material pair, (materials^2,)
        force_so_far: wp.array[vec3]  # from particles before it in its block [N], (n,); half list alone
        torque_so_far: wp.array[vec3]  # [N m], (n,), likewise
        moved: wp.array[wp.int32]  # k + 1: launch k or one before moved somebody beyond skin/2, (chunk + 1,)
        asked: wp.array[wp.int32]  # k + 1: launch k itself did, (chunk + 1,)

    if vibration:
        Particles.__annotations__ |= {
            "wall_shift": wp.array[wide],  # of plane k in launch l, at l m + k: how far from rest [m]
            "wall_rise": wp.array[wide],  # of a fast floor since the touch [m], -1 apart, (floors n,)
            "wall_work": wp.array[wp.float64],  # done by moving planes on whoever stood here [J], (n,)
        }
    Particles = wp.struct(Particles)

    class Walls:
        normal: wp.array[wide3]  # into the domain, length one, (m,)
        offset: wp.array[wide]  # normal . point [m], (m,)
        pairs: wp.array[Pair]  # coefficients by plane and particle material, (m materials,)

    if vibration:
        Walls.__annotations__ |= {
            "speed": wp.array[wide],  # U along the normal [m/s], (m,)
            "stroke": wp.array[wide],  # A of a saw-tooth [m], (m,)
            "floor": wp.array[wp.int32],  # number among the fast floors, -1: none, (m,)
        }
    Walls = wp.struct(Walls)

    @wp.struct
    class Full:
        velocity: wp.array[wide3]  # at the full step [m/s], (n,)
        angular_velocity: wp.array[wide3]  # [rad/s], (n,)
        force: wp.array[vec3]  # with gravity [N], (n,)
        torque: wp.array[vec3]  # [N m], (n,)
        contacts: wp.array[wp.int32]  # with particles + 2 x with walls, (n,)

    return SimpleNamespace(
        real=real,
        vec3=vec3,
        wide=wide,
        wide3=wide3,
        Pair=Pair,
        Params=Params,
        Particles=Particles,
        Walls=Walls,
        Full=Full,
    )


class State:
    """All device arrays of a run: `now` and `next`, read and written in turn; `particles`; `full`."""

    def __init__(self, scene: Scene, spec: Spec, device: Any, chunk: int):
        self.types = t = structs(spec.precision, spec.vibration)
        self.spec, self.device, self.n = spec, device, len(scene.state)
        initial, n = scene.state, self.n
        self.planes = len(scene.planes) if spec.walls else 0

        def vectors(count: int = n, need: bool = True, dtype: Any = t.vec3) -> Any:
            return wp.zeros(count, dtype=dtype, device=device) if need else None

        Body = body_struct(spec)
        bodies = np.zeros(n, dtype=Body.numpy_dtype())
        for name in ("position", "velocity", *(["angular_velocity"] * spec.rotation)):
            bodies[name] = getattr(initial, name)
        self.now = wp.array(bodies, dtype=Body, device=device)
        self.next = wp.zeros_like(self.now)

        self.particles = p = t.Particles()
        p.id = wp.array(np.arange(n, dtype=np.int32), device=device)
        index = {scene.material_index[name]: k for k, name in enumerate(scene.particle_materials)}
        material = np.array([index[m] for m in initial.material.tolist()], np.int32)
        mass = scene.masses
        if spec.several_radii:
            p.radius = wp.array(initial.radius, dtype=t.wide, device=device)
        if spec.several_masses:
            p.mass = wp.array(mass, dtype=t.real, device=device)
        if spec.several_materials:
            p.material = wp.array(material, device=device)
        if self.planes:
            p.wall_near = wp.zeros(n, dtype=wp.int32, device=device)
        if spec.memory and self.planes:
            p.wall_touch = wp.zeros(n, dtype=wp.int32, device=device)
            p.wall_spring = vectors(n * self.planes, spec.history)
            p.wall_rolling = vectors(n * self.planes, spec.rolling_history)
        if spec.vibration:
            floors = sum(plane.fast_floor for plane in scene.planes)
            p.wall_shift = wp.zeros(chunk * self.planes, dtype=t.wide, device=device)
            p.wall_rise = wp.full(n * floors, -1.0, dtype=t.wide, device=device) if floors else None
            p.wall_work = wp.zeros(n, dtype=wp.float64, device=device)
        p.built_at = vectors(dtype=t.wide3)
        p.start = wp.zeros(n + 1, dtype=wp.int32, device=device)
        p.force_so_far = vectors(n, spec.half_list)
        p.torque_so_far = vectors(n, spec.half_list and spec.rotation)
        p.moved = wp.zeros(chunk + 1, dtype=wp.int32, device=device)
        p.asked = wp.zeros(chunk + 1, dtype=wp.int32, device=device)
        self.full: Any = None
        self._views: dict[int, np.ndarray] = {}

    def allocate_full(self) -> None:
        """The arrays that output needs, on first use."""
        if self.full is None:
            t, spec = self.types, self.spec
            self.full = t.Full()
            kinds = {"velocity": t.wide3, "force": t.vec3}
            if spec.rotation:
                kinds |= {"angular_velocity": t.wide3, "torque": t.vec3}
            for name, dtype in kinds.items():
                setattr(self.full, name, wp.zeros(self.n, dtype=dtype, device=self.device))
            self.full.contacts = wp.zeros(self.n, dtype=wp.int32, device=self.device)

    def swap(self) -> None:
        """What was written, by a step or by a rebuild, becomes the present."""
        self.now, self.next = self.next, self.now

    def host(self, array: wp.array) -> np.ndarray:
        """Numbers of an array that lasts as long as this state: a copy; on the CPU a view, made once."""
        if self.device.is_cuda:
            return array.numpy()
        if array.ptr not in self._views:
            self._views[array.ptr] = array.numpy()
        return self._views[array.ptr]

    def arrays(self) -> dict[str, wp.array]:
        """Every array there is, by name: what a scene costs in memory."""
        groups = {"particles": self.particles}
        if self.full is not None:
            groups["full"] = self.full
        found = {"now": self.now, "next": self.next}
        for group, struct in groups.items():
            for name in struct._cls.vars:
                value = getattr(struct, name)
                if isinstance(value, wp.array) and value.size:
                    found[f"{group}.{name}"] = value
        return found
