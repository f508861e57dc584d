"""MFIX-DEM's verification cases DEM01 to DEM05: drop, bounces, squeezed column, slipping, oblique impact."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from comparisons.cases.mfix import scenes as mfix
from comparisons.cases.single_contact.checks import CODES
from comparisons.cases.single_contact.meetings import errors, exact
from comparisons.harness.case import Case, Check, Figure, Measured, Results, Table, Tier, Variant
from comparisons.metrics.trace import largest_difference
from comparisons.oracles import closed_forms
from comparisons.oracles.linear import Bouncer, hard_sphere_top, squeezed_column
from comparisons.report import plots
from gpudem.output.run import Run

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as MatplotlibFigure

LONG: tuple[Tier, ...] = ("standard", "full")
#: DEM02: (duration, time step) [s]; errors of first order add up from bounce to bounce.
BOUNCING = {"standard": (2.0, 2e-6), "full": (10.0, 1e-6)}


def variants(tier: Tier) -> list[Variant]:
    scenes = [
        mfix.falls("dem01", mfix.FALLS, 2e-5, 0.5, 1e-3), mfix.column(), mfix.throws(), mfix.pellets()
    ]  # fmt: skip
    if tier in LONG:
        duration, step = BOUNCING[tier]
        scenes.append(mfix.falls("dem02", mfix.BOUNCES, step, duration, 2e-3))
    return [Variant(s.name, s) for s in scenes]


# -- measures: (value got, value wanted, label) of everything that is compared -----------------------------


def bouncer(stiffness: float, restitution: float) -> Bouncer:
    """The exact motion of one sphere of DEM01 or DEM02."""
    return Bouncer(mfix.MASS, stiffness, restitution, mfix.GRAVITY, mfix.DROP)


def path(results: Results, code: str, name: str, rows: tuple[tuple[float, float], ...]) -> Measured:
    """Largest difference of the height from the exact one over the trace, by the drop."""
    trace, found = results[name, code].trace, []
    for k, (stiffness, e) in enumerate(rows):
        gap, _ = bouncer(stiffness, e).at(trace["time"])
        off = np.abs(trace["position"][:, k, 2] - mfix.BALL - gap).max() / mfix.DROP
        found.append((float(off), f"k = {stiffness:g} N/m, e = {e:g}"))
    return Measured(max(found)[0], note=f"{len(rows)} spheres; largest at {max(found)[1]}")


def speed_after(results: Results, code: str) -> Measured:
    """DEM01: velocity of the rebound, largest relative error; from the first row after it."""
    trace, rows = results["dem01", code].trace, []
    for k, (stiffness, e) in enumerate(mfix.FALLS):
        leave = bouncer(stiffness, e).phases(0.5)[2]
        after = int(np.argmax(trace["time"] > leave.start + 1e-3))
        got = float(trace["velocity"][after, k, 2]) + mfix.GRAVITY * (trace["time"][after] - leave.start)
        rows.append((abs(got / leave.speed - 1), got, leave.speed, f"k = {stiffness:g} N/m, e = {e:g}"))
    value, got, want, label = max(rows)
    return Measured(value, got, want, f"largest at {label}")


def tops(run: Run, row: int) -> list[float]:
    """Height of the lowest point [m] at the top of each flight, from energy in the trace: z + v^2/(2 g)."""
    z = run.trace["position"][:, row, 2] - mfix.BALL
    v = run.trace["velocity"][:, row, 2]
    turns = np.flatnonzero((v[:-1] > 0) & (v[1:] <= 0) & (z[:-1] > 0))
    return [float(z[k] + v[k] ** 2 / (2 * mfix.GRAVITY)) for k in turns]


def softness(run: Run, row: int) -> float:
    """|first top - that of a hard sphere| / it."""
    hard = hard_sphere_top(mfix.DROP, mfix.BOUNCES[row][1], 1)
    return abs(tops(run, row)[0] / hard - 1)


def hard_limit(results: Results, code: str) -> Measured:
    """Slope of log(distance from the hard sphere) against log(k) for e < 1: -1/2, since contact time ~
    k^-1/2.
    """
    run, slopes = results["dem02", code], []
    for e in mfix.RESTITUTIONS[1:]:
        off = [softness(run, mfix.BOUNCES.index((k, e))) for k in mfix.STIFFNESSES]
        slopes.append(float(np.polyfit(np.log(mfix.STIFFNESSES), np.log(off), 1)[0]))
    return Measured(max(slopes, key=lambda s: abs(s + 0.5)), note=f"{len(slopes)} restitutions; farthest")


def squeezed(results: Results, code: str) -> Measured:
    """DEM03: largest difference of a height from the exact one, by the first overlap with the floor."""
    run, worst = results["dem03", code], 0.0
    masses = [mfix.sphere_mass(mfix.GRAIN, d) for d in mfix.DENSITIES]
    for k, e in enumerate(mfix.RESTITUTIONS):
        want = results.once(
            ("column", e),
            lambda e=e: squeezed_column(
                run.trace["time"], mfix.HEIGHTS, mfix.GRAIN, masses, mfix.ROOF, mfix.SPRING, e, mfix.GRAVITY
            ),
        )
        got = run.trace["position"][:, 2 * k : 2 * k + 2, 2]
        worst = max(worst, float(np.abs(got - want).max()) / (mfix.GRAIN - mfix.HEIGHTS[0]))
    return Measured(worst, note=f"{len(mfix.RESTITUTIONS)} restitutions")


def slip(run: Run, row: int) -> tuple[float, float, float]:
    """DEM04: (end of slip [s], speed [m/s], R x spin [m/s]), the last two as means over the rolling."""
    time = run.trace["time"]
    speed = run.trace["velocity"][:, row, 0]
    surface = mfix.GRAIN * run.trace["angular_velocity"][:, row, 1]
    gone = speed - surface
    middle = (gone < 0.75 * gone[0]) & (gone > 0.25 * gone[0]) & (time < time[np.argmin(gone)])
    slope, offset = np.polyfit(time[middle], gone[middle], 1)
    end = -offset / slope
    late = time > end + 0.3 * (time[-1] - end)
    return float(end), float(speed[late].mean()), float(surface[late].mean())


def slipping(results: Results, code: str) -> Measured:
    """DEM04: largest relative error of end of slip, final speed and final R x spin."""
    rows = []
    for k, mu in enumerate(mfix.FRICTIONS):
        final = 5 / 7 * mfix.THROW
        want = (closed_forms.slip_time(mfix.THROW, mu, mfix.GRAVITY), final, final)
        names = ("end of slip", "speed", "R x spin")
        for name, got, value in zip(names, slip(results["dem04", code], k), want, strict=True):
            rows.append((abs(got / value - 1), got, value, f"{name}, mu = {mu:g}"))
    value, got, want, label = max(rows)
    return Measured(value, got, want, f"largest at {label}")


def pellet_errors(results: Results, code: str) -> Measured:
    """DEM05: largest velocity or spin error against the ODE, by the impact speed."""
    run = results["dem05", code]
    found = [
        (max(errors(results, run, m)[k] for k in ("velocity", "angular_velocity")), m.label)
        for m in mfix.MEETINGS
    ]
    return Measured(max(found)[0], note=f"{len(found)} angles; largest at {max(found)[1]}")


def pellet(run: Run, row: int) -> tuple[float, float, float]:
    """DEM05: (rebound angle [deg], tangential restitution [1], spin [rad/s]) of one sphere."""
    v, w = run.trace["velocity"][:, row], run.trace["angular_velocity"][-1, row]
    return (
        math.degrees(math.atan2(v[-1, 0], v[-1, 2])), float(v[-1, 0] / v[0, 0]), abs(float(w[1]))
    )  # fmt: skip


def published(results: Results, code: str) -> Measured:
    """DEM05: largest relative difference from what MFIX-DEM prints, over its three columns."""
    rows = []
    for angle, mine in mfix.PUBLISHED.items():
        got = pellet(results["dem05", code], mfix.ANGLES.index(angle))
        want = (mine.rebound, mine.restitution, mine.spin)
        for name, a, b in zip(("rebound angle", "restitution", "spin"), got, want, strict=True):
            rows.append((abs(a / b - 1), a, b, f"{name} at {angle:g} deg"))
    value, got, want, label = max(rows)
    return Measured(value, got, want, f"largest at {label}")


def between(results: Results, column: str) -> Measured:
    """Largest difference between the codes over all traces; scaled by radius, top speed, top speed /
    radius.
    """
    found = {}
    for label in results.labels():
        ours, theirs = results[label, "gpudem"], results[label, "liggghts"]
        radius = float(ours.scene.state.radius[0])
        speed = float(np.linalg.norm(theirs.trace["velocity"], axis=-1).max())
        scale = {"position": radius, "velocity": speed, "angular_velocity": speed / radius}[column]
        found[label] = largest_difference(ours.trace[column], theirs.trace[column], scale)
    worst = max(found, key=lambda label: np.nan_to_num(found[label], nan=np.inf))
    return Measured(found[worst], note=f"{len(found)} scenes; largest in {worst}")


# -- checks ------------------------------------------------------------------------------------------------

Row = tuple[str, Callable[[Results, str], Measured], float, str, str, tuple[Tier, ...]]
FIRST_ORDER = "the dashpot sees half-step velocities: first order, and below this at the step used"
ANALYTICAL: tuple[Row, ...] = (
    ("DEM01: height, largest error over the fall, contact and rebound / drop",
     lambda r, c: path(r, c, "dem01", mfix.FALLS), 1e-3, FIRST_ORDER,
     "a stiffness of hooke that is not k; a damping that does not give e; gravity left out in contact",
     ("quick", "standard", "full")),
    ("DEM01: velocity of the rebound, relative error", speed_after, 1e-3, FIRST_ORDER,
     "a contact that ends early or late, 1 % of damping", ("quick", "standard", "full")),
    ("DEM02: height, largest error over all bounces / drop",
     lambda r, c: path(r, c, "dem02", mfix.BOUNCES), 1e-3,
     FIRST_ORDER + "; errors of the bounces add up, by e = 0.9 over three of them",
     "energy gained or lost at a touch, which grows from bounce to bounce", LONG),
    ("DEM03: heights, largest error over time / first overlap", squeezed, 1e-3, FIRST_ORDER,
     "an effective mass of pair or wall; a contact force that is not opposite",
     ("quick", "standard", "full")),
    ("DEM04: end of slip, final speed and R x spin, relative error", slipping, 1e-3,
     "0.1 % asked; MFIX reaches 0.57 % and 0.04 %",
     "friction other than mu N; a moment of inertia other than 2/5 m R^2", ("quick", "standard", "full")),
    ("DEM05: velocity and R x spin, largest error / impact speed", pellet_errors, 1e-3,
     "1300 steps a contact; without damping the error is of second order but where slip sets in",
     "a tangential stiffness other than 8 G* sqrt(R* d): the angles below 25 degrees stick",
     ("quick", "standard", "full")),
)  # fmt: skip

CHECKS = (
    *(
        Check(
            name=f"{name}, largest difference over all traces",
            measure=lambda results, column=column: between(results, column),
            tolerance=1e-9, unit="1", against="LIGGGHTS", mark="X", needs=CODES,
            reason="same law, same scheme: rounding, over up to a million steps",
            catches="hooke put together otherwise, a bounce that starts a step late",
        )
        for name, column in (
            ("position / radius", "position"), ("velocity / top speed", "velocity"),
            ("R x angular velocity / top speed", "angular_velocity"),
        )
    ),
    *(
        Check(
            name=f"{name} ({code})",
            measure=lambda results, code=code, measure=measure: measure(results, code),
            tolerance=tolerance, unit="1", against="ODE (DOP853, rtol 1e-13)" if "DEM05" in name
            else "closed form", mark="A", needs=(code,), reason=reason, catches=catches, tiers=tiers,
        )
        for code in CODES
        for name, measure, tolerance, reason, catches, tiers in ANALYTICAL
    ),
    *(
        Check(
            name=f"DEM02: power of k with which bounce 1 tends to the hard sphere's e^2 h ({code})",
            measure=lambda results, code=code: hard_limit(results, code),
            lo=-0.53, tolerance=-0.47, unit="1", against="closed form", mark="A", needs=(code,), tiers=LONG,
            reason="-1/2 to leading order; the next, 1/k, is worth a few per cent of it at k = 5e4 N/m",
            catches="a loss that does not vanish in the hard limit",
        )
        for code in CODES
    ),
    *(
        Check(
            name=f"DEM05: rebound angle, restitution and spin, relative difference ({code})",
            measure=lambda results, code=code: published(results, code),
            tolerance=0.01, unit="1", against="MFIX-DEM, AUTOTEST of DEM05", mark="P", needs=(code,),
            reason="MFIX takes the arm R, LIGGGHTS' law R - overlap/2 (0.2 % of the spin), and its own step",
            catches="another tangential stiffness: 2/3 of it moves the rebound angle at 10 degrees by 18 %",
        )
        for code in CODES
    ),
)  # fmt: skip


# -- figures -----------------------------------------------------------------------------------------------


def _drop_axes(
    axes: Axes, results: Results, name: str, rows: tuple[tuple[float, float], ...], only: float
) -> None:
    """Height in time of the spheres of one stiffness: exact, and both codes' marks."""
    for k, (stiffness, e) in enumerate(rows):
        if stiffness != only:
            continue
        color = plots.SERIES[mfix.RESTITUTIONS.index(e)]
        for code in results.codes(name):
            trace = results[name, code].trace
            if code == CODES[0]:
                gap, _ = bouncer(stiffness, e).at(trace["time"])
                axes.plot(trace["time"], gap + mfix.BALL, "-", color=color, lw=0.9, label=f"e = {e:g}")
            every = max(1, len(trace["time"]) // 45)
            mark = "x" if code == CODES[0] else "o"
            axes.plot(
                trace["time"][::every], trace["position"][::every, k, 2], mark, color=color, ms=4, mfc="none"
            )
    axes.set(xlabel="time [s]", ylabel="height of the centre [m]")
    axes.set_title(f"{name.upper()}, k = {only:g} N/m")


def _figure(results: Results) -> MatplotlibFigure:
    long = "dem02" in results.labels()
    figure, axes = plots.figure(2, 2, width=plots.WHOLE, height=6.6)
    _drop_axes(axes[0, 0], results, "dem01", mfix.FALLS, 1e4)
    plots.legend(axes[0, 0], loc="lower left")
    if long:
        _drop_axes(axes[0, 1], results, "dem02", mfix.BOUNCES, 5e4)
    else:
        _drop_axes(axes[0, 1], results, "dem01", mfix.FALLS, 1e5)
    low = axes[1, 0]
    for code in results.codes("dem03"):
        run = results["dem03", code]
        squeezed(results, code)
        for k, e in enumerate(mfix.RESTITUTIONS):
            if e not in (1.0, 0.7, 0.5):
                continue
            color = plots.SERIES[k]
            if code == results.codes("dem03")[0]:
                exactly = results.cache["column", e]
                low.plot(run.trace["time"], exactly[:, 1], "-", color=color, lw=0.9, label=f"e = {e:g}")
            mark = "x" if code == CODES[0] else "o"
            time, height = run.trace["time"][::25], run.trace["position"][::25, 2 * k + 1, 2]
            low.plot(time, height, mark, color=color, ms=4, mfc="none")
    low.set(xlabel="time [s]", ylabel="height of the upper sphere [m]")
    low.set_title("DEM03")
    low.margins(y=0.18)
    plots.legend(low, loc="lower right", ncols=3)
    last = axes[1, 1]
    solved = [exact(results, results["dem05", results.codes()[0]].scene, m) for m in mfix.MEETINGS]
    ode = [math.degrees(math.atan2(-t.contact.final[3], t.contact.final[2])) for t in solved]
    last.plot(mfix.ANGLES, np.abs(ode), label="exact", color="#000000", lw=0.9)
    for code in results.codes("dem05"):
        angles = [pellet(results["dem05", code], k)[0] for k in range(len(mfix.ANGLES))]
        look = plots.style(code, linestyle="none", marker="x" if code == CODES[0] else "o")
        last.plot(mfix.ANGLES, angles, **look)
    plus = plots.style("event_driven", linestyle="none", marker="+", markersize=11, label="MFIX-DEM")
    last.plot(list(mfix.PUBLISHED), [p.rebound for p in mfix.PUBLISHED.values()], **plus)
    last.set(xlabel="impact angle [deg]", ylabel="rebound angle of the centre [deg]")
    last.set_title("DEM05")
    plots.legend(last)
    return figure


def _table(results: Results) -> pandas.DataFrame:
    import pandas

    run = results["dem05", "gpudem"]
    rows = []
    for k, angle in enumerate(mfix.ANGLES):
        row: dict[str, object] = {"impact angle [deg]": angle}
        printed = mfix.PUBLISHED.get(angle)
        columns = (("rebound angle [deg]", "rebound"), ("tangential restitution [1]", "restitution"))
        for (name, field), got in zip((*columns, ("spin [rad/s]", "spin")), pellet(run, k), strict=True):
            row[f"gpudem: {name}"] = got
            row[f"MFIX-DEM: {name}"] = getattr(printed, field) if printed else ""
        rows.append(row)
    return pandas.DataFrame(rows)


CASE = Case(
    name="mfix_dem",
    title="MFIX-DEM's verification cases DEM01 to DEM05",
    purpose=(
        "The verification cases of another public code, with its numbers and as matrices rather than single"
        " points: a sphere dropped on a floor (19 pairs of stiffness and restitution), its repeated bounces"
        " (18, against the exact motion and the hard sphere's limit), two spheres squeezed between floor and"
        " roof (6), a sphere thrown along a floor (9 frictions), and alumina spheres that hit glass at 8"
        " angles. The linear spring of the first four is `hooke` with a Young's modulus worked out so that k"
        " is the one wanted; the fifth is run with the Hertz law. MFIX' linear variant of DEM05 is left out:"
        " it has k_t = 0.86 k_n, and hooke, in LIGGGHTS and here, has k_t = k_n."
    ),
    source=(
        "MFIX-DEM tests/dem/DEM01 to DEM05 (set-ups, analytic solutions, AUTOTEST results); Kharaz, Gorham"
        " and Salman, Powder Technol. 120 (2001) 281."
    ),
    variants=variants,
    checks=CHECKS,
    figures=(
        Figure(
            "DEM01, DEM02, DEM03 and DEM05",
            "Lines: exact; crosses: gpudem; circles: LIGGGHTS; plus signs: MFIX-DEM's own results. All four"
            " lie on one another; soft springs let the sphere sink through a tenth of a metre and rebound"
            " lower than a hard one.",
            _figure, needs=CODES,
        ),
    ),
    tables=(Table("DEM05 beside MFIX-DEM's printed results", "Hertz law, sphere on wall.", _table),),
    features=(
        "normal hooke", "normal hertz", "damping", "gravity", "wall plane", "several materials",
        "sphere-sphere", "tangential history", "rotation",
    ),
    order=60,
)  # fmt: skip
