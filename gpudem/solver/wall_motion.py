"""Puts moving walls where they are, launch by launch, and says when the list no longer reaches them."""

from __future__ import annotations

from typing import Any

import numpy as np

from gpudem.scene import Scene
from gpudem.walls.motion import Poses, WallPath


class WallMotion:
    """The walls with motions of a scene; a saw-tooth has none.

    The list holds for as long as particle and wall have come no nearer than the skin: half of it is the
    particles', half the walls'.
    """

    def __init__(self, scene: Scene, chunk: int):
        self.scene, self.chunk = scene, chunk
        dt, sums = scene.time.step, scene.contact.mesh_contacts == "liggghts"
        self.paths = {
            w: WallPath(wall.motion, dt, sums) for w, wall in enumerate(scene.wall_elements) if wall.motion
        }
        self._bounds = {w: self._corners(w) for w in self.paths}
        self._at_rebuild: dict[int, np.ndarray] = {}

    def __bool__(self) -> bool:
        return bool(self.paths)

    def _corners(self, w: int) -> np.ndarray:
        """Corners of a box around the wall at the start, or around the domain for one without ends [m]."""
        wall = self.scene.wall_elements[w]
        points = getattr(wall, "corners", None)
        ends = (self.scene.domain.lo, self.scene.domain.hi)
        lo, hi = ends if points is None else (points.min(axis=(0, 1)), points.max(axis=(0, 1)))
        return np.array([[(lo, hi)[i >> k & 1][k] for k in range(3)] for i in range(8)], float)

    def tables(self, step: int) -> dict[str, np.ndarray]:
        """The tables of poses for launches that begin with `step`: rotation, displacement, velocity, ..."""
        m, chunk = len(self.scene.wall_elements), self.chunk
        found = {
            "rotation": np.tile(np.eye(3), (chunk, m, 1, 1)),
            **{name: np.zeros((chunk, m, 3)) for name in ("displacement", "velocity", "spin", "center")},
        }
        for w, path in self.paths.items():
            poses = path.at(step, chunk)
            for name in found:
                found[name][:, w] = getattr(poses, "shift" if name == "displacement" else name)
        return found

    def rebuilt(self, step: int) -> None:
        """The list was made for the places of `step`."""
        self._at_rebuild = {w: self._places(w, path.at(step, 1))[0] for w, path in self.paths.items()}

    def steps_within(self, step: int, count: int) -> int:
        """In how many of the next `count` steps, from `step` on, the list reaches the walls; 0: none."""
        allowed, limit = count, self.scene.skin / 2
        for w, path in self.paths.items():
            if w not in self._at_rebuild:
                return 0
            places = self._places(w, path.at(step, count))
            way = np.linalg.norm(places - self._at_rebuild[w], axis=2).max(axis=1)
            beyond = np.flatnonzero(way > limit)
            allowed = min(allowed, int(beyond[0]) if len(beyond) else count)
        return allowed

    def _places(self, w: int, poses: Poses) -> np.ndarray:
        """Where the corners of the box are: shape (k, 8, 3) [m]."""
        return np.einsum("kij,pj->kpi", poses.rotation, self._bounds[w]) + poses.shift[:, None]

    def assign(self, walls: Any, step: int) -> None:
        """Write the tables of a struct `Walls`."""
        for name, values in self.tables(step).items():
            array = getattr(walls, name)
            array.assign(values.reshape(-1, *values.shape[2:]))
