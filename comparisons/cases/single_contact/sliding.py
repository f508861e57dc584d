"""What friction takes in an oblique impact on a wall: against Coulomb's line mu (1 + e) v_n, and as a map
of slip.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from comparisons.cases.single_contact.checks import CODES
from comparisons.cases.single_contact.meetings import Meeting, exact, relative_velocity
from comparisons.harness.case import Check, Figure, Measured, Results, Table
from comparisons.oracles import closed_forms, contact_ode
from comparisons.oracles.impact import Impact
from comparisons.report import plots
from gpudem.output.run import Run

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure as MatplotlibFigure


def changes(results: Results, run: Run, m: Meeting) -> tuple[float, float]:
    """Change of (tangential velocity [m/s], spin [rad/s]) of a sphere on a wall, along the oracle's axes."""
    frame = exact(results, run.scene, m).frame
    velocity, spin = relative_velocity(run, m), run.trace["angular_velocity"][:, m.row]
    return float((velocity[-1] - velocity[0]) @ frame[1]), float((spin[-1] - spin[0]) @ frame[2])


def line(truth: Impact, limit_force: bool) -> tuple[float, float]:
    """The same two changes for a sphere that slides all the time (closed form, lever arm R - overlap/2)."""
    push, turn = closed_forms.sliding_rebound(truth.bodies, truth.speed, truth.slip, limit_force)
    return push, -turn  # the oracle's e3 = normal x slip: spin that adds to the slip is negative


def sliding_checks(
    what: str, meetings: list[Meeting], prefix: str, limit_force: bool, tolerance: float, reason: str
) -> tuple[Check, ...]:
    """Per code: velocity and spin out of gross sliding, largest relative error of their changes."""

    def value(results: Results, code: str, k: int) -> Measured:
        run = results[results.finest(prefix), code]
        rows = []
        for m in meetings:
            truth = exact(results, run.scene, m)
            rows.append((changes(results, run, m)[k], line(truth, limit_force)[k], m.label))
        got, want, label = max(rows, key=lambda row: abs(row[0] / row[1] - 1))
        return Measured(abs(got / want - 1), got, want, note=f"largest at {label}")

    names = ("tangential velocity lost", "spin gained")
    return tuple(
        Check(
            name=f"{what}: {names[k]} in gross sliding, relative error ({code})",
            measure=lambda results, code=code, k=k: value(results, code, k),
            tolerance=tolerance,
            unit="1",
            against="closed form",
            mark="A",
            needs=(code,),
            reason=reason,
            catches="friction not capped at mu F_n, a dashpot on top of the cap, a wrong inertia",
        )
        for code in CODES
        for k in (0, 1)
    )


def _curve(truth: Impact, law: contact_ode.Law, slips: np.ndarray) -> np.ndarray:
    """Tangential velocity lost [m/s] for each slip speed, by the ODE."""
    lost = []
    for slip in slips:
        start = np.zeros(11)
        start[2], start[3] = -truth.speed, slip
        lost.append(slip - contact_ode.solve(truth.bodies, law, start, rtol=1e-10).final[3])
    return np.array(lost)


def rebound_map(meetings: list[Meeting], options: dict[str, tuple[bool, bool]]) -> Figure:
    """Velocity lost to friction against the slip at impact; options: prefix -> (limit_force,
    tangential_damping).
    """

    def draw(results: Results) -> MatplotlibFigure:
        figure, axes = plots.figure(width=plots.WHOLE, height=4.2)
        slips = np.geomspace(0.02, 3.2, 25)
        color = 0
        for prefix, (limit, dashpot) in options.items():
            label = results.finest(prefix)
            scene = results[label, results.codes(label)[0]].scene
            solved = [(m, exact(results, scene, m)) for m in meetings]
            for e in dict.fromkeys(t.bodies.restitution for _, t in solved):
                group = [(m, t) for m, t in solved if t.bodies.restitution == e]
                truth = group[0][1]
                unit = truth.bodies.friction * truth.speed
                law = contact_ode.Law(True, limit, dashpot)
                key = ("map", prefix, e)
                lost = results.once(key, lambda t=truth, law=law: _curve(t, law, slips))
                axes.semilogx(
                    slips / unit,
                    lost / (unit * (1 + e)),
                    color=plots.SERIES[color],
                    label=f"{prefix}, e = {e:g}",
                )
                for code, mark in zip(CODES, ("x", "o"), strict=True):
                    if code not in results.codes(label):
                        continue
                    points = [
                        -changes(results, results[label, code], m)[0] / (unit * (1 + e)) for m, _ in group
                    ]
                    where = [t.slip / unit for _, t in group]
                    axes.semilogx(
                        where, points, mark, color=plots.SERIES[color], mfc="none", ms=9 if mark == "o" else 6
                    )
                color += 1
        axes.axhline(1, color="0.6", lw=1, ls=":")
        axes.set(xlabel="slip speed / (mu v_n)", ylabel="velocity lost / (mu (1 + e) v_n)")
        plots.legend(axes)
        return figure

    return Figure(
        "What friction takes from an oblique impact",
        "Lines: the exact law; crosses: gpudem; circles: LIGGGHTS. The dotted line is Coulomb's limit."
        " With the default options a damped impact takes more than friction may: the contact pulls late in"
        " the rebound, the friction goes by |F_n| then too, and the dashpot comes on top of the cap."
        " Cutting the pull (limit_force) and the tangential dashpot brings it to the limit for the"
        " restitution that limit_force leaves.",
        draw,
    )  # fmt: skip


def rebound_table(meetings: list[Meeting], prefixes: tuple[str, ...]) -> Table:
    """Phases of each wall impact, and velocity and spin changes of both codes and the ODE."""

    def make(results: Results) -> pandas.DataFrame:
        import pandas

        rows = []
        for prefix in prefixes:
            label = results.finest(prefix)
            for m in meetings:
                truth = exact(results, results[label, results.codes(label)[0]].scene, m)
                final, first = truth.contact.final, truth.contact.state(0.0)
                phases = " ".join(p.mode for p in truth.contact.phases)
                row: dict[str, str | float] = {"options": prefix, "impact": m.label, "phases": phases}
                row["ODE: velocity change [m/s]"] = final[3] - first[3]
                row["ODE: spin change [rad/s]"] = final[4] - first[4]
                for code in results.codes(label):
                    push, turn = changes(results, results[label, code], m)
                    row[f"{code}: velocity change [m/s]"], row[f"{code}: spin change [rad/s]"] = push, turn
                row["of mu (1 + e) v_n"] = abs(final[3] - first[3]) / (
                    truth.bodies.friction * (1 + truth.bodies.restitution) * truth.speed
                )
                rows.append(row)
        return pandas.DataFrame(rows)

    return Table("Oblique impacts on the wall", "Finest step; along the slip and about normal x slip.", make)
