"""Limits of event-driven simulation: collapse, rest, jams, grazing, simultaneous events."""

from __future__ import annotations

import math

import numpy as np
import pytest
import warp as wp

import gpudem.event_driven
from gpudem.contact import registry
from gpudem.errors import SceneError, SimulationError
from gpudem.event_driven.engine import EVENTS_PER_LAUNCH, Engine
from gpudem.event_driven.problem import HardSphereProblem
from gpudem.scene import Contact, FlowPlane, Output, Pair, Plane
from gpudem.scene.regions import Disc
from gpudem.scene.walls import Wall
from gpudem.walls import registry as walls
from tests.event_driven import scenes

R = scenes.RADIUS


def engine(scene, guard=0.0, log=100) -> Engine:
    return Engine(HardSphereProblem.from_scene(scene, guard), log=log)


def bouncing(e: float, height: float = 0.5, **more):
    return scenes.scene(
        [[0, 0, height + R]], [[0, 0, 0]], wall_restitution=e, gravity=(0, 0, -1), lo=(-1, -1, 0),
        duration=40.0, **({"sides": ("zlo",)} | more),
    )  # fmt: skip


def test_inelastic_collapse_on_the_floor_is_an_error():
    # detects: an endless loop. Bounces of e = 0.5 add up to t = t1 (1 + e)/(1 - e) = 3 t1
    e = engine(bouncing(0.5))
    with pytest.raises(SimulationError, match=r"particle 1 rests on a wall|event rate diverges") as error:
        e.advance(10.0, min_progress=1e-6)
    assert e.time == pytest.approx(3.0, abs=1e-6)
    assert "guard" in str(error.value) or "time-stepping solver" in str(error.value)


def test_the_guard_ends_a_collapse_on_the_floor():
    # detects: a guard that acts only on pairs. Flights shorter than t_c end elastically, and that is counted
    e = engine(bouncing(0.5), guard=1e-2)
    e.advance(10.0)
    late = e.counts
    e.advance(20.0)
    assert e.counts.guarded - late.guarded == e.counts.walls - late.walls > 1000
    assert 0 < e.state()[0][0, 2] - R < 1e-4


def test_the_budget_ends_a_run():
    # detects: a budget that is ignored, or that holds only to a whole launch
    e = engine(bouncing(0.5), guard=1e-4)
    with pytest.raises(SimulationError, match=r"event budget of 3000 events spent at t = .* collisions"):
        e.advance(10.0, budget=3000)
    assert e.counts.events == 3000


def clump(restitution: float):
    rng = np.random.default_rng(3)
    position = scenes.placed(rng, 60, (-0.25, -1, -0.25), (0.25, 1, 0.25), np.full(60, R), flat=1)
    velocity = -3 * position + rng.normal(size=(60, 3)) * (0.1, 0, 0.1)
    return scenes.scene(position, velocity, restitution=restitution, periodic=(True, False, True),
                        lo=(-0.3, -0.1, -0.3), hi=(0.3, 0.1, 0.3), duration=20.0)  # fmt: skip


@pytest.mark.parametrize("what", ["bouncing", "clump", "bed"])
def test_collapse_is_an_error_by_default(what):
    # detects: a loop that goes on while time moves by the last bit, 1e-11 s in 100 000 events: neither a
    # budget nor a least time is given here
    bed = scenes.vibrated(restitution=0.5, wall_restitution=0.5, duration=30.0)
    e = engine({"bouncing": bouncing(0.5), "clump": clump(0.3), "bed": bed}[what])
    with pytest.raises(SimulationError, match=r"rests on a wall|event rate diverges"):
        e.advance(20.0)
    assert e.counts.events <= 50 * EVENTS_PER_LAUNCH


def test_a_launch_is_bounded_by_the_kernel():
    # detects: an endless loop in the one place that Python cannot interrupt. One launch, to the end of time
    e = engine(clump(1.0))
    e._status[0] = 0
    wp.launch(e._advance, dim=1, inputs=[e._state, 1e300, 777], device="cpu")
    assert e.counts.events == 777


