"""`gpudem bench`: speed, memory and start-up of both codes on the same beds, in turn, in one run."""

from __future__ import annotations

import dataclasses
import itertools
import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import click
import numpy as np
import psutil

from comparisons.bench.beds import STEP
from comparisons.bench.drum import timed_scene
from comparisons.bench.insertion import STEPS as INSERTION_STEPS
from comparisons.bench.worker import Measured
from gpudem.errors import GpudemError
from gpudem.output.atomic import write_text
from gpudem.solver.device import cores as usable_cores
from gpudem.solver.device import find_device
from reference.liggghts.code import CODE as LIGGGHTS

BEDS = ("settled", "flowing", "drum", "insertion")
#: Particle-steps of one measurement: about 10 s on one core.
BUDGET = 4e7
MIN_STEPS, MAX_STEPS = 100, 6000
#: Memory of one measurement, a particle and at all [bytes]: more than either code was seen to need.
NEED, NEED_FIRST = 1800, 5e8
#: Beds from here on have left the caches; their cost per step is fitted against N.
LARGE = 10_000


@dataclasses.dataclass(frozen=True)
class Row:
    """One measurement; `rate` in particle-steps per second of stepping. None: LIGGGHTS does not tell."""

    state: str
    code: str
    particles: int
    steps: int
    cores: int
    device: str
    precision: str
    repeat: int
    rate: float
    peak_memory_bytes: int
    first_step_s: float | None = None
    compile_s: float | None = None
    rebuilds: int | None = None
    contacts: float | None = None
    array_bytes: float | None = None
    memory: dict[str, float] | None = None
    moved_bytes: float | None = None
    insertion_share: float | None = None
    """Of the time of stepping [1]; None where nothing is inserted."""


@dataclasses.dataclass(frozen=True)
class Plan:
    """What to measure."""

    sizes: list[int]
    cores: list[int]
    devices: list[str]
    precisions: list[str]
    beds: list[str]
    repeats: int
    budget: float
    liggghts: bool

    def places(self) -> list[tuple[str, int]]:
        """(device, cores); what is not a CPU counts as one core."""
        return [(device, n) for device in self.devices for n in (self.cores if device == "cpu" else [1])]

    def runs(self, bed: str) -> list[tuple[str, str, int, str]]:
        """(code, device, cores, precision) of one bed, in turn; LIGGGHTS is not given one with insertions."""
        liggghts = self.liggghts and bed != "insertion"
        found = []
        for device, cores in self.places():
            found += [("gpudem", device, cores, precision) for precision in self.precisions]
            found += [(LIGGGHTS.name, "cpu", cores, "float64")] * (liggghts and device == "cpu")
        return found

    def again(self, rows: list[Row]) -> list[str]:
        """Beds and places of the plan that were measured before: whose repeats would be mixed with theirs."""
        done = {(r.state, r.particles, r.device, r.cores) for r in rows}
        planned = itertools.product(self.beds, self.sizes, self.places())
        return [
            f"{bed} {size} on {device}, cores {cores}"
            for bed, size, (device, cores) in planned
            if (bed, size, device, cores) in done
        ]

    def steps(self, bed: str, size: int, device: str, cores: int) -> int:
        """So many that a core of a CPU is busy for some 10 s, and a GPU for 5 s at 1e9 particle-steps/s.

        All of them where particles are inserted.
        """
        if bed == "insertion":
            return INSERTION_STEPS
        budget = self.budget * (cores if device == "cpu" else 100)
        return int(min(MAX_STEPS, max(MIN_STEPS, budget / size)))


