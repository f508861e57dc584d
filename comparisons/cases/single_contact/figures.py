"""Figures and the table that the cases of few particles share."""

from __future__ import annotations

import numpy as np

from comparisons import kit
from comparisons.cases.single_contact.checks import normal_impacts
from comparisons.cases.single_contact.meetings import Meeting, errors, exact, relative_velocity
from comparisons.metrics.trace import observed_order
from comparisons.report import plots


def overlay(meetings: list[Meeting], prefix: str = "", component: int = 0, title: str = "") -> kit.Figure:
    """Velocity of the codes in time, and below their differences from each other and from the exact motion.

    Component 0: along the normal at the first touch, 1: along the slip.
    """
    name = ("normal", "tangential")[component]

    def draw(results: kit.Results) -> plots.Figure:
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
        low.set(xlabel="time since the contact began / contact time", xlim=(-0.1, 1.3))
        return figure

    return kit.Figure(
        title or f"{name.capitalize()} velocity through the impact",
        "Top: velocities of the codes. Bottom: the codes differ from each other by rounding, and from the"
        " exact motion by the error of the time step, which they have in common.",
        draw,
    )


def _ladder(results: kit.Results, prefix: str, code: str, m: Meeting) -> np.ndarray:
    """Columns step [s], stepping time [s], velocity error; by step."""
    runs = [results[label, code] for label in results.labels(code, prefix=prefix)]
    rows = ((r.scene.time.step, r.timing.stepping_s, errors(results, r, m)["velocity"]) for r in runs)
    return np.array(sorted(rows)).T


def of_steps(shown: list[Meeting], timed: list[Meeting], prefix: str = "") -> tuple[kit.Figure, kit.Figure]:
    """Velocity error against the time step, one line for each meeting shown, with the observed order; and
    the largest over the meetings timed against the seconds spent stepping.
    """

    def convergence(results: kit.Results) -> plots.Figure:
        figure, axes = plots.figure(height=4.2)
        ran = results.codes()
        for m, color in zip(shown, plots.SERIES, strict=False):
            for code in ran:
                step, _, error = _ladder(results, prefix, code, m)
                text = f"{m.label}: order {observed_order(step, error):.2f}" if code == ran[0] else None
                axes.loglog(step, error, **plots.line_or_marks(code, len(step), color=color, label=text))
        axes.set(xlabel="time step [s]", ylabel="largest velocity error / impact speed")
        plots.legend(axes, lines=ran, fontsize=7)
        return figure

    def work_precision(results: kit.Results) -> plots.Figure:
        series = {}
        for code in results.codes():
            _, seconds, error = np.max([_ladder(results, prefix, code, m) for m in timed], axis=0)
            series[code] = (seconds, error)
        return plots.work_precision(series, ylabel="largest velocity error / impact speed")

    return (
        kit.Figure(
            "Error against time step",
            "Largest velocity error against the exact motion. Damped impacts are first order, since the"
            " dashpot uses half-step velocities; without damping the scheme is second order.",
            convergence,
        ),
        kit.Figure(
            "Error against stepping time",
            "Run time for a given error. With so few particles this is the fixed cost of a step, not the"
            " speed of a code on a large scene.",
            work_precision, section="work_precision",
        ),
    )  # fmt: skip


def observables_table(meetings: list[Meeting], prefix: str = "") -> kit.Table:
    """Peak overlap, contact time and rebound of the finest run of each code beside the closed forms."""
    caption = "Finest time step; contact time: until the overlap is zero."
    return kit.table("Peak overlap, contact time, rebound", caption, normal_impacts(meetings, prefix))
