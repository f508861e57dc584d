"""A granular gas cools between elastic walls: hard spheres against Haff's law, soft codes against hard."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from comparisons import kit
from comparisons.cases.gas import scenes as gases
from comparisons.cases.gas.checks import EARLY, HARD, collisions, conserved, early_checks, hard, no_overlap
from comparisons.harness import codes
from comparisons.metrics import engines
from comparisons.report import plots
from gpudem.scene import Box, Output, Scene, Time

PHI, STEPS = 0.1, 30
#: Nearly elastic, for Haff's law itself; and as dissipative as `haff`, so that soft spheres need few steps.
MILD, LOSSY = 0.98, 0.9
MILD_DURATION, DURATION, EVERY, EARLY_TIME = 0.15, 0.03, 4e-4, 1.5e-3
#: Two to three collisions of a sphere, in which the gas loses its lattice [s]; less a tie with a row.
SETTLED = 2.8e-3 - 1e-9
#: Tier -> hard spheres for Haff's law, spheres for all engines, seeds of all engines, contact time [s].
SIZES: dict[kit.Tier, tuple[int, int, int, float]] = {
    "quick": (2197, 512, 3, 4e-5), "standard": (4096, 512, 8, 4e-5), "full": (8000, 1000, 10, 2e-5),
}  # fmt: skip
#: Seeds of the hard spheres, which cost little.
HARD_SEEDS = 16
#: Contact times of ever softer spheres [s], gpudem only.
SOFTER = (8e-5, 1.6e-4)
#: How much slower soft spheres cool, relative, by omega t_c (see SOFT_REASON): at most, and as found.
SOFTNESS, SOFTNESS_RANGE = 1.0, (0.3, 1.2)


def scene(
    count: int, seed: int, restitution: float, contact_time: float, duration: float, **output: Any
) -> Scene:
    return gases.gas_box(
        "haff_box", count, PHI, seed,
        **gases.springs(contact_time, restitution, "wall", tangential="off"),
        walls=[Box(kind="box", name="box", material="wall")],
        time=Time(step=contact_time / STEPS, duration=duration), output=Output(**output),
    )  # fmt: skip


def variants(tier: kit.Tier) -> list[kit.Variant]:
    many, count, number, t_c = SIZES[tier]
    made = [kit.Variant(EARLY, scene(512, 1, LOSSY, t_c, EARLY_TIME, trace_every=20 * (t_c / STEPS)))]
    for label, e in (("elastic", 1.0), ("mild", MILD)):
        made.append(kit.Variant(label, scene(many, 1, e, t_c, MILD_DURATION, history_every=EVERY), (HARD,)))
    for s in range(1, HARD_SEEDS + 1):
        cooling = scene(count, s, LOSSY, t_c, DURATION, history_every=EVERY)
        made.append(kit.Variant(f"seed_{s}", cooling, codes.built_in() if s <= number else (HARD,)))
    for t in SOFTER if tier in kit.LONG else ():
        for s in range(1, number + 1):
            cooling = scene(count, s, LOSSY, t, DURATION, history_every=EVERY)
            made.append(kit.Variant(f"soft_{t:g}_seed_{s}", cooling, ("gpudem",)))
    return made


def settled(results: kit.Results, label: str) -> tuple[np.ndarray, np.ndarray, float]:
    """Hard spheres from SETTLED on: (times [s], T [m2/s2], collisions with each other meanwhile)."""
    run = results[label, HARD]
    time = run.history["time"].to_numpy()
    late = time > SETTLED
    return time[late], gases.temperature(run)[late], float(np.ptp(collisions(results, label)[late]))


def rate(results: kit.Results) -> float:
    """Collisions of a sphere with spheres per second, by the rms velocity [1/m], of the elastic gas."""
    time, t, hits = settled(results, "elastic")
    return float(2 * hits / (SIZES[results.tier][0] * (time[-1] - time[0])) / math.sqrt(t[0]))


def haff(results: kit.Results) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(time, T, T by Haff's law) of hard spheres from SETTLED on, rate from the elastic gas, nothing fitted.

    T = T1/(1 + (1 - e^2) omega1 (t - t1)/6)^2, omega1 = rate sqrt(T1)
    """
    time, t, _ = settled(results, "mild")
    omega = rate(results) * math.sqrt(t[0])
    return time, t, t[0] / (1 + (1 - MILD**2) * omega * (time - time[0]) / 6) ** 2


