"""An elastic, frictionless gas: collision rate and pressure against Enskog and Carnahan-Starling; energy."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from comparisons.cases.gas import scenes as gases
from comparisons.cases.single_contact.checks import CODES
from comparisons.harness.case import TIERS, Case, Check, Figure, Measured, Results, Table, Tier, Variant
from comparisons.oracles import gas
from comparisons.report import plots
from gpudem.output.run import Run
from gpudem.scene import Contact, Material, Output, Pair, Scene, Time

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure as MatplotlibFigure

#: Volume share -> contact time [s], about a hundredth of the mean free time.
SHARES = {0.1: 1.2e-5, 0.2: 5e-6, 0.3: 2.5e-6}
STEPS, SPEED = 25, 1.0
#: Hard spheres of the same starts: no contact time, no diameter to correct.
HARD = "event_driven"
ENGINES = (*CODES, HARD)
MARKS = {"gpudem": "x", "liggghts": "o", HARD: "+"}
LINES = {"gpudem": "-", "liggghts": ":", HARD: "--"}
#: Precisions that go a million steps.
MILLION = ("float64", "mixed")
#: Mean free times before the gas, off its lattice, counts as in equilibrium, and measured after.
SETTLE, MEASURE = 8, {"quick": 12, "standard": 40, "full": 40}
COUNT = {"quick": 343, "standard": 729, "full": 4096}
#: Rate: 3 to 5 contacts a contact time counted. Pressure: 600 rows with some five contacts each are 3000 and
#: scatter by 2.5 %, Z by 1.7 %; three of that, and 4096 spheres in the full tier.
TOLERANCE = {
    "rate": {"quick": 0.10, "standard": 0.03, "full": 0.02},
    "pressure": {"quick": 0.15, "standard": 0.05, "full": 0.03},
}


def free_time(phi: float) -> float:
    """Mean free time [s] at T = 1 m2/s2 (Enskog)."""
    density = 6 * phi / (math.pi * (2 * gases.RADIUS) ** 3)
    return 1 / gas.collision_rate(2 * gases.RADIUS, density, 1.0, gas.contact_value(phi))


def scene(count: int, phi: float, free_times: int) -> Scene:
    """The gas with a linear spring through `hooke`, so that every contact lasts equally long."""
    contact_time = SHARES[phi]
    young, step = gases.spring_young(contact_time, SPEED), contact_time / STEPS
    duration, early = free_times * free_time(phi), free_times < SETTLE
    every = max(1, round(duration / step / (40 if early else 600))) * step
    return gases.gas_box(
        "elastic_gas", count, phi, 1,
        materials={"ball": Material(young=young, poisson=gases.POISSON, density=gases.DENSITY)},
        pairs=[Pair(materials=("ball", "ball"))],
        contact=Contact(normal="hooke", characteristic_velocity=SPEED),
        time=Time(step=step, duration=duration),
        output=Output(trace_every=every, history_every=None if early else STEPS * step),
    )  # fmt: skip


def variants(tier: Tier) -> list[Variant]:
    shares = {"quick": (0.2,), "standard": (0.1, 0.3), "full": tuple(SHARES)}[tier]
    made = [
        Variant(f"phi_{phi:g}", scene(COUNT[tier], phi, SETTLE + MEASURE[tier]), ENGINES) for phi in shares
    ]
    early = Variant(gases.EARLY, scene(343, 0.2, 2))
    if tier != "full":  # the standard tier's case endurance has a finer gas, of 1e5 steps
        return [early, *made]
    long = [Variant(f"million_{p}", million(), ("gpudem",), {"gpudem": {"precision": p}}) for p in MILLION]
    return [early, *made, *long]


def million() -> Scene:
    """125 spheres for a million steps, a hundred to a contact: some 7000 collisions."""
    one = scene(125, 0.2, 2)
    step = SHARES[0.2] / 100
    return one.replace(
        time={"step": step, "duration": 1e6 * step},
        output={"trace_every": None, "history_every": 500 * step},
    )


def million_drift(results: Results, precision: str) -> Measured:
    """Largest |kinetic energy/start - 1| where nobody touches: there all energy is kinetic."""
    history = results[f"million_{precision}", "gpudem"].history
    apart = history["contacts"].to_numpy() == 0
    energy = history["kinetic_energy"].to_numpy()[apart]
    if min(len(energy), (~apart).sum()) < 200:
        return Measured(float("nan"), note="too few rows with and without contacts")
    tenth = len(energy) // 10
    change = energy[-tenth:].mean() / energy[:tenth].mean() - 1
    note = f"{len(apart)} rows; the last tenth against the first: {change:.1e}"
    return Measured(float(np.abs(energy / energy[0] - 1).max()), note=note)


def shares(results: Results) -> list[float]:
    return [float(label[4:]) for label in results.labels() if label.startswith("phi_")]


def _facts(run: Run, phi: float) -> tuple[float, float, float, float]:
    """(k [N/m], n [1/m3], T [m2/s2], volume share of the hard spheres that these are or equal)."""
    k, edge = gases.stiffness(SHARES[phi]), run.scene.domain.hi[0]
    late = run.history["time"].to_numpy() > SETTLE * free_time(phi)
    t = float(gases.temperature(run)[late].mean())
    d = 2 * gases.RADIUS if run.code == HARD else gas.soft_diameter(2 * gases.RADIUS, k, gases.MASS, t)
    density = len(run.scene.state) / edge**3
    return k, density, t, gas.volume_share(d, density)


def rate(results: Results, code: str, phi: float) -> tuple[float, float]:
    """Collisions of a sphere per second [1/s]: (2 contacts/(N contact time), or counted; Enskog's)."""
    run = results[f"phi_{phi:g}", code]
    _, density, t, share = _facts(run, phi)
    late = run.history["time"].to_numpy() > SETTLE * free_time(phi)
    if code == HARD:
        pairs = counted(run, phi, "collisions")
    else:
        pairs = float(run.history["contacts"].to_numpy()[late].mean()) / SHARES[phi]
    got = 2 * pairs / len(run.scene.state)
    return got, gas.collision_rate(2 * gases.RADIUS, density, t, gas.contact_value(share))


def counted(run: Run, phi: float, column: str) -> float:
    """Growth of a column of hard spheres' history per second, in equilibrium."""
    return gases.growth(run, column, SETTLE * free_time(phi))


def springs(results: Results, code: str, phi: float) -> tuple[np.ndarray, np.ndarray]:
    """(sum of r.F [J], elastic energy [J]) of all contacts at every row of the trace."""
    run = results[f"phi_{phi:g}", code]

    def compute() -> tuple[np.ndarray, np.ndarray]:
        k, edge, d = gases.stiffness(SHARES[phi]), run.scene.domain.hi[0], 2 * gases.RADIUS
        rows = []
        for x in run.trace["position"]:
            overlap = gases.overlaps(x, edge)
            rows.append((float((k * overlap * (d - overlap)).sum()), float((k * overlap**2 / 2).sum())))
        both = np.array(rows)
        return both[:, 0], both[:, 1]

    return results.once(("springs", code, phi), compute)


def pressure(results: Results, code: str, phi: float) -> tuple[float, float]:
    """Z = p V/(N m T) [1]: (1 + mean of sum r.F/(3 N m T), Carnahan and Starling of the diameter).

    Of hard spheres the sum is that of diameter times impulse over the collisions, by the time.
    """
    run = results[f"phi_{phi:g}", code]
    _, _, t, share = _facts(run, phi)
    if code == HARD:
        virial = counted(run, phi, "virial")
    else:
        late = run.trace["time"] > SETTLE * free_time(phi)
        virial = float(springs(results, code, phi)[0][late].mean())
    got = 1 + virial / (3 * len(run.scene.state) * gases.MASS * t)
    return got, gas.compressibility(share)


def worst(results: Results, code: str, quantity: str) -> Measured:
    """Largest relative error of the rate or of Z over the volume shares."""
    measure, rows = {"rate": rate, "pressure": pressure}[quantity], []
    for phi in shares(results):
        got, want = measure(results, code, phi)
        rows.append((abs(got / want - 1), got, want, f"phi = {phi:g}"))
    value, got, want, where = max(rows)
    return Measured(value, got, want, f"largest at {where}")


def energy(results: Results, code: str, phi: float) -> np.ndarray:
    """Kinetic + elastic energy in time, by its start, less 1."""
    run = results[f"phi_{phi:g}", code]
    total = 0.5 * gases.MASS * (run.trace["velocity"] ** 2).sum(axis=(1, 2))
    if code != HARD:
        total = total + springs(results, code, phi)[1]
    return total / total[0] - 1


def drift(results: Results, code: str) -> Measured:
    """Largest |energy/start - 1| over all runs."""
    found = [(float(np.abs(energy(results, code, phi)).max()), f"phi = {phi:g}") for phi in shares(results)]
    return Measured(max(found)[0], note=f"largest at {max(found)[1]}")


def _figure(results: Results) -> MatplotlibFigure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.8)
    grid = np.linspace(0.02, 0.35, 100)
    left.plot(grid, [gas.compressibility(p) for p in grid], "k", lw=0.9, label="Carnahan and Starling")
    for code in results.codes():
        look = plots.style(code, linestyle="none", marker=MARKS[code])
        at = [_facts(results[f"phi_{phi:g}", code], phi)[3] for phi in shares(results)]
        left.plot(at, [pressure(results, code, phi)[0] for phi in shares(results)], **look)
        for k, phi in enumerate(shares(results)):
            time = results[f"phi_{phi:g}", code].trace["time"] / free_time(phi)
            line = LINES[code]
            text = f"phi = {phi:g}" if code == CODES[0] else None
            right.plot(time, energy(results, code, phi), line, color=plots.SERIES[k], lw=0.9, label=text)
    left.set(xlabel="volume share of the equal hard spheres", ylabel="Z = p V/(N m T)")
    right.set(xlabel="time / mean free time", ylabel="energy / start - 1")
    plots.legend(left)
    plots.legend(right)
    return figure


