"""MFIX-DEM's verification cases DEM01 to DEM05: drop, bounces, compressed column, slip, oblique impact."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from comparisons import kit
from comparisons.cases.mfix import scenes as mfix
from comparisons.cases.single_contact.meetings import errors, exact
from comparisons.metrics.trace import slip_end
from comparisons.oracles import closed_forms
from comparisons.oracles.linear import Bouncer, hard_sphere_top, squeezed_column
from comparisons.report import plots
from gpudem.output.run import Run

#: (stiffness [N/m], restitution) of each sphere.
Rows = tuple[tuple[float, float], ...]
#: DEM02: (duration, time step) [s]; errors of first order add up from bounce to bounce.
BOUNCING = {"standard": (2.0, 2e-6), "full": (10.0, 1e-6)}


def variants(tier: kit.Tier) -> list[kit.Variant]:
    scenes = [
        mfix.falls("dem01", mfix.FALLS, 2e-5, 0.5, 1e-3), mfix.column(), mfix.throws(), mfix.pellets()
    ]  # fmt: skip
    if tier in kit.LONG:
        duration, step = BOUNCING[tier]
        scenes.append(mfix.falls("dem02", mfix.BOUNCES, step, duration, 2e-3))
    return [kit.Variant(s.name, s) for s in scenes]


# -- measures: {what is compared: error, with the value of the code and the value expected} -----------------


def bouncer(stiffness: float, restitution: float) -> Bouncer:
    """The exact motion of one sphere of DEM01 or DEM02."""
    return Bouncer(mfix.MASS, stiffness, restitution, mfix.GRAVITY, mfix.DROP)


def title(stiffness: float, restitution: float) -> str:
    return f"k = {stiffness:g} N/m, e = {restitution:g}"


def heights(results: kit.Results, code: str, name: str, rows: Rows) -> dict[str, float]:
    """Largest difference of the height from the exact one over the trace, by the drop."""
    trace, found = results[name, code].trace, {}
    for k, row in enumerate(rows):
        gap, _ = bouncer(*row).at(trace["time"])
        off = np.abs(trace["position"][:, k, 2] - mfix.BALL - gap).max() / mfix.DROP
        found[title(*row)] = float(off)
    return found


def speed_after(results: kit.Results, code: str) -> dict[str, tuple[float, float]]:
    """DEM01: velocity of the rebound, relative error; from the first row after it."""
    trace, found = results["dem01", code].trace, {}
    for k, row in enumerate(mfix.FALLS):
        leave = bouncer(*row).phases(0.5)[2]
        after = int(np.argmax(trace["time"] > leave.start + 1e-3))
        got = float(trace["velocity"][after, k, 2]) + mfix.GRAVITY * (trace["time"][after] - leave.start)
        found[title(*row)] = got, leave.speed
    return found


def first_top(run: Run, row: int) -> float:
    """Height of the lowest point [m] at the top of the first flight, from energy: z + v^2/(2 g)."""
    z = run.trace["position"][:, row, 2] - mfix.BALL
    v = run.trace["velocity"][:, row, 2]
    turn = np.flatnonzero((v[:-1] > 0) & (v[1:] <= 0) & (z[:-1] > 0))[0]
    return float(z[turn] + v[turn] ** 2 / (2 * mfix.GRAVITY))


def hard_limit(results: kit.Results, code: str) -> kit.Measured:
    """Slope of log(distance from the hard sphere) in log(k) for e < 1: -1/2, as contact time ~ k^-1/2."""
    run, slopes = results["dem02", code], []
    for e in mfix.RESTITUTIONS[1:]:
        tops = [first_top(run, mfix.BOUNCES.index((k, e))) for k in mfix.STIFFNESSES]
        off = np.abs(np.array(tops) / hard_sphere_top(mfix.DROP, e, 1) - 1)
        slopes.append(float(np.polyfit(np.log(mfix.STIFFNESSES), np.log(off), 1)[0]))
    return kit.Measured(
        max(slopes, key=lambda s: abs(s + 0.5)),
        note=f"{len(slopes)} restitutions, the one with the largest deviation",
    )


def column(results: kit.Results, time: np.ndarray, restitution: float) -> np.ndarray:
    """DEM03: exact heights of both spheres."""
    masses = [mfix.sphere_mass(mfix.GRAIN, d) for d in mfix.DENSITIES]
    return results.once(
        ("column", restitution),
        lambda: squeezed_column(
            time, mfix.HEIGHTS, mfix.GRAIN, masses, mfix.ROOF, mfix.SPRING, restitution, mfix.GRAVITY
        ),
    )


def squeezed(results: kit.Results, code: str) -> dict[str, float]:
    """DEM03: largest difference of a height from the exact one, by the first overlap with the floor."""
    trace, found = results["dem03", code].trace, {}
    for k, e in enumerate(mfix.RESTITUTIONS):
        off = trace["position"][:, 2 * k : 2 * k + 2, 2] - column(results, trace["time"], e)
        found[f"e = {e:g}"] = float(np.abs(off).max()) / (mfix.GRAIN - mfix.HEIGHTS[0])
    return found


def slipping(results: kit.Results, code: str) -> dict[str, tuple[float, float]]:
    """DEM04: end of slip, and speed and R x spin, means over the rolling."""
    trace, found, final = results["dem04", code].trace, {}, 5 / 7 * mfix.THROW
    time = trace["time"]
    for k, mu in enumerate(mfix.FRICTIONS):
        speed, surface = trace["velocity"][:, k, 0], mfix.GRAIN * trace["angular_velocity"][:, k, 1]
        end = slip_end(time, speed - surface)
        late = time > end + 0.3 * (time[-1] - end)
        found[f"end of slip, mu = {mu:g}"] = end, closed_forms.slip_time(mfix.THROW, mu, mfix.GRAVITY)
        found[f"speed, mu = {mu:g}"] = float(speed[late].mean()), final
        found[f"R x spin, mu = {mu:g}"] = float(surface[late].mean()), final
    return found


def pellet_errors(results: kit.Results, code: str) -> dict[str, float]:
    """DEM05: largest velocity or spin error against the ODE, by the impact speed."""
    found = {m.label: errors(results, results["dem05", code], m) for m in mfix.MEETINGS}
    return {label: max(e["velocity"], e["angular_velocity"]) for label, e in found.items()}


def pellet(run: Run, row: int) -> dict[str, float]:
    """DEM05: how one sphere rebounds."""
    v, w = run.trace["velocity"][:, row], run.trace["angular_velocity"][-1, row]
    angle = math.degrees(math.atan2(v[-1, 0], v[-1, 2]))
    values = angle, float(v[-1, 0] / v[0, 0]), abs(float(w[1]))
    return dict(zip(("rebound angle [deg]", "restitution [1]", "spin [rad/s]"), values, strict=True))


def published(results: kit.Results, code: str) -> dict[str, dict[str, kit.Compared]]:
    """DEM05: how each sphere rebounds, beside what MFIX-DEM prints."""
    found = {}
    for angle, printed in mfix.PUBLISHED.items():
        got = pellet(results["dem05", code], mfix.ANGLES.index(angle))
        for quantity, want in zip(got, printed, strict=True):
            found.setdefault(quantity, {})[f"{angle:g} deg"] = got[quantity], want
    return found


def all_published(results: kit.Results, code: str) -> dict[str, kit.Compared]:
    """DEM05: all quantities of all spheres."""
    columns = published(results, code)
    return {f"{name} at {angle}": m for name, found in columns.items() for angle, m in found.items()}


# -- checks ------------------------------------------------------------------------------------------------

FIRST_ORDER = "the dashpot uses half-step velocities: first order, and below this at the step used"
#: (name, measure, reason, what it would catch, tiers); tolerance 1e-3.
ANALYTICAL: tuple[tuple[str, Any, str, str, tuple[kit.Tier, ...]], ...] = (
    ("DEM01: height, largest error over the fall, contact and rebound / drop",
     lambda r, c: heights(r, c, "dem01", mfix.FALLS), FIRST_ORDER,
     "a stiffness of hooke that is not k; a damping that does not give e; no gravity during contact",
     kit.TIERS),
    ("DEM01: velocity of the rebound, relative error", speed_after, FIRST_ORDER,
     "a contact that ends early or late, 1 % of damping", kit.TIERS),
    ("DEM02: height, largest error over all bounces / drop",
     lambda r, c: heights(r, c, "dem02", mfix.BOUNCES),
     FIRST_ORDER + "; errors of the bounces add up, by e = 0.9 over three of them",
     "energy gained or lost in a contact, which grows from bounce to bounce", kit.LONG),
    ("DEM03: heights, largest error over time / first overlap", squeezed, FIRST_ORDER,
     "an effective mass of pair or wall; a contact force that is not opposite", kit.TIERS),
    ("DEM04: end of slip, final speed and R x spin, relative error", slipping,
     "0.1 % is required; MFIX reaches 0.57 % and 0.04 %",
     "friction other than mu N; a moment of inertia other than 2/5 m R^2", kit.TIERS),
    ("DEM05: velocity and R x spin, largest error / impact speed", pellet_errors,
     "1300 steps per contact; without damping the error is of second order except where slip begins",
     "a tangential stiffness other than 8 G* sqrt(R* d): the angles below 25 degrees stick", kit.TIERS),
)  # fmt: skip


def _top_speed(run: Run) -> float:
    return float(np.linalg.norm(run.trace["velocity"], axis=-1).max())


CHECKS = (
    *(
        kit.step_by_step(
            f"{name}, largest difference over all traces", column, scale,
            tolerance=1e-9, reason="same law, same scheme: rounding, over up to a million steps",
            catches="hooke with other constants, a bounce that starts a step late",
        )
        for name, column, scale in (
            ("position / radius", "position", lambda run: run.scene.state.radius[0]),
            ("velocity / top speed", "velocity", _top_speed),
            ("R x angular velocity / top speed", "angular_velocity",
             lambda run: _top_speed(run) / run.scene.state.radius[0]),
        )
    ),
    *(
        kit.per_code(
            name, measure, tolerance=1e-3, reason=reason, catches=catches, tiers=tiers,
            against="ODE (DOP853, rtol 1e-13)" if "DEM05" in name else "closed form",
        )
        for name, measure, reason, catches, tiers in ANALYTICAL
    ),
    kit.per_code(
        "DEM02: power of k with which bounce 1 tends to the hard sphere's e^2 h", hard_limit,
        lo=-0.53, tolerance=-0.47, against="closed form", tiers=kit.LONG,
        reason="-1/2 to leading order; the next term, 1/k, is a few per cent of it at k = 5e4 N/m",
        catches="a loss that does not vanish in the hard limit",
    ),
    kit.per_code(
        "DEM05: rebound angle, restitution and spin, relative difference", all_published,
        tolerance=0.01, against="MFIX-DEM, AUTOTEST of DEM05", mark="P",
        reason="MFIX takes the arm R, LIGGGHTS' law R - overlap/2 (0.2 % of the spin), and its own step",
        catches="another tangential stiffness: 2/3 of it changes the rebound angle at 10 degrees by 18 %",
    ),
)  # fmt: skip


# -- figure ------------------------------------------------------------------------------------------------


def _drop_axes(axes: plots.Axes, results: kit.Results, name: str, rows: Rows, only: float) -> None:
    """Height in time of the spheres of one stiffness: exact, and the codes' marks."""
    time = results[name, results.codes(name)[0]].trace["time"]
    for k, (stiffness, e) in enumerate(rows):
        if stiffness == only:
            gap, _ = bouncer(stiffness, e).at(time)
            found = {c: results[name, c].trace["position"][:, k, 2] for c in results.codes(name)}
            color = plots.SERIES[mfix.RESTITUTIONS.index(e)]
            plots.exact_and_marks(axes, time, gap + mfix.BALL, found, color, f"e = {e:g}")
    title = f"{name.upper()}, k = {only:g} N/m"
    axes.set(xlabel="time [s]", ylabel="height of the center [m]", title=title)


