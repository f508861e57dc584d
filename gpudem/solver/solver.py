"""The solver: a scene on a device, stepped in LIGGGHTS' order of operations.

    set-up:  forces at full-step velocities, springs only evaluated
    step:    half kick, drift | list rebuilt if a particle moved over skin/2 | forces, springs | half kick

A step kernel does the part from the forces on, and the first half of the next step with it.

On a CUDA device a chunk of steps is one graph, a rebuild another; after each chunk the host reads how many of
its steps were done. Measured on an H100 with 5 000 balls, 16 us a step: a conditional node before every step,
which would rebuild within the chunk, costs 4 us; a look by the host 30 to 70 us; a launch that does nothing
5 us. With a rebuild every 30 to 60 steps it is best that a chunk ends where the list does: then a rebuild
costs one look, which is due anyway, and few launches that do nothing. A million balls take 300 us a step, and
neither matters. Without conditional nodes the arrays of a rebuild can change sides instead of being copied.
"""

from __future__ import annotations

import bisect
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp

from gpudem.contact.coefficients import pair_coefficients
from gpudem.contact.names import LawNames
from gpudem.errors import SimulationError
from gpudem.output.view import WallLoad
from gpudem.output.vtu import Frame
from gpudem.scene import Scene, flow, wall_phases
from gpudem.scene.groups import moving
from gpudem.scene.removal import search_box
from gpudem.scene.walls import Wall
from gpudem.solver import guards
from gpudem.solver.device import compile_kernels, find_device
from gpudem.solver.flow import FlowCounter
from gpudem.solver.group_motion import TABLES, GroupMotion
from gpudem.solver.lanes import LANES, lanes_for
from gpudem.solver.list_layout import packed, spread
from gpudem.solver.memory import array_bytes
from gpudem.solver.mesh_tables import MeshTables
from gpudem.solver.neighbor_list import NeighborList, block_size, cell_grid, layers_of_cells
from gpudem.solver.removal import Departures
from gpudem.solver.spec import Spec
from gpudem.solver.state import State
from gpudem.solver.step_kernel import SETUP, WRITE, laws_struct, step_kernel
from gpudem.solver.thread_pool import CpuThreadPool, require_serial_launches
from gpudem.solver.wall_forces import WallForces
from gpudem.solver.wall_motion import WallMotion
from gpudem.solver.walls import wall_table

#: Arrays of the list that a step writes before it reads them.
MESH_SCRATCH = ("mesh_near", "mesh_leader", "mesh_gap", "mesh_normal")
LIST_SCRATCH = (*MESH_SCRATCH, "wall_force", "wall_couple", "wall_point")
#: Steps launched as one CUDA graph between two looks by the host, at most.
CUDA_CHUNK = 64
#: Their number is a multiple of it: each number of steps is recorded as a graph of its own.
CHUNK_UNIT = 4


