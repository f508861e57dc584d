"""Vibrating walls: sawtooth of finite amplitude, and its zero-amplitude limit (the fast floor)."""

from __future__ import annotations

import dataclasses
import time

import numpy as np
import pytest

from gpudem.errors import SimulationError
from gpudem.event_driven.engine import Engine
from gpudem.event_driven.problem import HardSphereProblem
from tests.event_driven import scenes
from tests.event_driven.brute_force import BruteForceHardSpheres

R = scenes.RADIUS
DOWN, NONE = (0, 0, -1.0), (0, 0, 0)


def balls(heights, speeds, speed, amplitude, gravity=DOWN, e=1.0, **more) -> HardSphereProblem:
    """Balls one beside another, so far that they never meet, each at a height over the floor."""
    n = len(heights)
    x = np.column_stack([3 * R * np.arange(n), np.zeros(n), np.asarray(heights) + R])
    return HardSphereProblem.from_scene(
        scenes.scene(
            x, np.outer(speeds, [0, 0, 1]), wall_restitution=e, gravity=gravity, duration=40.0,
            lo=(-1, -1, 0), hi=(3 * R * n + 1, 1, 1000), walls=scenes.floored(speed, amplitude), **more,
        )
    )  # fmt: skip


def hits(problem: HardSphereProblem, until: float, log: int = 1000) -> tuple[Engine, np.ndarray]:
    engine = Engine(problem, log=log)
    engine.advance(until)
    return engine, engine.log[1]


def test_a_ball_at_rest_within_the_stroke_is_swept_up():
    # detects: a floor that acts only at its lowest position, or at a position of another time
    engine, times = hits(balls([0.006], [0.0], 0.1, 0.01, NONE, e=0.5), 0.5)
    assert times.tolist() == pytest.approx([0.06], abs=1e-15)
    assert engine.state()[1][0, 2] == pytest.approx(1.5 * 0.1, abs=1e-15)
    assert engine.sums.work == pytest.approx(0.1 * 0.15, rel=1e-12)
    assert engine.sums.dissipated == pytest.approx(0.1 * 0.15 - 0.5 * 0.15**2, rel=1e-12)


def test_a_ball_slower_than_the_floor_is_overtaken_in_the_tooth_that_reaches_it():
    # detects: a wall that acts only on what approaches its rest position; 0.02 against 0.1 m/s, from 0.009 m:
    # the first period ends below the ball, the second meets it at 0.009 + 0.02 t = 0.1 (t - 0.1)
    _, times = hits(balls([0.009], [0.02], 0.1, 0.01, NONE), 0.5)
    assert times.tolist() == []  # at the end of the first period it is at 0.011, above the amplitude
    _, times = hits(balls([0.005], [0.02], 0.1, 0.01, NONE), 0.5)
    assert times.tolist() == pytest.approx([0.0625], abs=1e-15)


def test_nothing_collides_as_the_floor_snaps_back():
    # detects: a collision with the jump of the sawtooth. A ball that reaches the amplitude just after it
    # meets the floor of the next period, 0.1105 - t = 0.1 (t - 0.1), not the top of the one before
    _, times = hits(balls([0.1105], [-1.0], 0.1, 0.01, NONE), 0.115)
    assert times.tolist() == pytest.approx([0.1205 / 1.1], abs=1e-15)


def test_a_far_slow_ball_costs_no_more_than_a_near_one():
    # detects: a loop over all periods; 100 m of fall are 1.4e7 of them, which would take minutes
    problem = balls([100.0], [0.0], 0.1, 1e-7)
    began = time.perf_counter()
    engine, times = hits(problem, 20.0)
    assert time.perf_counter() - began < 20
    assert times.tolist() == pytest.approx([np.sqrt(200.0)], rel=1e-7)
    assert engine.counts.events < 20_000  # crossings of cells, and one hit


