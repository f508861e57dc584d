"""Scenes at the ends of what can be stated: the result, its error, and the message that the user gets."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

from comparisons.cases.limits import extreme_scenes
from comparisons.cases.limits.extreme_scenes import Extreme
from comparisons.harness import codes
from comparisons.harness.case import (
    Case,
    Check,
    Finding,
    Measured,
    PerPair,
    Results,
    Table,
    Tier,
    Variant,
    largest,
)
from comparisons.harness.configurations import Configuration, Configurations, precisions
from comparisons.harness.numbers import number
from comparisons.metrics.trace import largest_difference
from gpudem.scene import checks as scene_checks

if TYPE_CHECKING:
    import pandas

CONFIGURATIONS = Configurations(*precisions())
DOUBLE, MIXED, SINGLE = CONFIGURATIONS.own
#: LIGGGHTS without the guards of our decks and of our runner, as a user starts it.
UNGUARDED = Configuration("LIGGGHTS unguarded", "liggghts", {"deviation": "unguarded"}, label="unguarded")
#: In the quick tier only scenes in which codes and precisions may differ; tests/comparisons/test_extremes.py
#: runs all through gpudem.
QUICK = ("fast_30", "concentric", "leaves", "dead", "far", "edge")


@functools.cache
def scenes() -> tuple[Extreme, ...]:
    """All extremes, made once."""
    return tuple(extreme_scenes.extremes())


def chosen(tier: Tier) -> list[Extreme]:
    """The extremes of a tier."""
    return [x for x in scenes() if tier != "quick" or x.name in QUICK]


def variants(tier: Tier) -> list[Variant]:
    made = []
    for x in chosen(tier):
        made += CONFIGURATIONS.variants(x.name, x.scene, may_end=True)
        if x.unguarded:
            label, code = UNGUARDED.key(x.name)
            made.append(Variant(label, x.scene, (code,), {code: UNGUARDED.options}, may_end=True))
    return made


def found(results: Results, x: Extreme, one: Configuration) -> tuple[float | None, str]:
    """(error, "") of a run that came to its end; (None, its message) of one that did not; (None, "") of one
    that is not there.
    """
    key = one.key(x.name)
    if key in results.ended:
        text = results.ended[key]
        return None, text.splitlines()[0] if "cannot state" not in text else " ".join(text.split())
    if key not in results.runs:
        return None, ""
    run = results[key]
    if one is UNGUARDED:
        n = run.notes
        what = [f"{n['lost']} of {run.timing.particles} lost"] * (n["lost"] != 0) + ["NaN"] * n["nan"]
        return None, f"exit status {n['exit_status']}, {', '.join(what) or 'no sign'}, no message"
    return results.once(("error", key), lambda: x.error(run)), ""


def silent_errors(results: Results, one: Configuration) -> Measured:
    """Runs of gpudem that came to their end with a wrong number and without a message."""
    wrong, tier = [], chosen(results.tier)
    for x in tier:
        error, message = found(results, x, one)
        run = results.runs.get(one.key(x.name))
        # a warning about the scene alone says nothing about the result
        warned = run is not None and bool(set(run.warnings) - set(scene_checks.scene_warnings(run.scene)))
        if error is None and not message:
            wrong.append(f"{x.name}: not run")
        elif error is not None and not error <= x.tolerance and not warned:
            wrong.append(f"{x.name}: {error:.2g}")
    return Measured(float(len(wrong)), note=f"{len(tier)} scenes; " + "; ".join(wrong))


def mixed(results: Results) -> Measured:
    """Largest difference of the error in mixed and in float64."""
    apart = {}
    for x in chosen(results.tier):
        double, single = (found(results, x, one)[0] for one in (DOUBLE, MIXED))
        if double is not None and single is not None:
            apart[x.name] = abs(double - single)
    return largest(apart, f"{len(apart)} scenes")


def same(results: Results, code: str, other: str) -> Measured:
    """Largest difference of the last velocities of two codes [m/s]."""
    apart = {}
    for x in chosen(results.tier):
        runs = [results.runs.get((x.name, c)) for c in (code, other)]
        if all(runs):
            first, second = (run.trace["velocity"][-1:] for run in runs if run)
            apart[x.name] = largest_difference(first, second, 1.0)
    return largest(apart, f"{len(apart)} scenes")


def unguarded_errors(results: Results) -> Measured:
    """Runs of LIGGGHTS, unguarded, that went wrong with exit status 0 and no message: particles lost, NaN, or
    (read from the guarded run) a wrong number.
    """
    names = []
    for x in chosen(results.tier):
        run = results.runs.get(UNGUARDED.key(x.name))
        error, _ = found(results, x, CONFIGURATIONS.of(UNGUARDED.code)[0])
        wrong = error is not None and not error <= x.tolerance
        if run and run.notes["exit_status"] == 0 and not run.notes["errors"]:
            what = ["lost"] * bool(run.notes["lost"]) + ["NaN"] * run.notes["nan"] + ["wrong"] * wrong
            names += [f"{x.name}: {', '.join(what)}"] * bool(what)
    return Measured(float(len(names)), note="; ".join(names))


def table(results: Results) -> pandas.DataFrame:
    """One row a scene: error by configuration, or the message."""
    import pandas

    rows = []
    columns = CONFIGURATIONS.among(results.codes())
    columns += [UNGUARDED] * (UNGUARDED.code in results.codes())
    for x in chosen(results.tier):
        row: dict[str, object] = {"extreme": x.title}
        for one in columns:
            error, message = found(results, x, one)
            row[one.title] = message if error is None else number(error, 2)
            if error is not None and not error <= x.tolerance:
                row[one.title] = f"{number(error, 2)}: wrong, no message"
        rows.append(row)
    return pandas.DataFrame(rows)


def advice(results: Results) -> pandas.DataFrame:
    """How far from the origin and how fast, in a sentence with the numbers of this run."""
    import pandas

    def outcome(name: str, one: Configuration) -> str:
        x = next(x for x in scenes() if x.name == name)
        error, message = found(results, x, one)
        return f"is off by {number(error, 1)}" if error is not None else f"ends: {message}"

    text = (
        f"1 km from the origin the rebound of a 3 mm ball {outcome('far', DOUBLE)} in float64, as near it,"
        f" and {outcome('far', MIXED)} in mixed; float32 {outcome('far', SINGLE)}. An impact so fast that the"
        f" overlap exceeds the radius (30 m/s on 5 MPa) {outcome('fast_30', DOUBLE)}."
    )
    return pandas.DataFrame([("distance, speed", text)], columns=["choose", "by"])


def _silent(one: Configuration) -> Check:
    return Check(
        name=f"wrong numbers without a message ({one.options['precision']})",
        measure=lambda results: silent_errors(results, one), tolerance=0.0, unit="scenes",
        against="closed form", mark="A",
        reason="each scene ends within its tolerance (the order of the scheme) or with a message",
        catches="a ball that passes through a wall, NaN that is written on, a lost particle, a normal of two"
        " concentric balls, an edge or corner counted once",
    )  # fmt: skip


def _same(code: str, other: str) -> Check:
    return Check(
        name="last velocities, largest difference [m/s]",
        measure=lambda results: same(results, code, other), tolerance=1e-9, unit="m/s",
        against=codes.title(other), mark="X", needs=(code, other),
        reason="same law and scheme: rounding, at speeds of about 1 m/s",
        catches="another treatment of a large friction, a small restitution or unequal balls",
    )  # fmt: skip


CASE = Case(
    name="extremes",
    title="Extremes and traps",
    purpose=(
        "Speeds, sizes, densities, restitution and friction at the ends of what may be stated, powder and"
        " boulders, a scene far from the origin, and the traps of flat geometry. The result of each is known"
        " in closed form. A code may compute it or refuse; it must not continue without a message. LIGGGHTS"
        " is shown twice: with the guards of our decks and runner, and unguarded, as a user starts it."
    ),
    source="Restitution of the law, statics, and the contact ODE (DOP853, rtol 1e-13) from primary inputs.",
    variants=variants,
    checks=(
        _silent(DOUBLE),
        _silent(MIXED),
        Check(
            name="error in mixed less error in float64, largest",
            measure=mixed, tolerance=1e-5, unit="1", against="float64", mark="R",
            reason="forces carry 6e-8, a contact adds up some hundred of them",
            catches="a position, a velocity or an overlap rounded to float32",
        ),
        PerPair(_same),
    ),
    findings=(
        Finding(
            "scenes that come out wrong in float32 at the end of a run",
            lambda results: silent_errors(results, SINGLE), "scenes",
            "float32 is for soft contacts near the origin only.",
        ),
        Finding(
            "LIGGGHTS as it is: runs gone wrong with exit status 0 and no message", unguarded_errors, "runs",
            "Concentric balls, a ball that leaves the domain, one that falls through a floor.",
            needs=(UNGUARDED.code,),
        ),
    ),
    tables=(
        Table("How far, how fast", "Numbers of this run.", advice, section="advice"),
        Table(
            "Extremes: error, or the message",
            "Largest error against the closed form (relative to impact speed, restitution or overlap).",
            table, section="limits",
        ),
    ),
    features=(
        "normal hertz", "damping", "tangential history", "several radii", "several materials", "wall plane",
        "mixed", "float32", "lost particles and NaN",
    ),
    order=82,
)  # fmt: skip
