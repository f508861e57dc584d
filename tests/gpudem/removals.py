"""Scenes from which particles leave."""

from typing import Any

from gpudem.scene import Scene
from tests.gpudem.insertions import filling

SIDES = ["xlo", "ylo", "yhi", "zlo", "zhi"]


def draining(count: int = 600, **changes: Any) -> Scene:
    """The bed of `filling` on a slope: from 4 ms on, when its gate goes, it runs out through an open side."""
    walls: list[dict[str, Any]] = [
        {"kind": "box", "name": "box", "material": "wall", "lo": (0, 0, 0), "hi": (0.2, 0.05, 0.4),
         "sides": SIDES},
        {"kind": "plane", "name": "gate", "material": "wall", "point": (0.1, 0, 0), "normal": (-1, 0, 0),
         "removed_at": 0.004},
    ]  # fmt: skip
    domain = {"lo": (-0.001, -0.001, -0.001), "hi": (0.101, 0.051, 0.401), "sides": {"xhi": "outflow"}}
    return filling(count, **{"walls": walls, "domain": domain, "gravity": (20.0, 0, -9.0), **changes})