def against_haff(results: kit.Results) -> kit.Measured:
    """Largest |T/Haff - 1| over the run."""
    _, t, law = haff(results)
    note = f"T falls by {t[0] / t[-1]:.2f}, {int(collisions(results, 'mild')[-1])} collisions"
    return kit.Measured(float(np.abs(t / law - 1).max()), note=note)


def decay(results: kit.Results) -> tuple[float, float]:
    """-d ln T per collision and sphere, and 2 (1 - e^2)/3."""
    _, t, hits = settled(results, "mild")
    return float(-np.log(t[-1] / t[0]) * SIZES[results.tier][0] / hits), 2 * (1 - MILD**2) / 3


def samples(results: kit.Results) -> dict[str, np.ndarray]:
    """Engine -> (seeds,) of the slope of T^-1/2."""
    return {code: gases.cooling(results, code, SETTLED)[2] for code in results.codes("seed_1")}


def softening(results: kit.Results) -> np.ndarray:
    """Rows by contact time: omega t_c, how much slower than hard spheres gpudem cools, standard error."""
    every, rows = samples(results), []
    exact = every[HARD]
    for t in (SIZES[results.tier][3], *SOFTER):
        prefix = f"soft_{t:g}_seed_"
        soft = gases.cooling(results, "gpudem", SETTLED, prefix)[2] if t in SOFTER else every["gpudem"]
        error = math.hypot(soft.std(ddof=1) / len(soft) ** 0.5, exact.std(ddof=1) / len(exact) ** 0.5)
        rows.append((rate(results) * t, float(1 - soft.mean() / exact.mean()), error / exact.mean()))
    return np.array(rows)


def softness(results: kit.Results) -> kit.Measured:
    """Relative lag of the slope by omega t_c: straight line through zero."""
    rows = softening(results)
    x, y, _ = rows.T
    return kit.Measured(
        float(x @ y / (x @ x)), note=", ".join(f"{b:+.2%} +- {c:.2%} at {a:.3f}" for a, b, c in rows)
    )


def against_hard(results: kit.Results, code: str) -> kit.Measured:
    """Difference of the mean slopes of a code and of hard spheres, by what chance and softness allow."""
    allowed = -SOFTNESS * rate(results) * SIZES[results.tier][3]
    return engines.gap(samples(results), code, HARD, allowed)


SOFT_REASON = (
    "softness: soft spheres separate a contact time t_c after they touch, as hard spheres with a diameter"
    " smaller by v t_c/2 would; with v = sqrt(pi T), the mean over collisions, this is d omega t_c/2 and"
    " reduces the collision rate by 1.4 omega t_c at this density; omega is that of the start and falls to"
    " half during the run, so that up to 1 omega t_c remains"
)


def _cooling(results: kit.Results) -> plots.Figure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.8)
    time, t, law = haff(results)
    left.plot(time, t / law - 1, color=plots.color(HARD), lw=1.2, label=f"event-driven, e = {MILD:g}")
    left.axhspan(-0.01, 0.01, color="0.92")
    left.axhline(0, color="k", lw=0.9, label="Haff, rate of the elastic gas")
    left.set(xlabel="time [s]", ylabel="T / Haff - 1", ylim=(-0.02, 0.02))
    for code in results.codes("seed_1"):
        plots.band(right, *gases.cooling(results, code, SETTLED)[:2], code)
    right.set(xlabel="time [s]", ylabel="T^(-1/2) [s/m]")
    plots.legend(left, right)
    return figure


