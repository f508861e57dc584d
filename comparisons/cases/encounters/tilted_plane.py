"""Oblique impacts on a plane whose normal is not along an axis, and not of length one."""

from __future__ import annotations

import numpy as np

from comparisons.cases.encounters import figures
from comparisons.cases.encounters.checks import against_ode, step_by_step
from comparisons.cases.encounters.scenes import ON_THE_PLANE, on_the_plane, turn
from comparisons.harness import check_builders as build
from comparisons.harness import codes
from comparisons.harness.case import Case, Check, Measured, PerCode, Results, Tier, Variant, largest
from comparisons.metrics import trace
from gpudem.output.run import Run

ALL = {"across_z": ON_THE_PLANE, "tilted": ON_THE_PLANE}


def variants(tier: Tier) -> list[Variant]:
    """The same impacts on a plane across z, and all turned: LIGGGHTS has planes across the axes only."""
    return [
        Variant("across_z", on_the_plane("across_z", np.eye(3), 2.5)),
        Variant("tilted", on_the_plane("tilted", turn(), 0.4), ("gpudem",)),
    ]


def difference(tilted: Run, straight: Run) -> Measured:
    """Velocity and R x spin of a tilted run, turned back, against those of one that is not tilted."""
    radius, found = straight.scene.state.radius, {}
    for column, scale in (("velocity", np.ones(len(radius))), ("angular_velocity", 1 / radius)):
        found[column] = trace.largest_difference(tilted.trace[column] @ turn(), straight.trace[column], scale)
    return largest(found)


def turned_back(results: Results, code: str, other: str) -> Measured:
    """A code's tilted run against the straight run of a code."""
    return difference(results["tilted", code], results["across_z", other])


def against_itself(code: str) -> tuple[Check, ...]:
    """The tilted run of a code under test against its own that is not; a reference runs no tilted plane."""
    if codes.CODES[code].role != "under_test":
        return ()
    check = Check(
        name=f"{NAME} ({code}, both)", measure=lambda results: turned_back(results, code, code),
        tolerance=1e-10, unit="1", against="itself", mark="A", reason=REASON, catches=CATCHES, needs=(code,),
    )  # fmt: skip
    return (check,)


NAME = "tilted and turned back: velocity and R x spin, largest difference over all steps / (1 m/s)"
REASON = (
    "the same physics in turned axes: what is left is the rounding of positions that are turned, 1e-18 m, by"
    " an overlap of 1e-5 m; ten to a hundred times what was measured"
)
CATCHES = (
    "a normal that is used without being brought to length one; a gap, an offset or a friction that is right"
    " along axes only"
)
CASE = Case(
    name="tilted_plane",
    title="Impacts on a tilted plane",
    purpose=(
        "A contact force does not depend on the direction of the axes. Six oblique impacts with friction on"
        " a plane across z, whose normal is stated with length 2.5, and the same six turned in space, with a"
        " normal of length 0.4 and three components. LIGGGHTS has planes across the axes only, so that it"
        " runs the first; the tilted run is turned back and must agree with it to rounding, as it must with"
        " the run of the same code that is not tilted, and both with the exact motion."
    ),
    source="Rotation of the frame; the law of LIGGGHTS' manual (hertz, tangential history) by DOP853.",
    variants=variants,
    checks=(
        *step_by_step({"across_z": ON_THE_PLANE}, CATCHES),
        build.per_pair(
            NAME, turned_back, tolerance=1e-10, reason=REASON, catches=CATCHES, half_step=True
        ),
        PerCode(against_itself),
        *against_ode(ALL, CATCHES),
    ),
    figures=(figures.through("tilted", [ON_THE_PLANE[k] for k in (0, 3, 5)], "Three impacts, tilted"),),
    tables=(figures.table(ALL),),
    features=("normal hertz", "damping", "tangential history", "wall plane", "rotation"),
    order=32,
)  # fmt: skip
