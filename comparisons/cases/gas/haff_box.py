"""A granular gas cools between elastic walls: hard spheres against Haff, two soft codes against hard."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from comparisons.cases.gas import scenes as gases
from comparisons.cases.single_contact.checks import CODES
from comparisons.harness.case import Case, Check, Figure, Measured, Results, Table, Tier, Variant
from comparisons.metrics import engines
from comparisons.report import plots
from gpudem.output.run import Run
from gpudem.scene import Box, Contact, Material, Output, Pair, Scene, Time

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure as MatplotlibFigure

HARD = "event_driven"
ENGINES = (*CODES, HARD)
PHI, SPEED, STEPS = 0.1, 1.0, 30
#: Nearly elastic, for Haff's law itself; and as lossy as `haff`, so that soft spheres need few steps.
MILD, LOSSY = 0.98, 0.9
MILD_DURATION, DURATION, EVERY = 0.15, 0.03, 4e-4
#: Two to three collisions of a sphere, in which the gas forgets its lattice [s].
SETTLED = 2.8e-3
EARLY_TIME = 1.5e-3
#: Tier -> hard spheres for Haff's law, spheres for all engines, seeds of all engines, contact time [s].
SIZES: dict[Tier, tuple[int, int, int, float]] = {
    "quick": (2197, 512, 3, 4e-5), "standard": (4096, 512, 8, 4e-5), "full": (8000, 1000, 10, 2e-5),
}  # fmt: skip
#: Seeds of the hard spheres, which are cheap.
HARD_SEEDS = 16
#: Contact times of ever softer spheres [s], gpudem alone.
SOFTER = (8e-5, 1.6e-4)
#: How much slower soft spheres cool, relative, by omega t_c (see SOFT_REASON): at most, and as found.
SOFTNESS, SOFTNESS_RANGE = 1.0, (0.3, 1.2)


def scene(
    count: int, seed: int, restitution: float, contact_time: float, time: Time, output: Output
) -> Scene:
    """The gas with a linear spring through `hooke`, so that every contact lasts equally long."""
    young = gases.spring_young(contact_time, SPEED)
    material = Material(young=young, poisson=gases.POISSON, density=gases.DENSITY)
    return gases.gas_box(
        "haff_box", count, PHI, seed,
        materials={"ball": material, "wall": material},
        pairs=[
            Pair(materials=("ball", "ball"), restitution=restitution),
            Pair(materials=("ball", "wall"), restitution=1.0),
        ],
        contact=Contact(normal="hooke", tangential="off", characteristic_velocity=SPEED),
        walls=[Box(kind="box", name="box", material="wall")], time=time, output=output,
    )  # fmt: skip


def cooling(count: int, seed: int, contact_time: float) -> Scene:
    time = Time(step=contact_time / STEPS, duration=DURATION)
    return scene(count, seed, LOSSY, contact_time, time, Output(history_every=EVERY))


def variants(tier: Tier) -> list[Variant]:
    many, count, seeds, contact_time = SIZES[tier]
    step = contact_time / STEPS
    early = scene(
        512, 1, LOSSY, contact_time, Time(step=step, duration=EARLY_TIME), Output(trace_every=20 * step)
    )
    long, rows = Time(step=step, duration=MILD_DURATION), Output(history_every=EVERY)
    made = [Variant(gases.EARLY, early)]
    made += [
        Variant(label, scene(many, 1, e, contact_time, long, rows), (HARD,))
        for label, e in (("elastic", 1.0), ("mild", MILD))
    ]
    made += [
        Variant(f"seed_{s}", cooling(count, s, contact_time), ENGINES if s <= seeds else (HARD,))
        for s in range(1, HARD_SEEDS + 1)
    ]
    if tier != "quick":
        made += [
            Variant(f"soft_{t:g}_seed_{s}", cooling(count, s, t), ("gpudem",))
            for t in SOFTER
            for s in range(1, seeds + 1)
        ]
    return made


def seeds(results: Results, code: str) -> list[str]:
    return [label for label in results.labels(code) if label.startswith("seed_")]


def pairs(run: Run) -> np.ndarray:
    """Collisions of spheres with spheres since the start, at every row."""
    return (run.history["collisions"] - run.history["wall_collisions"]).to_numpy()


def times(run: Run) -> np.ndarray:
    return run.history["time"].to_numpy()


def rate(results: Results) -> float:
    """Collisions of a sphere with spheres per second [1/s] and (m/s), of the elastic gas."""
    run = results["elastic", HARD]
    time, done = times(run), pairs(run)
    k = int(np.searchsorted(time, SETTLED - 1e-9))
    hits = 2 * (done[-1] - done[k]) / (len(run.scene.state) * (time[-1] - time[k]))
    return float(hits / math.sqrt(gases.temperature(run)[0]))


def haff(results: Results) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(time, T, T by Haff's law) of hard spheres from SETTLED on, rate from the elastic gas, nothing fitted.

    T = T1/(1 + (1 - e^2) omega1 (t - t1)/6)^2, omega1 = rate sqrt(T1)
    """
    run = results["mild", HARD]
    late = times(run) >= SETTLED - 1e-9
    time, t = times(run)[late], gases.temperature(run)[late]
    omega = rate(results) * math.sqrt(t[0])
    return time, t, t[0] / (1 + (1 - MILD**2) * omega * (time - time[0]) / 6) ** 2


