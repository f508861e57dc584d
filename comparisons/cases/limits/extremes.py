"""Scenes at the ends of what can be stated: the result, its error, and the message that the user gets."""

from __future__ import annotations

from comparisons import kit
from comparisons.cases.limits.extreme_scenes import Extreme, scenes
from comparisons.kit import number
from comparisons.metrics.trace import largest_difference
from gpudem.scene import checks as scene_checks
from reference.liggghts.code import CODE as LIGGGHTS

CONFIGURATIONS = kit.Configurations(*kit.precisions())
DOUBLE, MIXED, SINGLE = CONFIGURATIONS.own
#: LIGGGHTS without the guards of our decks and of our runner, as a user starts it.
UNGUARDED = kit.Configuration(
    "LIGGGHTS unguarded", LIGGGHTS.name, {"deviation": "unguarded"}, label="unguarded"
)
#: In the quick tier only scenes in which codes and precisions may differ; tests/comparisons/test_extremes.py
#: runs all through gpudem.
QUICK = ("fast_30", "concentric", "leaves", "dead", "far", "edge")


def chosen(tier: kit.Tier) -> list[Extreme]:
    """The extremes of a tier."""
    return [x for x in scenes() if tier != "quick" or x.name in QUICK]


def variants(tier: kit.Tier) -> list[kit.Variant]:
    made = []
    for x in chosen(tier):
        made += CONFIGURATIONS.variants(x.name, x.scene, may_end=True)
        if x.unguarded:
            label, code = UNGUARDED.key(x.name)
            made.append(kit.Variant(label, x.scene, (code,), {code: UNGUARDED.options}, may_end=True))
    return made


def found(results: kit.Results, x: Extreme, one: kit.Configuration) -> tuple[float | None, str]:
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


def wrong(x: Extreme, error: float | None) -> bool:
    """Whether a run came to its end with an error above the tolerance, or one that is not a number."""
    return error is not None and not error <= x.tolerance


def warned(results: kit.Results, x: Extreme, one: kit.Configuration) -> bool:
    """Whether a run has a warning about its result; one about the scene alone says nothing about it."""
    run = results.runs.get(one.key(x.name))
    return run is not None and bool(set(run.warnings) - set(scene_checks.scene_warnings(run.scene)))


def silent_errors(results: kit.Results, one: kit.Configuration) -> kit.Measured:
    """Runs of gpudem that came to their end with a wrong number and without a message."""
    silent, tier = [], chosen(results.tier)
    for x in tier:
        error, message = found(results, x, one)
        if error is None and not message:
            silent.append(f"{x.name}: not run")
        elif wrong(x, error) and not warned(results, x, one):
            silent.append(f"{x.name}: {error:.2g}")
    return kit.Measured(float(len(silent)), note=f"{len(tier)} scenes; " + "; ".join(silent))


def mixed(results: kit.Results) -> dict[str, float]:
    """Difference of the error in mixed and in float64, of the scenes that both come through."""
    errors = {x.name: [found(results, x, one)[0] for one in (DOUBLE, MIXED)] for x in chosen(results.tier)}
    return {name: abs(a - b) for name, (a, b) in errors.items() if a is not None and b is not None}


def same(results: kit.Results, code: str, other: str) -> dict[str, float]:
    """Largest difference of the last velocities of two codes [m/s], of the scenes that both come through."""
    ends = {
        label: [results[label, c].trace["velocity"][-1:] for c in (code, other)]
        for label in results.labels(code, other)
    }
    return {name: largest_difference(a, b, 1.0) for name, (a, b) in ends.items()}


def unguarded_errors(results: kit.Results) -> kit.Measured:
    """Runs of LIGGGHTS, unguarded, that went wrong with exit status 0 and no message: particles lost, NaN, or
    (read from the guarded run) a wrong number.
    """
    names = []
    for x in chosen(results.tier):
        run = results.runs.get(UNGUARDED.key(x.name))
        if run and run.notes["exit_status"] == 0 and not run.notes["errors"]:
            error, _ = found(results, x, CONFIGURATIONS.of(UNGUARDED.code)[0])
            signs = {"lost": run.notes["lost"], "NaN": run.notes["nan"], "wrong": wrong(x, error)}
            what = [sign for sign, there in signs.items() if there]
            names += [f"{x.name}: {', '.join(what)}"] * bool(what)
    return kit.Measured(float(len(names)), note="; ".join(names))


