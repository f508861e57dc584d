"""Springs of a mesh where another one goes: LIGGGHTS' rule loses them, the rule `unique` keeps them."""

import numpy as np
import pytest

from gpudem.driver import simulate
from tests.reference.wall_scenes import DT, FLAT, PRESSED, mesh, rolling, strips

GONE = 0.002


def friction(rule: str) -> tuple[float, float]:
    """Friction [N] in the last step before a mesh far from the ball goes, and in the step after."""
    scene = rolling(
        "goes",
        [mesh(**FLAT), mesh("far", present=(0.0, GONE), **strips([(0.03, 0.01), (0.03, 0.02)]))],
        position=[[0.0003, 0.0002, PRESSED]], velocity=[[0, 0, 0]], spin=[[0, 0, 0]],
        gravity=(20.0, 0.0, -300.0), steps=500, contact={"mesh_contacts": rule}, output={"trace_every": DT},
    )  # fmt: skip
    trace, mass = simulate(scene).trace, scene.masses[0]
    force = trace["force"][:, 0, 0] - mass * 20.0
    k = round(GONE / DT)
    return float(force[k]), float(force[k + 1])


@pytest.mark.parametrize("rule", ["unique", "liggghts"])
def test_springs_where_a_mesh_goes(rule):
    """Detects springs kept by LIGGGHTS' rule (its binary loses them, `mesh_gate`) or lost by the other."""
    before, after = friction(rule)
    assert before < -1e-4
    share = after / before
    assert share > 0.95 if rule == "unique" else share < 0.5
    assert np.isfinite(share)