def test_inelastic_collapse_of_a_clump_is_an_error():
    # detects: an endless loop among pairs
    e = engine(clump(0.3))
    with pytest.raises(SimulationError, match="event rate diverges"):
        e.advance(20.0, min_progress=1e-6)
    assert e.counts.events <= 10 * EVENTS_PER_LAUNCH


def test_the_guard_ends_the_collapse_of_a_clump():
    # detects: a guard that regards only one partner, or a time of the last collision that is not stored
    e = engine(clump(0.3), guard=1e-4)
    e.advance(20.0, min_progress=1e-6)
    assert 0 < e.counts.guarded < e.counts.pairs
    assert e.sums.overlap < 1e-9


def test_a_settling_bed_is_an_error_with_advice():
    # detects: endless or silent creep; without a guard a bed of e = 0.5 cannot come to rest
    e = engine(scenes.vibrated(restitution=0.5, wall_restitution=0.5, duration=30.0))
    with pytest.raises(SimulationError, match=r"(?s)(diverges|rests).*time-stepping solver"):
        e.advance(30.0, min_progress=1e-6)
    assert e.time < 30


def test_a_jammed_row_is_an_error():
    # detects: an endless loop where a row fills its width to the last bit: no time between hits
    n = 5
    x = np.column_stack([R * (1 + 2 * np.arange(n)), np.zeros(n), np.full(n, 0.5)])
    jam = scenes.scene(
        x, np.outer(np.cos(np.arange(n)), [1, 0, 0]), sides=("xlo", "xhi"),
        lo=(0, -1, 0), hi=(2 * R * n, 1, 1),
    )  # fmt: skip
    e = engine(jam)
    with pytest.raises(SimulationError, match="event rate diverges"):
        e.advance(1.0, min_progress=1e-6)
    assert e.time < 1e-6


def test_equal_velocities_never_meet():
    # detects: 0/0 in the root. Touching, side by side, and one behind the other
    x = [[0, 0, 0], [2 * R, 0, 0], [0, 0, 3 * R], [0.5, 0, 0.5]]
    e = engine(scenes.scene(x, [[0.1, 0, 0.2]] * 4, gravity=(0, 0, -0.5)))
    e.advance(1.0)
    assert e.counts.collisions == 0
    np.testing.assert_allclose(e.state()[0], np.add(x, [0.1, 0, 0.2 - 0.25]), atol=1e-15)


@pytest.mark.parametrize(("offset", "meets"), [(2 * R - 1e-9, True), (2 * R + 1e-9, False), (2 * R, False)])
def test_grazing(offset, meets):
    # detects: a graze that is missed, one that is seen where there is none, and one that pulls
    e = engine(scenes.scene([[-0.5, 0, 0], [0.0, 0, offset]], [[1, 0, 0], [0, 0, 0]]))
    e.advance(0.9)
    assert e.counts.pairs == meets
    if meets:
        assert e.log[1][0] == pytest.approx(0.5 - math.sqrt(4 * R * R - offset**2), abs=1e-12)
        assert 0 < e.state()[1][0, 2] * -1 < 1e-3
    assert e.energy() == pytest.approx(0.5, abs=1e-15)


def test_simultaneous_collisions():
    # detects: a tie that loses an event: two pairs meet and a third disk comes to a wall at the same instant
    x = [[-0.5, 0, 0.5], [-0.3, 0, 0.5], [0.3, 0, -0.5], [0.5, 0, -0.5], [1 - R - 0.08, 0, 0]]
    v = [[1, 0, 0], [-1, 0, 0], [1, 0, 0], [-1, 0, 0], [1, 0, 0]]
    e = engine(scenes.scene(x, v, sides=("xhi",)))
    e.advance(0.1)
    assert e.counts.pairs == 2
    assert e.counts.walls == 1
    np.testing.assert_allclose(e.log[1], 0.08, atol=1e-15)
    np.testing.assert_allclose(e.state()[1], -np.array(v), atol=1e-15)


