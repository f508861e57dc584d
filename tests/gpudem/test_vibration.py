"""Vibrating planes: one ball against closed forms, a bed against itself, the work of the floor.

Catches: the floor's speed left out of the damping or of the overlap, a touch whose age is lost at a rebuild,
a restart or between cores, a saw-tooth out of phase or unknown to the neighbour list, work of the wrong sign.
"""

from typing import Any

import numpy as np
import pytest

from gpudem.driver import simulate as run
from gpudem.errors import SceneError
from gpudem.scene import Scene
from gpudem.scene.time_step import contact_time
from gpudem.solver.solver import Solver
from gpudem.solver.spec import Spec
from tests.gpudem.beds import falling_bed, finish, same
from tests.gpudem.test_restart import stopped_and_resumed

pytestmark = pytest.mark.long

SPEED, MEETING, RADIUS = 0.4, 0.7, 0.01


def ball(e: float, steps: int = 400, vibration: dict[str, float] | None = None, **changes: Any) -> Scene:
    """A ball half a radius above a floor, coming down at MEETING without gravity; `steps` a contact."""
    data: dict[str, Any] = {
        "name": "ball",
        "materials": {"ball": {"young": 1e8, "poisson": 0.3, "density": 2000.0}},
        "pairs": [{"materials": ("ball", "ball"), "restitution": e, "friction": 0.0}],
        "particles": {
            "source": "explicit", "material": "ball", "radius": RADIUS,
            "position": [(0.0, 0.0, 1.5 * RADIUS)], "velocity": [(0.1, 0.0, -MEETING)],
        },
        "walls": [{"kind": "plane", "name": "floor", "material": "ball", "point": (0, 0, 0),
                   "normal": (0, 0, 1), "vibration": vibration}],
        "domain": {"lo": (-0.1, -0.1, 0), "hi": (0.1, 0.1, 0.2)},
        "time": {"step": 1e-6, "duration": 0.012},
    }  # fmt: skip
    scene = Scene(**{**data, **changes})
    step = contact_time(scene) / steps
    return scene.replace(time={"step": step}, output={"trace_every": 10 * step, "history_every": step})


FAST = {"speed": SPEED, "amplitude": 0.0}


@pytest.mark.parametrize("e", [1.0, 0.8])
def test_fast_floor(e):
    """The hard limit v' = (1 + e) U - e v, v < 0; what the ball gains and loses is the work of the floor."""
    made = run(ball(e, vibration=FAST))
    leaves = made.trace["velocity"][-1, 0]
    want = (1 + e) * SPEED + e * MEETING
    assert leaves[2] == pytest.approx(want, rel=1e-5 if e == 1 else 1e-3)  # second, first order in the step
    assert leaves[0] == pytest.approx(0.1, rel=1e-12)
    history = made.history
    contacts = history.contacts.to_numpy()
    assert contacts.max() == 1
    assert np.count_nonzero(np.diff(contacts) == 1) == 1  # no second touch
    mass = 2000 * 4 / 3 * np.pi * RADIUS**3
    impulse = mass * (leaves[2] + MEETING)
    assert history.work.iloc[-1] == pytest.approx(SPEED * impulse, rel=1e-12)
    gain = (history.kinetic_energy.iloc[-1] - history.kinetic_energy.iloc[0]) / (0.5 * mass)
    assert gain == pytest.approx(want**2 - MEETING**2, rel=1e-4 if e == 1 else 1e-2)


def test_order_of_the_step():
    """Elastic hits converge in second order from the touch on, wherever in a step it comes."""
    errors = []
    for steps in (100, 200, 400):
        leaves = run(ball(1.0, steps, FAST)).trace["velocity"][-1, 0, 2]
        errors.append(abs(leaves - 2 * SPEED - MEETING))
    assert max(errors) < 2e-4
    assert errors[2] < errors[0] / 3


@pytest.mark.parametrize("steps", [50, 140, 280])
def test_floor_rises_from_the_touch_on(steps):
    """The ball is let go where the floor has come to, to a small part of what it rises in one step.

    Catches a floor that rises from the end of the step in which they touch, or from its beginning.
    """
    made = run(ball(1.0, steps, FAST))
    mass, stiffness = 2000 * 4 / 3 * np.pi * RADIUS**3, 1e8 / (2 * (1 - 0.3**2))
    lasts = 2.868266 * (mass**2 / (RADIUS * stiffness**2 * (SPEED + MEETING))) ** 0.2  # Hertz
    touch, end = 0.5 * RADIUS / MEETING, made.trace["time"][-1]
    want = RADIUS + SPEED * lasts + (2 * SPEED + MEETING) * (end - touch - lasts)
    error = made.trace["position"][-1, 0, 2] - want
    assert abs(error) < 0.05 * SPEED * made.scene.time.step


