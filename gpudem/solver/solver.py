"""The solver: a scene on a device, stepped in LIGGGHTS' order of operations.

    set-up:  forces at full-step velocities, springs only evaluated
    step:    half kick, drift | list rebuilt if anybody moved more than skin/2 | forces, springs | half kick

A step kernel does the part from the forces on, and the first half of the next step with it.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp

from gpudem.errors import SimulationError
from gpudem.output.vtu import Frame
from gpudem.scene import Plane, Scene
from gpudem.solver import guards
from gpudem.solver.device import cores, find_device
from gpudem.solver.neighbor_list import NeighborList, block_size, cell_grid, layers_of_cells
from gpudem.solver.spec import Spec
from gpudem.solver.state import State
from gpudem.solver.step_kernel import SETUP, WRITE, step_kernel
from gpudem.solver.thread_pool import Crew
from gpudem.solver.wall_table import pair_entries, pair_table, wall_table

#: Steps launched as one CUDA graph between two looks of the host.
CUDA_CHUNK = 32


class Solver:
    """One scene on one device. `step_count` steps are done; after `write` the full-step state can be read.

    With `rebuild_inside`, as on a CUDA device whose graphs can branch, the list is rebuilt between launches
    of a chunk, without the host; else the launches up to its next look do nothing.

    Raises:
        SimulationError: lost particle, NaN, naming particle and time.
        ValueError: a half list for a CUDA device.
    """

    def __init__(
        self,
        scene: Scene,
        device: str = "cpu",
        threads: int | None = None,
        chunk: int | None = None,
        half_list: bool | None = None,
        everything: bool = False,
        rebuild_inside: bool | None = None,
    ):
        self.device, self.scene = find_device(device), scene
        if half_list and self.device.is_cuda:
            raise ValueError("half_list: adds up pairs in their order, which a CUDA launch does not have")
        self.spec = Spec.of(scene, self.device.is_cpu if half_list is None else half_list)
        if everything:
            self.spec = self.spec.loaded
        self.graphs = self.device.is_cuda
        self.chunk = chunk or (CUDA_CHUNK if self.device.is_cuda else 1)
        self.rebuild_inside = rebuild_inside
        if rebuild_inside is None:
            self.rebuild_inside = self.device.is_cuda and wp.is_conditional_graph_supported()
        self.state = State(scene, self.spec, self.device, self.chunk)
        self.params = self._params()
        self._choose_order(scene.state.position)
        self.crew = Crew(self.state.n, self.params.block, self.device, threads)
        if self.spec.several_materials:
            self.state.particles.pairs = pair_table(self.state, scene, scene.particle_materials)
        self.neighbors = NeighborList(scene, self.state, self.params, self.crew)
        self.neighbors.grew = self._forget_commands
        self.kernel = step_kernel(self.spec)
        self._commands: dict[tuple[int, int, int], Callable[[], None]] = {}
        self._graphs: dict[tuple[int, int], Any] = {}
        self.step_count = 0
        self._stale = self._half_way = False
        self._moved = self.state.particles.moved.numpy() if self.device.is_cpu else None
        self._saw_teeth = any(p.vibration and not p.fast_floor for p in scene.planes)
        self.walls: Any = None
        self.compile_s = self._compile()

    def _params(self) -> Any:
        scene, t = self.scene, self.state.types
        p = t.Params()
        cells, rate = cell_grid(scene)
        p.dt, p.drift, p.gravity = scene.time.step, scene.time.step, t.vec3(*scene.gravity)
        p.lo, p.size = (
            t.wide3(*scene.domain.lo),
            t.wide3(*(np.array(scene.domain.hi) - np.array(scene.domain.lo))),
        )
        p.cells, p.cell_rate = wp.vec3i(*cells), t.wide3(*rate)
        p.around = wp.vec3i(*[int(side) for side in scene.domain.periodic])
        p.speed_limit = guards.speed_limit(scene) ** 2
        p.overlap_limit = guards.overlap_limit(scene)
        p.skin, p.move_limit = scene.skin, (scene.skin / 2) ** 2
        p.radius, p.mass = float(scene.state.radius.max()), float(scene.masses[0])
        p.kick = 0.5 * scene.time.step / p.mass
        p.spin_kick = 0.5 * scene.time.step / (0.4 * p.radius * p.radius * p.mass)
        p.n, p.planes, p.materials = self.state.n, self.state.planes, len(scene.particle_materials)
        p.pair = pair_entries(self.state, scene, scene.particle_materials[:1])[0]
        return p

    def _choose_order(self, position: np.ndarray) -> None:
        """The order in which particles are sorted, slowest along their longest extent, and its blocks."""
        p = self.params
        layers = layers_of_cells(position, cell_grid(self.scene)[1])
        p.axes = wp.vec3i(*np.argsort(layers, kind="stable").tolist())
        p.block = block_size(self.state.n, float(layers.max()))

    def _compile(self) -> float:
        begin = time.perf_counter()
        modules = dict.fromkeys(k.module for k in (self.kernel, *self.neighbors.kernels.values()))
        threads = 1 if self.device.is_cpu else 256
        wp.force_load(self.device, list(modules), block_dim=threads, max_workers=cores())
        return time.perf_counter() - begin

    def _forget_commands(self) -> None:
        self._commands.clear()
        self._graphs.clear()

    # -- the algorithm -------------------------------------------------------------------------------------

    def start(self, planes: list[Plane] | None = None, write: bool = False) -> None:
        """Set-up: forces at the present full-step velocities with the given walls; first kick and drift.

        At a later start (a gate has gone) call it after `write_step(last=True)`.
        """
        if self.step_count > 0:
            self._take_full_velocities()
            self._choose_order(self.state.now.numpy()["position"])
            self.crew.cut(self.params.block)
        self.walls = wall_table(self.state, self.scene, self.scene.planes if planes is None else planes)
        self._forget_commands()
        self.neighbors.set_walls(self.walls)
        self._move_walls(self.step_count)
        self._rebuild()
        self._launch(SETUP | (WRITE if write else 0))
        self._stale = bool(self._moved_flags()[1])
        self.state.swap()

    def advance(self, steps: int) -> None:
        """Do `steps` steps without output."""
        while steps > 0:
            self._move_walls(self.step_count + 1)
            if self._stale:
                self._rebuild()
            done = self._launch_chunk(min(steps, self.chunk))
            self.step_count += done
            steps -= done
            if self._half_way:
                self._rebuild()

    def write_step(self, last: bool = False) -> None:
        """One more step, whose positions, velocities and forces can then be read; `last`: stay there."""
        self._move_walls(self.step_count + 1)
        if self._stale:
            self._rebuild()
        self._launch(WRITE)
        self._stale = bool(self._moved_flags()[1])
        self.step_count += 1
        if not last:
            self.state.swap()

    def _move_walls(self, step: int) -> None:
        """Puts saw-tooth planes where they are in `step`, the next launch's, and in those after it."""
        if self._saw_teeth:
            times = [(step + k) * self.scene.time.step for k in range(self.chunk)]
            shifts = [p.shift(t) for t in times for p in self.scene.planes]
            if self.device.is_cpu:
                self.state.host(self.state.particles.wall_shift)[:] = shifts
            else:
                self.state.particles.wall_shift.assign(shifts)

    def _launch_chunk(self, steps: int) -> int:
        """Launch steps without looking between them; returns how many were done.

        On CUDA they are one graph, and the look one small copy. After a launch that moves somebody too far
        the list is rebuilt within the graph; where that cannot be, the launches after it do nothing.
        """
        if self.graphs:
            self._launch_graph(steps)
        else:
            self._launch_each(steps)
        moved = self._moved_flags()
        self._stale, done = bool(moved[steps]), steps
        if self._stale:
            done = int(np.argmax(moved[1 : steps + 1])) + 1
            self._half_way = self.rebuild_inside and self.neighbors.stopped()
        if (steps - done) % 2:
            self.state.swap()
        return done

    def _launch_graph(self, steps: int) -> None:
        key = (id(self.state.now), steps)
        if key not in self._graphs:
            try:
                self._graphs[key] = self._captured(steps)
                wp.capture_launch(self._graphs[key])
            except RuntimeError as error:
                if not self.rebuild_inside:
                    raise
                self._without_branches(error)
                return self._launch_graph(steps)
        else:
            wp.capture_launch(self._graphs[key])
        if steps % 2:
            self.state.swap()

    def _captured(self, steps: int) -> Any:
        """A graph of so many launches; `now` and `next` stay what they are."""
        before = (self.state.now, self.state.next)
        try:
            with wp.ScopedCapture(self.device, force_module_load=False) as capture:
                self._launch_each(steps)
        finally:
            self.state.now, self.state.next = before
        return capture.graph

    def _without_branches(self, error: RuntimeError) -> None:
        """From now on the host rebuilds: this driver takes no rebuild within a graph."""
        warnings.warn(f"{self.device}: the list is rebuilt between graphs, not within: {error}", stacklevel=2)
        self.rebuild_inside = False
        self._forget_commands()

    def _launch_each(self, steps: int) -> None:
        for launch in range(steps):
            if self.rebuild_inside and launch:
                self.neighbors.rebuild_inside(launch)
            self._launch(0, launch)
            self.state.swap()

    def _moved_flags(self) -> np.ndarray:
        return self._moved if self._moved is not None else self.state.particles.moved.numpy()

    def _rebuild(self) -> None:
        try:
            (self.neighbors.go_on if self._half_way else self.neighbors.rebuild)()
            self._stale = self._half_way = False
        except SimulationError as error:
            step = self.step_count + 1
            what, mark, advice = str(error).partition("; ")
            when = f"t = {step * self.scene.time.step:.9g} s (step {step})"
            raise SimulationError(f"{what} at {when}{mark}{advice}") from None

    def _launch(self, mode: int, launch: int = 0) -> None:
        """The step kernel from `now` to `next`; recorded once for each mode, place and direction."""
        key = (id(self.state.now), mode, launch)
        if key not in self._commands:
            state = self.state
            if mode & WRITE:
                state.allocate_full()
            full = state.full if state.full is not None else state.types.Full()
            inputs = [mode, launch, self.walls, state.now]
            self._commands[key] = self.crew.command(
                self.kernel, self.params, inputs, [state.particles, state.next, full]
            )
        self._written = self.state.now
        self._commands[key]()

    def _take_full_velocities(self) -> None:
        bodies = self.state.now.numpy()
        for name in ("velocity", *(["angular_velocity"] * self.spec.rotation)):
            bodies[name] = getattr(self.state.full, name).numpy()
        self.state.now.assign(bodies)

    # -- restart -------------------------------------------------------------------------------------------

    def saved(self) -> dict[str, np.ndarray]:
        """The exact state between two steps, within a segment: every array that the next step reads."""
        state, total = self.state, int(self.state.particles.start.numpy()[-1])
        kept = {"now": state.now.numpy().copy()}
        for name in self._kept_arrays():
            array = getattr(state.particles, name).numpy()
            kept[name] = (array[:total] if name in self.neighbors.entry_arrays else array).copy()
        done = [self.step_count, self.neighbors.rebuilds, self._stale]
        order = [self.params.block, *self.params.axes]
        kept["counts"] = np.array([*done, self.spec.half_list, *order], np.int64)
        return kept

    def resume(self, saved: dict[str, np.ndarray], planes: list[Plane] | None = None) -> None:
        """Take over what `saved` gave for the same scene, in the place of `start`; `planes`: those present.

        Raises SimulationError for a state of another scene, precision or kind of device.
        """
        state, counts = self.state, [int(v) for v in saved["counts"]]
        names = {"now", "counts", *self._kept_arrays()}
        same = names == set(saved) and state.now.numpy().dtype == saved["now"].dtype
        if not same or counts[3] != self.spec.half_list:
            raise SimulationError("the saved state is of another scene, precision or kind of device")
        self.params.block, self.params.axes = counts[4], wp.vec3i(*counts[5:])
        self.crew.cut(self.params.block)
        state.now.assign(saved["now"])
        self.neighbors.make_room(len(saved["neighbor"]))
        for name in self._kept_arrays():
            array = getattr(state.particles, name)
            if name in self.neighbors.entry_arrays:
                array = array[: len(saved[name])]
            if array.size:
                array.assign(saved[name])
        self.walls = wall_table(state, self.scene, self.scene.planes if planes is None else planes)
        self._forget_commands()
        self.neighbors.set_walls(self.walls)
        self.step_count, self.neighbors.rebuilds, self._stale = counts[0], counts[1], bool(counts[2])

    def _kept_arrays(self) -> list[str]:
        """Arrays of `state.particles` that last from step to step.

        Not those that are zero between steps or follow from the number of the step.
        """
        leave = ("pairs", "moved", "asked", "force_so_far", "torque_so_far", "wall_shift")
        names = [name for name in self.state.types.Particles.vars if name not in leave]
        return [name for name in names if getattr(self.state.particles, name) is not None]

    # -- reading -------------------------------------------------------------------------------------------

    def frame(self) -> Frame:
        """The written step as a table in order of id, float64. Raises SimulationError for NaN in it."""
        state, scene = self.state, self.scene
        host = state.host
        row = host(state.particles.id)

        def by_id(values: np.ndarray) -> np.ndarray:
            out = np.empty((state.n, 3))
            out[row] = values
            return out

        full, zeros = state.full, np.zeros((state.n, 3))
        frame = {
            "id": np.arange(1, state.n + 1, dtype=np.int64),
            "material": scene.state.material.astype(np.int32),
            "position": self._inside(by_id(host(self._written)["position"])),
            "velocity": by_id(host(full.velocity)),
            "angular_velocity": by_id(host(full.angular_velocity)) if self.spec.rotation else zeros,
            "radius": scene.state.radius,
            "force": by_id(host(full.force)),
            "torque": by_id(host(full.torque)) if self.spec.rotation else zeros,
        }
        for name in ("position", "velocity"):
            if not np.isfinite(frame[name]).all():
                i = int(np.argwhere(~np.isfinite(frame[name]))[0][0])
                at = f"t = {self.step_count * scene.time.step:.9g} s (step {self.step_count})"
                raise SimulationError(f"particle {i + 1} has a {name} that is not a number (NaN) at {at}")
        return frame

    def _inside(self, position: np.ndarray) -> np.ndarray:
        """Positions wrapped into the periodic sides (the solver itself wraps at a rebuild only)."""
        lo, hi = np.array(self.scene.domain.lo), np.array(self.scene.domain.hi)
        for k in np.flatnonzero(self.scene.domain.periodic):
            position[position[:, k] < lo[k], k] += hi[k] - lo[k]
            position[position[:, k] >= hi[k], k] -= hi[k] - lo[k]
        return position

    def contact_count(self) -> int:
        """Contacts in the written step, between particles and with walls."""
        return int(self.state.host(self.state.full.contacts).sum()) // 2

    def wall_work(self) -> float | None:
        """Work of moving planes since the start [J]; None where no plane moves.

        Force on each particle times the way of the plane in the step, added up on the device.
        """
        return float(self.state.particles.wall_work.numpy().sum()) if self.spec.vibration else None

    def memory_bytes(self) -> dict[str, int]:
        """Bytes of every device array, by name."""
        own = {f"list.{k}": v for k, v in vars(self.neighbors).items() if isinstance(v, wp.array)}
        own |= {f"list.{k}": getattr(self.neighbors.scratch, k) for k in self.neighbors._moved_arrays}
        found = {}
        for name, array in (self.state.arrays() | own).items():
            fields = getattr(array.dtype, "vars", {})
            for field, var in fields.items():
                found[f"{name}.{field}"] = array.size * wp.types.type_size_in_bytes(var.type)
            if not fields:
                found[name] = array.size * wp.types.type_size_in_bytes(array.dtype)
        return found

    def close(self) -> None:
        """End the threads."""
        self.crew.close()
