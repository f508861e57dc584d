"""The largest stable step of contacts at rest, columns, a settled bed and impacts, found by sweep."""

from __future__ import annotations

import math

from comparisons.cases.limits import stability, stability_map
from comparisons.cases.limits.stability import UNSTABLE
from comparisons.harness.case import Case, Check, Figure, Measured, Results, Table

CODES = ("gpudem", "liggghts")
HALF, PATH, MIXED, SINGLE, THEIRS = stability_map.WHO
#: Steps so near the closed form's limit grow too slowly to be judged [share].
MARGIN = 0.02


def against_limit(results: Results, who: str, kind: str) -> Measured:
    """Points on the wrong side of the closed form's limit, of those farther from it than MARGIN."""
    mine = [p for p in stability_map.points(results) if p.who == who and p.spot.kind == kind]
    wrong, sides = [], set()
    for p in mine:
        ratio = p.share / stability.limit(p.spot, p.normal)
        if abs(math.log(ratio)) > MARGIN:
            sides.add(ratio > 1)
            if (ratio > 1) != (p.found == UNSTABLE):
                wrong.append(f"{p.row} at {ratio:.3f} of the limit")
    note = f"{len(mine)} points; " + ("; ".join(wrong[:3]) or "all on the right side")
    return Measured(float(len(wrong)) if sides == {True, False} else math.nan, note=note)


def same_map(results: Results, who: str) -> Measured:
    """Points that gpudem half_step and another judge differently, of those both ran."""
    found = {(p.row, p.share): p.found for p in stability_map.points(results) if p.who == HALF}
    theirs = [p for p in stability_map.points(results) if p.who == who]
    apart = [p for p in theirs if found[p.row, p.share] != p.found]
    return Measured(float(len(apart)), note=f"{len(theirs)} points; " + "; ".join(p.row for p in apart[:3]))


def told(results: Results) -> Measured:
    """Unstable points of gpudem of which the user hears neither before the run nor during it.

    Before: the checks of the scene, without the waiver; during: a guard or a warning.
    """
    mine = [p for p in stability_map.points(results) if p.who != THEIRS and p.found == UNSTABLE]
    before = [p for p in mine if stability_map.warned(p)]
    silent = [p for p in mine if not p.said and p not in before]
    note = f"{len(mine)} points, {len(before)} told before the run"
    return Measured(
        float(len(silent)), note="; ".join([note, *(f"{p.row} at {p.share:.2f}" for p in silent[:4])])
    )


def safe(results: Results) -> Measured:
    """Least step / Rayleigh time at which anything is unstable, of all rows and codes."""
    worst = min((p for p in stability_map.points(results) if p.found == UNSTABLE), key=lambda p: p.share)
    return Measured(worst.share, measured=worst.share, note=f"{worst.who}, {worst.row}")


CASE = Case(
    name="stable_step",
    title="The largest stable step",
    purpose=(
        "How long may a step be? The usual answer is a share of the Rayleigh time, as if a wave through a"
        " grain set it. It is the contact that does: its stiffness under load, the damping (the dashpot sees"
        " velocities half a step old and makes the limit shorter), and friction, whose spring is stretched by"
        " slip and spin at once and oscillates 1.67 times faster than the normal one. For contacts at rest"
        " there is a closed form, (2/w)(sqrt(1 + b^2) - b), and both codes break where it says. Impacts have"
        " no limit of that kind: they lose accuracy first, then come out with more energy than they had."
        " A ball under its own weight is far softer than one in a bed, and the Rayleigh time knows nothing of"
        " the load: the same share of it is safe for one and not for the other. The scenes waive the checks"
        " that keep such steps from being run."
    ),
    source="Eigenvalues of LIGGGHTS' scheme on the linearised contact; Rayleigh time: LIGGGHTS manual.",
    variants=stability_map.variants,
    checks=(
        *(
            Check(
                name=f"{text} on the wrong side of the closed form's limit ({who})",
                measure=lambda results, who=who, kind=kind: against_limit(results, who, kind),
                tolerance=0.0, unit="points", against="closed form", mark="A",
                needs=(stability_map.WHO[who][1],),
                reason=f"both sides are there; within {MARGIN:.0%} of the limit growth is too slow to judge",
                catches="a dashpot that lags by another half step, a friction spring without the spin, a"
                " stiffness at rest that is not the law's derivative",
            )
            for who in (HALF, THEIRS)
            for kind, text in (("rest", "balls at rest"), ("column", "columns"))
        ),
        Check(
            name="points of the map that gpudem half_step and LIGGGHTS judge differently",
            measure=lambda results: same_map(results, THEIRS), tolerance=0.0, unit="points",
            against="LIGGGHTS", mark="X", needs=CODES,
            reason="same law, same scheme: they agree to rounding before anything grows",
            catches="another stability limit than LIGGGHTS' in any law, damping or friction",
        ),
        Check(
            name="points of the map that float64 and mixed judge differently",
            measure=lambda results: same_map(results, MIXED), tolerance=0.0, unit="points",
            against="gpudem float64", mark="R",
            reason="a limit is a matter of stiffness and mass: rounding a force by 6e-8 does not move it",
            catches="positions or velocities that mixed rounds: noise that grows where nothing should",
        ),
        Check(
            name="unstable points of which gpudem says nothing, before or during the run",
            measure=told, tolerance=0.0, unit="points", against="nobody", mark="R",
            reason="a step above the usual limits is warned of before the run; guards: speed, overlap, a"
            " particle that leaves, energy",
            catches="a limit of the step set above what is stable; a run that blows up without a word",
        ),
        Check(
            name="least step / Rayleigh time at which any contact of the map is unstable",
            measure=safe, tolerance=10.0, lo=0.1, unit="1", against="the usual 10 % of the Rayleigh time",
            mark="R", needs=CODES, reason="what is usual must lie below all that was found to break",
            catches="a rule of thumb that is not safe on these scenes",
        ),
    ),
    figures=(
        Figure(
            "Stable, inaccurate, unstable: the step against the contact",
            "Steps as shares of the Rayleigh time of the ball; grey: the usual 10 to 20 %. Balls at rest,"
            " columns, beds: stable or not; impacts at 1 m/s: also whether the rebound is within 1 %, the"
            " worst of eight moments of touch. half_step and LIGGGHTS are the same map.",
            stability_map.draw, needs=CODES, section="limits",
        ),
    ),
    tables=(
        Table(
            "How long: which step to use", "Numbers of this run; impacts at 1 m/s on 5 MPa.",
            stability_map.advice, needs=CODES, section="advice",
        ),
        Table(
            "Error and run time of the impacts",
            "Largest error of the rebound over eight moments of touch, at the step nearest to that share of"
            " the Rayleigh time; stepping alone, a scene of some hundred balls.",
            stability_map.costs, needs=CODES, section="limits",
        ),
        Table(
            "Largest steps",
            "Largest step tried below the first that broke, by the Rayleigh time T_R; impacts at 1 m/s.",
            stability_map.table, needs=CODES, section="limits",
        ),
    ),
    features=(
        "normal hertz", "normal hooke", "damping", "tangential history", "integrator path", "mixed",
        "float32",
    ),
    order=80,
)  # fmt: skip
