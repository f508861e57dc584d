"""The map of stable steps: which scenes, which rows, what each point turned out to be, and its drawing."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from typing import TYPE_CHECKING

from comparisons.bench import beds
from comparisons.cases.limits import stability
from comparisons.cases.limits.stability import POOR, STABLE, UNSTABLE, Spot
from comparisons.harness.case import Results, Tier, Variant
from comparisons.harness.numbers import number
from comparisons.oracles import step_limit
from comparisons.report import plots
from gpudem.output.run import Run
from gpudem.scene import Output, Scene, Time
from gpudem.scene.time_step import USUAL_CONTACT, USUAL_RAYLEIGH

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

#: Who is mapped -> (label suffix, code, arguments of its run function).
WHO = {
    "gpudem half_step": ("half", "gpudem", {}),
    "gpudem path": ("path", "gpudem", {"integrator": "path"}),
    "gpudem mixed": ("mixed", "gpudem", {"precision": "mixed"}),
    "gpudem float32": ("float32", "gpudem", {"precision": "float32"}),
    "LIGGGHTS": ("liggghts", "liggghts", {"use_recorded": False}),
}
#: Who runs columns and beds of restitutions other than 0.9.
FEW = ("gpudem half_step", "gpudem path", "LIGGGHTS")
LAWS = {"quick": ("hertz",), "standard": ("hertz", "hooke"), "full": ("hertz", "hooke")}
#: Ratio of one rung to the next: contacts at rest, impacts.
FINE = {"quick": (1.25, 1.4), "standard": (1.07, 1.12), "full": (1.02, 1.05)}
REST, IMPACTS = (0.25, 8.0), (0.04, 2.5)
#: Columns: restitution, and steps as shares of the closed form's limit.
COLUMNS = {
    "quick": ((0.9,), (0.9, 1.1)),
    "standard": ((0.3, 0.9, 1.0), (0.6, 0.8, 0.97, 1.03, 1.1)),
    "full": ((0.3, 0.5, 0.9, 1.0), (0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 1.02, 1.05, 1.1, 1.2)),
}
#: The settled bed of 5000 balls: restitution, steps / Rayleigh time, steps of a run.
BEDS = {
    "quick": ((), ()), "standard": ((0.3, 0.9), (0.2, 0.3, 0.4, 0.5, 0.65, 0.8)),
    "full": ((0.1, 0.3, 0.5, 0.9, 1.0), (0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5, 0.55, 0.65, 0.8)),
}  # fmt: skip
BED_STEPS = 250
#: A bed is unstable where its kinetic energy has grown so many times: at a good step it falls.
BED_GROWN = 100.0
COLOURS = {STABLE: "#56b4e9", POOR: "#e6c229", UNSTABLE: "#b3261e"}
WORDS = {STABLE: "stable", POOR: "rebound off by more than 1 %", UNSTABLE: "unstable: gains energy"}


@dataclasses.dataclass(frozen=True)
class Point:
    """One step of one row of the map."""

    row: str
    who: str
    share: float
    """Step / Rayleigh time."""
    found: int
    spot: Spot
    normal: str
    said: str = ""
    """What the code said as it gave up."""


@functools.cache
def ladders(tier: Tier, normal: str) -> dict[str, tuple[Scene, list[Spot]]]:
    """The two scenes that hold whole ladders."""
    rest, hit = FINE[tier]
    return {
        "rest": stability.at_rest(normal, stability.ladder(*REST, rest)),
        "impact": stability.impacts(normal, stability.ladder(*IMPACTS, hit)),
    }


@functools.cache
def columns(tier: Tier) -> dict[str, tuple[Scene, Spot]]:
    """One scene for each step of a column, by label."""
    restitutions, shares = COLUMNS[tier]
    return {
        f"column_e{100 * e:g}_{100 * f:g}": stability.column("hertz", e, f * whole)
        for e in restitutions
        for whole in [stability.column_limit("hertz", e)]
        for f in shares
    }


@functools.cache
def settled(tier: Tier) -> dict[str, tuple[Scene, Spot]]:
    """The settled bed at each step, by label."""
    restitutions, shares = BEDS[tier]
    ball = beds.MATERIALS["polystyrene"]
    whole = step_limit.rayleigh_time(beds.RADIUS, ball["young"], ball["poisson"], ball["density"])
    found = {}
    for e in restitutions:
        pairs = [{**pair, "restitution": e} for pair in beds.PAIRS]
        for share in shares:
            step = share * whole
            scene = beds.bench_scene(
                "settled", beds.COUNT, BED_STEPS, pairs=pairs,
                time=Time(step=step, duration=BED_STEPS * step),
                output=Output(history_every=10 * step), allow=("time_step",),
            )  # fmt: skip
            found[f"bed_e{100 * e:g}_{100 * share:g}"] = (scene, Spot("bed", share, e, 0.3, ()))
    return found


def variants(tier: Tier) -> list[Variant]:
    """All scenes through all three."""
    made = []

    def add(label: str, scene: Scene, who: tuple[str, ...], may_end: bool = False) -> None:
        for name in who:
            suffix, code, arguments = WHO[name]
            timed = label == "impact_hertz"  # the rate that the table shows
            made.append(
                Variant(f"{label}-{suffix}", scene, (code,), {code: arguments}, may_end=may_end, timed=timed)
            )

    for normal in LAWS[tier]:
        for kind, (scene, _) in ladders(tier, normal).items():
            add(f"{kind}_{normal}", scene, tuple(WHO))
    for label, (scene, spot) in columns(tier).items():
        add(label, scene, tuple(WHO) if spot.restitution == 0.9 else FEW, may_end=True)
    for label, (scene, spot) in settled(tier).items():
        add(label, scene, tuple(WHO) if spot.restitution == 0.9 else FEW, may_end=True)
    return made


def points(results: Results) -> list[Point]:
    """Every point of the map."""
    return results.once("points", lambda: _points(results))


def _points(results: Results) -> list[Point]:
    found = []
    for who, (suffix, code, _) in WHO.items():
        if code not in results.codes():
            continue
        for normal in LAWS[results.tier]:
            for kind, (_, spots) in ladders(results.tier, normal).items():
                run = results[f"{kind}_{normal}-{suffix}", code]
                found += [
                    Point(row(s, normal), who, s.share, stability.judged(run, s), s, normal) for s in spots
                ]
        for label, (_, spot) in (columns(results.tier) | settled(results.tier)).items():
            key = (f"{label}-{suffix}", code)
            if key in results.ended:
                said = results.ended[key]
                found.append(Point(row(spot, "hertz"), who, spot.share, UNSTABLE, spot, "hertz", said))
            elif key in results.runs:
                judge = bed_judged if spot.kind == "bed" else stability.judged
                run = results[key]
                said = "; ".join(run.warnings) if code == "gpudem" else ""
                found.append(
                    Point(row(spot, "hertz"), who, spot.share, judge(run, spot), spot, "hertz", said)
                )
    return found


def bed_judged(run: Run, spot: Spot) -> int:
    """UNSTABLE where the kinetic energy has grown, STABLE otherwise."""
    energy = (run.history["kinetic_energy"] + run.history["rotational_energy"]).to_numpy()
    return STABLE if energy[-1] < BED_GROWN * energy[0] else UNSTABLE


def warned(point: Point) -> bool:
    """Whether gpudem says before a run that this step is above the usual limits: 0.2 of the Rayleigh time or
    0.05 of the contact time, as `gpudem validate` prints.
    """
    if point.spot.kind != "impact":
        return point.share > USUAL_RAYLEIGH
    c = stability.floor_bodies(point.spot)
    return point.share > USUAL_RAYLEIGH or stability.STEP > USUAL_CONTACT * stability.contact_time(
        c, point.normal
    )


def row(spot: Spot, normal: str) -> str:
    """Name of a row of the map."""
    what = {
        "rest": f"ball at rest, e = {spot.restitution:g}, mu = {spot.friction:g}",
        "impact": f"impact, e = {spot.restitution:g}" + (", mu = 0.5, 45°" if spot.friction else ", head-on"),
        "column": f"column of {stability.COLUMN}, e = {spot.restitution:g}",
        "bed": f"bed of {beds.COUNT}, e = {spot.restitution:g}, mu = {spot.friction:g}",
    }[spot.kind]
    return f"{normal}: {what}"


def bracket(results: Results, name: str, who: str, worst: int) -> tuple[float, float]:
    """(Largest step up to which all are at most `worst`, the next) / Rayleigh time; NaN, inf at the ends."""
    mine = sorted((p.share, p.found) for p in points(results) if (p.row, p.who) == (name, who))
    last = math.nan
    for share, found in mine:
        if found > worst:
            return last, share
        last = share
    return last, math.inf


def rows(results: Results) -> list[str]:
    """Rows of the map, in order."""
    order = ("rest", "column", "bed", "impact")
    found = sorted(points(results), key=lambda p: (p.normal, order.index(p.spot.kind)))
    return list(dict.fromkeys(p.row for p in found))


def draw(results: Results) -> Figure:
    """A bar for each point, coloured by what it turned out to be; a line where the closed form says."""
    names, who = rows(results), list(dict.fromkeys(p.who for p in points(results)))
    figure, axes = plots.figure(
        1,
        len(who),
        width=1.15 * plots.WHOLE,
        height=1.2 + 0.2 * len(names),
        sharey=True,
        sharex=True,
        squeeze=False,
    )
    for ax, one in zip(axes[0], who, strict=True):
        for k, name in enumerate(names):
            mine = [p for p in points(results) if (p.row, p.who) == (name, one)]
            mine.sort(key=lambda p: p.share)
            if not mine:
                continue
            shares = [p.share for p in mine]
            between = [math.sqrt(a * b) for a, b in itertools.pairwise(shares)]
            edges = [shares[0], *between, shares[-1]]
            for p, lo, hi in zip(mine, edges, edges[1:], strict=False):
                ax.barh(k, hi - lo, left=lo, height=0.8, color=COLOURS[p.found], label=WORDS[p.found])
            if mine[0].spot.kind in ("rest", "column"):
                marginal = [p for p in mine if p.share >= stability.limit(p.spot, p.normal)]
                if marginal:
                    at = stability.limit(marginal[0].spot, marginal[0].normal)
                    mark = {"color": "black", "lw": 1.4, "label": "closed form, half_step"}
                    ax.plot([at, at], [k - 0.5, k + 0.5], **mark)
        ax.set(title=one, xscale="log", xlabel="step / Rayleigh time", ylim=(len(names) - 0.4, -0.6))
        ax.set_xticks([0.05, 0.2, 1, 5], ["0.05", "0.2", "1", "5"])
        ax.minorticks_off()
        ax.axvspan(0.1, 0.2, color="0.9", zorder=0)
        ax.grid(axis="y", visible=False)
    axes[0, 0].set_yticks(range(len(names)), names, fontsize=7.5)
    handles = {}
    for ax in axes[0]:
        handles |= dict(zip(*reversed(ax.get_legend_handles_labels()), strict=True))
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=4, fontsize=8)
    return figure


def table(results: Results) -> pandas.DataFrame:
    """Largest steps of each row, / Rayleigh time."""
    import pandas

    def text(name: str, one: str, worst: int) -> str:
        lo, hi = bracket(results, name, one, worst)
        if math.isnan(lo):
            return f"below {hi:.2g}"
        return f"{lo:.2f}" if math.isfinite(hi) else f"above {lo:.2f}"

    found = []
    for name in rows(results):
        mine = [p for p in points(results) if p.row == name]
        p = mine[0]
        line: dict[str, object] = {"contact": name}
        for one in dict.fromkeys(q.who for q in points(results)):
            has = any(q.who == one for q in mine)
            line[f"{one}: stable up to [T_R]"] = text(name, one, POOR) if has else "not run"
        if p.spot.kind == "impact":
            line["within 1 %: half_step, path [T_R]"] = ", ".join(
                text(name, one, STABLE) for one in ("gpudem half_step", "gpudem path")
            )
            tr = stability.STEP / p.spot.share
            c = stability.floor_bodies(p.spot)
            line["T_R / contact time"] = f"{tr / stability.contact_time(c, p.normal):.2f}"
        found.append(line)
    return pandas.DataFrame(found).fillna("")


def costs(results: Results) -> pandas.DataFrame:
    """Error of head-on Hertz impacts at usual steps, and time a ball and step, of each who."""
    import pandas

    rows = []
    for who, (suffix, code, _) in WHO.items():
        key = (f"impact_hertz-{suffix}", code)
        if key not in results.runs:
            continue
        run, row = results[key], {"by": who}
        for e in (0.3, 0.5, 0.9):
            mine = [p.spot for p in points(results) if p.who == who and p.normal == "hertz"]
            mine = [s for s in mine if s.kind == "impact" and s.restitution == e and not s.friction]
            for share in (0.05, 0.1, 0.2):
                spot = min(mine, key=lambda s: abs(math.log(s.share / share)))
                row[f"e = {e:g}, {share:g} T_R"] = number(stability.rebound(run, spot)[1], 2)
        row["us a ball and step"] = f"{1e6 / run.timing.rate:.2f}"
        rows.append(row)
    return pandas.DataFrame(rows)


def advice(results: Results) -> pandas.DataFrame:
    """Which step to use, in sentences with the numbers of this run."""
    import pandas

    unstable = [p for p in points(results) if p.found == UNSTABLE]

    def least(kind: str) -> str:
        found = [p for p in unstable if p.spot.kind == kind and p.normal == "hertz"]
        if not found:
            return "not run"
        p = min(found, key=lambda p: p.share)
        return f"{p.share:.2g} ({p.row.partition(': ')[2]}, {p.who})"

    half, path = (
        bracket(results, "hertz: impact, e = 0.5, head-on", who, STABLE)[1] for who in list(WHO)[:2]
    )
    text = (
        "Take a tenth of the Rayleigh time: the first to become unstable are a single ball at rest at"
        f" {least('rest')} of it, a column at {least('column')}, a bed at {least('bed')}; impacts gain energy"
        f" from {least('impact')} on, and where there is damping the rebound is off long before: at e = 0.5"
        f" 1 % takes a step below {half:.2g} of it with half_step, as in LIGGGHTS, and below {path:.2g} with"
        " path."
    )
    rows = [("step", text)]
    return pandas.DataFrame(rows, columns=["choose", "by"])
