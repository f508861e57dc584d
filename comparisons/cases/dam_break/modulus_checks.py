"""Is a softened dam break the same flow? Seeds of each modulus against those of the hardest, and its cost."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from comparisons.cases.dam_break import modulus as stiff_dam
from comparisons.cases.dam_break.modulus import ALPHA, CONTACTS, DEPTH, METRICS, PLANS
from comparisons.harness.case import Check, Mark, Measured, Results, Tier
from comparisons.harness.numbers import number
from comparisons.report import plots

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes

TIERS: tuple[Tier, ...] = tuple(PLANS)
#: Slope of overlap against modulus on log axes: (load/E)^(2/3).
HERTZ = -2 / 3
#: Time [s] over which the codes must agree: hundreds of contacts made and gone; after it rounding grows
#: tenfold every 3 ms where contacts are as short as the true modulus makes them.
EARLY = 0.045
#: Who is held against float64 at the hardest modulus.
SAME: tuple[tuple[str, Mark, tuple[str, ...]], ...] = (
    ("gpudem mixed", "R", ("gpudem",)), ("LIGGGHTS", "X", ("gpudem", "liggghts")),
)  # fmt: skip


def same(results: Results, who: str) -> Measured:
    """Least corrected p over all metrics, of one against gpudem float64 at the hardest modulus."""
    hardest = PLANS[results.tier].hardest
    found = stiff_dam.gap(results, hardest, who)
    name = min(found, key=lambda n: found[n][1])
    return Measured(
        found[name][1], note=f"{number(hardest, 3)} Pa; least at {name}, apart by {found[name][0]:.3g}"
    )


def early(results: Results) -> Measured:
    """Largest distance of the centres of mass of gpudem and LIGGGHTS while the lattice falls / diameter."""
    plan, apart, touched = PLANS[results.tier], [], []
    for ours, theirs in zip(
        *(stiff_dam.runs(results, plan.hardest, w) for w in ("gpudem float64", "LIGGGHTS")), strict=True
    ):
        a, b = results[ours].history, results[theirs].history
        soon = a["time"].to_numpy() <= EARLY
        columns = ["centre_x", "centre_z"]
        distance = np.linalg.norm(a[columns].to_numpy() - b[columns].to_numpy(), axis=1)
        apart.append(float(distance[soon].max()) / (2 * plan.radius))
        touched.append(int(a["contacts"].to_numpy()[soon].max()))
    return Measured(max(apart) if min(touched) > 0 else math.nan, note=f"{min(touched)} contacts and more")


def overlap_slope(results: Results) -> Measured:
    """Slope of the largest overlap before the gate goes against the modulus, less -2/3."""
    moduli = [y for y in PLANS[results.tier].moduli if y >= stiff_dam.GUARDED]
    depths = [float(stiff_dam.sample(results, y)[DEPTH].mean()) for y in moduli]
    slope = float(np.polyfit(np.log(moduli), np.log(depths), 1)[0])
    return Measured(abs(slope - HERTZ), slope, HERTZ)


def speed(results: Results) -> Measured:
    """Stepping time of float64 / mixed at the hardest modulus: median over the seeds, run in turn."""
    hardest = PLANS[results.tier].hardest
    ratio = stiff_dam.seconds(results, hardest) / stiff_dam.seconds(results, hardest, "gpudem mixed")
    note = f"{len(ratio)} seeds, {ratio.min():.2f} to {ratio.max():.2f}"
    return Measured(float(np.median(ratio)), note=note)


def different(results: Results, young: float) -> str:
    """Metrics in which a modulus differs from the hardest beyond the seeds' spread, "" for none."""
    return ", ".join(n for n in stiff_dam.told(results, young) if n != CONTACTS)


def too_soft(results: Results) -> Measured:
    """Largest modulus [Pa] whose flow or pile differs from the hardest's."""
    soft = [y for y in PLANS[results.tier].moduli if different(results, y)]
    return Measured(
        max(soft, default=0.0), note="; ".join(f"{y:.3g} Pa: {different(results, y)}" for y in soft)
    )


def checks() -> tuple[Check, ...]:
    """Those of the dam break, for the case that holds it."""
    both = ("gpudem", "liggghts")
    return (
        *(
            Check(
                name=f"dam break at the hardest modulus: least corrected p over all metrics ({who})",
                measure=lambda results, who=who: same(results, who), lo=ALPHA, tolerance=1.0, unit="1",
                against="gpudem float64", mark=mark, tiers=TIERS, needs=needs,
                reason="exact permutation of the largest standardised gap over the seeds, level 0.01",
                catches="forces rounded so that grains stick, creep or gain energy",
            )
            for who, mark, needs in SAME
        ),
        Check(
            name="dam break at the hardest modulus: centre of mass, largest distance in 45 ms / diameter",
            measure=early, tolerance=1e-10, unit="1", against="LIGGGHTS", mark="X", tiers=TIERS, needs=both,
            reason="same law, same scheme: rounding, before it has grown",
            catches="an overlap that loses digits where it is a millionth of the radius",
        ),
        Check(
            name="dam break: largest overlap of the bed against the modulus, slope less -2/3",
            measure=overlap_slope, tolerance=0.1, unit="1", against="Hertz (1882)", mark="A", tiers=TIERS,
            reason="the largest of some thousand contacts; chains carry it another way in a softer bed",
            catches="a stiffness that does not go with E, a softened bed that is not softened",
        ),
        Check(
            name="dam break: time of float64 / time of mixed at the hardest modulus, median over seeds",
            measure=speed, lo=0.8, tolerance=math.inf, unit="1", against="gpudem float64", mark="R",
            tiers=TIERS,
            reason="in a CPU's caches a float64 costs no more than a float32, which must be converted: there"
            " mixed saves memory alone, and time on large beds",
            catches="a mixed mode that costs more than its conversions",
        ),
        *(
            Check(
                name="dam break: largest modulus that changes the flow or the pile [Pa]",
                measure=too_soft, lo=1e5, tolerance=plan.moduli[-3 if plan.hardest == stiff_dam.TRUE else -2],
                unit="Pa",
                against="the hardest modulus", mark="R", tiers=(tier,),
                reason="a finding, shown as such; the tolerance says that rubber is told from plastic"
                + ("" if plan.hardest < stiff_dam.TRUE else ", and that the flow has a stiff limit: the next"
                   " softer modulus is the same"),
                catches="a modulus that does not act; a test too weak to see a bed of rubber",
            )
            for tier, plan in PLANS.items()
        ),
    )  # fmt: skip


