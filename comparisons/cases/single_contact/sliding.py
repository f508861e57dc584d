"""Loss by friction in an oblique impact on a wall: Coulomb's limit mu (1 + e) v_n, and a map of the slip."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from comparisons.cases.single_contact.meetings import Meeting, exact, relative_velocity
from comparisons.harness import check_builders as build
from comparisons.harness.case import Figure, Measured, PerCode, Results, Table, largest, relative
from comparisons.oracles import closed_forms, contact_ode
from comparisons.oracles.impact import Impact
from comparisons.report import plots
from gpudem.output.run import Run

if TYPE_CHECKING:
    import pandas


def changes(results: Results, run: Run, m: Meeting) -> tuple[float, float]:
    """Change of (tangential velocity [m/s], spin [rad/s]) of a sphere on a wall, along the oracle's axes."""
    frame = exact(results, run.scene, m).frame
    velocity, spin = relative_velocity(run, m), run.trace["angular_velocity"][:, m.row]
    return float((velocity[-1] - velocity[0]) @ frame[1]), float((spin[-1] - spin[0]) @ frame[2])


def coulomb(truth: Impact, limit_force: bool) -> tuple[float, float]:
    """The same two changes for a sphere that slides all the time (closed form, lever arm R - overlap/2)."""
    push, turn = closed_forms.sliding_rebound(truth.bodies, truth.speed, truth.slip, limit_force)
    return push, -turn  # the oracle's e3 = normal x slip: spin that adds to the slip is negative


def sliding_checks(
    what: str, meetings: list[Meeting], prefix: str, limit_force: bool, tolerance: float, reason: str
) -> tuple[PerCode, ...]:
    """Per code: velocity and spin after gross sliding, largest relative error of their changes."""

    def error(results: Results, code: str, k: int) -> Measured:
        run = results[results.finest(prefix), code]
        truths = {m.label: (changes(results, run, m), exact(results, run.scene, m)) for m in meetings}
        return largest(
            {label: relative(got[k], coulomb(t, limit_force)[k]) for label, (got, t) in truths.items()}
        )

    return tuple(
        build.per_code(
            f"{what}: {quantity} in gross sliding, relative error",
            lambda results, code, k=k: error(results, code, k),
            tolerance=tolerance, against="closed form", reason=reason,
            catches="friction not capped at mu F_n, a dashpot on top of the cap, a wrong inertia",
        )
        for k, quantity in enumerate(("tangential velocity lost", "spin gained"))
    )  # fmt: skip


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
    slips = np.geomspace(0.02, 3.2, 25)

    def draw(results: Results) -> plots.Figure:
        figure, axes = plots.figure(width=plots.WHOLE, height=4.2)
        colors = iter(plots.SERIES)
        for prefix, (limit, dashpot) in options.items():
            label = results.finest(prefix)
            ran = results.codes(label)
            solved = [(m, exact(results, results[label, ran[0]].scene, m)) for m in meetings]
            for e in dict.fromkeys(t.bodies.restitution for _, t in solved):
                group, color = [(m, t) for m, t in solved if t.bodies.restitution == e], next(colors)
                truth, law = group[0][1], contact_ode.Law(True, limit, dashpot)
                unit = truth.bodies.friction * truth.speed
                lost = results.once(("map", prefix, e), lambda t=truth, law=law: _curve(t, law, slips))
                axes.semilogx(
                    slips / unit, lost / (unit * (1 + e)), color=color, label=f"{prefix}, e = {e:g}"
                )
                for code in ran:
                    got = np.array([-changes(results, results[label, code], m)[0] for m, _ in group])
                    where = [t.slip / unit for _, t in group]
                    axes.semilogx(where, got / (unit * (1 + e)), **plots.marks(code, color=color))
        axes.axhline(1, color="0.6", lw=1, ls=":")
        axes.set(xlabel="slip speed / (mu v_n)", ylabel="velocity lost / (mu (1 + e) v_n)")
        plots.legend(axes, points=results.codes())
        return figure

    return Figure(
        "Tangential velocity lost in an oblique impact",
        "Lines: the exact law; dotted: Coulomb's limit. With the default options a damped impact loses more"
        " than Coulomb's law allows: the contact pulls late in the rebound, the friction limit is mu |F_n|"
        " then too, and the dashpot is added after the limit. With limit_force on and tangential_damping off"
        " the loss is Coulomb's, for the restitution that limit_force gives.",
        draw,
    )


def rebound_table(meetings: list[Meeting], prefixes: tuple[str, ...]) -> Table:
    """Phases of each wall impact, and velocity and spin changes of the codes and the ODE."""

    def make(results: Results) -> pandas.DataFrame:
        import pandas

        rows = []
        for label, prefix in ((results.finest(prefix), prefix) for prefix in prefixes):
            for m in meetings:
                truth = exact(results, results[label, results.codes(label)[0]].scene, m)
                change = truth.contact.final - truth.contact.state(0.0)
                found = {"ODE": (change[3], change[4])}
                for code in results.codes(label):
                    found[plots.name(code)] = changes(results, results[label, code], m)
                phases = " ".join(p.mode for p in truth.contact.phases)
                row: dict[str, str | float] = {"options": prefix, "impact": m.label, "phases": phases}
                for who, (push, turn) in found.items():
                    row |= {f"{who}: velocity change [m/s]": push, f"{who}: spin change [rad/s]": turn}
                limit = truth.bodies.friction * (1 + truth.bodies.restitution) * truth.speed
                rows.append(row | {"of mu (1 + e) v_n": abs(change[3]) / limit})
        return pandas.DataFrame(rows)

    return Table("Oblique impacts on the wall", "Finest step; along the slip and about normal x slip.", make)
