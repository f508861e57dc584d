"""The list of neighbors and walls of a run: its buffers, and the rebuild as a sequence of launches.

A rebuild reads one set of arrays and writes another: the arrays that it sorts, the list and the histories of
its contacts. Afterwards the sets change sides, so nothing is copied. `State.side` counts these changes; a
launch recorded for one side is not valid for another.

The host either waits for the result (`rebuild`), or launches the whole rebuild and goes on
(`rebuild_in_graph`). Then a kernel of one thread decides whether the list may be filled. Where something was
found wrong, where particles leave, or where the list has no room, it sets `rebuild_pending[0]`: the list is
not filled, and the steps launched after it do nothing, until the host calls `finish_rebuild`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp

from gpudem.errors import SimulationError
from gpudem.scene import Scene
from gpudem.scene.removal import search_box
from gpudem.scene.size_classes import class_radii
from gpudem.solver import guards
from gpudem.solver.class_grids import class_grids, grid_struct
from gpudem.solver.list_layout import slice_widths
from gpudem.solver.neighbor_kernels import (
    cache_in_bodies,
    cache_size,
    cell_kernel,
    cell_start_threads,
    cell_starts,
    check_rebuild,
    count_kernel,
    fill_kernel,
    gather_kernel,
)
from gpudem.solver.removal import Exits, exit_kernel
from gpudem.solver.reports import (
    DEEP_IN_WALL,
    LOST,
    NO_REPORT,
    NOT_A_NUMBER,
    SLOTS,
    TOO_DEEP,
    TOO_FAST,
    unpack_report,
)
from gpudem.solver.state import State
from gpudem.solver.thread_pool import CpuThreadPool


def cell_grid(scene: Scene) -> tuple[tuple[int, int, int], np.ndarray]:
    """Cells along each axis, each at least one reach wide, and cells per length [1/m].

    Where radii are of several size classes: of particles of mean radius, for an estimate. At most eight cells
    a particle (and 4096), so that a large, nearly empty domain costs no memory.
    """
    lo, hi = search_box(scene)
    size = hi - lo
    radius = scene.state.radius
    margin = scene.skin + scene.contact_range
    reach = radius.max() if len(class_radii(radius, margin)) == 1 else radius.mean()
    edge = 2 * float(reach) + margin  # mutate: cell_edge
    limit = 8 * len(scene.state) + 4096
    while math.prod(cells := tuple(max(1, math.floor(s / edge)) for s in size)) > limit:
        edge *= 1.26  # half as many cells
    return cells, np.array(cells) / size  # type: ignore[return-value]


def layers_of_cells(position: np.ndarray, cell_rate: np.ndarray) -> np.ndarray:
    """Layers of cells along x, y, z that hold particles; outliers, a twentieth on each side, are left out.

    Sorted along the axis with most of them, a layer is small: neighbors lie near each other in memory, and
    blocks of the half list have few pairs across.
    """
    low, high = np.nan_to_num(np.quantile(position, (0.05, 0.95), axis=0))
    return np.maximum((high - low) / 0.9 * cell_rate, 1.0)


def with_room(entries: int) -> int:
    """Entries to allocate for a list of so many: it grows by a tenth at a time."""
    return int(1.1 * entries) + 64


def block_size(n: int, layers: float) -> int:
    """Particles of a block of the half list: a power of two blocks, at most 64, of 1000 particles or more.

    Sorted particles fill the cells layer by layer; blocks of eight layers leave few pairs across, which are
    computed twice.
    """
    most = min(n // 1000, int(layers) // 8, 64)
    blocks = 1 << (most.bit_length() - 1) if most else 1
    return -(-n // blocks)


class NeighborList:
    """Rebuilds the list of a State on request.

    `on_reallocate` is called when list arrays were replaced: launches recorded elsewhere are out of date.
    `when` gives the time of an error in words.
    """

    neighbor: Any

    def __init__(self, scene: Scene, state: State, params: Any, pool: CpuThreadPool):
        self.state, self.params, self.pool, self.scene = state, params, pool, scene
        spec, device, n, t = state.spec, state.device, state.n, state.types
        self.walls: Any = t.Walls()
        self.cells = math.prod(params.cells)
        self.grids: Any = None

        def integers(count: int) -> Any:
            return wp.zeros(count, dtype=wp.int32, device=device)

        self._set_grids()
        # the second half of both is free once the sort is done
        self.key, self.order = integers(2 * n), integers(2 * n + 1)
        self.neighbor_count = self.key[n:] if spec.has_walls else None
        slices = -(-n // spec.list_slice)
        self.cell_start, self.start = integers(self.cells + 1), integers(slices + 1)
        # a half list needs the lengths no longer than a rebuild lasts
        self.count = self.order[n:] if spec.half_list else integers(n)
        self.width = self.count if spec.half_list else integers(slices + 1)
        """Room that each slice takes in the list."""
        self.cache = None if cache_in_bodies(spec) else integers(slices * spec.list_slice * cache_size(spec))
        self.status = wp.full(SLOTS, NO_REPORT, dtype=wp.int64, device=device)
        self.rebuilds = 0
        """How often the list was made anew."""
        self._history_arrays = {
            **({"spring": t.vec3} if spec.spring_history else {}),
            **({"rolling_torque": t.vec3} if spec.rolling_history else {}),
            **({"rise": t.wide} if any(wall.fast_floor for wall in scene.wall_elements) else {}),
        }
        self._scratch_arrays: dict[str, Any] = {}
        if spec.meshes:
            self._scratch_arrays = {
                "mesh_near": wp.int32, "mesh_leader": wp.int32, "mesh_gap": t.wide, "mesh_normal": t.wide3,
            }  # fmt: skip
        if spec.wall_forces:
            self._scratch_arrays |= {"wall_force": t.vec3, "wall_couple": t.vec3, "wall_point": t.wide3}
        self.neighbor = self.spring = self.rolling_torque = self.rise = None
        self._permuted_arrays = ["id", *(["image"] * any(spec.periodic)), *(["radius"] * spec.polydisperse)]
        self._permuted_arrays += ["mass"] * spec.per_particle_mass + ["material"] * spec.multi_material
        self._permuted_arrays += ["held"] * spec.held + ["origin"] * spec.moved_groups
        self.scratch = t.Particles()
        self.scratch.x_at_rebuild = state.particles.x_at_rebuild  # rebuilding writes it anew
        for name in self._permuted_arrays:
            setattr(self.scratch, name, wp.zeros_like(getattr(state.particles, name)))
        self.exits = Exits(scene, spec, device) if scene.exits else None
        self.kernels = self._kernels()
        self.on_leave: Callable[[np.ndarray, np.ndarray], None] = lambda rows, exits: None
        """Called with the rows of the scene and the exits of particles that leave."""
        self._launches: dict[tuple[str, int, int], Callable[[], None]] = {}
        self._graphs: dict[tuple[int, int], Any] = {}
        """Rebuilds recorded as CUDA graphs, by the side of the bodies and of the list."""
        self.on_reallocate: Callable[[], None] = lambda: None
        self.next_step: Callable[[], int] = lambda: 0
        self._allocate(with_room(0))

    def _kernels(self) -> dict[str, Any]:
        spec = self.state.spec
        kernels = {
            "cells": cell_kernel(spec),
            "gather": gather_kernel(spec),
            "count": count_kernel(spec),
            "fill": fill_kernel(spec),
            "cell_starts": cell_starts,
            "check_rebuild": check_rebuild,
        }
        if not spec.half_list:
            kernels["slice_widths"] = slice_widths(spec.list_slice)
        if self.exits is not None:
            kernels["leave"] = exit_kernel(spec)
        return kernels

    def _allocate(self, capacity: int) -> None:
        """Arrays of so many entries; the old list stays: its history is still to be carried over."""
        state = self.state
        p, device = state.particles, state.device
        arrays = {"neighbor": wp.int32, **self._history_arrays}
        for name, dtype in arrays.items():
            grown = wp.zeros(capacity, dtype=dtype, device=device)
            if self.rebuilds > 0:
                wp.copy(grown, getattr(p, name), count=self.capacity)  # mutate: history_of_grown_list
            setattr(p, name, grown)
            setattr(self, name, wp.zeros(capacity, dtype=dtype, device=device))
        for name, dtype in self._scratch_arrays.items():
            setattr(p, name, wp.zeros(capacity, dtype=dtype, device=device))
        self.capacity = capacity
        self.forget_launches()
        self.on_reallocate()

    def tuning(self) -> dict[str, Any]:
        """What was chosen by rule: skin [m], cells along x, y, z, the sorted order, particles of a block.

        Also the number of size classes where there are several; the cells are then of the mean radius.
        """
        p = self.params
        chosen = {"skin": self.scene.skin, "cells": [int(c) for c in p.cells]}
        chosen["slowest_first"] = "".join("xyz"[a] for a in reversed(list(p.axes)))
        if self.grids is not None:
            chosen["size_classes"] = len(self.grids)
        if self.state.spec.half_list:
            chosen["block"] = int(p.block)
        return chosen

    @property
    def entry_arrays(self) -> tuple[str, ...]:
        """Arrays of `state.particles` with one value for each entry of the list."""
        return ("neighbor", *self._history_arrays)

    @property
    def permuted_arrays(self) -> tuple[str, ...]:
        """Arrays of `state.particles` that a rebuild sorts."""
        return tuple(self._permuted_arrays)

    def reserve(self, entries: int) -> None:
        """Let the list hold so many entries, whose old values are lost."""
        if entries > self.capacity:
            self.rebuilds = 0
            self._allocate(with_room(entries))

    def set_walls(self, walls: Any) -> None:
        """The walls to look for from now on, in the order that `params` now say; `rebuild` must follow."""
        self.walls = walls
        self._set_grids()
        if len(self.cell_start) != self.cells + 1:
            self.cell_start = wp.zeros(self.cells + 1, dtype=wp.int32, device=self.state.device)
        self.forget_launches()

    def forget_launches(self) -> None:
        """Arrays or the number of particles have changed; a rebuild records its launches anew."""
        self._launches.clear()
        self._graphs.clear()

    def _set_grids(self) -> None:
        """The cells of each size class, for the order of sorting and the blocks that `params` now say."""
        state, p = self.state, self.params
        if state.spec.size_classes:
            axes, precision = [int(axis) for axis in p.axes], state.spec.precision
            grids, self.cells = class_grids(self.scene, axes, int(p.block), precision)
            self.grids = wp.array(grids, dtype=grid_struct(precision), device=state.device)

    def rebuild(self) -> None:
        """Sort, re-order, list (which grows where needed). Raises SimulationError: lost particle or NaN."""
        self._search()
        self.rebuilds += 1
        self.finish_rebuild()

    def rebuild_in_graph(self, graph: bool) -> None:
        """The same, but the host does not wait for what was found: see `finish_suspended`.

        `graph`: as one CUDA graph. Without a memory pool Warp cannot allocate what sort and sum need while it
        records one; then they are launched one by one.
        """
        state, device = self.state, self.state.device
        self.rebuilds += 1
        if not graph or (device.is_cuda and not device.is_mempool_enabled):
            self._launch_all()
            return
        key = (id(state.now), state.side)
        if key in self._graphs:
            wp.capture_launch(self._graphs[key])
            self._change_sides_of_particles()  # mutate: sides_after_graph
            self._change_sides_of_list()
            return
        with wp.ScopedCapture(device, force_module_load=False) as capture:
            self._launch_all()
        self._graphs[key] = capture.graph
        wp.capture_launch(self._graphs[key])

    def _launch_all(self) -> None:
        state = self.state
        self._search()
        wp.launch(
            check_rebuild, 1,
            inputs=[
                state.present, self.capacity, self.start[-1:], self._first_to_leave, self.status,
            ],
            outputs=[state.particles.rebuild_pending], device=state.device,
        )  # fmt: skip
        self._fill()

    def finish_rebuild(self) -> None:
        """The second half of a rebuild, once the host has seen the first: what was found becomes the list.

        Raises SimulationError for what was reported.
        """
        self._check()
        if self.exits is not None:
            self._let_go()
        total = int(self.start[-1:].numpy()[0])
        if total > self.capacity:
            self._allocate(with_room(total))
        state = self.state
        state.particles.rebuild_pending.zero_()
        self._fill()
        if self.exits is not None and not state.spec.half_list and state.present < state.n:
            self.count[state.present :].zero_()  # those that left have a length in the old list

    def finish_suspended(self) -> None:
        """`finish_rebuild` after a `rebuild_in_graph` whose list was not filled."""
        self._change_sides_of_list()  # back: the old list is still the present one
        self.finish_rebuild()

    @property
    def _first_to_leave(self) -> Any:
        """Place of the first sorted particle without a cell: the number of those that stay, shape (1,)."""
        return self.cell_start[self.cells : self.cells + 1]

    def _let_go(self) -> None:
        """Particles without a cell, the last in the sorted order, leave the run."""
        state, staying = self.state, int(self._first_to_leave.numpy()[0])
        if staying < state.present:
            rows = state.particles.id[staying : state.present].numpy()
            exits = self.key[staying : state.present].numpy() - self.cells
            self.count[staying:].zero_()
            self.on_leave(rows, exits)

    def _search(self) -> None:
        """Cells, order, particle arrays in that order, entries counted, places in the list."""
        state = self.state
        self._run("cells")
        last = self.cells
        if self.exits is not None:
            self._run("leave")
            last += len(self.exits) - 1
        if state.present:
            bits = max(1, last.bit_length())
            wp.utils.radix_sort_pairs(self.key, self.order, state.present, end_bit=bits)
        self._run("cell_starts")
        self._run("gather")
        self._change_sides_of_particles()
        self._run("count")
        if not state.spec.half_list:
            self._run("slice_widths")
        wp.utils.array_scan(self.width, self.start, inclusive=False)

    def _fill(self) -> None:
        """Writes the list, with the history carried over, unless `rebuild_pending[0]` is set."""
        self._run("fill")
        self._change_sides_of_list()

    def _change_sides_of_particles(self) -> None:
        """The sorted particles become the present ones."""
        state, p = self.state, self.state.particles
        state.swap()
        for name in self._permuted_arrays:
            before = getattr(p, name)
            setattr(p, name, getattr(self.scratch, name))
            setattr(self.scratch, name, before)
        state.side = state.side ^ 1

    def _change_sides_of_list(self) -> None:
        """The new list becomes the present one."""
        state, p = self.state, self.state.particles
        changed = ["start", *self.entry_arrays]
        if not state.spec.half_list:
            changed.append("count")  # mutate: length_of_lists
        for name in changed:
            before = getattr(p, name)
            setattr(p, name, getattr(self, name))
            setattr(self, name, before)  # mutate: other_side_of_list
        state.side = state.side ^ 2

    def _run(self, name: str) -> None:
        state = self.state
        key = (name, id(state.now), state.side)
        if key not in self._launches:
            self._launches[key] = self._record(name)
        self._launches[key]()

    def _record(self, name: str) -> Callable[[], None]:
        state, p, now = self.state, self.state.particles, self.state.now
        if name in ("cell_starts", "slice_widths"):
            dim, inputs, output = {
                "cell_starts": (
                    cell_start_threads(state.present, self.cells),
                    [state.present, self.cells, self.key],
                    self.cell_start,
                ),
                "slice_widths": (len(self.width) - 1, [state.n, self.count], self.width),
            }[name]
            found = wp.launch(
                self.kernels[name], dim, inputs=inputs, outputs=[output], device=state.device, record_cmd=True
            )
            return found.launch  # pyright: ignore[reportOptionalMemberAccess]
        cells = [self.grids, self.key, self.cell_start, self.order]
        of_exits = [self.exits.array, self.exits.until, self.exits.arrival] if self.exits else []
        lists = [self.neighbor, self.spring, self.rolling_torque, self.rise]
        cache = state.words_of_next() if self.cache is None else self.cache
        inputs, outputs = {
            "cells": ([self.grids], [p, now, self.key, self.order, self.status]),
            "leave": ([self.cells, *of_exits, p.id, now], [self.key]),
            "gather": ([self.order, now, p], [state.next, self.scratch]),
            "count": ([p, self.walls, *cells], [self.count, self.neighbor_count, cache, self.status]),
            "fill": (
                [self.walls, *cells, self.start, self.count, self.neighbor_count, cache],
                [p, *lists, self.status],
            ),
        }[name]
        return self.pool.record_launch(self.kernels[name], self.params, inputs, outputs)

    def _check(self) -> None:
        """Raises SimulationError for what a rebuild reported: a lost particle, NaN, a guard."""
        report = int(self.status.numpy().min())
        if report == NO_REPORT:
            return
        code, particle, other = unpack_report(report)
        scene, step = self.scene, self.next_step()
        share = f"more than {guards.overlap_limit(scene):g} of the {'smaller ' * (code == TOO_DEEP)}radius"
        wall = scene.wall_elements[other].name if code == DEEP_IN_WALL else ""
        what = {
            LOST: f"left the domain {scene.domain.lo} .. {scene.domain.hi} m",
            NOT_A_NUMBER: "has a position that is not a number (NaN)",
            TOO_FAST: f"moves faster than {guards.speed_limit(scene):.4g} m/s, the smallest radius in a step",
            TOO_DEEP: f"overlaps particle {other + 1} by {share}",
            DEEP_IN_WALL: f"overlaps wall {wall} by {share}",
        }[code]
        advice = guards.SPEED_ADVICE if code == TOO_FAST else ""
        if code == TOO_DEEP:
            advice = guards.pair_advice(scene, particle, other, step)
        if code == DEEP_IN_WALL:
            advice = guards.wall_advice(scene, scene.wall_elements[other])
        when = f"t = {step * scene.time.step:.9g} s (step {step})"
        raise SimulationError(f"particle {particle + 1} {what} at {when}{'; ' * bool(advice)}{advice}")