def test_newtons_cradle_touching_at_the_start():
    # detects: touching partners that are dropped as overlapping, or that tunnel
    x = np.outer(2 * R * np.arange(4) + [0, 0.1, 0.1, 0.1], [1, 0, 0])
    e = engine(scenes.scene(x, [[1, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0]]))
    e.advance(0.3)
    np.testing.assert_allclose(e.state()[1][:, 0], [0, 0, 0, 1], atol=1e-12)
    assert e.counts.pairs == 3


def test_an_approach_from_touch_is_a_collision_now():
    # detects: a root at t = 0 that is dropped as past
    e = engine(scenes.scene([[0, 0, 0], [2 * R, 0, 0]], [[1, 0, 0], [0, 0, 0]], restitution=0.5))
    e.advance(0.1)
    np.testing.assert_allclose(e.state()[1][:, 0], [0.25, 0.75], atol=1e-15)
    assert e.log[1].tolist() == [0.0]


def test_a_ball_at_rest_on_the_floor_is_an_error():
    # detects: a zero-speed hit at t = 0 that repeats for ever
    with pytest.raises(SimulationError, match="particle 1 rests on a wall at t = 0 s"):
        engine(bouncing(0.9, height=0.0)).advance(1.0)


def test_the_fast_floor():
    # v' = (1 + e) U - e v; catches: U taken once, or the sign of v. And the work it does
    e = engine(bouncing(0.5, height=0.5, walls=scenes.floored(0.3, 0.0)))
    e.advance(1.0 + 1e-9)
    assert e.state()[1][0, 2] == pytest.approx(1.5 * 0.3 + 0.5 * 1.0, abs=1e-8)
    work = (0.95 + 1) * 0.3
    assert e.sums.work == pytest.approx(work, rel=1e-12)
    assert e.sums.dissipated == pytest.approx(work - (0.95**2 - 1) / 2, rel=1e-12)


def test_a_lost_particle_is_an_error():
    # detects: a particle that leaves by an open side unseen
    e = engine(scenes.scene([[0, 0, 0]], [[0, 0, 2]]))
    with pytest.raises(SimulationError, match=r"particle 1 left the domain by zhi at t = 0\.5 s"):
        e.advance(1.0)


