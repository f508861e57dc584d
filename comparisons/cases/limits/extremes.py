"""The ends of what a DEM user may state: what comes out, how far off, and what the user is told."""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING

from comparisons.cases.limits import extreme_scenes as extremes
from comparisons.cases.limits.extreme_scenes import Extreme
from comparisons.harness.case import Case, Check, Measured, Results, Table, Tier, Variant
from comparisons.harness.numbers import number
from comparisons.metrics.trace import largest_difference
from gpudem.scene import checks as scene_checks

if TYPE_CHECKING:
    import pandas

CODES = ("gpudem", "liggghts")
PRECISIONS = ("float64", "mixed", "float32")
#: Who ran a scene -> (label suffix, code, arguments of its run function).
WHO = {p: (p, "gpudem", {"precision": p}) for p in PRECISIONS} | {
    "LIGGGHTS": ("liggghts", "liggghts", {"use_recorded": False}),
    "LIGGGHTS alone": ("alone", "liggghts", {"deviation": "unguarded"}),
}
#: In the quick tier only scenes in which codes and precisions may part; tests/comparisons/test_extremes.py
#: runs all through gpudem.
QUICK = ("fast_30", "concentric", "leaves", "dead", "far", "edge")


@functools.cache
def scenes() -> tuple[Extreme, ...]:
    """All extremes, made once."""
    return tuple(extremes.extremes())


def chosen(tier: Tier) -> list[Extreme]:
    """The extremes of a tier."""
    return [x for x in scenes() if tier != "quick" or x.name in QUICK]


def variants(tier: Tier) -> list[Variant]:
    made = []
    for x in chosen(tier):
        for who, (suffix, code, arguments) in WHO.items():
            if who == "LIGGGHTS alone" and not x.alone:
                continue
            label = f"{x.name}-{suffix}"
            made.append(Variant(label, x.scene, (code,), {code: arguments}, may_end=True))
    return made


def found(results: Results, x: Extreme, who: str) -> tuple[float | None, str]:
    """(error, "") of a run that came to its end; (None, what was said) of one that did not; (None, "") of
    one that is not there.
    """
    suffix, code, _ = WHO[who]
    key = (f"{x.name}-{suffix}", code)
    if key in results.ended:
        return None, _first(results.ended[key])
    if key not in results.runs:
        return None, ""
    run = results[key]
    if who == "LIGGGHTS alone":
        n = run.notes
        what = [f"{n['lost']} of {run.timing.particles} lost"] * (n["lost"] != 0) + ["NaN"] * n["nan"]
        return None, f"exit status {n['exit_status']}, {', '.join(what) or 'no sign'}, no message"
    return results.once(("error", key), lambda: x.error(run)), ""


def _first(text: str) -> str:
    return text.splitlines()[0] if "cannot state" not in text else " ".join(text.split())


def unsaid(results: Results, precision: str) -> Measured:
    """Runs that came to their end with a wrong number and without a word."""
    wrong = []
    for x in chosen(results.tier):
        error, said = found(results, x, precision)
        run = results.runs.get((f"{x.name}-{precision}", "gpudem"))
        # what the scene alone is warned of says nothing of the result
        warned = run is not None and bool(set(run.warnings) - set(scene_checks.scene_warnings(run.scene)))
        if error is None and not said:
            wrong.append(f"{x.name}: not run")
        elif error is not None and not error <= x.tolerance and not warned:
            wrong.append(f"{x.name}: {error:.2g}")
    return Measured(float(len(wrong)), note=f"{len(chosen(results.tier))} scenes; " + "; ".join(wrong))


def mixed(results: Results) -> Measured:
    """Largest difference of the error in mixed and in float64."""
    apart = {}
    for x in chosen(results.tier):
        errors = [found(results, x, p)[0] for p in ("float64", "mixed")]
        if None not in errors:
            apart[x.name] = abs(errors[0] - errors[1])  # type: ignore[operator]
    name = max(apart, key=lambda n: apart[n])
    return Measured(apart[name], note=f"{len(apart)} scenes; largest in {name}")


def same(results: Results) -> Measured:
    """Largest difference of the last velocities of gpudem float64 and LIGGGHTS / the largest at the start."""
    apart = {}
    for x in chosen(results.tier):
        runs = [
            results.runs.get((f"{x.name}-{s}", c)) for s, c in (("float64", "gpudem"), WHO["LIGGGHTS"][:2])
        ]
        if all(runs):
            first, second = (run.trace["velocity"] for run in runs if run and run.trace)
            apart[x.name] = largest_difference(first[-1:], second[-1:], 1.0)
    name = max(apart, key=lambda n: math.inf if math.isnan(apart[n]) else apart[n])
    return Measured(apart[name], note=f"{len(apart)} scenes; largest in {name}")


def float32_fails(results: Results) -> Measured:
    """Scenes that come out wrong in float32 without a word: what the mode is not for."""
    return unsaid(results, "float32")


