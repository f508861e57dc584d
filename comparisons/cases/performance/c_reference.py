"""What an event costs: the three search methods, and the engine beside the same algorithm in plain C.

All in turn on this machine, in this run, on one core; start-up, compiling, reading and placing do not count.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import os
import shutil
import subprocess
import tempfile
import time
from importlib import resources
from pathlib import Path
from typing import Literal

import numpy as np

from comparisons.kit import Unmeasured
from gpudem.errors import GpudemError
from gpudem.event_driven.engine import Engine
from gpudem.event_driven.problem import HardSphereProblem
from gpudem.scene import Box, Contact, Domain, Explicit, Material, Pair, Plane, Scene, Time
from gpudem.scene.walls import Vibration

Search = Literal["tree", "scan", "pairs"]
SEARCHES: tuple[Search, ...] = ("tree", "scan", "pairs")
RADIUS, RESTITUTION, FLOOR_SPEED, ROWS = 0.02, 0.95, 0.149, 8
#: Events of a disk in a unit of time, roughly.
EVENTS = 25.0
FLAGS = ("-O2", "-ffp-contract=off")


@functools.cache
def problem(count: int, seed: int = 1) -> HardSphereProblem:
    """So many disks over a fast floor, on a jittered lattice, as wide as their number asks for."""
    rng, width = np.random.default_rng(seed), count / 150
    columns = math.ceil(count / ROWS)
    cell = np.array([width / columns, 0.5 / ROWS])
    k = np.arange(count)
    corner = np.column_stack([k // ROWS, k % ROWS]) * cell
    place = corner + cell / 2 + 0.45 * (cell - 2 * RADIUS) * rng.uniform(-1, 1, (count, 2))
    zero = np.zeros(count)
    scene = Scene(
        name="event_speed",
        materials={
            "disk": Material(young=1e7, poisson=0.3, density=3 / (4 * math.pi * RADIUS**3)),
            "wall": Material(young=1e7, poisson=0.3, density=1000.0),
        },
        pairs=[
            Pair(materials=("disk", "disk"), restitution=RESTITUTION), Pair(materials=("disk", "wall")),
        ],
        contact=Contact(tangential="off"),
        particles=Explicit(
            position=np.column_stack([place[:, 0], zero, place[:, 1]]),
            velocity=rng.normal(size=(count, 3)) * (1, 0, 1), radius=RADIUS, material="disk",
        ),
        gravity=(0.0, 0.0, -1.0),
        walls=[
            Box(kind="box", name="box", material="wall", sides=("xlo", "xhi")),
            Plane(name="floor", material="wall", point=(0, 0, 0), normal=(0, 0, 1),
                  vibration=Vibration(speed=FLOOR_SPEED)),
        ],
        domain=Domain(lo=(0.0, -0.1, 0.0), hi=(width, 0.1, 20.0)),
        time=Time(step=1e-3, duration=100.0),
        allow=("time_step", "unusual_units"),
    )  # fmt: skip
    return HardSphereProblem.from_scene(scene)


@dataclasses.dataclass(frozen=True)
class Timed:
    """One run of one program."""

    events: int
    collisions: int
    seconds: float
    height: float
    """Mean height at the end [m]."""


def engine_run(start: HardSphereProblem, until: float, search: Search = "tree") -> Timed:
    """The engine to a time [s]."""
    engine = Engine(start, search=search)
    began = time.perf_counter()
    engine.advance(until)
    seconds, counts = time.perf_counter() - began, engine.counts
    return Timed(counts.events, counts.collisions, seconds, float(engine.state()[0][:, 2].mean()))


def same_sequence(count: int = 30, collisions: int = 200) -> dict[Search, list[tuple[int, int]]]:
    """The first collisions by each search: the two particles, the lower number first."""
    start, found = problem(count), {}
    for search in SEARCHES:
        engine = Engine(start, log=collisions, search=search)
        while engine.counts.collisions < collisions:
            engine.advance(engine.time + 0.05)
        found[search] = [(a, b) if b < 0 else (min(a, b), max(a, b)) for a, b in engine.log[0].tolist()]
    return found


def rungs(plan: dict[Search, tuple[tuple[int, ...], float]], repeats: int) -> dict[Search, dict[int, float]]:
    """Least seconds an event over the repeats, which take turns; by search and number of particles.

    Args:
        plan: Search -> (numbers of particles, work of a run: events, or for "pairs" pairs looked at).
        repeats: Runs of each.
    """
    best: dict[Search, dict[int, float]] = {search: {} for search in plan}
    starts = {n: problem(n) for numbers, _ in plan.values() for n in numbers}
    for search in plan:
        engine_run(starts[min(starts)], 1e-3, search)  # compiled before it is timed
    rounds: list[tuple[Search, int, float]] = [
        (s, n, work) for s, (numbers, work) in plan.items() for n in numbers
    ]
    for search, n, work in rounds * repeats:
        events = work / {"pairs": n * n / 2, "scan": 1 + n / 1000, "tree": 1}[search]
        got = engine_run(starts[n], max(events, 30) / (EVENTS * n), search)
        each = got.seconds / (got.events + 1)  # the search that finds the end is one too
        best[search][n] = min(each, best[search].get(n, math.inf))
    return best


class CReference:
    """The C program, compiled for this machine into a folder.

    Raises:
        Unmeasured: there is no C compiler here.
        GpudemError: it does not compile.
    """

    def __init__(self, folder: Path) -> None:
        name = os.environ.get("CC", "cc")
        compiler = shutil.which(name)
        if compiler is None:
            raise Unmeasured(f"no C compiler here ({name}); Debian: apt-get install gcc")
        self.folder, self.program, source = folder, folder / "hard_spheres", folder / "hard_spheres.c"
        source.write_text(
            (resources.files("comparisons.cases.performance") / "data" / "hard_spheres.c").read_text()
        )
        command = [compiler, *FLAGS, "-o", str(self.program), str(source), "-lm"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise GpudemError(f"{' '.join(command[:-4])}: {done.stderr.strip()[:400]}")
        version = subprocess.run([compiler, "--version"], capture_output=True, text=True, check=False)
        self.compiler = f"{(version.stdout or name).splitlines()[0]} {' '.join(FLAGS)}"

    def write(self, start: HardSphereProblem) -> Path:
        """The start as the program reads it, with 17 digits."""
        engine, path = Engine(start), self.folder / f"start_{len(start.radius)}.txt"
        walls, lines = start.segments[0][2], [str(len(start.radius))]
        for k in range(3):
            row = [start.lo[k], engine.cell_edge[k], start.gravity[k]]
            lines.append(f"{engine.cells[k]} {int(not start.layer[k])} " + " ".join(f"{a:.17g}" for a in row))
        for side in range(6):
            at = [walls.position[side], walls.speed[side], walls.restitution[side, 0]]
            flags = f"{int(walls.present[side])} {int(engine.side_closed[side])} "
            lines.append(flags + " ".join(f"{a:.17g}" for a in at))
        lines.append(f"{start.restitution[0, 0]:.17g}")
        rows = np.column_stack([start.position, start.velocity, start.radius, start.mass])
        with path.open("w") as file:
            file.write("\n".join(lines) + "\n")
            np.savetxt(file, rows, fmt="%.17g")
        return path

    def run(self, path: Path, until: float) -> Timed:
        """The program to a time [s]. Raises GpudemError with its message."""
        command = [str(self.program), str(path), f"{until:.17g}"]
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
        if done.returncode:
            raise GpudemError(f"hard_spheres ended with {done.returncode}: {done.stderr.strip()}")
        events, collisions, _, _, seconds, height = done.stdout.split()
        return Timed(int(events), int(collisions), float(seconds), float(height))


def beside_c(plan: dict[int, tuple[float, int]]) -> tuple[str, dict[int, list[tuple[Timed, Timed]]]]:
    """(compiler, number of particles -> (engine, C) of each repeat, one right after the other).

    Args:
        plan: Number of particles -> (time to run to [s], repeats).
    """
    found: dict[int, list[tuple[Timed, Timed]]] = {}
    with tempfile.TemporaryDirectory(prefix="hard_spheres_") as folder:
        reference = CReference(Path(folder))
        engine_run(problem(30), 1e-3)
        for n, (until, repeats) in plan.items():
            start, found[n] = problem(n), []
            path = reference.write(start)
            for k in range(repeats):  # the order alternates as well
                if k % 2:
                    c, own = reference.run(path, until), engine_run(start, until)
                else:
                    own, c = engine_run(start, until), reference.run(path, until)
                found[n].append((own, c))
    return reference.compiler, found
