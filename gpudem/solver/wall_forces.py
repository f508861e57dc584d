# pyright: reportInvalidTypeForm=false, reportIndexIssue=false, reportArgumentType=false
# pyright: reportOperatorIssue=false
"""Force and torque on each wall in the written step: summed on the device, float64, in a fixed order.

Forces on triangles are summed on the host, for they are wanted where a frame is written.
"""

import functools
from typing import Any

import numpy as np
import warp as wp

from gpudem.solver.device import quiet
from gpudem.solver.list_layout import list_places, packed, places
from gpudem.solver.mesh_entries import mesh_entry
from gpudem.solver.spec import Spec
from gpudem.solver.state import State, structs

#: Partial sums of each wall at most: enough threads for any device, and 200 kB a wall to download.
THREADS = 4096
#: Particles of a partial sum at least: a servo reads the sums in every step, and few are quickly added.
PARTICLES = 64


@functools.cache
def sum_kernel(spec: Spec) -> Any:
    """The kernel: thread t sums over the particles t, t + threads, ... for every wall."""
    t = structs(spec.precision)
    Params, Particles, Walls = t.Params, t.Particles, t.Walls
    triangle, end_of = mesh_entry(spec).triangle, list_places(spec).end

    @wp.func
    def wide3d(a: Any):
        return wp.vec3d(wp.float64(a[0]), wp.float64(a[1]), wp.float64(a[2]))

    @wp.kernel(module="unique", enable_backward=False)
    def sum_on_walls(
        # params
        params: Params,
        threads: wp.int32,
        present: wp.int32,
        # in
        particles: Particles,
        walls: Walls,
        references: wp.array[wp.vec3d],
        # out
        force: wp.array[wp.vec3d],
        torque: wp.array[wp.vec3d],
    ):
        t = wp.tid()
        for w in range(params.walls):
            force[t * params.walls + w] = wp.vec3d()
            torque[t * params.walls + w] = wp.vec3d()
        i = t
        while i < present:
            for k in range(particles.wall_start[i], end_of(particles, i), wp.static(spec.list_slice)):
                entry = particles.neighbor[k]
                if entry < 0:
                    entry = -entry - 1
                w = entry - params.n
                if wp.static(bool(spec.meshes)):
                    if w >= params.walls:
                        w = walls.triangle_wall[triangle(w - params.walls)]  # mutate: wall_of_image
                f = -wide3d(particles.wall_force[k])  # mutate: force_of_particle_on_wall
                lever = wide3d(particles.wall_point[k]) - references[w]
                couple = -wide3d(particles.wall_couple[k])
                at = t * params.walls + w
                force[at] = force[at] + f
                torque[at] = torque[at] + wp.cross(lever, f) + couple  # mutate: torque_on_wall
            i += threads

    return sum_on_walls


class WallForces:
    """Sums over the entries of the list of a state."""

    def __init__(self, state: State):
        self.state = state
        self.threads = min(THREADS, -(-state.n // PARTICLES))
        device, count = state.device, self.threads * state.walls
        self._force = wp.zeros(count, dtype=wp.vec3d, device=device)
        self._torque = wp.zeros(count, dtype=wp.vec3d, device=device)
        self._references = wp.zeros(state.walls, dtype=wp.vec3d, device=device)
        self._launches: dict[int, Any] = {}

    def forget_launch(self) -> None:
        """Arrays of the state, the particles present or the walls have changed."""
        self._launches.clear()

    def sums(self, params: Any, walls: Any, references: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(force [N], torque [N m] about the references [m]) on each wall: shapes (m, 3)."""
        state = self.state
        if state.side not in self._launches:
            with quiet():  # the first launch compiles
                self._launches[state.side] = wp.launch(
                    sum_kernel(state.spec), self.threads,
                    inputs=[params, self.threads, state.present, state.particles, walls, self._references],
                    outputs=[self._force, self._torque], device=state.device, record_cmd=True,
                )  # fmt: skip
        if state.device.is_cpu:
            state.host(self._references)[:] = references
        else:
            self._references.assign(references)
        self._launches[state.side].launch()
        shape = (self.threads, state.walls, 3)
        return tuple(state.host(a).reshape(shape).sum(axis=0) for a in (self._force, self._torque))  # type: ignore[return-value]

    def on_triangles(self, count: int) -> np.ndarray:
        """Force on each triangle of the scene [N], (count, 3), summed in order of the list."""
        state = self.state
        found = packed(state, ("neighbor", "wall_force"))
        start, first = found["start"][: state.present + 1], found["wall_start"][: state.present]
        entries = places(first, start[1:] - first, 1)
        other = found["neighbor"][entries]
        code = np.where(other < 0, -other - 1, other) - state.n - state.walls
        of_mesh = code >= 0
        triangle = code[of_mesh] // state.spec.mesh_images  # mutate: triangle_of_image
        force = -found["wall_force"][entries[of_mesh]].astype(float)  # mutate: force_on_triangle
        return np.stack([np.bincount(triangle, force[:, k], count) for k in range(3)], axis=1)
