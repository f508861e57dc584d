"""gpudem: a discrete element solver on NVIDIA Warp, built to be verified.

    import gpudem

    scene = gpudem.Scene.from_toml("examples/drop.toml")
    run = gpudem.simulate(scene, "runs/drop")

Importing it is light: Warp, pandas and VTK are imported when first needed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpudem._version import __version__
from gpudem.errors import GpudemError, SceneError, SimulationError
from gpudem.output.run import Run
from gpudem.scene import Scene

if TYPE_CHECKING:
    from gpudem.driver import resume, simulate

__all__ = [
    "GpudemError", "Run", "Scene", "SceneError", "SimulationError", "__version__", "resume", "simulate",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name in ("resume", "simulate"):  # need Warp
        from gpudem import driver

        return driver.resume if name == "resume" else driver.simulate
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
