# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportIndexIssue=false, reportInvalidTypeForm=false
"""Particles that leave: found at a rebuild of the list, sorted behind the others, counted by the host."""

import functools
from typing import Any

import numpy as np
import warp as wp

from gpudem.scene import Scene
from gpudem.solver.body import body_reader, body_struct
from gpudem.solver.device import compile_kernels
from gpudem.solver.spec import Spec
from gpudem.solver.state import structs


@functools.cache
def exit_struct(precision: str) -> Any:
    """The struct `Exit`: a plane beyond which particles leave."""
    wide3 = structs(precision).wide3

    @wp.struct
    class Exit:
        point: wide3  # [m]
        inwards: wide3  # unit normal

    return Exit


def exit_array(scene: Scene, spec: Spec, device: Any) -> Any:
    """The exits of a scene on the device, shape (e,); None without any."""
    if not scene.exits:
        return None
    kind, wide3 = exit_struct(spec.precision), structs(spec.precision).wide3
    found = []
    for stated in scene.exits:
        one = kind()
        one.point, one.inwards = wide3(*stated.point), wide3(*stated.inwards)
        found.append(one)
    return wp.array(found, dtype=kind, device=device)


@functools.cache
def exit_kernel(spec: Spec) -> Any:
    """Gives particles that leave keys behind those of all cells: the number of cells + the exit."""
    t = structs(spec.precision)
    Exit, position_of = exit_struct(spec.precision), body_reader(spec, "position")

    @wp.kernel(module="unique", enable_backward=False)
    def find_leaving(
        # params
        params: t.Params,
        begin: wp.int32,
        cells: wp.int32,
        # in
        exits: wp.array[Exit],
        now: wp.array[body_struct(spec)],
        # out
        key: wp.array[wp.int32],
    ):
        i = begin + wp.tid()
        x = position_of(now, i)
        for e in range(exits.shape[0]):
            at = exits[e]
            if wp.dot(x - at.point, at.inwards) < t.wide(0.0):  # mutate: beyond_side
                key[i] = cells + e  # mutate: key_of_exit
                return

    return find_leaving


@wp.kernel(enable_backward=False)
def rank_rows(
    # in
    id: wp.array[wp.int32],
    rank: wp.array[wp.int32],
    # out
    row: wp.array[wp.int32],
):
    """The row of each particle in a table of those that are there."""
    i = wp.tid()
    row[i] = rank[id[i]]


#: Step of a particle that has not left.
NEVER = np.iinfo(np.int64).max


class Departures:
    """Which particles have left, when, and through which exit: by row of the scene, on the host."""

    def __init__(self, scene: Scene):
        self.scene = scene
        self.step = np.full(len(scene.state), NEVER, np.int64)
        """The first step without the particle."""
        self.exit = np.full(len(scene.state), -1, np.int64)

    def record(self, rows: np.ndarray, exits: np.ndarray, step: int) -> None:
        """These particles have left through these exits before the forces of a step."""
        self.step[rows] = step  # mutate: step_of_leaving
        self.exit[rows] = exits

    @property
    def rank(self) -> np.ndarray:
        """By row of the scene: the row in a table of those that have not left, in order of id."""
        return np.cumsum(self.exit < 0) - 1

    def ranked(self, id: wp.array, count: int) -> wp.array:
        """The rank of the first so many particles of a device array of rows of the scene, on its device."""
        compile_kernels(id.device, [rank_rows])
        rank = wp.array(self.rank.astype(np.int32), device=id.device)
        found = wp.empty(count, dtype=wp.int32, device=id.device)
        wp.launch(rank_rows, count, inputs=[id, rank], outputs=[found], device=id.device)
        return found

    def __len__(self) -> int:
        return int((self.exit >= 0).sum())

    def mean_count(self, steps: int) -> int:
        """How many particles there are on average over the first so many steps of the run."""
        if not steps:
            return self.scene.mean_count(0)
        without = np.clip(steps + 1 - self.step, 0, steps).sum() / steps
        return round(
            float(np.clip(steps + 1 - self.scene.arrival_steps, 0, steps).sum()) / steps - float(without)
        )

    def totals(self) -> dict[str, tuple[int, float]]:
        """Number and mass [kg] of the particles that have left so far, by name of the exit."""
        found = {}
        for k, stated in enumerate(self.scene.exits):
            rows = self.exit == k
            found[stated.name] = (
                int(rows.sum()),
                float(self.scene.masses[rows].sum()),
            )  # mutate: mass_that_left
        return found
