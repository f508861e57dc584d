"""The oracle of stable steps against a scheme stepped by hand, and the two forms against each other."""

from __future__ import annotations

import math

import pytest

from comparisons.oracles import step_limit
from comparisons.oracles.bodies import Bodies

MASS, RADIUS, GRAVITY = 2e-4, 0.003, 9.81


def floor(e: float, mu: float = 0.0) -> Bodies:
    return Bodies((MASS, math.inf), (RADIUS, math.inf), 2.8e6, 0.56e6, e, mu)


def grows(c: Bodies, step: float, steps: int = 4000) -> bool:
    """A ball at rest on a Hertz floor, pushed by 1e-6 of its overlap, in LIGGGHTS' scheme."""
    rest = (MASS * GRAVITY / c.normal_constant) ** (2 / 3)
    overlap, v = rest * (1 + 1e-6), 0.0
    for _ in range(steps):
        force = c.normal_constant * overlap**1.5 + c.normal_damping * overlap**0.25 * v
        v += step * (GRAVITY - force / MASS)
        overlap += step * v
        if abs(overlap / rest - 1) > 1e-2:
            return True
    return False


@pytest.mark.parametrize("e", [0.3, 0.9, 1.0])
def test_single_ball(e):
    """Catches a dashpot that lags otherwise, or a ratio without its sqrt(5/6)."""
    limit = step_limit.single(floor(e), MASS * GRAVITY)
    assert not grows(floor(e), 0.99 * limit)
    assert grows(floor(e), 1.01 * limit)


def test_a_column_of_one_is_a_single_ball():
    c = floor(0.5)
    column = step_limit.column(1, c, c, GRAVITY)
    assert column == pytest.approx(step_limit.single(c, MASS * GRAVITY), rel=1e-6)


def test_friction_shortens_the_limit():
    """Undamped: by sqrt(3.5 k_t/k_n), k_t/k_n = 8 G*/(2 E*)."""
    ratio = step_limit.single(floor(1.0), 1.0) / step_limit.single(floor(1.0, 0.5), 1.0)
    assert ratio == pytest.approx(math.sqrt(3.5 * 8 * 0.56 / (2 * 2.8)), rel=1e-12)
