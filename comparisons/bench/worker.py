"""One gpudem measurement in a process of its own, so that its memory and its start-up are its own.

`python -m comparisons.bench.worker BED PARTICLES STEPS THREADS DEVICE PRECISION STARTED` prints a `Measured`
as JSON; STARTED is `time.time()` at the start of the process.
"""

from __future__ import annotations

import dataclasses
import json
import sys
import time

import numpy as np
import warp as wp

from comparisons.bench.beds import SKIN
from comparisons.bench.drum import timed_scene
from comparisons.bench.insertion import step_through
from gpudem.solver.list_layout import packed
from gpudem.solver.memory import bytes_by_purpose
from gpudem.solver.solver import Solver


@dataclasses.dataclass(frozen=True)
class Measured:
    """What one run of a bed took."""

    device: str
    stepping_s: float
    particle_steps: float
    """Done in that time."""
    compile_s: float
    first_step_s: float
    """From the start of the process to the end of the first step."""
    insertion_s: float | None
    """Of stepping_s: insertion; None where nothing is inserted."""
    rebuilds: int
    contacts: float
    """A particle."""
    array_bytes: float
    """On the device, a particle."""
    memory: dict[str, float]
    """The same by purpose."""
    moved_bytes: float
    """That a step must read or write at least, a particle."""
    peak_memory_bytes: int


def measure(
    bed: str, particles: int, steps: int, threads: int, device: str, precision: str, started: float
) -> Measured:
    """Runs the bed without output."""
    from gpudem.process import peak_memory

    scene = timed_scene(bed, particles, steps, solver={"skin": SKIN, "precision": precision})
    simulation = Solver(scene, device, threads)
    simulation.start()
    simulation.advance(1)
    wp.synchronize_device(simulation.device)
    first_step_s = time.time() - started
    rebuilds, done = simulation.neighbors.rebuilds, simulation.departures.mean_count(1)
    stepping_s, insertion_s = step_through(simulation, steps - 1)
    rebuilds = simulation.neighbors.rebuilds - rebuilds
    memory = bytes_by_purpose(simulation.memory_bytes(), particles)
    moved = moved_bytes(simulation)
    simulation.write_step(last=True)
    return Measured(
        device=str(simulation.device), stepping_s=stepping_s,
        particle_steps=simulation.departures.mean_count(steps) * steps - done,
        insertion_s=insertion_s if scene.insert else None, compile_s=simulation.compile_s,
        first_step_s=first_step_s, rebuilds=rebuilds, contacts=simulation.contact_count() / particles,
        array_bytes=sum(memory.values()), memory=memory, moved_bytes=moved, peak_memory_bytes=peak_memory(),
    )  # fmt: skip


def moved_bytes(simulation: Solver) -> float:
    """Bytes a particle that a step reads or writes at least: springs of touching pairs alone, all else once.

    What a cache cannot spare once the arrays outgrow it; without the rebuild, and without the lines that the
    processor reads only to overwrite them.
    """
    n, memory = simulation.state.n, simulation.memory_bytes()
    entries = packed(simulation.state)["neighbor"]

    def each(*prefixes: str) -> float:
        return sum(size for name, size in memory.items() if name.startswith(prefixes)) / n

    spring = np.dtype(np.float64 if simulation.spec.precision == "float64" else np.float32).itemsize * 3
    particles = [f"particles.{name}" for name in ("x_at_rebuild", "start", "count", "wall_start")]
    once = each("now.", "next.", *particles)
    twice = each("particles.partial_force", "particles.partial_torque")
    listed = (4 * len(entries) + 2 * spring * np.count_nonzero(entries < 0)) / n
    return once + 2 * twice + float(listed)


def main(
    bed: str, particles: str, steps: str, threads: str, device: str, precision: str, started: str
) -> None:  # fmt: skip
    """Run the bed and print what was measured."""
    done = measure(bed, int(particles), int(steps), int(threads), device, precision, float(started))
    print(json.dumps(dataclasses.asdict(done)))


if __name__ == "__main__":
    main(*sys.argv[1:])
