"""The figure and the table of the encounters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from comparisons.cases.encounters.checks import Encounters, errors, exact, overlap, present
from comparisons.cases.encounters.scenes import Encounter
from comparisons.harness.case import Figure, Results, Table
from comparisons.report import plots
from gpudem.output.run import Run

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure as MatplotlibFigure


def _partner(other: int | str) -> str:
    return other if isinstance(other, str) else f"ball {other + 1}"


def through(label: str, encounters: Sequence[Encounter], title: str, exactly: bool = True) -> Figure:
    """Overlaps, speed and spin in time: one column for each encounter, every code, and the exact motion."""

    def draw(results: Results) -> MatplotlibFigure:
        figure, axes = plots.figure(
            3, len(encounters), width=plots.WHOLE, height=5.8, sharex=True, squeeze=False
        )
        for column, encounter in zip(axes.T, encounters, strict=True):
            column[0].set_title(encounter.what)
            row = encounter.meetings[0][0]
            for code in results.codes(label):
                run = results[label, code]
                time, radius = 1e6 * run.trace["time"], run.scene.state.radius[row]
                look = plots.style(code, markevery=max(1, len(time) // 30))
                for m in dict.fromkeys((m.row, m.other) for m in encounter.contacts):
                    meeting = next(c for c in encounter.contacts if (c.row, c.other) == m)
                    deep = np.where(present(run, meeting), 1e6 * overlap(run, meeting), np.nan)
                    column[0].plot(time, deep, **look)
                for axis, values in zip(column[1:], _shown(dict(run.trace or {}), row, radius), strict=True):
                    axis.plot(time, values, **look)
            if exactly:
                run = results[label, results.codes(label)[0]]
                at = exact(results, run.scene, encounter).at(row, run.trace["time"])
                at = {name: values[:, None] for name, values in at.items()}
                shown = _shown(at, 0, run.scene.state.radius[row])
                for axis, values in zip(column[1:], shown, strict=True):
                    axis.plot(1e6 * run.trace["time"], values, **plots.style("oracle"))
            column[-1].set_xlabel("time [us]")
        for axis, text in zip(axes[:, 0], ("overlaps [um]", "speed [m/s]", "R x spin [m/s]"), strict=True):
            axis.set_ylabel(text)
        plots.legend(axes[1, 0])
        return figure

    return Figure(
        title,
        "Overlaps of all contacts of the first ball and its partner, then speed and spin of that ball; the"
        f" codes over one another{', and the exact motion' if exactly else ''}.",
        draw,
    )


def _shown(trace: dict[str, np.ndarray], row: int, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Speed and R x spin [m/s] of a row."""
    speed, spin = (np.linalg.norm(trace[c][:, row], axis=-1) for c in ("velocity", "angular_velocity"))
    return speed, radius * spin


def table(of: Encounters, exactly: bool = True) -> Table:
    """One row for each encounter: its contacts, stick and slip by the oracle, errors of the codes."""

    def make(results: Results) -> pandas.DataFrame:
        import pandas

        rows = []
        for label, encounters in of.items():
            codes = results.codes(label)
            for encounter in encounters:
                first = results[label, codes[0]]
                row: dict[str, str | float] = {
                    "scene": label,
                    "encounter": encounter.what,
                    "contacts [us]": _contacts(first, encounter),
                }
                if exactly:
                    parts = exact(results, first.scene, encounter).impacts
                    row["stick and slip"] = " | ".join(
                        " ".join(phase.mode for phase in part.contact.phases) for _, part in parts
                    )
                    for code in codes:
                        found = errors(results, results[label, code], encounter).value
                        row[f"{plots.name(code)}: error / impact speed"] = found
                rows.append(row)
        return pandas.DataFrame(rows)

    return Table(
        "Encounters",
        "Contacts as the first code has them; stick and slip of each by the ODE, from touch to separation.",
        make,
    )


def _contacts(run: Run, encounter: Encounter) -> str:
    """Each contact of an encounter, in order: `ball 1 on floor 6.6-66.2, ball 1 on ceiling 78.2-138.0`."""
    time, found = 1e6 * run.trace["time"], []
    for m in {(m.row, m.other): m for m in encounter.contacts}.values():
        inside = np.concatenate([[False], present(run, m), [False]])
        edges = np.flatnonzero(np.diff(inside.astype(int)))
        who = f"ball {m.row + 1} on {_partner(m.other)}"
        found += [(time[a], f"{who} {time[a]:.1f}-{time[b - 1]:.1f}") for a, b in edges.reshape(-1, 2)]
    return ", ".join(text for _, text in sorted(found))