def test_slow_limit_is_a_plain_wall():
    """Catches a floor that acts otherwise than by its speed."""
    plain = run(ball(0.8)).trace
    slow = run(ball(0.8, vibration={"speed": 1e-9})).trace
    assert np.abs(plain["velocity"] - slow["velocity"][: len(plain["velocity"])]).max() < 1e-7


@pytest.mark.parametrize("e", [1.0, 0.8])
def test_saw_tooth(e):
    """A ball meets the tooth in a known phase: it rises for 25 ms; they meet where both have come to."""
    amplitude = 0.01
    made = run(ball(e, vibration={"speed": SPEED, "amplitude": amplitude}))
    time, z = made.trace["time"], made.trace["position"][:, 0, 2]
    want = (1 + e) * SPEED + e * MEETING
    assert made.trace["velocity"][-1, 0, 2] == pytest.approx(want, rel=1e-4 if e == 1 else 1e-3)
    touch = 0.5 * RADIUS / (MEETING + SPEED)
    assert touch < amplitude / SPEED
    force = made.trace["force"][:, 0, 2] != 0
    first = float(time[np.argmax(force)])
    assert touch < first < touch + 11 * made.scene.time.step
    assert z.min() > RADIUS + SPEED * touch - 0.2 * RADIUS


def test_saw_tooth_snaps_back():
    """In a later tooth the ball is met as far up as the phase says, and no earlier."""
    amplitude = 0.001
    made = run(ball(1.0, vibration={"speed": SPEED, "amplitude": amplitude}))
    first = float(made.trace["time"][np.argmax(made.trace["force"][:, 0, 2] != 0)])
    period = amplitude / SPEED
    place = 1.5 * RADIUS - MEETING * np.arange(0, 0.012, 1e-6) - RADIUS
    tooth = SPEED * np.mod(np.arange(0, 0.012, 1e-6), period)
    touch = 1e-6 * np.argmax(place <= tooth)
    assert touch > 2 * period
    assert touch - 1e-6 < first < touch + 11 * made.scene.time.step


BED = falling_bed().model_dump()
OUTPUT = {"frames_every": 0.01, "history_every": 0.001, "restart_every": 0.005}


def shaken_bed(count: int = 600, amplitude: float = 0.0, **changes: Any) -> Scene:
    """The falling bed over a floor that vibrates; a second plane vibrates across it."""
    vibration = {"speed": 0.3, "amplitude": amplitude}
    box = {**BED["walls"][0], "sides": ("xlo", "xhi", "ylo", "yhi", "zhi")}
    floor = {"kind": "plane", "name": "floor", "material": "wall", "point": (0, 0, 0), "normal": (0, 0, 1)}
    side = {
        "kind": "plane",
        "name": "side",
        "material": "wall",
        "point": (-0.0005, 0, 0),
        "normal": (1, 0, 0),
    }
    walls = [box, BED["walls"][1], {**floor, "vibration": vibration},
             {**side, "vibration": {"speed": 0.1, "amplitude": 0.001}}]  # fmt: skip
    return falling_bed(count, walls=walls, **changes)


@pytest.mark.parametrize("amplitude", [0.0, 0.0007])
@pytest.mark.parametrize("precision", ["float64", "mixed"])
def test_two_parts_are_one_run(tmp_path, amplitude, precision):
    scene = shaken_bed(amplitude=amplitude, output=OUTPUT, solver={"precision": precision})
    whole = run(scene, tmp_path / "whole")
    parts = stopped_and_resumed(scene, tmp_path / "parts", at=scene.steps(0.0355))
    assert parts.notes["resumed_at_step"] == scene.steps(0.035)
    for a, b in zip(whole.frames, parts.frames, strict=True):
        same(a, b)
    assert whole.history.equals(parts.history)
    assert whole.history.work.iloc[-1] > 1e-6
    assert whole.notes["rebuilds"] > 10


@pytest.mark.parametrize("options", [{"threads": 2}, {"threads": 1, "chunk": 7}, {"threads": 2, "chunk": 32}])
@pytest.mark.parametrize("amplitude", [0.0, 0.0007])
def test_bit_identical(options, amplitude):
    """Cores, and launches between two looks: a saw-tooth moves within a chunk too."""
    scene, ends = shaken_bed(2500, amplitude, time={"step": 4e-5, "duration": 0.04}), []
    for more in ({"threads": 1}, options):
        simulation = Solver(scene, **more)
        ends.append((finish(simulation), simulation.wall_work()))
    (one, work), (other, other_work) = ends
    same(one, other)
    assert work == pytest.approx(other_work, rel=1e-12)


