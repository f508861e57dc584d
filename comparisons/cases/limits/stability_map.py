"""The map of stable steps: its scenes, what each point turned out to be, its figure and its tables."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from typing import TYPE_CHECKING

from comparisons.bench import beds
from comparisons.cases.limits import stability
from comparisons.cases.limits.stability import POOR, STABLE, UNSTABLE, Spot
from comparisons.harness import codes
from comparisons.harness.case import Results, Tier, Variant
from comparisons.harness.configurations import Configuration, Configurations
from comparisons.harness.numbers import number
from comparisons.oracles import step_limit
from comparisons.report import plots
from gpudem.output.run import Run
from gpudem.scene import Output, Scene, Time
from gpudem.scene.time_step import USUAL_CONTACT, USUAL_RAYLEIGH

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

HALF = Configuration("gpudem half_step", options={"integrator": "half_step"})
PATH = Configuration("gpudem path", options={"integrator": "path"}, label="path")
MIXED = Configuration("gpudem mixed", options={"precision": "mixed"}, label="mixed")
SINGLE = Configuration("gpudem float32", options={"precision": "float32"}, label="float32")
#: The limits are those of the half-step scheme: codes that a user brings are not asked.
CONFIGURATIONS = Configurations(HALF, PATH, MIXED, SINGLE)
LAWS = {"quick": ("hertz",), "standard": ("hertz", "hooke"), "full": ("hertz", "hooke")}
#: Ratio of one step of a sweep to the next: contacts at rest, impacts; and where the sweeps begin and end.
FINE = {"quick": (1.25, 1.4), "standard": (1.07, 1.12), "full": (1.02, 1.05)}
REST, IMPACTS = (0.25, 8.0), (0.04, 2.5)
#: Columns: restitution, and steps / closed form's limit.
COLUMNS = {
    "quick": ((0.9,), (0.9, 1.1)),
    "standard": ((0.3, 0.9, 1.0), (0.6, 0.8, 0.97, 1.03, 1.1)),
    "full": ((0.3, 0.5, 0.9, 1.0), (0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 1.02, 1.05, 1.1, 1.2)),
}
#: The settled bed of 5000 balls: restitution, steps / Rayleigh time.
BEDS = {
    "quick": ((), ()), "standard": ((0.3, 0.9), (0.2, 0.3, 0.4, 0.5, 0.65, 0.8)),
    "full": ((0.1, 0.3, 0.5, 0.9, 1.0), (0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5, 0.55, 0.65, 0.8)),
}  # fmt: skip
BED_STEPS = 250
#: A bed is unstable where its kinetic energy has grown by this factor: at a stable step it falls.
BED_GROWN = 100.0
COLORS = {STABLE: "#56b4e9", POOR: "#e6c229", UNSTABLE: "#b3261e"}
WORDS = {STABLE: "stable", POOR: "rebound off by more than 1 %", UNSTABLE: "unstable: gains energy"}


@dataclasses.dataclass(frozen=True)
class Point:
    """One contact at one step by one configuration."""

    by: str
    normal: str
    spot: Spot
    found: int
    """STABLE, POOR or UNSTABLE."""
    message: str = ""
    """What the code said during the run or as it ended it."""

    @property
    def share(self) -> float:
        """Step / Rayleigh time."""
        return self.spot.share

    @property
    def row(self) -> str:
        """Its row of the map."""
        s = self.spot
        what = {
            "rest": f"ball at rest, e = {s.restitution:g}, mu = {s.friction:g}",
            "impact": f"impact, e = {s.restitution:g}" + (", mu = 0.5, 45°" if s.friction else ", head-on"),
            "column": f"column of {stability.COLUMN}, e = {s.restitution:g}",
            "bed": f"bed of {beds.COUNT}, e = {s.restitution:g}, mu = {s.friction:g}",
        }[s.kind]
        return f"{self.normal}: {what}"

    @property
    def warned(self) -> bool:
        """Whether `gpudem validate` calls this step long: above 0.2 of the Rayleigh time or 0.05 of the
        contact time.
        """
        if self.share > USUAL_RAYLEIGH or self.spot.kind != "impact":
            return self.share > USUAL_RAYLEIGH
        return USUAL_CONTACT * stability.contact_time(self.spot, self.normal) < stability.STEP


@functools.cache
def sweeps(tier: Tier, normal: str) -> dict[str, tuple[Scene, list[Spot]]]:
    """The two scenes that hold whole sweeps."""
    rest, hit = FINE[tier]
    return {
        "rest": stability.at_rest(normal, stability.sweep(*REST, rest)),
        "impact": stability.impacts(normal, stability.sweep(*IMPACTS, hit)),
    }


@functools.cache
def single(tier: Tier) -> dict[str, tuple[Scene, Spot]]:
    """One scene for each step of a column and of the settled bed, by label."""
    found, (restitutions, shares) = {}, COLUMNS[tier]
    for e in restitutions:
        whole = stability.column_limit("hertz", e)
        found |= {f"column_e{100 * e:g}_{100 * f:g}": stability.column("hertz", e, f * whole) for f in shares}
    ball, (restitutions, shares) = beds.MATERIALS["polystyrene"], BEDS[tier]
    rayleigh = step_limit.rayleigh_time(beds.RADIUS, ball["young"], ball["poisson"], ball["density"])
    for e, share in itertools.product(restitutions, shares):
        step = share * rayleigh
        scene = beds.bench_scene(
            "settled", beds.COUNT, BED_STEPS, pairs=[{**pair, "restitution": e} for pair in beds.PAIRS],
            time=Time(step=step, duration=BED_STEPS * step), output=Output(history_every=10 * step),
            allow=("time_step",),
        )  # fmt: skip
        found[f"bed_e{100 * e:g}_{100 * share:g}"] = (scene, Spot("bed", share, e, 0.3))
    return found


def variants(tier: Tier) -> list[Variant]:
    """All scenes by all configurations; columns and beds of e other than 0.9 not in mixed and float32."""
    asked = ("gpudem", *codes.references(tuple(codes.CODES)))
    made = []
    for normal in LAWS[tier]:
        for kind, (scene, _) in sweeps(tier, normal).items():
            made += CONFIGURATIONS.variants(f"{kind}_{normal}", scene, codes=asked)
    for label, (scene, spot) in single(tier).items():
        own = CONFIGURATIONS.own if spot.restitution == 0.9 else (HALF, PATH)
        made += CONFIGURATIONS.variants(label, scene, own, codes=asked, may_end=True)
    return made


def points(results: Results) -> list[Point]:
    """Every point of the map."""
    return results.once("points", lambda: _points(results))


def _points(results: Results) -> list[Point]:
    found = []
    for one in CONFIGURATIONS.among(results.codes()):
        for normal in LAWS[results.tier]:
            for kind, (_, spots) in sweeps(results.tier, normal).items():
                run = one.run(results, f"{kind}_{normal}")
                found += [Point(one.title, normal, s, stability.judged(run, s)) for s in spots]
        for label, (_, spot) in single(results.tier).items():
            key = one.key(label)
            if key in results.ended:
                found.append(Point(one.title, "hertz", spot, UNSTABLE, results.ended[key]))
            elif key in results.runs:
                run = results[key]
                judge = bed_judged if spot.kind == "bed" else stability.judged
                message = "; ".join(run.warnings) if one.code == "gpudem" else ""
                found.append(Point(one.title, "hertz", spot, judge(run, spot), message))
    return found


def bed_judged(run: Run, spot: Spot) -> int:
    """UNSTABLE where the kinetic energy has grown, STABLE otherwise."""
    energy = (run.history["kinetic_energy"] + run.history["rotational_energy"]).to_numpy()
    return STABLE if energy[-1] < BED_GROWN * energy[0] else UNSTABLE


def bracket(results: Results, row: str, by: str, worst: int) -> tuple[float, float]:
    """(Largest step up to which all are at most `worst`, the next) / Rayleigh time; NaN, inf at the ends."""
    last = math.nan
    for p in _row(results, row, by):
        if p.found > worst:
            return last, p.share
        last = p.share
    return last, math.inf


def _row(results: Results, row: str, by: str) -> list[Point]:
    def grouped() -> dict[tuple[str, str], list[Point]]:
        found: dict[tuple[str, str], list[Point]] = {}
        for p in sorted(points(results), key=lambda p: p.share):
            found.setdefault((p.row, p.by), []).append(p)
        return found

    return results.once("points by row", grouped).get((row, by), [])


def rows(results: Results) -> dict[str, Point]:
    """Rows of the map in order, with one point of each."""
    order = ("rest", "column", "bed", "impact")
    found = sorted(points(results), key=lambda p: (p.normal, order.index(p.spot.kind)), reverse=True)
    return dict(reversed({p.row: p for p in found}.items()))


def _by(results: Results) -> list[str]:
    return list(dict.fromkeys(p.by for p in points(results)))


def draw(results: Results) -> Figure:
    """A bar for each point, colored by what it turned out to be; a line at the closed form's limit."""
    names, by = list(rows(results)), _by(results)
    figure, axes = plots.figure(
        1, len(by), width=1.15 * plots.WHOLE, height=1.2 + 0.2 * len(names), sharey=True, sharex=True,
        squeeze=False,
    )  # fmt: skip
    for ax, one in zip(axes[0], by, strict=True):
        for k, name in enumerate(names):
            mine = _row(results, name, one)
            shares = [p.share for p in mine]
            edges = [*shares[:1], *(math.sqrt(a * b) for a, b in itertools.pairwise(shares)), *shares[-1:]]
            for p, lo, hi in zip(mine, edges, edges[1:], strict=False):
                ax.barh(k, hi - lo, left=lo, height=0.8, color=COLORS[p.found], label=WORDS[p.found])
            if mine and mine[0].spot.kind in ("rest", "column"):
                limits = [stability.limit(p.spot, p.normal) for p in mine]
                at = next((x for x, p in zip(limits, mine, strict=True) if p.share >= x), None)
                if at is not None:
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
    """Largest steps of each row / Rayleigh time."""
    import pandas

    def text(name: str, one: str, worst: int) -> str:
        lo, hi = bracket(results, name, one, worst)
        if math.isnan(lo):
            return f"below {hi:.2g}" if math.isfinite(hi) else "not run"
        return f"{lo:.2f}" if math.isfinite(hi) else f"above {lo:.2f}"

    found = []
    for name, p in rows(results).items():
        line = {"contact": name}
        line |= {f"{one}: stable up to [T_R]": text(name, one, POOR) for one in _by(results)}
        if p.spot.kind == "impact":
            within = (text(name, one.title, STABLE) for one in (HALF, PATH))
            line["within 1 %: half_step, path [T_R]"] = ", ".join(within)
            ratio = stability.STEP / p.share / stability.contact_time(p.spot, p.normal)
            line["T_R / contact time"] = f"{ratio:.2f}"
        found.append(line)
    return pandas.DataFrame(found).fillna("")


