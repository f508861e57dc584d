"""The dam break against Young's modulus: from which softness on is it another flow?"""

from __future__ import annotations

import dataclasses

import numpy as np

from comparisons.cases.dam_break import scenes as dam
from comparisons.harness.case import Results, Tier, Variant
from comparisons.metrics import pile, statistics
from gpudem.output.run import Run

#: Young's modulus of the balls of the experiment [Pa].
TRUE = dam.BALL.young


@dataclasses.dataclass(frozen=True)
class Plan:
    """Which moduli a tier runs, with how many seeds, at which grain size."""

    radius: float
    seeds: int
    moduli: tuple[float, ...]
    hardest: float
    """Modulus [Pa] that mixed, float32 and LIGGGHTS run as well, and that the others are held against."""


#: Five seeds a side pass the 1 % level only as the most extreme of 252 splits: they see rubber. The full tier
#: asks which modulus is stiff enough, and takes the most seeds that are tested exactly.
PLANS: dict[Tier, Plan] = {
    "standard": Plan(0.012, 5, (1e5, 3e5, 1e6, 5e6), 5e6),
    "full": Plan(0.009, 10, (1e5, 3e5, 1e6, 5e6, 5e7, 5e8, TRUE), TRUE),
}
#: Who runs the hardest -> (label suffix, code, arguments).
WHO = {
    "gpudem float64": ("float64", "gpudem", {"precision": "float64"}),
    "gpudem mixed": ("mixed", "gpudem", {"precision": "mixed"}),
    "gpudem float32": ("float32", "gpudem", {"precision": "float32"}),
    "LIGGGHTS": ("liggghts", "liggghts", {"use_recorded": False}),
}
#: What is compared, a reading from each part of the flow; more would only cost power.
METRICS = (
    "height at 0 mm [mm]", "height at 400 mm [mm]", "run-out in flow [mm]", "centre of mass x at rest [mm]",
    "centre of mass z at rest [mm]", "time to the far wall [ms]",
)  # fmt: skip
#: What they say of, together: softening changes one before the other.
PARTS = {
    "the pile at rest": (METRICS[0], METRICS[1], METRICS[3], METRICS[4]),
    "the run-out in flow": (METRICS[2],),
    "the first ball at the far wall": (METRICS[5],),
}
#: Below, balls overlap by more than half a radius somewhere in the fall; the guard that ends such a run is
#: waived, to see what comes out.
GUARDED = 1e6
#: Level of the tests, as in the dam break's own case.
ALPHA = 0.01
CONTACTS, DEPTH = "contacts of a ball at rest", "largest overlap before / radius"


def variants(tier: Tier) -> list[Variant]:
    """Every modulus in float64, the hardest by all, one seed after the other; none in a tier without."""
    if tier not in PLANS:
        return []
    plan, made = PLANS[tier], []
    for seed in range(1, plan.seeds + 1):
        for young in plan.moduli:
            scene = dam.Dam(radius=plan.radius, seed=seed, opens=0.4, flows=0.9, young=young).scene()
            scene = scene.replace(
                output={"frames_every": 0.1, "history_every": 0.005},
                allow=("large_overlap",) if young < GUARDED else (),
            )
            for suffix, code, arguments in WHO.values() if young == plan.hardest else [WHO["gpudem float64"]]:
                label = f"dam_{young:.3g}_{seed}-{suffix}"
                made.append(Variant(label, scene, (code,), {code: arguments}, timed=True))
    return made


def runs(results: Results, young: float, who: str = "gpudem float64") -> list[tuple[str, str]]:
    """(label, code) of the seeds of one modulus, those that ran."""
    suffix, code, _ = WHO[who]
    keys = [(f"dam_{young:.3g}_{k}-{suffix}", code) for k in range(1, PLANS[results.tier].seeds + 1)]
    return [key for key in keys if key in results.runs]


def overlap(run: Run) -> float:
    """Largest overlap of two balls just before the gate goes / radius."""
    frame = run.frames.at(dam.opening(run))
    domain, radius = run.scene.domain, frame["radius"]
    deepest = pile.largest_overlap(frame["position"], radius, domain.hi[1] - domain.lo[1])
    return deepest / float(radius.max())


def sample(results: Results, young: float, who: str = "gpudem float64") -> dict[str, np.ndarray]:
    """Metric -> its values over the seeds."""

    def compute() -> dict[str, np.ndarray]:
        rows = []
        for key in runs(results, young, who):
            found = dam.measures(results, *key)
            run = results[key]
            contacts = 2 * int(run.history["contacts"].to_numpy()[-1]) / len(run.scene.state)
            rows.append({m: found[m] for m in METRICS} | {CONTACTS: contacts, DEPTH: overlap(run)})
        return {name: np.array([row[name] for row in rows]) for name in rows[0]}

    return results.once(("dam sample", young, who), compute)


def gap(results: Results, young: float, who: str = "gpudem float64") -> dict[str, tuple[float, float]]:
    """Metric -> (mean less that of the hardest in float64, corrected p of no difference)."""

    def compute() -> dict[str, tuple[float, float]]:
        ours, hard = sample(results, young, who), sample(results, PLANS[results.tier].hardest)
        names = (*METRICS, CONTACTS)
        samples = [np.array([values[n] for n in names]).T for values in (ours, hard)]
        p = statistics.largest_gap(*samples)
        means = [float(ours[n].mean() - hard[n].mean()) for n in names]
        return {n: (m, float(q)) for n, m, q in zip(names, means, p, strict=True)}

    return results.once(("dam gap", young, who), compute)


def told(results: Results, young: float, who: str = "gpudem float64") -> dict[str, float]:
    """Metric that the seeds tell from the hardest's, at the level ALPHA -> mean less that of the hardest."""
    return {n: shift for n, (shift, p) in gap(results, young, who).items() if p < ALPHA}


def stiff_enough(results: Results, part: str) -> tuple[float, float]:
    """(softest modulus [Pa] from which on up no seed test tells a part from the hardest's, the next softer).

    The second is nan where even the softest is stiff enough.
    """
    moduli = PLANS[results.tier].moduli
    soft = [y for y in moduli if not told(results, y).keys().isdisjoint(PARTS[part])]
    harder = [y for y in moduli if y > max(soft, default=0.0)]
    return min(harder), max(soft, default=float("nan"))


def left_open(results: Results, young: float, part: str) -> dict[str, float]:
    """Metric of a part -> largest difference from the hardest in its 95 % interval (Welch)."""
    hard = PLANS[results.tier].hardest
    return {
        n: statistics.welch(sample(results, young)[n], sample(results, hard)[n]).bound for n in PARTS[part]
    }


def seconds(results: Results, young: float, who: str = "gpudem float64") -> np.ndarray:
    """Stepping time [s] of each seed."""
    return np.array([results[key].timing.stepping_s for key in runs(results, young, who)])


def steps(results: Results, young: float) -> float:
    """Steps of a second."""
    return 1 / results[runs(results, young)[0]].scene.time.step