@pytest.mark.parametrize("amplitude", [0.0, 0.0007])
def test_rebuilds_change_nothing(amplitude):
    """A skin so thin that the list is rebuilt all the time, touches and all."""
    ends = []
    for skin in (1e-5, 1e-3):
        scene = shaken_bed(60, amplitude, time={"step": 2e-5, "duration": 0.02}, solver={"skin": skin},
                           output={"history_every": 0.02})  # fmt: skip
        ends.append(run(scene))
    few, many = (r.history.iloc[-1] for r in ends[::-1])
    assert ends[0].notes["rebuilds"] > 5 * ends[1].notes["rebuilds"]
    assert many.work == pytest.approx(few.work, rel=1e-9)
    assert many.centre_z == pytest.approx(few.centre_z, rel=1e-9)


@pytest.mark.parametrize("precision", ["float32", "mixed"])
def test_precision(precision):
    """The same hit in every precision."""
    made = run(ball(0.8, 100, FAST), precision=precision).trace["velocity"][-1, 0, 2]
    assert made == pytest.approx(run(ball(0.8, 100, FAST)).trace["velocity"][-1, 0, 2], rel=2e-4)


def test_steady_power():
    """The floor carries the weight: its power is m g U, bounce by bounce, with e < 1."""
    scene = ball(0.8, 100, FAST, gravity=(0, 0, -200.0), time={"step": 1e-6, "duration": 0.4})
    made = run(scene.replace(output={"history_every": 100 * scene.time.step, "trace_every": None}))
    rows = made.history[made.history.time > 0.1]
    power = (rows.work.iloc[-1] - rows.work.iloc[0]) / (rows.time.iloc[-1] - rows.time.iloc[0])
    weight = 2000 * 4 / 3 * np.pi * RADIUS**3 * 200
    assert rows.kinetic_energy.max() > 0
    assert power == pytest.approx(weight * SPEED, rel=0.03)
    late = rows[rows.time > 0.3]
    assert 0.9 * RADIUS < late.centre_z.min() < 1.1 * RADIUS  # the floor waits where it was
    assert late.centre_z.max() > 2 * RADIUS


def test_only_who_vibrates_pays():
    plain, shaken = Spec.of(ball(0.8)), Spec.of(ball(0.8, vibration=FAST))
    assert not plain.moving_walls
    assert shaken.moving_walls
    for scene, there in ((ball(0.8), False), (ball(0.8, vibration=FAST), True)):
        simulation = Solver(scene)
        simulation.start()
        assert ("particles.rise" in simulation.memory_bytes()) is there
    assert run(ball(0.8)).history.get("work") is None


def refused(**changes: Any) -> str:
    with pytest.raises(SceneError) as caught:
        ball(0.8, **changes)
    return str(caught.value)


def test_refused():
    """By name, each with what to do."""
    assert "solver.integrator = 'path' knows no moving plane" in refused(
        vibration=FAST, solver={"integrator": "path"}
    )
    assert "1e-05 s is 2.5 time steps; allowed: >= 10, or amplitude = 0" in refused(
        vibration={"speed": 0.4, "amplitude": 4e-6}, time={"step": 4e-6, "duration": 0.01}
    )
    fast = {"vibration": {"speed": 9e3}, "allow": ["time_step"]}
    assert "moves 0.018 m in a step; allowed: < the smallest radius, 0.01 m" in refused(
        **fast, time={"step": 2e-6, "duration": 0.01}
    )


def test_resumed_in_mid_contact():
    """A ball on the fast floor at the restart: who forgets the rise lets it fall through the touch again."""
    scene = ball(0.8, 100, FAST)
    whole = Solver(scene)
    whole.start()
    for _ in range(scene.n_steps):
        whole.advance(1)
        # its list has one entry: the floor
        if whole.state.particles.rise.numpy()[0] > 20 * 0.4 * scene.time.step:
            break
    else:
        raise AssertionError("the ball never came onto the floor")
    other = Solver(scene)
    other.load_state_dict(whole.state_dict())
    for s in (whole, other):
        s.advance(200)
        s.write_step(last=True)
    for k, v in whole.frame().items():
        assert np.array_equal(v, other.frame()[k]), k
    assert whole.wall_work() == other.wall_work() > 0
