"""Spheres on an incline on both sides of tan(slope) = 7/2 mu: below they roll, beyond they slide and spin."""

from __future__ import annotations

import math

import numpy as np

from comparisons import kit
from comparisons.cases.rolling.scenes import GRAVITY, arm, on_plane, rate, step_by_step
from comparisons.oracles.rolling import down_slope, sticking_limit
from comparisons.report import plots
from gpudem.output.run import Run
from gpudem.scene import Contact, Scene

#: Slope [deg] and rolling friction under `epsd`; 0: no rolling law.
INCLINES = ((20.0, 0.0), (45.0, 0.0), (45.0, 0.05))
#: Friction as a multiple of that at which rolling ends.
SHARES = (0.25, 0.5, 0.75, 0.9, 0.98, 1.02, 1.1, 1.5, 2.5)
DURATION, VISCOUS = 0.1, 0.3


def limit(slope: float, rolling: float) -> float:
    """Friction [1] at which rolling ends, of a rigid sphere."""
    return 2 / 7 * math.tan(math.radians(slope)) + 5 / 7 * rolling


def scene(slope: float, rolling: float) -> Scene:
    """All spheres of one slope, at rest."""
    resists = {"rolling_friction": rolling, "rolling_viscous_damping": VISCOUS} if rolling else {}
    return on_plane(
        f"incline_{slope:g}", [{"friction": share * limit(slope, rolling), **resists} for share in SHARES],
        slope=slope, contact=Contact(rolling="epsd" if rolling else "off"),
        lo=(-0.01, -0.01, -0.001), hi=(0.1, 0.01 * len(SHARES), 0.01),
        step=4e-6, duration=DURATION, every=2e-4,
    )  # fmt: skip


def label(slope: float, rolling: float) -> str:
    return f"slope_{slope:g}_epsd" if rolling else f"slope_{slope:g}"


def text(slope: float, rolling: float) -> str:
    return f"{slope:g} deg, mu_r = {rolling:g}" if rolling else f"{slope:g} deg"


def rates(run: Run, slope: float) -> list[tuple[float, float]]:
    """(du/dt, a dw/dt) [m/s2] of each sphere: lines through the second half of the run."""
    found, lever = [], arm(run.scene, slope).arm
    for k in range(len(SHARES)):
        speed, spin = run.trace["velocity"][:, k, 0], run.trace["angular_velocity"][:, k, 1]
        found.append((rate(run, speed, DURATION / 2), rate(run, spin, DURATION / 2) * lever))
    return found


def exact(run: Run, slope: float, rolling: float, friction: float) -> tuple[float, float]:
    """The same two by the closed form."""
    return down_slope(arm(run.scene, slope), math.radians(slope), friction, GRAVITY, rolling)


def accelerations(results: kit.Results, code: str) -> dict[str, dict[str, kit.Compared]]:
    """Both accelerations of each sphere; error by the rolling acceleration."""
    found = {"acceleration [m/s2]": {}, "a x angular acceleration [m/s2]": {}}
    for slope, rolling in INCLINES:
        run = results[label(slope, rolling), code]
        rolls = exact(run, slope, rolling, 10.0)[0]
        for share, both in zip(SHARES, rates(run, slope), strict=True):
            where = f"{text(slope, rolling)}, mu = {share:g} x limit"
            wanted = exact(run, slope, rolling, share * limit(slope, rolling))
            for one, got, want in zip(found.values(), both, wanted, strict=True):
                one[where] = kit.Measured(abs(got - want) / rolls, got, want)
    return found


def transition(results: kit.Results, code: str) -> dict[str, tuple[float, float]]:
    """Friction at which slip ends, beside the limit: the line through the last two slips."""
    found = {}
    for slope, rolling in INCLINES:
        run, mu = results[label(slope, rolling), code], [s * limit(slope, rolling) for s in SHARES]
        slips = [speed - surface for speed, surface in rates(run, slope)[3:5]]
        zero = mu[4] - slips[1] * (mu[4] - mu[3]) / (slips[1] - slips[0])
        wanted = sticking_limit(arm(run.scene, slope), math.radians(slope), rolling)
        found[text(slope, rolling)] = zero, wanted
    return found


