"""Rolling friction: deceleration 5/7 mu_r g on a floor; a slope, on which `epsd2` holds and `cdt` creeps."""

from __future__ import annotations

import math

import numpy as np

from comparisons import kit
from comparisons.cases.rolling.scenes import GRAVITY, arm, on_plane, rate, step_by_step
from comparisons.oracles.rolling import resisted
from comparisons.report import plots
from gpudem.output.run import Run
from gpudem.scene import Contact, Scene

FRICTION = 0.6
#: Law -> line in figures.
LAWS = {"cdt": "-", "epsd2": "--"}
#: Flat: starting speed [m/s], rolling friction.
ROLLS = ((0.10, 0.10), (0.06, 0.05), (0.15, 0.20))
#: Slope [deg], and rolling friction as a multiple of its tangent: below 1 a sphere rolls down from rest.
SLOPE, SHARES = 10.0, (0.3, 0.6, 0.9, 1.1, 2.0)
FLAT_TIME, SLOPE_TIME = 0.2, 0.1


def scene(law: str, slope: float) -> Scene:
    """All spheres of one law on one slope [deg]: rolling on the flat, at rest on a slope."""
    tangent = math.tan(math.radians(slope))
    rows = [(0.0, share * tangent) for share in SHARES] if slope else list(ROLLS)
    return on_plane(
        f"{law}_{slope:g}", [{"friction": FRICTION, "rolling_friction": mu} for _, mu in rows], slope=slope,
        velocity=[(u, 0.0, 0.0) for u, _ in rows], rolling=True,
        contact=Contact(rolling=law),  # pyright: ignore[reportArgumentType]
        lo=(-0.01, -0.01, -0.001), hi=(0.1, 0.01 * len(rows), 0.01),
        step=4e-6, duration=SLOPE_TIME if slope else FLAT_TIME, every=4e-4,
    )  # fmt: skip


def label(law: str, slope: float) -> str:
    return f"{law}_{'slope' if slope else 'flat'}"


VARIANTS = [(law, slope) for law in LAWS for slope in (0.0, SLOPE)]


def speed(run: Run, k: int) -> np.ndarray:
    return run.trace["velocity"][:, k, 0]


def flat(results: kit.Results, code: str, law: str) -> dict[str, dict[str, kit.Compared]]:
    """Deceleration from 90 to 10 % of the speed, beside 5/7 mu_r g; distance rolled, beside u0^2/(2 a)."""
    run, found = results[label(law, 0), code], {"deceleration [m/s2]": {}, "stopping distance [m]": {}}
    for k, (u0, mu) in enumerate(ROLLS):
        x, u = run.trace["position"][:, k, 0], speed(run, k)
        moving, braking = (u < 0.9 * u0) & (u > 0.1 * u0), -resisted(arm(run.scene, 0), 0.0, mu, GRAVITY)
        slope = np.polyfit(run.trace["time"][moving], u[moving], 1)[0]
        where = f"u0 = {u0:g} m/s, mu_r = {mu:g}"
        found["deceleration [m/s2]"][where] = -float(slope), braking
        found["stopping distance [m]"][where] = float(x[-1] - x[0]), u0**2 / (2 * braking)
    return found


def sloping(results: kit.Results, code: str, law: str) -> dict[str, kit.Measured]:
    """Error of the acceleration of those that roll, by 5/7 g sin(slope)."""
    run, angle, found = results[label(law, SLOPE), code], math.radians(SLOPE), {}
    for k, share in enumerate(share for share in SHARES if share < 1):
        got = rate(run, speed(run, k), SLOPE_TIME / 2)
        want = resisted(arm(run.scene, SLOPE), angle, share * math.tan(angle), GRAVITY)
        off = abs(got - want) / (5 / 7 * GRAVITY * math.sin(angle))
        found[f"mu_r = {share:g} tan(slope)"] = kit.Measured(off, got, want)
    return found