def _table(results: Results) -> pandas.DataFrame:
    import pandas

    rows = []
    for phi in shares(results):
        for code in results.codes():
            rows.append((phi, code, *rate(results, code, phi), *pressure(results, code, phi)))
    columns = ["phi [1]", "by", "collision rate [1/s]", "Enskog [1/s]", "Z [1]", "Carnahan-Starling [1]"]
    return pandas.DataFrame(rows, columns=columns)


QUANTITIES = {
    "rate": (
        "collision rate of a sphere",
        "Enskog theory",
        "pairs missed or found twice",
    ),
    "pressure": ("Z = p V/(N m T)", "Carnahan and Starling", "a stiffness off by 5 %, a wrong image"),
}

CASE = Case(
    name="elastic_gas",
    title="Collision rate and pressure of an elastic gas",
    purpose=(
        "In equilibrium an elastic, frictionless gas has the collision rate of Enskog's theory and the"
        " pressure of Carnahan and Starling's equation, and keeps its energy. With a linear spring each"
        " contact lasts equally long, so that the mean number of contacts at an instant is the rate, and the"
        " pressure follows from positions alone. The spheres overlap by some tenths of a per cent, so that"
        " theory is taken at the diameter of the hard spheres they equal, d - sqrt(pi m T/(2 k))."
        " Hard spheres from the same starts, by events, need no such correction: their collisions are"
        " counted, and their pressure is the sum of impulses."
    ),
    source="Carnahan and Starling (1969); Chapman and Cowling (1970); Barker and Henderson (1967).",
    variants=variants,
    checks=(
        *gases.early_checks(),
        *(
            Check(
                name=f"{name}, relative error, {tier} ({code})",
                measure=lambda results, code=code, quantity=quantity: worst(results, code, quantity),
                tolerance=TOLERANCE[quantity][tier], unit="1", against=against, mark="A", needs=(code,),
                tiers=(tier,),
                reason="three standard deviations of the mean over the contacts seen (rate: at every contact"
                " time, pressure: in 600 rows); the equations themselves are right to 0.3 %",
                catches=catches,
            )
            for quantity, (name, against, catches) in QUANTITIES.items()
            for tier in TIERS
            for code in ENGINES
        ),
        Check(
            name="energy, largest change over the run (event_driven)",
            measure=lambda results: drift(results, HARD),
            tolerance=1e-10, unit="1", against="conservation", mark="A", needs=(HARD,),
            reason="each collision rounds the energy of two, 1e-16 of it, at random",
            catches="a collision rule that is elastic to first order only",
        ),
        *(
            Check(
                name=f"energy, largest change over the run ({code})",
                measure=lambda results, code=code: drift(results, code),
                tolerance=1e-3, unit="1", against="conservation", mark="A", needs=(code,),
                reason=f"velocity Verlet with {STEPS} steps a contact: the step in which a contact begins or"
                " ends errs either way, and the errors do not add up",
                catches="a force that lags by a step, which heats or cools the gas by per cents",
            )
            for code in CODES
        ),
        *(
            Check(
                name=f"energy, largest change over a million steps (gpudem {precision})",
                measure=lambda results, precision=precision: million_drift(results, precision),
                tolerance=1e-4, unit="1", against="conservation", mark="A", needs=("gpudem",),
                tiers=("full",),
                reason="a hundred steps a contact: a sixteenth of what 25 steps may err; the steps in which"
                " contacts begin and end err either way",
                catches="an integrator that heats or cools; positions or velocities added up in float32",
            )
            for precision in MILLION
        ),
    ),
    figures=(
        Figure(
            "Pressure, and energy in time",
            "Left: the three engines on the equation of state. Right: energy wanders by some 1e-4, the error"
            " of the steps in which contacts begin and end (full: gpudem, dotted: LIGGGHTS); of hard spheres"
            " (dashed) it stays to rounding.",
            _figure,
        ),
    ),
    tables=(Table("Collision rate and pressure", "Theory at the diameter of equal hard spheres.", _table),),
    features=("normal hooke", "periodic sides", "sphere-sphere", "mixed precision"),
    order=72,
)  # fmt: skip
