"""Index of mixing, and forces and dissipated energy in the drum, where they are known."""

import numpy as np
import pytest

from comparisons.metrics import mixing
from comparisons.oracles import drum as oracle

BALL = oracle.Spring(300.0, 0.2, 0.5)


def drum(spin: float = 0.0) -> oracle.Drum:
    """One facet in the middle of 24 at the lowest place."""
    return oracle.Drum(0.05, 24, spin, -np.pi / 2, 0.2, 0.003, 3e-4, BALL, BALL)


def trace(velocity, steps=400, dt=1e-5, overlap=3e-5):
    """A sphere that slides along the lowest facet at a constant velocity, without spin."""
    start = np.array([0.0, 0.01, -0.05 + 0.003 - overlap])
    time = dt * np.arange(steps)
    position = start + time[:, None, None] * np.array(velocity)
    same = np.broadcast_to(np.array(velocity, float), position.shape)
    none = np.zeros_like(position)
    return {"position": position, "velocity": same, "angular_velocity": none, "force": none, "torque": none}


def test_separate_kinds_and_a_random_mixture():
    """Detects a variance about the wrong mean, or the index turned round."""
    rng = np.random.default_rng(1)
    place = rng.uniform(size=(2000, 3))
    apart = np.arange(2000) < 1000
    assert mixing.lacey(place + 5.0 * apart[:, None], apart) == pytest.approx(0.0, abs=1e-12)
    assert mixing.lacey(place, apart) == pytest.approx(1.0, abs=0.03)  # 2000 samples that share members
    layers = place[:, 0] < 0.5
    assert 0.05 < mixing.lacey(place, layers) < 0.3


def test_sliding_dissipates_friction_times_way():
    """Detects energy of sliding that is counted twice, halved or left out, and a limit without friction."""
    dt, speed, overlap = 1e-5, 0.3, 3e-5
    found = oracle.follow(drum(), dt, trace((0, speed, 0), dt=dt, overlap=overlap))
    friction = BALL.friction * BALL.stiffness * overlap
    assert found.force[-1, 0] == pytest.approx([0, -friction, BALL.stiffness * overlap])
    late = (found.dissipated[-1] - found.dissipated[200]) / (199 * dt)
    assert late == pytest.approx(friction * speed)
    assert found.stored[-1] == pytest.approx(
        BALL.stiffness * overlap**2 / 2 + friction**2 / (2 * BALL.stiffness)
    )
    # all that a hand spends on the sphere: friction times way, less what it was before the limit
    hand = -np.trapezoid(found.force[:, 0, 1] * speed, dx=dt)
    gained = found.stored[-1] - found.stored[0]
    assert found.dissipated[-1] + gained == pytest.approx(hand, rel=1e-3)


def test_a_wall_that_turns_has_the_torque_of_the_friction():
    """Detects a drum whose surface stands still, or turns the other way."""
    dt, spin = 1e-6, 6.0  # the lowest facet moves along -x, by 30 micrometers
    found = oracle.follow(drum(spin), dt, trace((0, 0, 0), steps=100, dt=dt))
    assert found.force[-1, 0, 0] < 0
    friction = np.linalg.norm(found.force[-1, 0]) * BALL.friction / np.hypot(1, BALL.friction)
    assert found.torque[-1] == pytest.approx(-friction * 0.05, rel=1e-2)
    power = -spin * found.torque
    gained = found.stored - found.stored[0]
    work = np.concatenate([[0.0], np.cumsum((power[1:] + power[:-1]) / 2 * dt)])
    assert found.dissipated[-1] + gained[-1] == pytest.approx(work[-1], rel=1e-2)
