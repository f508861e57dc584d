"""Speed of both codes on the same settled and flowing beds, in turn, in this run; and the recorded bench."""

from __future__ import annotations

import json
import statistics
from importlib import resources

import pandas

from comparisons.bench.beds import COUNT, bench_scene
from comparisons.bench.command import LARGE
from comparisons.harness.case import Case, Check, Figure, Measured, Results, Table, Tier, Variant

BEDS = ("settled", "flowing")
#: (steps, repeats, core counts): a measurement takes 0.3 s in the quick tier, 3 s in the others.
PLAN = {"quick": (200, 1, (1,)), "standard": (1500, 3, (1, 2)), "full": (3000, 5, (1, 2))}
LEAST = 1.4


def variants(tier: Tier) -> list[Variant]:
    steps, repeats, cores = PLAN[tier]
    return [
        Variant(
            f"{bed}_{n}_{repeat}", bench_scene(bed, COUNT, steps),
            options={"gpudem": {"threads": n}, "liggghts": {"ranks": n, "use_recorded": False}}, timed=True,
        )
        for bed in BEDS for n in cores for repeat in range(repeats)
    ]  # fmt: skip


def ratios(results: Results, bed: str, cores: int) -> list[float]:
    """Rate of gpudem over that of LIGGGHTS, each repeat."""
    labels = [label for label in results.labels() if label.startswith(f"{bed}_{cores}_")]
    both = [lab for lab in labels if {"gpudem", "liggghts"} <= set(results.codes(lab))]
    return [results[lab, "gpudem"].timing.rate / results[lab, "liggghts"].timing.rate for lab in both]


def _check(bed: str, cores: int) -> Check:
    def measure(results: Results) -> Measured:
        found = ratios(results, bed, cores)
        middle = statistics.median(found)
        return Measured(
            1 / middle, measured=middle, note=f"{len(found)} repeats, {min(found):.2f} to {max(found):.2f}"
        )

    return Check(
        name=f"LIGGGHTS' particle-steps per second / gpudem's, {bed}, {cores} core{'s' if cores > 1 else ''}",
        measure=measure, tolerance=1 / LEAST, unit="1", against="LIGGGHTS, same bed, same machine, in turn",
        mark="X", reason=f"gpudem is to reach at least {LEAST} of LIGGGHTS' speed on a CPU in float64",
        catches="a slow kernel, a list rebuilt too often, time lost between launches",
        needs=("gpudem", "liggghts"), tiers=("standard", "full"),
    )  # fmt: skip


def table(results: Results) -> pandas.DataFrame:
    """Median rates and ratio with spread."""
    rows = []
    for bed in BEDS:
        for cores in (1, 2):
            labels = [lab for lab in results.labels() if lab.startswith(f"{bed}_{cores}_")]
            found = ratios(results, bed, cores)
            if not found:
                continue
            rate = {
                code: statistics.median(results[lab, code].timing.rate for lab in labels) / 1e6
                for code in ("gpudem", "liggghts")
            }
            rows.append(
                (
                    bed,
                    cores,
                    rate["gpudem"],
                    rate["liggghts"],
                    statistics.median(found),
                    min(found),
                    max(found),
                )
            )
    return pandas.DataFrame(
        rows,
        columns=["bed", "cores or ranks", "gpudem [1e6/s]", "LIGGGHTS [1e6/s]", "ratio", "least", "most"],
    ).round(2)


def recorded() -> dict | None:
    """The last `gpudem bench` that was kept, with its provenance; None if there is none."""
    path = resources.files("comparisons") / "recorded" / "bench.json"
    return json.loads(path.read_text()) if path.is_file() else None


def recorded_table(part: str):
    """A function (results) -> that part of the recorded bench as a table."""

    def table(results: Results) -> pandas.DataFrame:
        data = recorded()
        if data is None:
            return pandas.DataFrame({"note": ["no recorded bench: run  gpudem bench"]})
        rows = pandas.DataFrame(data[part] or [{"note": "too few sizes"}])
        if part == "summary":
            rows = narrowed(rows)
        return rows.round(2).dropna(axis=1, how="all")

    return table


def narrowed(rows: pandas.DataFrame) -> pandas.DataFrame:
    """The summary in as many columns as a page holds: ratio with range, no device where all are one."""
    spread = [
        "" if pandas.isna(ratio) else f"{ratio:.2f} ({least:.2f} to {most:.2f})"
        for ratio, least, most in zip(rows["ratio"], rows["ratio least"], rows["ratio most"], strict=True)
    ]
    rows = rows.assign(ratio=spread)
    left_out = ["ratio least", "ratio most", "arrays [B]", "contacts"]
    left_out += ["device"] * (rows["device"].nunique() == 1)
    names = {
        "s a simulated s": "s / simulated s", "of the roofline [%]": "roofline [%]",
        "first step after [s]": "start [s]",
    }  # fmt: skip
    return rows.drop(columns=left_out).rename(columns=names)


