"""Spheres thrown along a floor slide, gain spin, roll: slip time 2 u0/(7 mu g), final speed 5/7 u0."""

from __future__ import annotations

import numpy as np

from comparisons import kit
from comparisons.cases.rolling.scenes import GRAVITY, RADIUS, on_plane, step_by_step
from comparisons.metrics.trace import slip_end
from comparisons.oracles import closed_forms
from comparisons.report import plots
from gpudem.output.run import Run
from gpudem.scene import Contact, Material, Scene

#: Throwing speed [m/s], direction in the floor's plane, friction with the floor.
THROWS = ((0.5, (1.0, 0.0), 0.3), (1.0, (0.0, 1.0), 0.5), (0.35, (-0.6, 0.8), 0.2))
NAMES = [f"u0 = {u:g} m/s, mu = {mu:g}" for u, _, mu in THROWS]
#: Polystyrene and acrylic softened to 5e6 Pa: friction and weight set this motion, stiffness only its step.
BALL = Material(young=5e6, poisson=0.34, density=1768.0)
FLOOR = Material(young=5e6, poisson=0.37, density=1185.0)
DURATION = 0.08
#: Variants without and with the tangential dashpot, which LIGGGHTS adds after the friction limit: it slows a
#: sphere set down at full slip while its spring is short, by c_t u0 dt/2 in the first step, 0.3 % of u0.
EXACT, DEFAULT = "dashpot_off", "default"


def scene(dashpot: bool) -> Scene:
    """All throws."""
    return on_plane(
        "slide_to_roll", [{"friction": mu} for _, _, mu in THROWS], materials=(BALL, FLOOR), spacing=0.03,
        velocity=[(u * d[0], u * d[1], 0.0) for u, d, _ in THROWS],
        title=f"spheres thrown along a floor, tangential_damping {'on' if dashpot else 'off'}",
        contact=Contact(tangential_damping=dashpot), lo=(-0.2, -0.2, -0.001), hi=(0.2, 0.3, 0.05),
        step=1e-5, duration=DURATION, every=4e-5,
    )  # fmt: skip


def motion(run: Run, k: int) -> tuple[np.ndarray, np.ndarray]:
    """(speed along the throw [m/s], R x spin about the rolling axis [m/s]) of throw k in time."""
    x, y = THROWS[k][1]
    velocity, spin = run.trace["velocity"][:, k], run.trace["angular_velocity"][:, k]
    return velocity @ np.array((x, y, 0.0)), RADIUS * (spin @ np.array((-y, x, 0.0)))


def final(results: kit.Results, code: str) -> dict[str, dict[str, kit.Compared]]:
    """Slip time, final speed and final surface speed of each throw."""
    run, found = results[EXACT, code], {}
    for k, (u, _, mu) in enumerate(THROWS):
        end, (speed, surface) = closed_forms.slip_time(u, mu, GRAVITY), motion(run, k)
        wanted, spin = closed_forms.slide_to_roll(DURATION, u, mu, GRAVITY, RADIUS)
        last = run.trace["time"] > end + 0.5 * (DURATION - end)
        for quantity, compared in (
            ("slip time [s]", (slip_end(run.trace["time"], speed - surface), end)),
            ("final speed [m/s]", (float(speed[last].mean()), wanted)),
            ("final surface speed [m/s]", (float(surface[last].mean()), RADIUS * spin)),
        ):
            found.setdefault(quantity, {})[NAMES[k]] = compared
    return found


def not_rolling(run: Run) -> str:
    """Which sphere does not roll at the end."""
    slow = (name for k, name in enumerate(NAMES) if motion(run, k)[1][-1] < 0.5 * THROWS[k][0])
    return next((f"{name}: does not roll at the end" for name in slow), "")


def _figure(results: kit.Results) -> plots.Figure:
    ran, curves = results.codes(EXACT), {}
    time = results[EXACT, ran[0]].trace["time"]
    for k, (u, _, mu) in enumerate(THROWS):
        exact = np.array([closed_forms.slide_to_roll(t, u, mu, GRAVITY, RADIUS)[0] for t in time])
        curves[NAMES[k]] = {code: motion(results[EXACT, code], k)[0] for code in ran}, exact
    figure, top, low = plots.curves_and_differences(
        dict.fromkeys(NAMES, time), curves, reference="closed form", width=plots.WHOLE
    )
    for k, color in enumerate(plots.SERIES[: len(THROWS)]):
        for code in ran:
            surface = motion(results[EXACT, code], k)[1]
            top.plot(time, surface, **plots.line_or_marks(code, len(time), color=color), alpha=0.5)
    top.set_ylabel("velocity (full), R x spin (pale) [m/s]")
    low.set(ylabel="difference [m/s]", xlabel="time [s]")
    return figure


CASE = kit.Case(
    name="slide_to_roll", title="From sliding to rolling",
    purpose="A sphere thrown along a floor slides; friction slows it and spins it up until its surface no"
    " longer slips; then it must roll without loss. The slip time 2 u0/(7 mu g) and the final speed 5/7 u0"
    " depend on friction, torque and moment of inertia; the transition from slip to stick, under the weight,"
    " must not change the speed. The codes must agree to rounding over 8000 steps in contact.",
    source="Rigid-body mechanics; MFIX-DEM verification case 04.",
    variants=lambda tier: [kit.Variant(EXACT, scene(False)), kit.Variant(DEFAULT, scene(True))],
    checks=(
        *step_by_step(
            "u0", lambda run: np.array([u for u, _, _ in THROWS]), defect=not_rolling,
            reason="same law, same scheme: rounding, over 8000 steps in contact",
            catches="a spring that is stretched, limited or reset differently in a lasting contact",
        ),
        *kit.per_quantity(
            final,
            {"slip time [s]": "friction other than mu N; a moment of inertia other than 2/5 m R^2",
             "final speed [m/s]":
                 "a moment of inertia other than 2/5 m R^2; friction that continues while rolling",
             "final surface speed [m/s]": "a lever arm or a sign of the torque that does not belong to the"
                 " force"},
            tolerance=1e-3, against="closed form",
            reason="0.1 % is required; an overlap of 0.15 % of R takes half of it, through the lever arm",
        ),
    ),
    figures=(kit.Figure(
        "From sliding to rolling",
        "Velocity decreases and surface speed increases until both are 5/7 u0. Bottom: the codes differ"
        " by rounding; from the closed form, for a rigid sphere, they differ by the stretch of the"
        " tangential spring.",
        _figure,
    ),),
    tables=(
        kit.table("Slip time and final speed", "Without the tangential dashpot.", final, rows="sphere"),
    ),
    features=("normal hertz", "damping", "tangential history", "rotation", "gravity", "wall plane"), order=40,
)  # fmt: skip
