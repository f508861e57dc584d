"""Puts moving walls where they are, launch by launch, and says when the list no longer reaches them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from gpudem.scene import Scene, wall_phases
from gpudem.scene.removal import search_box
from gpudem.scene.walls import Wall
from gpudem.walls.motion import BLOCK, PhasedPath, ServoPath, WallPath

#: Tables of a struct `Walls` with a row for each wall in each launch.
TABLES = ("rotation", "displacement", "velocity", "spin", "center")


#: Steps for which reach is determined at once; a divisor of BLOCK.
AHEAD = 32


class WallMotion:
    """The walls with motions of a scene, and how long a list holds.

    A list holds for as long as particle and wall have come no nearer than the skin: half of it is the
    particles', half the walls'.

    Args:
        chunk: Launches between two looks by the host, each with rows of its own in the tables.
    """

    def __init__(self, scene: Scene, chunk: int):
        self.scene, self.chunk = scene, chunk
        following = self._following()
        self.servos = {
            w: [(0, math.inf, path)] if isinstance(path, ServoPath) else path.servos
            for w, path in following.items()
        }
        """Of these walls only the next step's place is known: the steps at which each of their servos begins
        and ends, and its path.
        """
        self.paths: dict[int, WallPath | PhasedPath | ServoPath] = {
            w: following.get(w) or scene.wall_paths[wall.name]
            for w, wall in enumerate(scene.wall_elements) if wall.name in scene.wall_paths
        }  # fmt: skip
        self._turns = {
            name: [[motion.turns for motion in motions] for _, motions in parts]
            for name, parts in wall_phases.motions(scene).items()
        }
        self.list_step: int | None = None
        """The step for whose places the list was made."""
        self._present = set(self.paths)
        self._reached, self._beyond = 0, False
        self._corners = search_box(scene)
        self._at_list: dict[int, np.ndarray] = {}
        self._known_marks: dict[tuple[int, int], np.ndarray] = {}
        self._limit = scene.skin / 2  # mutate: share_of_skin
        self._sure = 0
        self._rows = chunk if self.servos else max(BLOCK, chunk)
        self._begin = -self._rows
        self._tables_ahead: dict[str, np.ndarray] = {}
        self._views: dict[str, np.ndarray] = {}
        self._walls: Any = None

    def __bool__(self) -> bool:
        return bool(self.paths)

    def _following(self) -> dict[int, PhasedPath | ServoPath]:
        """Paths of the walls that follow a force at some time."""
        scene, dt, found = self.scene, self.scene.time.step, {}
        liggghts = bool(scene.meshes) and scene.contact.mesh_contacts == "liggghts"
        parts = wall_phases.motions(scene)
        for w, wall in enumerate(scene.wall_elements):
            if wall.name not in scene.servos:
                continue
            if len(parts[wall.name]) == 1:
                found[w] = ServoPath(scene.servos[wall.name][0][1], dt, liggghts)
            else:
                found[w] = PhasedPath(parts[wall.name], dt, liggghts, follow=True)
        return found

    # -- servos --------------------------------------------------------------------------------------------

    def follows(self, step: int) -> bool:
        """Whether a servo of any wall needs the force of this step."""
        return any(begin < step < end for parts in self.servos.values() for begin, end, _ in parts)

    def _servo_paths(self) -> list[ServoPath]:
        return [path for parts in self.servos.values() for *_, path in parts]

    def follow(self, step: int, force: np.ndarray) -> None:
        """Step `step` is done with these forces on the walls [N], (m, 3)."""
        for w, parts in self.servos.items():
            for begin, end, path in parts:
                if begin < step < end:  # mutate: steps_of_servo
                    path.advance(step, force[w])

    def servo_states(self) -> np.ndarray:
        """What a restart needs of each servo, a row each."""
        return np.array([[*path.state, *path.listed] for path in self._servo_paths()])

    def load_servo_states(self, rows: np.ndarray) -> None:
        """Take over what `servo_states` gave."""
        for path, row in zip(self._servo_paths(), rows, strict=True):
            path.state[:], path.listed[:] = row[:-2], row[-2:]  # mutate: restart_servo

    def attach(self, walls: Any, present: list[Wall]) -> None:
        """Write into this struct `Walls` from now on; of the others no list need know. A new list follows."""
        if not self.paths:
            return
        names = {wall.name for wall in present}
        self._present = {w for w in self.paths if self.scene.wall_elements[w].name in names}
        self._walls, self.list_step = walls, None
        self._sure = min((self._sure_steps(w) for w in self._present), default=AHEAD)
        self._views = {}
        if walls.rotation.device.is_cpu:
            arrays = {name: getattr(walls, name).numpy() for name in TABLES}
            rows = (self.chunk, len(self.scene.wall_elements))
            self._views = {name: values.reshape(*rows, *values.shape[1:]) for name, values in arrays.items()}

    # -- places --------------------------------------------------------------------------------------------

    def assign(self, step: int, in_set_up: bool = False) -> None:
        """Write the places for launches that begin with `step`, which may be a set-up."""
        k = step - self._begin
        if self.servos or in_set_up or not 0 <= k <= self._rows - self.chunk:
            self._begin, k = step, 0
            self._tables_ahead = self._tables(step, self._rows)
            if in_set_up:
                self._set_up(step)
        if self._views:
            for name, view in self._views.items():
                view[:] = self._tables_ahead[name][k : k + self.chunk]
            return
        for name, values in self._tables_ahead.items():
            rows = values[k : k + self.chunk]
            getattr(self._walls, name).assign(rows.reshape(-1, *rows.shape[2:]))

    def _tables(self, first: int, count: int) -> dict[str, np.ndarray]:
        """The tables of poses in so many steps: shapes (count, m, 3, 3) and (count, m, 3)."""
        walls = self.scene.wall_elements
        found: dict[str, np.ndarray] = {name: np.zeros((count, len(walls), 3)) for name in TABLES}
        found["rotation"] = np.zeros((count, len(walls), 3, 3))
        found["rotation"][:] = np.eye(3)
        for w, wall in enumerate(walls):
            if w in self.paths:
                poses = self.paths[w].at(first, count)
                for name in TABLES:
                    found[name][:, w] = poses.shift if name == "displacement" else getattr(poses, name)
            elif wall.speed > 0:
                times = np.arange(first, first + count) * self.scene.time.step
                found["displacement"][:, w] = [wall.displacement(time) for time in times.tolist()]
                found["velocity"][:, w] = wall.velocity  # mutate: saw_tooth_beside_motion
        return found

    def _set_up(self, step: int) -> None:
        """In the first row the velocities with which motions of a phase begin."""
        for w, path in self.paths.items():
            if isinstance(path, PhasedPath):
                pose = path.in_set_up(step)
                for name in ("velocity", "spin", "center"):  # mutate: velocity_in_set_up_of_phase
                    self._tables_ahead[name][0, w] = getattr(pose, name)[0]

    def carried(self, points: np.ndarray, step: int) -> np.ndarray:
        """Where points that move with the walls, one each, are in a step: shape (m, 3) [m]."""
        found = points.astype(float)
        for w, path in self.paths.items():
            poses = path.at(step, 1)
            found[w] = poses.rotation[0] @ points[w] + poses.shift[0]  # mutate: torque_point_moves
        return found

    # -- how long a list holds -----------------------------------------------------------------------------

    def list_made(self, step: int) -> None:
        """A list was made for the places of `step`."""
        self.list_step, self._reached, self._beyond = step, step + self._sure, False
        for path in self._servo_paths():
            path.list_made(step)
        self._at_list = self._marks_of_all(step) if self.servos else {}

    def steps_within(self, step: int, count: int) -> int:
        """In how many of the next `count` steps, from `step` on, the list reaches the walls; 0: none."""
        if self.list_step is None:
            return 0
        while self._reached < step + count and not self._beyond:
            self._at_list = self._at_list or self._marks_of_all(self.list_step)
            ahead = 1 if self.servos else AHEAD - self._reached % AHEAD
            within = self._first_beyond(self._at_list, self._reached, ahead)
            self._reached, self._beyond = self._reached + within, within < ahead
        return max(0, min(count, self._reached - step))

    def _sure_steps(self, w: int) -> int:
        """Steps in which the wall cannot leave the reach of a list, by the bound of its speed.

        0 where a translation carries a turn along, for that bound is for the stated run, which may be
        exceeded; and beside a servo, of which only the next place is known.
        """
        parts = self._turns[self.scene.wall_elements[w].name]
        carried = any(turn and not all(turns[:m]) for turns in parts for m, turn in enumerate(turns))
        way = self.scene.wall_speeds[w] * self.scene.time.step
        if carried or self.servos:
            return 0
        return AHEAD if way * AHEAD < self._limit else int(0.99 * self._limit / way)

    def _marks_of_all(self, step: int) -> dict[int, np.ndarray]:
        return {w: self._marks(w, step, 1)[0] for w in self._present}

    def _first_beyond(self, made: dict[int, np.ndarray], first: int, count: int) -> int:
        """How many steps from `first` on all walls are within reach of a list made at these marks."""
        for w, before in made.items():
            if count == 0:
                break
            way = self.scene.wall_elements[w].moved(self._marks(w, first, count), before)
            if way.max() > self._limit:
                count = int(np.argmax(way > self._limit))
        return count

    def _marks(self, w: int, first: int, count: int) -> np.ndarray:
        """The marks of a wall in so many steps, computed block by block."""
        if w in self.servos:
            poses = self.paths[w].at(first, count)
            return self.scene.wall_elements[w].marks(poses.rotation, poses.shift, *self._corners)
        found, end = [], first + count
        for b in range(first // BLOCK, (end - 1) // BLOCK + 1):
            if (w, b) not in self._known_marks:
                poses = self.paths[w].at(b * BLOCK, BLOCK)
                wall, lo, hi = self.scene.wall_elements[w], *self._corners
                self._known_marks[w, b] = wall.marks(poses.rotation, poses.shift, lo, hi)
                for old in [key for key in self._known_marks if key[0] == w][:-2]:
                    del self._known_marks[old]
            found.append(self._known_marks[w, b][max(0, first - b * BLOCK) : end - b * BLOCK])
        return found[0] if len(found) == 1 else np.concatenate(found)
