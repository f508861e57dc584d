"""Force, torque and work of walls in the history: against weights, levers and energies."""

from __future__ import annotations

import numpy as np
import pytest

import gpudem
from gpudem.errors import SceneError
from gpudem.output.vtu import read_vtu_and_cells
from gpudem.scene import Scene
from gpudem.scene.motion import Servo
from gpudem.walls.motion import ServoPath

R, DT = 0.05, 2e-5
FLAT = {
    "vertices": [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]],
    "triangles": [[0, 1, 2], [0, 2, 3]],
}


def scene(walls: list[dict], position: list, steps: int = 20000, output: dict | None = None, **more) -> Scene:
    """Balls over walls, with damping and friction."""
    names = tuple(wall["name"] for wall in walls)
    more = {"gravity": (0.0, 0.0, -9.81)} | more
    particles = {"source": "explicit", "position": position, "radius": R, "material": "a"}
    return Scene(
        name="loads", materials={"a": {"young": 5e6, "poisson": 0.3, "density": 2500.0}},
        pairs=[{"materials": ("a", "a"), "restitution": 0.5, "friction": 0.4, "rolling_friction": 0.05}],
        particles=particles | more.pop("particles", {}),
        walls=[{"material": "a"} | wall for wall in walls],
        domain={"lo": (-2, -2, -1), "hi": (2, 2, 2)}, time={"step": DT, "duration": steps * DT},
        output={"history_every": steps * DT / 10, "wall_forces": names} | (output or {}), **more,
    )  # fmt: skip


def floor(kind: str) -> dict:
    """A horizontal wall of a kind, at z = 0."""
    if kind == "plane":
        return {"kind": "plane", "name": "floor", "point": (0, 0, 0), "normal": (0, 0, 1)}
    return {"kind": "mesh", "name": "floor", **FLAT}


def vector(history, quantity: str, wall: str) -> np.ndarray:
    """Columns of a quantity, shape (rows, 3)."""
    return history[[f"{quantity}_{wall}_{axis}" for axis in "xyz"]].to_numpy()


@pytest.mark.parametrize("rolling", ["off", "cdt"])
@pytest.mark.parametrize("kind", ["plane", "mesh"])
def test_balls_at_rest(kind, rolling):
    """Weights and their levers about the origin; catches a wrong sign, a force counted at the wrong wall, a
    lever from the ball's centre, the entry of a triangle taken for a wall."""
    walls = [floor(kind), {"kind": "plane", "name": "side", "point": (-1.5, 0, 0), "normal": (1, 0, 0)}]
    at = [[0.31, 0.2, 0.0498], [-0.2, -0.4, 0.0499]]
    s = scene(walls, at, contact={"rolling": rolling})
    history = gpudem.simulate(s).history
    weight = np.array([[0, 0, -9.81 * m] for m in s.masses])
    assert vector(history, "force", "floor")[-1] == pytest.approx(weight.sum(axis=0), abs=1e-3)
    moment = np.cross(np.array(at) * [1, 1, 0], weight).sum(axis=0)
    assert vector(history, "torque", "floor")[-1] == pytest.approx(moment, abs=1e-3)
    assert not vector(history, "force", "side").any()
    assert not history.work_floor.any()


def test_force_of_balls_that_come():
    """Of which the history has rows before and after each: all weights in the end. Detects a sum over the
    balls and the list of an earlier row; lists have two sides, so two balls come one after the other.
    """
    come = {"kind": "list", "time": [0.1, 0.16], "radius": [R, R], "material": "a",
            "position": [[-0.2, -0.4, 0.0499], [-0.6, 0.3, 0.0499]]}  # fmt: skip
    walls = [floor("mesh"), {"kind": "plane", "name": "side", "point": (-1.5, 0, 0), "normal": (1, 0, 0)}]
    s = scene(walls, [[0.31, 0.2, 0.0498]], insert=[come], contact={"rolling": "off"})
    force = vector(gpudem.simulate(s).history, "force", "floor")[:, 2]
    assert force[2] == pytest.approx(-9.81 * s.masses[0], rel=0.2)
    assert force[-1] == pytest.approx(-9.81 * s.masses.sum(), rel=0.01)


