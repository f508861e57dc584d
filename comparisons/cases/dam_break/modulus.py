"""The dam break against Young's modulus: down to which modulus is the flow the same, and what it costs."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from comparisons import kit
from comparisons.cases.dam_break import scenes as dam
from comparisons.cases.dam_break.checks import early
from comparisons.cases.over_seeds import ALPHA
from comparisons.harness import codes
from comparisons.kit import number
from comparisons.metrics import pile, statistics
from comparisons.report import plots
from gpudem.output.run import Run

#: Young's modulus of the balls of the experiment [Pa].
TRUE = dam.BALL.young
FLOAT64, MIXED, FLOAT32 = kit.precisions()
CONFIGURATIONS = kit.Configurations(FLOAT64, MIXED, FLOAT32, timed_on=1)


@dataclasses.dataclass(frozen=True)
class Plan:
    """Which moduli a tier runs, with how many seeds, at which grain size."""

    radius: float
    seeds: int
    moduli: tuple[float, ...]
    hardest: float
    """Modulus [Pa] that all configurations and codes run, and that the others are compared with."""


#: Five seeds per side reach p = 0.01 only as the most extreme of 252 splits: enough to detect rubber. The
#: full tier asks which modulus is stiff enough, and takes the most seeds that can be tested exactly.
PLANS: dict[kit.Tier, Plan] = {
    "standard": Plan(0.012, 5, (1e5, 3e5, 1e6, 5e6), 5e6),
    "full": Plan(0.009, 10, (1e5, 3e5, 1e6, 5e6, 5e7, 5e8, TRUE), TRUE),
}
TIERS: tuple[kit.Tier, ...] = tuple(PLANS)
#: What is compared, a reading from each part of the flow; more would only cost power.
METRICS = (
    "height at 0 mm [mm]", "height at 400 mm [mm]", "run-out in flow [mm]", "center of mass x at rest [mm]",
    "center of mass z at rest [mm]", "time to the far wall [ms]",
)  # fmt: skip
#: Parts of the flow and their metrics: a reduced modulus changes one before the other.
PARTS = {
    "the pile at rest": (METRICS[0], METRICS[1], METRICS[3], METRICS[4]),
    "the run-out in flow": (METRICS[2],),
    "the first ball at the far wall": (METRICS[5],),
}
#: Below this, overlaps exceed half a radius somewhere in the fall, and the scene allows it.
LARGE_OVERLAP_BELOW = 1e6
CONTACTS, DEPTH = "contacts of a ball at rest", "largest overlap before / radius"
#: Slope of overlap against modulus on log axes: (load/E)^(2/3).
HERTZ = -2 / 3
#: Time [s] over which the codes must agree: hundreds of contacts have ended; after it rounding grows tenfold
#: every 3 ms where contacts are as short as with the true modulus.
EARLY = 0.045


def name_of(young: float, seed: int) -> str:
    """Label of the variant that all codes run."""
    return f"dam_{young:.3g}_{seed}"


def variants(tier: kit.Tier) -> list[kit.Variant]:
    """Every modulus in float64, the hardest by all, one seed after the other; none in a tier without."""
    if tier not in PLANS:
        return []
    plan, made = PLANS[tier], []
    for seed in range(1, plan.seeds + 1):
        for young in plan.moduli:
            scene = dam.Dam(radius=plan.radius, seed=seed, opens=0.4, flows=0.9, young=young).scene()
            scene = scene.replace(
                output={"frames_every": 0.1, "history_every": 0.005},
                allow=("large_overlap",) if young < LARGE_OVERLAP_BELOW else (),
            )
            one = {} if young == plan.hardest else {"own": (FLOAT64,), "codes": ("gpudem",)}
            made += CONFIGURATIONS.variants(name_of(young, seed), scene, **one)
    return made


def keys(results: kit.Results, young: float, by: kit.Configuration = FLOAT64) -> list[tuple[str, str]]:
    """(label, code) of the seeds of one modulus, those that ran."""
    seeds = range(1, PLANS[results.tier].seeds + 1)
    return [key for seed in seeds if (key := by.key(name_of(young, seed))) in results.runs]


def overlap(run: Run) -> float:
    """Largest overlap of two balls just before the opening / radius."""
    frame, domain = run.frames.at(dam.opening(run)), run.scene.domain
    found = pile.largest_overlap(frame["position"], frame["radius"], domain.hi[1] - domain.lo[1])
    return found / float(frame["radius"].max())


def sample(results: kit.Results, young: float, by: kit.Configuration = FLOAT64) -> dict[str, np.ndarray]:
    """Metric -> its values over the seeds."""

    def compute() -> dict[str, np.ndarray]:
        rows = []
        for key in keys(results, young, by):
            found, run = dam.measures(results, *key), results[key]
            contacts = 2 * int(run.history["contacts"].to_numpy()[-1]) / len(run.scene.state)
            rows.append({m: found[m] for m in METRICS} | {CONTACTS: contacts, DEPTH: overlap(run)})
        return {name: np.array([row[name] for row in rows]) for name in rows[0]}

    return results.once(("dam sample", young, by.key("")), compute)


def gap(
    results: kit.Results, young: float, by: kit.Configuration = FLOAT64, against: kit.Configuration = FLOAT64
) -> dict[str, statistics.Comparison]:
    """Metric -> comparison with the hardest."""

    def compute() -> dict[str, statistics.Comparison]:
        ours, hard = sample(results, young, by), sample(results, PLANS[results.tier].hardest, against)
        return statistics.compare({name: ours[name] for name in (*METRICS, CONTACTS)}, hard)

    return results.once(("dam gap", young, by.key(""), against.key("")), compute)


def significant(results: kit.Results, young: float, by: kit.Configuration = FLOAT64) -> dict[str, float]:
    """Metric that differs significantly from the hardest's (p < ALPHA) -> mean less that of the hardest."""
    return {n: c.difference for n, c in gap(results, young, by).items() if c.corrected < ALPHA}


