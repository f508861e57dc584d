"""The event loop against the brute-force reference: all pairs at every event, no cells, no tree."""

from __future__ import annotations

import numpy as np
import pytest

from gpudem.errors import SimulationError
from gpudem.event_driven.engine import Engine
from gpudem.event_driven.problem import HardSphereProblem
from gpudem.scene import Box, Plane
from tests.event_driven import scenes
from tests.event_driven.brute_force import BruteForceHardSpheres

WALLS = ("xlo", "xhi", "ylo", "yhi", "zlo", "zhi")
GATE = [
    Box(kind="box", name="box", material="wall", sides=("xlo", "xhi", "zlo")),
    Plane(name="gate", material="wall", point=(0.25, 0, 0), normal=(-1, 0, 0), removed_at=0.05),
]
#: Vibrating walls that are no floor: one opposite to gravity, one across it.
CEILING = scenes.floored(0.3, 0.02, ("xlo", "xhi", "zlo"), point=(0, 0, 0.6), normal=(0, 0, -1))
PISTON = scenes.floored(0.2, 0.005, ("zlo", "zhi", "xhi"), point=(0, 0, 0), normal=(1, 0, 0))


def turning(n: int) -> np.ndarray:
    """Spins with surface speeds like those of the centers."""
    return np.random.default_rng(9).normal(size=(n, 3)) / scenes.RADIUS


#: Scene, and how it is run: each axis of the problem is in one of them at least.
SCENES = {
    "disks over a fast floor": (lambda: scenes.vibrated(floor_speed=0.149), {}),
    "disks over a saw-tooth": (lambda: scenes.vibrated(floor_speed=0.149, amplitude=0.012), {}),
    "saw-tooth longer than a flight": (lambda: scenes.vibrated(floor_speed=0.4, amplitude=0.3), {}),
    "saw-tooth ceiling": (lambda: scenes.vibrated(walls=CEILING, hi=(0.2, 0.1, 0.6)), {}),
    "saw-tooth piston without gravity": (
        lambda: scenes.vibrated(
            walls=PISTON, gravity=(0, 0, 0), lo=(0, -0.1, 0), hi=(0.4, 0.1, 0.6), shift=(0.2, 0, 0)
        ),
        {},
    ),
    "disks, guarded": (
        lambda: scenes.vibrated(floor_speed=0.149, restitution=0.7, wall_restitution=0.8), {"guard": 5e-3},
    ),
    "two radii, periodic cube": (lambda: scenes.gas(restitution=0.9), {}),
    "two radii, box, oblique gravity": (
        lambda: scenes.gas(
            periodic=(False, False, False), sides=WALLS, gravity=(3.0, 1.0, -9.81), wall_restitution=0.9
        ),
        {},
    ),
    "periodic in one axis of two cells": (
        lambda: scenes.gas(
            8, edge=0.12, periodic=(True, False, True), sides=("ylo", "yhi"), gravity=(0, -1.0, 0)
        ),
        {},
    ),
    "gate": (lambda: scenes.vibrated(walls=GATE, hi=(0.6, 0.1, 12)), {}),
    "rough, two radii, periodic cube": (
        lambda: scenes.gas(restitution=0.9, friction=0.2, spin=turning(100)), {"tangential_restitution": 0.4},
    ),
    "rough disks over a saw-tooth, guarded": (
        lambda: scenes.vibrated(
            floor_speed=0.149, amplitude=0.012, friction=0.5, wall_friction=0.3, spin=turning(60) * (0, 1, 0),
            restitution=0.7,
        ),
        {"guard": 5e-3, "tangential_restitution": 0.7},
    ),
    "rough, box, oblique gravity": (
        lambda: scenes.gas(
            periodic=(False, False, False), sides=WALLS, gravity=(0.6, 0.2, -1.5), wall_restitution=0.95,
            friction=0.1, wall_friction=0.4, spin=turning(100),
        ),
        {"tangential_restitution": -0.5},
    ),
}  # fmt: skip
#: Chaos multiplies rounding with every collision of a particle: few particles, fewer collisions.
COLLISIONS = {"periodic in one axis of two cells": 35}


def both(name: str, collisions: int, **engine: float) -> tuple[Engine, BruteForceHardSpheres]:
    make, how = SCENES[name]
    problem = HardSphereProblem.from_scene(make(), **how)
    slow = BruteForceHardSpheres(problem)
    slow.advance(1.0, collisions)
    quick = Engine(problem, log=collisions, **engine)
    quick.advance(slow.time + 1e-11)  # the last collision is in
    return quick, slow


def sequence(engine: Engine) -> list[tuple[int, int]]:
    """The pairs of all logged collisions, the lower index first."""
    return [(a, b) if b < 0 else (min(a, b), max(a, b)) for a, b in engine.log[0].tolist()]