def creep(results: kit.Results, law: str, code: str) -> float:
    """Distance in the second half of the run of the fastest sphere that should be held, by that of one that
    rolls freely.
    """
    x = results[label(law, SLOPE), code].trace["position"][:, [s > 1 for s in SHARES], 0]
    free = 5 / 7 * GRAVITY * math.sin(math.radians(SLOPE)) / 2 * (SLOPE_TIME**2 - (SLOPE_TIME / 2) ** 2)
    return float(np.abs(x[-1] - x[len(x) // 2]).max()) / free


def held(results: kit.Results, code: str) -> kit.Measured:
    return kit.Measured(creep(results, "epsd2", code), note=f"cdt: {creep(results, 'cdt', code):.2g}")


def _figure(results: kit.Results) -> plots.Figure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.8)
    for law, slope in VARIANTS:
        for code in results.codes(label(law, slope)):
            run, axes = results[label(law, slope), code], right if slope else left
            time, size = run.trace["time"], {"cdt": 6, "epsd2": 3}[law]
            for k in range(len(SHARES if slope else ROLLS)):
                text = f"mu_r = {SHARES[k]:g} tan(slope)" if slope else f"mu_r = {ROLLS[k][1]:g}"
                look = plots.line_or_marks(code, len(time), LAWS[law], color=plots.SERIES[k], markersize=size)
                axes.plot(time, speed(run, k), **look, label=text if look["linestyle"] == "-" else None)
                if not slope:
                    u0, mu = ROLLS[k]
                    end = -u0 / resisted(arm(run.scene, 0), 0.0, mu, GRAVITY)
                    axes.plot([0, end], [u0, 0], color="k", lw=0.6)
    left.set(xlabel="time [s]", ylabel="velocity [m/s]", title="on the flat")
    right.set(xlabel="time [s]", title=f"from rest on {SLOPE:g} degrees")
    plots.legend(left, lines=results.codes())
    plots.legend(right)
    return figure


CASE = kit.Case(
    name="rolling_decay", title="Rolling friction: roll-out and slope",
    purpose="Rolling friction decelerates a sphere on a floor at 5/7 mu_r g and stops it after 7 u0^2/(10"
    " mu_r g) under both laws: the torque of constant size `cdt` and the elastic-plastic spring `epsd2`. On"
    " a slope, from rest, the laws differ: for mu_r above the slope's tangent `epsd2` holds the sphere, as"
    " its torque has a history; `cdt` has no torque at rest and holds it only by a torque whose sign"
    " alternates every few steps.",
    source="Rigid-body mechanics; laws: Ai, Chen, Rotter and Ooi, Powder Technol. 206 (2011) 269, A and C.",
    variants=lambda tier: [kit.Variant(label(law, slope), scene(law, slope)) for law, slope in VARIANTS],
    checks=(
        *step_by_step(
            "largest starting speed", lambda run: ROLLS[2][0],
            reason="same law, same scheme: rounding, over 50 000 steps in contact",
            catches="a rolling torque that is stored, limited or projected differently",
        ),
        *(
            check
            for law in LAWS
            for check in kit.per_quantity(
                lambda results, code, law=law: flat(results, code, law),
                {"deceleration [m/s2]":
                     "a torque other than mu_r N R*, of the wrong sign, or with its part along the normal",
                 "stopping distance [m]":
                     "a torque that drives the sphere on, or back, after it has stopped"},
                f"{law}, on the flat: {{}}, relative error", tolerance=1e-4, against="closed form",
                reason="rounding for the rate; the oscillation at the stop changes the distance by 2e-5",
            )
        ),
        *(
            kit.per_code(
                f"{law}, down the slope: acceleration, largest error / (5/7 g sin(slope))",
                lambda results, code, law=law: sloping(results, code, law),
                tolerance=1e-6, against="closed form",
                reason="the dashpot has ended the oscillation of the spring: rounding",
                catches="a rolling torque proportional to m g instead of the normal force",
            )
            for law in LAWS
        ),
        kit.per_code(
            "epsd2, held by the slope: way in the second half / way of a free sphere", held,
            tolerance=1e-6, against="closed form",
            reason="at rest but for the oscillation of the two springs, which epsd2 does not damp",
            catches="a rolling torque that is reset at every step",
        ),
    ),
    figures=(kit.Figure(
        "Velocity on the flat and from rest on a slope",
        "Full lines and large marks: cdt; dashed lines and small marks: epsd2. Left: straight lines to"
        " rest at the rate 5/7 mu_r g (black: closed form). Right: spheres with mu_r above the slope's"
        " tangent stay at rest, the others accelerate at 5/7 g (sin - mu_r cos).",
        _figure,
    ),),
    tables=(kit.table(
        "Deceleration and stopping distance", "On the flat, under cdt.",
        lambda results, code: flat(results, code, "cdt"), rows="sphere",
    ),),
    features=(
        "rolling cdt", "rolling epsd2", "normal hertz", "tangential history", "rotation", "gravity",
        "wall plane",
    ), order=44,
)  # fmt: skip
