"""The verdict on two engines: chance and softness are granted, with their sign, and no more."""

from __future__ import annotations

import numpy as np
import pytest

from comparisons.metrics.engines import gap


def samples(shift: float) -> dict[str, np.ndarray]:
    spread = 0.01 * np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0])
    return {"hard": 5 * (1 + spread), "soft": 5 * (1 + spread[:2] + shift)}


def test_the_bounds_are_those_of_the_formula():
    # catches: seeds counted wrongly, softness granted in the wrong direction, its sign lost.
    # sums of squares 6e-4 and 2e-4 over 5 + 1 degrees of freedom
    chance = 3 * (8e-4 / 6) ** 0.5 * (1 / 6 + 1 / 2) ** 0.5
    assert gap(samples(chance), "soft", "hard").value == pytest.approx(1, rel=1e-9)
    assert gap(samples(-chance), "soft", "hard").value == pytest.approx(1, rel=1e-9)
    assert gap(samples(-chance - 0.05), "soft", "hard", -0.05).value == pytest.approx(1, rel=1e-9)
    assert gap(samples(chance), "soft", "hard", -0.05).value == pytest.approx(1, rel=1e-9)
    assert gap(samples(chance + 0.02), "soft", "hard", 0.02).value == pytest.approx(1, rel=1e-9)
    assert gap(samples(-0.025), "soft", "hard", -0.05).value == pytest.approx(0, abs=1e-9)


def test_not_a_number_fails():
    broken = samples(0.0)
    broken["soft"] = np.array([np.nan, 5.0])
    assert not gap(broken, "soft", "hard").value <= 1
