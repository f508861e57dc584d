"""From rubber to steel at the same number of steps per contact: error, steps and time of each precision."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from comparisons import kit
from comparisons.cases.dam_break import modulus
from comparisons.cases.dam_break.modulus import CONFIGURATIONS, FLOAT32, FLOAT64, MIXED
from comparisons.cases.side_by_side import plane
from comparisons.kit import number
from comparisons.oracles import step_limit
from comparisons.oracles.bodies import bodies, of_material
from comparisons.oracles.closed_forms import elastic_contact_time, static_overlap
from comparisons.report import plots
from gpudem.scene import Domain, Explicit, Material, Output, Pair, Scene, Time

MODULI = {
    "quick": (1e5, 3.25e9, 2e11),
    "standard": (1e5, 1e6, 5e6, 5e7, 5e8, 3.25e9, 3e10, 2e11),
    "full": tuple(float(e) for e in np.geomspace(1e5, 2e11, 22)),
}
RADIUS, NU, DENSITY = 0.003, 0.34, 1768.0
SPEED, RESTITUTION, GRAVITY = 0.1, 0.9, 9.81
#: Steps in an elastic contact, and in an oscillation at rest; oscillations of a run at rest.
STEPS, SWING, SWINGS = 300, 100, 12
#: Restitution of the ball at rest: its oscillation decays as exp(-b w t), to 1e-9 and less in SWINGS.
DEAD = 0.3
#: A ball at rest is not timed.
UNTIMED = kit.Configurations(FLOAT64, MIXED, FLOAT32)
#: Error above which float32 counts as failed.
FLOAT32_FAILS = 0.01
#: Balls in a side of the square that hits the floor at once; where the square stands [m].
SIDE, PLACE = {"quick": 5, "standard": 20, "full": 30}, 0.7


def _ball(young: float) -> Material:
    return Material(young=young, poisson=NU, density=DENSITY)


def _scene(name: str, young: float, e: float, side: int, height: float, speed: float, **changes) -> Scene:
    spot = PLACE + 2.5 * RADIUS * np.arange(side)
    x, y = np.meshgrid(spot, spot, indexing="ij")
    position = np.stack([x.ravel(), y.ravel(), np.full(side * side, PLACE + height)], axis=1)
    lo, hi = PLACE - 0.05, float(spot[-1]) + 0.05
    return Scene(
        name=name, materials={"ball": _ball(young)}, pairs=[Pair(materials=("ball", "ball"), restitution=e)],
        particles=Explicit(
            position=position, velocity=np.tile([0.0, 0.0, -speed], (side * side, 1)), radius=RADIUS,
            material="ball",
        ),
        walls=[plane("floor", (0, 0, PLACE), (0, 0, 1), "ball")],
        domain=Domain(lo=(lo, lo, lo), hi=(hi, hi, hi)), allow=("time_step",), **changes,
    )  # fmt: skip


def impact(young: float, side: int) -> Scene:
    """A square of balls hits the floor, STEPS steps per elastic contact."""
    step = elastic_contact_time(of_material(_ball(young), RADIUS, wall=True), SPEED) / STEPS
    duration = math.ceil(1.3 * STEPS) * step
    height = RADIUS + 10.5 * SPEED * step
    return _scene(
        "impact", young, RESTITUTION, side, height, SPEED, time=Time(step=step, duration=duration),
        output=Output(trace_every=duration),
    )  # fmt: skip


def rest(young: float) -> Scene:
    """A ball a tenth off its overlap at rest, with SWING steps per oscillation."""
    c = of_material(_ball(young), RADIUS, wall=True)
    overlap, stiffness, _ = step_limit.rest(c, c.mass[0] * GRAVITY)
    step = 2 * math.pi * math.sqrt(c.mass[0] / stiffness) / SWING
    duration = SWING * SWINGS * step
    return _scene(
        "rest", young, DEAD, 1, RADIUS - 0.9 * overlap, 0.0, gravity=(0.0, 0.0, -GRAVITY),
        time=Time(step=step, duration=duration), output=Output(trace_every=duration),
    )  # fmt: skip


def variants(tier: kit.Tier) -> list[kit.Variant]:
    made = []
    for young in MODULI[tier]:
        made += CONFIGURATIONS.variants(f"impact_{young:.3g}", impact(young, SIDE[tier]))
        made += UNTIMED.variants(f"rest_{young:.3g}", rest(young))
    return made + modulus.variants(tier)


Error = Callable[[kit.Results, kit.Configuration, float], float]


def over_moduli(error: Error) -> Callable[[kit.Results, kit.Configuration], dict[str, float]]:
    """A measure of a configuration: error(results, configuration, modulus) of each modulus."""
    return lambda results, by: {f"{y:.3g} Pa": error(results, by, y) for y in MODULI[results.tier]}


def impact_error(results: kit.Results, by: kit.Configuration, young: float) -> float:
    """Largest |rebound - e| of the balls."""
    v = by.run(results, f"impact_{young:.3g}").trace["velocity"][:, :, 2]
    return float(np.abs(-v[-1] / v[0] - RESTITUTION).max())


def depth_error(results: kit.Results, by: kit.Configuration, young: float) -> float:
    """Relative error of the overlap at rest, (m g/k)^(2/3)."""
    run = by.run(results, f"rest_{young:.3g}")
    want = static_overlap(bodies(run.scene, 0, "floor"), GRAVITY)
    return float(abs((RADIUS - (run.trace["position"][-1, 0, 2] - PLACE)) / want - 1))


def from_float64(results: kit.Results, by: kit.Configuration, young: float) -> float:
    """Larger difference from float64 of last velocity / impact speed and of net force at rest / weight."""
    a, b = (one.run(results, f"impact_{young:.3g}").trace["velocity"][-1] for one in (by, FLOAT64))
    rest = [one.run(results, f"rest_{young:.3g}") for one in (by, FLOAT64)]
    weight = bodies(rest[0].scene, 0, "floor").mass[0] * GRAVITY
    c, d = (float(abs(run.trace["force"][-1, 0, 2]) / weight) for run in rest)
    return max(float(np.abs(a - b).max() / SPEED), abs(c - d))


def larger_error(results: kit.Results, by: kit.Configuration, young: float) -> float:
    return max(impact_error(results, by, young), depth_error(results, by, young))


def _curves(ax: Any, results: kit.Results, error: Error) -> None:
    moduli = MODULI[results.tier]
    for by in CONFIGURATIONS.among(results.codes()):
        found = [max(error(results, by, y), 1e-16) for y in moduli]
        ax.loglog(moduli, found, **by.line(marker=by.mark, mfc="none", lw=1.1, ms=6))
    ax.set(xlabel="Young's modulus [Pa]")


def draw(results: kit.Results) -> plots.Figure:
    """Errors of the impact and at rest, against the modulus."""
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.6)
    _curves(left, results, impact_error)
    _curves(right, results, depth_error)
    left.set_ylabel("|rebound - e|")
    right.set_ylabel("overlap at rest, relative error")
    plots.legend(left)
    return figure


def table(results: kit.Results) -> kit.Rows:
    """Steps and time for a second, and errors."""
    rows = []
    for young in MODULI[results.tier]:
        step = FLOAT64.run(results, f"impact_{young:.3g}").scene.time.step
        row = {"E [Pa]": number(young, 3), "steps for 1 s": number(1 / step, 2)}
        for by in CONFIGURATIONS.among(results.codes()):
            timing = by.run(results, f"impact_{young:.3g}").timing
            errors = (error(results, by, young) for error in (impact_error, depth_error))
            row[f"{by.title}: us per ball and step"] = f"{1e6 / timing.rate:.2f}"
            row[f"{by.title}: |rebound - e|; overlap at rest"] = "; ".join(number(e, 2) for e in errors)
        rows.append(row)
    return rows


def draw_choice(results: kit.Results) -> plots.Figure:
    """What a modulus changes in the dam break, which precision it needs, and what it costs."""
    figure, (shift, error, cost) = plots.figure(1, 3, width=plots.WHOLE, height=4.2)
    modulus.draw_shift(shift, results)
    _curves(error, results, larger_error)
    modulus.draw_cost(cost, results)
    error.set(ylabel="larger error of rebound and overlap at rest")
    plots.legend(error, cost)
    for ax in (shift, error, cost):
        ax.set(xlabel="Young's modulus [Pa]", xlim=(6e4, 4e11))
    return figure


def advice(results: kit.Results) -> kit.Rows:
    """Modulus and precision, in sentences with the numbers of this run."""
    moduli, dam = MODULI[results.tier], results.tier in modulus.PLANS
    failed = [y for y in moduli if not larger_error(results, FLOAT32, y) < FLOAT32_FAILS]
    good = max(larger_error(results, MIXED, y) for y in moduli)
    ratio = modulus.speed_up(results).value if dam else math.nan
    cost = f", and takes {1 / ratio:.2f} times the time of float64 in this dam break" if dam else ""
    contact = (
        f"From {number(moduli[0], 3)} to {number(moduli[-1], 3)} Pa the same number of steps per contact"
        " gives the same error, and the steps for a second are proportional to the root of the modulus:"
        " reduce it for time, not for accuracy."
    )
    precision = (
        f"Use mixed or float64 at any modulus (mixed is accurate to {number(good, 2)} on all of these"
        f"{cost}); float32 is off by more than {100 * FLOAT32_FAILS:g} %, without a message,"
        f" from {number(min(failed), 3)} Pa on at {PLACE:g} m from the origin."
    )
    parts = modulus.advice(results) if dam else []
    rows = [("modulus, for a contact", contact), *parts, ("precision", precision)]
    return [{"choose": what, "by": text} for what, text in rows]


CASE = kit.Case(
    name="stiffness",
    title="From rubber to steel",
    purpose=(
        "Young's modulus is often reduced, because the steps for a second are proportional to its root. Here"
        " the number of steps per contact is the same from 0.1 MPa to 200 GPa, and with it the error of an"
        " impact: it does not depend on the modulus in float64, mixed and LIGGGHTS. In float32 it does: the"
        " overlap of a ball at rest becomes nanometers, less than the spacing of its positions, and the ball"
        " stops too early, without a message. What a reduced modulus changes in a flow is another question:"
        " the dam break, over seeds, from 0.1 MPa up to the 3.25 GPa of the paper's balls (full tier)."
    ),
    source="Restitution of the law; overlap at rest (m g/k)^(2/3), Hertz (1882).",
    variants=variants,
    checks=(
        kit.per_configuration(
            CONFIGURATIONS, "rebound, largest error over the moduli", over_moduli(impact_error),
            without=(FLOAT32,), tolerance=2e-3, against="closed form",
            reason=f"first order: some (|ln e| + 0.1)/steps, {STEPS} steps per contact",
            catches="an overlap lost in the rounding of positions",
        ),
        kit.per_configuration(
            CONFIGURATIONS, "overlap at rest, largest relative error over the moduli",
            over_moduli(depth_error), without=(FLOAT32,), tolerance=1e-5, against="closed form",
            reason="the oscillation has decayed to 1e-9; float64 positions at 0.7 m are rounded to 1e-16 m,"
            " overlaps are 1e-8 m",
            catches="a ball that stops before it is at rest",
        ),
        *kit.checks(
            "mixed against float64: last velocity / impact speed, net force at rest / weight, largest",
            lambda results: over_moduli(from_float64)(results, MIXED), 1e-5, against="float64", mark="R",
            reason="forces are rounded to 6e-8, a contact adds some hundred of them",
            catches="positions or velocities accumulated in float32",
        ),
        *modulus.CHECKS,
    ),
    findings=(
        kit.Finding(
            "float32: overlap at rest, largest relative error over the moduli",
            lambda results: kit.largest(over_moduli(depth_error)(results, FLOAT32)), "1",
            "float32 is not accurate here: the overlap is lost in the spacing of positions.",
        ),
        modulus.SPEED_UP,
    ),
    figures=(
        kit.Figure(
            "How stiff: what a modulus changes, which precision it needs, what it costs",
            "Left: the dam break over its seeds, against the hardest; filled marks: significant (p < 0.01)."
            " Middle: impact and ball at rest. Right: stepping only.",
            draw_choice, tiers=modulus.TIERS, section="advice", recorded=True,
        ),
        kit.Figure(
            "Error against the modulus at the same number of steps per contact",
            "Left: impacts at 0.1 m/s, 0.7 m from the origin. Right: a ball that comes to rest. float32 loses"
            " the overlap in the spacing of its positions (6e-8 m there).",
            draw, section="limits",
        ),
    ),
    tables=(
        kit.Table(
            "How stiff: which modulus and precision to use", "Numbers of this run; grains of 3 mm.", advice,
            section="advice", recorded=True,
        ),
        kit.Table(
            "The dam break against the modulus",
            "Means and standard deviations over the seeds, measured as in the dam break's own case.",
            modulus.table, tiers=modulus.TIERS, section="limits", recorded=True,
        ),
        kit.Table(
            "What stiffness costs",
            "Steps of one second at the same number of steps per contact; stepping time of a square of balls"
            " that hit the floor.",
            table, section="limits",
        ),
    ),
    features=("normal hertz", "damping", "gravity", "wall plane", "mixed", "float32", "bulk flow"),
    order=81,
)  # fmt: skip