def silent(results: Results) -> Measured:
    """Runs of LIGGGHTS as it is that went wrong at exit status 0 without a message: particles lost, NaN, or
    (read from the same run behind our runner) a wrong number.
    """
    names = []
    for x in chosen(results.tier):
        run = results.runs.get((f"{x.name}-alone", "liggghts"))
        error, _ = found(results, x, "LIGGGHTS")
        wrong = error is not None and not error <= x.tolerance
        if run and run.notes["exit_status"] == 0 and not run.notes["errors"]:
            what = ["lost"] * bool(run.notes["lost"]) + ["NaN"] * run.notes["nan"] + ["wrong"] * wrong
            names += [f"{x.name}: {', '.join(what)}"] * bool(what)
    return Measured(float(len(names)), note="; ".join(names))


def table(results: Results) -> pandas.DataFrame:
    """One row a scene: error by precision and code, or what was said."""
    import pandas

    rows = []
    for x in chosen(results.tier):
        row: dict[str, object] = {"extreme": x.title}
        for who in WHO:
            error, said = found(results, x, who)
            text = said if error is None else number(error, 2)
            if error is not None and not error <= x.tolerance:
                text += ": wrong, no message"
            row[who if who.startswith("LIGGGHTS") else f"gpudem {who}"] = text
        rows.append(row)
    return pandas.DataFrame(rows)


def advice(results: Results) -> pandas.DataFrame:
    """How far from the origin, how fast, how unequal, in a sentence with the numbers of this run."""
    import pandas

    def said(name: str, who: str) -> str:
        x = next(x for x in scenes() if x.name == name)
        error, words = found(results, x, who)
        return f"is off by {number(error, 1)}" if error is not None else f"ends: {words}"

    text = (
        f"1 km from the origin the rebound of a 3 mm ball {said('far', 'float64')} in float64, as near it,"
        f" and {said('far', 'mixed')} in mixed; float32 {said('far', 'float32')}. An impact so fast that the"
        f" overlap passes the radius (30 m/s on 5 MPa) {said('fast_30', 'float64')}."
    )
    return pandas.DataFrame([("distance, speed", text)], columns=["choose", "by"])


CASE = Case(
    name="extremes",
    title="Extremes and traps",
    purpose=(
        "Speeds, sizes, densities, restitution and friction at the ends of what may be stated, powder and"
        " boulders, a scene far from the origin, and the traps of flat geometry. Of each it is known by"
        " closed form what must come out. A code may do it, or refuse; what it may not do is go on without a"
        " word. LIGGGHTS is shown twice: behind our runner, which reads what it prints, and alone, as a user"
        " starts it."
    ),
    source="Restitution of the law, statics, and the contact ODE (DOP853, rtol 1e-13) from primary inputs.",
    variants=variants,
    checks=(
        *(
            Check(
                name=f"wrong numbers without a message ({p})",
                measure=lambda results, p=p: unsaid(results, p), tolerance=0.0, unit="scenes",
                against="closed form", mark="A",
                reason="each scene comes out within its tolerance (the order of the scheme) or ends with a"
                " message",
                catches="a ball that goes through a wall, NaN that is written on, a lost particle, a normal"
                " of two concentric balls, an edge or corner counted once",
            )
            for p in ("float64", "mixed")
        ),
        Check(
            name="error in mixed less error in float64, largest",
            measure=mixed, tolerance=1e-5, unit="1", against="float64", mark="R",
            reason="forces carry 6e-8, a contact adds up some hundred of them",
            catches="a position, a velocity or an overlap rounded to float32",
        ),
        Check(
            name="scenes that come out wrong in float32 at the end of a run",
            measure=float32_fails, tolerance=math.inf, lo=1.0, unit="scenes", against="closed form", mark="A",
            reason="float32 is for soft contacts near the origin alone: shown failing where it fails",
            catches="a float32 mode that is not float32",
        ),
        Check(
            name="last velocities, largest difference [m/s]",
            measure=same, tolerance=1e-9, unit="m/s", against="LIGGGHTS", mark="X", needs=CODES,
            reason="same law, same scheme: rounding, at speeds of about 1 m/s",
            catches="another treatment of a large friction, a small restitution or unequal balls",
        ),
        Check(
            name="LIGGGHTS as it is: runs gone wrong with exit status 0 and no message",
            measure=silent, tolerance=math.inf, lo=3.0, unit="runs", against="nobody", mark="X",
            needs=("liggghts",),
            reason="NaN of concentric balls, a ball that leaves the domain, one that falls through a floor",
            catches="a report that promises silent failures where there are none",
        ),
    ),
    tables=(
        Table("How far, how fast", "Numbers of this run.", advice, section="advice"),
        Table(
            "Extremes: error, or what the user is told",
            "Largest error against the closed form (relative to impact speed, restitution or overlap).",
            table, needs=CODES, section="limits",
        ),
    ),
    features=(
        "normal hertz", "damping", "tangential history", "several radii", "several materials", "wall plane",
        "mixed", "float32", "lost particles and NaN",
    ),
    order=82,
)  # fmt: skip
