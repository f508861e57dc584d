"""Figures and tables of the dam break."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from comparisons.cases.dam_break import checks as dam_checks
from comparisons.cases.dam_break import scenes as dam
from comparisons.harness.case import Results
from comparisons.report import plots

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure


def seed_profiles(results: Results) -> Figure:
    """Profiles at rest of all seeds, and the difference of the means with its spread."""
    figure, (top, low) = plots.figure(2, 1, height=5.0, sharex=True, height_ratios=(1.6, 1))
    labels, means = dam_checks.seeds(results), {}
    for code in results.codes():
        curves = 1e3 * np.array([dam.heights(results, lab, code, dam.PROFILE_AT) for lab in labels])
        plots.band(top, 1e3 * dam.PROFILE_AT, curves, code)
        means[code] = curves
    if len(means) == 2:
        a, b = means["gpudem"], means["liggghts"]
        spread = np.sqrt((a.var(axis=0, ddof=1) + b.var(axis=0, ddof=1)) / len(labels))
        low.fill_between(
            1e3 * dam.PROFILE_AT, -2 * spread, 2 * spread, color="0.85", label="2 standard errors"
        )
        low.plot(
            1e3 * dam.PROFILE_AT, a.mean(axis=0) - b.mean(axis=0), color="0.2", label="gpudem - LIGGGHTS"
        )
    top.set_ylabel("height [mm]")
    low.set(xlabel="x [mm]", ylabel="difference of means [mm]")
    plots.legend(top)
    plots.legend(low)
    return figure


def gate_profiles(results: Results) -> Figure:
    """Profiles at rest of the three gates, and the differences between the codes."""
    labels = [label for label in results.labels() if label.startswith("gate")]
    figure, axes = plots.figure(
        2, len(labels), width=plots.WHOLE, height=4.6, sharex=True, sharey="row", height_ratios=(1.6, 1)
    )
    x = 1e3 * dam.PROFILE_AT
    for (top, low), label in zip(axes.T, labels, strict=True):
        curves = {c: 1e3 * dam.heights(results, label, c, dam.PROFILE_AT) for c in results.codes(label)}
        for code, curve in curves.items():
            top.plot(x, curve, **plots.style(code, markevery=3))
        if len(curves) == 2:
            low.plot(x, curves["gpudem"] - curves["liggghts"], color="0.2")
        limit = 1e3 * dam.PAPER_HEIGHT_ERROR
        for level in (-limit, limit):
            low.axhline(level, **plots.TOLERANCE)
        top.set_title(results[label, next(iter(curves))].scene.title.split(",")[0])
        low.set_xlabel("x [mm]")
    axes[0, 0].set_ylabel("height [mm]")
    axes[1, 0].set_ylabel("gpudem - LIGGGHTS [mm]")
    plots.legend(axes[0, 0])
    return figure


def flow(results: Results) -> Figure:
    """Kinetic energy and front in time, all seeds."""
    figure, (top, low) = plots.figure(2, 1, height=5.0, sharex=True)
    for code in results.codes():
        for k, label in enumerate(dam_checks.seeds(results)):
            run = results[label, code]
            time = run.history["time"] - dam.opening(run)
            energy = run.history["kinetic_energy"] + run.history["rotational_energy"]
            look = plots.style(code, marker="", linestyle="-" if code == "gpudem" else "--", linewidth=1)
            look["label"] = look["label"] if k == 0 else None
            top.plot(time, 1e3 * energy, **look)
            low.plot(time, 1e3 * run.history["front_x"], **look)
    low.axvline(dam.MEASURED_ARRIVAL, color="0.4", lw=0.9, ls=":", label="far wall: experiment")
    low.axvline(dam.PAPER_ARRIVAL, color="0.4", lw=0.9, ls="-.", label="far wall: paper's simulation")
    top.set_ylabel("kinetic energy [mJ]")
    low.set(xlabel="time since the gate went [s]", ylabel="centre of the first ball [mm]", xlim=(-0.05, None))
    plots.legend(top)
    plots.legend(low)
    return figure


def rounding(results: Results) -> Figure:
    """How far apart the centres of mass of the two codes are in time, for every variant."""
    figure, axes = plots.figure(width=plots.WHOLE)
    for label in results.labels("liggghts"):
        time, distance = dam_checks.apart(results, label)
        axes.semilogy(time, np.maximum(distance, 1e-18), lw=1, label=label)
    axes.axvline(dam.EARLY, color="0.4", lw=0.9, ls=":")
    axes.set(xlabel="time from the start [s]", ylabel="distance of centres of mass [m]")
    plots.legend(axes, ncols=2)
    return figure


def sweep(results: Results) -> Figure:
    """Time to the far wall against ball friction."""
    figure, axes = plots.figure()
    for code in results.codes():
        axes.plot(*np.array(dam_checks.arrivals(results, code)).T, **plots.style(code, marker="o"))
        spread = np.array([dam.arrival(results[label, code]) for label in dam_checks.seeds(results)])
        plots.points(axes, [dam.BALL_FRICTION], [spread.mean()], code, error=[2 * spread.std(ddof=1)])
    axes.axhline(dam.MEASURED_ARRIVAL, color="0.4", lw=0.9, ls=":", label="experiment")
    axes.axhline(dam.PAPER_ARRIVAL, color="0.4", lw=0.9, ls="-.", label="paper's simulation")
    axes.set(xlabel="ball friction", ylabel="time to the far wall [s]")
    plots.legend(axes)
    return figure


def metrics_table(results: Results) -> pandas.DataFrame:
    """Every metric: mean and spread of each code, difference, its bound, p before and after correction."""
    import pandas

    rows = [
        (name, c.mean[0], c.spread[0], c.mean[1], c.spread[1], c.difference, c.half_width, c.p, p)
        for name, (c, p) in dam_checks.compared(results).items()
    ]
    columns = [
        "metric",
        "gpudem",
        "spread",
        "LIGGGHTS",
        "spread ",
        "difference",
        "+- (95 %)",
        "p (Welch)",
        "p (corrected)",
    ]
    return pandas.DataFrame(rows, columns=columns)


def bed_table(results: Results) -> pandas.DataFrame:
    """The settled column of every run before the gate goes."""
    import pandas

    rows = []
    for (label, code), run in results.runs.items():
        found = dam.bed(run)
        row = (
            label,
            code,
            1e3 * found["height"],
            found["solid fraction"],
            found["contacts"],
            dam.arrival(run),
        )
        rows.append(row)
    columns = ["run", "by", "height [mm]", "solid fraction", "contacts per ball", "time to the far wall [s]"]
    return pandas.DataFrame(rows, columns=columns)
