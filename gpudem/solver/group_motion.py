"""Puts groups with a motion where they are, launch by launch."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from gpudem.scene import Scene
from gpudem.scene.groups import paths

#: Arrays of a struct `Particles` with a row for each launch, of `Poses`: name -> its field there.
TABLES = {f"group_{name}": name for name in ("rotation", "shift", "velocity", "spin", "center")}


def group_tables(wide: Any) -> dict[str, Any]:
    """Name -> type of the elements of each of TABLES."""
    matrix, vector = wp.types.matrix((3, 3), wide), wp.types.vector(3, wide)
    return {name: matrix if field == "rotation" else vector for name, field in TABLES.items()}


class GroupMotion:
    """The groups with a motion of a scene; the particles of each are one rigid body."""

    def __init__(self, scene: Scene, particles: Any, chunk: int):
        self.paths, self.particles, self.chunk = paths(scene), particles, chunk

    def assign(self, step: int) -> None:
        """Write the poses after each of the launches from `step` on: a launch ends in the next step."""
        if not self.paths:
            return
        first = step + 1  # mutate: step_of_group
        poses = [path.at(first, self.chunk) for path in self.paths]
        for name, field in TABLES.items():
            values = np.stack([getattr(pose, field) for pose in poses], axis=1)
            array = getattr(self.particles, name)
            if array.device.is_cpu:
                array.numpy()[:] = values
            else:
                array.assign(values)
