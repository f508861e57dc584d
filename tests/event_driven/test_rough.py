"""Rough spheres (Walton's rule): friction mu with a constant largest tangential restitution beta0."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from gpudem import event_driven
from gpudem.event_driven.engine import Engine
from gpudem.event_driven.problem import HardSphereProblem
from tests.event_driven import scenes

R = scenes.RADIUS


def impact(angle: float, mu: float, beta: float, e: float = 0.8, wall: bool = True):
    """(velocity, spin, dissipated) after an impact at 1 m/s, at an angle from the normal."""
    v = [np.sin(angle), 0, -np.cos(angle)]
    if wall:
        scene = scenes.scene(
            [[-0.5, 0, 2 * R]], [v], sides=("zlo",), lo=(-1, -1, 0), wall_restitution=e, wall_friction=mu
        )
    else:  # two equal spheres: for each the other acts as a wall between them
        x = np.array([[0, 0, R], [0, 0, -R]]) - 0.05 * np.array([v, np.negative(v)])
        scene = scenes.scene(x, [v, np.negative(v)], restitution=e, friction=mu)
    engine = Engine(HardSphereProblem.from_scene(scene, tangential_restitution=beta))
    engine.advance(0.2)
    assert engine.counts.collisions == 1
    return engine.state()[1], engine.angular_velocity, engine.sums.dissipated


@pytest.mark.parametrize("wall", [True, False])
@pytest.mark.parametrize("angle", [0.1, 0.6, 1.4])
@pytest.mark.parametrize(("mu", "beta"), [(0.2, 1.0), (0.2, 0.3), (0.6, -0.4), (10.0, 0.0)])
def test_a_single_oblique_impact(angle, mu, beta, wall):
    # detects: a tangential mass other than 2/7 m, an inertia of disks, a spin of opposite sign, a limit by
    # mu times another impulse. Sticking: (1 + beta) 2/7 v_t; sliding: mu (1 + e) v_n
    e, normal, across = 0.8, np.cos(angle), np.sin(angle)
    stick, slide = (1 + beta) * 2 / 7 * across, mu * (1 + e) * normal
    loss = min(stick, slide)
    velocity, spin, dissipated = impact(angle, mu, beta, e, wall)
    assert velocity[0] == pytest.approx([across - loss, 0, e * normal], abs=1e-13)
    assert spin[0] * R == pytest.approx([0, 2.5 * loss, 0], abs=1e-13)
    if not wall:
        np.testing.assert_allclose(velocity[1], -velocity[0], atol=1e-13)
        np.testing.assert_allclose(spin[1], spin[0], atol=1e-11)
    after = 0.5 * (velocity**2).sum() + 0.5 * 0.4 * R**2 * (spin**2).sum()
    assert dissipated == pytest.approx(0.5 * len(velocity) - after, abs=1e-13)


def test_both_regimes_are_among_the_impacts():
    # or only one of the two branches was compared
    found = {(1 + b) * 2 / 7 * np.sin(a) < mu * 1.8 * np.cos(a) for a in (0.1, 0.6, 1.4) for mu, b in
             [(0.2, 1.0), (0.2, 0.3), (0.6, -0.4)]}  # fmt: skip
    assert found == {True, False}


@pytest.mark.parametrize(("mu", "beta"), [(0.3, 0.5), (10.0, 1.0), (0.05, -0.2)])
def test_angular_momentum_of_a_collision(mu, beta):
    # detects: a torque of opposite sign or other lever, or one equal for both partners of two sizes
    rng = np.random.default_rng(4)
    x, radius = np.array([[0, 0, 0], [0.1, 0.01, -0.005]]), np.array([R, 0.6 * R])
    scene = scenes.scene(x, [[2, 0.3, 0.1], [0, 0.1, 0]], radius=radius, friction=mu, restitution=0.7,
                         spin=rng.normal(size=(2, 3)) * 50)  # fmt: skip
    engine = Engine(HardSphereProblem.from_scene(scene, tangential_restitution=beta))

    def total() -> np.ndarray:
        (x, v), s = engine.state(), engine.problem
        turning = (0.4 * s.mass * s.radius**2)[:, None] * engine.angular_velocity
        return (s.mass[:, None] * np.cross(x, v) + turning).sum(axis=0)

    before, spin = total(), engine.angular_velocity
    engine.advance(0.1)
    assert engine.counts.pairs == 1
    assert np.abs(engine.angular_velocity - spin).min() > 0.1
    np.testing.assert_allclose(total(), before, rtol=0, atol=1e-14)


def gas(mu: float, beta: float, n: int = 500, e: float = 1.0) -> Engine:
    """A dense periodic gas without spin at the start."""
    edge = 2 * R * (n / 0.4) ** (1 / 3)
    problem = HardSphereProblem.from_scene(
        scenes.gas(n, edge=edge, radius=R, duration=100.0, friction=0.5, restitution=e),
        tangential_restitution=beta,
    )
    return Engine(dataclasses.replace(problem, friction=np.full_like(problem.friction, mu)))


def test_perfectly_rough_spheres_keep_energy_and_momentum_and_share_the_energy():
    # detects: any one collision that is not time-reversible; an inertia in the rule other than in the energy.
    # mu is beyond what a scene may state, or grazing collisions slide
    engine = gas(1e12, 1.0)
    energy, momentum = engine.energy(), engine.state()[1].sum(axis=0)
    engine.advance(2.0)
    share = []
    while engine.counts.pairs < 100_000:
        engine.advance(engine.time + 0.05)
        moving, turning = (engine.state()[1] ** 2).sum(), 0.4 * R**2 * (engine.angular_velocity**2).sum()
        share.append(turning / moving)
        assert engine.time < 50
    assert engine.energy() == pytest.approx(energy, rel=1e-11)
    np.testing.assert_allclose(engine.state()[1].sum(axis=0), momentum, atol=1e-10)
    assert abs(engine.sums.dissipated) < 1e-9 * energy
    assert np.mean(share) == pytest.approx(1.0, rel=0.05)


@pytest.mark.parametrize(("mu", "beta"), [(0.3, 0.4), (0.1, 1.0), (2.0, -0.5)])
def test_balance_of_energy_with_friction(mu, beta):
    # detects: a loss to sliding or to sticking that differs between the sums and the motion
    engine = gas(mu, beta, 200, e=0.95)
    begin = engine.energy()
    engine.advance(3.0)
    assert engine.counts.pairs > 3000
    assert engine.sums.dissipated > 0.1 * begin
    assert begin - engine.energy() == pytest.approx(engine.sums.dissipated, abs=1e-11 * begin)


def test_beta_of_minus_one_is_smooth():
    # detects: another limit. The same numbers to the last bit, and spins as at the start
    spin = np.random.default_rng(1).normal(size=(100, 3))
    smooth = Engine(HardSphereProblem.from_scene(scenes.gas(spin=spin)))
    scene = scenes.gas(spin=spin, friction=0.5)
    rough = Engine(HardSphereProblem.from_scene(scene, tangential_restitution=-1.0))
    for engine in (smooth, rough):
        engine.advance(1.0)
    np.testing.assert_array_equal(smooth.state(), rough.state())
    np.testing.assert_array_equal(rough.angular_velocity, spin)


def test_a_smooth_scene_has_no_arrays_of_spin():
    # detects: memory for physics that the scene does not have
    smooth, rough = Engine(HardSphereProblem.from_scene(scenes.gas())), gas(0.3, 0.4, 20)
    fields = ("angular_velocity", "friction", "wall_friction")
    assert [getattr(smooth._state, name) for name in fields] == [None] * 3
    assert all(getattr(rough._state, name).size > 0 for name in fields)


def test_history_and_frames_have_the_spin():
    # detects: only the initial spin is written, or spin is left out of the energies
    scene = scenes.scene(
        [[0, 0, 2 * R]], [[1, 0, -1]], sides=("zlo",), lo=(-5, -5, 0), hi=(5, 5, 5), wall_friction=0.3,
        output=scenes.Output(history_every=0.1, trace_every=0.1), duration=0.3,
    )  # fmt: skip
    run = event_driven.run(scene, tangential_restitution=1.0)
    spin = 2.5 * min(4 / 7, 0.3 * 2) / R
    np.testing.assert_allclose(run.trace["angular_velocity"][:, 0, 1], [0, spin, spin, spin], rtol=1e-12)
    want = 0.2 * R**2 * spin**2
    np.testing.assert_allclose(run.history["rotational_energy"], [0, want, want, want], rtol=1e-12)
    assert run.notes["tangential_restitution"] == 1.0
