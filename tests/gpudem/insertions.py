"""Scenes in which particles are inserted."""

from typing import Any

import numpy as np

from gpudem.scene import Scene
from tests.gpudem.beds import falling_bed


def rain(events: int = 10, every: float = 3e-3, **columns: Any) -> dict[str, Any]:
    """Every so often [s] a layer of 40 balls of two radii, high up in the box of `falling_bed`."""
    x, y = np.meshgrid(np.linspace(0.01, 0.09, 8), np.linspace(0.01, 0.04, 5))
    layer = np.stack([x.ravel(), y.ravel(), np.full(x.size, 0.3)], axis=1)
    count = events * len(layer)
    return {
        "kind": "list", "time": np.repeat(0.002 + every * np.arange(events), len(layer)),
        "position": np.tile(layer, (events, 1)), "material": "ball",
        "radius": np.where(np.arange(count) % 3, 0.003, 0.0025),
        "velocity": np.tile((0.3, 0.0, -3.0), (count, 1)),
        "angular_velocity": np.tile((0.0, 20.0, 5.0), (count, 1)), **columns,
    }  # fmt: skip


def filling(count: int = 600, **changes: Any) -> Scene:
    """A bed onto which ten layers fall; the gate goes while they do."""
    data: dict[str, Any] = {"insert": [rain()], "time": {"step": 2e-5, "duration": 0.04}, **changes}
    return falling_bed(count, **data)
