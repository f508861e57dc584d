"""An elastic, frictionless gas: collision rate and pressure against Enskog and Carnahan-Starling; energy."""

from __future__ import annotations

import math

import numpy as np

from comparisons import kit
from comparisons.cases.gas import scenes as gases
from comparisons.cases.gas.checks import EARLY, HARD, early_checks, hard
from comparisons.harness import codes
from comparisons.oracles import gas
from comparisons.report import plots
from gpudem.output.run import Run
from gpudem.scene import Output, Scene, Time

DIAMETER = gases.DIAMETER
#: Volume fraction -> contact time [s], about a hundredth of the mean free time.
FRACTIONS = {0.1: 1.2e-5, 0.2: 5e-6, 0.3: 2.5e-6}
STEPS = 25
#: Precisions that run a million steps.
MILLION = ("float64", "mixed")
#: Mean free times until the gas has left its lattice, and averaged over after that.
SETTLE, MEASURE = 8, {"quick": 12, "standard": 40, "full": 40}
COUNT = {"quick": 343, "standard": 729, "full": 4096}


def free_time(phi: float) -> float:
    """Mean free time [s] at T = 1 m2/s2 (Enskog)."""
    return 1 / gas.collision_rate(DIAMETER, 6 * phi / (math.pi * DIAMETER**3), 1.0, gas.contact_value(phi))


def scene(count: int, phi: float, free_times: int) -> Scene:
    step = FRACTIONS[phi] / STEPS
    duration, early = free_times * free_time(phi), free_times < SETTLE
    every = max(1, round(duration / step / (40 if early else 600))) * step
    return gases.gas_box(
        "elastic_gas", count, phi, 1, **gases.springs(FRACTIONS[phi], 1.0),
        time=Time(step=step, duration=duration),
        output=Output(trace_every=every, history_every=None if early else STEPS * step),
    )  # fmt: skip


def million() -> Scene:
    """125 spheres for a million steps, a hundred per contact: some 7000 collisions."""
    step = FRACTIONS[0.2] / 100
    return scene(125, 0.2, 2).replace(
        time={"step": step, "duration": 1e6 * step},
        output={"trace_every": None, "history_every": 500 * step},
    )


def variants(tier: kit.Tier) -> list[kit.Variant]:
    made = [kit.Variant(EARLY, scene(343, 0.2, 2))]
    for phi in {"quick": (0.2,), "standard": (0.1, 0.3), "full": tuple(FRACTIONS)}[tier]:
        one = scene(COUNT[tier], phi, SETTLE + MEASURE[tier])
        made.append(kit.Variant(f"phi_{phi:g}", one, codes.built_in()))
    if tier == "full":  # the standard tier's case endurance has a finer gas, of 1e5 steps
        for precision in MILLION:
            options = {"gpudem": {"precision": precision}}
            made.append(kit.Variant(f"million_{precision}", million(), ("gpudem",), options))
    return made


def million_drift(results: kit.Results, precision: str) -> kit.Measured:
    """Largest |kinetic energy/start - 1| where no spheres touch: there all energy is kinetic."""
    history = results[f"million_{precision}", "gpudem"].history
    apart = history["contacts"].to_numpy() == 0
    energy = history["kinetic_energy"].to_numpy()[apart]
    if min(len(energy), (~apart).sum()) < 200:
        return kit.Measured(float("nan"), note="too few rows with and without contacts")
    tenth = len(energy) // 10
    change = energy[-tenth:].mean() / energy[:tenth].mean() - 1
    note = f"{len(apart)} rows; the last tenth against the first: {change:.1e}"
    return kit.Measured(float(np.abs(energy / energy[0] - 1).max()), note=note)


def runs(results: kit.Results, code: str) -> dict[float, Run]:
    """Volume fraction -> run."""
    return {float(label[4:]): results[label, code] for label in results.labels(code, prefix="phi_")}


