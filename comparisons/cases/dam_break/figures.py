"""Figures and tables of the dam break."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from comparisons import kit
from comparisons.cases import over_seeds
from comparisons.cases.dam_break import checks
from comparisons.cases.dam_break import scenes as dam
from comparisons.harness import codes
from comparisons.report import plots

X = 1e3 * dam.PROFILE_AT


def paper_lines(line: Callable[..., Any], prefix: str = "") -> None:
    """Lines that figures share: the time to the far wall that the paper measured, and that it simulated."""
    for time, dash, label in (
        (dam.MEASURED_ARRIVAL, ":", "experiment"), (dam.PAPER_ARRIVAL, "-.", "paper's simulation")
    ):  # fmt: skip
        line(time, color="0.4", lw=0.9, ls=dash, label=prefix + label)


def fronts(axes: Any, results: kit.Results, prefix: str, look: Callable[[str], dict[str, Any]]) -> None:
    """The first ball in time, in the runs whose label starts with `prefix`, and the times of the paper."""
    for code in results.codes():
        for label in results.labels(code, prefix=prefix):
            run = results[label, code]
            axes.plot(dam.kinetic(run)[0], 1e3 * run.history["front_x"], **look(code))
    paper_lines(axes.axvline, "far wall: ")
    axes.set(
        xlabel="time after the gate is removed [s]",
        ylabel="center of the first ball [mm]",
        xlim=(-0.05, None),
    )


def _differences(axes: Any, curves: dict[str, np.ndarray]) -> None:
    for a, b in codes.pairs(list(curves)):
        axes.plot(X, curves[a] - curves[b], color="0.2", label=f"{plots.name(a)} - {plots.name(b)}")
    axes.set(xlabel="x [mm]")


def seed_profiles(results: kit.Results) -> plots.Figure:
    """Profiles at rest of all seeds, and the difference of the means with its standard error."""
    figure, (top, low) = plots.figure(2, 1, height=5.0, sharex=True, height_ratios=(1.6, 1))
    curves = {}
    for code in results.codes():
        labels = results.labels(code, prefix="seed")
        curves[code] = 1e3 * np.array([dam.heights(results, label, code) for label in labels])
        plots.band(top, X, curves[code], code)
    for pair in codes.pairs(list(curves)):
        error = np.sqrt(sum(curves[c].var(axis=0, ddof=1) / len(curves[c]) for c in pair))
        low.fill_between(X, -2 * error, 2 * error, color="0.85", label="2 standard errors")
    _differences(low, {code: curve.mean(axis=0) for code, curve in curves.items()})
    top.set_ylabel("height [mm]")
    low.set_ylabel("difference of means [mm]")
    plots.legend(top, low)
    return figure


def gate_profiles(results: kit.Results) -> plots.Figure:
    """Profiles at rest of the three gates, and the differences between the codes."""
    labels, limit = results.labels(prefix="gate"), 1e3 * dam.PAPER_HEIGHT_ERROR
    figure, axes = plots.figure(
        2, len(labels), width=plots.WHOLE, height=4.6, sharex=True, sharey="row", height_ratios=(1.6, 1)
    )
    for (top, low), label in zip(axes.T, labels, strict=True):
        curves = {c: 1e3 * dam.heights(results, label, c) for c in results.codes(label)}
        for code, curve in curves.items():
            top.plot(X, curve, **plots.style(code, markevery=3))
        _differences(low, curves)
        for level in (-limit, limit):
            low.axhline(level, **plots.TOLERANCE)
        top.set_title(results[label, next(iter(curves))].scene.title.split(",")[0])
    axes[0, 0].set_ylabel("height [mm]")
    axes[1, 0].set_ylabel("difference [mm]")
    plots.legend(axes[0, 0], axes[1, 0])
    return figure


def flow(results: kit.Results) -> plots.Figure:
    """Kinetic energy and front in time, all seeds."""
    figure, (top, low) = plots.figure(2, 1, height=5.0, sharex=True)

    def look(code: str) -> dict[str, Any]:
        return plots.style(code, marker="", linestyle="-" if code == "gpudem" else "--", linewidth=1)

    for code in results.codes():
        for label in results.labels(code, prefix="seed"):
            time, energy = dam.kinetic(results[label, code])
            top.plot(time, 1e3 * energy, **look(code))
    fronts(low, results, "seed", look)
    top.set_ylabel("kinetic energy [mJ]")
    plots.legend(top, low)
    return figure


def rounding(results: kit.Results) -> plots.Figure:
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


def sweep(results: kit.Results) -> plots.Figure:
    """Time to the far wall against ball friction."""
    figure, axes = plots.figure()
    for code in results.codes():
        axes.plot(*np.array(checks.arrivals(results, code)).T, **plots.style(code, marker="o"))
        labels = results.labels(code, prefix="seed")
        times = np.array([dam.arrival(results[label, code]) for label in labels])
        plots.points(axes, [dam.BALL_FRICTION], [times.mean()], code, error=[2 * times.std(ddof=1)])
    paper_lines(axes.axhline)
    axes.set(xlabel="ball friction", ylabel="time to the far wall [s]")
    plots.legend(axes)
    return figure


def metrics_table(results: kit.Results) -> kit.Rows:
    """Every metric: mean and spread of each code, difference, its interval, p before and after correction."""
    return [
        row
        for a, b in codes.pairs(results.codes())
        for row in over_seeds.rows(checks.compared(results, a, b), plots.name(a), plots.name(b))
    ]


def bed_table(results: kit.Results) -> kit.Rows:
    """The settled column of every run before the gate is removed."""
    return [
        {"run": label, "code": plots.name(code), "height [mm]": 1e3 * bed["height"],
         "solid fraction": bed["solid fraction"], "contacts per ball": bed["contacts"],
         "time to the far wall [s]": dam.arrival(run)}
        for (label, code), run in results.runs.items() for bed in [dam.bed(run)]
    ]  # fmt: skip
