"""Two balls of two materials with friction: unequal moduli, Poisson ratios, densities and radii."""

from __future__ import annotations

from comparisons import kit
from comparisons.cases.encounters import figures, throws
from comparisons.cases.encounters.checks import against_ode, step_by_step
from comparisons.cases.encounters.throws import BALL, SPACING, Encounter, Throw
from comparisons.cases.side_by_side import turned
from gpudem.scene import Material, Pair, Scene

MATERIALS = {
    "ball": BALL,
    "stiff": Material(young=8e9, poisson=0.1, density=2500.0),
    "rubbery": Material(young=2e9, poisson=0.49, density=1100.0),
}
#: Each pair of materials: restitution, friction, radii [m].
PAIRS = {
    ("ball", "stiff"): (0.8, 0.2, (0.003, 0.005)),
    ("rubbery", "ball"): (0.6, 0.45, (0.004, 0.003)),
    ("stiff", "rubbery"): (1.0, 0.3, (0.0025, 0.004)),
}
#: Slip speed by friction times approach speed, of two impacts of each.
SLIPS = (0.6, 2.0)
OF_TWO = [
    Encounter(f"{a} on {b}, slip {slip:g} mu", ((6 * n + 2 * k, 6 * n + 2 * k + 1),))
    for n, slip in enumerate(SLIPS)
    for k, (a, b) in enumerate(PAIRS)
]
ALL = {"two_materials": OF_TWO}


def scene() -> Scene:
    """Six impacts of unlike balls: unequal moduli, Poisson ratios, densities and radii."""
    rows = throws.Spheres()
    for n, slip in enumerate(SLIPS):
        for k, (materials, (e, friction, radii)) in enumerate(PAIRS.items()):
            throw = Throw("", e, slip * friction, (0.1, -0.05))
            place, axes = (SPACING * k, SPACING * n, 0.0), turned(0.8 * k + n, 0.4 + k)
            rows.throw(throw, place, axes, radii=radii, materials=materials)
    pairs = [Pair(materials=both, restitution=e, friction=mu) for both, (e, mu, _) in PAIRS.items()]
    return throws.scene("two_materials", rows, materials=MATERIALS, pairs=pairs, steps=500)


CATCHES = (
    "a shear modulus from one material or from a mean Poisson ratio; friction or restitution of another pair;"
    " a moment of inertia with the density of another material"
)
CASE = kit.Case(
    name="two_materials",
    title="Oblique impacts of two materials",
    purpose=(
        "Six oblique impacts of balls of three materials, whose Poisson ratios are 0.1, 0.34 and 0.49 and"
        " whose radii and densities differ; each pair of materials has its own restitution and friction. The"
        " effective shear modulus enters the tangential force only, so that an error in it is not detected"
        " without friction."
    ),
    source="The law of LIGGGHTS' manual (hertz, tangential history) by DOP853.",
    variants=lambda tier: [kit.Variant("two_materials", scene())],
    checks=(*step_by_step(ALL, CATCHES), *against_ode(ALL, CATCHES)),
    figures=(figures.through("two_materials", OF_TWO[3:], "Three of the impacts"),),
    tables=(figures.table(ALL),),
    features=(
        "normal hertz", "damping", "tangential history", "several materials", "several radii",
        "sphere-sphere", "rotation",
    ),
    order=38,
)  # fmt: skip
