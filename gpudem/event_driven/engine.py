"""Hard spheres in flight: arrays, cells and the event loop in chunks, with its budget."""

import dataclasses
from collections.abc import Callable
from typing import Any, Literal

import numpy as np
import warp as wp

from gpudem.errors import SimulationError
from gpudem.event_driven import events as k
from gpudem.event_driven.all_pairs import all_pairs
from gpudem.event_driven.kernels import kernels
from gpudem.event_driven.statement import SIDES, Statement, Walls
from gpudem.solver.device import compile_kernels, find_device

#: Events of one launch, some 40 ms: time to look at the clock, for Ctrl-C and for progress.
CHUNK = 100_000
#: A chunk of events that takes less than this share of the scene's duration is a diverging event rate.
SLOWEST = 1e-7
#: Edge of a cell by the largest diameter: fastest at some 1.4 [1.1 to 1.6 differ little].
EDGE = 1.4


@dataclasses.dataclass(frozen=True)
class Counts:
    """What happened so far."""

    pairs: int
    walls: int
    crossings: int
    stale: int
    guarded: int
    """Collisions that the TC model made elastic."""

    @property
    def collisions(self) -> int:
        """Particle with particle and particle with wall."""
        return self.pairs + self.walls

    @property
    def events(self) -> int:
        """All that the loop took from the tree."""
        return self.collisions + self.crossings + self.stale


@dataclasses.dataclass(frozen=True)
class Sums:
    """What collisions added up to."""

    work: float
    """Done by moving walls [J]."""
    dissipated: float
    """Lost to restitution [J]."""
    virial: float
    """Sum of impulse times distance of centres [J s]."""
    overlap: float
    """Largest overlap at a collision, in sums of radii [1]."""


