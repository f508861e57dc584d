"""The event-driven engine: memory, cells, and the event loop in launches of bounded length."""

import dataclasses
import math
from collections.abc import Callable
from typing import Any, Literal

import numpy as np
import warp as wp

from gpudem.errors import SimulationError
from gpudem.event_driven import event_state as es
from gpudem.event_driven.all_pairs import all_pairs_kernel
from gpudem.event_driven.kernels import build_kernels
from gpudem.event_driven.problem import SIDES, HardSphereProblem, SideWalls, wrap_periodic
from gpudem.solver.device import compile_kernels, find_device

#: Events of one launch, some 40 ms; between launches Ctrl-C, progress and the event rate are looked at.
EVENTS_PER_LAUNCH = 100_000
#: The event rate diverges if EVENTS_PER_LAUNCH events take less than this share of the scene's duration.
MIN_PROGRESS_SHARE = 1e-7
#: Edge of a cell in largest diameters: fastest at about 1.4 [1.1 to 1.6 differ little].
CELL_EDGE_IN_DIAMETERS = 1.4
Search = Literal["tree", "scan", "pairs"]


@dataclasses.dataclass(frozen=True)
class EventCounts:
    """Number of events since the start, by kind."""

    pairs: int
    """Collisions of two particles."""
    walls: int
    """Collisions with a wall."""
    crossings: int
    """Crossings from cell to cell."""
    stale: int
    """Predicted collisions discarded since the partner had collided in the meantime."""
    guarded: int
    """Collisions that the TC model made elastic."""

    @property
    def collisions(self) -> int:
        """Collisions of two particles and with walls."""
        return self.pairs + self.walls

    @property
    def events(self) -> int:
        """All events that the loop has processed."""
        return self.collisions + self.crossings + self.stale


@dataclasses.dataclass(frozen=True)
class CollisionSums:
    """Sums over all collisions since the start."""

    work: float
    """Work of moving walls [J]."""
    dissipated: float
    """Energy lost to restitution and friction [J]."""
    virial: float
    """Impulse times distance of the centers, over collisions of pairs [J s]."""
    overlap: float
    """Largest overlap at a collision, in sums of radii [1]."""