class Solver:
    """One scene on one device. `step_count` steps are done; after `write_step` the full step can be read.

    At most `chunk` steps are launched at once. Those after a step in which a particle has moved too far for
    the list do nothing, and the host has the list made anew before the next chunk. With `rebuild_in_graph`,
    as on a CUDA device, it does not wait for the new list: see `NeighborList`.

    Raises:
        SimulationError: lost particle, NaN, naming particle and time.
        ValueError: a half list for a CUDA device; a number of lanes that cannot be.
    """

    def __init__(
        self,
        scene: Scene,
        device: str = "cpu",
        threads: int | None = None,
        chunk: int | None = None,
        half_list: bool | None = None,
        specialize: bool = True,
        rebuild_in_graph: bool | None = None,
        lanes: int | None = None,
    ):
        self.device, self.scene = find_device(device), scene
        if half_list and self.device.is_cuda:
            raise ValueError("half_list: adds up pairs in their order, which a CUDA launch does not have")
        self.spec = Spec.of(scene, self.device.is_cpu if half_list is None else half_list)
        if not specialize:
            self.spec = self.spec.generic
        self.graphs = self.device.is_cuda
        self.chunk = 1 if scene.servos else chunk or (CUDA_CHUNK if self.device.is_cuda else 1)
        self.rebuild_in_graph = self.device.is_cuda if rebuild_in_graph is None else rebuild_in_graph
        self.lanes = self._lanes(lanes)
        self.state = State(scene, self.spec, self.device, self.chunk, self.lanes)
        self._wall_forces: Any = WallForces(self.state) if self.spec.wall_forces else None
        self.params = self._params()
        self._choose_order(scene.state.position)
        self.pool = CpuThreadPool(self.state.present, self.params.block, self.device, threads)
        self._phase = scene.phase_scenes[0]
        self.laws = self._laws()
        self.neighbors = NeighborList(scene, self.state, self.params, self.pool)
        self.neighbors.on_reallocate = self._invalidate_launches
        self.neighbors.next_step = lambda: self.step_count + 1
        self.neighbors.on_leave = self._let_go
        self.departures = Departures(scene)
        self._flow = FlowCounter(scene, self.state, self.params, self.pool) if flow.faces(scene) else None
        self.kernel = self.plain_kernel = step_kernel(self.spec, lanes=self.lanes)
        if not self.spec.half_list and (self.device.is_cuda or self.rebuild_in_graph):
            self.plain_kernel = step_kernel(self.spec, True, self.lanes)
        self._launches: dict[tuple[int, int, int, int], Callable[[], None]] = {}
        self._graphs: dict[tuple[int, int, int], Any] = {}
        self.step_count = 0
        self._needs_rebuild = False
        self._interval = self.chunk
        """Steps for which the list before the present one held."""
        self._list_step = 0
        self._written: Any = None
        self._at_written_step = False
        self._pending = self.state.particles.rebuild_pending.numpy() if self.device.is_cpu else None
        self._displaced = any(wall.stroke > 0 for wall in scene.wall_elements)
        self._motion = WallMotion(scene, self.chunk)
        self._groups = GroupMotion(scene, self.state.particles, self.chunk)
        self._meshes = MeshTables(scene, self.state)
        self.walls: Any = None
        self._walls_at = 0
        self._present: set[str] = set()
        self.compile_s = self._compile()
        if self.spec.half_list:
            require_serial_launches()

    def _lanes(self, asked: int | None) -> int:
        """Threads of a particle: as asked, or by rule. Raises ValueError: not possible."""
        if asked is not None and (asked not in LANES or (asked > 1 and self.spec.half_list)):
            raise ValueError(f"lanes = {asked}: must be one of {LANES}; with a half list 1")
        usual = lanes_for(self.scene.start_count) if self.device.is_cuda else 1
        return usual if asked is None else asked

    def _params(self) -> Any:
        scene, t = self.scene, self.state.types
        p = t.Params()
        cells, rate = cell_grid(scene)
        p.dt, p.dt_wide, p.gravity = scene.time.step, scene.time.step, t.vec3(*scene.gravity)
        lo, hi = search_box(scene)
        p.lo, p.hi, p.size = t.wide3(*lo), t.wide3(*hi), t.wide3(*(hi - lo))
        p.cells, p.inv_cell_size = wp.vec3i(*cells), t.wide3(*rate)
        p.is_periodic = wp.vec3i(*[int(side) for side in scene.domain.periodic])
        p.speed_limit = guards.speed_limit(scene) ** 2
        p.merge_cosine = np.cos(np.radians(scene.contact.merge_angle))  # mutate: merge_angle
        p.coplanar_cosine = np.cos(np.radians(scene.contact.mesh_curvature))  # mutate: coplanar_angle
        p.overlap_limit = guards.overlap_limit(scene)
        # mutate: move_limit
        p.skin, p.move_limit, p.range = scene.skin, (scene.skin / 2) ** 2, scene.contact_range
        p.radius, p.mass = float(scene.state.radius.max()), float(scene.masses[0])
        p.kick = 0.5 * scene.time.step / p.mass
        # mutate: half_spin_kick_equal
        p.spin_kick = 0.5 * scene.time.step / (0.4 * p.radius * p.radius * p.mass)
        p.n, p.walls, p.materials = self.state.n, self.state.walls, len(scene.particle_materials)
        return p

    def _laws(self) -> Any:
        """Coefficients of every pair of particle materials, and of every wall with each of them, in the
        present phase.
        """
        scene, device = self.scene, self.device
        laws = laws_struct(self.spec)()
        Pair = type(laws.pair)

        usual, own, inputs = self.spec.law_names[0], scene.wall_laws, self._phase.inputs

        def entries(partners: list[tuple[str, LawNames]]) -> list[Any]:
            found = []
            for partner, names in partners:
                for name in scene.particle_materials:
                    entry = Pair()
                    for field, value in pair_coefficients(names.laws, inputs(name, partner)).items():
                        setattr(entry, field, value)
                    found.append(entry)
            return found

        def table(partners: list[tuple[str, LawNames]]) -> Any:
            return wp.array(entries(partners), dtype=laws_struct(self.spec).vars["pair"].type, device=device)

        ours, walls = [(name, usual) for name in scene.particle_materials], []
        for wall in self._phase.wall_elements:
            names = own.get(wall.name, usual)  # mutate: laws_of_wall_coefficients
            walls.append((wall.material, names))
        laws.pair = entries(ours[:1])[0]
        if self.spec.multi_material:
            laws.pairs = table(ours)
        if walls:
            laws.wall_pairs = table(walls)
        return laws

    def _choose_order(self, position: np.ndarray) -> None:
        """The order in which particles are sorted, slowest along their longest extent, and its blocks."""
        p = self.params
        if not len(position):
            position = self.scene.state.position
        layers = layers_of_cells(position, cell_grid(self.scene)[1])
        p.axes = wp.vec3i(*np.argsort(layers, kind="stable").tolist())
        p.block = block_size(self.state.n, float(layers.max()))

    def _compile(self) -> float:
        begin = time.perf_counter()
        compile_kernels(self.device, (self.kernel, self.plain_kernel, *self.neighbors.kernels.values()))
        return time.perf_counter() - begin

    def _invalidate_launches(self) -> None:
        self._launches.clear()
        self._graphs.clear()
        if self._wall_forces is not None:
            self._wall_forces.forget_launch()  # mutate: launch_of_forces
        if self._flow is not None:
            self._flow.forget_launches()

    # -- the algorithm -------------------------------------------------------------------------------------

    def start(self, walls: list[Wall] | None = None, write: bool = False) -> None:
        """Set-up: forces at the present full-step velocities with the given walls; first kick and drift.

        At a later start (a gate was removed) the step before it must be one of `write_step`.
        """
        if self.step_count > 0:
            self.rewind()
            self._take_full_step_velocities()
            bodies: Any = self.state.now.numpy()
            self._choose_order(bodies["position"][: self.state.present])
            self.pool.partition(self.params.block)  # mutate: slices_of_new_blocks
        before, phase = self._present, self._phase
        self._set_walls(walls)
        if self.step_count > 0 and self.scene.contact.mesh_contacts == "liggghts":
            self._forget_restated(before, phase)
        self._move_walls(self.step_count, in_set_up=True)
        self._count_flow(only_sides=True)
        self._rebuild()
        self._launch(SETUP | (WRITE if write else 0))
        self._needs_rebuild = bool(self._read_rebuild_flags()[1])
        self.state.swap()
        self._at_written_step = False

    def rewind(self) -> None:
        """Make the written full step the present one again, to change it; `start` must follow."""
        if not self._at_written_step:
            self.state.swap()
        self._at_written_step = True

    @property
    def written(self) -> Any:
        """The bodies of the written step, whose velocities are half a step behind."""
        return self._written

    def advance(self, steps: int) -> None:
        """Do `steps` steps without output."""
        self._leave_written_step()
        while steps > 0:
            self._move_walls(self.step_count + 1)
            self._remove(self.step_count + 1)
            self._insert(self.step_count + 1)
            if self._needs_rebuild:
                self._rebuild(wait=not self.rebuild_in_graph)
            done = self._launch_chunk(self._within_reach(self._steps_to_launch(steps)))
            self.step_count += done
            steps -= done
            if done:
                self._follow_forces()

    def write_step(self, last: bool = False) -> None:
        """One more step, whose positions, velocities and forces can then be read; `last`: stay there."""
        self._leave_written_step()
        self._move_walls(self.step_count + 1)
        self._remove(self.step_count + 1)
        self._insert(self.step_count + 1)
        if self._needs_rebuild:
            self._rebuild()
        self._launch(WRITE)
        self._needs_rebuild = bool(self._read_rebuild_flags()[1])
        self.step_count += 1
        self._follow_forces()
        self._at_written_step = last
        if not last:
            self.state.swap()

    def _leave_written_step(self) -> None:
        if self._at_written_step:
            self.state.swap()
        self._at_written_step = False

    def _set_walls(self, present: list[Wall] | None) -> None:
        """Walls that get into contact from now on; all of them by default."""
        self._set_phase()
        here = self.scene.wall_elements if present is None else present
        self._present = {wall.name for wall in here}
        self.walls = wall_table(self.state, self.scene, self.chunk, here, self._phase)
        self._meshes.attach(self.walls)
        self._motion.attach(self.walls, here)
        self._invalidate_launches()
        self.neighbors.set_walls(self.walls)

    def _set_phase(self) -> None:
        """Gravity and coefficients of the steps to come; launches are recorded anew after it."""
        before, phase = self._phase, self.scene.phase_after(self.step_count)
        self.params.gravity = self.state.types.vec3(*phase.gravity)
        self._phase, materials = phase, [[wall.material for wall in at.walls] for at in (before, phase)]
        # mutate: laws_of_other_material
        if phase.pairs != before.pairs or materials[0] != materials[1]:
            self.laws = self._laws()  # mutate: laws_of_phase

    def _forget_restated(self, before: set[str], phase: Scene) -> None:
        """LIGGGHTS loses the springs of walls that it states anew: of all meshes where one comes, goes, has
        another belt, or a servo that begins or ends, and of another wall whose belt changes.

        Args:
            before: Names of the walls that were there.
            phase: The one before.
        """
        elements, meshes = self.scene.wall_elements, {mesh.name for mesh in self.scene.meshes}
        belts = wall_phases.belts_that_change(phase, self._phase) & before & self._present
        # mutate: springs_of_servo
        restated = belts | wall_phases.servos_that_change(self.scene, self.step_count)
        anew = before & meshes != self._present & meshes or bool(restated & meshes)
        # mutate: springs_of_other_belt
        lost = [w for w, wall in enumerate(elements) if wall.name in belts - meshes]
        if not (anew or lost):
            return
        neighbor = self.state.particles.neighbor
        entries = neighbor.numpy().copy()
        wall = -entries - 1 - self.state.n
        gone = (entries < 0) & (np.isin(wall, lost) | (anew & (wall >= self.state.walls)))
        entries[gone] = -entries[gone] - 1  # mutate: springs_of_other_meshes
        neighbor.assign(entries)

    def _move_walls(self, step: int, in_set_up: bool = False) -> None:
        """Puts moving walls and groups where they are in `step`, the next launch's, and in those after it."""
        self._walls_at = step
        self._groups.assign(step)
        if self._motion:
            self._motion.assign(step, in_set_up)
            if self._motion.steps_within(step, 1) == 0:
                self._needs_rebuild = True  # mutate: rebuild_for_walls
        elif self._displaced:
            times = [(step + k) * self.scene.time.step for k in range(self.chunk)]  # mutate: saw_tooth_times
            places = [wall.displacement(time) for time in times for wall in self.scene.wall_elements]
            if self.device.is_cpu:
                self.walls.displacement.numpy()[:] = places
            else:
                self.walls.displacement.assign(places)

    def _steps_to_launch(self, steps: int) -> int:
        """How many of so many steps to launch at once: until the list is expected to be out of date.

        It is expected to hold as long as the one before. Where it holds longer, the chunks grow with the time
        since then.
        """
        if self.chunk <= CHUNK_UNIT:
            return min(steps, self.chunk)
        expected = abs(self._interval - (self.step_count - self._list_step))
        wanted = max(1, -(-expected // CHUNK_UNIT)) * CHUNK_UNIT
        steps = min(steps, self.chunk, wanted)  # mutate: steps_to_rebuild
        return steps // CHUNK_UNIT * CHUNK_UNIT or steps

    def _within_reach(self, steps: int) -> int:
        """How many of so many steps can be launched at once, at least one: the list reaches the walls that
        move, and no particle comes after the first of them.
        """
        after = bisect.bisect_right(self.scene.insertion_steps, self.step_count + 1)
        for step in self.scene.insertion_steps[after : after + 1]:
            steps = min(steps, step - self.step_count - 1)  # mutate: steps_to_insertion
        if self.neighbors.exits is not None:
            removal = self.neighbors.exits.next_after(self.step_count + 1)
            steps = steps if removal is None else min(steps, removal - self.step_count - 1)
        return max(1, self._motion.steps_within(self.step_count + 1, steps)) if self._motion else steps

    def _remove(self, step: int) -> None:
        """Has the list rebuilt in a step in which a `[[remove]]` is decided, before its forces."""
        exits = self.neighbors.exits
        if exits is not None and exits.next_after(step - 1) == step:
            exits.look_in(step)
            self._rebuild()  # mutate: rebuild_to_remove
            exits.look_in(None)

    def _insert(self, step: int) -> None:
        """Puts the particles that come in a step behind those that are there, before its forces."""
        first, end = self.state.present + len(self.departures), self.scene.count_at(step)
        if end > first:
            self.state.insert(self.scene, first, end)
            self._set_present(self.state.present + end - first)
            self._needs_rebuild = True  # mutate: rebuild_at_insertion

    def _let_go(self, rows: np.ndarray, exits: np.ndarray) -> None:
        """The last particles of the sorted order leave, before the forces of the step to come."""
        present = self.state.present
        bodies: Any = self.state.now[present - len(rows) : present].numpy()
        self.departures.record(rows, exits, self.step_count + 1, bodies)
        self._set_present(self.state.present - len(rows))

    def _set_present(self, count: int) -> None:
        """So many particles are there from now on; a rebuild must follow."""
        self.state.present = count
        self.pool.partition(self.params.block, count)
        self.neighbors.forget_launches()
        self._invalidate_launches()

    def _count_flow(self, launch: int = 0, only_sides: bool = False) -> None:
        """Crossings of the faces of `output.flow`, if there are any, in the step of a launch."""
        if self._flow is not None:
            self._flow.count(launch, only_sides)

    def crossings(self) -> dict[str, np.ndarray]:
        """Net crossings of each face of `output.flow` since the start by row of the scene, (n,), by name."""
        return self._flow.crossings() if self._flow is not None else {}

    def _launch_chunk(self, steps: int) -> int:
        """Launch steps without a look by the host between them; returns how many were done.

        On CUDA they are one graph, and the look one small copy. After a launch that moves a particle too far
        those after it do nothing. None is done where the new list needs the host.
        """
        if self.graphs:
            self._launch_graph(steps)
        else:
            self._launch_each(steps)
        pending = self._read_rebuild_flags()
        done = steps
        if pending[steps]:
            done = int(np.argmax(pending[: steps + 1]))  # mutate: steps_done
        if (steps - done) % 2:
            self.state.swap()
        if pending[0]:
            self.neighbors.finish_suspended()
        elif pending[steps]:
            self._needs_rebuild = True
            self._interval = self.step_count + done - self._list_step
        return done

    def _launch_graph(self, steps: int) -> None:
        key = (id(self.state.now), self.state.side, steps)
        if key not in self._graphs:
            self._graphs[key] = self._captured(steps)
        wp.capture_launch(self._graphs[key])
        if steps % 2:
            self.state.swap()

    def _captured(self, steps: int) -> Any:
        """A graph of so many launches; `now` and `next` stay what they are."""
        before = (self.state.now, self.state.next)
        with wp.ScopedCapture(self.device, force_module_load=False) as capture:
            self._launch_each(steps)
        self.state.now, self.state.next = before
        return capture.graph

    def _launch_each(self, steps: int) -> None:
        for launch in range(steps):
            self._launch(0, launch)
            self.state.swap()

    def _read_rebuild_flags(self) -> np.ndarray:
        return self._pending if self._pending is not None else self.state.particles.rebuild_pending.numpy()

    def _rebuild(self, wait: bool = True) -> None:
        """`wait`: the host looks at what was found before anything else is launched."""
        if self.scene.exits:  # who leaves now may have crossed a face in its last step
            self._count_flow()  # mutate: flow_before_leaving
        if wait:
            self.neighbors.rebuild()
        else:
            self.neighbors.rebuild_in_graph(self.graphs)
        self._motion.list_made(self._walls_at)
        self._list_step, self._needs_rebuild = self.step_count, False

    def _launch(self, mode: int, launch: int = 0) -> None:
        """The step kernel from `now` to `next`; recorded once for each mode, place and direction."""
        key = (id(self.state.now), self.state.side, mode, launch)
        if not mode & SETUP:
            self._count_flow(launch)
        if key not in self._launches:
            state = self.state
            if mode & WRITE:
                state.allocate_output()
            output = state.output if state.output is not None else state.types.StepOutput()
            inputs = [mode, launch, self.laws, self.walls, state.now]
            kernel = self.plain_kernel
            if mode:  # mutate: kernel_of_mode
                kernel = self.kernel
            self._launches[key] = self.pool.record_launch(
                kernel, self.params, inputs, [state.particles, state.next, output], self.lanes
            )
        self._written = self.state.now
        self._launches[key]()

    def _take_full_step_velocities(self) -> None:
        bodies: Any = self.state.now.numpy()
        for name in ("velocity", *(["angular_velocity"] * self.spec.rotation)):
            bodies[name] = getattr(self.state.output, name).numpy()  # mutate: velocities_at_gate
        self.state.now.assign(bodies)

    # -- restart -------------------------------------------------------------------------------------------

    def state_dict(self) -> dict[str, np.ndarray]:
        """The exact state between two steps, within a segment: every array that the next step reads."""
        state, listed = self.state, packed(self.state, self.neighbors.entry_arrays)
        stored = {"now": state.now.numpy().copy()}
        for name in stored["now"].dtype.names:
            if name.startswith("pad_"):  # what a rebuild left there
                stored["now"][name] = 0
        for name in self._stored_arrays():
            stored[name] = listed[name] if name in listed else getattr(state.particles, name).numpy().copy()
        done = [self.step_count, self.neighbors.rebuilds, self._needs_rebuild]
        order = [self.params.block, *self.params.axes]
        if self._motion.servos:
            stored["servo"] = self._motion.servo_states()
        stored["counts"] = np.array([*done, self.spec.half_list, *order], np.int64)
        if self.scene.exits:
            stored |= self.departures.saved()
        if self._flow is not None:
            stored |= self._flow.saved()
        if self._motion:
            stored["list_step"] = np.array(self._motion.list_step, np.int64)
        return stored

    def load_state_dict(self, saved: dict[str, np.ndarray], walls: list[Wall] | None = None) -> None:
        """Take over what `saved` gave for the same scene, in the place of `start`; `walls`: those present.

        Raises SimulationError for a state of another scene, precision or kind of device.
        """
        state, counts = self.state, [int(v) for v in saved["counts"]]
        extra = ["list_step"] * bool(self._motion) + ["servo"] * bool(self._motion.servos)
        extra += [*self.departures.saved()] * bool(self.scene.exits)
        extra += [*self._flow.saved()] if self._flow is not None else []
        names = {"now", "counts", *self._stored_arrays(), *extra}
        same = names == set(saved) and state.now.numpy().dtype == saved["now"].dtype
        if not same or counts[3] != self.spec.half_list:
            raise SimulationError("the saved state is of another scene, precision or kind of device")
        self.params.block, self.params.axes = counts[4], wp.vec3i(*counts[5:])  # mutate: restart_order
        if self.scene.exits:
            self.departures.load(saved)
        if self._flow is not None:
            self._flow.load(saved)
        # mutate: present_at_restart
        self._set_present(self.scene.count_at(counts[0]) - len(self.departures))
        state.now.assign(saved["now"])
        arrays, entry_arrays = (
            {name: saved[name] for name in self._stored_arrays()},
            self.neighbors.entry_arrays,
        )
        listed = {k: v for k, v in arrays.items() if k in ("start", "wall_start", *entry_arrays)}
        arrays |= spread(self.spec, listed)
        self.neighbors.reserve(len(arrays["neighbor"]))
        for name, values in arrays.items():
            array = getattr(state.particles, name)
            if name in entry_arrays:
                array = array[: len(values)]
            if array.size:
                array.assign(values)
        self._motion.load_servo_states(saved.get("servo", np.empty(0)))
        # mutate: restart_counts
        self.step_count, self.neighbors.rebuilds, self._needs_rebuild = counts[0], counts[1], bool(counts[2])
        self._set_walls(walls)
        if self._motion:
            self._motion.list_made(int(saved["list_step"]))  # mutate: list_step_at_restart

    def _stored_arrays(self) -> list[str]:
        """Arrays of `state.particles` that last from step to step.

        Not those that are zero between steps or follow from others or from the number of the step.
        """
        # mutate: restart_arrays
        leave = (
            "count",
            "rebuild_pending",
            "partial_force",
            "partial_torque",
            *LIST_SCRATCH,
            *TABLES,
        )
        names = [name for name in self.state.types.Particles.vars if name not in leave]
        return [name for name in names if getattr(self.state.particles, name) is not None]

    # -- reading -------------------------------------------------------------------------------------------

    def column(self, name: str) -> np.ndarray:
        """One column of the written step in order of id, float64, shape (n, 3).

        A column of a frame, or "unwrapped_position": as if it had not been moved through periodic sides [m].

        Raises:
            SimulationError: a position or velocity that is not a number (NaN); names particle and time.
        """
        state, host, output = self.state, self.state.host, self.state.output
        n = state.present
        row = self._row_of_place()
        if name in ("angular_velocity", "torque") and not self.spec.rotation:
            return np.zeros((n, 3))
        found, values = np.empty((n, 3)), {"unwrapped_position": "position"}.get(name, name)
        array = host(self._written)["position"] if values == "position" else host(getattr(output, name))
        found[row] = array[:n]  # mutate: rows_by_id
        if values in ("position", "velocity") and not np.isfinite(found).all():
            i = int(self.rows()[np.argwhere(~np.isfinite(found))[0][0]])
            at = f"t = {self.step_count * self.scene.time.step:.9g} s (step {self.step_count})"
            raise SimulationError(f"particle {i + 1} has a {values} that is not a number (NaN) at {at}")
        if name == "unwrapped_position" and any(self.scene.domain.periodic):
            image = np.empty((n, 3))
            image[row] = host(state.particles.image)[:n]
            found += image * (np.array(self.scene.domain.hi) - np.array(self.scene.domain.lo))
        return self._inside(found) if name == "position" else found

    def rows(self) -> np.ndarray:
        """The rows of the scene that are there, ascending: id - 1, shape (n,)."""
        return np.flatnonzero(self.departures.exit[: self.state.present + len(self.departures)] < 0)

    def _row_of_place(self) -> np.ndarray:
        """The row in a table in order of id of each particle in sorted order, shape (n,)."""
        state = self.state
        row = state.host(state.particles.id)[: state.present]
        if len(self.departures):
            row = self.departures.rank[row]  # mutate: rows_without_those_that_left
        return row

    def frame(self) -> Frame:
        """The written step as a table in order of id, float64. Raises SimulationError for NaN in it."""
        rows = self.rows()
        return {
            "id": rows + 1,
            "material": self.scene.state.material[rows].astype(np.int32),
            **{name: self.column(name) for name in ("position", "velocity", "angular_velocity")},
            "radius": self.scene.state.radius[rows],
            **{name: self.column(name) for name in ("force", "torque")},
        }

    def _inside(self, position: np.ndarray) -> np.ndarray:
        """Positions wrapped into the periodic sides (the solver itself wraps at a rebuild only)."""
        lo, hi = np.array(self.scene.domain.lo), np.array(self.scene.domain.hi)
        for k in np.flatnonzero(self.scene.domain.periodic):
            x, size = position[:, k], hi[k] - lo[k]
            wrapped = np.where(x < lo[k], x + size, np.where(x >= hi[k], np.maximum(x - size, lo[k]), x))
            # mutate: wrapped_frame
            position[:, k] = np.where(wrapped >= hi[k], lo[k], wrapped)  # rounded to the upper face
        return position

    def contact_count(self) -> int:
        """Contacts in the written step, between particles and with walls."""
        return int(self.state.host(self.state.output.contacts)[: self.state.present].sum()) // 2

    def wall_work(self) -> float | None:
        """Work of moving planes since the start [J]; None where no plane moves.

        Force on each particle times the way of the plane in the step, added up on the device.
        """
        return float(self.state.particles.wall_work.numpy().sum()) if self.spec.moving_walls else None

    def wall_loads(self) -> dict[str, WallLoad]:
        """What the particles do to each wall that `output.wall_forces` names, in the written step.

        About its torque point, where that is now.
        """
        elements, wanted = self.scene.wall_elements, self.scene.output.wall_forces
        if not wanted:
            return {}
        points = self._motion.carried(np.array([wall.torque_point for wall in elements]), self.step_count)
        force, torque = self._wall_forces.sums(self.params, self.walls, points)
        work = self._work_of_walls()
        return {
            wall.name: WallLoad(force[w], torque[w], points[w], work[w])
            for w, wall in enumerate(elements) if wall.name in wanted
        }  # fmt: skip

    def triangle_forces(self) -> dict[str, np.ndarray]:
        """Force of the particles on each triangle [N], (k, 3), of the meshes of `output.wall_stress`."""
        wanted = self.scene.output.wall_stress
        if not wanted:
            return {}
        joined, found, first = self._wall_forces.on_triangles(self._meshes.triangles), {}, 0
        for mesh in self.scene.meshes:
            if mesh.name in wanted:
                found[mesh.name] = joined[first : first + len(mesh.corners)]
            first += len(mesh.corners)  # mutate: first_triangle_of_mesh
        return found

    def servo_ways(self) -> dict[str, np.ndarray]:
        """How far servos have moved their walls beyond the motions of the scene [m], (3,), by name."""
        found, step = {}, self.step_count
        for w in self._motion.servos:
            name = self.scene.wall_elements[w].name
            stated = self.scene.wall_paths[name].at(step, 1).shift[0]
            found[name] = self._motion.paths[w].at(step, 1).shift[0] - stated
        return found

    def _follow_forces(self) -> None:
        """Walls with a servo: their velocity in the next step, from the forces in the last one."""
        if self._motion.follows(self.step_count):
            points = np.zeros((self.state.walls, 3))
            force, _torque = self._wall_forces.sums(self.params, self.walls, points)
            self._motion.follow(self.step_count, force)

    def _work_of_walls(self) -> np.ndarray:
        """Work on the particles since the start [J], of each wall."""
        moves = self.scene.moving_walls
        moving = [w for w, wall in enumerate(self.scene.wall_elements) if wall.name in moves]
        found = np.zeros(len(self.scene.wall_elements))
        if moving:
            found[moving] = self.state.particles.wall_work.numpy().reshape(len(moving), -1).sum(axis=1)
        return found

    def group_works(self) -> dict[str, float]:
        """Work of each group with a motion on the particles since the start [J], by name."""
        names = [group.name for group in moving(self.scene)]
        if not names:
            return {}
        work = self.state.particles.group_work.numpy().reshape(len(names), -1).sum(axis=1)
        return dict(zip(names, work.tolist(), strict=True))

    def memory_bytes(self) -> dict[str, int]:
        """Bytes of every device array, by name."""
        found = array_bytes(self.state, self.neighbors)
        return found | (self._flow.memory_bytes() if self._flow is not None else {})

    def close(self) -> None:
        """End the threads."""
        self.pool.close()
