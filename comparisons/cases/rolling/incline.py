"""Spheres on an incline on both sides of tan(slope) = 7/2 mu: below they roll, beyond they slide and spin."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from comparisons.cases.single_contact.checks import CODES
from comparisons.harness.case import Case, Check, Figure, Measured, Results, Table, Variant
from comparisons.metrics.trace import largest_difference
from comparisons.oracles.bodies import bodies
from comparisons.oracles.rolling import Arm, down_slope, sticking_limit
from comparisons.report import plots
from gpudem.output.run import Run
from gpudem.scene import Domain, Explicit, Material, Output, Pair, Plane, Scene, Time

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure as MatplotlibFigure

GRAVITY, RADIUS = 9.81, 0.003
SLOPES = (20.0, 45.0)
#: Friction as a multiple of 2/7 tan(slope), where rolling ends.
SHARES = (0.25, 0.5, 0.75, 0.9, 0.98, 1.02, 1.1, 1.5, 2.5)
#: Stiff enough that a static overlap (0.02 % of R) costs the lever arm nothing that shows.
BALL = Material(young=1e8, poisson=0.34, density=1768.0)
FLOOR = Material(young=1e8, poisson=0.37, density=1185.0)
STEP, DURATION, TRACE = 4e-6, 0.1, 2e-4


def frictions(slope: float) -> list[float]:
    """Friction [1] of each sphere on a slope [deg]."""
    return [share * 2 / 7 * math.tan(math.radians(slope)) for share in SHARES]


def scene(slope: float) -> Scene:
    """All spheres of one slope, at rest at their static overlap; gravity is tilted, not the plane."""
    names, angle = [f"ball_{k}" for k in range(len(SHARES))], math.radians(slope)
    pairs = [
        Pair(materials=(n, "floor"), restitution=0.5, friction=mu)
        for n, mu in zip(names, frictions(slope), strict=True)
    ]
    pairs += [Pair(materials=(a, b), restitution=0.5) for k, a in enumerate(names) for b in names[k:]]

    materials = dict.fromkeys(names, BALL) | {"floor": FLOOR}

    def built(height: float) -> Scene:
        return Scene(
            name=f"incline_{slope:g}", materials=materials, pairs=pairs,
            particles=Explicit(
                position=[(0.0, 0.01 * k, height) for k in range(len(SHARES))], radius=RADIUS, material=names
            ),
            gravity=(GRAVITY * math.sin(angle), 0.0, -GRAVITY * math.cos(angle)),
            walls=[Plane(name="floor", material="floor", point=(0, 0, 0), normal=(0, 0, 1))],
            domain=Domain(lo=(-0.01, -0.01, -0.001), hi=(0.1, 0.01 * len(SHARES), 0.01)),
            time=Time(step=STEP, duration=DURATION), output=Output(trace_every=TRACE),
        )  # fmt: skip

    return built(RADIUS - arm(built(RADIUS), slope).overlap)


def arm(incline: Scene, slope: float) -> Arm:
    """Static overlap and lever arm on a slope [deg], the same for all spheres."""
    return Arm.of(bodies(incline, 0, "floor"), GRAVITY * math.cos(math.radians(slope)))


def label(slope: float) -> str:
    return f"slope_{slope:g}"


def rates(run: Run, slope: float, k: int) -> tuple[float, float]:
    """(du/dt, a dw/dt) [m/s2] of sphere k: lines through the second half of the run."""
    time, late = run.trace["time"], run.trace["time"] > DURATION / 2
    speed, spin = run.trace["velocity"][:, k, 0], run.trace["angular_velocity"][:, k, 1]
    lines = [np.polyfit(time[late], v[late], 1)[0] for v in (speed, spin)]
    return float(lines[0]), float(lines[1]) * arm(run.scene, slope).arm


def worst(results: Results, code: str, quantity: int) -> Measured:
    """Largest error of du/dt (0) or a dw/dt (1), by the rolling acceleration."""
    rows = []
    for slope in SLOPES:
        run = results[label(slope), code]
        lever = arm(run.scene, slope)
        rolling = down_slope(lever, math.radians(slope), 10.0, GRAVITY)[0]
        for k, mu in enumerate(frictions(slope)):
            want = down_slope(lever, math.radians(slope), mu, GRAVITY)[quantity]
            got = rates(run, slope, k)[quantity]
            rows.append((abs(got - want) / rolling, got, want, f"{slope:g} deg, mu = {SHARES[k]:g} x limit"))
    value, got, want, where = max(rows)
    return Measured(value, got, want, f"largest at {where}")


def change_over(results: Results, code: str) -> Measured:
    """Friction at which slip ends, by the limit: the line through the last two slips."""
    found = []
    for slope in SLOPES:
        run = results[label(slope), code]
        lever = arm(run.scene, slope)
        limit = sticking_limit(lever, math.radians(slope))
        slips = [mu_u - mu_w for mu_u, mu_w in (rates(run, slope, k) for k in (3, 4))]
        mu = frictions(slope)
        zero = mu[4] - slips[1] * (mu[4] - mu[3]) / (slips[1] - slips[0])
        found.append((abs(zero / limit - 1), zero, limit, f"{slope:g} deg"))
    value, got, want, where = max(found)
    return Measured(value, got, want, f"largest at {where}")


def between(results: Results, column: str) -> Measured:
    """Largest difference between the codes over both traces, by the final rolling speed (or it / R)."""
    found = 0.0
    for slope in SLOPES:
        ours, theirs = (results[label(slope), code] for code in CODES)
        speed = 5 / 7 * GRAVITY * math.sin(math.radians(slope)) * DURATION
        scale = speed / (1.0 if column == "velocity" else RADIUS)
        found = max(found, largest_difference(ours.trace[column], theirs.trace[column], scale))
    return Measured(found, note=f"{len(SLOPES)} slopes, {len(SHARES)} frictions")


def _figure(results: Results) -> MatplotlibFigure:
    figure, axes = plots.figure(1, len(SLOPES), width=plots.WHOLE, height=3.8, sharey=True)
    for ax, slope in zip(axes, SLOPES, strict=True):
        run = results[label(slope), results.codes()[0]]
        lever, angle = arm(run.scene, slope), math.radians(slope)
        grid = np.linspace(0.0, 2.6, 400)
        unit = GRAVITY * math.sin(angle)
        exact = (
            np.array([down_slope(lever, angle, s * 2 / 7 * math.tan(angle), GRAVITY) for s in grid]) / unit
        )
        ax.plot(grid, exact[:, 0], color=plots.SERIES[0], lw=1.2, label="acceleration")
        ax.plot(grid, exact[:, 1], color=plots.SERIES[1], lw=1.2, label="a x angular acceleration")
        for code in results.codes(label(slope)):
            got = np.array([rates(results[label(slope), code], slope, k) for k in range(len(SHARES))]) / unit
            mark = "x" if code == CODES[0] else "o"
            for k in (0, 1):
                ax.plot(
                    SHARES, got[:, k], mark, color=plots.SERIES[k], mfc="none", ms=5 if mark == "x" else 8
                )
        ax.set(xlabel="mu / (2/7 tan(slope))", title=f"slope {slope:g} degrees")
    axes[0].set_ylabel("/ (g sin(slope))")
    plots.legend(axes[0])
    return figure


def _table(results: Results) -> pandas.DataFrame:
    import pandas

    rows = []
    for slope in SLOPES:
        for k, mu in enumerate(frictions(slope)):
            lever = arm(results[label(slope), results.codes()[0]].scene, slope)
            want = down_slope(lever, math.radians(slope), mu, GRAVITY)
            row = {"slope [deg]": slope, "mu [1]": mu, "motion": "rolls" if want[0] == want[1] else "slides"}
            row |= {"closed form: du/dt [m/s2]": want[0], "closed form: a dw/dt [m/s2]": want[1]}
            for code in results.codes(label(slope)):
                got = rates(results[label(slope), code], slope, k)
                row |= {f"{code}: du/dt [m/s2]": got[0], f"{code}: a dw/dt [m/s2]": got[1]}
            rows.append(row)
    return pandas.DataFrame(rows)


CASE = Case(
    name="incline",
    title="Sphere on an incline: rolling or sliding",
    purpose=(
        "A sphere let go on an incline rolls if tan(slope) is at most 7/2 mu and slides while spinning up"
        " beyond. Nine frictions on each of two slopes, two of them 2 % to either side of the limit, show"
        " acceleration and angular acceleration in both regimes and where one turns into the other: the"
        " balance of friction, torque and moment of inertia under a steady load, which a short impact does"
        " not show."
    ),
    source="Rigid-body mechanics: 5/7 g sin(slope); g (sin - mu cos) and 5/2 mu g cos/R.",
    variants=lambda tier: [Variant(label(slope), scene(slope)) for slope in SLOPES],
    checks=(
        *(
            Check(
                name=f"{name}, largest difference over the trace / final speed",
                measure=lambda results, column=column: between(results, column),
                tolerance=1e-9, unit="1", against="LIGGGHTS", mark="X", needs=CODES,
                reason="same law, same scheme: rounding, over 25 000 steps in contact",
                catches="a spring forgotten or shortened otherwise in a lasting contact",
            )
            for name, column in (("velocity", "velocity"), ("R x angular velocity", "angular_velocity"))
        ),
        *(
            Check(
                name=f"{name}, largest error / rolling acceleration ({code})",
                measure=lambda results, code=code, k=k: worst(results, code, k),
                tolerance=1e-6, unit="1", against="closed form", mark="A", needs=(code,),
                reason="the closed form has the arm R - overlap/2 of the law, and the dashpot has ended the"
                " swing of the spring: rounding is left; with the arm R it were 6e-5",
                catches=catches,
            )
            for code in CODES
            for k, (name, catches) in enumerate((
                ("acceleration", "friction other than mu N, a moment of inertia other than 2/5 m R^2"),
                ("a x angular acceleration", "a torque that does not belong to the friction, a wrong arm"),
            ))
        ),
        *(
            Check(
                name=f"friction at which slip ends / (2/7 tan(slope)), less 1 ({code})",
                measure=lambda results, code=code: change_over(results, code),
                tolerance=1e-6, unit="1", against="closed form", mark="A", needs=(code,),
                reason="slip is exactly linear in mu; from the slips at 0.9 and 0.98 of the limit",
                catches="a spring that creeps below the limit of friction",
            )
            for code in CODES
        ),
    ),
    figures=(
        Figure(
            "Acceleration on both sides of the limit",
            "Lines: closed form; crosses: gpudem; circles: LIGGGHTS. Left of 1 the sphere slides and spins"
            " more slowly than it runs, right of 1 both accelerations are 5/7 of g sin(slope).",
            _figure,
        ),
    ),
    tables=(Table("Accelerations", "By straight lines through the second half of the run.", _table),),
    features=("normal hertz", "damping", "tangential history", "rotation", "gravity", "wall plane"),
    order=42,
)  # fmt: skip
