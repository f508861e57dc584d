"""A granular gas cools in a periodic box: T = T0/(1 + t/tau)^2 (Haff), over several seeds."""

from __future__ import annotations

from typing import Any

import numpy as np

from comparisons import kit
from comparisons.cases.gas import scenes as gases
from comparisons.cases.gas.checks import EARLY, HARD, early_checks
from comparisons.harness import codes
from comparisons.oracles import gas
from comparisons.report import plots
from gpudem.scene import Output, Pair, Scene, Time

PHI, RESTITUTION = 0.1, 0.9
DURATION, EARLY_TIME, SETTLED = 0.03, 1.5e-3, 2e-3
#: Tier -> spheres, seeds, Young's modulus [Pa], step [s] (a thirtieth of the contact time at 2 m/s).
SIZES: dict[kit.Tier, tuple[int, int, float, float]] = {
    "quick": (500, 1, 5e8, 1.5e-6), "standard": (1000, 4, 2e9, 8e-7), "full": (8000, 4, 5e9, 5e-7),
}  # fmt: skip


def scene(count: int, seed: int, young: float, step: float, duration: float, **output: Any) -> Scene:
    return gases.gas_box(
        "haff", count, PHI, seed,
        materials={"ball": gases.material(young)},
        pairs=[Pair(materials=("ball", "ball"), restitution=RESTITUTION)],
        time=Time(step=step, duration=duration), output=Output(**output),
    )  # fmt: skip


def variants(tier: kit.Tier) -> list[kit.Variant]:
    count, many, young, step = SIZES[tier]
    made = [kit.Variant(EARLY, scene(500, 1, 5e8, 1.5e-6, EARLY_TIME, trace_every=6e-5))]
    for s in range(1, many + 1):
        cooling = scene(count, s, young, step, DURATION, history_every=2e-4)
        made.append(kit.Variant(f"seed_{s}", cooling, codes.built_in()))
    return made


def theory(results: kit.Results, code: str) -> float:
    """d(T^-1/2)/dt [1/m] by Enskog's theory."""
    scene = results["seed_1", code].scene
    return gas.haff_slope(gases.DIAMETER, len(scene.state) / scene.domain.hi[0] ** 3, RESTITUTION)


def slopes(results: kit.Results, code: str) -> np.ndarray:
    """(seeds,) of d(T^-1/2)/dt [1/m], from two collisions of each sphere on."""
    return gases.cooling(results, code, SETTLED)[2]


def against_theory(results: kit.Results, code: str) -> kit.Measured:
    """Mean slope over the seeds against Enskog's, relative."""
    got, want = slopes(results, code), theory(results, code)
    spread = float(np.std(got, ddof=1) / want) if len(got) > 1 else float("nan")
    note = f"{len(got)} seeds, standard deviation of one {spread:.2%}"
    return kit.Measured(abs(float(got.mean()) / want - 1), float(got.mean()), want, note)


def straight(results: kit.Results, code: str) -> float:
    """Largest distance of T^-1/2, mean of the seeds, from its straight line, by its rise over the run."""
    time, values, _ = gases.cooling(results, code, SETTLED)
    late = time > SETTLED
    mean = values.mean(axis=0)[late]
    line = np.polyval(np.polyfit(time[late], mean, 1), time[late])
    return float(np.abs(mean - line).max() / np.ptp(line))


def difference(results: kit.Results, code: str, other: str) -> kit.Measured:
    """Difference of the mean slopes of two codes, by the theory's."""
    got, want = (float(slopes(results, c).mean()) for c in (code, other))
    return kit.Measured(abs(got - want) / theory(results, code), got, want)


def momentum(results: kit.Results) -> float:
    """Change of the center-of-mass velocity over the early run, by the rms velocity of 1 m/s."""
    velocity = results[EARLY, "gpudem"].trace["velocity"]
    return float(np.abs(velocity[-1].mean(axis=0) - velocity[0].mean(axis=0)).max())


