"""Scenes from which particles leave."""

from typing import Any

from gpudem.scene import Scene
from tests.gpudem.beds import MATERIALS, PAIRS
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


def conveyor(**changes: Any) -> Scene:
    """Three balls of a group move out through xhi one after the other; of two free ones the first falls on
    them and is carried out, the second falls beside them.
    """
    data: dict[str, Any] = {
        "name": "conveyor", "materials": {"ball": MATERIALS["ball"]},
        "pairs": [{**PAIRS[0], "friction": 0.5}],
        "particles": {"source": "explicit", "material": "ball", "radius": 0.01,
                      "position": [(0.269, 0, 0), (0.25, 0, 0), (0.231, 0, 0), (0.24, 0, 0.0185),
                                   (0.1, 0, 0.1)],
                      "velocity": [(0, 0, 0)] * 3 + [(1.0, 0, 0), (0, 0, 0)]},
        "groups": [{"name": "belt", "ids": [1, 2, 3], "reference": (0.1, 0, 0.05),
                    "motion": [{"type": "linear", "velocity": (1.0, 0, -0.1)}]}],
        "gravity": (0, 0, -9.81),
        "domain": {"lo": (-0.5, -0.5, -0.5), "hi": (0.3, 0.5, 0.5), "sides": {"xhi": "outflow"}},
        "time": {"step": 2e-5, "duration": 0.08},
        "output": {"trace_every": 2e-5, "history_every": 2e-5, "group_forces": ["belt"],
                   "history": ["particles", "kinetic_energy", "potential_energy"]},
    }  # fmt: skip
    return Scene(**{**data, **changes})
