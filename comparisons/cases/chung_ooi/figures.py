"""Figures of the Chung and Ooi tests as in the paper: exact line, published points, experiment, codes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from comparisons.cases.chung_ooi.checks import curve, exact_outcome, outcome
from comparisons.cases.chung_ooi.normal_checks import force_history
from comparisons.cases.chung_ooi.scenes import Test, published
from comparisons.cases.single_contact.meetings import exact
from comparisons.harness import check_builders as build
from comparisons.harness.case import Figure, Measured, Results, Table
from comparisons.report import plots

#: Published points: squares and triangles by material, in a color that no code has.
POINTS = ({"marker": "s"}, {"marker": "^"})
READ = {"color": "#009e73", "linestyle": "none", "markersize": 4.5, "markerfacecolor": "none", "zorder": 6}


def _points(code: str) -> dict[str, Any]:
    """A code's marks in its own color."""
    return plots.marks(code, color=plots.color(code), label=plots.name(code))


def force(test: Test, prefix: str, table: str) -> Figure:
    """Normal force in time and against overlap, of the first material."""

    def draw(results: Results) -> plots.Figure:
        figure, axes = plots.figure(1, 2, width=plots.WHOLE, height=3.4)
        label = results.finest(prefix)
        ran = results.codes(label)
        for k, b in enumerate(test.balls):
            for code in ran:
                time, deep, f = force_history(results, results[label, code], test, k)
                inside = deep > 0
                look = plots.line_or_marks(
                    code, sum(inside), color=plots.color(code), label=plots.name(code), lw=1.8
                )
                for ax, x in zip(axes, (time, deep), strict=True):
                    ax.plot(1e6 * x[inside], 1e-3 * f[inside], **look)
            truth = exact(results, results[label, ran[0]].scene, test.meetings()[k])
            since = np.linspace(0, truth.contact.duration, 200)
            states = [truth.contact.state(t) for t in since]
            deep = np.array([state[5] - state[0] for state in states])  # displacements along the first normal
            f = truth.bodies.normal_constant * np.maximum(deep, 0) ** 1.5
            axes[0].plot(1e6 * since, 1e-3 * f, **plots.style("oracle"))
            axes[1].plot(1e6 * deep, 1e-3 * f, **plots.style("oracle"))
            place = (1e6 * since[np.argmax(f)], 1e-3 * f.max())
            options = {"xytext": (0, 3), "textcoords": "offset points", "ha": "center", "fontsize": 8}
            axes[0].annotate(b.what, place, **options)
        names = {"time": "time since the touch [us]", "displacement": "overlap [um]"}
        for ax, (name, xlabel) in zip(axes, names.items(), strict=True):
            points = np.array(published()[f"T{test.number}_{table}_force_{name}"]["data"])
            ax.plot(*points.T, **READ, **POINTS[0], label=f"published, {test.balls[0].what}")
            ax.set(xlabel=xlabel, ylabel="normal force [kN]")
        plots.legend(axes[1])
        return figure

    return Figure(
        f"Test {test.number}: normal force",
        "Force in time and against overlap: Hertz (black), the codes, and points read from the paper's"
        " figure. Loading and unloading are one line: e = 1.",
        draw,
    )


def restitution(test: Test, prefix: str) -> Figure:
    """Restitution out against restitution in."""

    def draw(results: Results) -> plots.Figure:
        figure, (top, low) = plots.figure(2, 1, height=4.6, sharex=True, height_ratios=(1.5, 1))
        label = results.finest(prefix)
        put_in = np.array([b.restitution for b in test.balls])
        top.plot((0, 1), (0, 1), **plots.style("oracle", label="e out = e in"))
        for code in results.codes(label):
            out = outcome(results[label, code], test)[:, 0] / [b.normal for b in test.balls]
            top.plot(put_in, out, **_points(code))
            low.semilogy(put_in, np.maximum(np.abs(out - put_in), 1e-18), **_points(code))
        low.axhline(1e-3, **plots.TOLERANCE, label="tolerance")
        top.set_ylabel("restitution out")
        low.set(xlabel="restitution in", ylabel="|difference|")
        plots.legend(top)
        return figure

    return Figure(
        f"Test {test.number}: restitution",
        "The restitution that comes out is the one put in, for both materials; the difference is the error of"
        " the time step, which the codes have in common.",
        draw,
    )


