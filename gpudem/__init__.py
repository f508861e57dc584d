"""Discrete element method (DEM) solver on NVIDIA Warp for CPUs and CUDA devices, built for verification.

    import gpudem

    scene = gpudem.Scene.from_toml("examples/drop.toml")
    run = gpudem.simulate(scene, "runs/drop")
    print(run.history.kinetic_energy.max())  # [J]

    with gpudem.Simulation(scene) as sim:    # stepped by hand
        sim.run_until(0.1)
        print(sim.read("position").numpy())

The same scene as hard spheres: `gpudem.event_driven.run(scene)`. Warp, pandas and meshio are imported when
first needed, not with the package.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from gpudem._version import __version__
from gpudem.errors import GpudemError, SceneError, SimulationError
from gpudem.hooks import Hook, every
from gpudem.output.run import Run
from gpudem.scene import Scene

if TYPE_CHECKING:
    from gpudem.driver import resume, simulate
    from gpudem.simulation import Simulation

__all__ = [
    "GpudemError",
    "Hook",
    "Run",
    "Scene",
    "SceneError",
    "Simulation",
    "SimulationError",
    "__version__",
    "every",
    "resume",
    "simulate",
]

#: Names that need Warp, and their modules.
_LAZY = {"Simulation": "simulation", "resume": "driver", "simulate": "driver"}


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        return getattr(importlib.import_module(f"gpudem.{_LAZY[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
