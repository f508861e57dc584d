"""The largest stable step of contacts at rest, columns, a settled bed and impacts: a map found by sweeps."""

from __future__ import annotations

import functools
import itertools
import math
from typing import Any

import numpy as np
import pandas

from comparisons import kit
from comparisons.bench import beds
from comparisons.cases.limits import stability
from comparisons.cases.limits.stability import POOR, STABLE, UNSTABLE, Spot
from comparisons.harness import codes
from comparisons.oracles import step_limit
from comparisons.report import plots
from gpudem.output.run import Run
from gpudem.scene import Output, Scene, Time
from gpudem.scene.time_step import USUAL_CONTACT, USUAL_RAYLEIGH

HALF = kit.Configuration("gpudem half_step", options={"integrator": "half_step"})
PATH = kit.Configuration("gpudem path", options={"integrator": "path"}, label="path")
MIXED = kit.Configuration("gpudem mixed", options={"precision": "mixed"}, label="mixed")
SINGLE = kit.Configuration("gpudem float32", options={"precision": "float32"}, label="float32")
#: The limits are those of the half-step scheme: codes that a user brings are not asked.
CONFIGURATIONS = kit.Configurations(HALF, PATH, MIXED, SINGLE, brought=False)
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
#: So near the closed form's limit [share] growth is too slow to be judged.
MARGIN = 0.02
COLORS = {STABLE: "#56b4e9", POOR: "#e6c229", UNSTABLE: "#b3261e"}
KINDS = ("rest", "column", "bed", "impact")
#: A pandas.DataFrame whose columns are read as attributes, which a type checker cannot know.
Frame = Any
WORDS = {STABLE: "stable", POOR: "rebound off by more than 1 %", UNSTABLE: "unstable: gains energy"}


def _point(one: kit.Configuration, normal: str, spot: Spot, found: int, message: str = "") -> dict[str, Any]:
    """One contact at one step by one configuration: `message` is what the code said during the run."""
    friction = ", mu = 0.5, 45°" if spot.friction else ", head-on"
    what = {
        "rest": f"ball at rest, e = {spot.restitution:g}, mu = {spot.friction:g}",
        "impact": f"impact, e = {spot.restitution:g}{friction}",
        "column": f"column of {stability.COLUMN}, e = {spot.restitution:g}",
        "bed": f"bed of {beds.COUNT}, e = {spot.restitution:g}, mu = {spot.friction:g}",
    }[spot.kind]
    contact = stability.contact_time(spot, normal) if spot.kind == "impact" else math.inf
    # `gpudem validate` calls a step long by its share of the Rayleigh time or of the contact time
    warned = bool(spot.share > USUAL_RAYLEIGH or USUAL_CONTACT * contact < stability.STEP)
    return {
        "by": one.title, "normal": normal, "kind": spot.kind, "row": f"{normal}: {what}",
        "share": spot.share, "found": found, "message": message, "warned": warned,
        "limit": stability.limit(spot, normal) if spot.kind in ("rest", "column") else math.nan,
        "ratio": stability.STEP / spot.share / contact,
    }  # fmt: skip


@functools.cache
def sweeps(tier: kit.Tier, normal: str) -> dict[str, tuple[Scene, list[Spot]]]:
    """The two scenes that hold whole sweeps."""
    rest, hit = FINE[tier]
    return {
        "rest": stability.at_rest(normal, stability.sweep(*REST, rest)),
        "impact": stability.impacts(normal, stability.sweep(*IMPACTS, hit)),
    }


@functools.cache
def single(tier: kit.Tier) -> dict[str, tuple[Scene, Spot]]:
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


def variants(tier: kit.Tier) -> list[kit.Variant]:
    """All scenes by all configurations; columns and beds of e other than 0.9 not in mixed and float32."""
    made = []
    for normal in LAWS[tier]:
        for kind, (scene, _) in sweeps(tier, normal).items():
            made += CONFIGURATIONS.variants(f"{kind}_{normal}", scene)
    for label, (scene, spot) in single(tier).items():
        own = CONFIGURATIONS.own if spot.restitution == 0.9 else (HALF, PATH)
        made += CONFIGURATIONS.variants(label, scene, own, may_end=True)
    return made


