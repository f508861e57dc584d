"""Scene files -> cases: `gpudem compare my_scene.toml`."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from pathlib import Path

from comparisons.harness.case import Case, Figure, Results, Table, Variant
from comparisons.scene_case import analysis, checks, figures, headline
from comparisons.scene_case import plan as plans
from comparisons.scene_case.plan import Plan
from gpudem.scene import Scene

#: Endings of scene files.
ENDINGS = (".toml", ".json")


def is_scene(argument: str) -> bool:
    """Whether an argument of `compare` is a scene and not the name of a case."""
    return argument.endswith(ENDINGS) or Path(argument).is_file()


def split(arguments: Sequence[str]) -> tuple[list[str], tuple[str, ...]]:
    """(scene files, names of cases) among the arguments of `compare`."""
    scenes = [name for name in arguments if is_scene(name)]
    return scenes, tuple(name for name in arguments if name not in scenes)


def from_files(
    paths: Sequence[str], taken: Sequence[str], *, seeds: int = 5, work_precision: bool = False,
    precision: str | None = None,
) -> list[Case]:  # fmt: skip
    """One case for each file; a name that is taken gets a number. Raises SceneError."""
    names, made = set(taken), []
    for path in paths:
        scene = Scene.from_file(path)
        name = next(
            n
            for k in range(len(names) + 1)
            for n in [f"{scene.name}_{k + 1}" if k else scene.name]
            if n not in names
        )
        names.add(name)
        made.append(
            of_scene(scene, name, path, seeds=seeds, work_precision=work_precision, precision=precision)
        )
    return made


def of_scene(
    scene: Scene, name: str, source: str, *, seeds: int = 5, work_precision: bool = False,
    precision: str | None = None,
) -> Case:  # fmt: skip
    """A case that asks of a scene what can be asked of it."""
    plan = plans.make(scene, seeds, work_precision, precision)

    def bound(function):
        return functools.partial(function, plan=plan)

    return Case(
        name=name,
        title=scene.title or name.replace("_", " "),
        purpose=(
            "A scene of the user through every code that can state it. While rounding is small, the codes"
            " must agree particle by particle: how far they may differ is measured with runs of gpudem whose"
            " starts are perturbed by rounding. After that, distributions are compared over seeds, or over"
            " starts perturbed by 1e-9 diameters where the scene has no random part. In any case each code"
            f" must conserve what the scene conserves. Compared in {plan.scene.solver.precision}."
        ),
        source=source,
        variants=lambda tier: plans.first_variants(plan),
        checks=(checks.between(plan), checks.each(plan), *checks.own(plan)),
        figures=_figures(plan, bound),
        tables=_tables(plan, bound),
        features=_features(plan.scene),
        follow_up=lambda results: follow_up(results, plan),
        headline=lambda results, found: headline.sentence(plan, results, found),
    )


def _features(scene: Scene) -> tuple[str, ...]:
    """What the scene has, for the table of what is covered."""
    found = [name.replace("_", " ") for name, present in scene.needs if present]
    return (f"normal {scene.contact.normal}", *found)


def follow_up(results: Results, plan: Plan) -> list[Variant]:
    """Runs that the first ones call for: seeds, a denser trace where codes separate, steps and precisions."""
    if headline.incomplete(results):
        return []
    limits, made = analysis.envelope(results, plan), []
    pairs = headline.pairs_of(results)
    if pairs and limits.horizon <= limits.time[-1]:
        made += plans.seed_variants(plan)
    where = [analysis.agreement(results, plan, *pair).parting for pair in pairs]
    times = [found.time for found in where if found is not None]
    if times and plan.stride > 1:
        made.append(plans.dense_variant(plan, max(times)))
    if plan.work_precision:
        made += plans.rung_variants(plan, analysis.resolved(results, plan))
    return made


def _figures(plan: Plan, bound) -> tuple[Figure, ...]:
    found = [
        Figure(
            "Difference of the codes in time",
            "Largest difference of positions over all particles. Below the dashed line rounding explains it,"
            " as perturbed starts of gpudem have shown; from the horizon on, single runs cannot be compared.",
            bound(figures.difference),
        ),
        Figure("Histories", "Each code; over seeds mean and range.", bound(figures.histories), needs=()),
        Figure(
            "Profiles",
            "At the end of the runs; over seeds mean and range.",
            bound(figures.profiles),
            needs=(),
        ),
    ]
    if plan.work_precision:
        found.append(
            Figure(
                "Error against run time",
                f"Each code against its own run at {plans.LADDER[-1]:g} of the step, one core each, while"
                f" half the step changes positions by less than {analysis.RESOLVED:g} diameters.",
                bound(figures.work_precision),
            )
        )
    return tuple(found)


def _tables(plan: Plan, bound) -> tuple[Table, ...]:
    found = [
        Table(
            "Comparison particle by particle", "What was chosen and what was found.", bound(figures.summary)
        ),
        Table(
            "Conservation and sanity",
            "Energy is kinetic, potential and elastic energy of overlaps, less the work of walls"
            " and groups that move;"
            " friction and damping take from it.",
            bound(figures.sanity), needs=(),
        ),
        Table(
            "Distributions",
            "Over seeds; p corrected for all metrics by permutation of the largest difference.",
            bound(figures.distributions), needs=(),
        ),
    ]  # fmt: skip
    if plan.work_precision:
        found.append(
            Table(
                "Steps and precisions", "Error against each code's smallest step.", bound(figures.work_table)
            )
        )
    return tuple(found)