def curves(
    test: Test, prefix: str, title: str, caption: str, quantities: dict[str, tuple[str, str, str]],
    columns: dict[str, dict[str, str]], extra: dict[str, Callable[[plots.Axes], Any]] | None = None,
    **fields: Any,
) -> Figure:  # fmt: skip
    """One panel a quantity (-> table, x label, y label) with a curve a material: ODE line, codes, published.

    columns: material -> {column of the table: label}; a column a table lacks is left out. `extra` draws more
    into the panel of a quantity.
    """

    def draw(results: Results) -> plots.Figure:
        figure, axes = plots.figure(1, len(quantities), width=plots.WHOLE, height=3.6, squeeze=False)
        label = results.finest(prefix)
        ran = results.codes(label)
        truth = exact_outcome(results, results[label, ran[0]], test)
        for ax, (quantity, (table, xlabel, ylabel)) in zip(axes[0], quantities.items(), strict=True):
            for code in ran:
                got = outcome(results[label, code], test)
                for material in test.names:
                    ax.plot(*curve(test, got, material, quantity), **_points(code))
            for k, (material, wanted) in enumerate(columns.items()):
                text = f"exact law, {material.replace('_', ' ')}"
                look = plots.style("oracle", linestyle=("-", "--")[k], label=text)
                ax.plot(*curve(test, truth, material, quantity), **look)
                for column, name in wanted.items():
                    points = np.array(published()[table].get(column, []))
                    if len(points) and "Kharaz" in column:
                        plots.points(ax, points[:, 0], points[:, 1], "experiment", label=name)
                    elif len(points):
                        color = {"color": "#cc79a7"} if "FEM" in column else {}
                        ax.plot(*points.T, **{**READ, **color}, **POINTS[k], label=name)
            if extra and quantity in extra:
                extra[quantity](ax)
            ax.set(xlabel=xlabel, ylabel=ylabel)
        plots.legend(axes[0, -1], fontsize=7.5)
        return figure

    return Figure(title, caption, draw, **fields)


def options(tests: dict[str, tuple[Test, str]], material: str, quantity: str, table: str) -> Figure:
    """One of the curves of one material under several options of the law (prefix -> test, name), by the ODE
    and the codes.
    """

    def draw(results: Results) -> plots.Figure:
        figure, axes = plots.figure(width=plots.WHOLE, height=4.2)
        shown = {prefix: test for prefix, test in tests.items() if results.labels(prefix=prefix)}
        for (prefix, (test, name)), color in zip(shown.items(), plots.SERIES, strict=False):
            label = results.finest(prefix)
            ran = results.codes(label)
            truth = exact_outcome(results, results[label, ran[0]], test)
            axes.semilogx(*curve(test, truth, material, quantity), color=color, lw=1.2, label=name)
            for code in ran:
                x, y = curve(test, outcome(results[label, code], test), material, quantity)
                axes.semilogx(x, y, **plots.marks(code, color=color))
        points = np.array(published()[table]["Al_alloy"])
        axes.semilogx(*points.T, **{**READ, "color": plots.INK}, **POINTS[0], label="published")
        x = np.linspace(0.17, 1.6, 20)
        axes.semilogx(x, x - 1, color="0.5", lw=1, ls=":", label="rigid sphere that slides: X - 1")
        axes.set(xlabel="X = 7/2 mu (1 + e) v_n / v_s", ylabel="tangential restitution of the surface, beta")
        axes.set_ylim(-0.95, 0.75)
        plots.legend(axes, points=results.codes())
        return figure

    return Figure(
        "Test 6: effect of the options of the law",
        "Lines: exact law. For X < 1 the contact slides, and all points should be on the dotted line. The"
        " default loses up to 18 % more than Coulomb's law allows, since the friction limit is mu |F_n| also"
        " while the contact pulls. With limit_force on and the tangential dashpot off it obeys Coulomb's law,"
        " but 0.55 comes out where 0.5 was put in; with 0.435 put in, 0.5 comes out, and the line is the"
        " paper's. For X > 1, where the contact sticks, the published points are nearest to limit_force with"
        " the dashpot.",
        draw,
    )


def finals_table(test: Test, prefix: str, **fields: Any) -> Table:
    """v_n', v_t' and R w' of the finest run of each code beside the ODE."""

    def finals(results: Results, code: str, k: int) -> dict[str, Measured]:
        run, scale = results[results.finest(prefix), code], (1.0, 1.0, test.radius)[k]
        rows = zip(test.balls, outcome(run, test)[:, k], exact_outcome(results, run, test)[:, k], strict=True)
        return {b.what: Measured(scale * abs(got - want), scale * got, scale * want) for b, got, want in rows}

    return build.table(
        f"Test {test.number}: motion after impact", "Finest step.",
        {name: lambda results, code, k=k: finals(results, code, k)
         for k, name in enumerate(("v_n' [m/s]", "v_t' [m/s]", "R w' [m/s]"))},
        reference="exact", **fields,
    )  # fmt: skip


def sliding_line(test: Test) -> Callable[[plots.Axes], Any]:
    """Gross sliding of the rigid sphere in the axes of T5 and T6, (x - 7/2 mu (1 + e))/e."""
    b = test.balls[0]
    limit = 3.5 * (1 + b.stated) * (test.friction if test.number == 6 else 1.0)

    def draw(ax: plots.Axes) -> None:
        x = np.array([limit, ax.get_xlim()[1]])
        ax.plot(x, (x - limit) / b.stated, color="0.5", lw=1, ls=":", label="slides throughout")

    return draw
