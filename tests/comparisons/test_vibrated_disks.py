"""What the case vibrated_box computes with: contact times, fits, the two rules of time stepping.

Catches: a modulus that is not that of the contact time, a fit without its errors, a right rule that meets
pairs twice, a source's rule that does not.
"""

import numpy as np
import pytest

from comparisons.cases.vibrated_disks import soft_disks, stepped_disks, vibrated_box
from comparisons.metrics.limit import Approach, block_mean
from gpudem.driver import simulate as run
from gpudem.event_driven.problem import HardSphereProblem


def test_contact_time():
    """Two disks that meet at MEETING: the modulus gives the time they are in contact, damping included."""
    hard = vibrated_box.scene(1, 0.05)
    pair = {"source": "explicit", "material": "disk", "radius": 0.02, "angular_velocity": None,
            "position": [(0, 0, 1.0), (0.0401, 0, 1.0)],
            "velocity": [(soft_disks.MEETING / 2, 0, 0), (-soft_disks.MEETING / 2, 0, 0)]}  # fmt: skip
    scene = soft_disks.soften(hard.replace(particles=pair, gravity=(0, 0, 0)), 0.01, 0.03, mass=1.0)
    scene = scene.replace(time={"step": 1e-5}, output={"history_every": 1e-5})
    made = run(scene)
    assert made.history.contacts.sum() * 1e-5 == pytest.approx(0.01, rel=0.01)


def test_fits():
    """A known approach with known noise: exponent, limit, and their standard errors from many draws."""
    times, errors = np.array([0.002, 0.005, 0.01, 0.03]), np.array([0.004, 0.003, 0.002, 0.002])
    truth = 10.0 * times
    exact = Approach(times, truth + 0.001, errors, 0.0)
    assert exact.limit()[0] == pytest.approx(0.001, abs=1e-12)
    assert Approach(times, truth, errors, 0.0).slope()[0] == pytest.approx(1.0, abs=1e-6)
    rng = np.random.default_rng(1)
    drawn = [Approach(times, truth + rng.normal(scale=errors), errors, 0.0) for _ in range(400)]
    for found in ([a.limit() for a in drawn], [a.slope() for a in drawn]):
        values, stated = np.array(found).T
        assert np.std(values) == pytest.approx(stated.mean(), rel=0.15)


def test_mean_of_blocks():
    """Values as if each were independent; a last block that is shorter."""
    assert block_mean(np.array([0.0, 2.0, 4.0, 6.0, 80.0]), 2) == pytest.approx((3.0, 2.0))


@pytest.mark.parametrize(("tested", "low", "high"), [(True, 0.31, 0.335), (False, 0.198, 0.212)])
def test_time_stepping(tested, low, high):
    problem = HardSphereProblem.from_scene(vibrated_box.scene(1, vibrated_box.START))
    times, heights = stepped_disks.mean_heights(problem, 1e-2, vibrated_box.START, 0.1, tested)
    assert times[-1] == pytest.approx(vibrated_box.START)
    assert heights[0] == pytest.approx(problem.position[:, 2].mean())
    assert low < vibrated_box.window(times, heights) < high