def stiff_enough(results: kit.Results, part: str) -> tuple[float, float]:
    """(softest modulus [Pa] from which on no part differs significantly from the hardest's, the next softer).

    The second is nan where even the softest is stiff enough.
    """
    moduli = PLANS[results.tier].moduli
    soft = [y for y in moduli if not significant(results, y).keys().isdisjoint(PARTS[part])]
    return min(y for y in moduli if y > max(soft, default=0.0)), max(soft, default=float("nan"))


def seconds(results: kit.Results, young: float, by: kit.Configuration = FLOAT64) -> np.ndarray:
    """Stepping time [s] of each seed."""
    return np.array([results[key].timing.stepping_s for key in keys(results, young, by)])


# -- checks --------------------------------------------------------------------------------------------------


def smallest_p(
    results: kit.Results, by: kit.Configuration, against: kit.Configuration = FLOAT64
) -> kit.Measured:
    """Least corrected p over all metrics of two configurations or codes at the hardest modulus."""
    hardest = PLANS[results.tier].hardest
    name, c = min(gap(results, hardest, by, against).items(), key=lambda item: item[1].corrected)
    note = f"{number(hardest, 3)} Pa; least at {name}, difference {c.difference:.3g}"
    return kit.Measured(c.corrected, note=note)


def overlap_slope(results: kit.Results) -> kit.Measured:
    """Slope of the largest overlap before the opening against the modulus, less -2/3."""
    moduli = [y for y in PLANS[results.tier].moduli if y >= LARGE_OVERLAP_BELOW]
    depths = [float(sample(results, y)[DEPTH].mean()) for y in moduli]
    slope = float(np.polyfit(np.log(moduli), np.log(depths), 1)[0])
    return kit.Measured(abs(slope - HERTZ), slope, HERTZ)


def speed_up(results: kit.Results) -> kit.Measured:
    """Speed-up of mixed over float64 at the hardest modulus: median over the seeds, run in turn."""
    hardest = PLANS[results.tier].hardest
    return kit.median(seconds(results, hardest) / seconds(results, hardest, MIXED), "seeds")


