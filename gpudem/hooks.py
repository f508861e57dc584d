"""Functions of the user that a run calls while it advances.

gpudem.simulate(scene, "runs/x", hooks=[gpudem.every(0.01, lambda sim: print(sim.step_count))])
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

from gpudem.errors import GpudemError
from gpudem.scene import Scene


@dataclasses.dataclass(frozen=True)
class Hook:
    """An action at t = 0 and after every interval, rounded to whole steps (at least one).

    It is called with the run's `gpudem.Simulation`, at a full step; reading it does not change the run. After
    `resume` it is called at the steps after that of the restart file. What it raises ends the run, whose
    results so far are saved.
    """

    interval: float
    """[s]"""
    action: Callable[[Any], object]

    def __post_init__(self) -> None:
        if not (math.isfinite(self.interval) and self.interval > 0):
            raise GpudemError(f"every({self.interval!r}, ...): the interval must be a finite number > 0 [s]")
        if not callable(self.action):
            raise GpudemError(f"every({self.interval:g}, {self.action!r}): not a function")

    def stride(self, scene: Scene) -> int:
        """Steps between calls."""
        return max(1, scene.steps(self.interval))

    def warnings(self, scene: Scene) -> list[str]:
        """That the interval is no whole number of steps, if so."""
        actual = self.stride(scene) * scene.time.step
        if math.isclose(actual, self.interval, rel_tol=1e-6):
            return []
        return [f"hook every {self.interval:g} s: rounded to whole steps, called every {actual:g} s"]


def every(interval: float, action: Callable[[Any], object]) -> Hook:
    """A hook that calls `action(simulation)` every `interval` [s]. Raises GpudemError: not a time > 0."""
    return Hook(interval, action)