def impact_errors(results: Results) -> pandas.DataFrame:
    """Error of head-on Hertz impacts at usual steps, by configuration."""
    import pandas

    found = []
    for one in CONFIGURATIONS.among(results.codes()):
        run = one.run(results, "impact_hertz")
        row = {"by": one.title}
        for e in (0.3, 0.5, 0.9):
            spots = [
                s
                for s in sweeps(results.tier, "hertz")["impact"][1]
                if (s.restitution, s.friction) == (e, 0.0)
            ]
            for share in (0.05, 0.1, 0.2):
                spot = min(spots, key=lambda s: abs(math.log(s.share / share)))
                row[f"e = {e:g}, {share:g} T_R"] = number(stability.rebound(run, spot)[1], 2)
        found.append(row)
    return pandas.DataFrame(found)


def advice(results: Results) -> pandas.DataFrame:
    """Which step to use, in one sentence with the numbers of this run."""
    import pandas

    def least(kind: str) -> str:
        found = [
            p for p in points(results)
            if p.found == UNSTABLE and p.spot.kind == kind and p.normal == "hertz"
        ]  # fmt: skip
        if not found:
            return "not run"
        p = min(found, key=lambda p: p.share)
        return f"{p.share:.2g} ({p.row.partition(': ')[2]}, {p.by})"

    half, path = (
        bracket(results, "hertz: impact, e = 0.5, head-on", one.title, STABLE)[1] for one in (HALF, PATH)
    )
    text = (
        "Use a tenth of the Rayleigh time. The smallest steps that are unstable, as multiples of it: a single"
        f" ball at rest {least('rest')}, a column {least('column')}, a bed {least('bed')}, impacts"
        f" {least('impact')}. With damping, accuracy limits the step earlier: at e = 0.5 a rebound within 1 %"
        f" needs less than {half:.2g} with half_step, as in LIGGGHTS, and less than {path:.2g} with path."
    )
    return pandas.DataFrame([("step", text)], columns=["choose", "by"])