@pytest.mark.parametrize("name", SCENES)
def test_same_collisions_at_the_same_times(name):
    # detects: an event lost by cells, tree, lazy invalidation or periodic images; another collision rule
    count = COLLISIONS.get(name, 200)
    quick, slow = both(name, count)
    assert len(slow.log) == count
    assert sequence(quick) == [(i, j) for _, i, j in slow.log]
    np.testing.assert_allclose(quick.log[1], [t for t, _, _ in slow.log], rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", SCENES)
def test_same_energy_balance(name):
    # detects: sums of work, dissipation or guarded collisions that differ from what happens
    quick, slow = both(name, COLLISIONS.get(name, 200))
    assert quick.sums.work == pytest.approx(slow.work, abs=1e-9)
    assert quick.sums.dissipated == pytest.approx(slow.dissipated, abs=1e-9)
    assert quick.counts.guarded == slow.guarded
    assert quick.energy() == pytest.approx(slow.energy(), abs=1e-9)
    np.testing.assert_allclose(quick.angular_velocity, slow.angular_velocity, rtol=0, atol=1e-7)


def test_spins_change():
    # or rough spheres were compared as smooth ones
    quick, _ = both("rough, two radii, periodic cube", 200)
    assert 0.5 < np.abs(quick.angular_velocity - quick.problem.angular_velocity).max() * scenes.RADIUS < 10


@pytest.mark.parametrize("name", [name for name in SCENES if "guarded" in name])
def test_the_guard_acts(name):
    # or the comparison above would hold without one
    quick, _ = both(name, 200)
    assert 5 < quick.counts.guarded < 150


def test_walls_are_hit():
    # at each side of the box, or its walls were not compared
    quick, _ = both("two radii, box, oblique gravity", 200)
    assert set(quick.log[0][:, 1]) >= {-2 - side for side in range(6)}


def test_the_gate_holds_until_it_is_removed():
    # detects: a gate that is never removed, or walls behind it that are not predicted afterwards
    quick, slow = both("gate", 200)
    sides = {(partner, t < 0.05) for t, _, partner in slow.log if partner == -3}
    assert sides == {(-3, True)}  # the gate was hit, the wall behind it not yet
    assert slow.time > 0.08
    quick.advance(0.8)
    assert quick.state()[0][:, 0].max() > 0.5


@pytest.mark.parametrize("cells", [1.0, 2.6, 4.0, 1000.0])
@pytest.mark.parametrize("name", list(SCENES)[:3])
def test_independent_of_the_size_of_the_cells(name, cells):
    # detects: a pair that comes into range unnoticed after a crossing; 1000: one cell, no crossings
    make, how = SCENES[name]
    problem = HardSphereProblem.from_scene(make(), **how)
    one, other = Engine(problem, log=200), Engine(problem, cells * 2 * scenes.RADIUS, log=200)
    assert one.cells.prod() != other.cells.prod()
    one.advance(0.3)
    other.advance(0.3)
    assert len(one.log[0]) == 200
    assert sequence(one) == sequence(other)
    np.testing.assert_allclose(one.log[1], other.log[1], rtol=0, atol=1e-12)


@pytest.mark.parametrize("search", ["scan", "pairs"])
@pytest.mark.parametrize("name", [name for name in SCENES if "periodic" not in name])
def test_the_slow_searches_find_the_same_events(name, search):
    # detects: a search that computes something else than the one it is compared with
    make, how = SCENES[name]
    problem = HardSphereProblem.from_scene(make(), **how)
    one, other = Engine(problem, log=200), Engine(problem, log=200, search=search)
    one.advance(0.3)
    other.advance(0.3)
    assert len(one.log[0]) >= 100
    assert sequence(one) == sequence(other)
    np.testing.assert_allclose(one.log[1], other.log[1], rtol=0, atol=0 if search == "scan" else 1e-12)


def test_all_pairs_refuse_periodic_sides_and_lose_no_particle():
    # detects: ignored images; a particle that leaves unnoticed, as without cells there are no crossings
    with pytest.raises(SimulationError, match="periodic sides are not supported"):
        Engine(HardSphereProblem.from_scene(scenes.gas(8, edge=0.12)), search="pairs")
    x, v = [[0, 0, 0], [-0.5, 0, 0], [-0.4, 0, 0]], [[0, 0, 2], [0, 0, 0], [-0.1, 0, 0]]
    with pytest.raises(SimulationError, match=r"particle 1 left the domain by zhi"):
        Engine(HardSphereProblem.from_scene(scenes.scene(x, v)), search="pairs").advance(1.0)


def test_independent_of_the_number_of_stops():
    # detects: a stop that changes local times or predictions, and so the rounding
    problem = HardSphereProblem.from_scene(scenes.vibrated(floor_speed=0.149))
    one, other = Engine(problem), Engine(problem)
    one.advance(1.0)
    for k in range(1, 101):
        other.advance(k / 100)
        other.state()
    np.testing.assert_array_equal(one.state(), other.state())


@pytest.mark.parametrize("name", SCENES)
def test_nothing_ever_overlaps(name):
    # detects: a missed collision long after the first 200; overlaps of all pairs, not the loop's own sum
    make, how = SCENES[name]
    problem = HardSphereProblem.from_scene(make(), **how)
    quick, look = Engine(problem), BruteForceHardSpheres(problem)
    for k in range(1, 101):
        quick.advance(k / 100)
        look.x, _ = quick.state()
        assert look.closest() < 1e-9
        for side in np.flatnonzero(problem.segments[-1][2].present):
            walls = problem.segments[-1][2]
            depth = problem.radius - (look.x[:, side // 2] - walls.position[side]) * (1 - 2 * (side % 2))
            if walls.amplitude[side] > 0:
                depth += walls.speed[side] * (k / 100 % (walls.amplitude[side] / walls.speed[side]))
            assert depth.max() < 1e-9 * scenes.RADIUS
    assert quick.counts.pairs > 100
    assert quick.sums.overlap < 1e-9