def measure_gpudem(bed: str, size: int, steps: int, cores: int, device: str, precision: str) -> Measured:
    """In a process of its own. Raises GpudemError with what it said."""
    arguments = [bed, str(size), str(steps), str(cores), device, precision, repr(time.time())]
    command = [sys.executable, "-m", "comparisons.bench.worker", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        said = done.stderr.strip().splitlines() or [f"ended with {done.returncode}"]
        raise GpudemError(f"bench worker failed ({' '.join(arguments[:-1])}): {said[-1]}")
    return Measured(**json.loads(done.stdout.strip().splitlines()[-1]))


def measure_row(run: tuple[str, str, int, str], bed: str, size: int, steps: int, repeat: int) -> Row:
    """One measurement. Raises GpudemError."""
    code, device, cores, precision = run
    about: dict[str, Any] = {
        "state": bed, "code": code, "particles": size, "steps": steps, "cores": cores, "device": device,
        "precision": precision, "repeat": repeat,
    }  # fmt: skip
    if code == "gpudem":
        m = dataclasses.asdict(measure_gpudem(bed, size, steps, cores, device, precision))
        stepping_s, about["device"] = m.pop("stepping_s"), m.pop("device")
        rate, inserting_s = m.pop("particle_steps") / stepping_s, m.pop("insertion_s")
        share = None if inserting_s is None else inserting_s / stepping_s
        return Row(**about, **m, rate=rate, insertion_share=share)
    from reference import liggghts

    with tempfile.TemporaryDirectory() as folder:
        scene = timed_scene(bed, size, steps)
        timing = liggghts.run(scene, Path(folder), ranks=cores, use_recorded=False).timing
    return Row(**about, rate=timing.rate, peak_memory_bytes=timing.peak_memory_bytes)


def fits(size: int) -> bool:
    """Whether a bed of so many balls fits into the memory that is free now."""
    return NEED_FIRST + NEED * size < psutil.virtual_memory().available


def measurements(plan: Plan) -> Iterator[Row]:
    """Every combination, the codes in turn within each repeat, so that all see the same machine."""
    for size, bed in itertools.product(plan.sizes, plan.beds):
        for repeat, run in itertools.product(range(plan.repeats), plan.runs(bed)):
            yield measure_row(run, bed, size, plan.steps(bed, size, run[1], run[2]), repeat)


def _kind(row: Row) -> tuple[Any, ...]:
    return row.particles, row.state, row.device, row.cores, row.code, row.precision


def summary(rows: list[Row], bandwidths: Iterable[dict[str, Any]] = ()) -> list[dict[str, Any]]:
    """By bed, device, cores, precision: median rate; over LIGGGHTS' and over one core's; memory; ..."""
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(_kind(row), []).append(row)
    bytes_a_second = {(b["device"], b["cores"]): b["bytes_per_s"] for b in bandwidths}
    table = []
    for (size, bed, device, cores, code, precision), mine in groups.items():
        if code != "gpudem":
            continue
        same = (size, bed, "cpu", cores, LIGGGHTS.name, "float64")
        theirs = {r.repeat: r.rate for r in groups.get(same, [])}
        alone = {r.repeat: r.rate for r in groups.get((size, bed, "cpu", 1, "gpudem", precision), [])}
        ratios = [r.rate / theirs[r.repeat] for r in mine if r.repeat in theirs] if device == "cpu" else []
        speedups = [r.rate / alone[r.repeat] for r in mine if r.repeat in alone]
        rate = statistics.median(r.rate for r in mine)
        line: dict[str, Any] = {
            "particles": size, "bed": bed, "device": device, "cores": cores, "precision": precision,
            "gpudem [M/s]": rate / 1e6,
            "LIGGGHTS [M/s]": statistics.median(theirs.values()) / 1e6 if ratios else None,
            "ratio": statistics.median(ratios) if ratios else None,
            "ratio least": min(ratios, default=None), "ratio most": max(ratios, default=None),
            "over one core": statistics.median(speedups) if speedups else None,
        }  # fmt: skip
        moved, ceiling = mine[0].moved_bytes, bytes_a_second.get((device, cores))
        line["s a simulated s"] = size / rate / STEP
        line["bytes a step"] = moved
        line["of the roofline [%]"] = 100 * rate * moved / ceiling if moved and ceiling else None
        line["arrays [B]"] = mine[0].array_bytes
        line["contacts"] = mine[0].contacts
        shares = [100 * r.insertion_share for r in mine if r.insertion_share is not None]
        line["insertion [%]"] = statistics.median(shares) if shares else None
        line["insertion most [%]"] = max(shares, default=None)
        line["first step after [s]"] = statistics.median(r.first_step_s or np.nan for r in mine)
        table.append(line)
    return table


def memory(rows: list[Row]) -> list[dict[str, Any]]:
    """Peak memory of the process against N on one core, by code and precision: offset and slope."""
    table = []
    keys = dict.fromkeys((r.code, r.precision) for r in rows if r.device == "cpu" and r.cores == 1)
    for code, precision in keys:
        mine = [r for r in rows if (r.code, r.precision, r.device, r.cores) == (code, precision, "cpu", 1)]
        n = np.array([r.particles for r in mine], float)
        if len(set(n)) < 2:
            continue
        slope, offset = np.polyfit(n, [r.peak_memory_bytes for r in mine], 1, w=1 / n)
        about = {"code": code, "precision": precision}
        table.append({**about, "bytes a particle": slope, "and [MiB]": offset / 2**20})
    return table


def memory_by_purpose(rows: list[Row]) -> list[dict[str, Any]]:
    """Bytes a particle of gpudem's arrays, by purpose: a column for each bed, device and precision, of its
    largest number of particles.
    """
    largest = {
        (r.state, r.device, r.precision): r for r in sorted(rows, key=lambda r: r.particles) if r.memory
    }
    purposes = dict.fromkeys(p for r in largest.values() for p in r.memory or ())
    table = [
        {"bytes a particle": p, **{" ".join(key): (r.memory or {}).get(p) for key, r in largest.items()}}
        for p in purposes
    ]
    total = {" ".join(key): r.array_bytes for key, r in largest.items()}
    return [*table, {"bytes a particle": "total", **total}] if table else []


def scaling(rows: list[Row]) -> list[dict[str, Any]]:
    """Exponent k of seconds per step ~ N^k over the large beds: least squares of logarithms of medians."""
    table = []
    for key in dict.fromkeys(_kind(r)[1:] for r in rows):
        mine = [r for r in rows if _kind(r)[1:] == key and r.particles >= LARGE]
        n = np.array(sorted({r.particles for r in mine}), float)
        if len(n) >= 3:  # each size counts once, however often it was measured
            rate = [statistics.median(r.rate for r in mine if r.particles == size) for size in n]
            slope = np.polyfit(np.log(n), np.log(n / np.array(rate)), 1)[0]
            names = ("bed", "device", "cores", "code", "precision")
            table.append({**dict(zip(names, key, strict=True)), "exponent": slope, "up to": int(n.max())})
    return table


@dataclasses.dataclass(frozen=True)
class Bench:
    """What one or more calls on one machine measured."""

    rows: list[Row]
    bandwidths: list[dict[str, Any]]
    left_out: list[int]
    commands: list[str]
    """Of the calls before this one."""

    def write(self, out: Path) -> None:
        """As JSON, with what follows from it and its provenance."""
        from comparisons.harness.provenance import collect

        provenance = collect()
        provenance["command"] = "; ".join([*self.commands, provenance["command"]])
        data = {
            "provenance": provenance, "bandwidth": self.bandwidths, "left_out": self.left_out,
            "summary": summary(self.rows, self.bandwidths), "scaling": scaling(self.rows),
            "memory": memory(self.rows), "rows": [dataclasses.asdict(r) for r in self.rows],
        }  # fmt: skip
        write_text(out, json.dumps(data, indent=1, default=str))


def earlier(out: Path) -> Bench:
    """What an earlier call wrote. Raises GpudemError where that was another commit or machine, or nothing."""
    from comparisons.harness.provenance import collect

    if not out.is_file():
        raise GpudemError(f"--append: {out}: no such file")
    try:
        data, now = json.loads(out.read_text()), collect()
        return _continued(out, data, now)
    except (ValueError, KeyError, TypeError) as error:
        raise GpudemError(f"--append: {out}: not written by `gpudem bench`: {error!r}") from None


def _continued(out: Path, data: dict[str, Any], now: Mapping[str, Any]) -> Bench:
    for what in ("commit", "hardware"):
        if data["provenance"][what] != now[what]:
            raise GpudemError(
                f"--append: {out} is of {what} {data['provenance'][what]}; here it is {now[what]}"
            )
    rows = [Row(**row) for row in data["rows"]]
    return Bench(rows, data["bandwidth"], data["left_out"], [data["provenance"]["command"]])


def _numbers(context: click.Context, parameter: click.Parameter, value: str) -> list[int]:
    try:
        numbers = [int(float(v)) for v in value.split(",")]
    except ValueError:
        raise click.BadParameter(f"{value!r}: numbers with commas between them are wanted") from None
    if min(numbers) < 1:
        raise click.BadParameter(f"{value!r}: numbers of 1 or more are wanted")
    return numbers


@click.command()
@click.option(
    "--sizes", default="1000,5000,20000,120000", callback=_numbers, show_default=True,
    help="Spheres: below 5000, or multiples of it; 1e6 is understood.",
)  # fmt: skip
@click.option(
    "--cores", default="1,2", callback=_numbers, show_default=True,
    help="Threads of gpudem and MPI ranks of LIGGGHTS.",
)  # fmt: skip
@click.option(
    "--beds", default="settled,flowing", help="Of settled, flowing, drum, insertion.", show_default=True
)
@click.option("--repeats", default=3, show_default=True)
@click.option("--precision", default="float64,mixed", help="Of gpudem, with commas.", show_default=True)
@click.option("--device", default="cpu", help="Of gpudem, with commas.", show_default=True)
@click.option("--budget", default=BUDGET, help="Particle-steps of one measurement.", show_default=True)
@click.option("--liggghts/--no-liggghts", default=True, show_default=True)
@click.option("--out", type=click.Path(path_type=Path), default=Path("runs/bench.json"), show_default=True)
@click.option("--append", is_flag=True, help="Keep what OUT holds, of the same commit and machine.")
def command(
    sizes: list[int], cores: list[int], beds: str, repeats: int, precision: str, device: str, budget: float,
    liggghts: bool, out: Path, append: bool,
) -> None:  # fmt: skip
    """Measure speed and memory of both codes on settled and flowing beds, in turn, in one run."""
    import pandas

    from comparisons.bench.roofline import bandwidth

    if liggghts:
        from reference.liggghts.binary import find_liggghts

        find_liggghts()
    usable = usable_cores()
    if max(cores) > usable:
        raise GpudemError(f"--cores {max(cores)}: this process may use {usable}")
    plan = Plan(
        sizes=[size for size in sizes if fits(size)], cores=cores, beds=beds.split(","),
        devices=device.split(","), precisions=precision.split(","), repeats=repeats, budget=budget,
        liggghts=liggghts,
    )  # fmt: skip
    made = earlier(out) if append else Bench([], [], [], [])
    if again := plan.again(made.rows):
        raise GpudemError(f"--append: {out} has {again[0]} already")
    made.left_out.extend(size for size in sizes if size not in plan.sizes)
    for size in made.left_out:
        click.echo(f"{size} spheres: left out, they need {(NEED_FIRST + NEED * size) / 2**30:.1f} GiB")
    for where, core in plan.places():
        name = str(find_device(where))
        made.bandwidths.append({"device": name, "cores": core, "bytes_per_s": bandwidth(where, core)})
        click.echo(f"memory, {name}, cores {core}: {made.bandwidths[-1]['bytes_per_s'] / 1e9:.1f} GB/s")
    out.parent.mkdir(parents=True, exist_ok=True)
    for row in measurements(plan):
        made.rows.append(row)
        click.echo(
            f"{row.particles:>8} {row.state:8} {row.device} {row.cores} core{'s' if row.cores > 1 else ' '}"
            f" {row.code:9} {row.precision:8} {row.rate / 1e6:8.2f} M particle-steps/s"
            f" {row.peak_memory_bytes / 2**20:7.0f} MiB"
        )
        made.write(out)
    tables = (summary(made.rows, made.bandwidths), scaling(made.rows), memory(made.rows))
    for table in (*tables, memory_by_purpose(made.rows)):
        if table:
            click.echo(pandas.DataFrame(table).to_string(index=False, float_format="{:.2f}".format))
    click.echo(f"written: {out}")


def main(arguments: list[str]) -> int:
    """Run the command with these arguments. Raises GpudemError where a code could not run."""
    command.main(arguments, prog_name="gpudem bench", standalone_mode=False)
    return 0
