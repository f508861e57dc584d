"""A case run with a wrong law must fail: gpudem on a slightly changed scene, judged as if it were the
stated one.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import pytest

from comparisons.cases.encounters import (
    meet_again,
    moving_pairs,
    several_walls,
    tilted_plane,
    two_materials,
)
from comparisons.cases.rolling import slide_to_roll
from comparisons.cases.single_contact import head_on, oblique, wall_restitution
from comparisons.cases.walls import ball_over_edge, mesh_plane, moving_walls
from comparisons.harness.case import Case, Measured, Results
from gpudem import driver
from gpudem.scene import Plane, Scene

pytestmark = pytest.mark.cases


def softer(scene: Scene) -> Scene:
    return scene.replace(
        materials={n: m.model_copy(update={"young": 0.99 * m.young}) for n, m in scene.materials.items()}
    )


def heavier(scene: Scene) -> Scene:
    return scene.replace(
        materials={n: m.model_copy(update={"density": 1.01 * m.density}) for n, m in scene.materials.items()}
    )


def with_pairs(**factors: float) -> Callable[[Scene], Scene]:
    def change(scene: Scene) -> Scene:
        pairs = [
            p.model_copy(update={k: min(f * getattr(p, k), 1.0) for k, f in factors.items()})
            for p in scene.pairs
        ]
        return scene.replace(pairs=pairs)

    return change


def with_contact(**changes: bool | float) -> Callable[[Scene], Scene]:
    return lambda scene: scene.replace(contact=changes)


def mean_friction(scene: Scene) -> Scene:
    """The friction of every pair is the mean over the pairs: a mixing rule in place of a table."""
    mean = sum(pair.friction for pair in scene.pairs) / len(scene.pairs)
    return scene.replace(pairs=[p.model_copy(update={"friction": mean}) for p in scene.pairs])


def one_poisson_ratio(scene: Scene) -> Scene:
    """The Poisson ratio of the first material for all; E is changed with it, so that E* stays as it is."""
    first = next(iter(scene.materials.values())).poisson
    changed = {
        name: m.model_copy(update={"poisson": first, "young": m.young * (1 - first**2) / (1 - m.poisson**2)})
        for name, m in scene.materials.items()
    }
    return scene.replace(materials=changed)


def late_gate(scene: Scene) -> Scene:
    """Gates are removed three steps later."""
    walls = [
        w.model_copy(update={"removed_at": w.removed_at + 3 * scene.time.step})
        if isinstance(w, Plane) and w.removed_at
        else w
        for w in scene.walls
    ]
    return scene.replace(walls=walls)


def closed(scene: Scene) -> Scene:
    """Boxes have all sides."""
    sides = ("xlo", "xhi", "ylo", "yhi", "zlo", "zhi")
    walls = [w.model_copy(update={"sides": sides}) if w.kind == "box" else w for w in scene.walls]
    return scene.replace(walls=walls)


def with_walls(change: Callable[[Any], dict[str, Any]]) -> Callable[[Scene], Scene]:
    """Walls with some keys changed."""
    return lambda scene: scene.replace(walls=[w.model_copy(update=change(w)) for w in scene.walls])


def longer_periods(wall: Any) -> dict[str, Any]:
    """Motions of 1.001 times the period; belts and plates of 0.998 times the speed."""
    motions = tuple(
        m.model_copy(
            update={"period": 1.001 * m.period}
            if m.cycle
            else {"velocity": tuple(0.998 * v for v in m.velocity)}
        )
        for m in wall.motion
    )
    belt = tuple(0.998 * v for v in wall.surface_velocity) if wall.surface_velocity else None
    return {"motion": motions, "surface_velocity": belt}


def long(*values: Any) -> Any:
    """A parameter set of a test that takes seconds."""
    return pytest.param(*values, marks=pytest.mark.long)


def failures(case: Case, change: Callable[[Scene], Scene]) -> list[str]:
    """Names of the checks against closed forms and the ODE that a changed gpudem fails."""
    runs = {}
    for variant in case.variants("quick"):
        run = driver.simulate(change(variant.scene))
        runs[variant.label, "gpudem"] = dataclasses.replace(run, scene=variant.scene)
    results, failed = Results("quick", runs), []
    for check in case.checks_of("quick", ("gpudem",)):
        if check.needs == ("gpudem",):
            found = check.measure(results)
            value = found.value if isinstance(found, Measured) else found
            if not (value <= check.tolerance and (check.lo is None or value >= check.lo)):
                failed.append(check.name)
    return failed


@pytest.mark.parametrize(
    ("case", "change", "expected"),
    [
        (head_on.CASE, softer, "peak overlap"),
        (head_on.CASE, heavier, "contact time"),
        (head_on.CASE, with_pairs(restitution=0.99), "rebound"),
        (wall_restitution.CASE, with_contact(limit_force=True), "default, damped: rebound"),
        (wall_restitution.CASE, with_contact(limit_force=False), "limit_force, damped: rebound"),
        (oblique.CASE, with_pairs(friction=0.99), "gross sliding"),
        (oblique.CASE, with_contact(tangential_damping=False), "default, damped"),
        (slide_to_roll.CASE, with_pairs(friction=0.99), "slip time"),
        (two_materials.CASE, mean_friction, "damped"),
        (two_materials.CASE, one_poisson_ratio, "elastic"),
        (several_walls.CASE, late_gate, "force on the ball where the gate was"),
        (several_walls.CASE, closed, "passing ball"),
        long(moving_walls.CASE, with_walls(longer_periods), "velocity of a ball that rolls"),
        long(moving_walls.CASE, with_walls(longer_periods), "velocity from rest"),
        long(moving_walls.CASE, with_pairs(restitution=0.8), "heights above the threshold"),
        long(mesh_plane.CASE, with_contact(merge_angle=60.0), "rule 'unique'"),
        long(mesh_plane.CASE, with_contact(mesh_curvature=12.0), "rule 'liggghts'"),
        long(ball_over_edge.CASE, with_pairs(restitution=0.99), "energy over ridge and rim"),
        long(ball_over_edge.CASE, with_pairs(friction=0.05), "spin of a ball that rolls over the rim"),
    ],
    ids=[
        "modulus", "density", "restitution", "limit", "no limit", "friction", "dashpot", "floor friction",
        "mixing rule of friction", "one Poisson ratio", "late gate", "closed box",
        "period of walls", "speed of walls", "restitution on a plate",
        "merge angle", "curvature", "damping over an edge", "friction at a rim",
    ],
)  # fmt: skip
def test_a_small_mistake_is_seen(case: Case, change: Callable[[Scene], Scene], expected: str):
    failed = failures(case, change)
    assert any(expected in name for name in failed), failed


@pytest.mark.parametrize(
    "case",
    [
        head_on.CASE,
        wall_restitution.CASE,
        oblique.CASE,
        slide_to_roll.CASE,
        tilted_plane.CASE,
        meet_again.CASE,
        several_walls.CASE,
        moving_pairs.CASE,
        two_materials.CASE,
        long(mesh_plane.CASE),
        long(moving_walls.CASE),
        long(ball_over_edge.CASE),
    ],
    ids=lambda case: case.name,
)
def test_the_right_law_passes(case: Case):
    assert failures(case, lambda scene: scene) == []