@pytest.mark.parametrize("kind", ["plane", "mesh"])
def test_friction_on_a_belt(kind):
    """A ball sliding on a belt: the belt is dragged back by mu N, and its work is that force times its speed.

    Catches work taken from the ball's velocity, a belt without velocity, friction on the wall with the sign
    of that on the ball.
    """
    belt, every = floor(kind) | {"surface_velocity": (3.0, 0, 0)}, {"history_every": DT}
    s = scene([belt], [[0.0, 0, R - 2e-5]], steps=2000, output=every)
    history = gpudem.simulate(s).history
    force = vector(history, "force", "floor")
    sliding = history.time > 0
    assert force[sliding, 0] == pytest.approx(0.4 * force[sliding, 2], rel=1e-9)
    impulse = -force[1:, 0].sum() * DT
    assert impulse > 0.1
    assert history.work_floor.iloc[-1] == pytest.approx(3.0 * impulse, rel=1e-12)


def test_work_is_the_energy_gained():
    """An elastic ball on an oscillating plate, without gravity: it gains the plate's work, to second order
    in the step. Catches a force and a velocity of different steps, a motion without work."""
    errors = []
    for refine in (1, 2):
        errors.append(_gain(refine))
    assert errors[0] < 1e-3
    assert errors[1] < 0.4 * errors[0]


def test_work_of_two_walls():
    """Two belts, each with its ball, the second twice as fast: the work of each is its own, and the sum is
    that of the history. Catches work booked on another wall."""
    walls = [
        floor("plane")
        | {"name": name, "point": (0, 0, z), "normal": (0, 0, n), "surface_velocity": (v, 0, 0)}
        for name, z, n, v in (("low", 0, 1, 1.0), ("high", 1, -1, 2.0))
    ]
    at = [[0, 0, R - 2e-5], [0.5, 0, 1 - R + 2e-5]]
    s = scene(walls, at, steps=500, gravity=(0.0, 0.0, 0.0), output={"history": ("work",)})
    last = gpudem.simulate(s).history.iloc[-1]
    assert last.work_low > 0
    assert last.work_high > 1.5 * last.work_low
    assert last.work == pytest.approx(last.work_low + last.work_high, rel=1e-12)


def _gain(refine: int) -> float:
    s = Scene(
        name="work", materials={"a": {"young": 5e6, "poisson": 0.3, "density": 2500.0}},
        pairs=[{"materials": ("a", "a")}],
        particles={"source": "explicit", "position": [[0.1, 0, R + 0.02]], "velocity": [[0, 0, -1.0]],
                   "radius": R, "material": "a"},
        walls=[{"kind": "mesh", "name": "floor", "material": "a", **FLAT,
                "motion": [{"type": "oscillate", "amplitude": (0, 0, 0.002), "period": 0.05}]}],
        domain={"lo": (-2, -2, -1), "hi": (2, 2, 2)}, time={"step": DT / refine, "duration": 0.06},
        output={"history_every": 0.06, "wall_forces": ("floor",)},
    )  # fmt: skip
    history = gpudem.simulate(s).history
    assert history.contacts.iloc[-1] == 0
    gained = history.kinetic_energy.iloc[-1] - history.kinetic_energy.iloc[0]
    assert abs(gained) > 0.1 * history.kinetic_energy.iloc[0]
    return abs(history.work_floor.iloc[-1] / gained - 1)


def test_turning_floor_torque_point():
    """The torque about the point of the first turn: friction on a ball that a turntable carries has no lever
    along the axis but r mu N; a reference far off changes it by d x F. Catches a point that does not move."""
    turn = {"motion": [{"type": "rotate", "axis": (0, 0, 1), "point": (0.2, 0, 0), "period": 2.0}]}
    at, found = [[0.7, 0, R - 1e-5]], {}
    for reference in (None, (1.2, 0.0, 0.0)):
        s = scene([floor("mesh") | turn | {"reference": reference}], at, steps=1000)
        found[reference] = gpudem.simulate(s).history
    force = vector(found[None], "force", "floor")
    angle = 2 * np.pi * found[None].time.to_numpy() / 2.0
    shift = np.stack(
        [np.cos(angle), np.sin(angle), 0 * angle], axis=1
    )  # 1 m from the axis, turned with the wall
    away = vector(found[None], "torque", "floor") - np.cross(shift, force)
    assert vector(found[(1.2, 0.0, 0.0)], "torque", "floor") == pytest.approx(away, abs=1e-9)
    assert np.abs(force[1:, 1]).min() > 0.1


def test_unknown_wall():
    with pytest.raises(SceneError, match=r"output.wall_forces: 'flor' is no wall; did you mean 'floor'"):
        scene([floor("plane")], [[0, 0, 0.06]], output={"wall_forces": ("flor",)})


def test_a_servo_beside_another_motion():
    """Which would be left out: the wall follows the force alone."""
    servo = {"type": "servo", "axis": (0, 0, -1), "target": 40.0, "velocity_limit": 0.05}
    motions = [servo, {"type": "linear", "velocity": (1, 0, 0)}]
    with pytest.raises(SceneError, match=r"walls: floor.motion: a servo beside other motions"):
        scene([floor("mesh") | {"motion": motions}], [[0, 0, 0.06]])


