"""Compare the speed of two commits: both step the same beds in turn, chunk by chunk, on one machine.

    python tools/compare_speed.py 39dcc83                        # that commit against the working tree
    python tools/compare_speed.py A B --sizes 5000,20000 --threads 1 --precision mixed
    python tools/compare_speed.py FOLDER . --device cuda:0       # sources in a folder, on a GPU

Two processes hold one simulation each and take turns, a fraction of a second long, so that what else the
machine does affects both. Prints a line per bed: median ratio of the times (first commit / second: above 1
the second is faster), its quartiles over the turns, and the bytes of device arrays per particle.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from compare_commits import unpack


def serve(device: str) -> None:
    """The worker: reads "BED N THREADS PRECISION" and then numbers of steps; answers each with a line."""
    import warp as wp

    from comparisons.bench.beds import SKIN, bench_scene

    try:
        from gpudem.solver.solver import Solver
    except ImportError:  # before the solver was a package
        from gpudem.solver import Simulation as Solver
    simulation: Any = None
    for line in sys.stdin:
        words = line.split()
        if len(words) == 4:
            if simulation is not None:
                simulation.close()
            bed, n, threads, precision = words
            scene = bench_scene(bed, int(n), 100_000, solver={"skin": SKIN, "precision": precision})
            simulation = Solver(scene, device, int(threads))
            simulation.start()
            simulation.advance(20)
            answer = sum(simulation.memory_bytes().values()) / int(n)
        else:
            begin = time.perf_counter()
            simulation.advance(int(words[0]))
            wp.synchronize_device(device)
            answer = time.perf_counter() - begin
        print(json.dumps(answer), flush=True)


class Worker:
    """A process with the sources of one commit."""

    def __init__(self, commit: str, folder: Path, device: str):
        sources = (
            Path(commit).resolve() if Path(commit).is_dir() and commit != "." else unpack(commit, folder)
        )
        path = os.pathsep.join([str(sources), os.environ.get("PYTHONPATH", "")])
        self.process = subprocess.Popen(
            [sys.executable, str(Path(__file__).resolve()), "--worker", "--device", device],
            cwd=sources, env={**os.environ, "PYTHONPATH": path},
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip

    def ask(self, line: str) -> float:
        """Send a line, wait for the answer."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()
        while answer := self.process.stdout.readline():
            try:
                return float(json.loads(answer))
            except ValueError:
                continue  # Warp's own words
        raise RuntimeError(f"worker ended with status {self.process.wait()}")


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("commits", nargs="*")
    parser.add_argument("--beds", default="settled,flowing")
    parser.add_argument("--sizes", default="5000,20000,120000")
    parser.add_argument("--threads", default="1,2")
    parser.add_argument("--precision", default="float64,mixed")
    parser.add_argument("--turns", type=int, default=25)
    parser.add_argument("--turn-steps", type=float, default=1.5e6, help="particle-steps of a turn")
    parser.add_argument("--device", default="cpu", help="cpu (default), cuda:0 (without --threads)")
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.worker:
        serve(given.device)
        return
    one, two = (*given.commits, ".")[:2]
    with tempfile.TemporaryDirectory(prefix="commits_") as folder:
        workers = [Worker(commit, Path(folder), given.device) for commit in (one, two)]
        choices = itertools.product(
            given.precision.split(","),
            given.sizes.split(","),
            given.threads.split(",") if given.device == "cpu" else ["1"],
            given.beds.split(","),
        )
        for precision, size, threads, bed in choices:
            memory = [w.ask(f"{bed} {size} {threads} {precision}") for w in workers]
            steps = max(2, round(given.turn_steps / int(size)))
            times = np.array([[w.ask(str(steps)) for w in workers] for _ in range(given.turns)])
            low, middle, high = np.quantile(times[:, 0] / times[:, 1], (0.25, 0.5, 0.75))
            print(
                f"{precision} {size} {bed} {threads} threads on {given.device}:"
                f" {middle:.3f} ({low:.3f} to {high:.3f});"
                f" {memory[0]:.0f} -> {memory[1]:.0f} B a particle",
                flush=True,
            )
        for worker in workers:
            worker.process.kill()


if __name__ == "__main__":
    main()