def _column_axes(axes: plots.Axes, results: kit.Results) -> None:
    """DEM03: height of the upper sphere."""
    ran = results.codes("dem03")
    time = results["dem03", ran[0]].trace["time"]
    for k, e in enumerate(mfix.RESTITUTIONS):
        if e in (1.0, 0.7, 0.5):
            found = {code: results["dem03", code].trace["position"][:, 2 * k + 1, 2] for code in ran}
            exact_height = column(results, time, e)[:, 1]
            plots.exact_and_marks(axes, time, exact_height, found, plots.SERIES[k], f"e = {e:g}")
    axes.set(xlabel="time [s]", ylabel="height of the upper sphere [m]", title="DEM03")
    axes.margins(y=0.18)
    plots.legend(axes, loc="lower right", ncols=3)


def _pellet_axes(axes: plots.Axes, results: kit.Results) -> None:
    """DEM05: rebound angle."""
    ran = results.codes("dem05")
    solved = [exact(results, results["dem05", ran[0]].scene, m) for m in mfix.MEETINGS]
    ode = [math.degrees(math.atan2(-t.contact.final[3], t.contact.final[2])) for t in solved]
    axes.plot(mfix.ANGLES, np.abs(ode), **plots.style("oracle"))
    for code in ran:
        found = [pellet(results["dem05", code], k) for k in range(len(mfix.ANGLES))]
        angles = [one["rebound angle [deg]"] for one in found]
        axes.plot(mfix.ANGLES, angles, **plots.marks(code, color=plots.color(code), label=plots.name(code)))
    printed = [p[0] for p in mfix.PUBLISHED.values()]
    axes.plot(list(mfix.PUBLISHED), printed, "+", color="#009e73", ms=11, label="MFIX-DEM")
    axes.set(xlabel="impact angle [deg]", ylabel="rebound angle of the center [deg]", title="DEM05")
    plots.legend(axes)