def table(results: kit.Results) -> kit.Rows:
    """One row a scene: error by configuration, or the message."""
    columns = CONFIGURATIONS.among(results.codes()) + [UNGUARDED] * (UNGUARDED.code in results.codes())

    def cell(x: Extreme, one: kit.Configuration) -> str:
        error, message = found(results, x, one)
        if error is None:
            return message
        said = "with a warning" if warned(results, x, one) else "no message"
        return number(error, 2) + f": wrong, {said}" * wrong(x, error)

    return [{"extreme": x.title} | {one.title: cell(x, one) for one in columns} for x in chosen(results.tier)]


def advice(results: kit.Results) -> kit.Rows:
    """How far from the origin and how fast, in a sentence with the numbers of this run."""

    def outcome(name: str, one: kit.Configuration) -> str:
        error, message = found(results, next(x for x in scenes() if x.name == name), one)
        return f"is off by {number(error, 1)}" if error is not None else f"ends: {message}"

    text = (
        f"1 km from the origin the rebound of a 3 mm ball {outcome('far', DOUBLE)} in float64, as it is near"
        f" the origin, and {outcome('far', MIXED)} in mixed; float32 {outcome('far', SINGLE)}. An impact so"
        f" fast that the overlap exceeds the radius (30 m/s on 5 MPa) {outcome('fast_30', DOUBLE)}."
    )
    return [{"choose": "distance, speed", "by": text}]


CASE = kit.Case(
    name="extremes",
    title="Extremes and traps",
    purpose=(
        "Speeds, sizes, densities, restitution and friction at the ends of what may be stated, powder and"
        " boulders, a scene far from the origin, and the traps of flat geometry. The result of each is known"
        " in closed form. A code may compute it or refuse; it must not continue without a message. LIGGGHTS"
        " is shown twice: with the guards of our decks and runner, and without them, as a user starts it."
    ),
    source="Restitution of the law, statics, and the contact ODE (DOP853, rtol 1e-13) from primary inputs.",
    variants=variants,
    checks=(
        *(
            kit.Check(
                name=f"wrong numbers without a message ({one.options['precision']})",
                measure=lambda results, one=one: silent_errors(results, one), tolerance=0.0, unit="scenes",
                against="closed form", mark="A",
                reason="each scene ends within its tolerance (the order of the scheme) or with a message",
                catches="a ball that passes through a wall, NaN that is written on, a lost particle, a normal"
                " of two concentric balls, an edge or corner counted once",
            )
            for one in (DOUBLE, MIXED)
        ),
        *kit.checks(
            "error in mixed less error in float64, largest", mixed, 1e-5, against="float64", mark="R",
            reason="forces are rounded to 6e-8, a contact adds up about a hundred of them",
            catches="a position, a velocity or an overlap rounded to float32",
        ),
        kit.per_pair(
            "last velocities, largest difference [m/s]", same, tolerance=1e-9, unit="m/s",
            reason="same law and scheme: rounding, at speeds of about 1 m/s",
            catches="another treatment of a large friction, a small restitution or unequal balls",
        ),
    ),
    findings=(
        kit.Finding(
            "scenes that come out wrong in float32 at the end of a run",
            lambda results: silent_errors(results, SINGLE), "scenes",
            "float32 is for soft contacts near the origin only.",
        ),
        kit.Finding(
            "LIGGGHTS as it is: runs gone wrong with exit status 0 and no message", unguarded_errors, "runs",
            "Concentric balls, a ball that leaves the domain, one that falls through a floor.",
            needs=(UNGUARDED.code,),
        ),
    ),
    tables=(
        kit.Table("How far, how fast", "Numbers of this run.", advice, section="advice"),
        kit.Table(
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
