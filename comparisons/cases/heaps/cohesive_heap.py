"""The heap that a lifted tube leaves, over cohesion: from an angle of repose to a column that stands.

Particle-steps of each code: 1e7 (quick tier), 5e7 (standard), 3e8 (full).
"""

from __future__ import annotations

import itertools

import numpy as np

from comparisons import kit
from comparisons.cases.heaps import measures
from comparisons.cases.heaps.scenes import SETTLED, Heap, weight
from comparisons.cases.machines import hopper_scenes as beds
from comparisons.oracles.bodies import Bodies, star
from comparisons.oracles.cohesion import density_for
from comparisons.report import plots
from gpudem.output.run import Run

#: Pull-off force of two balls by the weight of one.
BONDS: dict[kit.Tier, tuple[float, ...]] = {
    "quick": (0.0, 1.0, 10.0), "standard": (0.0, 1.0, 10.0), "full": (0.0, 0.3, 1.0, 2.0, 5.0, 10.0),
}  # fmt: skip
SEEDS: dict[kit.Tier, int] = {"quick": 1, "standard": 5, "full": 6}
BALLS: dict[kit.Tier, int] = {"quick": 400, "standard": 400, "full": 600}
FRICTION, ROLLING = 0.5, 0.1
#: Stiffer than without cohesion, or the largest one would let balls sink in by a tenth of their diameter.
YOUNG = 5e5
#: Bond number at which the column stands.
STANDS = 10.0


def density(bond: float) -> float:
    """Cohesion energy density [J/m3] of two balls of the mean diameter."""
    if not bond:
        return 0.0
    grain, radius = beds.ball(YOUNG), beds.DIAMETER / 2
    mass = weight() / beds.GRAVITY
    equal = Bodies((mass, mass), (radius, radius), *star(grain, grain), beds.RESTITUTION, FRICTION)
    return density_for(equal, bond * weight())


def prefix(bond: float) -> str:
    return f"bond_{bond:g}_seed_"


def groups(tier: kit.Tier) -> dict[str, str]:
    """What each group of runs is -> beginning of its labels."""
    return {f"Bo = {bond:g}": prefix(bond) for bond in BONDS[tier]}


def variants(tier: kit.Tier) -> list[kit.Variant]:
    found, strength = [], {bond: density(bond) for bond in BONDS[tier]}
    for seed, bond in itertools.product(range(1, SEEDS[tier] + 1), BONDS[tier]):
        heap = Heap(FRICTION, ROLLING, seed, BALLS[tier], YOUNG, strength[bond])
        found.append(kit.Variant(f"{prefix(bond)}{seed}", heap.scene()))
    return found


def height(run: Run) -> float:
    """Mean height of the balls [m], of a column half of its height."""
    return float(run.frames[-1]["position"][:, 2].mean())


def steeper(results: kit.Results, code: str) -> kit.Measured:
    """Smallest rise of the mean angle from one Bond number to the next [deg]."""
    bonds = BONDS[results.tier]
    mean = [float(measures.cones(results, code, prefix(bond)).mean()) for bond in bonds]
    k = int(np.argmin(np.diff(mean)))
    return kit.Measured(
        float(np.diff(mean)[k]),
        note=f"{mean[k]:.3g} to {mean[k + 1]:.3g}, Bo {bonds[k]:g} to {bonds[k + 1]:g}",
    )


def stands(results: kit.Results, code: str) -> dict[str, kit.Measured]:
    """Mean height at the end by that before the tube is lifted, of the most cohesive heaps."""
    found = {}
    for label in results.labels(code, prefix=prefix(STANDS)):
        run = results[label, code]
        before = float(run.frames.at(SETTLED)["position"][:, 2].mean())
        found[label] = kit.Measured(height(run) / before, height(run), before)
    return found


def _angles(results: kit.Results) -> plots.Figure:
    figure, axes = plots.figure()
    bonds = BONDS[results.tier]
    for code in results.codes():
        found = [measures.cones(results, code, prefix(bond)) for bond in bonds]
        error = [2 * f.std(ddof=1) / np.sqrt(len(f)) if len(f) > 1 else 0.0 for f in found]
        plots.points(axes, bonds, [f.mean() for f in found], code, error=error,
                     marker="x" if code == "gpudem" else "o")  # fmt: skip
    axes.set(xlabel="Bond number: pull-off force / weight", ylabel="angle of the cone [deg]")
    axes.set_xscale("symlog", linthresh=0.3)
    axes.set_xticks(bonds, labels=[f"{bond:g}" for bond in bonds])
    axes.minorticks_off()
    plots.legend(axes)
    return figure


CASE = kit.Case(
    name="cohesive_heap", title="Heap of cohesive balls: from angle of repose to a column",
    purpose="The tube of the case repose, with cohesion (sjkr) between the balls, stated by the Bond number:"
    " the pull-off force of two balls by the weight of one. With some weights of a ball the heap is steeper"
    " than without, and from ten on the column stands as the tube leaves it. The pull-off force of sjkr falls"
    " with the square of the modulus, so that the density is worked out from it for the modulus at hand.",
    source="Bond number: Nase, Vargas, Abatan and McCarthy, Powder Technol. 116 (2001) 214; sjkr: LIGGGHTS"
    " manual, gran_cohesion_sjkr.",
    variants=variants,
    checks=(
        *measures.between(groups, SEEDS, scatter=3.0),
        kit.per_code(
            "smallest rise of the angle of the cone with the Bond number", steeper,
            lo=1.0, tolerance=90.0, against="cohesion holds balls back", mark="P", unit="deg",
            reason="a mean over seeds is known to 1 degree; the angles are 5 degrees apart and more",
            catches="cohesion of the wrong sign, or lost between rebuilds of the list",
        ),
        kit.per_code(
            f"Bo = {STANDS:g}: mean height at the end / before the tube is lifted", stands,
            lo=0.8, tolerance=1.1, against="a column that stands", mark="P", unit="1",
            reason="cohesion of ten weights carries a bed of some eight balls; it settles by a few percent",
            catches="an attraction that friction's limit does not feel: such a column flows apart",
        ),
        kit.per_code(
            "root mean square speed at the end", measures.moving, tolerance=0.03, unit="m/s", against="rest",
            reason="the tube pours at 0.1 m/s; of hundreds of balls one or two may still roll on the floor",
            catches="a heap measured before it is at rest",
        ),
    ),
    figures=(
        kit.Figure(
            "Profiles of the heaps", "First seed; mean over 16 sectors of the highest ball.",
            lambda results: measures.profiles(results, groups(results.tier)),
        ),
        kit.Figure(
            "Angle over the Bond number",
            "Means over the seeds; bars: two standard errors, where there are several.", _angles,
        ),
    ),
    tables=(
        kit.Table(
            "Angles", "Means over the seeds.",
            lambda results: measures.rows(results, groups(results.tier)),
        ),
        kit.Table(
            "Codes against each other", "Over seeds; p corrected for all metrics by permutation.",
            lambda results: measures.seed_rows(results, groups(results.tier)), tiers=kit.LONG,
        ),
    ),
    features=(
        "normal hertz", "damping", "tangential history", "rolling epsd2", "cohesion sjkr", "rotation",
        "gravity", "several radii", "several materials", "wall mesh", "wall plane", "motion",
    ),
    order=59,
)  # fmt: skip