def _softness(results: kit.Results) -> plots.Figure:
    figure, axes = plots.figure()
    x, y, error = softening(results).T
    plots.points(axes, x, 100 * y, "gpudem", error=100 * error, linestyle="none", marker="o")
    line = softness(results).value
    axes.plot([0, x[-1]], [0, 100 * line * x[-1]], "k", lw=0.9, label=f"{line:.2f} omega t_c")
    axes.plot(0, 0, "D", color=plots.color(HARD), label="event-driven")
    axes.set(xlabel="omega t_c", ylabel="slower cooling, slope of T^(-1/2) [%]")
    plots.legend(axes)
    return figure


def _table(results: kit.Results) -> kit.Rows:
    found = samples(results)
    return [
        {"code": plots.name(code), "d(T^-1/2)/dt [1/m]": float(t.mean()),
         "standard deviation of a seed [1/m]": float(t.std(ddof=1)),
         "against event-driven [1]": float(t.mean() / found[HARD].mean() - 1)}
        for code, t in found.items()
    ]  # fmt: skip


CASE = kit.Case(
    name="haff_box", title="A cooling gas between walls: three engines",
    purpose="Hard spheres are the limit of ever stiffer soft spheres. Between elastic walls, e = 0.98, they"
    " follow Haff's law with the collision rate of the same gas without loss: nothing is fitted. From the"
    " same starts, e = 0.9, the soft codes cool as the hard spheres do, up to the scatter of the seeds and"
    " an error that grows with omega t_c, the fraction of time spent in contact.",
    source="Haff (1983); van Noije and Ernst (1998).",
    variants=variants,
    checks=(
        *early_checks(),
        hard(
            "T against Haff's law, largest relative error (event-driven)", against_haff, 0.01,
            "Haff's law, rate of the elastic gas",
            "finite loss in a collision (0.2 %) and the scatter of the rate of some thousand spheres",
            "a restitution off by 0.0005, one collision in a hundred missed",
        ),
        hard(
            "-d ln T per collision and sphere against 2 (1 - e^2)/3, relative error (event-driven)", decay,
            0.01, "closed form",
            "the Sonine correction of the velocities (0.3 %) and scatter; no rate enters",
            "a restitution off by 0.0005; a loss counted per sphere instead of per collision",
        ),
        conserved("energy of the elastic gas, largest change (event-driven)", prefix="elastic"),
        no_overlap(),
        kit.per_code(
            "slope of T^-1/2, difference from hard spheres / allowed", against_hard, beside=(HARD,),
            tolerance=1.0, against="event-driven hard spheres", mark="X",
            reason=f"{engines.SIGMAS:g} standard errors over the seeds, and towards slower cooling"
            f" {SOFT_REASON}",
            catches="a restitution off by 0.01, which is 10 % of the loss",
        ),
        kit.per_pair(
            "slope of T^-1/2, difference of the soft codes / allowed",
            lambda results, code, other: engines.gap(samples(results), code, other), tolerance=1.0,
            reason=f"{engines.SIGMAS:g} standard errors over the seeds; same law, same softness",
            catches="collisions lost by one code after the first milliseconds; side walls that absorb 2 %",
        ),
        kit.check(
            "softness: relative lag of the slope / omega t_c, line through zero (gpudem)", softness,
            tolerance=SOFTNESS_RANGE[1], lo=SOFTNESS_RANGE[0], needs=("gpudem", HARD), tiers=kit.LONG,
            against="derivation from the mean contact", reason=SOFT_REASON,
            catches="soft spheres that do not tend to hard ones, or whose contact takes another time",
        ),
    ),
    figures=(
        kit.Figure(
            "Haff's law, and three engines on one gas",
            "Left: hard spheres, e = 0.98, against Haff's law without a fit; grey: 1 %. Right: e = 0.9, mean"
            " and range over the seeds.",
            _cooling, needs=(HARD,),
        ),
        kit.Figure(
            "Soft spheres tend to hard ones",
            "How much slower soft spheres cool, with standard errors, against the fraction of time in"
            " contact: an error of first order in the contact time.",
            _softness, tiers=kit.LONG, needs=("gpudem", HARD),
        ),
    ),
    tables=(kit.Table("Cooling rate", "Line through T^-1/2, mean over the seeds.", _table, needs=(HARD,)),),
    features=("normal hooke", "damping", "wall plane", "sphere-sphere"), order=71,
)  # fmt: skip
