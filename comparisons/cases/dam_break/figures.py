"""Figures and tables of the dam break."""

from __future__ import annotations

from typing import Any

import numpy as np

from comparisons.cases.dam_break import checks
from comparisons.cases.dam_break import scenes as dam
from comparisons.harness import codes
from comparisons.harness.case import Results
from comparisons.report import plots

#: Lines that the figures share: what the paper measured, and what it simulated.
PAPER = ((dam.MEASURED_ARRIVAL, ":", "experiment"), (dam.PAPER_ARRIVAL, "-.", "paper's simulation"))
X = 1e3 * dam.PROFILE_AT


def seed_profiles(results: Results) -> plots.Figure:
    """Profiles at rest of all seeds, and the difference of the means with its standard error."""
    figure, (top, low) = plots.figure(2, 1, height=5.0, sharex=True, height_ratios=(1.6, 1))
    curves = {}
    for code in results.codes():
        labels = results.labels(code, prefix="seed")
        curves[code] = 1e3 * np.array([dam.heights(results, lab, code, dam.PROFILE_AT) for lab in labels])
        plots.band(top, X, curves[code], code)
    for a, b in codes.pairs(list(curves)):
        error = np.sqrt(sum(curves[c].var(axis=0, ddof=1) / len(curves[c]) for c in (a, b)))
        low.fill_between(X, -2 * error, 2 * error, color="0.85", label="2 standard errors")
        difference = curves[a].mean(axis=0) - curves[b].mean(axis=0)
        low.plot(X, difference, color="0.2", label=f"{plots.name(a)} - {plots.name(b)}")
    top.set_ylabel("height [mm]")
    low.set(xlabel="x [mm]", ylabel="difference of means [mm]")
    plots.legend(top, low)
    return figure


def gate_profiles(results: Results) -> plots.Figure:
    """Profiles at rest of the three gates, and the differences between the codes."""
    labels = results.labels(prefix="gate")
    figure, axes = plots.figure(
        2, len(labels), width=plots.WHOLE, height=4.6, sharex=True, sharey="row", height_ratios=(1.6, 1)
    )
    limit = 1e3 * dam.PAPER_HEIGHT_ERROR
    for (top, low), label in zip(axes.T, labels, strict=True):
        curves = {c: 1e3 * dam.heights(results, label, c, dam.PROFILE_AT) for c in results.codes(label)}
        for code, curve in curves.items():
            top.plot(X, curve, **plots.style(code, markevery=3))
        for a, b in codes.pairs(list(curves)):
            low.plot(X, curves[a] - curves[b], color="0.2", label=f"{plots.name(a)} - {plots.name(b)}")
        for level in (-limit, limit):
            low.axhline(level, **plots.TOLERANCE)
        top.set_title(results[label, next(iter(curves))].scene.title.split(",")[0])
        low.set_xlabel("x [mm]")
    axes[0, 0].set_ylabel("height [mm]")
    axes[1, 0].set_ylabel("difference [mm]")
    plots.legend(axes[0, 0], axes[1, 0])
    return figure


def flow(results: Results) -> plots.Figure:
    """Kinetic energy and front in time, all seeds."""
    figure, (top, low) = plots.figure(2, 1, height=5.0, sharex=True)
    for code in results.codes():
        for label in results.labels(code, prefix="seed"):
            table, line = results[label, code].history, "-" if code == "gpudem" else "--"
            look = plots.style(code, marker="", linestyle=line, linewidth=1)
            time = table["time"] - dam.opening(results[label, code])
            top.plot(time, 1e3 * (table["kinetic_energy"] + table["rotational_energy"]), **look)
            low.plot(time, 1e3 * table["front_x"], **look)
    for time, dash, label in PAPER:
        low.axvline(time, color="0.4", lw=0.9, ls=dash, label=f"far wall: {label}")
    top.set_ylabel("kinetic energy [mJ]")
    low.set(xlabel="time after the opening [s]", ylabel="center of the first ball [mm]", xlim=(-0.05, None))
    plots.legend(top, low)
    return figure


def rounding(results: Results) -> plots.Figure:
    """Distance of the centers of mass of two codes in time, for every variant."""
    figure, axes = plots.figure(width=plots.WHOLE)
    pairs = codes.pairs(results.codes())
    for a, b in pairs:
        suffix = f", {plots.name(a)} and {plots.name(b)}" if len(pairs) > 1 else ""
        for label, time, distance in checks.distances(results, a, b):
            axes.semilogy(time, np.maximum(distance, 1e-18), lw=1, label=label + suffix)
    axes.axvline(dam.EARLY, color="0.4", lw=0.9, ls=":")
    axes.set(xlabel="time from the start [s]", ylabel="distance of centers of mass [m]")
    plots.legend(axes, ncols=2)
    return figure


def sweep(results: Results) -> plots.Figure:
    """Time to the far wall against ball friction."""
    figure, axes = plots.figure()
    for code in results.codes():
        axes.plot(*np.array(checks.arrivals(results, code)).T, **plots.style(code, marker="o"))
        labels = results.labels(code, prefix="seed")
        times = np.array([dam.arrival(results[label, code]) for label in labels])
        plots.points(axes, [dam.BALL_FRICTION], [times.mean()], code, error=[2 * times.std(ddof=1)])
    for time, dash, label in PAPER:
        axes.axhline(time, color="0.4", lw=0.9, ls=dash, label=label)
    axes.set(xlabel="ball friction", ylabel="time to the far wall [s]")
    plots.legend(axes)
    return figure


def metrics_table(results: Results) -> list[dict[str, Any]]:
    """Every metric: mean and spread of each code, difference, its interval, p before and after correction."""
    return [
        {"metric": name, plots.name(a): c.mean[0], "standard deviation": c.spread[0],
         plots.name(b): c.mean[1], "standard deviation ": c.spread[1], "difference": c.difference,
         "+- (95 %)": c.half_width, "p (Welch)": c.p, "p (corrected)": p}
        for a, b in codes.pairs(results.codes())
        for name, (c, p) in checks.compared(results, a, b).items()
    ]  # fmt: skip


def bed_table(results: Results) -> list[dict[str, Any]]:
    """The settled column of every run before the gate is removed."""
    rows = []
    for (label, code), run in results.runs.items():
        bed = dam.bed(run)
        row = {"run": label, "code": plots.name(code), "height [mm]": 1e3 * bed["height"]}
        row |= {"solid fraction": bed["solid fraction"], "contacts per ball": bed["contacts"]}
        rows.append(row | {"time to the far wall [s]": dam.arrival(run)})
    return rows
