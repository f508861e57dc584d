"""Kernels that carry everything move the balls of any scene as those built for it do."""

import numpy as np
import pytest

from comparisons.cases.performance import specialized
from gpudem.driver import simulate as run

pytestmark = pytest.mark.long

STEPS = 60


@pytest.mark.parametrize("name", ["frictionless gas", "frictionless bed", "polydisperse"])
def test_the_motion_is_the_same(name):
    """Catches physics left out that a scene has: a radius, mass or material taken for that of all."""
    scene = specialized.scenes()[name]
    scene = scene.replace(
        time={"duration": STEPS * scene.time.step}, output={"trace_every": STEPS * scene.time.step}
    )
    least, everything = run(scene), run(scene, specialize=False)
    v, w = (r.trace["velocity"][-1] for r in (least, everything) if r.trace)
    assert not np.array_equal(v, scene.state.velocity)
    assert np.abs(v - w).max() <= 1e-9 * np.abs(v).max()
    arrays = [set(r.notes["arrays"]) for r in (least, everything)]  # type: ignore[call-overload]
    assert arrays[0] - {"list.cache"} < arrays[1]  # the memory of small bodies has no room for it