def test_without_a_history():
    with pytest.raises(SceneError, match=r"wall_forces: has no effect without output\.history_every"):
        scene([floor("plane")], [[0, 0, 0.06]], output={"history_every": None})


def press(steps: int = 15000, **gains) -> Scene:
    """A plate that presses a ball on the floor with 40 N."""
    servo = {"type": "servo", "axis": (0, 0, -2), "target": 40.0, "velocity_limit": 0.2} | gains
    plate = {"kind": "mesh", "name": "plate", **FLAT, "move": (0, 0, 2 * R + 1e-4), "motion": [servo]}
    every = {"history_every": DT, "restart_every": 0.07}
    return scene([floor("plane"), plate], [[0.02, 0.01, R - 1e-5]], steps=steps, output=every)


@pytest.mark.long
@pytest.mark.parametrize(("ki", "kd"), [(0.0, 0.0), (0.5, 1e-6)])
def test_a_servo_reaches_its_force(ki, kd):
    """And moves as the controller says, from the forces of the history; catches a force of the wrong step or
    sign, a limit not kept, a position that is not the sum of the velocities."""
    history = gpudem.simulate(press(kp=0.4, ki=ki, kd=kd)).history
    force, z = history.force_plate_z.to_numpy(), history.position_plate_z.to_numpy()
    assert force[-1] == pytest.approx(40.0, rel=1e-3 if ki == 0 else 0.1)  # the integral decays slowly
    error = 1 - force / 40.0
    wanted = 0.4 * error[1:] + ki * np.cumsum(error[1:]) * DT
    wanted[1:] += kd * np.diff(error[1:]) / DT
    velocity = np.concatenate([[0.0], 0.2 * np.clip(wanted, -1, 1)[:-1]])
    assert z[1:] - z[0] == pytest.approx(-np.cumsum(velocity) * DT, abs=1e-12)
    assert history.work_plate.iloc[-1] > 0


@pytest.mark.long
def test_a_servo_resumes_bit_for_bit(tmp_path):
    """Catches a controller whose sum, last error or place is not in the restart file."""
    s = press(steps=8000, ki=0.5, kd=1e-6)
    whole = gpudem.simulate(s, tmp_path / "whole")
    with pytest.raises(KeyboardInterrupt):
        gpudem.simulate(s, tmp_path / "cut", hooks=[gpudem.every(0.1, _stop)])
    resumed = gpudem.resume(tmp_path / "cut")
    assert resumed.history.equals(whole.history)


def test_frames_show_where_a_servo_has_moved_its_wall(tmp_path):
    """As the history does; catches a plate that is drawn at its first place."""
    one = press(steps=4000).replace(output={"frames_every": 1000 * DT, "history_every": 1000 * DT})
    run = gpudem.simulate(one, tmp_path)
    moved = run.history.position_plate_z - run.history.position_plate_z.iloc[0]
    for step, way in zip(run.history.step, moved, strict=True):
        points, _ = read_vtu_and_cells(tmp_path / "frames" / f"walls_{step:09d}.vtu")
        assert points["points"][-1, 2] == pytest.approx(2 * R + 1e-4 + way, abs=1e-15)
    assert abs(moved.iloc[-1]) > 1e-6


def test_place_of_a_servo_when_its_list_was_made():
    """Also once later steps are done, as after a restart: how far it has moved since then decides when the
    list is made anew. Catches the last place taken for that of the list."""
    servo = Servo(type="servo", axis=(0, 0, -2), target=40.0, velocity_limit=0.2, kp=1.0)
    path = ServoPath(servo, DT)
    for step in range(1, 6):
        if step == 3:
            path.list_made(step)
        path.advance(step, np.zeros(3))
    way = -0.2 * DT * np.arange(6)
    assert path.at(3, 1).shift[0] == pytest.approx([0, 0, way[2]], abs=1e-15)
    assert path.at(5, 2).shift[:, 2] == pytest.approx([way[4], way[5]], abs=1e-15)