def too_soft(results: kit.Results) -> kit.Measured:
    """Largest modulus [Pa] whose flow or pile differs from the hardest's."""
    found = {y: significant(results, y).keys() - {CONTACTS} for y in PLANS[results.tier].moduli}
    note = "; ".join(f"{y:.3g} Pa: {', '.join(sorted(names))}" for y, names in found.items() if names)
    return kit.Measured(max((y for y, names in found.items() if names), default=0.0), note=note)


def same(who: str, needs: tuple[str, ...], *pair: kit.Configuration, **fields: Any) -> kit.Check:
    """No significant difference of two configurations or codes over the seeds."""
    return kit.Check(
        name=f"dam break at the hardest modulus: least corrected p over all metrics ({who})",
        measure=lambda results: smallest_p(results, *pair), lo=ALPHA, tolerance=1.0, unit="1", needs=needs,
        tiers=TIERS, reason="exact permutation test of the largest standardized difference over the seeds; no"
        " significant difference at"
        " 0.01", catches="forces rounded so that grains stick, creep or gain energy", **fields,
    )  # fmt: skip


CHECKS = (
    same("gpudem mixed", ("gpudem",), MIXED, against="gpudem float64", mark="R"),
    kit.PerPair(
        lambda code, other: same(
            codes.title(other), (code, other), *(kit.Configuration(c, c) for c in (other, code)), mark="X",
            against=codes.title(code),
        )
    ),
    early(  # of the hardest modulus: other codes run no other
        "dam break at the hardest modulus: center of mass, largest distance in 45 ms / diameter",
        prefix="dam_", until=EARLY, tiers=TIERS, reason="same law and scheme: rounding, before it has grown",
        catches="an overlap that loses digits where it is a millionth of the radius",
    ),
    kit.Check(
        name="dam break: largest overlap of the bed against the modulus, slope less -2/3",
        measure=overlap_slope, tolerance=0.1, unit="1", against="Hertz (1882)", mark="A", tiers=TIERS,
        reason="the largest of some thousand contacts; force chains differ in a softer bed",
        catches="a stiffness that is not proportional to E, a modulus that does not act",
    ),
    *kit.checks(
        "dam break: largest modulus that changes the flow or the pile [Pa]", too_soft, lo=1e5,
        tolerance={"standard": 1e6, "full": 5e7}, unit="Pa", against="the hardest modulus", mark="R",
        reason="the softest must differ, or the test has no power; in the full tier, which has the true"
        " modulus, the two below it must not, or there is no stiff limit",
        catches="a modulus that does not act; too few seeds to detect a bed of rubber",
    ),
)  # fmt: skip
SPEED_UP = kit.Finding(
    "dam break: time of float64 / time of mixed at the hardest modulus, median over seeds", speed_up, "1",
    "Speed-up of mixed: in a CPU's caches a float64 costs no more than a float32 that must be converted;"
    " mixed saves memory there, and time with large beds.",
    tiers=TIERS,
)  # fmt: skip


# -- shown ---------------------------------------------------------------------------------------------------


def draw_shift(ax: Any, results: kit.Results) -> None:
    """Mean of each metric less that of the hardest, by the seeds' spread, against the modulus; filled marks
    differ significantly.
    """
    plan = PLANS[results.tier]
    moduli = np.array([y for y in plan.moduli if y != plan.hardest])
    for k, name in enumerate((*METRICS, CONTACTS)):
        spread = float(sample(results, plan.hardest)[name].std(ddof=1))
        shift = np.array([gap(results, y)[name].difference for y in moduli]) / spread
        differs = np.array([name in significant(results, y) for y in moduli])
        look = {"marker": "osv^D<>"[k], "ms": 5, "color": plots.SERIES[k % 7]}
        ax.plot(moduli, shift, lw=0.9, mfc="none", label=name.partition(" [")[0], **look)
        ax.plot(moduli[differs], shift[differs], ls="", **look)
    ax.axhline(0, color="0.5", lw=0.8)
    ax.set(xscale="log", ylabel="change of the mean / standard deviation of a seed")
    ax.set_yscale("symlog", linthresh=1)
    ax.set_yticks(ticks := [-10, -3, -1, 0, 1, 3, 10], map(str, ticks))
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.17), ncol=2, fontsize=7)