def draw_shift(ax: Axes, results: Results) -> None:
    """Mean of each metric less that of the hardest, by the seeds' spread, against the modulus; full marks
    differ at the level of the tests.
    """
    plan = PLANS[results.tier]
    moduli = [y for y in plan.moduli if y != plan.hardest]
    for k, name in enumerate((*METRICS, CONTACTS)):
        spread = float(stiff_dam.sample(results, plan.hardest)[name].std(ddof=1))
        shift = np.array([stiff_dam.gap(results, y)[name][0] for y in moduli]) / spread
        told = np.array([name in stiff_dam.told(results, y) for y in moduli])
        colour, mark = plots.SERIES[k % 7], "osv^D<>"[k]
        label = name.partition(" [")[0]
        ax.plot(moduli, shift, marker=mark, ms=5, lw=0.9, color=colour, mfc="none", label=label)
        ax.plot(np.array(moduli)[told], shift[told], ls="", marker=mark, ms=5, color=colour)
    ax.axhline(0, color="0.5", lw=0.8)
    ax.set(xscale="log", ylabel="change of the mean / standard deviation of a seed")
    ax.set_yscale("symlog", linthresh=1)
    ticks = [-10, -3, -1, 0, 1, 3, 10]
    ax.set_yticks(ticks, [f"{t:g}" for t in ticks])
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.17), ncol=2, fontsize=7)


def table(results: Results) -> pandas.DataFrame:
    """Each modulus: steps, time, overlap, means of the metrics; then the hardest by all."""
    import pandas

    plan, rows = PLANS[results.tier], []
    who = [(y, "gpudem float64") for y in plan.moduli]
    who += [(plan.hardest, w) for w in stiff_dam.WHO if w != "gpudem float64"]
    for young, one in who:
        if not stiff_dam.runs(results, young, one):
            continue
        found = stiff_dam.sample(results, young, one)
        row: dict[str, object] = {"E [Pa]": number(young, 3), "by": one}
        row["steps for 1 s"] = number(stiff_dam.steps(results, young), 2)
        row["time of a run [s]"] = f"{np.median(stiff_dam.seconds(results, young, one)):.1f}"
        row[DEPTH] = number(float(found[DEPTH].mean()), 2)
        for name in (*METRICS, CONTACTS):
            row[name] = f"{found[name].mean():.4g} ± {found[name].std(ddof=1):.2g}"
        if (young, one) != (plan.hardest, "gpudem float64"):
            row["differs (p < 0.01)"] = ", ".join(stiff_dam.told(results, young, one)) or "nowhere"
        rows.append(row)
    return pandas.DataFrame(rows).fillna("")


def advice(results: Results) -> list[tuple[str, str]]:
    """(part of a dam break, how soft it may be, with the numbers of this run)."""
    return [(f"modulus, for {part}", _enough(results, part)) for part in stiff_dam.PARTS]


def _enough(results: Results, part: str) -> str:
    """Down to which modulus a part is the same, how far that is known, what the next softer does to it."""
    plan = PLANS[results.tier]
    good, soft = stiff_dam.stiff_enough(results, part)
    if good == plan.hardest:
        text = "Only the hardest: every softer one differs."
    else:
        depth = float(stiff_dam.sample(results, good)[DEPTH].mean())
        cost = float(np.median(stiff_dam.seconds(results, plan.hardest) / stiff_dam.seconds(results, good)))
        text = (
            f"{number(good, 3)} Pa and more: {plan.seeds} seeds of a dam break do not tell it from that of"
            f" {number(plan.hardest, 3)} Pa. Overlaps there are up to {100 * depth:.1g} % of the radius, and"
            f" it takes 1/{cost:.2g} of the time. Differences that the seeds leave possible:"
            f" {_quantities(stiff_dam.left_open(results, good, part), '.3g')}."
        )
    if not math.isnan(soft):
        shifts = {n: m for n, m in stiff_dam.told(results, soft).items() if n in stiff_dam.PARTS[part]}
        text += f" At {number(soft, 3)} Pa: {_quantities(shifts, '+.3g')}."
    return text


def _quantities(values: dict[str, float], form: str) -> str:
    """Values with the units that stand in their names: {"height [mm]": 2.0} gives "height 2 mm"."""
    names = {n: n.rstrip("]").split(" [") for n in values}
    return ", ".join(f"{names[n][0]} {v:{form}} {names[n][1]}" for n, v in values.items())
