"""Files with a line a step: loads of walls and groups of which each step is wanted, for their work."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from gpudem.scene import Scene
from reference.liggghts.errors import LiggghtsOutputError


@dataclasses.dataclass(frozen=True)
class Written:
    """A wall or group of which each step's load is written to a file, a line a step."""

    name: str
    ways: tuple[str, ...]
    """Of a wall with a servo: formulas of the way of its torque point from the start [m]."""
    columns: tuple[str, ...]
    """Words of its load."""


def lines(scene: Scene, folder: Path, name: str) -> np.ndarray:
    """The file of a wall or group, with zeros for the set-up: shape (steps + 1, columns).

    Raises LiggghtsOutputError.
    """
    path, steps = folder / f"load_{name}.txt", np.arange(1, scene.n_steps + 1)
    try:
        table = np.loadtxt(path, ndmin=2)
    except (OSError, ValueError) as error:
        raise LiggghtsOutputError(f"{path}: {error}") from None
    if table.size == 0 or not np.array_equal(table[:, 0], steps) or not np.isfinite(table).all():
        raise LiggghtsOutputError(f"{path}: not a line of numbers for each of the steps 1 to {steps[-1]}")
    return np.concatenate([np.zeros((1, table.shape[1] - 1)), table[:, 1:]])
