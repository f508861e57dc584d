"""Figures and the table that the cases of few particles share."""

from __future__ import annotations

import numpy as np

from comparisons.cases.single_contact.checks import closed_form_errors
from comparisons.cases.single_contact.meetings import (
    Meeting,
    errors,
    exact,
    relative_velocity,
)
from comparisons.harness import check_builders as build
from comparisons.harness.case import Figure, Results, Table
from comparisons.metrics import trace as measure
from comparisons.report import plots


def overlay(meetings: list[Meeting], prefix: str = "", component: int = 0, title: str = "") -> Figure:
    """Velocity of the codes in time, and below their differences from each other and from the exact motion.

    Component 0: along the normal at the first touch, 1: along the slip.
    """
    name = ("normal", "tangential")[component]

    def draw(results: Results) -> plots.Figure:
        label, since, curves = results.finest(prefix), {}, {}
        ran = results.codes(label)
        time = results[label, ran[0]].trace["time"]
        for m in meetings:
            truth = exact(results, results[label, ran[0]].scene, m)
            direction = truth.frame[component] / float(np.hypot(truth.speed, truth.slip))
            at = truth.at(time)["velocity"]
            wanted = (at[:, 0] - (at[:, 1] if len(m.rows) > 1 else 0)) @ direction
            found = {code: relative_velocity(results[label, code], m) @ direction for code in ran}
            since[m.label] = (time - truth.touch) / truth.contact.duration
            curves[m.label] = found, wanted
        figure, top, low = plots.curves_and_differences(since, curves, reference="ODE", width=plots.WHOLE)
        top.set_ylabel(f"{name} velocity / impact speed")
        low.set(xlabel="time since the first touch / contact time", xlim=(-0.1, 1.3))
        return figure

    return Figure(
        title or f"{name.capitalize()} velocity through the impact",
        "Top: velocities of the codes. Bottom: the codes differ from each other by rounding, and from the"
        " exact motion by the error of the time step, which they have in common.",
        draw,
    )


def convergence(meetings: list[Meeting], prefix: str = "") -> Figure:
    """Velocity error against the time step, one line per meeting and code, with the observed order."""

    def draw(results: Results) -> plots.Figure:
        figure, axes = plots.figure(height=4.2)
        ran = results.codes()
        for k, m in enumerate(meetings):
            for code in ran:
                rows = _ladder(results, prefix, code, m)
                order = measure.observed_order(rows[:, 0], rows[:, 2])
                text = f"{m.label}: order {order:.2f}" if code == ran[0] else None
                look = plots.line_or_marks(code, len(rows), color=plots.SERIES[k], label=text)
                axes.loglog(rows[:, 0], rows[:, 2], **look)
        axes.set(xlabel="time step [s]", ylabel="largest velocity error / impact speed")
        plots.legend(axes, lines=ran, fontsize=7)
        return figure

    return Figure(
        "Error against time step",
        "Largest velocity error against the exact motion. Damped impacts are first order, since the dashpot"
        " sees half-step velocities; without damping the scheme is second order.",
        draw,
    )


def work_precision(meetings: list[Meeting], prefix: str = "") -> Figure:
    """Velocity error, largest over the meetings, against the seconds spent stepping."""

    def draw(results: Results) -> plots.Figure:
        series = {}
        for code in results.codes():
            rows = np.max([_ladder(results, prefix, code, m) for m in meetings], axis=0)
            series[code] = (rows[:, 1], rows[:, 2])
        return plots.work_precision(series, ylabel="largest velocity error / impact speed")

    return Figure(
        "Error against stepping time",
        "Run time for a given error. With so few particles this is the fixed cost of a step, not the speed of"
        " a code on a large scene.",
        draw, section="work_precision",
    )  # fmt: skip


def _ladder(results: Results, prefix: str, code: str, m: Meeting) -> np.ndarray:
    """Rows of (step [s], stepping time [s], velocity error), by step."""
    runs = [results[label, code] for label in results.labels(code, prefix=prefix)]
    return np.array(
        sorted((r.scene.time.step, r.timing.stepping_s, errors(results, r, m)["velocity"]) for r in runs)
    )


def observables_table(meetings: list[Meeting], prefix: str = "", limit_force: bool = False) -> Table:
    """Peak overlap, contact time and rebound of the finest run of each code beside the closed forms."""
    names = {"peak_overlap": "peak overlap [m]", "contact_time": "contact time [s]", "rebound": "rebound [1]"}
    return build.table(
        "Peak overlap, contact time, rebound", "Finest time step; contact time: until the overlap is zero.",
        {name: closed_form_errors(meetings, key, limit_force, prefix) for key, name in names.items()},
    )  # fmt: skip