class Engine:
    """Hard spheres from t = 0 on.

    Args:
        statement: Particles, walls, restitutions.
        cell_edge: Edge of a cell [m]; default 1.4 of the largest diameter.
        log: How many collisions to log, from the first.
        search: How the next event is found. "tree": O(log N), the engine. For comparisons of cost "scan": the
            same cells and predictions, the earliest of all particles, O(N); "pairs": all pairs, O(N^2).

    Raises:
        SimulationError: cells smaller than a particle; "pairs" with periodic sides.
    """

    def __init__(
        self,
        statement: Statement,
        cell_edge: float | None = None,
        log: int = 0,
        search: Literal["tree", "scan", "pairs"] = "tree",
    ):
        self.statement, self.n = statement, len(statement.radius)
        self._device = find_device("cpu")
        saw = any(bool(walls.stroke.any()) for _, _, walls in statement.segments)
        self._start, self._advance = kernels(saw, statement.rough, search != "scan")
        if search == "pairs":
            if statement.periodic.any():
                raise SimulationError("search = 'pairs': sees no images over periodic sides")
            self._advance = all_pairs(saw, statement.rough)
        compile_kernels(self._device, (self._start, self._advance))
        diameter = 2 * float(statement.radius.max())
        edge = EDGE * diameter if cell_edge is None else cell_edge
        if edge < diameter:
            raise SimulationError(f"cell_edge = {edge:g} m: must be at least the diameter, {diameter:g} m")
        extent = statement.hi - statement.lo
        cells = np.maximum(np.floor(extent / edge), 1)
        cells = np.where(statement.layer, 1, cells)
        while cells.prod() > max(4096, 64 * self.n):  # a high open top is not cut into millions of cells
            cells = np.maximum(np.floor(cells / 1.1), 1)
        self.cells = cells.astype(int)
        self.edge = extent / self.cells
        self._segment = -1
        self.shut = np.zeros(6, np.int32)
        self._end, self.time = 0.0, 0.0
        self._allocate(log)
        self._next_segment()

    # -- running -------------------------------------------------------------------------------------------

    def advance(
        self,
        t: float,
        budget: int | None = None,
        slowest: float | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> None:
        """Go on to time t [s].

        Args:
            t: Time to stop at [s], not before the present one.
            budget: Most events that the whole run may take.
            slowest: Least time [s] that CHUNK events (or 100 a particle) must take; default: SLOWEST of the
                scene's duration.
            progress: Called with the time [s] after every chunk.

        Raises:
            SimulationError: the event rate diverges or the budget is spent; a particle left the domain or
                rests on a wall.
        """
        if slowest is None:
            slowest = SLOWEST * self.statement.segments[-1][1]
        while t > self._end and self._segment + 1 < len(self.statement.segments):
            self._to(self._end, budget, slowest, progress)
            self._next_segment()
        self._to(t, budget, slowest, progress)

    def _to(
        self, t: float, budget: int | None, slowest: float, progress: Callable[[float], None] | None
    ) -> None:
        done, mark, mark_time = 0, max(CHUNK, 100 * self.n), self.time
        while True:
            size = CHUNK
            if budget is not None:
                size = min(size, budget - self.counts.events)
                if size <= 0:
                    raise SimulationError(
                        f"event budget of {budget} events spent at t = {self.time:.9g} s" + self._advice()
                    )
            self._status[0] = k.BUSY
            wp.launch(
                self._advance, dim=1, inputs=[self._events, t, size], device=self._device, record_tape=False
            )
            self.time = float(self._now[0])
            if self._status[0] == k.DONE:
                return
            self._raise_for(int(self._status[0]), int(self._status[1]))
            done += size
            if progress:
                progress(self.time)
            if done >= mark:
                if self.time - mark_time <= slowest:
                    raise SimulationError(
                        f"event rate diverges at t = {self.time:.9g} s: the last {done} events took"
                        f" {self.time - mark_time:.3g} s of simulated time" + self._advice()
                    )
                done, mark_time = 0, self.time

    def _advice(self) -> str:
        c = self.counts
        return (
            f" ({c.collisions} collisions, {c.guarded} made elastic by the guard): particles settle or"
            " collapse; set guard (t_c) to a time well below that between collisions, or use the soft solver"
            " for beds at rest"
        )

    def _raise_for(self, status: int, i: int) -> None:
        if status == k.LOST:
            side = SIDES[int(self._cross_side[i])]
            raise SimulationError(
                f"particle {i + 1} left the domain by {side} at t = {self.time:.9g} s: there is no wall;"
                " put one there or widen the domain"
            )
        if status == k.RESTING:
            raise SimulationError(
                f"particle {i + 1} rests on a wall at t = {self.time:.9g} s: hard spheres state no lasting"
                " contact; lift it, or use the soft solver"
            )
        if status == k.UNSEEN:
            raise SimulationError(
                f"particle {i + 1} finds no tooth of a vibrating wall at t = {self.time:.9g} s: the period is"
                " too short for the clock; amplitude = 0 is that limit"
            )

    # -- reading -------------------------------------------------------------------------------------------

    def state(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities (n, 3) at the present time; the clocks of the particles stay."""
        dt = (self.time - self._clock)[:, None]
        g = self.statement.gravity
        x, v = self._x + dt * (self._v + 0.5 * dt * g), self._v + dt * g
        s = self.statement
        return np.where(s.periodic, s.lo + (x - s.lo) % (s.hi - s.lo), x), v

    @property
    def spin(self) -> np.ndarray:
        """Angular velocities (n, 3) [rad/s]; between smooth spheres those of the start."""
        return (self._spin if self.statement.rough else self.statement.spin).copy()

    @property
    def counts(self) -> Counts:
        """Events so far."""
        return Counts(*self._counts.tolist())

    @property
    def sums(self) -> Sums:
        """Work and losses so far."""
        return Sums(*self._sums.tolist())

    def energy(self) -> float:
        """Kinetic and potential energy [J] of the present state; potential counts from the origin."""
        x, v = self.state()
        m, w, radius = self.statement.mass, self.spin, self.statement.radius
        turning = 0.2 * float((m * radius**2) @ (w * w).sum(axis=1))
        return float(0.5 * m @ (v * v).sum(axis=1) - m @ (x @ self.statement.gravity)) + turning

    @property
    def log(self) -> tuple[np.ndarray, np.ndarray]:
        """(pairs (c, 2), times (c,)) of the first collisions; a wall is -2 - its side."""
        size = min(len(self._log_time), self.counts.collisions)
        return self._log[:size].copy(), self._log_time[:size].copy()

    # -- arrays --------------------------------------------------------------------------------------------

    def _array(self, name: str, value: np.ndarray, dtype: Any) -> np.ndarray:
        """Put an array into the struct; returns its memory."""
        array = wp.array(np.ascontiguousarray(value), dtype=dtype, device=self._device)
        setattr(self._events, name, array)
        return array.numpy()  # on the CPU a view

    def _allocate(self, log: int) -> None:
        s, n = self.statement, self.n
        e = self._events = k.Events()
        leaves = 2
        while leaves < n:
            leaves *= 2
        e.n, e.leaves, e.log_size, e.guard = n, leaves, log, s.guard
        e.gravity, e.lo, e.edge = wp.vec3d(*s.gravity), wp.vec3d(*s.lo), wp.vec3d(*self.edge)
        e.size, e.cells = wp.vec3d(*(s.hi - s.lo)), wp.vec3i(*self.cells.tolist())
        e.reach, e.periodic = (
            wp.vec3i(*(~s.layer).astype(int).tolist()),
            wp.vec3i(*s.periodic.astype(int).tolist()),
        )
        real, whole, none = wp.float64, wp.int32, np.zeros(n, np.int32)
        self._wall = self._array("wall", np.zeros(6, np.int32), whole)
        self._shut = self._array("shut", np.zeros(6, np.int32), whole)
        self._wall_at = self._array("wall_at", np.zeros(6), real)
        self._wall_speed = self._array("wall_speed", np.zeros(6), real)
        self._wall_stroke = self._array("wall_stroke", np.zeros(6), real)
        self._wall_restitution = self._array("wall_restitution", np.ones((6, len(s.restitution))), real)
        self._array("restitution", s.restitution, real)
        if s.rough:
            e.tangential = s.tangential
            self._array("friction", s.friction, real)
            self._wall_friction = self._array("wall_friction", np.zeros((6, len(s.friction))), real)
            self._spin = self._array("spin", s.spin, wp.vec3d)
        span = s.hi - s.lo
        x = np.where(s.periodic, s.lo + (s.position - s.lo) % span, s.position)
        self._x, self._v = self._array("x", x, wp.vec3d), self._array("v", s.velocity, wp.vec3d)
        self._clock = self._array("clock", np.zeros(n), real)
        self._array("last", np.full(n, -1e300), real)
        self._array("radius", s.radius, real)
        self._array("mass", s.mass, real)
        self._array("material", s.material.astype(np.int32), whole)
        self._head = self._array("head", np.full(int(self.cells.prod()), -1, np.int32), whole)
        for name in ("next", "previous"):
            self._array(name, none - 1, whole)
        self._cell = self._array("cell", np.zeros((n, 3), np.int32), wp.vec3i)
        for name in ("collisions", "partner", "partner_collisions"):
            self._array(name, none, whole)
        for name in ("hit_time", "cross_time"):
            self._array(name, np.zeros(n), real)
        self._cross_side = self._array("cross_side", none, whole)
        self._array("time", np.full(leaves, 1e300), real)
        self._array("winner", np.zeros(leaves, np.int32), whole)
        self._status = self._array("status", np.zeros(2, np.int32), whole)
        self._now = self._array("now", np.zeros(1), real)
        self._counts = self._array("counts", np.zeros(5, np.int64), wp.int64)
        self._sums = self._array("sums", np.zeros(4), real)
        self._log = self._array("log", np.zeros((max(log, 1), 2), np.int32), wp.vec2i)
        self._log_time = self._array("log_time", np.zeros(max(log, 1)), real)[:log]

    def _next_segment(self) -> None:
        """Put up the walls of the next segment and predict all anew."""
        self._segment += 1
        begin, self._end, walls = self.statement.segments[self._segment]
        self._set_walls(walls)
        x = self._x + (begin - self._clock)[:, None] * (
            self._v + 0.5 * (begin - self._clock)[:, None] * self.statement.gravity
        )
        cell = np.floor((x - self.statement.lo) / self.edge).astype(int)
        self._cell[:] = np.clip(cell, 0, self.cells - 1)
        self._head[:] = -1
        self._status[0] = k.BUSY
        wp.launch(
            self._start, dim=1, inputs=[self._events, begin, self.n], device=self._device, record_tape=False
        )
        self._raise_for(int(self._status[0]), int(self._status[1]))

    def _set_walls(self, walls: Walls) -> None:
        s = self.statement
        self._wall[:], self._wall_at[:] = walls.present, walls.at
        self._wall_speed[:], self._wall_stroke[:] = walls.speed, walls.stroke
        self._wall_restitution[:] = walls.restitution
        if s.rough:
            self._wall_friction[:] = walls.friction
        edges = np.stack([s.lo, s.hi], axis=1).ravel()
        outwards = np.array([-1.0, 1.0] * 3)
        self._shut[:] = walls.present & ((walls.at - edges) * outwards <= 0)
        self.shut = self._shut.copy()