def points(results: kit.Results, **equal: Any) -> Frame:
    """Points of the map by rising step, those with these values; the columns of `_point`."""
    found = results.once("points", lambda: _points(results))
    for column, value in equal.items():
        found = found[found[column] == value]
    return found


def _points(results: kit.Results) -> pandas.DataFrame:
    found = []
    for one in CONFIGURATIONS.among(results.codes()):
        for normal in LAWS[results.tier]:
            for kind, (_, spots) in sweeps(results.tier, normal).items():
                run = one.run(results, f"{kind}_{normal}")
                found += [_point(one, normal, s, stability.judged(run, s)) for s in spots]
        for label, (_, spot) in single(results.tier).items():
            key = one.key(label)
            if key in results.ended:
                found.append(_point(one, "hertz", spot, UNSTABLE, results.ended[key]))
            elif key in results.runs:
                run = results[key]
                judge = bed_judged if spot.kind == "bed" else stability.judged
                message = "; ".join(run.warnings) if one.code == "gpudem" else ""
                found.append(_point(one, "hertz", spot, judge(run, spot), message))
    return pandas.DataFrame(found).sort_values("share", kind="stable")


def bed_judged(run: Run, spot: Spot) -> int:
    """UNSTABLE where the kinetic energy has grown, STABLE otherwise."""
    energy = (run.history["kinetic_energy"] + run.history["rotational_energy"]).to_numpy()
    return STABLE if energy[-1] < BED_GROWN * energy[0] else UNSTABLE


def bracket(results: kit.Results, row: str, by: str, worst: int) -> tuple[float, float]:
    """(Largest step up to which all are at most `worst`, the next) / Rayleigh time; NaN, inf at the ends."""
    mine = points(results, row=row, by=by)
    above = min(mine.share[mine.found > worst], default=math.inf)
    return max(mine.share[mine.share < above], default=math.nan), above


def rows(results: kit.Results) -> Frame:
    """Rows of the map in order, one point of each."""
    found = points(results).drop_duplicates("row")
    return found.assign(kind=pandas.Categorical(found.kind, KINDS)).sort_values(["normal", "kind", "row"])


def draw(results: kit.Results) -> plots.Figure:
    """A bar for each point, colored by what it turned out to be; a line at the closed form's limit."""
    names, everyone = list(rows(results).row), points(results).by.unique()
    figure, axes = plots.figure(
        1, len(everyone), width=1.15 * plots.WHOLE, height=1.2 + 0.2 * len(names), sharey=True, sharex=True,
        squeeze=False,
    )  # fmt: skip
    for ax, one in zip(axes[0], everyone, strict=True):
        for k, name in enumerate(names):
            mine = points(results, row=name, by=one)
            shares = list(mine.share)
            edges = [*shares[:1], *(math.sqrt(a * b) for a, b in itertools.pairwise(shares)), *shares[-1:]]
            for found, lo, hi in zip(mine.found, edges, edges[1:], strict=False):
                ax.barh(k, hi - lo, left=lo, height=0.8, color=COLORS[found], label=WORDS[found])
            for limit in mine.limit[mine.share >= mine.limit][:1]:
                look = {"color": "black", "lw": 1.4, "label": "closed form, half_step"}
                ax.plot([limit, limit], [k - 0.5, k + 0.5], **look)
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


def table(results: kit.Results) -> pandas.DataFrame:
    """Largest steps of each row / Rayleigh time."""

    def text(row: str, by: str, worst: int) -> str:
        lo, hi = bracket(results, row, by, worst)
        if math.isnan(lo):
            return f"below {hi:.2g}" if math.isfinite(hi) else "not run"
        return f"{lo:.2f}" if math.isfinite(hi) else f"above {lo:.2f}"

    found = []
    for p in rows(results).itertuples():
        line = {"contact": p.row}
        line |= {f"{by}: stable up to [T_R]": text(p.row, by, POOR) for by in points(results).by.unique()}
        if p.kind == "impact":
            within = (text(p.row, one.title, STABLE) for one in (HALF, PATH))
            line["within 1 %: half_step, path [T_R]"] = ", ".join(within)
            line["T_R / contact time"] = f"{p.ratio:.2f}"
        found.append(line)
    return pandas.DataFrame(found).fillna("")