def against_haff(results: Results) -> Measured:
    """Largest |T/Haff - 1| over the run."""
    _, t, law = haff(results)
    note = f"T falls by {t[0] / t[-1]:.2f}, {int(pairs(results['mild', HARD])[-1])} collisions"
    return Measured(float(np.abs(t / law - 1).max()), note=note)


def decay(results: Results) -> Measured:
    """-d ln T per collision and sphere against 2 (1 - e^2)/3."""
    run = results["mild", HARD]
    late = times(run) >= SETTLED - 1e-9
    t, done = gases.temperature(run)[late], pairs(run)[late]
    got = float(-np.log(t[-1] / t[0]) * len(run.scene.state) / (done[-1] - done[0]))
    want = 2 * (1 - MILD**2) / 3
    return Measured(abs(got / want - 1), got, want)


def conserved(results: Results) -> Measured:
    """Largest |energy/start - 1| of the elastic gas."""
    energy = results["elastic", HARD].history["kinetic_energy"].to_numpy()
    note = f"{int(pairs(results['elastic', HARD])[-1])} collisions"
    return Measured(float(np.abs(energy / energy[0] - 1).max()), note=note)


def overlap(results: Results) -> Measured:
    return Measured(max(float(run.notes["largest_overlap"]) for _, run in results.of(HARD)))


def slope(run: Run) -> float:
    """d(T^-1/2)/dt [1/m] by a straight line from SETTLED on; by Haff's law it does not depend on T(0)."""
    late = times(run) >= SETTLED - 1e-9
    return float(np.polyfit(times(run)[late], gases.temperature(run)[late] ** -0.5, 1)[0])


def samples(results: Results) -> dict[str, np.ndarray]:
    """Engine -> (seeds,) of the slope of T^-1/2."""
    return {
        code: np.array([slope(results[label, code]) for label in seeds(results, code)])
        for code in results.codes("seed_1")
    }


def against_hard(results: Results, code: str) -> Measured:
    contact_time = SIZES[results.tier][3]
    return engines.gap(samples(results), code, HARD, -SOFTNESS * rate(results) * contact_time)


def codes_apart(results: Results) -> Measured:
    return engines.gap(samples(results), *CODES)


def softening(results: Results) -> list[tuple[float, float, float]]:
    """(omega t_c, how much slower than hard spheres it cools, standard error) by contact time, gpudem."""
    labels, hard, rows = seeds(results, "gpudem"), samples(results)[HARD], []
    for t in (SIZES[results.tier][3], *SOFTER):
        names = labels if t == SIZES[results.tier][3] else [f"soft_{t:g}_{label}" for label in labels]
        soft = np.array([slope(results[name, "gpudem"]) for name in names])
        error = math.hypot(soft.std(ddof=1) / len(soft) ** 0.5, hard.std(ddof=1) / len(hard) ** 0.5)
        rows.append((rate(results) * t, float(1 - soft.mean() / hard.mean()), error / hard.mean()))
    return rows


def softness(results: Results) -> Measured:
    """Relative lag of the slope by omega t_c: straight line through zero."""
    x, y, _ = np.array(softening(results)).T
    got = float(x @ y / (x @ x))
    note = ", ".join(f"{b:+.2%} +- {c:.2%} at {a:.3f}" for a, b, c in softening(results))
    return Measured(got, note=note)


def _cooling(results: Results) -> MatplotlibFigure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.8)
    time, t, law = haff(results)
    left.plot(time, t / law - 1, color="#009e73", lw=1.2, label=f"event-driven, e = {MILD:g}")
    left.axhspan(-0.01, 0.01, color="0.92")
    left.axhline(0, color="k", lw=0.9, label="Haff, rate of the elastic gas")
    left.set(xlabel="time [s]", ylabel="T / Haff - 1", ylim=(-0.02, 0.02))
    for code in samples(results):
        runs = [results[label, code] for label in seeds(results, code)]
        plots.band(right, times(runs[0]), np.array([gases.temperature(run) ** -0.5 for run in runs]), code)
    right.set(xlabel="time [s]", ylabel="T^(-1/2) [s/m]")
    plots.legend(left)
    plots.legend(right)
    return figure


def _softness(results: Results) -> MatplotlibFigure:
    figure, axes = plots.figure()
    x, y, error = np.array(softening(results)).T
    plots.points(axes, x, 100 * y, "gpudem", error=100 * error, linestyle="none", marker="o")
    slope = softness(results).value
    axes.plot([0, x[-1]], [0, 100 * slope * x[-1]], "k", lw=0.9, label=f"{slope:.2f} omega t_c")
    axes.plot(0, 0, "D", color="#009e73", label="event-driven")
    axes.set(xlabel="omega t_c", ylabel="slower cooling, slope of T^(-1/2) [%]")
    plots.legend(axes)
    return figure


