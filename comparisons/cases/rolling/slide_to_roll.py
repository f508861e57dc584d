"""Spheres thrown along a floor slide, gain spin, roll: slip time 2 u0/(7 mu g), final speed 5/7 u0."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from comparisons.cases.single_contact.checks import CODES
from comparisons.harness.case import Case, Check, Figure, Measured, Results, Table, Variant
from comparisons.metrics.trace import largest_difference
from comparisons.oracles import closed_forms
from comparisons.oracles.bodies import bodies
from comparisons.report import plots
from gpudem.output.run import Run
from gpudem.scene import Contact, Domain, Explicit, Material, Output, Pair, Plane, Scene, Time

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure as MatplotlibFigure

GRAVITY, RADIUS, SPACING = 9.81, 0.003, 0.03
#: Throwing speed [m/s], direction in the floor's plane, friction with the floor.
THROWS = ((0.5, (1.0, 0.0), 0.3), (1.0, (0.0, 1.0), 0.5), (0.35, (-0.6, 0.8), 0.2))
#: Polystyrene and acrylic softened to 5e6 Pa: friction and weight set this motion, stiffness only its step.
BALL = Material(young=5e6, poisson=0.34, density=1768.0)
FLOOR = Material(young=5e6, poisson=0.37, density=1185.0)
STEP, DURATION, TRACE = 1e-5, 0.08, 4e-5
TOLERANCE = 1e-3
#: Variant -> tangential_damping. The dashpot, which LIGGGHTS adds after the cap, brakes a sphere set down
#: at full slip for as long as its spring is still short: a kick of c_t u0 dt/2 in the first step, 0.3 % of
#: u0 here.
EXACT, DEFAULT = "dashpot_off", "default"


def scene(dashpot: bool) -> Scene:
    """All throws, each at its static overlap: a higher start bounces, a deeper one hops."""
    names = [f"ball_{k}" for k in range(len(THROWS))]
    pairs = [
        Pair(materials=(n, "floor"), restitution=0.5, friction=mu)
        for n, (_, _, mu) in zip(names, THROWS, strict=True)
    ]
    pairs += [Pair(materials=(a, b), restitution=0.5) for k, a in enumerate(names) for b in names[k:]]

    def built(height: float) -> Scene:
        return Scene(
            name="slide_to_roll",
            title=f"spheres thrown along a floor, tangential_damping {'on' if dashpot else 'off'}",
            contact=Contact(tangential_damping=dashpot),
            materials=dict.fromkeys(names, BALL) | {"floor": FLOOR}, pairs=pairs,
            particles=Explicit(
                position=[(0.0, SPACING * k, height) for k in range(len(THROWS))],
                velocity=[(u * d[0], u * d[1], 0.0) for u, d, _ in THROWS],
                radius=RADIUS, material=names,
            ),
            gravity=(0.0, 0.0, -GRAVITY),
            walls=[Plane(name="floor", material="floor", point=(0, 0, 0), normal=(0, 0, 1))],
            domain=Domain(lo=(-0.2, -0.2, -0.001), hi=(0.2, 0.3, 0.05)),
            time=Time(step=STEP, duration=DURATION), output=Output(trace_every=TRACE),
        )  # fmt: skip

    return built(RADIUS - closed_forms.static_overlap(bodies(built(RADIUS), 0, "floor"), GRAVITY))


def motion(run: Run, k: int) -> tuple[np.ndarray, np.ndarray]:
    """(speed along the throw [m/s], R x spin about the rolling axis [m/s]) of throw k in time."""
    x, y = THROWS[k][1]
    velocity, spin = run.trace["velocity"][:, k], run.trace["angular_velocity"][:, k]
    return velocity @ np.array((x, y, 0.0)), RADIUS * (spin @ np.array((-y, x, 0.0)))


def slip_end(run: Run, k: int) -> float:
    """Time [s] at which the slip u - R w would reach zero, from a straight line through its middle half.

    A line, since near the end the tangential spring lets the surface swing about rolling.
    """
    speed, surface = motion(run, k)
    slip, time = speed - surface, run.trace["time"]
    middle = (slip < 0.75 * slip[0]) & (slip > 0.25 * slip[0]) & (time < time[np.argmin(slip)])
    slope, offset = np.polyfit(time[middle], slip[middle], 1)
    return float(-offset / slope)


def worst(results: Results, code: str, quantity: str) -> Measured:
    """Largest relative error of the slip time, the final speed or the final surface speed over the throws."""
    run, rows = results[EXACT, code], []
    for k, (u, _, mu) in enumerate(THROWS):
        end = closed_forms.slip_time(u, mu, GRAVITY)
        speed, spin = closed_forms.slide_to_roll(DURATION, u, mu, GRAVITY, RADIUS)
        last = run.trace["time"] > end + 0.5 * (DURATION - end)
        got, want = {
            "slip time": (slip_end(run, k), end),
            "final speed": (float(motion(run, k)[0][last].mean()), speed),
            "final surface speed": (float(motion(run, k)[1][last].mean()), RADIUS * spin),
        }[quantity]
        rows.append((got, want, f"u0 = {u:g} m/s, mu = {mu:g}"))
    got, want, label = max(rows, key=lambda row: abs(row[0] / row[1] - 1))
    return Measured(abs(got / want - 1), got, want, note=f"largest at {label}")


def _closed_form_checks() -> tuple[Check, ...]:
    catches = {
        "slip time": "friction other than mu N; a moment of inertia other than 2/5 m R^2",
        "final speed": "a moment of inertia other than 2/5 m R^2; friction that goes on while rolling",
        "final surface speed": "a torque arm or spin sign that does not belong to the force",
    }
    return tuple(
        Check(
            name=f"{quantity}, relative error ({code})",
            measure=lambda results, code=code, quantity=quantity: worst(results, code, quantity),
            tolerance=TOLERANCE, unit="1", against="closed form", mark="A", needs=(code,),
            reason="0.1 % asked; sinking in by 0.15 % of R takes half of it, through the lever arm",
            catches=text,
        )
        for code in CODES
        for quantity, text in catches.items()
    )  # fmt: skip


def between(results: Results, column: str) -> Measured:
    """Largest difference between the codes over both traces, by u0; NaN if a sphere does not roll."""
    scale, found = np.array([u for u, _, _ in THROWS]) / (1 if column == "velocity" else RADIUS), 0.0
    for label in results.labels():
        ours, theirs = results[label, "gpudem"], results[label, "liggghts"]
        for k, (u, _, _) in enumerate(THROWS):
            if min(motion(run, k)[1][-1] for run in (ours, theirs)) < 0.5 * u:
                return Measured(float("nan"), note=f"{label}: sphere {k + 1} does not roll at the end")
        found = max(found, largest_difference(ours.trace[column], theirs.trace[column], scale))
    return Measured(found, note=f"{len(THROWS)} throws, {len(results.labels())} variants")


def _figure(results: Results) -> MatplotlibFigure:
    figure, (top, low) = plots.figure(2, 1, height=5.4, sharex=True, height_ratios=(1.5, 1))
    for k, (u, _, mu) in enumerate(THROWS):
        time = results[EXACT, results.codes()[0]].trace["time"]
        exact = np.array([closed_forms.slide_to_roll(t, u, mu, GRAVITY, RADIUS) for t in time])
        curves = {code: motion(results[EXACT, code], k) for code in results.codes()}
        for code, (speed, surface) in curves.items():
            thin = slice(None) if code == "gpudem" else slice(None, None, 60)
            style = "-" if code == "gpudem" else "o"
            label = f"u0 = {u:g} m/s, mu = {mu:g}" if code == "gpudem" else None
            top.plot(time[thin], speed[thin], style, color=plots.SERIES[k], ms=4, label=label)
            top.plot(time[thin], surface[thin], style, color=plots.SERIES[k], ms=4, mfc="none", alpha=0.5)
        first = next(iter(curves.values()))
        low.semilogy(time, np.maximum(np.abs(first[0] - exact[:, 0]), 1e-18), "--", color=plots.SERIES[k])
        if len(curves) > 1:
            gap = np.abs(curves["gpudem"][0] - curves["liggghts"][0])
            low.semilogy(time, np.maximum(gap, 1e-18), "-", color=plots.SERIES[k])
    top.set_ylabel("velocity (full), R x spin (pale) [m/s]")
    low.set(ylabel="difference [m/s]", xlabel="time [s]")
    low.set_title("solid: gpudem - LIGGGHTS, dashed: gpudem - closed form", fontsize=9)
    plots.legend(top)
    return figure


def _table(results: Results) -> pandas.DataFrame:
    import pandas

    rows = []
    for k, (u, _, mu) in enumerate(THROWS):
        final = 5 / 7 * u
        rows.append((u, mu, "closed form", "", closed_forms.slip_time(u, mu, GRAVITY), final, final))
        for (label, code), run in results.runs.items():
            rows.append((u, mu, code, label, slip_end(run, k), *(float(m[-1]) for m in motion(run, k))))
    columns = [
        "u0 [m/s]",
        "mu [1]",
        "by",
        "variant",
        "slip time [s]",
        "final speed [m/s]",
        "final R x spin [m/s]",
    ]
    return pandas.DataFrame(rows, columns=columns)


CASE = Case(
    name="slide_to_roll",
    title="From sliding to rolling",
    purpose=(
        "A sphere thrown flat along a floor slides, is braked by friction and set spinning by it, until"
        " its surface no longer slips; then it must roll on for ever. Friction, torque and moment of"
        " inertia are all in the two numbers 2 u0/(7 mu g) and 5/7 u0, and the change from slip to stick,"
        " with weight on the contact, must neither lose nor gain speed. The codes must agree to rounding"
        " over 8000 steps in contact."
    ),
    source="Rigid-body mechanics; MFIX-DEM verification case 04.",
    variants=lambda tier: [Variant(EXACT, scene(False)), Variant(DEFAULT, scene(True))],
    checks=(
        *(
            Check(
                name=f"{name}, largest difference over the trace / u0",
                measure=lambda results, column=column: between(results, column),
                tolerance=1e-9, unit="1", against="LIGGGHTS", mark="X", needs=CODES,
                reason="same law, same scheme: rounding, over 8000 steps in contact",
                catches="a spring that is stretched, cut or forgotten otherwise in a lasting contact",
            )
            for name, column in (("velocity", "velocity"), ("R x angular velocity", "angular_velocity"))
        ),
        *_closed_form_checks(),
    ),
    figures=(
        Figure(
            "From sliding to rolling",
            "Velocity falls and surface speed rises until they meet at 5/7 u0. Below: the codes differ by"
            " rounding; the closed form, for a rigid sphere, is left by the stretch of the tangential"
            " spring.",
            _figure, needs=CODES,
        ),
    ),
    tables=(Table("Slip time and final speed", "Checked without the tangential dashpot.", _table),),
    features=("normal hertz", "damping", "tangential history", "rotation", "gravity", "wall plane"),
    order=40,
)  # fmt: skip