def impact_errors(results: kit.Results) -> kit.Rows:
    """Error of head-on Hertz impacts at usual steps, by configuration."""
    found, sweep = [], sweeps(results.tier, "hertz")["impact"][1]
    for one in CONFIGURATIONS.among(results.codes()):
        run = one.run(results, "impact_hertz")
        row = {"code": one.title}
        for e in (0.3, 0.5, 0.9):
            spots = [s for s in sweep if (s.restitution, s.friction) == (e, 0.0)]
            for share in (0.05, 0.1, 0.2):
                spot = min(spots, key=lambda s: abs(math.log(s.share / share)))
                row[f"e = {e:g}, {share:g} T_R"] = kit.number(stability.rebound(run, spot)[1], 2)
        found.append(row)
    return found


def advice(results: kit.Results) -> kit.Rows:
    """Which step to use, in one sentence with the numbers of this run."""
    first = points(results, found=UNSTABLE, normal="hertz").drop_duplicates("kind").set_index("kind")
    least = {
        kind: "{share:.2g} ({what}, {by})".format(what=p.row.partition(": ")[2], **p)
        for kind, p in first.iterrows()
    }
    half, path = (
        bracket(results, "hertz: impact, e = 0.5, head-on", one.title, STABLE)[1] for one in (HALF, PATH)
    )
    text = (
        "Use a tenth of the Rayleigh time. The smallest unstable steps, as multiples of the Rayleigh time: a"
        f" single ball at rest {least.get('rest', 'not run')}, a column {least.get('column', 'not run')}, a"
        f" bed {least.get('bed', 'not run')}, impacts {least.get('impact', 'not run')}. With damping,"
        f" accuracy limits the step earlier: at e = 0.5 a rebound within 1 % needs less than {half:.2g} with"
        f" half_step, as in LIGGGHTS, and less than {path:.2g} with path."
    )
    return [{"choose": "step", "by": text}]


# -- checks --------------------------------------------------------------------------------------------------


def against_limit(results: kit.Results, by: str, kind: str) -> kit.Measured:
    """Points on the wrong side of the closed form's limit, among those farther from it than MARGIN."""
    mine = points(results, by=by, kind=kind)
    ratio = mine.share / mine.limit
    mine = mine.assign(ratio=ratio)[np.abs(np.log(ratio)) > MARGIN]
    wrong = mine[(mine.ratio > 1) != (mine.found == UNSTABLE)]
    both = mine.ratio.min() < 1 < mine.ratio.max()
    return _counted(wrong, f"{len(ratio)} points", "{row} at {ratio:.3f} of the limit", both)


def judged_differently(results: kit.Results, by: str) -> kit.Measured:
    """Points that gpudem half_step and another configuration judge differently, of those both ran."""
    half, theirs = (points(results, by=one) for one in (HALF.title, by))
    both = theirs.merge(half, how="left", on=["row", "share"])
    return _counted(both[both.found_x != both.found_y], f"{len(theirs)} points", "{row}", len(theirs) > 0)


def silent(results: kit.Results) -> kit.Measured:
    """Unstable points of gpudem without a warning before the run or a message during it."""
    mine = points(results, found=UNSTABLE)
    mine = mine[mine.by.isin([one.title for one in CONFIGURATIONS.own])]
    note = f"{len(mine)} points, {mine.warned.sum()} warned of before the run"
    return _counted(mine[(mine.message == "") & ~mine.warned], note, "{row} at {share:.2f}")


def _counted(wrong: Frame, note: str, each: str, enough: bool = True) -> kit.Measured:
    """How many points are wrong, and the first of them; NaN where there are not enough to judge."""
    texts = [note, *(each.format(**p) for p in wrong[:4].to_dict("records"))]
    return kit.Measured(float(len(wrong)) if enough else math.nan, note="; ".join(texts))


def least_unstable(results: kit.Results) -> kit.Measured:
    """Smallest step / Rayleigh time at which anything is unstable, of all rows and configurations."""
    worst = points(results, found=UNSTABLE).iloc[0]
    return kit.Measured(worst.share, measured=worst.share, note=f"{worst.by}, {worst.row}")


