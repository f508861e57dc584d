"""A bed of particles from a scene: run until it has settled, or to its end, and kept as a file of particles.

A bed has settled when the mean energy of a particle, translation and rotation, has stayed below that of a
fall of a stated fraction of the mean radius,

    E/n <= fraction m g R,  m and R means over the n particles,

at CHECKS times over a span of HOLD sqrt(2 R/g): twice the time of a fall through the radius, so that the
turning point of a bounce is not taken for rest. It cannot settle before the last insertion, nor before the
last phase has started, whose gravity counts.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gpudem.errors import GpudemError
from gpudem.output.atomic import write_npz
from gpudem.simulation import Simulation

if TYPE_CHECKING:
    from gpudem.scene import Scene

#: Default of `fraction` [radii].
FRACTION = 1e-3
#: Span over which the energy must stay low [sqrt(2 R/g)], and checks within it.
HOLD, CHECKS = 2.0, 8


@dataclasses.dataclass(frozen=True)
class Bed:
    """Particles at the end of a run, by id."""

    position: np.ndarray
    """Centers [m], shape (n, 3)."""
    velocity: np.ndarray
    """Velocities [m/s], shape (n, 3)."""
    angular_velocity: np.ndarray
    """Angular velocities [rad/s], shape (n, 3)."""
    radius: np.ndarray
    """Radii [m], shape (n,)."""
    material: np.ndarray
    """Names of materials, shape (n,)."""
    time: float
    """When it ended [s]."""
    settled: bool
    """Whether the criterion holds."""
    energy: float
    """Mean energy of a particle at the end / (m g R), in fractions of a radius [1]; NaN without gravity."""

    def write(self, path: Path) -> None:
        """Write a .npz file that `[particles] path` reads. Raises GpudemError: another suffix; WriteError."""
        if path.suffix != ".npz":
            raise GpudemError(f"{path}: a bed is written as .npz, which particles.path reads")
        names = ("position", "velocity", "angular_velocity", "radius", "material")
        write_npz(path, {name: getattr(self, name) for name in names})


def make(
    scene: Scene, *, until_settled: bool = True, fraction: float = FRACTION, device: str = "cpu",
    threads: int | None = None, progress: Callable[[int], None] = lambda step: None,
) -> Bed:  # fmt: skip
    """Run a scene until its particles have settled, at most for its duration; its output is not used.

    Args:
        scene: What to run.
        until_settled: False: to the end.
        fraction: Of the mean radius [1]; see the module.
        device: Warp device.
        threads: CPU threads.
        progress: Told each step reached.

    Raises:
        GpudemError: no gravity or no particles to settle.
        SimulationError: a run that cannot go on.
    """
    gravity, state = scene.phase_scenes[-1].gravity, scene.state
    pull = math.hypot(*gravity)
    if until_settled and pull == 0:
        raise GpudemError(f"gravity = {gravity}: without gravity nothing settles; run to the end instead")
    radius = float(state.radius.mean())
    span = HOLD * math.sqrt(2 * radius / pull) if pull else scene.time.duration
    stride = max(1, round(span / CHECKS / scene.time.step))
    changes = [*scene.insertion_steps, *scene.phase_steps]
    last = max([0, *(step for step in changes if step <= scene.n_steps)])
    low, energy = 0, math.nan
    with Simulation(scene, device, threads) as simulation:
        while simulation.step_count < scene.n_steps:
            simulation.step(min(stride, scene.n_steps - simulation.step_count))
            progress(simulation.step_count)
            energy = _energy(simulation, pull)
            resting = energy <= fraction and simulation.step_count > last
            low = low + 1 if resting else 0  # mutate: rest_that_lasts
            if until_settled and low > CHECKS:
                break
        return _bed(simulation, low > CHECKS, energy)


def _energy(simulation: Simulation, pull: float) -> float:
    """Mean energy of the particles / (m g R); NaN without particles or gravity."""
    mass, radius = simulation.read("mass").numpy(), simulation.read("radius").numpy()
    if not len(mass) or pull == 0:
        return math.nan
    total = simulation.observe("kinetic_energy") + simulation.observe("rotational_energy")
    return total / (float(mass.sum()) * pull * float(radius.mean()))


def _bed(simulation: Simulation, settled: bool, energy: float) -> Bed:
    """The particles of the present step. Raises GpudemError: none."""
    names = list(simulation.scene.materials)
    columns = {
        name: np.asarray(simulation.read(name).numpy(), np.float64)
        for name in ("position", "velocity", "angular_velocity", "radius")
    }
    if not len(columns["radius"]):
        raise GpudemError(f"no particles at {simulation.time:g} s, the end of the run")
    material = np.array([names[int(k)] for k in simulation.read("material").numpy()])
    return Bed(**columns, material=material, time=simulation.time, settled=settled, energy=energy)