def _recorded_caption() -> str:
    data = recorded()
    if data is None:
        return "Not recorded yet."
    p, only_cpu = data["provenance"], all(row["device"] == "cpu" for row in data["rows"])
    caption = (
        f"Recorded, not run now: {p['date']}, commit {p['commit']}, {p['hardware']['cpu']},"
        f" {p['hardware']['cores']} cores. Particle-steps per second of stepping; the ratio is to LIGGGHTS on"
        " as many ranks, in float64 whatever our precision. Bytes a step: what a step must read or write at"
        " least, a particle; by the rate and the memory bandwidth measured beforehand that is the share of"
        " the roofline. Start: of the process to its first step, with kernels compiled by an earlier run."
    )
    if only_cpu:
        caption += (
            " No GPU was at hand: the tests compile the CUDA kernels and read their registers, spills and"
            " loads; their speed is not known yet."
        )
    return caption


def draw_recorded(results: Results):
    """Rate against the number of balls, each code and precision."""
    from comparisons.report import plots

    data = recorded()
    rows = pandas.DataFrame(data["rows"] if data else [])
    figure, axes = plots.figure(1, 2, width=plots.WHOLE, height=3.4, sharey=True)
    if data is None:
        return figure
    looks = {"float64": (0, "-"), "mixed": (2, "--"), "float32": (3, ":")}
    for k, bed in enumerate(BEDS):
        part = rows[rows.state == bed]
        for key, group in part.groupby(["code", "precision", "device", "cores"]):
            code, precision, device, cores = list(key)  # pyright: ignore[reportArgumentType]
            middle = group.groupby("particles").rate.median() / 1e6
            color, line = (1, "-.") if code == "liggghts" else looks[precision]
            name = "LIGGGHTS" if code == "liggghts" else f"gpudem {precision}"
            where = device if device != "cpu" else f"{cores} core{'s' if cores > 1 else ''}"
            axes[k].semilogx(
                middle.index, middle, color=plots.SERIES[color], ls=line, marker="o" if cores > 1 else "s",
                ms=3, lw=1.2, label=f"{name}, {where}", mfc="none" if cores == 1 else None,
            )  # fmt: skip
        axes[k].set(xlabel="balls", title=f"{bed} bed")
    axes[0].set_ylabel("1e6 particle-steps / s")
    if rows.rate.max() > 100 * rows.rate.min():  # a GPU is among them
        axes[0].set_yscale("log")
    else:
        axes[0].set_ylim(bottom=0)
    plots.legend(axes[1], ncol=2, loc="lower center", fontsize=7)
    return figure


def draw(results: Results):
    from comparisons.report import plots

    groups = [(bed, n) for bed in BEDS for n in (1, 2) if ratios(results, bed, n)]
    figure, axes = plots.figure(height=3.0)
    for k, (bed, n) in enumerate(groups):
        found = ratios(results, bed, n)
        axes.plot([k] * len(found), found, **plots.style("gpudem", linestyle="none", marker="o", label=None))
    axes.axhline(1.0, **plots.style("liggghts", marker="", label="LIGGGHTS", linestyle="-"))
    axes.axhline(LEAST, color="0.5", linestyle=":", label=f"target, {LEAST}")
    axes.set_xticks(range(len(groups)), [f"{bed}\n{n} core{'s' if n > 1 else ''}" for bed, n in groups])
    axes.set_xlim(-0.5, len(groups) - 0.5)
    axes.set_ylim(bottom=0)
    axes.set_ylabel("gpudem / LIGGGHTS")
    plots.legend(axes)
    return figure


CASE = Case(
    name="speed",
    title="Speed and memory",
    purpose=(
        "Particle-steps per second of stepping alone (no start-up, compiling or output), both codes in turn"
        " on the same bed of 5000 spheres with friction and shear history, float64, on as many cores as the"
        " other has ranks. Cost per step does not depend on the modulus; cost per simulated second does."
    ),
    source="This run; other sizes from the recorded `gpudem bench`.",
    variants=variants,
    checks=tuple(_check(bed, cores) for bed in BEDS for cores in (1, 2)),
    figures=(
        Figure(
            "gpudem's speed over LIGGGHTS'",
            "One point a repeat; other programs on the machine widen the spread.",
            draw, needs=("gpudem", "liggghts"),
        ),
        Figure(
            "Recorded bench: particle-steps per second against the number of balls",
            "Squares: one core; dots: more. " + _recorded_caption(), draw_recorded,
        ),
    ),
    tables=(
        Table("Particle-steps per second, measured now", "5000 spheres, median of the repeats.", table,
              needs=("gpudem", "liggghts")),
        Table("Recorded bench", _recorded_caption(), recorded_table("summary")),
        Table(
            "Recorded bench: cost against the number of balls",
            f"Exponent k of seconds per step ~ N^k from {LARGE} balls on, least squares of the logarithms of"
            " the medians: 1 is linear; what is above is memory that no longer fits the caches.",
            recorded_table("scaling"),
        ),
        Table(
            "Recorded bench: memory of the whole process",
            "Least squares over the beds on one core: what a ball costs, and what is there before the first"
            " (Python, NumPy and Warp with its compiler; MPI for LIGGGHTS).",
            recorded_table("memory"),
        ),
    ),
    features=("speed",),
    order=90,
)  # fmt: skip
