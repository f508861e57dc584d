"""Speed of the codes on the same settled and flowing beds, in turn, in this run; and the recorded bench."""

from __future__ import annotations

import functools
import json
import statistics
from importlib import resources
from typing import Any

import pandas

from comparisons import kit
from comparisons.bench.beds import COUNT, bench_scene
from comparisons.bench.command import LARGE
from comparisons.bench.insertion import EVENTS, INTERVAL
from comparisons.harness import codes
from comparisons.report import plots

BEDS = ("settled", "flowing")
#: (steps, repeats, core counts): a measurement takes 0.3 s in the quick tier, 3 s in the others.
PLAN = {"quick": (200, 1, (1,)), "standard": (1500, 3, (1, 2)), "full": (3000, 5, (1, 2))}
LEAST = 1.4


def variants(tier: kit.Tier) -> list[kit.Variant]:
    steps, repeats, cores = PLAN[tier]
    return [
        variant
        for bed in BEDS for n in cores for repeat in range(repeats)
        for variant in kit.Configurations(kit.Configuration("gpudem"), timed_on=n, brought=False).variants(
            f"{bed}_{n}_{repeat}", bench_scene(bed, COUNT, steps)
        )
    ]  # fmt: skip


def _pairs(results: kit.Results) -> list[tuple[str, str]]:
    found = codes.pairs(results.codes())
    if not found:
        raise kit.Unmeasured("needs a second code on the same beds")
    return found


def rates(results: kit.Results, bed: str, cores: int, *asked: str) -> list[list[float]]:
    """Particle-steps per second of each of the codes, by repeat; of repeats that all of them ran."""
    labels = results.labels(*asked, prefix=f"{bed}_{cores}_")
    return [[results[label, code].timing.rate for label in labels] for code in asked]


def speed_ups(results: kit.Results, bed: str, cores: int, code: str, other: str) -> list[float]:
    """Rate of a code / that of another, by repeat."""
    return [a / b for a, b in zip(*rates(results, bed, cores, code, other), strict=True)]


def _findings(code: str, other: str) -> tuple[kit.Finding, ...]:
    return () if codes.brought(code) else tuple(
        kit.Finding(
            f"{codes.title(code)}'s particle-steps per second / {codes.title(other)}'s, {bed}, {_cores(n)}",
            lambda results, bed=bed, n=n: kit.median(speed_ups(results, bed, n, code, other)), "1",
            f"Same bed and machine, in turn; the target is {LEAST}.", (code, other), kit.LONG,
        )
        for bed in BEDS for n in (1, 2)
    )  # fmt: skip


def _cores(n: int) -> str:
    return f"{n} core{'s' if n > 1 else ''}"


def table(results: kit.Results) -> pandas.DataFrame:
    """Median rates and speed-up with its range, for each pair of codes."""
    rows = []
    for code, other in _pairs(results):
        for bed, cores in ((bed, n) for bed in BEDS for n in PLAN[results.tier][2]):
            own, theirs = (statistics.median(rate) / 1e6 for rate in rates(results, bed, cores, code, other))
            found = speed_ups(results, bed, cores, code, other)
            ratio = {"speed-up": statistics.median(found), "smallest": min(found), "largest": max(found)}
            rate = {f"{codes.title(code)} [1e6/s]": own, f"{codes.title(other)} [1e6/s]": theirs}
            rows.append({"bed": bed, "cores or ranks": cores, **rate, **ratio})
    return pandas.DataFrame(rows).round(2)


def draw(results: kit.Results) -> plots.Figure:
    groups = [(bed, n) for bed in BEDS for n in PLAN[results.tier][2]]
    figure, axes = plots.figure(height=3.0)
    for code, other in _pairs(results):
        for k, (bed, n) in enumerate(groups):
            found = speed_ups(results, bed, n, code, other)
            label = f"{codes.title(code)} / {codes.title(other)}" if k == 0 else None
            axes.plot([k] * len(found), found, **plots.style(code, linestyle="none", marker="o", label=label))
    axes.axhline(1.0, color="0.3")
    axes.axhline(LEAST, color="0.5", linestyle=":", label=f"target, {LEAST}")
    axes.set_xticks(range(len(groups)), [f"{bed}\n{_cores(n)}" for bed, n in groups])
    axes.set(xlim=(-0.5, len(groups) - 0.5), ylabel="speed-up")
    axes.set_ylim(bottom=0)
    plots.legend(axes)
    return figure


# -- the recorded bench --------------------------------------------------------------------------------------


#: Heads of columns of the recorded bench, in full.
HEADS = {
    "over one core": "speed-up over one core", "bytes a step": "bytes per step",
    "bytes a particle": "bytes per particle", "and [MiB]": "before the first particle [MiB]",
    "exponent": "exponent k", "up to": "largest N",
}  # fmt: skip


@functools.cache
def recorded(name: str = "bench") -> dict[str, Any]:
    """The last `gpudem bench` that was kept, with its provenance; "bench_insertion": of insertion."""
    return json.loads((resources.files("comparisons") / "recorded" / f"{name}.json").read_text())


def recorded_table(part: str) -> pandas.DataFrame:
    """A part of the recorded bench as a table."""
    rows = pandas.DataFrame(recorded()[part] or [{"note": "too few sizes"}])
    rows = narrowed(rows) if part == "summary" else rows
    return rows.rename(columns=HEADS).round(2).dropna(axis=1, how="all")


