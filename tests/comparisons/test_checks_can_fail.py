"""A case run with a wrong law must fail: gpudem on a slightly changed scene, judged as if it were the
stated one.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import pytest

from comparisons.cases.rolling import slide_to_roll
from comparisons.cases.single_contact import head_on, oblique, wall_restitution
from comparisons.harness.case import Case, Results
from gpudem import driver
from gpudem.scene import Scene

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


def with_contact(**changes: bool) -> Callable[[Scene], Scene]:
    return lambda scene: scene.replace(contact=changes)


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
            value = found if isinstance(found, float) else found.value
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
    ],
    ids=["modulus", "density", "restitution", "limit", "no limit", "friction", "dashpot", "floor friction"],
)
def test_one_per_cent_wrong_is_seen(case: Case, change: Callable[[Scene], Scene], expected: str):
    failed = failures(case, change)
    assert any(expected in name for name in failed), failed


@pytest.mark.parametrize(
    "case",
    [head_on.CASE, wall_restitution.CASE, oblique.CASE, slide_to_roll.CASE],
    ids=lambda case: case.name,
)
def test_the_right_law_passes(case: Case):
    assert failures(case, lambda scene: scene) == []