def _figure(results: kit.Results) -> plots.Figure:
    figure, axes = plots.figure(1, len(INCLINES), width=plots.WHOLE, height=3.8, sharey=True)
    grid = np.linspace(max(SHARES[0] - 0.05, 0.0), 2.6, 400)
    for ax, (slope, rolling) in zip(axes, INCLINES, strict=True):
        name = label(slope, rolling)
        ran, unit = results.codes(name), GRAVITY * math.sin(math.radians(slope))
        first, most = results[name, ran[0]], limit(slope, rolling)
        wanted = np.array([exact(first, slope, rolling, s * most) for s in grid]) / unit
        found = {code: np.array(rates(results[name, code], slope)) / unit for code in ran}
        for j, what in enumerate(("acceleration", "a x angular acceleration")):
            values = {code: both[:, j] for code, both in found.items()}
            plots.exact_and_marks(ax, SHARES, (grid, wanted[:, j]), values, plots.SERIES[j], what)
        ax.set(xlabel="mu / limit of rolling", title=text(slope, rolling))
    axes[0].set_ylabel("/ (g sin(slope))")
    plots.legend(axes[0], points=results.codes())
    return figure


CASE = kit.Case(
    name="incline", title="Sphere on an incline: rolling or sliding",
    purpose="A sphere released on an incline rolls if tan(slope) is at most 7/2 mu; beyond, it slides and"
    " spins up. Nine frictions on each of two slopes, two of them 2 % below and above the limit, show both"
    " accelerations in both regimes, and the limit itself: the balance of friction, torque and moment of"
    " inertia under a steady load, which a short impact does not test. Against the rolling torque of `epsd`"
    " the limit is 2/7 tan(slope) + 5/7 mu_r, and all accelerations are less.",
    source="Rigid-body mechanics: 5/7 g sin(slope); g (sin - mu cos) and 5/2 mu g cos/R.",
    variants=lambda tier: [kit.Variant(label(*incline), scene(*incline)) for incline in INCLINES],
    checks=(
        *step_by_step(
            "final speed", lambda run: 5 / 7 * run.scene.gravity[0] * DURATION,
            reason="same law, same scheme: rounding, over 25 000 steps in contact",
            catches="a spring that is reset or limited differently in a lasting contact",
        ),
        *kit.per_quantity(
            accelerations,
            {"acceleration [m/s2]": "friction other than mu N, a moment of inertia other than 2/5 m R^2",
             "a x angular acceleration [m/s2]": "a torque that does not belong to the friction, a wrong arm"},
            "{}, largest error / rolling acceleration", tolerance=1e-6, against="closed form",
            reason="the closed form has the arm R - overlap/2 of the law, and the dashpot has ended the"
            " oscillation of the spring: only rounding remains; the arm R would give 6e-5",
        ),
        kit.per_code(
            "friction at which slip ends / (2/7 tan(slope) + 5/7 mu_r), less 1", transition,
            tolerance=1e-6, against="closed form",
            reason="slip is exactly linear in mu; from the slips at 0.9 and 0.98 of the limit",
            catches="a spring that creeps below the limit of friction",
        ),
    ),
    figures=(kit.Figure(
        "Acceleration on both sides of the limit",
        "Lines: closed form. Left of 1 the sphere slides, and its surface is slower than its center;"
        " right of 1 both accelerations are 5/7 of g sin(slope), less 5/7 mu_r g cos(slope).",
        _figure,
    ),),
    tables=(kit.table(
        "Accelerations", "Slopes of straight lines fitted to the second half of the run.", accelerations,
        rows="sphere",
    ),),
    features=(
        "normal hertz", "damping", "tangential history", "rolling epsd", "rotation", "gravity", "wall plane",
    ), order=42,
)  # fmt: skip
