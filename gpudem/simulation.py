"""A scene that is stepped by hand: read and write its particles between steps, on the device.

with gpudem.Simulation(scene, device="cuda:0") as sim:
    sim.step(1000)                     # or sim.run_until(0.5)
    x = sim.read("position")           # wp.array on the device, ordered by id: .numpy(), wp.to_torch, DLPack
    sim.write("velocity", v)           # checked, by id
"""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from typing import Any

import numpy as np
import warp as wp

from gpudem.errors import GpudemError
from gpudem.output import observables
from gpudem.output.view import DeviceView, View
from gpudem.scene import Scene
from gpudem.scene.groups import FREE
from gpudem.scene.walls import Wall
from gpudem.solver.by_id import gather_by_id, position_by_id, scatter_by_id, set_body_by_id
from gpudem.solver.device import compile_kernels
from gpudem.solver.solver import Solver

#: What `read` gives of each particle: vectors of the last full step, and properties that do not change.
VECTORS = ("position", "velocity", "angular_velocity", "force", "torque")
PROPERTIES = ("id", "radius", "mass", "material")
#: What `write` sets.
WRITABLE = ("position", "velocity", "angular_velocity")
#: Steps between two checks for Ctrl-C.
CHUNK = 64


class Simulation:
    """One scene on one device, at a full step whenever a method returns.

    Reading does not change the trajectory: the bits are those of a run without it. Ctrl-C within `step` ends
    it at a full step, from which the next call continues. After an error of the solver, and after `close`,
    every use raises GpudemError.

    Args:
        scene: What to simulate. Its duration and output sections are not used: the caller decides.
        device: Warp device, "cpu" or "cuda:0".
        threads: CPU threads; default: one per core, fewer for few particles.

    Raises:
        SimulationError: no such device; a particle that overlaps another one too far at the start.
    """

    def __init__(self, scene: Scene, device: str = "cpu", threads: int | None = None):
        self.scene = scene
        self._closed: str | None = None
        self._scalars: dict[str, Any] = {}
        self._solver = Solver(scene, device, threads)
        try:
            self._solver.start(self._present(), write=True)
        except BaseException:
            self._solver.close()
            raise

    @classmethod
    def of_solver(cls, solver: Solver) -> Simulation:
        """The same view of a solver that another loop steps, after it has written a full step."""
        self = cls.__new__(cls)
        self.scene, self._solver, self._closed, self._scalars = solver.scene, solver, None, {}
        return self

    def __enter__(self) -> Simulation:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """End the threads; a second call does nothing."""
        self._closed = self._closed or "it was closed"
        self._solver.close()

    @property
    def device(self) -> Any:
        """The Warp device."""
        return self._solver.device

    @property
    def step_count(self) -> int:
        """Steps done."""
        return self._solver.step_count

    @property
    def time(self) -> float:
        """Time [s] since the start."""
        return self.step_count * self.scene.time.step

    # -- stepping ------------------------------------------------------------------------------------------

    def step(self, steps: int = 1) -> None:
        """Do so many steps. Raises GpudemError for a negative number; SimulationError: lost particle, NaN."""
        self._check_open()
        if not isinstance(steps, int | np.integer) or isinstance(steps, bool) or steps < 0:
            raise GpudemError(f"steps = {steps!r}: must be a whole number of 0 or more")
        end = self.step_count + int(steps)
        with _interrupt_deferred() as interrupted, self._closed_by_errors():
            while self.step_count < end and not interrupted():
                self._chunk(min(end, self.step_count + CHUNK))

    def run_until(self, time: float) -> None:
        """Step to the full step nearest to a time [s] since the start. Raises GpudemError: it has passed."""
        steps = round(time / self.scene.time.step) - self.step_count
        if steps < 0:
            raise GpudemError(f"time = {time:g} s: has passed; the simulation is at {self.time:g} s")
        self.step(steps)

    def _chunk(self, end: int) -> None:
        """Steps up to `end`, or to the next change of walls or phase, set up in the next chunk."""
        solver, here = self._solver, self._solver.step_count
        removals = self._removals()
        if here in removals and here > 0:
            solver.start(self._present())  # mutate: set_up_at_removal
        end = min([end, *(step for step in removals if step > here)])
        solver.advance(end - here - 1)
        solver.write_step()

    def _removals(self) -> set[int]:
        return set(self.scene.changes)

    def _present(self) -> list[Wall]:
        """The walls that are there in the step to come."""
        here = self._solver.step_count  # mutate: walls_of_next_step
        return [wall for wall in self.scene.wall_elements if self.scene.is_present(wall, here)]

    # -- reading and writing -------------------------------------------------------------------------------

    def read(self, name: str) -> wp.array:
        """An array of the present full step on the device, ordered by id: a copy.

        position [m], velocity [m/s], angular_velocity [rad/s], force [N] (with gravity), torque [N m]: shape
        (n,) of vectors; radius [m], mass [kg]: shape (n,); material: index into the scene's materials, (n,);
        id: from 1, ascending, (n,). Particles that have left are not in it. Raises GpudemError: unknown name.
        """
        self._check_open()
        if name in PROPERTIES:
            return wp.array(self._property(name), device=self.device)
        if name not in VECTORS:
            raise GpudemError(f"read: no array {name!r}; known: {', '.join((*VECTORS, *PROPERTIES))}")
        solver, state = self._solver, self._solver.state
        spec, t, ids = solver.spec, state.types, self._rows_of_places()
        dtype = t.vec3 if name in ("force", "torque") else t.wide3
        out = wp.zeros(state.present, dtype=dtype, device=self.device)
        if name in ("angular_velocity", "torque") and not spec.rotation:
            return out
        if name == "position":
            self._launch(position_by_id(spec), [solver.params, ids, solver.written], [out])
        else:
            self._launch(gather_by_id(dtype), [ids, getattr(state.output, name)], [out])
        return out

    def observe(self, name: str) -> float:
        """An observable of the present full step, as a history has it (`gpudem.output.observables`).

        Raises GpudemError: unknown name.
        """
        self._check_open()
        return float(observables.get(name)(self.view(self.step_count)))

    def view(self, step: int) -> View:
        """The state at the written full step, as observables see it; on a CUDA device it is reduced there."""
        solver = self._solver
        facts = (
            solver.contact_count, solver.wall_work, solver.wall_loads, solver.servo_ways,
            solver.triangle_forces, solver.rows, solver.departures.totals,
            solver.departures.places, solver.group_works, solver.crossings,
        )  # fmt: skip
        if solver.device.is_cuda:
            return DeviceView(self.scene, step, self._column, self._scalars, *facts)
        return View(self.scene, step, solver.column, *facts)

    def _column(self, name: str) -> wp.array:
        if name == "unwrapped_position":  # asked for only where sides are periodic
            return wp.array(self._solver.column(name), dtype=wp.vec3d, device=self.device)
        return self.read(name)

    def write(self, name: str, values: Any) -> None:
        """Set position [m], velocity [m/s] or angular_velocity [rad/s] of all particles, by id.

        The forces are set up anew for the new state, as at the start of a run; springs of contacts that
        persist are kept. `values`: anything that converts to an array of shape (n, 3), or a wp.array.
        Raises GpudemError: unknown name, shape, not finite, outside the domain; SimulationError: too deep an
        overlap.
        """
        self._check_open()
        given = self._checked(name, values)
        solver, state = self._solver, self._solver.state
        with self._closed_by_errors():
            solver.rewind()  # mutate: rewind_before_write
            ids = self._rows_of_places()
            self._launch(set_body_by_id(solver.spec, name), [ids, given], [state.now])
            if name != "position":
                self._launch(scatter_by_id(state.types.wide3), [ids, given], [getattr(state.output, name)])
            solver.start(self._present(), write=True)  # mutate: set_up_after_write

    def _checked(self, name: str, values: Any) -> wp.array:
        if name not in WRITABLE:
            raise GpudemError(f"write: cannot set {name!r}; known: {', '.join(WRITABLE)}")
        solver, n = self._solver, self._solver.state.present
        if name == "angular_velocity" and not solver.spec.rotation:
            raise GpudemError("write: angular_velocity has no effect: nothing in this scene turns a particle")
        array = np.asarray(values.numpy() if isinstance(values, wp.array) else values)
        if array.dtype.kind not in "iuf" or array.shape != (n, 3):
            raise GpudemError(f"write: {name} has shape {array.shape}, type {array.dtype}; must be ({n}, 3)")
        bad = ~np.isfinite(array).all(axis=1)
        what = "is not finite"
        if name == "position" and not bad.any():
            lo, hi = self.scene.domain.lo, self.scene.domain.hi
            bad, what = ((array < lo) | (array > hi)).any(axis=1), f"is outside the domain {lo} .. {hi} m"
        if bad.any():
            row = int(np.argmax(bad))
            row_id = int(solver.rows()[row]) + 1
            raise GpudemError(f"write: {name} of particle {row_id} = {array[row].tolist()} {what}")
        self._check_held(name, array)
        return wp.array(array.astype(float), dtype=solver.state.types.wide3, device=self.device)

    def _check_held(self, name: str, array: np.ndarray) -> None:
        """Particles of groups stay where they are. Raises GpudemError: another value than theirs."""
        there = self._solver.rows()
        rows = np.flatnonzero(self.scene.held[there] != FREE)
        if not len(rows):
            return
        other = (array[rows] != self.read(name).numpy()[rows]).any(axis=1)
        if other.any():
            i = int(there[rows[np.argmax(other)]])
            group = next(group.name for group in self.scene.groups if i in group.rows(self.scene))
            raise GpudemError(f"write: particle {i + 1} is in group {group!r}: its {name} must stay as it is")

    def _property(self, name: str) -> np.ndarray:
        state, rows = self.scene.state, self._solver.rows()
        if name == "id":
            return rows + 1
        columns = {"radius": state.radius, "mass": self.scene.masses, "material": state.material}
        return columns[name][rows]

    def _rows_of_places(self) -> wp.array:
        """On the device: the row, in order of id, of each particle in sorted order."""
        solver = self._solver
        ids = solver.state.particles.id
        return ids if not len(solver.departures) else solver.departures.ranked(ids, solver.state.present)

    def _launch(self, kernel: Any, inputs: list[Any], outputs: list[Any]) -> None:
        compile_kernels(self.device, [kernel])
        wp.launch(kernel, self._solver.state.present, inputs=inputs, outputs=outputs, device=self.device)

    # -- state of the object -------------------------------------------------------------------------------

    def _check_open(self) -> None:
        if self._closed is not None:
            raise GpudemError(f"the simulation cannot be used any more: {self._closed}")

    @contextlib.contextmanager
    def _closed_by_errors(self) -> Iterator[None]:
        """An error within a step leaves no state to go on from."""
        try:
            yield
        except BaseException as error:
            self._closed = f"it ended with {type(error).__name__}: {error}"
            self._solver.close()
            raise


@contextlib.contextmanager
def _interrupt_deferred() -> Iterator[Any]:
    """Hold Ctrl-C back until the block has ended; yields a function that tells whether it has come.

    Within a step an interrupt would leave arrays half swapped. In another
    thread than the main one, or with another handler, signals stay as they are.
    """
    mine = threading.current_thread() is threading.main_thread()
    if not mine or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield lambda: False
        return
    came: list[int] = []
    signal.signal(signal.SIGINT, lambda number, frame: came.append(number))
    try:
        yield lambda: bool(came)
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if came:
        raise KeyboardInterrupt
