"""Figures and the table that the cases of few particles share."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from comparisons.cases.single_contact.checks import CODES
from comparisons.cases.single_contact.meetings import Meeting, errors, exact, observables, relative_velocity
from comparisons.harness.case import Figure, Results, Table
from comparisons.metrics import trace as measure
from comparisons.oracles import closed_forms
from comparisons.report import plots

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure as MatplotlibFigure


def overlay(meetings: list[Meeting], prefix: str = "", component: int = 0, title: str = "") -> Figure:
    """Velocity of both codes in time, and below their differences from each other and the exact motion.

    Component 0: along the normal at the first touch, 1: along the slip.
    """
    name = ("normal", "tangential")[component]

    def draw(results: Results) -> MatplotlibFigure:
        figure, (top, low) = plots.figure(
            2, 1, width=plots.WHOLE, height=5.4, sharex=True, height_ratios=(1.5, 1)
        )
        label = results.finest(prefix)
        time = results[label, "gpudem"].trace["time"]
        for k, m in enumerate(meetings):
            truth = exact(results, results[label, "gpudem"].scene, m)
            scale, curves = float(np.hypot(truth.speed, truth.slip)), {}
            since = (time - truth.touch) / truth.contact.duration
            for code in results.codes(label):
                run = results[label, code]
                curves[code] = relative_velocity(run, m) @ truth.frame[component] / scale
                thin = slice(None, None, max(1, len(since) // 25)) if code != "gpudem" else slice(None)
                style, text = ("-", m.label) if code == "gpudem" else ("o", None)
                top.plot(since[thin], curves[code][thin], style, color=plots.SERIES[k], ms=3, label=text)
            at = truth.at(time)["velocity"]
            relative = at[:, 0] - (at[:, 1] if len(m.rows) > 1 else 0)
            late = curves["gpudem"] - relative @ truth.frame[component] / scale
            low.semilogy(since, _floor(late), "--", color=plots.SERIES[k])
            if len(curves) > 1:
                low.semilogy(since, _floor(curves["gpudem"] - curves["liggghts"]), "-", color=plots.SERIES[k])
        top.set_ylabel(f"{name} velocity / impact speed")
        low.set_ylabel("difference")
        low.set_xlabel("time since the first touch / contact time")
        low.set_xlim(-0.1, 1.3)
        low.set_title("solid: gpudem - LIGGGHTS, dashed: gpudem - ODE", fontsize=9)
        plots.legend(top, ncols=2)
        return figure

    return Figure(
        title or f"{name.capitalize()} velocity through the impact",
        "Above: gpudem (lines) on LIGGGHTS (dots). Below: the codes differ from each other by rounding,"
        " and both differ from the exact motion by the error of the time step, which they share.",
        draw, needs=CODES,
    )  # fmt: skip


def _floor(difference: np.ndarray) -> np.ndarray:
    return np.maximum(np.abs(difference), 1e-18)


def convergence(meetings: list[Meeting], prefix: str = "") -> Figure:
    """Velocity error against the time step, one line per meeting and code, with the observed order."""

    def draw(results: Results) -> MatplotlibFigure:
        figure, axes = plots.figure(height=4.2)
        for k, m in enumerate(meetings):
            for code in results.codes():
                rows = _ladder(results, prefix, code, m)
                slope = measure.observed_order(rows[:, 0], rows[:, 2])
                line, text = ("-", f"{m.label}: order {slope:.2f}") if code == "gpudem" else ("o", None)
                axes.loglog(rows[:, 0], rows[:, 2], line, color=plots.SERIES[k], label=text, mfc="none")
        axes.set(xlabel="time step [s]", ylabel="largest velocity error / impact speed")
        plots.legend(axes)
        return figure

    return Figure(
        "Error against time step",
        "gpudem (lines) and LIGGGHTS (circles) against the exact motion. A dashpot that sees half-step"
        " velocities makes damped impacts first order; without damping the scheme is second order.",
        draw,
    )  # fmt: skip


def work_precision(meetings: list[Meeting], prefix: str = "") -> Figure:
    """Velocity error, largest over the meetings, against the seconds spent stepping."""

    def draw(results: Results) -> MatplotlibFigure:
        series = {}
        for code in results.codes():
            rows = np.max([_ladder(results, prefix, code, m) for m in meetings], axis=0)
            series[code] = (rows[:, 1], rows[:, 2])
        return plots.work_precision(series, ylabel="largest velocity error / impact speed")

    return Figure(
        "Error against stepping time",
        "What a given error costs. With so few particles a step costs its fixed overhead alone, so that"
        " this shows the overhead of a step, not the speed of either code on a large scene.",
        draw, section="work_precision",
    )  # fmt: skip


def _ladder(results: Results, prefix: str, code: str, m: Meeting) -> np.ndarray:
    """Rows of (step [s], stepping time [s], velocity error), by step."""
    rows = []
    for label in results.labels(prefix=prefix):
        run = results[label, code]
        rows.append((run.scene.time.step, run.timing.stepping_s, errors(results, run, m)["velocity"]))
    return np.array(sorted(rows))


def observables_table(meetings: list[Meeting], prefix: str = "", limit_force: bool = False) -> Table:
    """Peak overlap, contact time and rebound of the finest run of each code beside the closed forms."""

    def make(results: Results) -> pandas.DataFrame:
        import pandas

        rows, label = [], results.finest(prefix)
        for m in meetings:
            truth = exact(results, results[label, results.codes(label)[0]].scene, m)
            want = (
                1e6 * closed_forms.peak_overlap(truth.bodies, truth.speed),
                1e6 * closed_forms.contact_time(truth.bodies, truth.speed, limit_force),
                closed_forms.restitution(truth.bodies, limit_force),
            )
            rows.append((m.label, "closed form", *want))
            for code in results.codes(label):
                got = observables(results, results[label, code], m)
                rows.append(
                    (m.label, code, 1e6 * got["peak_overlap"], 1e6 * got["contact_time"], got["rebound"])
                )
        return pandas.DataFrame(
            rows, columns=["impact", "by", "peak overlap [um]", "time to zero overlap [us]", "rebound [1]"]
        )

    return Table("Peak overlap, contact time, rebound", "The finest time step beside the closed forms.", make)
