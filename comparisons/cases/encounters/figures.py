"""The figure and the table of the encounters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from comparisons import kit
from comparisons.cases.encounters.checks import errors, exact, present
from comparisons.cases.encounters.throws import Encounter, Encounters
from comparisons.cases.single_contact.meetings import Meeting, overlap
from comparisons.report import plots
from gpudem.output.run import Run


def _meetings(encounter: Encounter) -> dict[tuple[int, int | str], Meeting]:
    """Each two that meet, once."""
    return {(m.row, m.other): m for m in encounter.contacts}


def through(label: str, encounters: Sequence[Encounter], title: str, exactly: bool = True) -> kit.Figure:
    """Overlaps, speed and spin in time: one column for each encounter, every code, and the exact motion."""

    def draw(results: kit.Results) -> plots.Figure:
        figure, axes = plots.figure(
            3, len(encounters), width=plots.WHOLE, height=5.8, sharex=True, squeeze=False
        )
        runs = {code: results[label, code] for code in results.codes(label)}
        first = results[label, results.codes(label)[0]]
        scene, seconds = first.scene, first.trace["time"]
        for (top, speed, spin), encounter in zip(axes.T, encounters, strict=True):
            row = encounter.meetings[0][0]
            drawn = {
                code: (run.trace["time"], {c: run.trace[c][:, row] for c in ("velocity", "angular_velocity")})
                for code, run in runs.items()
            }
            if exactly:
                drawn["oracle"] = seconds, exact(results, scene, encounter).at(row, seconds)
            for who, (time, moved) in drawn.items():
                look = plots.style(who, markevery=max(1, len(time) // 30))
                for meeting in _meetings(encounter).values() if who in runs else ():
                    deep = np.where(present(runs[who], meeting), overlap(runs[who], meeting), np.nan)
                    top.plot(1e6 * time, 1e6 * deep, **look)
                speed.plot(1e6 * time, np.linalg.norm(moved["velocity"], axis=-1), **look)
                turning = scene.state.radius[row] * np.linalg.norm(moved["angular_velocity"], axis=-1)
                spin.plot(1e6 * time, turning, **look)
            top.set_title(encounter.what)
            spin.set_xlabel("time [us]")
        for axis, text in zip(axes[:, 0], ("overlaps [um]", "speed [m/s]", "R x spin [m/s]"), strict=True):
            axis.set_ylabel(text)
        plots.legend(axes[1, 0])
        return figure

    return kit.Figure(
        title,
        "Top: overlaps of all contacts of the first ball and its partner. Below: its speed, and radius times"
        f" angular velocity. The curves of the codes coincide{', and the exact motion' if exactly else ''}.",
        draw,
    )


def table(of: Encounters) -> kit.Table:
    """One row for each encounter: its contacts, stick and slip by the oracle, errors of the codes."""

    def make(results: kit.Results) -> kit.Rows:
        rows = []
        for label, encounter in ((label, e) for label, encounters in of.items() for e in encounters):
            codes = results.codes(label)
            first = results[label, codes[0]]
            parts = exact(results, first.scene, encounter).impacts
            modes = (" ".join(phase.mode for phase in part.contact.phases) for _, part in parts)
            found = {code: errors(results, results[label, code], encounter).value for code in codes}
            row = {"scene": label, "encounter": encounter.what, "contacts [us]": _contacts(first, encounter)}
            row["stick and slip"] = " | ".join(modes)
            rows.append(row | {f"{plots.name(c)}: error / impact speed": error for c, error in found.items()})
        return rows

    return kit.Table(
        "Encounters",
        "Contacts in the run of the first code; stick and slip phases of each by the ODE, from its beginning"
        " to separation.",
        make,
    )


def _contacts(run: Run, encounter: Encounter) -> str:
    """Each contact of an encounter, in order: `ball 1 on floor 6.6-66.2, ball 1 on ceiling 78.2-138.0`."""
    time, found = 1e6 * run.trace["time"], []
    for (row, other), meeting in _meetings(encounter).items():
        edges = np.flatnonzero(np.diff(np.concatenate([[False], present(run, meeting), [False]]).astype(int)))
        who = f"ball {row + 1} on {other if isinstance(other, str) else f'ball {other + 1}'}"
        found += [(time[a], f"{who} {time[a]:.1f}-{time[b - 1]:.1f}") for a, b in edges.reshape(-1, 2)]
    return ", ".join(text for _, text in sorted(found))
