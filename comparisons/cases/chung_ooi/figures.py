"""Figures of the Chung and Ooi tests as in the paper: exact line, published points, experiment, codes."""

from __future__ import annotations

from typing import Any

import numpy as np

from comparisons import kit
from comparisons.cases.chung_ooi.checks import curve
from comparisons.cases.chung_ooi.scenes import Test, published
from comparisons.report import plots

#: Published points: squares and triangles by material, in a color that no code has.
POINTS = ({"marker": "s"}, {"marker": "^"})
READ = {"color": "#009e73", "linestyle": "none", "markersize": 4.5, "markerfacecolor": "none", "zorder": 6}


def by_code(code: str) -> dict[str, Any]:
    """A code's marks in its own color."""
    return plots.marks(code, color=plots.color(code), label=plots.name(code))


def curves(
    test: Test, prefix: str, title: str, caption: str, quantities: dict[str, tuple[str, str, str]],
    columns: dict[str, dict[str, str]], sliding: str = "", **fields: Any,
) -> kit.Figure:  # fmt: skip
    """One panel a quantity (-> table, x label, y label) with a curve a material: ODE line, codes, published.

    columns: material -> {column of the table: label}; a column a table lacks is left out. `sliding`: the
    quantity that has a line for gross sliding of the rigid sphere.
    """

    def draw(results: kit.Results) -> plots.Figure:
        figure, axes = plots.figure(1, len(quantities), width=plots.WHOLE, height=3.6, squeeze=False)
        label = results.finest(prefix)
        runs = {code: results[label, code] for code in results.codes(label)}
        truth = test.exact_outcome(results, next(iter(runs.values())))
        for ax, (quantity, (table, xlabel, ylabel)) in zip(axes[0], quantities.items(), strict=True):
            for code, run in runs.items():
                for material in test.materials:
                    ax.plot(*curve(test, test.outcome(run), material, quantity), **by_code(code))
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
            if quantity == sliding:
                _sliding_line(ax, test)
            ax.set(xlabel=xlabel, ylabel=ylabel)
        plots.legend(axes[0, -1], fontsize=7.5)
        return figure

    return kit.Figure(title, caption, draw, **fields)


def _sliding_line(ax: plots.Axes, test: Test) -> None:
    """Gross sliding of the rigid sphere in the axes of T5 and T6, (x - 7/2 mu (1 + e))/e."""
    e = test.balls[0].stated
    limit = 3.5 * (1 + e) * (test.friction if test.number == 6 else 1.0)
    x = np.array([limit, ax.get_xlim()[1]])
    ax.plot(x, (x - limit) / e, color="0.5", lw=1, ls=":", label="slides throughout")


def finals_table(test: Test, prefix: str, **fields: Any) -> kit.Table:
    """v_n', v_t' and R w' of the finest run of each code beside the ODE."""

    def observe(results: kit.Results, code: str) -> dict[str, dict[str, tuple[float, float]]]:
        run, scale = results[results.finest(prefix), code], (1.0, 1.0, test.radius)
        got, want = test.outcome(run) * scale, test.exact_outcome(results, run) * scale
        names = ("v_n' [m/s]", "v_t' [m/s]", "R w' [m/s]")
        return {
            name: {b.what: (got[row, k], want[row, k]) for row, b in enumerate(test.balls)}
            for k, name in enumerate(names)
        }

    title = f"Test {test.number}: motion after impact"
    return kit.table(title, "Finest step.", observe, reference="exact", **fields)
