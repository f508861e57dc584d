"""Small beds for tests of the solver, with enough particles for cells, rebuilds and slices to matter."""

from typing import Any

import numpy as np

from gpudem.scene import Scene
from gpudem.solver.solver import Solver

MATERIALS = {
    "ball": {"young": 5e6, "poisson": 0.34, "density": 1768.0},
    "wall": {"young": 5e6, "poisson": 0.37, "density": 1185.0},
}
PAIRS = [
    {"materials": ("ball", "ball"), "restitution": 0.8, "friction": 0.4},
    {"materials": ("ball", "wall"), "restitution": 0.7, "friction": 0.3},
]


def falling_bed(count: int = 2500, **changes: Any) -> Scene:
    """Balls fall into a box with a gate in its middle, which goes at 30 ms."""
    data: dict[str, Any] = {
        "name": "falling_bed",
        "materials": MATERIALS,
        "pairs": PAIRS,
        "particles": {
            "source": "lattice", "material": "ball", "count": count, "radius": 0.003, "seed": 1,
            "lo": (0, 0, 0), "hi": (0.1, 0.05, 0.4), "velocity_rms": 0.2,
        },
        "gravity": (0, 0, -9.81),
        "walls": [
            {"kind": "box", "name": "box", "material": "wall", "lo": (0, 0, 0), "hi": (0.2, 0.05, 0.4)},
            {"kind": "plane", "name": "gate", "material": "wall", "point": (0.1, 0, 0), "normal": (-1, 0, 0),
             "removed_at": 0.03},
        ],
        "domain": {"lo": (-0.001, -0.001, -0.001), "hi": (0.201, 0.051, 0.401)},
        "time": {"step": 2e-5, "duration": 0.04},
    }  # fmt: skip
    return Scene(**{**data, **changes})


def gas(**changes: Any) -> Scene:
    """A frictionless elastic gas of several radii in a periodic box."""
    data: dict[str, Any] = {
        "name": "gas",
        "materials": {"ball": {"young": 5e8, "poisson": 0.3, "density": 2500.0}},
        "pairs": [{"materials": ("ball", "ball"), "restitution": 1.0, "friction": 0.0}],
        "particles": {
            "source": "lattice", "material": "ball", "count": 120, "seed": 2,
            "radius": [{"radius": 0.003, "share": 0.5}, {"radius": 0.0015, "share": 0.5}],
            "lo": (0, 0, 0), "hi": (0.05, 0.05, 0.05), "velocity_rms": 0.5,
        },
        "domain": {"lo": (0, 0, 0), "hi": (0.05, 0.05, 0.05), "periodic": (True, True, True)},
        "time": {"step": 2e-6, "duration": 0.02},
    }  # fmt: skip
    return Scene(**{**data, **changes})


def finish(simulation: Solver) -> dict[str, np.ndarray]:
    """The last frame of a simulation, run through all its segments."""
    for first, last, planes in simulation.scene.segments:
        simulation.start(planes, write=first == 0)
        simulation.advance(last - first - 1)
        simulation.write_step(last=True)
    simulation.close()
    return simulation.frame()


def same(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> None:
    """Asserts the same bits in every column."""
    for column in one:
        assert np.array_equal(one[column], other[column]), column
