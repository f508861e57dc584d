"""The neighbour list of a run: its buffers, and the rebuild as a sequence of launches."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp

from gpudem.errors import SimulationError
from gpudem.scene import Scene
from gpudem.solver import guards
from gpudem.solver.neighbor_kernels import (
    DEEP_IN_WALL,
    HITS,
    LOST,
    NOT_A_NUMBER,
    OK,
    TOO_DEEP,
    TOO_FAST,
    cell_kernel,
    cell_starts,
    decide,
    gather_kernel,
    list_kernel,
)
from gpudem.solver.scan import ExclusiveScan, group_starts, group_sums
from gpudem.solver.state import State
from gpudem.solver.thread_pool import Crew


def cell_grid(scene: Scene) -> tuple[tuple[int, int, int], np.ndarray]:
    """Cells along each axis, each at least one reach wide, and cells per length [1/m].

    At most eight cells a particle (and 4096), so that a large, nearly empty domain costs no memory.
    """
    size = np.array(scene.domain.hi) - np.array(scene.domain.lo)
    edge = 2 * float(scene.state.radius.max()) + scene.skin
    limit = 8 * len(scene.state) + 4096
    while math.prod(cells := tuple(max(1, math.floor(s / edge)) for s in size)) > limit:
        edge *= 1.26  # half as many cells
    return cells, np.array(cells) / size  # type: ignore[return-value]


def layers_of_cells(position: np.ndarray, cell_rate: np.ndarray) -> np.ndarray:
    """Layers of cells along x, y, z that hold particles; outliers, a twentieth on each side, are left out.

    Sorted along the axis with most of them, a layer is small: neighbours lie near each other in memory, and
    blocks of the half list have few pairs across.
    """
    low, high = np.nan_to_num(np.quantile(position, (0.05, 0.95), axis=0))
    return np.maximum((high - low) / 0.9 * cell_rate, 1.0)


def block_size(n: int, layers: float) -> int:
    """Particles of a block of the half list: a power of two blocks, at most 64, of 1000 particles or more.

    Sorted particles fill the cells layer by layer; blocks of eight layers leave few pairs across, which are
    computed twice.
    """
    most = min(n // 1000, int(layers) // 8, 64)
    blocks = 1 << (most.bit_length() - 1) if most else 1
    return -(-n // blocks)


class NeighborList:
    """Rebuilds the list of a State when told to."""

    def __init__(self, scene: Scene, state: State, params: Any, crew: Crew):
        self.state, self.params, self.crew, self.scene = state, params, crew, scene
        self._by_host = 0
        self.walls: Any = state.types.Walls()
        spec, device, n, t = state.spec, state.device, state.n, state.types
        self.cells = math.prod(params.cells)
        self.key = wp.zeros(2 * n, dtype=wp.int32, device=device)
        self.order = wp.zeros(2 * n, dtype=wp.int32, device=device)
        self.cell_start = wp.zeros(self.cells + 1, dtype=wp.int32, device=device)
        self.start = wp.zeros(n + 1, dtype=wp.int32, device=device)
        self.count = wp.zeros(n + 1, dtype=wp.int32, device=device)
        self.hits = wp.zeros(n * HITS, dtype=wp.int32, device=device)
        self.status = wp.zeros(3, dtype=wp.int32, device=device)
        self.scan = ExclusiveScan(self.count, self.start)
        self.fits = wp.zeros(1, dtype=wp.int32, device=device)
        """1: the last search on the device found nothing wrong, and the list has room."""
        self.inside = wp.zeros(2, dtype=wp.int32, device=device)
        """Of rebuilds within a graph: how many there were; 1: one stopped half way."""
        self.scratch = t.Particles()
        self._moved_arrays = ["id"]
        self._moved_arrays += ["radius"] * spec.several_radii + ["mass"] * spec.several_masses
        self._moved_arrays += ["material"] * spec.several_materials
        self._moved_arrays += ["wall_near"] * bool(state.planes)
        self._moved_arrays += ["wall_rise"] * (spec.vibration and state.particles.wall_rise is not None)
        if spec.memory and state.planes:
            self._moved_arrays += ["wall_touch", *(["wall_spring"] * spec.history)]
            self._moved_arrays += ["wall_rolling"] * spec.rolling_history
        self._kept = [*(["spring"] * spec.history), *(["rolling"] * spec.rolling_history)]
        self.spring = self.rolling = None
        self.scratch.built_at = state.particles.built_at  # rebuilding writes it anew
        for name in self._moved_arrays:
            setattr(self.scratch, name, wp.zeros_like(getattr(state.particles, name)))
        self.kernels = {
            "cells": cell_kernel(spec),
            "gather": gather_kernel(spec),
            "count": list_kernel(spec, fill=False),
            "fill": list_kernel(spec, fill=True),
            "cell_starts": cell_starts,
            "decide": decide,
            "group_sums": group_sums,
            "group_starts": group_starts,
        }
        self._commands: dict[tuple[str, int], Callable[[], None]] = {}
        self.grew: Callable[[], None] = lambda: None
        """Called when list arrays were replaced: recorded launches elsewhere are out of date."""
        self._allocate((6 if spec.half_list else 12) * n + 64)  # grows where it is denser

    def _allocate(self, capacity: int) -> None:
        state = self.state
        p, device = state.particles, state.device
        if p.neighbor is None or self.rebuilds == 0:
            p.neighbor = wp.zeros(capacity, dtype=wp.int32, device=device)
            for name in self._kept:
                setattr(p, name, wp.zeros(capacity, dtype=state.types.vec3, device=device))
        else:  # keep what the old list holds: its springs are still to be carried over
            for name in ("neighbor", *self._kept):
                grown = wp.zeros(capacity, dtype=getattr(p, name).dtype, device=device)
                wp.copy(grown, getattr(p, name), count=self.capacity)
                setattr(p, name, grown)
        self.neighbor = wp.zeros(capacity, dtype=wp.int32, device=device)
        for name in self._kept:
            setattr(self, name, wp.zeros(capacity, dtype=state.types.vec3, device=device))
        self.capacity = capacity
        self._commands.clear()
        self.grew()

    def choices(self) -> dict[str, Any]:
        """What was chosen by rule: skin [m], cells along x, y, z, the sorted order, particles of a block."""
        p = self.params
        chosen = {"skin": self.scene.skin, "cells": [int(c) for c in p.cells]}
        chosen["slowest_first"] = "".join("xyz"[a] for a in reversed(list(p.axes)))
        if self.state.spec.half_list:
            chosen["block"] = int(p.block)
        return chosen

    @property
    def rebuilds(self) -> int:
        """How often the list was made anew."""
        return self._by_host + int(self.inside.numpy()[0])

    @rebuilds.setter
    def rebuilds(self, count: int) -> None:
        self._by_host = count
        self.inside.zero_()

    @property
    def entry_arrays(self) -> tuple[str, ...]:
        """Arrays of `state.particles` with one value for each entry of the list."""
        return ("neighbor", *self._kept)

    def make_room(self, entries: int) -> None:
        """Let the list hold so many entries, whose old values are lost."""
        if entries > self.capacity:
            self.rebuilds = 0
            self._allocate(int(1.2 * entries))

    def set_walls(self, walls: Any) -> None:
        """The planes to look for from now on, in the order `params` now say; `rebuild` must follow."""
        self.walls = walls
        self._commands.clear()

    def rebuild(self) -> None:
        """Sort, re-order, list (which grows where needed). Raises SimulationError: lost particle or NaN."""
        self._search()
        self.go_on()

    def rebuild_inside(self, launch: int) -> None:
        """The same before a launch of a graph, where a particle asks for it; the host has no look at it.

        Afterwards `now` is the array it was, for a graph cannot swap on a condition. Where something is wrong
        or the list has no room it stops half way and `moved[launch]` stays: no step is done until `go_on`.
        """
        wp.capture_if(self.state.particles.asked[launch : launch + 1], on_true=self._inside, launch=launch)

    def _inside(self, launch: int) -> None:
        self._search()
        wp.copy(self.state.next, self.state.now)
        self.state.swap()
        wp.launch(
            decide, 1, inputs=[self.state.n, self.capacity, self.start, self.status],
            outputs=[self.fits, self.inside], device=self.state.device,
        )  # fmt: skip
        wp.capture_if(self.fits, on_true=self._fill, launch=launch)

    def stopped(self) -> bool:
        """Whether a rebuild within a graph has stopped half way; `go_on` must follow."""
        return bool(self.inside.numpy()[1])

    def go_on(self) -> None:
        """The second half of a rebuild, after a look at the first: what was found becomes the list.

        Raises SimulationError for what was wrong.
        """
        self._check()
        total = int(self.start[self.state.n : self.state.n + 1].numpy()[0])
        if total > self.capacity:
            self._allocate(int(1.2 * total))
        self._fill()
        self.inside[1:].zero_()
        self._by_host += 1

    def _search(self) -> None:
        """Cells, order, particle arrays in that order, neighbours counted, places in the list."""
        state, p = self.state, self.state.particles
        self._run("cells")
        wp.utils.radix_sort_pairs(self.key, self.order, state.n, end_bit=max(1, self.cells.bit_length()))
        wp.launch(
            cell_starts,
            self.cells + 1,
            inputs=[state.n, self.key],
            outputs=[self.cell_start],
            device=state.device,
        )
        self._run("gather")
        state.swap()
        for name in self._moved_arrays:
            wp.copy(getattr(p, name), getattr(self.scratch, name))
        self._run("count")
        self.scan.run()

    def _fill(self, launch: int | None = None) -> None:
        """Writes the list, with the springs that go on; takes back that `launch`, or any, asked for it."""
        p = self.state.particles
        self._run("fill")
        wp.copy(p.start, self.start)
        wp.copy(p.neighbor, self.neighbor)
        for name in self._kept:
            wp.copy(getattr(p, name), getattr(self, name))
        for flags in (p.moved, p.asked):
            (flags if launch is None else flags[launch : launch + 1]).zero_()

    def _run(self, name: str) -> None:
        state = self.state
        key = (name, id(state.now))
        if key not in self._commands:
            p, now = state.particles, state.now
            listing = [p, self.key, self.cell_start, self.order]
            inputs, outputs = {
                "cells": ([p, now], [self.key, self.order, self.status]),
                "gather": ([self.order, self.walls, now, p], [state.next, self.scratch, self.status]),
                "count": ([*listing, self.count, self.hits], [None, None, None, self.status]),
                "fill": (
                    [*listing, self.start, self.hits],
                    [self.neighbor, self.spring, self.rolling, self.status],
                ),
            }[name]
            self._commands[key] = self.crew.command(self.kernels[name], self.params, inputs, outputs)
        self._commands[key]()

    def _check(self) -> None:
        """Raises SimulationError for what a rebuild reported: a lost particle, NaN, a guard."""
        code, who, other = (int(v) for v in self.status.numpy())
        if code == OK:
            return
        scene = self.scene
        share = f"more than {guards.overlap_limit(scene):g} of the {'smaller ' * (code == TOO_DEEP)}radius"
        wall = scene.planes[other].name if code == DEEP_IN_WALL else ""
        what = {
            LOST: f"left the domain {scene.domain.lo} .. {scene.domain.hi} m",
            NOT_A_NUMBER: "has a position that is not a number (NaN)",
            TOO_FAST: f"moves faster than {guards.speed_limit(scene):.4g} m/s, the smallest radius in a step",
            TOO_DEEP: f"overlaps particle {other + 1} by {share}",
            DEEP_IN_WALL: f"overlaps wall {wall} by {share}",
        }[code]
        deep = (TOO_DEEP, DEEP_IN_WALL)
        advice = guards.OVERLAP_ADVICE if code in deep else guards.SPEED_ADVICE if code == TOO_FAST else ""
        raise SimulationError(f"particle {who + 1} {what}" + (f"; {advice}" if advice else ""))