def _table(results: Results) -> pandas.DataFrame:
    import pandas

    found = samples(results)
    rows = [
        (plots.name(code), float(t.mean()), float(t.std(ddof=1)), float(t.mean() / found[HARD].mean() - 1))
        for code, t in found.items()
    ]
    columns = ["by", "d(T^-1/2)/dt [1/m]", "standard deviation of a seed [1/m]", "against event-driven [1]"]
    return pandas.DataFrame(rows, columns=columns)


SOFT_REASON = (
    "softness: a spring sends two spheres back a contact time t_c after they touch, as hard ones would of a"
    " diameter smaller by v t_c/2; with the mean v of a collision, sqrt(pi T), that is d omega t_c/2, which"
    " at this density takes 1.4 omega t_c off the rate of collisions, which cool the gas; omega, taken at the"
    " start, falls meanwhile to half, so that up to 1 omega t_c is left"
)
NEEDS = (HARD,)
ALL = (*CODES, HARD)

CASE = Case(
    name="haff_box",
    title="A cooling gas between walls: three engines",
    purpose=(
        "Hard spheres from collision to collision are what soft spheres tend to. Between elastic walls, e ="
        " 0.98, they follow Haff's law with the collision rate that the same gas has without loss: nothing is"
        " fitted. From the same starts, e = 0.9, gpudem and LIGGGHTS cool as the hard spheres do, up to the"
        " scatter of the seeds and an error that grows with omega t_c, the share of time spent in contact."
    ),
    source="Haff (1983); van Noije and Ernst (1998).",
    variants=variants,
    checks=(
        *gases.early_checks(),
        Check(
            name="T against Haff's law, largest relative error (event-driven)", measure=against_haff,
            tolerance=0.01, unit="1", against="Haff's law, rate of the elastic gas", mark="A", needs=NEEDS,
            reason="finite loss in a collision (0.2 %) and the scatter of the rate of some thousand spheres",
            catches="a restitution off by 0.0005, one collision in a hundred missed",
        ),
        Check(
            name="-d ln T per collision and sphere against 2 (1 - e^2)/3, relative error (event-driven)",
            measure=decay, tolerance=0.01, unit="1", against="closed form", mark="A", needs=NEEDS,
            reason="the Sonine correction of the velocities (0.3 %) and scatter; no rate enters",
            catches="a restitution off by 0.0005; a loss counted per sphere instead of per collision",
        ),
        Check(
            name="energy of the elastic gas, largest change (event-driven)", measure=conserved,
            tolerance=1e-11, unit="1", against="conservation", mark="A", needs=NEEDS, reason="rounding",
            catches="any wall or collision that gives or takes energy",
        ),
        Check(
            name="largest overlap at a collision / diameter (event-driven)", measure=overlap, tolerance=1e-9,
            unit="1", against="hard spheres", mark="A", needs=NEEDS,
            reason="rounding of positions after a flight", catches="a collision found late",
        ),
        *(
            Check(
                name=f"slope of T^-1/2, difference from hard spheres / allowed ({code})",
                measure=lambda results, code=code: against_hard(results, code),
                tolerance=1.0, unit="1", against="event-driven hard spheres", mark="X", needs=(code, HARD),
                reason=f"{engines.SIGMAS:g} standard errors over the seeds either way, and towards slower"
                f" cooling {SOFT_REASON}",
                catches="a restitution off by 0.01, which is 10 % of the loss",
            )
            for code in CODES
        ),
        Check(
            name="slope of T^-1/2, difference of the soft codes / allowed", measure=codes_apart,
            tolerance=1.0, unit="1", against="LIGGGHTS", mark="X", needs=ALL,
            reason=f"{engines.SIGMAS:g} standard errors over the seeds; same law, same softness",
            catches="collisions lost by one code after the first milliseconds; side walls that take 2 %",
        ),
        Check(
            name="softness: relative lag of the slope / omega t_c, line through zero (gpudem)",
            measure=softness, tolerance=SOFTNESS_RANGE[1], lo=SOFTNESS_RANGE[0], unit="1", mark="A",
            needs=("gpudem", HARD), against="derivation from the mean contact",
            tiers=("standard", "full"), reason=SOFT_REASON,
            catches="soft spheres that do not tend to hard ones, or whose contact takes another time",
        ),
    ),
    figures=(
        Figure(
            "Haff's law, and three engines on one gas",
            "Left: hard spheres, e = 0.98, against Haff's law without a fit; grey: 1 %. Right: e = 0.9, mean"
            " and range over the seeds.",
            _cooling, needs=NEEDS,
        ),
        Figure(
            "Soft spheres tend to hard ones",
            "How much slower soft spheres cool, with standard errors, against the share of time in contact:"
            " an error of first order in the contact time.",
            _softness, tiers=("standard", "full"), needs=("gpudem", HARD),
        ),
    ),
    tables=(Table("Cooling rate", "Line through T^-1/2, mean over the seeds.", _table, needs=NEEDS),),
    features=("normal hooke", "damping", "wall plane", "sphere-sphere"),
    order=71,
)  # fmt: skip
