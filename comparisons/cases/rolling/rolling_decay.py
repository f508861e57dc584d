"""Rolling friction: deceleration 5/7 mu_r g on a floor; a slope, on which springs hold and `cdt` creeps."""

from __future__ import annotations

import math

import numpy as np

from comparisons import kit
from comparisons.cases.rolling.scenes import GRAVITY, arm, on_plane, rate, step_by_step
from comparisons.oracles.rolling import resisted, wound_stop
from comparisons.report import plots
from gpudem.output.run import Run
from gpudem.scene import Contact, Scene

FRICTION = 0.6
#: Law -> line and size of marks in figures.
LAWS = {"cdt": ("-", 7), "epsd2": ("--", 5), "epsd": (":", 3), "epsd3": ("-.", 2)}
#: Those with a spring, which hold a sphere on a slope.
SPRINGS = ("epsd2", "epsd", "epsd3")
VISCOUS = 0.3
#: What a law reads beside rolling friction; the stiffness of `epsd3` is four times that of `epsd`.
MORE: dict[str, dict[str, float]] = {
    "epsd": {"rolling_viscous_damping": VISCOUS},
    "epsd3": {"rolling_viscous_damping": VISCOUS, "rolling_stiffness": 9.0},
}
AT_STOP = "the oscillation at the stop changes the distance by 2e-5"
ONE_STEP = (
    "the spring yields after 2 to 20 steps, the last of them not whole; the dashpot of a step, 2 eta omega dt"
    " of the speed, is twice that of the distance: {} at most"
)
#: Tolerance of a stopping distance, and why.
STOPPING = {
    "cdt": (1e-4, AT_STOP), "epsd2": (1e-4, AT_STOP), "epsd": (5e-3, ONE_STEP.format("5e-3")),
    "epsd3": (1e-2, ONE_STEP.format("1e-2")),
}  # fmt: skip
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
        f"{law}_{slope:g}",
        [{"friction": FRICTION, "rolling_friction": mu, **MORE.get(law, {})} for _, mu in rows],
        slope=slope, velocity=[(u, 0.0, 0.0) for u, _ in rows], rolling=True,
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
    """Deceleration from 90 to 10 % of the speed, beside 5/7 mu_r g; distance rolled, beside `stop`."""
    run, found = results[label(law, 0), code], {"deceleration [m/s2]": {}, "stopping distance [m]": {}}
    for k, (u0, mu) in enumerate(ROLLS):
        x, u = run.trace["position"][:, k, 0], speed(run, k)
        moving, braking = (u < 0.9 * u0) & (u > 0.1 * u0), -resisted(arm(run.scene, 0), 0.0, mu, GRAVITY)
        slope = np.polyfit(run.trace["time"][moving], u[moving], 1)[0]
        where = f"u0 = {u0:g} m/s, mu_r = {mu:g}"
        found["deceleration [m/s2]"][where] = -float(slope), braking
        found["stopping distance [m]"][where] = float(x[-1] - x[0]), stop(run, law, u0, mu, braking)
    return found


def stop(run: Run, law: str, u0: float, mu: float, braking: float) -> float:
    """Distance [m] in which a sphere stops: u0^2/(2 a), or with the spring and dashpot of `epsd`, which act
    before the spring has wound up to k_r theta = mu_r N R, k_r = s k_n mu_r^2 R^2, and as it unwinds.
    """
    if law not in MORE:
        return u0**2 / (2 * braking)
    one, factor = arm(run.scene, 0), MORE[law].get("rolling_stiffness", 2.25)
    return wound_stop(u0, braking, one.overlap * one.arm / (factor * mu * one.radius), VISCOUS)


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


def held(results: kit.Results, code: str, law: str) -> kit.Measured:
    return kit.Measured(creep(results, law, code), note=f"cdt: {creep(results, 'cdt', code):.2g}")


def _figure(results: kit.Results) -> plots.Figure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.8)
    for law, slope in VARIANTS:
        for code in results.codes(label(law, slope)):
            run, axes = results[label(law, slope), code], right if slope else left
            time, (line, size) = run.trace["time"], LAWS[law]
            for k in range(len(SHARES if slope else ROLLS)):
                text = f"mu_r = {SHARES[k]:g} tan(slope)" if slope else f"mu_r = {ROLLS[k][1]:g}"
                look = plots.line_or_marks(code, len(time), line, color=plots.SERIES[k], markersize=size)
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
    " mu_r g) under all laws: the torque of constant size `cdt` and the elastic-plastic springs `epsd2`,"
    " `epsd` and `epsd3`, whose dashpot acts below the limit only. On a slope, from rest, they differ: for"
    " mu_r above the slope's tangent the springs hold the sphere, as their torque has a history; `cdt` has no"
    " torque at rest and holds it only by a torque whose sign alternates every few steps.",
    source="Rigid-body mechanics; laws: Ai, Chen, Rotter and Ooi, Powder Technol. 206 (2011) 269, A and C.",
    variants=lambda tier: [kit.Variant(label(law, slope), scene(law, slope)) for law, slope in VARIANTS],
    checks=(
        *step_by_step(
            "largest starting speed", lambda run: ROLLS[2][0],
            reason="same law, same scheme: rounding, over 50 000 steps in contact",
            catches="a rolling torque that is stored, limited or projected differently",
        ),
        *(
            kit.per_code(
                f"{law}, on the flat: deceleration, relative error",
                lambda results, code, law=law: flat(results, code, law)["deceleration [m/s2]"],
                tolerance=1e-4, against="closed form", reason="rounding",
                catches="a torque other than mu_r N R*, of the wrong sign, or with its part along the normal",
            )
            for law in LAWS
        ),
        *(
            kit.per_code(
                f"{law}, on the flat: stopping distance, relative error",
                lambda results, code, law=law: flat(results, code, law)["stopping distance [m]"],
                tolerance=tolerance, against="closed form", reason=reason,
                catches="a torque that drives the sphere on, or back, after it has stopped; a dashpot beyond"
                " the limit, or none below it",
            )
            for law, (tolerance, reason) in STOPPING.items()
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
        *(
            kit.per_code(
                f"{law}, held by the slope: way in the second half / way of a free sphere",
                lambda results, code, law=law: held(results, code, law),
                tolerance=1e-6, against="closed form",
                reason="at rest but for the oscillation of the two springs, which epsd2 does not damp",
                catches="a rolling torque that is reset at every step",
            )
            for law in SPRINGS
        ),
    ),
    figures=(kit.Figure(
        "Velocity on the flat and from rest on a slope",
        "Full lines and large marks: cdt; dashed: epsd2; dotted: epsd; dash-dotted and small marks: epsd3."
        " Left: straight lines to rest at the rate 5/7 mu_r g (black: closed form). Right: spheres with mu_r"
        " above the slope's tangent stay at rest, the others accelerate at 5/7 g (sin - mu_r cos).",
        _figure,
    ),),
    tables=(kit.table(
        "Deceleration and stopping distance", "On the flat, under cdt.",
        lambda results, code: flat(results, code, "cdt"), rows="sphere",
    ),),
    features=(
        "rolling cdt", "rolling epsd2", "rolling epsd", "rolling epsd3", "normal hertz", "tangential history",
        "rotation", "gravity", "wall plane",
    ), order=44,
)  # fmt: skip