def test_integral_of_a_servo_at_its_limit_by_the_rule_of_liggghts():
    """Is reset so that the next steps go the other way; by the other rule it grows on. Catches a reset of
    another sign, without the proportional part, or under the rule `unique`."""
    servo = Servo(type="servo", axis=(0, 0, -1), target=40.0, velocity_limit=0.2, kp=1.5, ki=5.0)
    speeds = {}
    for liggghts in (False, True):
        path = ServoPath(servo, DT, liggghts)
        for step in range(1, 4):
            path.advance(step, np.zeros(3))
            speeds[liggghts, step + 1] = -path.at(step + 1, 1).velocity[0, 2]
    assert [speeds[False, step] for step in (2, 3, 4)] == [0.2, 0.2, 0.2]
    after = [0.2 * (1.5 + 5 * ((-1 - 1.5) / 5 + k * DT)) for k in (1, 2)]
    assert [speeds[True, step] for step in (2, 3, 4)] == pytest.approx([0.2, *after], rel=1e-12)


def test_velocity_of_a_servo_in_a_later_set_up():
    """By the rule of LIGGGHTS that of the step to come, else that of the step done."""
    servo = Servo(type="servo", axis=(0, 0, -1), target=40.0, velocity_limit=0.2, kp=0.5)
    for liggghts, speed in ((False, 0.0), (True, 0.1)):
        path = ServoPath(servo, DT, liggghts)
        path.advance(1, np.zeros(3))
        assert -path.at(1, 1).velocity[0, 2] == speed
        assert path.at(1, 1).shift[0, 2] == 0.0


def _stop(sim) -> None:
    if sim.time > 0.08:
        raise KeyboardInterrupt


def test_stress_on_triangles(tmp_path):
    """Balls that slide on a belt of two triangles, one on each, under a roof that nothing touches: the
    pressure adds up to the force, and the shear stress is mu times it.

    Detects the force on a particle for that on the wall, a triangle's force at another, half of an area, zero
    for a wall that nobody asked for.
    """
    roof = {"kind": "mesh", "name": "roof", **FLAT, "move": (0, 0, 1.0)}
    belt = floor("mesh") | {"surface_velocity": (30.0, 0, 0)}
    output = {"wall_forces": ("floor",), "wall_stress": ("floor",), "history_every": DT}
    s = scene([roof, belt], [[0.9, -0.8, 0.0498], [-0.3, 0.4, 0.0499]], steps=500, output=output)
    run = gpudem.simulate(s, tmp_path)
    cells, force = run.frames.walls(-1), vector(run.history, "force", "floor")[-1]
    assert cells["wall"].tolist() == [0, 0, 1, 1]
    assert np.isnan(cells["pressure"][:2]).all()
    assert np.isnan(cells["shear_stress"][:2]).all()
    pressure, shear = cells["pressure"][2:], cells["shear_stress"][2:]
    weights = run.frames[-1]["force"][:, 2] + 9.81 * s.masses
    assert pressure * 2.0 == pytest.approx(weights, rel=1e-9)  # two triangles of 2 m2
    assert weights.min() > 1.0
    assert pressure.sum() * 2.0 == pytest.approx(-force[2], rel=1e-12)
    assert shear == pytest.approx(0.4 * pressure, rel=1e-9)


def test_stress_on_a_turned_triangle(tmp_path):
    """A floor that turns over, with a ball pressed on it from its back: the pressure is negative and what the
    history has, along the normal where the floor is now. Detects a normal at the start."""
    turn = {"type": "rotate", "axis": (0, 1, 0), "point": (0, 0, 0), "period": 0.4}
    s = scene(
        [floor("mesh") | {"motion": [turn]}], [[0.0, 0.0, -R + 1e-4]], steps=1000, gravity=(0.0, 0.0, 98.1),
        output={"wall_stress": ("floor",), "frames_every": 1000 * DT},
    )  # fmt: skip
    run = gpudem.simulate(s, tmp_path)
    angle = 2 * np.pi * 0.02 / 0.4
    force = vector(run.history, "force", "floor")[-1]
    normal = np.array([np.sin(angle), 0, np.cos(angle)])
    assert force @ normal > 1.0
    cells = run.frames.walls(-1)
    assert cells["pressure"].sum() * 2.0 == pytest.approx(-force @ normal, rel=1e-9)
    assert np.max(cells["shear_stress"]) * 2.0 == pytest.approx(
        np.linalg.norm(force - force @ normal * normal), rel=1e-6
    )


def test_stress_of_walls_without_triangles_is_refused():
    """By name. Detects frames that silently lack what was asked for."""
    with pytest.raises(SceneError, match=r"wall_stress: 'floor' is no mesh, and has no triangles"):
        scene([floor("plane")], [[0, 0, 0.06]], output={"wall_stress": ("floor",)})
    with pytest.raises(SceneError, match=r"wall_stress: 'flor' is no wall; did you mean 'floor'"):
        scene([floor("mesh")], [[0, 0, 0.06]], output={"wall_stress": ("flor",)})