CASE = kit.Case(
    name="stable_step",
    title="The largest stable step",
    purpose=(
        "The usual limit of the time step is a share of the Rayleigh time. What sets the limit is the"
        " contact: its stiffness under load, the damping (the dashpot uses velocities half a step old, which"
        " shortens the limit), and friction, whose spring is loaded by slip and spin together and oscillates"
        " 1.67 times faster than the normal one. For contacts at rest there is a closed form, (2/w)(sqrt(1 +"
        " b^2) - b), and the codes become unstable where it says. Impacts have no such limit: they lose"
        " accuracy first and then gain energy. The Rayleigh time does not depend on the load: the same share"
        " of it is stable for a ball under its own weight and unstable for one in a bed. These scenes waive"
        " the checks of the step."
    ),
    source="Eigenvalues of LIGGGHTS' scheme on the linearized contact; Rayleigh time: LIGGGHTS manual.",
    variants=variants,
    checks=(
        *(
            kit.per_configuration(
                CONFIGURATIONS, f"{text} on the wrong side of the closed form's limit",
                lambda results, one, kind=kind: against_limit(results, one.title, kind),
                without=(PATH, MIXED, SINGLE), tolerance=0.0, unit="points",
                against="closed form",
                reason=f"both sides are sampled; nearer to the limit than {MARGIN:.0%} growth is too slow",
                catches="damping that lags by another half step, a friction spring without the spin, a"
                " stiffness at rest that is not the derivative of the law",
            )
            for kind, text in (("rest", "balls at rest"), ("column", "columns"))
        ),
        kit.per_pair(
            "points of the map that gpudem half_step and {other} judge differently",
            lambda results, code, other: judged_differently(results, codes.title(other)),
            brought=False, tolerance=0.0, unit="points",
            reason="same law and scheme: they agree to rounding before anything grows",
            catches="another stability limit in any law, damping or friction",
        ),
        kit.Check(
            name="points of the map that float64 and mixed judge differently",
            measure=lambda results: judged_differently(results, MIXED.title), tolerance=0.0, unit="points",
            against="gpudem float64", mark="R",
            reason="the limit depends on stiffness and mass: rounding a force by 6e-8 does not move it",
            catches="positions or velocities that mixed rounds: noise that grows where nothing should",
        ),
        kit.Check(
            name="unstable points of which gpudem says nothing, before or during the run",
            measure=silent, tolerance=0.0, unit="points", against="warnings and errors", mark="R",
            reason="a step above the usual limits is warned of before the run; guards: speed, overlap, a"
            " particle that leaves, energy",
            catches="a limit of the step set above what is stable; a run that blows up without a message",
        ),
        kit.Check(
            name="least step / Rayleigh time at which any contact of the map is unstable",
            measure=least_unstable, tolerance=10.0, lo=0.1, unit="1",
            against="the usual 10 % of the Rayleigh time", mark="R",
            reason="the usual step must be stable on every scene of the map",
            catches="a rule of thumb that is unstable on these scenes",
        ),
    ),
    figures=(
        kit.Figure(
            "Stable, inaccurate and unstable time steps",
            "Steps as shares of the Rayleigh time of the ball; gray: the usual 10 to 20 %. Balls at rest,"
            " columns and beds are stable or not; for impacts at 1 m/s also whether the rebound is within 1"
            " %, for the worst of eight phases of the first contact within a step.",
            draw, section="limits",
        ),
    ),
    tables=(
        kit.Table(
            "How long: which step to use", "Numbers of this run; impacts at 1 m/s on 5 MPa.",
            advice, section="advice",
        ),
        kit.Table(
            "Error of the impacts",
            "Largest error of the rebound over eight phases, at the step nearest to that share of the"
            " Rayleigh time T_R.",
            impact_errors, section="limits",
        ),
        kit.Table(
            "Largest steps", "Largest stable step tried / Rayleigh time T_R; impacts at 1 m/s.",
            table, section="limits",
        ),
    ),
    features=("normal hertz", "normal hooke", "damping", "tangential history", "integrator path", "mixed",
              "float32"),
    order=80,
)  # fmt: skip
