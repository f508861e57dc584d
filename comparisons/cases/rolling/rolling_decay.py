"""Rolling friction: roll-out on a floor at 5/7 mu_r g; a slope, on which `epsd2` holds and `cdt` creeps."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from comparisons.cases.single_contact.checks import CODES
from comparisons.harness.case import Case, Check, Figure, Measured, Results, Table, Variant
from comparisons.metrics.trace import largest_difference
from comparisons.oracles.bodies import bodies
from comparisons.oracles.rolling import Arm, resisted
from comparisons.report import plots
from gpudem.output.run import Run
from gpudem.scene import Contact, Domain, Explicit, Material, Output, Pair, Plane, Scene, Time

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure as MatplotlibFigure

GRAVITY, RADIUS, FRICTION = 9.81, 0.003, 0.6
LAWS = ("cdt", "epsd2")
#: Flat: starting speed [m/s], rolling friction.
ROLLS = ((0.10, 0.10), (0.06, 0.05), (0.15, 0.20))
#: Slope [deg], and rolling friction as a multiple of its tangent: below 1 a sphere rolls down from rest.
SLOPE, SHARES = 10.0, (0.3, 0.6, 0.9, 1.1, 2.0)
BALL = Material(young=1e8, poisson=0.34, density=1768.0)
FLOOR = Material(young=1e8, poisson=0.37, density=1185.0)
STEP, TRACE, FLAT_TIME, SLOPE_TIME = 4e-6, 4e-4, 0.2, 0.1


def scene(law: str, slope: float) -> Scene:
    """All spheres of one law on one slope [deg] at their static overlap; on the flat they roll already."""
    tangent = math.tan(math.radians(slope))
    rows = [(0.0, share * tangent) for share in SHARES] if slope else list(ROLLS)
    angle, names = math.radians(slope), [f"ball_{k}" for k in range(len(rows))]
    pairs = [
        Pair(materials=(n, "floor"), restitution=0.5, friction=FRICTION, rolling_friction=mu)
        for n, (_, mu) in zip(names, rows, strict=True)
    ]
    pairs += [Pair(materials=(a, b), restitution=0.5) for k, a in enumerate(names) for b in names[k:]]

    def built(overlap: float) -> Scene:
        lever = RADIUS - overlap / 2
        return Scene(
            name=f"{law}_{slope:g}", materials=dict.fromkeys(names, BALL) | {"floor": FLOOR}, pairs=pairs,
            contact=Contact(rolling=law),  # pyright: ignore[reportArgumentType]
            particles=Explicit(
                position=[(0.0, 0.01 * k, RADIUS - overlap) for k in range(len(rows))],
                velocity=[(u, 0.0, 0.0) for u, _ in rows],
                angular_velocity=[(0.0, u / lever, 0.0) for u, _ in rows], radius=RADIUS, material=names,
            ),
            gravity=(GRAVITY * math.sin(angle), 0.0, -GRAVITY * math.cos(angle)),
            walls=[Plane(name="floor", material="floor", point=(0, 0, 0), normal=(0, 0, 1))],
            domain=Domain(lo=(-0.01, -0.01, -0.001), hi=(0.1, 0.01 * len(rows), 0.01)),
            time=Time(step=STEP, duration=SLOPE_TIME if slope else FLAT_TIME),
            output=Output(trace_every=TRACE),
        )  # fmt: skip

    return built(arm(built(0.0), slope).overlap)


def arm(stated: Scene, slope: float) -> Arm:
    """Static overlap and lever arm on a slope [deg], the same for all spheres."""
    return Arm.of(bodies(stated, 0, "floor"), GRAVITY * math.cos(math.radians(slope)))


def label(law: str, slope: float) -> str:
    return f"{law}_{'slope' if slope else 'flat'}"


VARIANTS = [(law, slope) for law in LAWS for slope in (0.0, SLOPE)]


def speed(run: Run, k: int) -> np.ndarray:
    return run.trace["velocity"][:, k, 0]


def braking(run: Run, k: int) -> float:
    """du/dt [m/s2] of a rolling sphere from 10 to 90 % of its way to rest."""
    u0 = ROLLS[k][0]
    moving = (speed(run, k) < 0.9 * u0) & (speed(run, k) > 0.1 * u0)
    return float(np.polyfit(run.trace["time"][moving], speed(run, k)[moving], 1)[0])


def distance(run: Run, k: int) -> float:
    """Way [m] rolled at the end of the run, at rest."""
    return float(run.trace["position"][-1, k, 0] - run.trace["position"][0, k, 0])


def flat(results: Results, law: str, code: str, quantity: str) -> Measured:
    """Largest relative error of the deceleration or the stopping distance u0^2/(2 a)."""
    run, rows = results[label(law, 0), code], []
    for k, (u0, mu) in enumerate(ROLLS):
        rate = resisted(arm(run.scene, 0), 0.0, mu, GRAVITY)
        got, want = (braking(run, k), rate) if quantity == "deceleration" else (
            distance(run, k), u0**2 / (-2 * rate)
        )  # fmt: skip
        rows.append((abs(got / want - 1), got, want, f"u0 = {u0:g} m/s, mu_r = {mu:g}"))
    value, got, want, where = max(rows)
    return Measured(value, got, want, f"largest at {where}")


def sloping(results: Results, law: str, code: str) -> Measured:
    """Largest error of the acceleration of those that roll, by 5/7 g sin(slope)."""
    run, rows, angle = results[label(law, SLOPE), code], [], math.radians(SLOPE)
    time = run.trace["time"]
    for k, share in enumerate(SHARES):
        if share < 1:
            late = time > SLOPE_TIME / 2
            got = float(np.polyfit(time[late], speed(run, k)[late], 1)[0])
            want = resisted(arm(run.scene, SLOPE), angle, share * math.tan(angle), GRAVITY)
            scale = 5 / 7 * GRAVITY * math.sin(angle)
            rows.append((abs(got - want) / scale, got, want, f"mu_r = {share:g} tan(slope)"))
    value, got, want, where = max(rows)
    return Measured(value, got, want, f"largest at {where}")


def creep(results: Results, law: str, code: str) -> float:
    """Way [m] in the second half of the run of the sphere that moves most of those to be held."""
    run = results[label(law, SLOPE), code]
    half = len(run.trace["time"]) // 2
    x = run.trace["position"][:, :, 0]
    return float(max(abs(x[-1, k] - x[half, k]) for k, share in enumerate(SHARES) if share > 1))


def held(results: Results, code: str) -> Measured:
    """Way down the slope of a sphere that mu_r should hold, by the way of a free one in that time."""
    free = 5 / 7 * GRAVITY * math.sin(math.radians(SLOPE)) / 2 * (SLOPE_TIME**2 - (SLOPE_TIME / 2) ** 2)
    return Measured(
        creep(results, "epsd2", code) / free, note=f"cdt: {creep(results, 'cdt', code) / free:.2g}"
    )


def between(results: Results, column: str) -> Measured:
    """Largest difference between the codes over all traces, by the largest starting speed (or it / R)."""
    found, scale = {}, ROLLS[2][0] / (1.0 if column == "velocity" else RADIUS)
    for name in (label(*v) for v in VARIANTS):
        a, b = (results[name, code].trace[column] for code in CODES)
        found[name] = largest_difference(a, b, scale)
    worst = max(found, key=lambda name: np.nan_to_num(found[name], nan=np.inf))
    return Measured(found[worst], note=f"{len(found)} scenes; largest in {worst}")


def _figure(results: Results) -> MatplotlibFigure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.8)
    for k, (u0, mu) in enumerate(ROLLS):
        for law, line in zip(LAWS, ("-", "--"), strict=True):
            for code in results.codes(label(law, 0)):
                run = results[label(law, 0), code]
                if code == CODES[0]:
                    text = f"{law}, mu_r = {mu:g}"
                    left.plot(run.trace["time"], speed(run, k), line, color=plots.SERIES[k], label=text)
                else:
                    left.plot(run.trace["time"][::25], speed(run, k)[::25], "o" if law == "cdt" else "s",
                              color=plots.SERIES[k], ms=5, mfc="none")  # fmt: skip
        rate = resisted(arm(results[label("cdt", 0), results.codes()[0]].scene, 0), 0.0, mu, GRAVITY)
        left.plot([0, -u0 / rate], [u0, 0], color="k", lw=0.6)
    left.set(xlabel="time [s]", ylabel="velocity [m/s]", title="on the flat")
    plots.legend(left)
    for law, line in zip(LAWS, ("-", "--"), strict=True):
        run = results[label(law, SLOPE), CODES[0]]
        for k, share in enumerate(SHARES):
            right.plot(run.trace["time"], speed(run, k), line, color=plots.SERIES[k],
                       label=f"mu_r = {share:g} tan(slope)" if law == "cdt" else None)  # fmt: skip
    right.set(xlabel="time [s]", title=f"from rest on {SLOPE:g} degrees")
    plots.legend(right)
    return figure


def _table(results: Results) -> pandas.DataFrame:
    import pandas

    rows = []
    for k, (u0, mu) in enumerate(ROLLS):
        rate = resisted(arm(results[label("cdt", 0), results.codes()[0]].scene, 0), 0.0, mu, GRAVITY)
        rows.append((u0, mu, "closed form", "", -rate, u0**2 / (-2 * rate)))
        for law in LAWS:
            for code in results.codes(label(law, 0)):
                run = results[label(law, 0), code]
                rows.append((u0, mu, code, law, -braking(run, k), distance(run, k)))
    columns = ["u0 [m/s]", "mu_r [1]", "by", "law", "deceleration [m/s2]", "stopping distance [m]"]
    return pandas.DataFrame(rows, columns=columns)


CATCHES = {
    "deceleration": "a torque other than mu_r N R*, of the wrong sign, or with its part along the normal",
    "stopping distance": "a torque that drives the sphere on, or back, after it has stopped",
}

CASE = Case(
    name="rolling_decay",
    title="Rolling friction: roll-out and slope",
    purpose=(
        "Spheres that roll on a floor are braked by rolling friction at 5/7 mu_r g and stop after"
        " 7 u0^2/(10 mu_r g), whichever of the two laws acts: the torque of constant size `cdt`, or the"
        " elastic-plastic spring `epsd2`. From rest on a slope the laws part: with mu_r above the slope's"
        " tangent `epsd2` holds the sphere, since its torque is kept from step to step; `cdt` has no torque"
        " at rest and holds it only by turning its sign every few steps."
    ),
    source="Rigid-body mechanics; laws: Ai, Chen, Rotter and Ooi, Powder Technol. 206 (2011) 269, A and C.",
    variants=lambda tier: [Variant(label(law, slope), scene(law, slope)) for law, slope in VARIANTS],
    checks=(
        *(
            Check(
                name=f"{name}, largest difference over the trace / largest starting speed",
                measure=lambda results, column=column: between(results, column),
                tolerance=1e-9, unit="1", against="LIGGGHTS", mark="X", needs=CODES,
                reason="same law, same scheme: rounding, over 50 000 steps in contact",
                catches="a rolling torque that is kept, cut or projected otherwise",
            )
            for name, column in (("velocity", "velocity"), ("R x angular velocity", "angular_velocity"))
        ),
        *(
            Check(
                name=f"{law}, on the flat: {quantity}, relative error ({code})",
                measure=lambda results, law=law, code=code, quantity=quantity: flat(
                    results, law, code, quantity
                ),
                tolerance=1e-4, unit="1", against="closed form", mark="A", needs=(code,),
                reason="rounding for the rate; the springs that swing at the stop move it by 2e-5 of the way",
                catches=CATCHES[quantity],
            )
            for law in LAWS
            for code in CODES
            for quantity in CATCHES
        ),
        *(
            Check(
                name=f"{law}, down the slope: acceleration, largest error / (5/7 g sin(slope)) ({code})",
                measure=lambda results, law=law, code=code: sloping(results, law, code),
                tolerance=1e-6, unit="1", against="closed form", mark="A", needs=(code,),
                reason="the dashpot has ended the swing of the spring: rounding, through a straight line",
                catches="a rolling torque that goes by m g instead of the normal force",
            )
            for law in LAWS
            for code in CODES
        ),
        *(
            Check(
                name=f"epsd2, held by the slope: way in the second half / way of a free sphere ({code})",
                measure=lambda results, code=code: held(results, code),
                tolerance=1e-6, unit="1", against="closed form", mark="A", needs=(code,),
                reason="at rest but for the swing of the two springs, which epsd2 does not damp",
                catches="a rolling torque that is forgotten from step to step",
            )
            for code in CODES
        ),
    ),
    figures=(
        Figure(
            "Velocity on the flat and from rest on a slope",
            "Left: straight lines to rest at the rate 5/7 mu_r g (black: closed form; marks: LIGGGHTS);"
            " full cdt, dashed epsd2. Right: spheres with mu_r above the slope's tangent stay, the others"
            " run off at 5/7 g (sin - mu_r cos).",
            _figure,
        ),
    ),
    tables=(Table("Deceleration and stopping distance", "On the flat.", _table),),
    features=(
        "rolling cdt", "rolling epsd2", "normal hertz", "tangential history", "rotation", "gravity",
        "wall plane",
    ),
    order=44,
)  # fmt: skip
