# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportIndexIssue=false, reportInvalidTypeForm=false, reportOperatorIssue=false
"""Particles that leave: found at a rebuild of the list, sorted behind the others, counted by the host."""

import functools
from typing import Any

import numpy as np
import warp as wp

from gpudem.scene import Scene
from gpudem.scene.groups import FREE
from gpudem.scene.removal import AGE, BLOCK, PLANE, SPHERE
from gpudem.solver.body import body_reader, body_struct
from gpudem.solver.device import compile_kernels
from gpudem.solver.spec import Spec
from gpudem.solver.state import structs


@functools.cache
def exit_struct(precision: str) -> Any:
    """The struct `Exit`, as `gpudem.scene.removal.Exit`."""
    wide3 = structs(precision).wide3

    @wp.struct
    class Exit:
        kind: wp.int32
        point: wide3  # [m]
        vector: wide3  # [1] or [m]
        size: wide3  # [m]

    return Exit


@functools.cache
def exit_kernel(spec: Spec) -> Any:
    """Gives particles that leave keys behind those of all cells: the number of cells + the exit.

    Of each exit `until` says whether it is looked for (>= 0), and by age the last step whose particles leave.
    """
    t = structs(spec.precision)
    Exit, position_of = exit_struct(spec.precision), body_reader(spec, "position")
    wide, wide3 = t.wide, t.wide3

    @wp.func
    def is_inside(at: Exit, x: wide3):
        d = x - at.point
        if at.kind == wp.static(PLANE):
            return wp.dot(d, at.vector) < wide(0.0)
        if at.kind == wp.static(BLOCK):
            e = at.vector - x
            return wp.min(wp.min(d), wp.min(e)) >= wide(0.0)  # mutate: in_block
        if at.kind == wp.static(SPHERE):
            return wp.dot(d, d) <= at.size[0] * at.size[0]
        z = wp.dot(d, at.vector)
        across = d - z * at.vector
        radius = at.size[0] + (at.size[1] - at.size[0]) * z / at.size[2]  # mutate: in_cone
        return z >= wide(0.0) and z <= at.size[2] and wp.dot(across, across) <= radius * radius

    @wp.kernel(module="unique", enable_backward=False)
    def find_leaving(
        # params
        params: t.Params,
        begin: wp.int32,
        cells: wp.int32,
        # in
        exits: wp.array[Exit],
        until: wp.array[wp.int32],
        arrival: wp.array[wp.int32],
        id: wp.array[wp.int32],
        now: wp.array[body_struct(spec)],
        # out
        key: wp.array[wp.int32],
    ):
        i = begin + wp.tid()
        x = position_of(now, i)
        for e in range(exits.shape[0]):
            if until[e] < 0:
                continue
            at = exits[e]
            leaves = False
            if at.kind == wp.static(AGE):
                came = arrival[id[i]]
                leaves = came > 0 and came <= until[e]  # mutate: old_enough
            else:
                leaves = is_inside(at, x)
            if leaves:  # mutate: beyond_side
                key[i] = cells + e  # mutate: key_of_exit
                return

    return find_leaving


class Exits:
    """The exits of a scene on the device, and which of them are looked for at the next rebuild."""

    def __init__(self, scene: Scene, spec: Spec, device: Any):
        kind, wide3 = exit_struct(spec.precision), structs(spec.precision).wide3
        found = []
        for stated in scene.exits:
            one = kind()
            one.kind = stated.kind
            one.point, one.vector, one.size = wide3(*stated.point), wide3(*stated.vector), wide3(*stated.size)
            found.append(one)
        self._stated = scene.exits
        self.array = wp.array(found, dtype=kind, device=device)
        steps = scene.arrival_steps if any(e.kind == AGE for e in scene.exits) else np.zeros(1, np.int64)
        self.arrival = wp.array(steps.astype(np.int32), dtype=wp.int32, device=device)
        self.until = wp.zeros(len(found), dtype=wp.int32, device=device)
        self.look_in(None)

    def __len__(self) -> int:
        return len(self._stated)

    def next_after(self, step: int) -> int | None:
        """The next step in which a `[[remove]]` is decided."""
        return min(((step // e.every + 1) * e.every for e in self._stated if e.every), default=None)

    def look_in(self, step: int | None) -> None:
        """From now on for open sides, and for what is decided in a step; None: for open sides only."""
        until = []
        for stated in self._stated:
            decided = stated.every == 0 or (step is not None and step % stated.every == 0)
            until.append(((step or 0) - stated.age) if decided else -1)
        self.until.assign(np.array(until, np.int32))


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
        self._place = np.zeros((len(scene.state) if scene.output.flow else 0, 3))
        """Where each was when it left [m]; kept where flow is counted."""
        self.energy = np.zeros(len(scene.state))
        """Kinetic and potential energy that each took along [J]; 0 of those that are there."""
        self._count = 0

    def record(self, rows: np.ndarray, exits: np.ndarray, step: int, bodies: Any) -> None:
        """These particles have left through these exits before the forces of a step, which would have given
        them the second half of the kick.
        """
        position = bodies["position"]
        self.energy[rows] = self._energies(rows, step, bodies)
        self.step[rows] = step  # mutate: step_of_leaving
        self.exit[rows] = exits
        self._count += len(rows)
        if len(self._place):
            self._place[rows] = position  # mutate: place_of_leaving

    def _energies(self, rows: np.ndarray, step: int, bodies: Any) -> np.ndarray:
        """Kinetic and potential energy [J] of particles that leave: at full-step velocities, were gravity the
        only force on those that no group holds.
        """
        scene, mass = self.scene, self.scene.masses[rows]
        gravity = scene.gravity_at(np.array([step]))[0]
        free = (scene.held[rows] == FREE)[:, None]
        v = bodies["velocity"] + np.where(free, gravity * scene.time.step / 2, 0.0)  # mutate: kick_of_leaving
        kinetic = mass * (v**2).sum(axis=1)
        if "angular_velocity" in (bodies.dtype.names or ()):
            inertia = 0.4 * mass * scene.state.radius[rows] ** 2
            kinetic += inertia * (bodies["angular_velocity"] ** 2).sum(axis=1)
        return kinetic / 2 - mass * (bodies["position"] @ gravity)  # mutate: energy_that_leaves

    def energy_up_to(self, steps: np.ndarray) -> np.ndarray:
        """Energy [J] that has left by each of these steps."""
        order = np.argsort(self.step, kind="stable")
        total = np.concatenate([[0.0], np.cumsum(self.energy[order])])
        return total[np.searchsorted(self.step[order], steps, side="right")]

    def saved(self) -> dict[str, np.ndarray]:
        """For a restart file."""
        found = {"left_step": self.step, "left_exit": self.exit, "left_energy": self.energy}
        return {**found, "left_place": self._place} if len(self._place) else found

    def load(self, saved: dict[str, np.ndarray]) -> None:
        """Take over what `saved` gave."""
        for name, array in self.saved().items():
            array[:] = saved[name]
        self._count = int((self.exit >= 0).sum())

    def places(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows of the scene that have left, and where they were then [m]; where flow is counted."""
        rows = np.flatnonzero(self.exit >= 0)
        return rows, self._place[rows]

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
        """How many have left: asked for in every step, so counted, not summed."""
        return self._count

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
