"""From rubber to steel at the same number of steps a contact: error, steps and time of each precision."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from comparisons.cases.dam_break import modulus as stiff_dam
from comparisons.cases.dam_break import modulus_checks as stiff_dam_checks
from comparisons.harness.case import Case, Check, Figure, Measured, Results, Table, Tier, Variant
from comparisons.harness.numbers import number
from comparisons.oracles import step_limit
from comparisons.oracles.bodies import bodies
from comparisons.oracles.closed_forms import elastic_contact_time, static_overlap
from comparisons.report import plots
from gpudem.output.run import Run
from gpudem.scene import Domain, Explicit, Material, Output, Pair, Plane, Scene, Time

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure as MatplotlibFigure

CODES = ("gpudem", "liggghts")
#: Who -> (label suffix, code, arguments, colour, mark).
WHO = {
    "gpudem float64": ("float64", "gpudem", {"precision": "float64"}, plots.SERIES[0], "s"),
    "gpudem mixed": ("mixed", "gpudem", {"precision": "mixed"}, plots.SERIES[2], "^"),
    "gpudem float32": ("float32", "gpudem", {"precision": "float32"}, plots.SERIES[3], "v"),
    "LIGGGHTS": ("liggghts", "liggghts", {"use_recorded": False}, plots.SERIES[1], "o"),
}
MODULI = {
    "quick": (1e5, 3.25e9, 2e11),
    "standard": (1e5, 1e6, 5e6, 5e7, 5e8, 3.25e9, 3e10, 2e11),
    "full": tuple(float(e) for e in np.geomspace(1e5, 2e11, 22)),
}
RADIUS, NU, DENSITY = 0.003, 0.34, 1768.0
SPEED, RESTITUTION, GRAVITY = 0.1, 0.9, 9.81
#: Steps in an elastic contact, and in a swing at rest; swings of a run at rest.
STEPS, SWING, SWINGS = 300, 100, 12
#: Restitution of the ball at rest: its swing dies away as exp(-b w t), to 1e-9 and less in SWINGS.
DEAD = 0.3
#: Error above which float32 counts as failed.
FLOAT32_FAILS = 0.01
#: Balls in a side of the square that hits the floor at once; where the square stands [m].
SIDE, PLACE = {"quick": 5, "standard": 20, "full": 30}, 0.7


def _scene(name: str, young: float, e: float, side: int, height: float, speed: float, **changes) -> Scene:
    spot = PLACE + 2.5 * RADIUS * np.arange(side)
    x, y = np.meshgrid(spot, spot, indexing="ij")
    position = np.stack([x.ravel(), y.ravel(), np.full(side * side, PLACE + height)], axis=1)
    lo, hi = PLACE - 0.05, float(spot[-1]) + 0.05
    ball = Material(young=young, poisson=NU, density=DENSITY)
    return Scene(
        name=name, materials={"ball": ball}, pairs=[Pair(materials=("ball", "ball"), restitution=e)],
        particles=Explicit(
            position=position, velocity=np.tile([0.0, 0.0, -speed], (side * side, 1)), radius=RADIUS,
            material="ball",
        ),
        walls=[Plane(name="floor", material="ball", point=(0, 0, PLACE), normal=(0, 0, 1))],
        domain=Domain(lo=(lo, lo, lo), hi=(hi, hi, hi)), allow=("time_step",), **changes,
    )  # fmt: skip


def _probe(young: float, e: float):
    scene = _scene("probe", young, e, 1, RADIUS, 0.0, time=Time(step=1e-9, duration=1e-8))
    return bodies(scene, 0, "floor")


def impact(young: float, side: int) -> Scene:
    """A square of balls hits the floor, STEPS steps to the elastic contact."""
    step = elastic_contact_time(_probe(young, RESTITUTION), SPEED) / STEPS
    duration = math.ceil(1.3 * STEPS) * step
    height = RADIUS + 10.5 * SPEED * step
    return _scene(
        "impact", young, RESTITUTION, side, height, SPEED, time=Time(step=step, duration=duration),
        output=Output(trace_every=duration),
    )  # fmt: skip


def rest(young: float) -> Scene:
    """A ball a tenth off its overlap at rest, with SWING steps to a swing."""
    c = _probe(young, DEAD)
    overlap, stiffness, _ = step_limit.rest(c, c.mass[0] * GRAVITY)
    step = 2 * math.pi * math.sqrt(c.mass[0] / stiffness) / SWING
    duration = SWING * SWINGS * step
    return _scene(
        "rest", young, DEAD, 1, RADIUS - 0.9 * overlap, 0.0, gravity=(0.0, 0.0, -GRAVITY),
        time=Time(step=step, duration=duration), output=Output(trace_every=duration),
    )  # fmt: skip


def variants(tier: Tier) -> list[Variant]:
    made = []
    for young in MODULI[tier]:
        for name, scene in (("impact", impact(young, SIDE[tier])), ("rest", rest(young))):
            for suffix, code, arguments, *_ in WHO.values():
                label, timed = f"{name}_{young:.3g}-{suffix}", name == "impact"
                made.append(Variant(label, scene, (code,), {code: arguments}, timed=timed))
    return made + stiff_dam.variants(tier)


def run_of(results: Results, name: str, young: float, who: str) -> Run:
    """The run of one modulus."""
    suffix, code, *_ = WHO[who]
    return results[f"{name}_{young:.3g}-{suffix}", code]


def rebound_error(run: Run) -> float:
    """Largest |rebound - e| of the balls."""
    v = run.trace["velocity"][:, :, 2]
    return float(np.abs(-v[-1] / v[0] - RESTITUTION).max())


def rest_error(run: Run) -> float:
    """|net force| / weight at the end: zero for a ball at rest."""
    weight = bodies(run.scene, 0, "floor").mass[0] * GRAVITY
    return float(abs(run.trace["force"][-1, 0, 2]) / weight)


def overlap_error(run: Run) -> float:
    """Relative error of the overlap at rest, (m g/k)^(2/3)."""
    want = static_overlap(bodies(run.scene, 0, "floor"), GRAVITY)
    return float(abs((RADIUS - (run.trace["position"][-1, 0, 2] - PLACE)) / want - 1))


def worst(results: Results, who: str, name: str, error) -> Measured:
    """Largest error over the moduli."""
    found = {young: error(run_of(results, name, young, who)) for young in MODULI[results.tier]}
    at = max(found, key=lambda y: math.inf if math.isnan(found[y]) else found[y])
    return Measured(found[at], note=f"largest at {at:.3g} Pa; {len(found)} moduli")


def mixed(results: Results) -> Measured:
    """Largest difference of rebound, relative overlap and net force at rest between mixed and float64."""
    found = {}
    for young in MODULI[results.tier]:
        a, b = (run_of(results, "impact", young, f"gpudem {p}").trace for p in ("mixed", "float64"))
        found[young] = float(np.abs(a["velocity"][-1] - b["velocity"][-1]).max() / SPEED)
        a, b = (run_of(results, "rest", young, f"gpudem {p}") for p in ("mixed", "float64"))
        found[young] = max(found[young], abs(rest_error(a) - rest_error(b)))
    at = max(found, key=lambda y: math.inf if math.isnan(found[y]) else found[y])
    return Measured(found[at], note=f"largest at {at:.3g} Pa")


def draw(results: Results) -> MatplotlibFigure:
    """Errors of the impact and at rest, against the modulus."""
    figure, axes = plots.figure(1, 2, width=plots.WHOLE, height=3.6)
    moduli = np.array(MODULI[results.tier])
    for ax, (name, error) in zip(axes, (("impact", rebound_error), ("rest", overlap_error)), strict=True):
        for who, (_, _, _, colour, mark) in WHO.items():
            found = [max(error(run_of(results, name, y, who)), 1e-16) for y in moduli]
            ax.loglog(moduli, found, marker=mark, color=colour, label=who, mfc="none", lw=1.1, ms=6)
        ax.set(xlabel="Young's modulus [Pa]")
    axes[0].set_ylabel("|rebound - e|")
    axes[1].set_ylabel("overlap at rest, relative error")
    plots.legend(axes[0])
    return figure


def table(results: Results) -> pandas.DataFrame:
    """Steps and time that a second takes, and errors."""
    import pandas

    rows = []
    for young in MODULI[results.tier]:
        step = run_of(results, "impact", young, "gpudem float64").scene.time.step
        row: dict[str, object] = {"E [Pa]": number(young, 3), "steps for 1 s": number(1 / step, 2)}
        for who in WHO:
            run = run_of(results, "impact", young, who)
            micro = 1e6 * run.timing.stepping_s / run.timing.steps / run.timing.particles
            row[f"{who}: us a ball and step"] = f"{micro:.2f}"
            at_rest = run_of(results, "rest", young, who)
            row[f"{who}: |rebound - e|; overlap at rest"] = (
                f"{number(rebound_error(run), 2)}; {number(overlap_error(at_rest), 2)}"
            )
        rows.append(row)
    return pandas.DataFrame(rows)


def draw_choice(results: Results) -> MatplotlibFigure:
    """What a modulus changes in the dam break, what precision it takes, and what it costs."""
    figure, (shift, error, cost) = plots.figure(1, 3, width=plots.WHOLE, height=4.2)
    stiff_dam_checks.draw_shift(shift, results)
    moduli = MODULI[results.tier]
    for who, (_, _, _, colour, mark) in WHO.items():
        found = [max(_error(results, y, who), 1e-16) for y in moduli]
        error.loglog(moduli, found, marker=mark, color=colour, label=who, mfc="none", lw=1.1, ms=5)
    error.set(ylabel="larger error of rebound and overlap at rest")
    plots.legend(error)
    plan = stiff_dam.PLANS[results.tier]
    length = results[stiff_dam.runs(results, plan.hardest)[0]].scene
    for who, (_, _, _, colour, mark) in WHO.items():
        ran = [y for y in plan.moduli if stiff_dam.runs(results, y, who)]
        seconds = [float(np.median(stiff_dam.seconds(results, y, who))) / length.time.duration for y in ran]
        cost.loglog(ran, seconds, marker=mark, color=colour, label=who, mfc="none", lw=1.1, ms=5)
    cost.set(ylabel=f"dam break of {len(length.state)} balls: seconds for 1 s")
    plots.legend(cost)
    for ax in (shift, error, cost):
        ax.set(xlabel="Young's modulus [Pa]", xlim=(6e4, 4e11))
    return figure


def _error(results: Results, young: float, who: str) -> float:
    rebound = rebound_error(run_of(results, "impact", young, who))
    return max(rebound, overlap_error(run_of(results, "rest", young, who)))


def advice(results: Results) -> pandas.DataFrame:
    """Modulus and precision, in sentences with the numbers of this run."""
    import pandas

    moduli = MODULI[results.tier]
    wrong = [y for y in moduli if not _error(results, y, "gpudem float32") < FLOAT32_FAILS]
    good = max(_error(results, y, "gpudem mixed") for y in moduli)
    faster = stiff_dam_checks.speed(results).value if results.tier in stiff_dam.PLANS else math.nan
    modulus = (
        f"From {number(moduli[0], 3)} to {number(moduli[-1], 3)} Pa the same number of steps a contact gives"
        " the same error, and the steps of a second go with the root of the modulus: soften for time, not"
        " for accuracy."
    )
    parts = stiff_dam_checks.advice(results) if results.tier in stiff_dam.PLANS else []
    precision = (
        f"Use mixed or float64 at any modulus (mixed is right to {number(good, 2)} on all of these, and takes"
        f" {1 / faster:.2f} times the time of float64 in this dam break); float32 is off by more than"
        f" {100 * FLOAT32_FAILS:g} %, without a message, from {number(min(wrong), 3)} Pa on at {PLACE:g} m"
        " from the origin."
    )
    rows = [("modulus, for a contact", modulus), *parts, ("precision", precision)]
    return pandas.DataFrame(rows, columns=["choose", "by"])


CASE = Case(
    name="stiffness",
    title="From rubber to steel",
    purpose=(
        "Everyone softens grains, because the steps of a second go with the root of the modulus. Here the"
        " number of steps in a contact is the same from 0.1 MPa to 200 GPa, and with it the error of an"
        " impact: float64, mixed and LIGGGHTS do not see the modulus. float32 does: the overlap of a ball"
        " at rest shrinks to nanometres, less than the spacing of its positions, and the ball freezes where"
        " it is, without a word. What softening changes in a flow is another matter: the dam break, seed by"
        " seed, from 0.1 MPa up to the 3.25 GPa of the paper's balls (full tier)."
    ),
    source="Restitution of the law; overlap at rest (m g/k)^(2/3), Hertz (1882).",
    variants=variants,
    checks=(
        *(
            Check(
                name=f"rebound, largest error over the moduli ({who})",
                measure=lambda results, who=who: worst(results, who, "impact", rebound_error),
                tolerance=2e-3, unit="1", against="closed form", mark="A", needs=(WHO[who][1],),
                reason=f"first order: some (|ln e| + 0.1)/steps, {STEPS} steps in a contact",
                catches="an overlap lost in the rounding of positions",
            )
            for who in ("gpudem float64", "gpudem mixed", "LIGGGHTS")
        ),
        *(
            Check(
                name=f"overlap at rest, largest relative error over the moduli ({who})",
                measure=lambda results, who=who: worst(results, who, "rest", overlap_error),
                tolerance=1e-5, unit="1", against="closed form", mark="A", needs=(WHO[who][1],),
                reason="the swing has died away to 1e-9; float64 positions at 0.7 m carry 1e-16 m, beside"
                " overlaps of 1e-8 m",
                catches="a ball that freezes before it is at rest",
            )
            for who in ("gpudem float64", "gpudem mixed", "LIGGGHTS")
        ),
        Check(
            name="mixed against float64: last velocity / impact speed, net force at rest / weight, largest",
            measure=mixed, tolerance=1e-5, unit="1", against="float64", mark="R",
            reason="forces carry 6e-8, a contact adds up some hundred of them",
            catches="positions or velocities added up in float32",
        ),
        Check(
            name="float32: overlap at rest, largest relative error over the moduli",
            measure=lambda results: worst(results, "gpudem float32", "rest", overlap_error),
            tolerance=math.inf, lo=0.1, unit="1", against="closed form", mark="A",
            reason="shown failing where it fails", catches="a float32 mode that is not float32",
        ),
        *stiff_dam_checks.checks(),
    ),
    figures=(
        Figure(
            "How stiff: what a modulus changes, which precision it takes, what it costs",
            "Left: the dam break over its seeds, against the hardest; full marks: told from it (p < 0.01)."
            " Middle: impact and ball at rest. Right: stepping alone.",
            draw_choice, tiers=stiff_dam_checks.TIERS, needs=CODES, section="advice", recorded=True,
        ),
        Figure(
            "Error against the modulus at the same number of steps a contact",
            "Left: impacts at 0.1 m/s, 0.7 m from the origin. Right: a ball that comes to rest. float32 loses"
            " the overlap in the spacing of its positions (6e-8 m there).",
            draw, needs=CODES, section="limits",
        ),
    ),
    tables=(
        Table(
            "How stiff: which modulus and precision to use", "Numbers of this run; grains of 3 mm.", advice,
            needs=CODES, section="advice", recorded=True,
        ),
        Table(
            "The dam break against the modulus",
            "Means and standard deviations over the seeds, measured as in the dam break's own case.",
            stiff_dam_checks.table, tiers=stiff_dam_checks.TIERS, needs=CODES, section="limits",
            recorded=True,
        ),
        Table(
            "What stiffness costs",
            "Steps of one second at the same number of steps a contact; stepping time of a square of balls"
            " that hit the floor.",
            table, needs=CODES, section="limits",
        ),
    ),
    features=("normal hertz", "damping", "gravity", "wall plane", "mixed", "float32", "bulk flow"),
    order=81,
)  # fmt: skip