OBLIQUE = Plane(name="slope", material="wall", point=(0, 0, -1), normal=(0.1, 0, 1))
DISC = Disc(kind="disc", center=(0, 0, 0), axis=(0, 0, 1), radius=0.1)
REFUSED = {
    "an oblique wall": ({"walls": [OBLIQUE]}, {}, r"walls\.slope\.normal"),
    "flow through a face": (
        {"output": Output(history_every=0.1, flow=(FlowPlane(name="disc", face=DISC),))}, {},
        r"output\.flow: disc\.face",
    ),
    "restart files": ({"output": Output(restart_every=0.1)}, {}, r"output\.restart_every"),
    "a vibration too fast for the clock": (
        {"walls": scenes.floored(1.0, 1e-12)}, {}, r"walls\.floor\.vibration.*amplitude = 0 is that limit",
    ),
    "two walls of a side, one of which moves": (
        {"walls": scenes.floored(1.0, 0.1, ("zlo",))}, {}, r"walls\.floor\.vibration: .* box_zlo",
    ),
    "a tangential restitution without friction": (
        {}, {"tangential_restitution": 0.5}, r"tangential_restitution = 0\.5: the scene has no friction",
    ),
    "a tangential restitution beyond 1": (
        {"friction": 0.3}, {"tangential_restitution": 1.5}, r"tangential_restitution = 1\.5: must be -1 to 1",
    ),
    "rolling friction": (
        {
            "contact": Contact(tangential="off", rolling="cdt"),
            "pairs": [Pair(materials=("ball", "ball"), rolling_friction=0.1)],
        },
        {}, r"pairs\.rolling_friction",
    ),
    "negative guard": ({}, {"guard": -1.0}, "guard = -1 s: must be finite and at least 0 s"),
    "a guard that is no number": ({}, {"guard": math.nan}, "guard = nan s"),
    "a law without a restitution": (
        {
            "contact": Contact(normal="hertz/stiffness", tangential="off"),
            "pairs": [Pair(materials=("ball", "ball"), kn=1e5, kt=1e5, gamma_n=1.0, gamma_t=1.0)],
        },
        {}, r"contact\.normal = 'hertz/stiffness': does not use pairs\.restitution",
    ),
    "no budget": ({}, {"budget": 0}, "budget = 0: must be an integer of 1 or more"),
    "half a budget": ({}, {"budget": 0.5}, r"budget = 0\.5: must be an integer"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_refused_by_name(name):
    # detects: a scene that runs as something else than it says
    changes, options, message = REFUSED[name]
    with pytest.raises(SceneError, match=message):
        gpudem.event_driven.run(scenes.scene([[0, 0, 0.5]], [[0, 0, 0]], **changes), **options)


def test_overlap_at_the_start_is_refused():
    # detects: overlapping pairs, whose collision time is in the past
    with pytest.raises(SceneError, match=r"particles 1 and 2 overlap by 0\.025 diameters"):
        HardSphereProblem.from_scene(_allowing(scenes.scene([[0, 0, 0], [1, 0, 0]], [[0, 0, 0]] * 2)))


def _allowing(scene):
    return scene.replace(
        allow=("time_step", "unusual_units", "overlap"), particles={"position": [[0, 0, 0], [1.95 * R, 0, 0]]}
    )


def test_friction_without_a_rule_is_refused():
    # detects: rough contacts simulated as smooth
    with pytest.raises(SceneError, match=r"pairs\.friction.*tangential_restitution"):
        HardSphereProblem.from_scene(scenes.scene([[0, 0, 0]], [[0, 0, 0]], friction=0.3))


class Ceiling(Wall):
    """A wall of a kind that hard spheres do not have."""

    def elements(self, lo, hi):
        return [self]

    def gap(self, points: np.ndarray) -> np.ndarray:
        return np.ones(len(points))


def test_a_wall_of_another_kind_is_refused_by_name(monkeypatch):
    # detects: a wall of another package that the engine leaves out, so that particles pass through it
    monkeypatch.setitem(walls._registered, "ceiling", walls.WallKind("ceiling", None, Ceiling))
    scene = scenes.scene(
        [[0, 0, 0.5]], [[0, 0, 0]], walls=[Ceiling(kind="ceiling", name="top", material="wall")]
    )
    with pytest.raises(SceneError, match=r"walls\.top\.kind = 'ceiling': hard spheres support only planes"):
        HardSphereProblem.from_scene(scene)


def test_a_law_that_acts_at_a_distance_is_refused(monkeypatch):
    # detects: cohesion of another package that is simulated as if there were none
    hertz = type(registry.law("normal", "hertz"))
    monkeypatch.setattr(hertz, "range", lambda law, inputs, radius: 1e-4)
    scene = scenes.scene([[0, 0, 0.5]], [[0, 0, 0]])
    with pytest.raises(SceneError, match=r"contact\.normal = 'hertz': acts across gaps up to 0\.0001 m"):
        HardSphereProblem.from_scene(scene)


@pytest.mark.parametrize("edge", [1.9 * R, 0.0, -1.0, math.nan, math.inf])
def test_a_cell_smaller_than_a_particle_is_an_error(edge):
    # detects: pairs that are not in neighboring cells and pass through each other; NaN compares as neither
    problem = HardSphereProblem.from_scene(scenes.scene([[0, 0, 0]], [[0, 0, 0]]))
    with pytest.raises(SimulationError, match=r"cell_edge = .* m: must be finite and at least .* 0\.04 m"):
        Engine(problem, edge)


@pytest.mark.parametrize("t", [0.09, math.nan, math.inf])
def test_a_time_in_the_past_or_no_time_is_an_error(t):
    # detects: a clock that runs backwards, or a loop without an end
    e = engine(scenes.scene([[0, 0, 0]], [[0, 0, 0]]))
    e.advance(0.1)
    e.advance(0.1)
    with pytest.raises(SimulationError, match=r"t = .* s: must be finite and at least the present 0\.1 s"):
        e.advance(t)
