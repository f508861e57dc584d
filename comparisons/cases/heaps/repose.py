"""Angle of repose of the heap that a lifted tube leaves, over friction and rolling friction.

Particle-steps of each code: 8e6 (quick tier), 4e7 (standard), 4e8 (full).
"""

from __future__ import annotations

import itertools

import numpy as np

from comparisons import kit
from comparisons.cases.heaps import measures
from comparisons.cases.heaps.scenes import Heap
from comparisons.report import plots

#: Friction and rolling friction.
POINTS: dict[kit.Tier, tuple[tuple[float, float], ...]] = {
    "quick": ((0.1, 0.1), (0.5, 0.1), (0.5, 0.5)), "standard": ((0.1, 0.1), (0.5, 0.1), (0.5, 0.5)),
    "full": ((0.1, 0.1), (0.2, 0.02), (0.5, 0.02), (0.5, 0.1), (0.5, 0.3), (0.8, 0.1), (0.8, 0.5)),
}  # fmt: skip
SEEDS: dict[kit.Tier, int] = {"quick": 1, "standard": 5, "full": 6}
BALLS: dict[kit.Tier, int] = {"quick": 400, "standard": 400, "full": 800}
#: The heap that is compared with glass beads and made of a material four times as stiff, at this factor.
GLASS, STIFFER = (0.5, 0.1), 4.0
#: Friction from which on balls roll before they slide: more of it alone does not change the angle.
SATURATED = 0.5
#: Angle of repose of glass beads [deg].
PUBLISHED = 22.0


def prefix(friction: float, rolling: float) -> str:
    return f"mu_{friction:g}_{rolling:g}_seed_"


def text(friction: float, rolling: float) -> str:
    return f"mu = {friction:g}, mu_r = {rolling:g}"


def groups(tier: kit.Tier) -> dict[str, str]:
    """What each group of runs is -> beginning of its labels."""
    return {text(*point): prefix(*point) for point in POINTS[tier]}


def variants(tier: kit.Tier) -> list[kit.Variant]:
    found = []
    for seed, point in itertools.product(range(1, SEEDS[tier] + 1), POINTS[tier]):
        found.append(kit.Variant(f"{prefix(*point)}{seed}", Heap(*point, seed, BALLS[tier]).scene()))
        if point == GLASS and tier != "quick":
            stiff = Heap(*point, seed, BALLS[tier], young=STIFFER * Heap(*point).young)
            found.append(kit.Variant(f"stiff_seed_{seed}", stiff.scene(), codes=("gpudem",)))
    return found


def steeper(results: kit.Results, code: str) -> kit.Measured:
    """Smallest rise of the mean angle from a heap to one with no less of either friction [deg].

    Heaps that differ in friction above SATURATED alone are not compared.
    """
    points = POINTS[results.tier]
    mean = {point: float(measures.cones(results, code, prefix(*point)).mean()) for point in points}
    rises = {
        (a, b): mean[b] - mean[a]
        for a, b in itertools.permutations(points, 2)
        if a[0] <= b[0] and a[1] <= b[1] and (a[1] < b[1] or a[0] < SATURATED)
    }  # fmt: skip
    (a, b), rise = min(rises.items(), key=lambda item: item[1])
    return kit.Measured(rise, note=f"{mean[a]:.3g} to {mean[b]:.3g}, {text(*a)} to {text(*b)}")


def glass(results: kit.Results, code: str) -> kit.Measured:
    """Slope of the surface beside the angle of repose of glass beads [deg]."""
    slope = float(measures.surfaces(results, code, prefix(*GLASS)).mean())
    return kit.Measured(abs(slope - PUBLISHED), slope, PUBLISHED)


def softer(results: kit.Results) -> kit.Measured:
    """Difference of the mean angles of the cones of two moduli [deg]."""
    soft = measures.cones(results, "gpudem", prefix(*GLASS))
    stiff = measures.cones(results, "gpudem", "stiff_seed_")
    off = abs(float(soft.mean() - stiff.mean()))
    return kit.Measured(off, float(soft.mean()), float(stiff.mean()), f"{len(soft)} seeds")


