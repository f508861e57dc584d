"""Two balls of two materials with friction: unequal moduli, Poisson ratios, densities and radii."""

from __future__ import annotations

from comparisons.cases.encounters import figures
from comparisons.cases.encounters.checks import against_ode, step_by_step
from comparisons.cases.encounters.scenes import OF_TWO, of_two_materials
from comparisons.harness.case import Case, Tier, Variant

ALL = {"two_materials": OF_TWO}


def variants(tier: Tier) -> list[Variant]:
    """Six impacts of unlike balls."""
    return [Variant("two_materials", of_two_materials())]


CATCHES = (
    "a shear modulus from one material or from a mean Poisson ratio; friction or restitution of another pair;"
    " a moment of inertia with the density of another material"
)
CASE = Case(
    name="two_materials",
    title="Oblique impacts of two materials",
    purpose=(
        "Six oblique impacts of balls of three materials, whose Poisson ratios are 0.1, 0.34 and 0.49 and"
        " whose radii and densities differ; each pair of materials has its own restitution and friction. The"
        " effective shear modulus enters friction only, so that a wrong one is not seen without it."
    ),
    source="The law of LIGGGHTS' manual (hertz, tangential history) by DOP853.",
    variants=variants,
    checks=(*step_by_step(ALL, CATCHES), *against_ode(ALL, CATCHES)),
    figures=(figures.through("two_materials", OF_TWO[3:], "Three of the impacts"),),
    tables=(figures.table(ALL),),
    features=(
        "normal hertz", "damping", "tangential history", "several materials", "several radii",
        "sphere-sphere", "rotation",
    ),
    order=38,
)  # fmt: skip
