"""Oblique impacts on a plane whose normal is not along an axis, and not of length one."""

from __future__ import annotations

import math

import numpy as np

from comparisons import kit
from comparisons.cases.encounters import figures, throws
from comparisons.cases.encounters.checks import against_ode, differences, step_by_step
from comparisons.cases.encounters.throws import RADIUS, SPACING, Encounter, Throw
from comparisons.cases.side_by_side import plane, turned
from comparisons.harness import codes
from gpudem.scene import Scene

THROWS = (
    Throw("elastic, slips, sticks, slips", 1.0, 0.5),
    Throw("elastic, slides", 1.0, 2.5),
    Throw("e = 0.6, sticks", 0.6, 0.05),
    Throw("e = 0.6, slips and sticks", 0.6, 0.5, speed=0.8),
    Throw("e = 0.6, slides", 0.6, 3.0),
    Throw("e = 0.6, back spin", 0.6, 0.8, (1.4, 0.0)),
)
ON_THE_PLANE = [Encounter(throw.what, ((k, "floor"),)) for k, throw in enumerate(THROWS)]
ALL = {"across_z": ON_THE_PLANE, "tilted": ON_THE_PLANE}


def turn() -> np.ndarray:
    """The rotation of the tilted scene: z into a direction whose components are 0.42, -0.37 and 0.83."""
    axis, angle = np.array([0.37, 0.42, 0.2]), 0.63
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


def scene(name: str, rotation: np.ndarray, length: float) -> Scene:
    """Six impacts on a floor through the origin; all turned by a rotation, the normal of that length."""
    rows = throws.Spheres()
    for k, throw in enumerate(THROWS):
        place = rotation @ np.array([SPACING * (k - 2.5), 0.0, RADIUS])
        rows.throw(throw, place, turned(0.7 + 0.9 * k) @ rotation.T)
    floor = plane("floor", (0.0, 0.0, 0.0), (length * rotation[:, 2]).tolist())
    return throws.scene(name, rows, THROWS, "wall", walls=[floor], steps=425)


def turned_back(results: kit.Results, code: str, other: str) -> dict[str, float]:
    tilted, straight = results["tilted", code], results["across_z", other]
    back = {column: tilted.trace[column] @ turn() for column in ("velocity", "angular_velocity")}
    return differences(back, straight.trace or {}, straight.scene.state.radius)


def against_itself(code: str) -> tuple[kit.Check, ...]:
    """The tilted run of a code under test against its own that is not; a reference runs no tilted plane."""
    if codes.CODES[code].role != "under_test":
        return ()
    return kit.checks(
        f"{NAME} ({code}, both)", lambda results: turned_back(results, code, code), 1e-10,
        against="itself", reason=REASON, catches=CATCHES, needs=(code,),
    )  # fmt: skip


NAME = "tilted and turned back: velocity and R x spin, largest difference over all steps / (1 m/s)"
REASON = (
    "the same physics in rotated axes: the rounding of the rotated positions, 1e-18 m, relative to an overlap"
    " of 1e-5 m remains; the tolerance is ten to a hundred times the measured value"
)
CATCHES = (
    "a normal that is used without being brought to length one; a gap, an offset or a friction that is right"
    " along axes only"
)
CASE = kit.Case(
    name="tilted_plane",
    title="Impacts on a tilted plane",
    purpose=(
        "A contact force does not depend on the direction of the axes. Six oblique impacts with friction on a"
        " plane across z, whose normal is stated with length 2.5, and the same six rotated in space, with a"
        " normal of length 0.4 and three components. LIGGGHTS has only planes perpendicular to an axis, so it"
        " runs the first; the tilted run is rotated back and must agree to rounding with LIGGGHTS' run and"
        " with the untilted run of the same code, and all of them with the exact motion."
    ),
    source="Rotation of the frame; the law of LIGGGHTS' manual (hertz, tangential history) by DOP853.",
    variants=lambda tier: [  # LIGGGHTS has planes across the axes only
        kit.Variant("across_z", scene("across_z", np.eye(3), 2.5)),
        kit.Variant("tilted", scene("tilted", turn(), 0.4), ("gpudem",)),
    ],
    checks=(
        *step_by_step({"across_z": ON_THE_PLANE}, CATCHES),
        kit.per_pair(NAME, turned_back, tolerance=1e-10, reason=REASON, catches=CATCHES, half_step=True),
        kit.PerCode(against_itself),
        *against_ode(ALL, CATCHES),
    ),
    figures=(figures.through("tilted", [ON_THE_PLANE[k] for k in (0, 3, 5)], "Three impacts, tilted"),),
    tables=(figures.table(ALL),),
    features=("normal hertz", "damping", "tangential history", "wall plane", "rotation"),
    order=32,
)  # fmt: skip