def _angles(results: kit.Results) -> plots.Figure:
    figure, axes = plots.figure()
    points = POINTS[results.tier]
    for k, code in enumerate(results.codes()):
        found = [measures.cones(results, code, prefix(*point)) for point in points]
        at = np.arange(len(points)) + 0.1 * k
        error = [2 * f.std(ddof=1) / np.sqrt(len(f)) if len(f) > 1 else 0.0 for f in found]
        plots.points(axes, at, [f.mean() for f in found], code, error=error, linestyle="none",
                     marker="x" if code == "gpudem" else "o")  # fmt: skip
    axes.set_xticks(range(len(points)), labels=[f"{mu:g}\n{rolling:g}" for mu, rolling in points])
    axes.set(xlabel="friction, rolling friction", ylabel="angle of the cone [deg]")
    plots.legend(axes)
    return figure


CASE = kit.Case(
    name="repose", title="Angle of repose: a tube is lifted",
    purpose="Balls rest in a tube on a rough floor; the tube is lifted slowly and a heap remains. Its angle"
    " grows with friction up to 0.5, beyond which balls roll before they slide (0.8, full tier, changes"
    " it by 0.1 degrees), and with rolling friction (epsd2); it hardly depends on the modulus. Two measures:"
    " the slope of the surface, and the angle of the cone with the same mean height and mean distance from"
    " the axis, which all balls enter and which scatters less. A heap is chaotic: the codes are compared ball"
    " by ball while the balls fall, and over seeds at the end.",
    source="Trends: Zhou, Xu, Yu and Zulli, Phys. Rev. E 64 (2001) 021301 (angle against sliding and rolling"
    " friction, modulus); glass beads, 22 +- 0.5 degrees: Lajeunesse, Mangeney-Castelnau and Vilotte, Phys."
    " Fluids 16 (2004) 2371.",
    variants=variants,
    checks=(
        *measures.between(groups, SEEDS, scatter=1.5),
        kit.per_code(
            "smallest rise of the angle of the cone with either friction", steeper,
            lo=0.3, tolerance=20.0, against="Zhou et al. 2001: it increases with both", mark="P", unit="deg",
            reason="a mean over seeds is known to 0.5 degrees; the points are 1 to 4 degrees apart",
            catches="a rolling torque that does not act in a heap, or friction that another pair's hides",
        ),
        kit.per_code(
            f"{text(*GLASS)}: slope of the surface, distance from that of glass beads", glass,
            tolerance=4.0, against="Lajeunesse et al. 2004: 22 degrees", mark="P", unit="deg",
            reason="not calibrated: frictions of the order of those in use for glass; a heap four balls high"
            " has a slope known to 1 degree",
            catches="heaps that flow apart, or stand as columns",
        ),
        kit.per_code(
            "root mean square speed at the end", measures.moving, tolerance=0.02, unit="m/s",
            against="rest",
            reason="the tube pours at 0.1 m/s; of hundreds of balls one or two may still roll on the floor",
            catches="a heap measured before it is at rest",
        ),
        kit.per_code(
            "share of the balls that are not part of the heap", measures.loose, tolerance=0.14, unit="1",
            against="one heap",
            reason="of 400 balls some 55, 14 %, lie at its foot on the rough floor; most touch another",
            catches="balls that a tube carries along, or that lie apart on the floor",
        ),
        kit.check(
            f"{text(*GLASS)}: angle of the cone, difference to a modulus {STIFFER:g} times as large", softer,
            tolerance=1.5, against="Zhou et al. 2001: not sensitive", mark="P", unit="deg", tiers=kit.LONG,
            needs=("gpudem",), reason="two means over seeds, each known to 0.5 degrees",
            catches="balls so soft that overlaps shape the heap",
        ),
    ),
    figures=(
        kit.Figure(
            "Profiles of the heaps", "First seed; mean over 16 sectors of the highest ball.",
            lambda results: measures.profiles(results, groups(results.tier)),
        ),
        kit.Figure(
            "Angle over friction and rolling friction",
            "Means over the seeds; bars: two standard errors, where there are several.", _angles,
        ),
    ),
    tables=(
        kit.Table(
            "Angles of repose", "Means over the seeds.",
            lambda results: measures.rows(results, groups(results.tier)),
        ),
        kit.Table(
            "Codes against each other", "Over seeds; p corrected for all metrics by permutation.",
            lambda results: measures.seed_rows(results, groups(results.tier)), tiers=kit.LONG,
        ),
    ),
    features=(
        "normal hertz", "damping", "tangential history", "rolling epsd2", "rotation", "gravity",
        "several radii", "several materials", "wall mesh", "wall plane", "motion",
    ),
    order=58,
)  # fmt: skip
