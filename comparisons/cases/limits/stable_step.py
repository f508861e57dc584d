"""The largest stable step of contacts at rest, columns, a settled bed and impacts, found by sweeps."""

from __future__ import annotations

import math

from comparisons.cases.limits import stability, stability_map
from comparisons.cases.limits.stability import UNSTABLE
from comparisons.cases.limits.stability_map import CONFIGURATIONS, HALF, MIXED, points
from comparisons.harness import codes
from comparisons.harness.case import Case, Check, Figure, Measured, PerCode, PerPair, Results, Table

#: So near the closed form's limit [share] growth is too slow to be judged.
MARGIN = 0.02


def against_limit(results: Results, by: str, kind: str) -> Measured:
    """Points on the wrong side of the closed form's limit, among those farther from it than MARGIN."""
    mine = [p for p in points(results) if p.by == by and p.spot.kind == kind]
    wrong, sides = [], set()
    for p in mine:
        ratio = p.share / stability.limit(p.spot, p.normal)
        if abs(math.log(ratio)) > MARGIN:
            sides.add(ratio > 1)
            if (ratio > 1) != (p.found == UNSTABLE):
                wrong.append(f"{p.row} at {ratio:.3f} of the limit")
    note = f"{len(mine)} points; " + ("; ".join(wrong[:3]) or "all on the right side")
    return Measured(float(len(wrong)) if sides == {True, False} else math.nan, note=note)


def judged_differently(results: Results, by: str) -> Measured:
    """Points that gpudem half_step and another configuration judge differently, of those both ran."""
    found = {(p.row, p.share): p.found for p in points(results) if p.by == HALF.title}
    theirs = [p for p in points(results) if p.by == by]
    apart = [p for p in theirs if found[p.row, p.share] != p.found]
    note = f"{len(theirs)} points; " + "; ".join(p.row for p in apart[:3])
    return Measured(float(len(apart)) if theirs else math.nan, note=note)


def silent(results: Results) -> Measured:
    """Unstable points of gpudem without a warning before the run or a message during it."""
    own = {one.title for one in CONFIGURATIONS.own}
    mine = [p for p in points(results) if p.by in own and p.found == UNSTABLE]
    before = [p for p in mine if p.warned]
    without = [p for p in mine if not p.message and not p.warned]
    notes = [f"{len(mine)} points, {len(before)} warned of before the run"]
    notes += [f"{p.row} at {p.share:.2f}" for p in without[:4]]
    return Measured(float(len(without)), note="; ".join(notes))


def least_unstable(results: Results) -> Measured:
    """Smallest step / Rayleigh time at which anything is unstable, of all rows and configurations."""
    worst = min((p for p in points(results) if p.found == UNSTABLE), key=lambda p: p.share)
    return Measured(worst.share, measured=worst.share, note=f"{worst.by}, {worst.row}")


def _limits(code: str) -> tuple[Check, ...]:
    if codes.brought(code):
        return ()
    title = CONFIGURATIONS.of(code)[0].title
    return tuple(
        Check(
            name=f"{text} on the wrong side of the closed form's limit ({title})",
            measure=lambda results, kind=kind: against_limit(results, title, kind),
            tolerance=0.0, unit="points", against="closed form", mark="A", needs=(code,),
            reason=f"both sides are sampled; within {MARGIN:.0%} of the limit growth is too slow to judge",
            catches="damping that lags by another half step, a friction spring without the spin, a stiffness"
            " at rest that is not the derivative of the law",
        )
        for kind, text in (("rest", "balls at rest"), ("column", "columns"))
    )  # fmt: skip


def _same_map(code: str, other: str) -> tuple[Check, ...]:
    if codes.brought(code):
        return ()
    title = codes.title(other)
    return (
        Check(
            name=f"points of the map that gpudem half_step and {title} judge differently",
            measure=lambda results: judged_differently(results, title), tolerance=0.0, unit="points",
            against=title, mark="X", needs=(code, other),
            reason="same law and scheme: they agree to rounding before anything grows",
            catches="another stability limit in any law, damping or friction",
        ),
    )  # fmt: skip


CASE = Case(
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
    variants=stability_map.variants,
    checks=(
        PerCode(_limits),
        PerPair(_same_map),
        Check(
            name="points of the map that float64 and mixed judge differently",
            measure=lambda results: judged_differently(results, MIXED.title), tolerance=0.0, unit="points",
            against="gpudem float64", mark="R",
            reason="the limit depends on stiffness and mass: rounding a force by 6e-8 does not move it",
            catches="positions or velocities that mixed rounds: noise that grows where nothing should",
        ),
        Check(
            name="unstable points of which gpudem says nothing, before or during the run",
            measure=silent, tolerance=0.0, unit="points", against="warnings and errors", mark="R",
            reason="a step above the usual limits is warned of before the run; guards: speed, overlap, a"
            " particle that leaves, energy",
            catches="a limit of the step set above what is stable; a run that blows up without a message",
        ),
        Check(
            name="least step / Rayleigh time at which any contact of the map is unstable",
            measure=least_unstable, tolerance=10.0, lo=0.1, unit="1",
            against="the usual 10 % of the Rayleigh time", mark="R",
            reason="the usual step must be stable on every scene of the map",
            catches="a rule of thumb that is unstable on these scenes",
        ),
    ),
    figures=(
        Figure(
            "Stable, inaccurate, unstable: the step against the contact",
            "Steps as shares of the Rayleigh time of the ball; gray: the usual 10 to 20 %. Balls at rest,"
            " columns and beds are stable or not; for impacts at 1 m/s also whether the rebound is within 1"
            " %, for the worst of eight phases of the first contact within a step.",
            stability_map.draw, section="limits",
        ),
    ),
    tables=(
        Table(
            "How long: which step to use", "Numbers of this run; impacts at 1 m/s on 5 MPa.",
            stability_map.advice, section="advice",
        ),
        Table(
            "Error of the impacts",
            "Largest error of the rebound over eight phases, at the step nearest to that share of the"
            " Rayleigh time T_R.",
            stability_map.impact_errors, section="limits",
        ),
        Table(
            "Largest steps", "Largest stable step tried / Rayleigh time T_R; impacts at 1 m/s.",
            stability_map.table, section="limits",
        ),
    ),
    features=("normal hertz", "normal hooke", "damping", "tangential history", "integrator path", "mixed",
              "float32"),
    order=80,
)  # fmt: skip
