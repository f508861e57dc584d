"""Walls where they are at a time of a run, for what looks at its output: contacts, overlaps, energies."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from gpudem.scene.walls import Wall

if TYPE_CHECKING:
    from gpudem.scene.model import Scene


@dataclasses.dataclass(frozen=True)
class Placed:
    """A wall where its motions have moved it."""

    wall: Wall
    rotation: np.ndarray
    """Shape (3, 3)."""
    shift: np.ndarray
    """[m], shape (3,)."""

    @property
    def name(self) -> str:
        """Of the wall."""
        return self.wall.name

    @property
    def normal(self) -> np.ndarray | None:
        """Of a plane; None of other walls."""
        own = normal_of(self.wall)
        return None if own is None else self.rotation @ own

    @property
    def material(self) -> str:
        """Of the wall."""
        return self.wall.material

    def gap(self, points: np.ndarray) -> np.ndarray:
        """Distance [m] of points, (n, 3), from its surface."""
        return self.wall.gap((points - self.shift) @ self.rotation)

    def overlap(self, points: np.ndarray, radius: np.ndarray) -> np.ndarray:
        """Overlap [m] of spheres with it (`Wall.overlap`)."""
        return self.wall.overlap((points - self.shift) @ self.rotation, radius)


def normal_of(wall: Wall | Placed) -> np.ndarray | None:
    """The normal of a plane; None of other walls, which have none of their own."""
    if isinstance(wall, Placed):
        return wall.normal
    return np.array(wall.shape()[0]) if wall.kind == "plane" else None


#: A wall at its place at the start, or where it has moved.
Surface: TypeAlias = Wall | Placed


def walls_at(scene: Scene, time: float, servo_ways: Mapping[str, np.ndarray] | None = None) -> list[Surface]:
    """Elementary walls present at a time [s], where they are then, of the material that they have then.

    Left out: planes that move by `vibration`, and from the start of its first servo on a wall of which
    `servo_ways` does not say how far servos have moved it beyond its stated motions [m], (3,).
    """
    step = round(time / scene.time.step)
    found: list[Surface] = []
    materials = [wall.material for wall in scene.phase_after(step - 1).wall_elements]
    for stated, material in zip(scene.wall_elements, materials, strict=True):
        same = stated.material == material
        wall = stated if same else stated.model_copy(update={"material": material})
        if not scene.is_present(wall, step) or wall.speed > 0:
            continue
        if wall.name not in scene.wall_paths:
            found.append(wall)
            continue
        way = (servo_ways or {}).get(wall.name)
        if way is None and any(begin < step for begin, _ in scene.servos.get(wall.name, ())):
            continue
        pose = scene.wall_paths[wall.name].at(step, 1)
        found.append(Placed(wall, pose.rotation[0], pose.shift[0] + (0.0 if way is None else way)))
    return found