def narrowed(rows: pandas.DataFrame) -> pandas.DataFrame:
    """The summary in as many columns as a page holds: ratio with range, no device where all are one."""
    spread = [
        "" if pandas.isna(ratio) else f"{ratio:.2f} ({least:.2f} to {most:.2f})"
        for ratio, least, most in zip(rows["ratio"], rows["ratio least"], rows["ratio most"], strict=True)
    ]
    wide = ("ratio least", "ratio most", "arrays [B]", "contacts", "insertion most [%]")
    left_out = [name for name in wide if name in rows]
    left_out += ["device"] * (rows["device"].nunique() == 1)
    names = {
        "s a simulated s": "s / simulated s", "of the roofline [%]": "roofline [%]",
        "first step after [s]": "start [s]", "ratio": "speed-up",
    }  # fmt: skip
    return rows.assign(ratio=spread).drop(columns=left_out).rename(columns=names)


def insertion_table() -> pandas.DataFrame:
    """The recorded share of the time that insertion takes, by repeat."""
    rows = pandas.DataFrame(recorded("bench_insertion")["rows"])
    return pandas.DataFrame({
        "particles": rows["particles"], "layers": EVENTS, "steps": rows["steps"], "cores": rows["cores"],
        "precision": rows["precision"], "insertion [% of the time]": 100 * rows["insertion_share"],
        "1e6 particle-steps/s": rows["rate"] / 1e6,
    }).round(2)  # fmt: skip


def _insertion_caption() -> str:
    p = recorded("bench_insertion")["provenance"]
    return (
        f"Recorded, not run now: {p['date']}, commit {p['commit']}, {p['hardware']['cpu']}, while other"
        f" programs used the machine. An empty bed filled by a stream: a layer every {INTERVAL} steps, the"
        " time in which it moves by a diameter. Insertion: what a step with a new layer takes longer than the"
        " steps up to the next one do on average, its new list of neighbors included."
    )


def _recorded_caption() -> str:
    p, only_cpu = recorded()["provenance"], all(row["device"] == "cpu" for row in recorded()["rows"])
    caption = (
        f"Recorded, not run now: {p['date']}, commit {p['commit']}, {p['hardware']['cpu']},"
        f" {p['hardware']['cores']} cores. Particle-steps per second of stepping; the speed-up is relative to"
        " LIGGGHTS on as many ranks, in float64 whatever the precision of gpudem. Bytes a step: what a step"
        " must read or write at least for a particle; with the rate and the measured memory bandwidth this"
        " gives the share of the roofline. Start: from the start of the process to its first step, kernels"
        " compiled before."
    )
    if only_cpu:
        caption += " No GPU is among them: the case gpu shows what was recorded on one."
    return caption


def draw_recorded(results: kit.Results) -> plots.Figure:
    """Rate against the number of balls, each code and precision."""
    figure, axes = plots.figure(1, 2, width=plots.WHOLE, height=3.4, sharey=True)
    rows = pandas.DataFrame(recorded()["rows"])
    looks = {"float64": (0, "-"), "mixed": (2, "--"), "float32": (3, ":")}
    for ax, bed in zip(axes, BEDS, strict=True):
        part = rows[rows.state == bed]
        for key, group in part.groupby(["code", "precision", "device", "cores"]):
            code, precision, device, cores = list(key)  # pyright: ignore[reportArgumentType]
            middle = group.groupby("particles").rate.median() / 1e6
            own = code == "gpudem"
            color, line = looks[precision] if own else (1, "-.")
            name = f"{codes.title(code)} {precision}" if own else codes.title(code)
            where = device if device != "cpu" else _cores(cores)
            ax.semilogx(
                middle.index, middle, color=plots.SERIES[color], ls=line, marker="o" if cores > 1 else "s",
                ms=3, lw=1.2, label=f"{name}, {where}", mfc="none" if cores == 1 else None,
            )  # fmt: skip
        ax.set(xlabel="particles", title=f"{bed} bed")
    axes[0].set_ylabel("particle-steps per second [1e6/s]")
    if rows.rate.max() > 100 * rows.rate.min():  # a GPU is among them
        axes[0].set_yscale("log")
    else:
        axes[0].set_ylim(bottom=0)
    plots.legend(axes[1], ncol=2, loc="lower center", fontsize=7)
    return figure


CASE = kit.Case(
    name="speed",
    title="Speed and memory",
    purpose=(
        "Particle-steps per second of stepping (without start-up, compilation and output), the codes in turn"
        " on the same bed of 5000 spheres with friction and shear history, float64, on equal numbers of cores"
        " and ranks. The cost of a step does not depend on the modulus; the cost of a simulated second does."
    ),
    source="This run; other sizes from the recorded `gpudem bench`.",
    variants=variants,
    checks=(),
    findings=(kit.PerPair(_findings),),
    figures=(
        kit.Figure("Speed-up", "One point a repeat; other programs on the machine widen the spread.", draw),
        kit.Figure(
            "Recorded bench: particle-steps per second against the number of balls",
            "Squares: one core; dots: more. " + _recorded_caption(), draw_recorded,
        ),
    ),
    tables=(
        kit.Table("Particle-steps per second, measured now", "5000 spheres, median of the repeats.", table),
        kit.Table("Recorded bench", _recorded_caption(), lambda results: recorded_table("summary")),
        kit.Table("Recorded bench: insertion", _insertion_caption(), lambda results: insertion_table()),
        kit.Table(
            "Recorded bench: cost against the number of balls",
            f"Exponent k of seconds per step ~ N^k from {LARGE} balls on, least squares of the logarithms of"
            " the medians. 1 is linear; memory that no longer fits the caches raises it.",
            lambda results: recorded_table("scaling"),
        ),
        kit.Table(
            "Recorded bench: memory of the whole process",
            "Least squares over the beds on one core: bytes for each ball, and what the process uses before"
            " the first (Python, NumPy and Warp with its compiler; MPI for LIGGGHTS).",
            lambda results: recorded_table("memory"),
        ),
    ),
    features=("speed",),
    order=90,
)  # fmt: skip