def equilibrium(run: Run, phi: float) -> tuple[float, float, float]:
    """(n [1/m3], T [m2/s2], volume fraction of the hard spheres that these are, or are equal to)."""
    late = run.history["time"].to_numpy() > SETTLE * free_time(phi)
    t = float(gases.temperature(run)[late].mean())
    density = len(run.scene.state) / run.scene.domain.hi[0] ** 3
    k = gases.stiffness(FRACTIONS[phi])
    d = DIAMETER if run.code == HARD else gas.soft_diameter(DIAMETER, k, gases.MASS, t)
    return density, t, gas.volume_share(d, density)


def springs(results: kit.Results, code: str, phi: float) -> tuple[np.ndarray, np.ndarray]:
    """(sum of r.F [J], elastic energy [J]) of all contacts at every row of the trace."""
    run = runs(results, code)[phi]

    def compute() -> tuple[np.ndarray, np.ndarray]:
        k, edge = gases.stiffness(FRACTIONS[phi]), run.scene.domain.hi[0]
        found = [gases.overlaps(x, edge) for x in run.trace["position"]]
        return (
            np.array([(k * overlap * (DIAMETER - overlap)).sum() for overlap in found]),
            np.array([(k * overlap**2 / 2).sum() for overlap in found]),
        )

    return results.once(("springs", code, phi), compute)


def observed(results: kit.Results, code: str, phi: float) -> dict[str, tuple[float, float]]:
    """(observed, by theory): collisions of a sphere per second [1/s], p V/(N m T) [1].

    Soft spheres: 2 contacts/(N contact time) (Enskog), and 1 + mean of sum r.F/(3 N m T) (Carnahan and
    Starling of the diameter). Hard spheres: collisions are counted, and the sum is that of diameter times
    impulse over the collisions, divided by the time.
    """
    run, since = runs(results, code)[phi], SETTLE * free_time(phi)
    (density, t, fraction), count = equilibrium(run, phi), len(run.scene.state)
    if code == HARD:
        pairs, virial = gases.growth(run, "collisions", since), gases.growth(run, "virial", since)
    else:
        touching = run.history["contacts"].to_numpy()[run.history["time"].to_numpy() > since]
        pairs = float(touching.mean()) / FRACTIONS[phi]
        virial = float(springs(results, code, phi)[0][run.trace["time"] > since].mean())
    enskog = gas.collision_rate(DIAMETER, density, t, gas.contact_value(fraction))
    return {
        "collision rate of a sphere": (2 * pairs / count, enskog),
        "Z = p V/(N m T)": (1 + virial / (3 * count * gases.MASS * t), gas.compressibility(fraction)),
    }


def energy(results: kit.Results, code: str, phi: float) -> np.ndarray:
    """(kinetic + elastic energy) / that of the start - 1 in time."""
    total = 0.5 * gases.MASS * (runs(results, code)[phi].trace["velocity"] ** 2).sum(axis=(1, 2))
    if code != HARD:
        total = total + springs(results, code, phi)[1]
    return total / total[0] - 1


def drift(results: kit.Results, code: str) -> dict[str, float]:
    """Largest |energy/start - 1| of each run."""
    return {f"phi = {p:g}": float(np.abs(energy(results, code, p)).max()) for p in runs(results, code)}


#: Name, source, what it detects, tolerance by tier and its reason.
QUANTITIES: tuple[tuple[str, str, str, dict[kit.Tier, float], str], ...] = (
    ("collision rate of a sphere", "Enskog theory", "pairs missed or found twice",
     {"quick": 0.10, "standard": 0.03, "full": 0.02},
     "three standard deviations of the mean over 3 to 5 contacts per contact time"),
    ("Z = p V/(N m T)", "Carnahan and Starling", "a stiffness off by 5 %, a wrong image",
     {"quick": 0.15, "standard": 0.05, "full": 0.03},
     "three standard deviations of the mean over 600 rows with some five contacts each (1.7 %); the full"
     " tier has more spheres"),
)  # fmt: skip