@pytest.mark.parametrize("gravity", [DOWN, NONE, (0, 0, 1.0)])
@pytest.mark.parametrize(("speed", "amplitude"), [(0.3, 0.1), (0.3, 0.01), (2.0, 0.1), (0.05, 0.3)])
def test_every_way_into_a_tooth(speed, amplitude, gravity):
    # detects: a period left out or entered late: 80 balls below, at and above the amplitude, up and down
    rng = np.random.default_rng(5)
    heights = np.concatenate([rng.uniform(0, 2 * amplitude, 60), rng.uniform(0, 1, 20)])
    speeds = rng.normal(size=80) * np.repeat([speed, 1.0], 40)
    e = 1.0 if amplitude / speed > 5 else 0.9  # in so long a period bounces of 0.9 collapse
    problem = balls(heights, speeds, speed, amplitude, gravity, e)
    slow = BruteForceHardSpheres(problem)
    slow.advance(20.0, 300)
    engine, times = hits(problem, slow.time + 1e-11, 300)
    assert len(slow.log) >= 8  # without gravity, or away from the floor, each ball is hit once
    assert [i for i, _ in engine.log[0].tolist()] == [i for _, i, _ in slow.log]
    np.testing.assert_allclose(times, [t for t, _, _ in slow.log], rtol=0, atol=1e-12)
    assert engine.sums.work == pytest.approx(slow.work, abs=1e-10)


def test_collapse_on_a_rising_floor_is_an_error_and_the_guard_ends_it():
    # detects: an endless loop within one period of 10 s, where the floor acts like one at rest
    with pytest.raises(SimulationError, match=r"rests on a wall|diverges"):
        Engine(balls([0.5], [0.0], 0.1, 1.0, e=0.5)).advance(9.0, min_progress=1e-6)
    engine = Engine(dataclasses.replace(balls([0.5], [0.0], 0.1, 1.0, e=0.5), guard=1e-3))
    engine.advance(9.0, min_progress=1e-6)
    assert engine.counts.guarded > 1000
    assert 0 < engine.state()[0][0, 2] - R - 0.9 < 1e-5  # it rides on the floor


def test_the_saw_tooth_tends_to_the_fast_floor():
    # detects: another law in the limit: the difference vanishes with the amplitude
    def flight(amplitude: float) -> np.ndarray:
        engine, _ = hits(balls([0.5, 0.3, 0.2], [0.0, 0.1, -0.2], 0.3, amplitude, e=0.8), 3.0)
        return engine.state()[0][:, 2]

    far = {a: np.abs(flight(a) - flight(0.0)).max() for a in (1e-3, 1e-5, 1e-7)}
    assert all(0 < distance < 30 * a for a, distance in far.items()), far


def test_disks_over_a_small_saw_tooth_are_as_high_as_over_the_fast_floor():
    # detects: a saw-tooth that heats more or less than its limit. 0.2882 m; a mean scatters by 0.14 %
    problem = HardSphereProblem.from_scene(scenes.vibrated(300, 1, 0.149, 1e-4, duration=240.0))
    engine, heights = Engine(problem), []
    for t in np.arange(40.0, 240.0, 0.1):
        engine.advance(t)
        heights.append(engine.state()[0][:, 2].mean())
    assert np.mean(heights) == pytest.approx(0.2882, abs=0.002)


@pytest.mark.parametrize("amplitude", [1e-3, 0.02])
def test_balance_of_energy_over_a_million_collisions(amplitude):
    # detects: work computed with another velocity than the floor's, in any one collision
    engine = Engine(HardSphereProblem.from_scene(scenes.vibrated(300, 2, 0.149, amplitude, duration=1e4)))
    begin, t = engine.energy(), 0.0
    while engine.counts.collisions < 1_000_000:
        t += 20.0
        engine.advance(t)
        assert t < 1000
    sums = engine.sums
    assert engine.energy() - begin == pytest.approx(sums.work - sums.dissipated, abs=1e-10 * sums.work)
    assert sums.work > 30 * begin
