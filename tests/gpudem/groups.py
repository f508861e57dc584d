"""Scenes with frozen particles."""

from typing import Any

import numpy as np

from gpudem.scene import Scene
from tests.gpudem.beds import PAIRS, falling_bed

RADII = (0.003, 0.0025)


def base(count: int = 300, frozen_radius: float = 0.003) -> dict[str, Any]:
    """Explicit particles of `falling_bed`: a frozen layer of material `wall`, whose balls overlap, first."""
    bed = falling_bed(count)
    x, y = np.meshgrid(np.arange(0.003, 0.1, 0.005), np.arange(0.003, 0.05, 0.005))
    rng = np.random.default_rng(1)
    layer = np.stack([x.ravel(), y.ravel(), 0.002 + 0.002 * rng.random(x.size)], axis=1)
    raised = bed.state.position + np.array((0, 0, 0.01))
    none = np.zeros_like(layer)
    return {
        "source": "explicit", "position": np.concatenate([layer, raised]),
        "velocity": np.concatenate([none, bed.state.velocity]),
        "radius": np.concatenate([np.full(len(layer), frozen_radius), RADII[1] + 0 * bed.state.radius]),
        "material": ["wall"] * len(layer) + ["ball"] * len(raised),
    }  # fmt: skip


def on_base(count: int = 300, **changes: Any) -> Scene:
    """Balls fall on a rough base of frozen balls that reach into the floor; the gate goes at 30 ms."""
    data: dict[str, Any] = {
        "particles": base(count), "groups": [{"name": "base", "material": "wall", "frozen": True}],
        "pairs": [*PAIRS, {**PAIRS[0], "materials": ("wall", "wall")}], **changes,
    }  # fmt: skip
    return falling_bed(count, **data)