def _figure(results: kit.Results) -> plots.Figure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.8)
    ran = results.codes("seed_1")
    for code in ran:
        time, values, _ = gases.cooling(results, code, SETTLED)
        plots.band(left, time, values**-2, code)
        plots.band(right, time, values, code)
    time = np.linspace(0, DURATION, 200)
    line = gases.temperature(results["seed_1", ran[0]])[0] ** -0.5 + theory(results, ran[0]) * time
    left.plot(time, line**-2, "k", lw=0.9, label="Enskog")
    right.plot(time, line, "k", lw=0.9, label="Enskog")
    left.set(xlabel="time [s]", ylabel="T [m2/s2]", yscale="log")
    right.set(xlabel="time [s]", ylabel="T^(-1/2) [s/m]")
    plots.legend(left, right)
    return figure


def _table(results: kit.Results) -> kit.Rows:
    return [
        {"seed": f"seed_{seed}", "code": plots.name(code), "d(T^-1/2)/dt [1/m]": slope,
         "Enskog [1/m]": (want := theory(results, code)), "relative difference [1]": slope / want - 1}
        for code in results.codes("seed_1")
        for seed, slope in enumerate(slopes(results, code), 1)
    ]  # fmt: skip


CASE = kit.Case(
    name="haff", title="A cooling granular gas: Haff's law",
    purpose="A gas of inelastic spheres in a periodic box loses (1 - e^2)/4 m v_n^2 in each collision, and"
    " the collisions become rarer as it cools: T = T0/(1 + t/tau)^2. Thousands of collisions at all speeds"
    " and angles, in the bulk and across the periodic sides, must have the restitution and the collision rate"
    " of theory. The trajectories are chaotic: the codes are compared step by step over the first collisions,"
    " and by their means over seeds after that. Hard spheres from the same initial states show what Enskog's"
    " theory neglects.",
    source="Haff (1983); van Noije and Ernst (1998), Sonine coefficient; Carnahan and Starling (1969).",
    variants=variants,
    checks=(
        *early_checks(),
        kit.per_code(
            "slope of T^-1/2, mean over the seeds, relative error, {tier}", against_theory, also=(HARD,),
            tolerance={"quick": 0.10, "standard": 0.06, "full": 0.06}, against="Enskog theory",
            reason="a seed of 1000 spheres (some 7000 collisions) scatters by 1 to 2 %; Enskog's theory"
            " neglects the correlation of velocities, which slows the cooling by about 3 % at e = 0.9",
            catches="a restitution off by 0.005, 5 % of collisions missed, damping that depends on speed",
        ),
        kit.per_code(
            "T^-1/2 against its straight line, largest distance / rise", straight, also=(HARD,),
            tolerance=0.05, against="Haff's law",
            reason="scatter of the collisions in a tenth of the run, some 2 to 3 %",
            catches="a restitution that depends on speed: the curve of viscoelastic spheres is bent",
        ),
        kit.per_pair(
            "slope of T^-1/2, difference of the codes' means / Enskog's slope", difference, tolerance=0.06,
            reason="chaotic: three standard deviations of the difference of two means, 1.5 % each",
            catches="collisions lost by one code after the first milliseconds",
        ),
        kit.check(
            "velocity of the center of mass, change / rms velocity", momentum, tolerance=1e-12,
            against="conservation", reason="equal and opposite forces, up to rounding of their sum",
            catches="a contact across a periodic side that acts on one sphere only",
        ),
    ),
    figures=(kit.Figure(
        "Temperature of the cooling gas",
        "Mean and range over the seeds. Right: by Haff's law a straight line; its slope is the collision"
        " rate times the loss in a collision.",
        _figure,
    ),),
    tables=(kit.Table("Cooling rate", "Straight line through T^-1/2 from 2 ms on.", _table),),
    features=("normal hertz", "damping", "periodic sides", "sphere-sphere"), order=70,
)  # fmt: skip
