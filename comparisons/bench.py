"""`gpudem bench`: particle-steps per second and memory of both codes on the same beds, in turn."""

from __future__ import annotations

import dataclasses
import itertools
import json
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from comparisons.beds import COUNT, bench_scene
from gpudem.errors import GpudemError
from gpudem.run import Timing

#: Particle-steps of one measurement: about 10 s on one core.
BUDGET = 4e7
MIN_STEPS, MAX_STEPS = 300, 6000


@dataclasses.dataclass(frozen=True)
class Row:
    """One measurement; `rate` in particle-steps per second of stepping."""

    state: str
    code: str
    particles: int
    steps: int
    cores: int
    device: str
    precision: str
    repeat: int
    rate: float
    stepping_s: float
    setup_s: float
    compile_s: float
    peak_memory_bytes: int


def measure_gpudem(state: str, copies: int, steps: int, cores: int, device: str, precision: str) -> Timing:
    """In a process of its own. Raises GpudemError with what it said."""
    arguments = [state, str(copies), str(steps), str(cores), device, precision]
    command = [sys.executable, "-m", "comparisons.bench_worker", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise GpudemError(f"bench worker failed: {done.stderr.strip().splitlines()[-1]}")
    return Timing(**json.loads(done.stdout.strip().splitlines()[-1]))


def measure_liggghts(state: str, copies: int, steps: int, cores: int) -> Timing:
    """Through the binary, without output. Raises GpudemError."""
    from reference import liggghts

    with tempfile.TemporaryDirectory() as folder:
        scene = bench_scene(state, copies, steps)
        return liggghts.run(scene, Path(folder), ranks=cores, use_recorded=False).timing


def measurements(
    sizes: list[int], cores: list[int], repeats: int, device: str, precisions: list[str], budget: float
) -> Iterator[Row]:
    """Every combination, the codes in turn within each repeat, so that both see the same machine."""
    for size, state, core in itertools.product(sizes, ("settled", "flowing"), cores):
        copies = max(1, round(size / COUNT))
        steps = int(min(MAX_STEPS, max(MIN_STEPS, budget * core / (copies * COUNT))))
        for repeat in range(repeats):
            runs = [("gpudem", p) for p in precisions] + [("liggghts", "float64")]
            for code, precision in runs:
                if code == "gpudem":
                    t = measure_gpudem(state, copies, steps, core, device, precision)
                else:
                    t = measure_liggghts(state, copies, steps, core)
                yield Row(
                    state=state, code=code, particles=copies * COUNT, steps=steps, cores=core,
                    device=t.device, precision=precision, repeat=repeat, rate=t.rate, stepping_s=t.stepping_s,
                    setup_s=t.setup_s, compile_s=t.compile_s, peak_memory_bytes=t.peak_memory_bytes,
                )  # fmt: skip


def summary(rows: list[Row]) -> list[dict[str, Any]]:
    """By bed, cores, precision: median rates; ratio gpudem/LIGGGHTS (median, least, most of the repeats)."""
    table = []
    for key, group in itertools.groupby(rows, key=lambda r: (r.particles, r.state, r.cores)):
        mine = list(group)
        theirs = {r.repeat: r for r in mine if r.code == "liggghts"}
        if not theirs:
            continue  # the first repeat is not complete yet
        for precision in dict.fromkeys(r.precision for r in mine if r.code == "gpudem"):
            ours = [r for r in mine if r.code == "gpudem" and r.precision == precision]
            ratios = [r.rate / theirs[r.repeat].rate for r in ours if r.repeat in theirs]
            table.append(
                {
                    "particles": key[0], "bed": key[1], "cores": key[2], "precision": precision,
                    "gpudem [M/s]": statistics.median(r.rate for r in ours) / 1e6,
                    "LIGGGHTS [M/s]": statistics.median(r.rate for r in theirs.values()) / 1e6,
                    "ratio": statistics.median(ratios), "ratio least": min(ratios), "ratio most": max(ratios),
                    "gpudem [MiB]": max(r.peak_memory_bytes for r in ours) / 2**20,
                    "LIGGGHTS [MiB]": max(r.peak_memory_bytes for r in theirs.values()) / 2**20,
                }
            )  # fmt: skip
    return table


@click.command()
@click.option("--sizes", default="5000,20000,120000", help="Spheres, multiples of 5000.", show_default=True)
@click.option(
    "--cores", default="1,2", help="Threads of gpudem and MPI ranks of LIGGGHTS.", show_default=True
)
@click.option("--repeats", default=3, show_default=True)
@click.option("--precision", default="float64,mixed", help="Of gpudem, with commas.", show_default=True)
@click.option("--device", default="cpu", help="Of gpudem.", show_default=True)
@click.option("--budget", default=BUDGET, help="Particle-steps of one measurement.", show_default=True)
@click.option("--out", type=click.Path(path_type=Path), default=Path("runs/bench.json"), show_default=True)
def command(
    sizes: str, cores: str, repeats: int, precision: str, device: str, budget: float, out: Path
) -> None:
    """Measure speed and memory of both codes on settled and flowing beds, in turn, in one run."""
    from comparisons.provenance import collect

    rows: list[Row] = []
    out.parent.mkdir(parents=True, exist_ok=True)
    counts, core_counts = ([int(v) for v in text.split(",")] for text in (sizes, cores))
    for row in measurements(counts, core_counts, repeats, device, precision.split(","), budget):
        rows.append(row)
        click.echo(
            f"{row.particles:>8} {row.state:8} {row.cores} core{'s' if row.cores > 1 else ' '} {row.code:9}"
            f" {row.precision} {row.rate / 1e6:7.2f} M particle-steps/s"
            f" {row.peak_memory_bytes / 2**20:7.0f} MiB"
        )
        everything = [dataclasses.asdict(r) for r in rows]
        data = {"provenance": collect(), "summary": summary(rows), "rows": everything}
        out.write_text(json.dumps(data, indent=1, default=str))
    import pandas

    click.echo(pandas.DataFrame(summary(rows)).to_string(index=False, float_format="{:.2f}".format))
    click.echo(f"written: {out}")


def main(arguments: list[str]) -> int:
    """Run the command with these arguments. Raises GpudemError where a code could not run."""
    command.main(arguments, prog_name="gpudem bench", standalone_mode=False)
    return 0