def _figure(results: kit.Results) -> plots.Figure:
    figure, axes = plots.figure(2, 2, width=plots.WHOLE, height=6.6)
    _drop_axes(axes[0, 0], results, "dem01", mfix.FALLS, 1e4)
    plots.legend(axes[0, 0], points=results.codes(), loc="lower left")
    long = "dem02" in results.labels()
    second = ("dem02", mfix.BOUNCES, 5e4) if long else ("dem01", mfix.FALLS, 1e5)
    _drop_axes(axes[0, 1], results, *second)
    _column_axes(axes[1, 0], results)
    _pellet_axes(axes[1, 1], results)
    return figure


CASE = kit.Case(
    name="mfix_dem", title="MFIX-DEM's verification cases DEM01 to DEM05",
    purpose="The verification cases of another public code, with its numbers, over ranges of parameters: a"
    " sphere dropped on a floor (19 pairs of stiffness and restitution), its repeated bounces (18, against"
    " the exact motion and the limit of hard spheres), two spheres compressed between floor and roof (6), a"
    " sphere thrown along a floor (9 frictions), and alumina spheres on glass at 8 angles. The first four"
    " have linear springs, here `hooke` with the Young's modulus that gives k; the fifth has the Hertz law."
    " MFIX' linear variant of DEM05 cannot be stated: it has k_t = 0.86 k_n, hooke has k_t = k_n.",
    source="MFIX-DEM tests/dem/DEM01 to DEM05 (set-ups, analytic solutions, AUTOTEST results); Kharaz,"
    " Gorham and Salman, Powder Technol. 120 (2001) 281.",
    variants=variants,
    checks=CHECKS,
    figures=(kit.Figure(
        "DEM01, DEM02, DEM03 and DEM05",
        "Lines: exact; plus signs: MFIX-DEM's own results. With soft springs the overlap reaches a tenth"
        " of a meter, and the rebound is lower than that of a hard sphere.",
        _figure,
    ),),
    tables=(kit.table(
        "DEM05 beside MFIX-DEM's printed results", "Hertz law, sphere on wall.", published,
        reference="MFIX-DEM",
    ),),
    features=(
        "normal hooke", "normal hertz", "damping", "gravity", "wall plane", "several materials",
        "sphere-sphere", "tangential history", "rotation",
    ), order=60,
)  # fmt: skip