def _figure(results: kit.Results) -> plots.Figure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.8)
    grid = np.linspace(0.02, 0.35, 100)
    left.plot(grid, [gas.compressibility(p) for p in grid], "k", lw=0.9, label="Carnahan and Starling")
    for n, code in enumerate(results.codes()):
        found = runs(results, code)
        at = [equilibrium(run, phi)[2] for phi, run in found.items()]
        z = [observed(results, code, phi)["Z = p V/(N m T)"][0] for phi in found]
        left.plot(at, z, **plots.style(code, linestyle="none", marker="xo+s^"[n % 5]))
        for k, (phi, run) in enumerate(found.items()):
            text = f"phi = {phi:g}" if n == 0 else None
            line = "--" if code == HARD else ("-", ":")[min(n, 1)]
            time = run.trace["time"] / free_time(phi)
            right.plot(time, energy(results, code, phi), line, color=plots.SERIES[k], lw=0.9, label=text)
    left.set(xlabel="volume fraction of equal hard spheres", ylabel="Z = p V/(N m T)")
    right.set(xlabel="time / mean free time", ylabel="energy / start - 1")
    plots.legend(left, right)
    return figure


def _table(results: kit.Results) -> kit.Rows:
    columns = ("collision rate [1/s]", "Enskog [1/s]", "Z [1]", "Carnahan-Starling [1]")
    return [
        {"phi [1]": phi, "code": plots.name(code)}
        | dict(zip(columns, sum(observed(results, code, phi).values(), ()), strict=True))
        for phi in FRACTIONS
        for code in results.codes(f"phi_{phi:g}")
    ]


CASE = kit.Case(
    name="elastic_gas", title="Collision rate and pressure of an elastic gas",
    purpose="An elastic, frictionless gas in equilibrium has the collision rate of Enskog's theory and the"
    " pressure of Carnahan and Starling's equation, and keeps its energy. With a linear spring each contact"
    " lasts equally long, so that the mean number of contacts is proportional to the rate, and the pressure"
    " follows from positions. The spheres overlap by some tenths of a per cent; theory is taken at the"
    " diameter of equal hard spheres, d - sqrt(pi m T/(2 k)). The event-driven engine, from the same starts,"
    " needs no such correction: collisions are counted and impulses summed.",
    source="Carnahan and Starling (1969); Chapman and Cowling (1970); Barker and Henderson (1967).",
    variants=variants,
    checks=(
        *early_checks(),
        *(
            kit.per_code(
                f"{name}, relative error, {{tier}}",
                lambda results, code, name=name: {
                    f"phi = {phi:g}": observed(results, code, phi)[name] for phi in runs(results, code)
                },
                also=(HARD,), tolerance=tolerance, against=against, catches=catches,
                reason=f"{reason}; the equation itself is accurate to 0.3 %",
            )
            for name, against, catches, tolerance, reason in QUANTITIES
        ),
        kit.per_code(
            "energy, largest change over the run", drift, tolerance=1e-3, against="conservation",
            reason=f"{STEPS} steps per contact: the steps in which contacts begin and end have errors of"
            " either sign, which do not accumulate",
            catches="a force that lags by a step, which heats or cools the gas by several per cent",
        ),
        hard(
            f"energy, largest change over the run ({HARD})", lambda results: drift(results, HARD), 1e-10,
            "conservation", "each collision rounds the energy of two spheres by 1e-16 of it, at random",
            "a collision rule that is elastic to first order only",
        ),
        *(
            kit.check(
                f"energy, largest change over a million steps (gpudem {precision})",
                lambda results, precision=precision: million_drift(results, precision),
                tolerance=1e-4, against="conservation", tiers=("full",),
                reason="a hundred steps per contact: a sixteenth of the error of 25 steps",
                catches="an integrator that heats or cools; positions or velocities accumulated in float32",
            )
            for precision in MILLION
        ),
    ),
    figures=(kit.Figure(
        "Pressure, and energy in time",
        "Left: all engines on the equation of state. Right: the energy fluctuates by some 1e-4, the error"
        " of the steps in which contacts begin and end (full: gpudem, dotted: others); that of hard"
        " spheres (dashed) is constant to rounding.",
        _figure,
    ),),
    tables=(kit.Table(
        "Collision rate and pressure", "Theory at the diameter of equal hard spheres.", _table
    ),),
    features=("normal hooke", "periodic sides", "sphere-sphere", "mixed precision"), order=72,
)  # fmt: skip