def draw_cost(ax: Any, results: kit.Results) -> None:
    """Time for a second of the dam break against the modulus."""
    plan = PLANS[results.tier]
    scene = results[keys(results, plan.hardest)[0]].scene
    for by in CONFIGURATIONS.among(results.codes()):
        ran = [y for y in plan.moduli if keys(results, y, by)]
        took = [float(np.median(seconds(results, y, by))) / scene.time.duration for y in ran]
        ax.loglog(ran, took, **by.line(marker=by.mark, mfc="none", lw=1.1, ms=5))
    ax.set(ylabel=f"dam break of {len(scene.state)} balls: seconds for 1 s")


def table(results: kit.Results) -> kit.Rows:
    """Each modulus: steps, time, overlap, means of the metrics; then the hardest by all."""
    plan, rows = PLANS[results.tier], []
    everyone = [one for one in CONFIGURATIONS.among(results.codes()) if one != FLOAT64]
    for young, by in [*((y, FLOAT64) for y in plan.moduli), *((plan.hardest, one) for one in everyone)]:
        ran = keys(results, young, by)
        if not ran:
            continue
        found, step = sample(results, young, by), results[ran[0]].scene.time.step
        row = {"E [Pa]": number(young, 3), "code": by.title, "steps for 1 s": number(1 / step, 2)}
        row["time of a run [s]"] = f"{np.median(seconds(results, young, by)):.1f}"
        row[DEPTH] = number(float(found[DEPTH].mean()), 2)
        row |= {n: f"{found[n].mean():.4g} ± {found[n].std(ddof=1):.2g}" for n in (*METRICS, CONTACTS)}
        reference = (young, by) == (plan.hardest, FLOAT64)
        differs = "" if reference else ", ".join(significant(results, young, by)) or "nowhere"
        rows.append(row | {"differs (p < 0.01)": differs})
    return rows


def advice(results: kit.Results) -> list[tuple[str, str]]:
    """(part of a dam break, down to which modulus it is the same, with the numbers of this run)."""
    return [(f"modulus, for {part}", _enough(results, part)) for part in PARTS]


def _enough(results: kit.Results, part: str) -> str:
    """Down to which modulus a part is the same, how far that is known, what the next softer changes."""
    plan, (good, soft) = PLANS[results.tier], stiff_enough(results, part)
    if good == plan.hardest:
        text = "Only the hardest: every softer one differs."
    else:
        bounds = {n: gap(results, good)[n].bound for n in PARTS[part]}
        depth = float(sample(results, good)[DEPTH].mean())
        cost = float(np.median(seconds(results, plan.hardest) / seconds(results, good)))
        text = (
            f"{number(good, 3)} Pa and more: {plan.seeds} seeds of a dam break show no significant difference"
            f" from {number(plan.hardest, 3)} Pa. Overlaps are up to {100 * depth:.1g} % of the radius, and"
            f" it takes 1/{cost:.2g} of the time. Differences within the 95 % confidence intervals:"
            f" {_quantities(bounds, '.3g')}."
        )
    if not math.isnan(soft):
        shifts = {n: m for n, m in significant(results, soft).items() if n in PARTS[part]}
        text += f" Significant at {number(soft, 3)} Pa: {_quantities(shifts, '+.3g')}."
    return text


def _quantities(values: dict[str, float], form: str) -> str:
    """Values with the units that stand in their names: {"height [mm]": 2.0} gives "height 2 mm"."""
    names = {n: n.rstrip("]").split(" [") for n in values}
    return ", ".join(f"{names[n][0]} {v:{form}} {names[n][1]}" for n, v in values.items())
