"""One gpudem measurement in a process of its own, so that its peak memory is its own.

`python -m comparisons.bench_worker STATE COPIES STEPS THREADS DEVICE PRECISION` prints the timing as JSON.
"""

from __future__ import annotations

import dataclasses
import json
import sys

from comparisons.beds import bench_scene
from gpudem.simulation import run


def main(state: str, copies: str, steps: str, threads: str, device: str, precision: str) -> None:
    """Run the bed and print its timing."""
    scene = bench_scene(state, int(copies), int(steps))
    timing = run(scene, device=device, threads=int(threads), precision=precision).timing
    print(json.dumps(dataclasses.asdict(timing)))


if __name__ == "__main__":
    main(*sys.argv[1:])