class Engine:
    """Event-driven simulation of hard spheres, from t = 0.

    Args:
        problem: Particles, walls, restitutions.
        cell_edge: Edge of a cell [m], at least the largest diameter; default: CELL_EDGE_IN_DIAMETERS of it.
        log: Number of collisions to log, from the first.
        search: How the next event is found. "tree": O(log N), for use. For comparisons of cost only: "scan",
            the same cells and predictions, the earliest of all particles, O(N); "pairs", all pairs, O(N^2).

    Raises:
        SimulationError: cell_edge below the largest diameter; "pairs" with periodic sides.
    """

    def __init__(
        self,
        problem: HardSphereProblem,
        cell_edge: float | None = None,
        log: int = 0,
        search: Search = "tree",
    ):
        self.problem, self.n, self.time = problem, len(problem.radius), 0.0
        self._device = find_device("cpu")
        sawtooth = any(bool(walls.amplitude.any()) for _, _, walls in problem.segments)
        self._start, self._advance = build_kernels(sawtooth, problem.rough, search != "scan")
        if search == "pairs":
            if problem.periodic.any():
                raise SimulationError("search = 'pairs': periodic sides are not supported; use 'tree'")
            self._advance = all_pairs_kernel(sawtooth, problem.rough)
        compile_kernels(self._device, (self._start, self._advance))
        compile_kernels(self._device, (self._start, self._advance))
        self.cells = _number_of_cells(problem, cell_edge)
        self.cell_edge = (problem.hi - problem.lo) / self.cells
        self.side_closed = np.zeros(6, np.int32)
        self._segment, self._segment_end = -1, 0.0
        self._state = es.EventState()
        self._set_scalars(log)
        self._allocate_walls()
        self._allocate_particles()
        self._allocate_events(log)
        self._start_next_segment()

    # -- running -------------------------------------------------------------------------------------------

    def advance(
        self,
        t: float,
        budget: int | None = None,
        min_progress: float | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> None:
        """Simulate up to time t [s].

        Args:
            t: Time to stop at [s], at least the present one.
            budget: Largest number of events of the whole run.
            min_progress: Simulated time [s] that EVENTS_PER_LAUNCH events (or 100 a particle, if more) must
                exceed; default: MIN_PROGRESS_SHARE of the scene's duration.
            progress: Called with the time [s] after every launch.

        Raises:
            SimulationError: t is not finite or lies in the past; the event rate diverges; the budget is
                spent; a particle left the domain or rests on a wall.
        """
        if not self.time <= t < math.inf:
            raise SimulationError(f"t = {t:g} s: must be finite and at least the present {self.time:g} s")
        if min_progress is None:
            min_progress = MIN_PROGRESS_SHARE * self.problem.segments[-1][1]
        while t > self._segment_end and self._segment + 1 < len(self.problem.segments):
            self._advance_segment(self._segment_end, budget, min_progress, progress)
            self._start_next_segment()
        self._advance_segment(t, budget, min_progress, progress)

    def _advance_segment(
        self, t: float, budget: int | None, min_progress: float, progress: Callable[[float], None] | None
    ) -> None:
        """Launch the event loop until time t, within one segment."""
        events, window, window_start = 0, max(EVENTS_PER_LAUNCH, 100 * self.n), self.time
        while True:
            size = EVENTS_PER_LAUNCH
            if budget is not None:
                size = min(size, budget - self.counts.events)
                if size <= 0:
                    raise SimulationError(
                        f"event budget of {budget} events spent at t = {self.time:.9g} s" + self._advice()
                    )
            self._launch(self._advance, t, size)
            self.time = float(self._current_time[0])
            if self._status[0] == es.STOP_TIME_REACHED:
                return
            self._raise_error()
            events += size
            if progress:
                progress(self.time)
            if events >= window:
                if self.time - window_start <= min_progress:
                    raise SimulationError(
                        f"event rate diverges at t = {self.time:.9g} s: the last {events} events took"
                        f" {self.time - window_start:.3g} s of simulated time" + self._advice()
                    )
                events, window_start = 0, self.time

    def _launch(self, kernel: Any, t: float, count: int) -> None:
        self._status[0] = es.RUNNING
        wp.launch(kernel, dim=1, inputs=[self._state, t, count], device=self._device, record_tape=False)

    def _advice(self) -> str:
        c = self.counts
        return (
            f" ({c.collisions} collisions, {c.guarded} made elastic by the guard): particles settle or"
            " collapse; set guard (t_c) [s] well below the mean time between collisions, or use the"
            " time-stepping solver for beds at rest"
        )

    def _raise_error(self) -> None:
        status, i = int(self._status[0]), int(self._status[1])
        if status == es.LEFT_DOMAIN:
            side = SIDES[int(self._crossing_side[i])]
            raise SimulationError(
                f"particle {i + 1} left the domain by {side} at t = {self.time:.9g} s: there is no wall;"
                " add one or extend the domain"
            )
        if status == es.RESTING_ON_WALL:
            raise SimulationError(
                f"particle {i + 1} rests on a wall at t = {self.time:.9g} s: hard spheres have no lasting"
                " contacts; start it above the wall, or use the time-stepping solver"
            )
        if status == es.SAWTOOTH_ROOT_NOT_FOUND:
            raise SimulationError(
                f"no collision time of particle {i + 1} with a vibrating wall found at t = {self.time:.9g} s:"
                " the period amplitude / speed is too short to be resolved; amplitude = 0 is that limit"
            )

    # -- reading -------------------------------------------------------------------------------------------

    def state(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions [m] and velocities [m/s], (n, 3), at the present time; does not change the simulation.

        Periodic coordinates are in [lo, hi).
        """
        p, (x, v) = self.problem, self._flight()
        return wrap_periodic(x, p.lo, p.hi, p.periodic), v

    def unwrapped_positions(self) -> np.ndarray:
        """Positions (n, 3) [m] at the present time that follow particles through periodic sides."""
        p, (x, _) = self.problem, self._flight()
        return x + self._image * (p.hi - p.lo) if p.periodic.any() else x

    def _flight(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities at the present time, from the local times on; not wrapped."""
        dt, g = (self.time - self._local_time)[:, None], self.problem.gravity
        return self._x + dt * (self._v + 0.5 * dt * g), self._v + dt * g

    @property
    def angular_velocity(self) -> np.ndarray:
        """(n, 3) [rad/s]; of smooth spheres the initial one."""
        p = self.problem
        return (self._angular_velocity if p.rough else p.angular_velocity).copy()

    @property
    def counts(self) -> EventCounts:
        """Events since the start."""
        return EventCounts(*self._counts.tolist())

    @property
    def sums(self) -> CollisionSums:
        """Work, dissipation and virial since the start."""
        return CollisionSums(*self._sums.tolist())

    def energy(self) -> float:
        """Kinetic, rotational and potential energy [J] at the present time.

        Potential energy is relative to the origin; it follows particles through periodic sides.
        """
        p, v, w = self.problem, self.state()[1], self.angular_velocity
        rotational = 0.2 * float((p.mass * p.radius**2) @ (w * w).sum(axis=1))
        potential = -p.mass @ (self.unwrapped_positions() @ p.gravity)
        return float(0.5 * p.mass @ (v * v).sum(axis=1) + potential) + rotational

    @property
    def log(self) -> tuple[np.ndarray, np.ndarray]:
        """(particle and partner (c, 2), times (c,) [s]) of the first collisions; a wall is -2 - its side."""
        size = min(len(self._log_time), self.counts.collisions)
        return self._log[:size].copy(), self._log_time[:size].copy()

    # -- memory --------------------------------------------------------------------------------------------

    def _array(self, name: str, value: np.ndarray, dtype: Any) -> np.ndarray:
        """Set an array of the state; returns a view of its memory."""
        array = wp.array(np.ascontiguousarray(value), dtype=dtype, device=self._device)
        setattr(self._state, name, array)
        return array.numpy()  # on the CPU a view

    def _set_scalars(self, log: int) -> None:
        p, s, n_leaves = self.problem, self._state, 2
        while n_leaves < self.n:
            n_leaves *= 2
        s.n, s.n_leaves, s.log_capacity, s.guard = self.n, n_leaves, log, p.guard
        s.tangential_restitution = p.tangential_restitution
        s.gravity, s.lo, s.cell_edge = wp.vec3d(*p.gravity), wp.vec3d(*p.lo), wp.vec3d(*self.cell_edge)
        s.domain_size, s.n_cells = wp.vec3d(*(p.hi - p.lo)), wp.vec3i(*self.cells.tolist())
        s.search_range = wp.vec3i(*(~p.layer).astype(int).tolist())
        s.periodic = wp.vec3i(*p.periodic.astype(int).tolist())

    def _allocate_walls(self) -> None:
        p, zero, none = self.problem, np.zeros(6), np.zeros(6, np.int32)
        self._wall_present = self._array("wall_present", none, wp.int32)
        self._side_closed = self._array("side_closed", none, wp.int32)
        self._wall_position = self._array("wall_position", zero, wp.float64)
        self._wall_speed = self._array("wall_speed", zero, wp.float64)
        self._wall_amplitude = self._array("wall_amplitude", zero, wp.float64)
        by_material = np.ones((6, len(p.restitution)))
        self._wall_restitution = self._array("wall_restitution", by_material, wp.float64)
        self._array("restitution", p.restitution, wp.float64)
        if p.rough:
            self._wall_friction = self._array("wall_friction", 0 * by_material, wp.float64)
            self._array("friction", p.friction, wp.float64)

    def _allocate_particles(self) -> None:
        p = self.problem
        x = wrap_periodic(p.position, p.lo, p.hi, p.periodic)
        self._x, self._v = self._array("x", x, wp.vec3d), self._array("v", p.velocity, wp.vec3d)
        if p.rough:
            self._angular_velocity = self._array("angular_velocity", p.angular_velocity, wp.vec3d)
        if p.periodic.any():
            image = np.rint((p.position - x) / (p.hi - p.lo)).astype(np.int32)
            self._image = self._array("image", image, wp.vec3i)
        self._local_time = self._array("local_time", np.zeros(self.n), wp.float64)
        self._array("last_collision_time", np.full(self.n, -1e300), wp.float64)
        self._array("radius", p.radius, wp.float64)
        self._array("mass", p.mass, wp.float64)
        self._array("material", p.material.astype(np.int32), wp.int32)

    def _allocate_events(self, log: int) -> None:
        n, n_leaves, none = self.n, int(self._state.n_leaves), np.zeros(self.n, np.int32)
        self._head = self._array("head", np.full(int(self.cells.prod()), -1, np.int32), wp.int32)
        for name in ("next", "previous"):
            self._array(name, none - 1, wp.int32)
        self._cell = self._array("cell", np.zeros((n, 3), np.int32), wp.vec3i)
        for name in ("collision_count", "partner", "partner_count"):
            self._array(name, none, wp.int32)
        for name in ("collision_time", "crossing_time"):
            self._array(name, np.zeros(n), wp.float64)
        self._crossing_side = self._array("crossing_side", none, wp.int32)
        self._array("event_time", np.full(n_leaves, 1e300), wp.float64)
        self._array("tree", np.zeros(n_leaves, np.int32), wp.int32)
        self._status = self._array("status", np.zeros(2, np.int32), wp.int32)
        self._current_time = self._array("current_time", np.zeros(1), wp.float64)
        self._counts = self._array("counts", np.zeros(5, np.int64), wp.int64)
        self._sums = self._array("sums", np.zeros(4), wp.float64)
        self._log = self._array("log", np.zeros((max(log, 1), 2), np.int32), wp.vec2i)
        self._log_time = self._array("log_time", np.zeros(max(log, 1)), wp.float64)[:log]

    # -- segments ------------------------------------------------------------------------------------------

    def _start_next_segment(self) -> None:
        """Set the walls of the next segment and predict all particles anew."""
        self._segment += 1
        begin, self._segment_end, walls = self.problem.segments[self._segment]  # mutate: segment
        self._set_walls(walls)  # mutate: walls_of_segment
        dt = (begin - self._local_time)[:, None]
        x = self._x + dt * (self._v + 0.5 * dt * self.problem.gravity)
        cell = np.floor((x - self.problem.lo) / self.cell_edge).astype(int)
        self._cell[:] = np.clip(cell, 0, self.cells - 1)  # rounding may put a particle on a face beyond it
        self._head[:] = -1
        self._launch(self._start, begin, self.n)
        self._raise_error()

    def _set_walls(self, walls: SideWalls) -> None:
        p = self.problem
        self._wall_present[:], self._wall_position[:] = walls.present, walls.position
        self._wall_speed[:], self._wall_amplitude[:] = walls.speed, walls.amplitude
        self._wall_restitution[:] = walls.restitution
        if p.rough:
            self._wall_friction[:] = walls.friction
        faces = np.stack([p.lo, p.hi], axis=1).ravel()
        outwards = np.array([-1.0, 1.0] * 3)
        self._side_closed[:] = walls.present & ((walls.position - faces) * outwards <= 0)
        self.side_closed = self._side_closed.copy()


def _number_of_cells(problem: HardSphereProblem, cell_edge: float | None) -> np.ndarray:
    """(3,) int: cells of at least cell_edge [m]; one along the normal of a layer. Raises SimulationError."""
    diameter = 2 * float(problem.radius.max())
    edge = CELL_EDGE_IN_DIAMETERS * diameter if cell_edge is None else cell_edge
    if not diameter <= edge < math.inf:
        raise SimulationError(
            f"cell_edge = {edge:g} m: must be finite and at least the largest diameter, {diameter:g} m"
        )
    cells = np.maximum(np.floor((problem.hi - problem.lo) / edge), 1)
    cells = np.where(problem.layer, 1, cells)
    while cells.prod() > max(4096, 64 * len(problem.radius)):  # a high open domain: not millions of cells
        cells = np.maximum(np.floor(cells / 1.1), 1)
    return cells.astype(int)
