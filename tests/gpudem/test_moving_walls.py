"""Runs with moving walls: forces from the place and velocity that the wall has in that step, lists, restarts.

Catches: a wall that the device has in another place, turned otherwise or faster than it is; a list that no
longer reaches a wall; a restart that makes a list too many; a wall that forgets its motion while it is away.
"""

from typing import Any

import numpy as np
import pytest

from gpudem import Simulation
from gpudem.driver import simulate
from gpudem.errors import SceneError, SimulationError
from gpudem.scene import Scene
from gpudem.scene.time_step import top_speed
from gpudem.solver import guards
from gpudem.solver.solver import Solver
from gpudem.solver.wall_motion import WallMotion
from gpudem.walls.motion import WallPath
from tests.gpudem.beds import MATERIALS, PAIRS, falling_bed, finish, same

pytestmark = pytest.mark.long

R, DT = 0.003, 2e-5
PLANE = {"kind": "plane", "name": "moving", "material": "wall", "point": (0, 0, -0.0045), "normal": (0, 0, 1)}
#: A bent plate of four triangles below the balls.
PLATE = {
    "kind": "mesh", "name": "moving", "material": "wall",
    "vertices": [(-0.1, -0.1, -0.0045), (0.05, -0.1, -0.0045), (0.05, 0.15, -0.0045), (-0.1, 0.15, -0.0045),
                 (0.2, -0.1, 0.0), (0.2, 0.15, 0.0)],
    "triangles": [(0, 1, 2), (0, 2, 3), (1, 4, 5), (1, 5, 2)],
}  # fmt: skip
MOTIONS: dict[str, list[dict[str, Any]]] = {
    "linear": [{"type": "linear", "velocity": (0.05, -0.1, 0.2)}],
    "oscillate": [{"type": "oscillate", "amplitude": (0.002, 0.0, 0.004), "period": 0.03}],
    "rotate": [{"type": "rotate", "axis": (0.2, -1, 0.1), "point": (-0.05, 0, -0.005), "period": 2.0}],
    "swing": [{"type": "swing", "axis": (0, -1, 0), "point": (-0.05, 0, 0), "amplitude": 0.1,
               "period": 0.06}],
    "table": [{"type": "table", "time": [0.0, 0.01, 0.02],
               "velocity": [(0, 0, 0.0), (0.1, 0.0, 0.3), (0.0, 0.1, -0.1)]}],
    "rotate, linear": [{"type": "rotate", "axis": (0, 0, 1), "point": (0.02, 0.01, 0), "period": 0.2},
                       {"type": "linear", "velocity": (0.1, 0.05, 0.2)}],
}  # fmt: skip


def grid(*walls: dict[str, Any], **changes: Any) -> Scene:
    """Twelve balls at rest, far from each other, without gravity: all that they do a wall has done."""
    position = [(0.03 * i, 0.03 * j, 0.0) for i in range(4) for j in range(3)]
    data: dict[str, Any] = {
        "name": "grid", "materials": MATERIALS, "pairs": PAIRS,
        "particles": {"source": "explicit", "material": "ball", "radius": R, "position": position},
        "walls": walls, "domain": {"lo": (-0.3, -0.3, -0.3), "hi": (0.4, 0.4, 0.3)},
        "time": {"step": DT, "duration": 0.024}, "output": {"trace_every": DT, "history_every": DT},
    }  # fmt: skip
    return Scene(**{**data, **changes})


# -- the law at a moving wall ------------------------------------------------------------------------------

#: Forces that are linear in overlap and velocities: three constants.
LINEAR_LAW = {"normal": "hooke", "characteristic_velocity": 0.3, "tangential": "no_history"}
NO_SLIP: dict[str, Any] = {"pairs": [{**p, "friction": 1e4} for p in PAIRS], "allow": ["unusual_units"]}


def nearest_on_plate(scene: Scene, x: np.ndarray) -> np.ndarray:
    """The point of the plate nearest to x, both in the plate's frame; it has no corner towards the balls."""
    wall = scene.wall_elements[0]
    if wall.kind == "plane":
        return x - wall.gap(x[None])[0] * np.array(wall.normal)  # type: ignore[attr-defined]
    best = None
    for a, b, c in wall.corners:  # type: ignore[attr-defined]
        n = np.cross(b - a, c - a)
        q = x - ((x - a) @ n) / (n @ n) * n
        inside = all(np.cross(e, q - p) @ n >= 0 for p, e in ((a, b - a), (b, c - b), (c, a - c)))
        if inside and (best is None or np.linalg.norm(x - q) < np.linalg.norm(x - best)):
            best = q
    assert best is not None
    return best


def terms(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """(k, 3, 3), (k, 3): what the three constants of the law multiply, and the force, of contacts."""
    trace = simulate(scene).trace
    assert trace is not None
    mass, inertia = scene.masses[0], 0.4 * scene.masses[0] * R * R
    wall = scene.wall_elements[0]
    poses = WallPath(wall.motion, DT, scene.contact.mesh_contacts == "liggghts").at(0, scene.n_steps + 1)  # type: ignore[arg-type]
    found, forces = [], []
    for n in range(1, scene.n_steps + 1):
        near = np.linalg.norm(trace["position"][n][:, None] - trace["position"][n], axis=2) < 2.1 * R
        touches = (np.abs(trace["force"][n]).max(axis=1) > 0) & (near.sum(axis=1) == 1)
        for i in np.flatnonzero(touches)[:3]:
            x, force = trace["position"][n, i], trace["force"][n, i]
            v = trace["velocity"][n, i] - 0.5 * DT * force / mass  # half a step behind
            w = trace["angular_velocity"][n, i] - 0.5 * DT * trace["torque"][n, i] / inertia
            rotation, shift = poses.rotation[n], poses.shift[n]
            q = rotation @ nearest_on_plate(scene, rotation.T @ (x - shift)) + shift
            gap = np.linalg.norm(x - q)
            normal = (x - q) / gap
            point = v - poses.part(n, n + 1).velocity_at(q)[0] - (R - (R - gap) / 2) * np.cross(w, normal)
            closing = point @ normal * normal
            found.append(np.stack([(R - gap) * normal, -closing, -(point - closing)], axis=1))
            forces.append(force)
    return np.array(found), np.array(forces)


@pytest.fixture(scope="module")
def constants() -> np.ndarray:
    """Of a plane at rest that balls hit obliquely."""
    data = grid(PLANE, contact=LINEAR_LAW, **NO_SLIP).particles.model_dump()
    data["velocity"] = [(0.1, 0.05, -0.3)] * 12
    columns, forces = terms(grid(PLANE, contact=LINEAR_LAW, **NO_SLIP, particles=data))
    fitted, _, rank, _ = np.linalg.lstsq(columns.reshape(-1, 3), forces.ravel(), rcond=None)
    assert rank == 3
    assert np.abs(columns @ fitted - forces).max() < 1e-10 * np.abs(forces).max()
    return fitted


@pytest.mark.parametrize("rule", ["unique", "liggghts"])
@pytest.mark.parametrize("kind", [PLANE, PLATE], ids=["plane", "mesh"])
@pytest.mark.parametrize("name", MOTIONS)
def test_force_of_the_place_and_velocity_of_that_step(constants, name, kind, rule):
    """With the constants found at a wall at rest; rounding of positions, 1e-17 m, is 1e-12 of an overlap."""
    scene = grid({**kind, "motion": MOTIONS[name]}, contact={**LINEAR_LAW, "mesh_contacts": rule}, **NO_SLIP)
    columns, forces = terms(scene)
    assert len(forces) > 50
    assert np.abs(columns @ constants - forces).max() < 1e-9 * np.abs(forces).max()


def test_only_relative_motion_counts():
    """A wall that moves on steadily, and balls that come to one at rest: history, friction and all."""
    velocity = np.array([0.1, -0.05, 0.31])
    moving = simulate(grid({**PLANE, "motion": [{"type": "linear", "velocity": tuple(velocity)}]})).trace
    data = grid(PLANE).particles.model_dump() | {"velocity": [tuple(-velocity)] * 12}
    still = simulate(grid(PLANE, particles=data)).trace
    assert moving is not None
    assert still is not None
    assert np.abs(moving["velocity"][-1, :, 2]).min() > 0.2
    assert np.abs(moving["angular_velocity"][-1]).min(axis=0)[0] > 1
    assert np.abs(moving["velocity"] - velocity - still["velocity"]).max() < 1e-9
    assert np.abs(moving["angular_velocity"] - still["angular_velocity"]).max() < 1e-6


@pytest.mark.parametrize("kind", [PLANE, PLATE], ids=["plane", "mesh"])
def test_a_belt_is_a_wall_that_slides_along_itself(kind):
    """The same velocities of balls that lie on them."""
    down = {"gravity": (0, 0, -9.81), "time": {"step": DT, "duration": 0.04}}
    flat = {**kind, "vertices": [(x, y, -R) for x, y, _ in PLATE["vertices"]]} if "vertices" in kind else kind
    flat = {**flat, "point": (0, 0, -R)} if kind is PLANE else flat
    belt = simulate(grid({**flat, "surface_velocity": (0.02, 0.01, 0)}, **down)).trace
    sliding = {**flat, "motion": [{"type": "linear", "velocity": (0.02, 0.01, 0)}]}
    slides = simulate(grid(sliding, **down)).trace
    assert belt is not None
    assert slides is not None
    assert belt["velocity"][-1, 4, 0] > 0.005
    assert np.abs(belt["velocity"] - slides["velocity"]).max() < 1e-10


def test_friction_brings_a_ball_up_to_speed():
    """A ball laid on a wall that moves at V slides for 2 V/(7 mu g), and rolls at 2 V/7 then."""
    down = {"gravity": (0, 0, -9.81), "time": {"step": DT, "duration": 0.06}}
    speed, laid = 0.3, -R * (1 - 1e-3)
    wall = {**PLANE, "point": (0, 0, laid), "motion": [{"type": "linear", "velocity": (speed, 0, 0)}]}
    trace = simulate(grid(wall, **down)).trace
    assert trace is not None
    v = trace["velocity"][:, :, 0].mean(axis=1)
    slides = 2 * speed / (7 * 0.3 * 9.81)
    half = round(slides / 2 / DT)
    assert v[half] == pytest.approx(0.3 * 9.81 * half * DT, rel=0.05)  # it bounces a little
    assert v[-1] == pytest.approx(2 * speed / 7, rel=0.02)


# -- lists -------------------------------------------------------------------------------------------------

MOVING: dict[str, tuple[dict[str, Any], ...]] = {
    **{f"{kind['kind']}, {name}": ({**kind, "motion": MOTIONS[name]},)
       for kind in (PLANE, PLATE) for name in ("linear", "oscillate", "rotate", "rotate, linear")},
    "two walls": ({**PLANE, "motion": MOTIONS["oscillate"]},
                  {**PLATE, "name": "above", "move": (0, 0, 0.01),
                   "motion": [{"type": "oscillate", "amplitude": (0, 0, 0.004), "period": 0.02}]}),
    "beside a saw-tooth": ({**PLANE, "motion": MOTIONS["rotate"]},
                           {**PLANE, "name": "saw", "point": (0, 0, -0.0035),
                            "vibration": {"speed": 0.2, "amplitude": 0.001}}),
}  # fmt: skip
WAYS = {
    "one by one": {},
    "chunks": {"chunk": 32},
    "cores": {"chunk": 7, "threads": 2},
    "lists within a chunk": {"chunk": 32, "rebuild_in_graph": True},
}


def ended(scene: Scene, **options: Any) -> dict[str, np.ndarray]:
    """The last frame; each pair from both sides, so that no order of particles matters."""
    return finish(Solver(scene, **{"threads": 1, "half_list": False, **options}))


def with_a_fast_ball(*walls: dict[str, Any], **changes: Any) -> Scene:
    """One that asks for a list every few steps, far from the others."""
    data = grid().particles.model_dump()
    data["position"] = [*data["position"], (0.0, -0.28, 0.1)]
    data["velocity"] = [(0, 0, 0)] * 12 + [(10.0, 0.0, 0.0)]
    return grid(*walls, particles=data, **changes)


@pytest.mark.parametrize("name", MOVING)
def test_no_contact_is_missed(monkeypatch, name):
    """Against a list at every step, to the last bit. The balls are at rest until a wall comes: only it asks
    for lists; then with one more that asks for many."""
    for make in (grid, with_a_fast_ball):
        scene = make(*MOVING[name])
        with monkeypatch.context() as patch:
            patch.setattr(WallMotion, "steps_within", lambda *_: 0)
            brute = Solver(scene, threads=1, half_list=False)
            expected = finish(brute)
        assert np.abs(expected["velocity"][:12]).max(axis=1).max() > 0.05
        assert brute.neighbors.rebuilds > scene.n_steps
        for way, options in WAYS.items():
            solver = Solver(scene, **{"threads": 1, "half_list": False, **options})
            same(expected, finish(solver))
            assert solver.neighbors.rebuilds < brute.neighbors.rebuilds / 2, way


def test_saw_tooth_beside_a_motion():
    """It hits the balls as it does alone; catches tables of motions that leave it out."""
    saw, far = MOVING["beside a saw-tooth"][1], {**PLANE, "point": (0, 0, -0.2), "motion": MOTIONS["swing"]}
    alone, beside = (ended(grid(*walls))["velocity"] for walls in ((saw,), ({**far, "name": "far"}, saw)))
    assert np.abs(alone[:, 2]).min() > 0.1
    assert np.array_equal(alone, beside)


def test_faster_than_the_skin():
    """A wall that moves ten skins a step: a list for every step, and the same result."""
    scene = grid(*MOVING["mesh, rotate"])
    few, many = ended(scene), ended(scene.replace(solver={"skin": 1e-7}))
    same(few, many)


def test_a_wall_that_is_away_asks_for_no_list():
    """It moves on all the same: what it does when it comes is what its place is then."""
    wall = {**PLANE, "motion": MOTIONS["linear"], "present": (0.008,)}
    scene = grid(wall, gravity=(0, 0, 0))
    solver = Solver(scene)
    solver.start([])
    solver.advance(399)
    assert solver.neighbors.rebuilds == 1
    late, always = simulate(scene).trace, simulate(grid({**PLANE, "motion": MOTIONS["linear"]})).trace
    assert late is not None
    assert always is not None
    assert np.abs(late["velocity"][-1]).max() > 0.1
    assert (late["force"][:400] == 0).all()
    first = int(np.argmax(np.abs(always["force"]).max(axis=(1, 2)) > 0))
    assert first * DT < 0.008  # it had come to the balls before
    assert not np.allclose(late["velocity"][-1], always["velocity"][-1])


def test_springs_of_other_walls_survive():
    """A ball held by friction on a slope: a wall that comes and goes elsewhere does not let go of it."""
    slope = {"kind": "plane", "name": "slope", "material": "wall", "point": (0, 0, -R), "normal": (0, 0, 1)}
    other = {
        **PLANE,
        "name": "far",
        "point": (0, 0, -0.2),
        "motion": MOTIONS["swing"],
        "present": (0.01, 0.015),
    }
    down = {"gravity": (1.0, 0, -9.81)}
    with_it, without = (simulate(grid(*walls, **down)).trace for walls in ((slope, other), (slope,)))
    assert with_it is not None
    assert without is not None
    assert np.abs(without["force"][-1, :, 0]).max() > 1e-5
    for key in ("position", "angular_velocity"):
        scale = np.abs(without[key] - without[key][0]).max()
        assert np.abs(with_it[key] - without[key]).max() < 1e-3 * scale


def test_a_wall_that_comes_where_balls_are():
    """By name, with the time and what to do."""
    wall = {**PLANE, "name": "late", "point": (0, 0, 0.002), "present": (0.004,)}
    with pytest.raises(
        SimulationError, match=r"overlaps wall late by more than 0\.5 of the radius at t = 0\.004"
    ) as caught:
        simulate(grid(wall))
    assert "it is there from t = 0.004 s on" in str(caught.value)


# -- restart, reading --------------------------------------------------------------------------------------

TURNING = {
    "closed forms": {},
    "sums": {"contact": {"mesh_contacts": "liggghts"}},
    "path": {"solver": {"integrator": "path"}},
    "mixed": {"solver": {"precision": "mixed"}},
}


def stirred(count: int = 300, **changes: Any) -> Scene:
    """A bed whose floor, a mesh, turns and then oscillates, beside a wall that swings."""
    box = {**falling_bed().walls[0].model_dump(), "sides": ("xlo", "ylo", "yhi", "zhi")}
    corners = [(-0.05, -0.05, 0.0), (0.3, -0.05, 0.0), (0.3, 0.1, 0.0), (-0.05, 0.1, 0.0)]
    floor = {
        "kind": "mesh", "name": "floor", "material": "wall", "vertices": corners,
        "triangles": [(0, 1, 2), (0, 2, 3)],
        "motion": [{"type": "rotate", "axis": (0, 0, 1), "point": (0.1, 0.025, 0), "period": 0.5},
                   {"type": "oscillate", "amplitude": (0, 0, 0.0005), "period": 0.013}],
    }  # fmt: skip
    side = {"kind": "plane", "name": "side", "material": "wall", "point": (0.12, 0, 0), "normal": (-1, 0, 0),
            "motion": [{"type": "swing", "axis": (0, 1, 0), "point": (0.12, 0, 0), "amplitude": 0.1,
                        "period": 0.05}]}  # fmt: skip
    domain = {"lo": (-0.05, -0.01, -0.01), "hi": (0.3, 0.06, 0.45)}
    return falling_bed(count, walls=[box, floor, side], domain=domain, **changes)


@pytest.mark.parametrize("changes", TURNING.values(), ids=TURNING)
@pytest.mark.parametrize("stop", [1, 700, 1313])
def test_restart_in_the_middle_of_a_turn(changes, stop):
    """To the last bit, at a step in which the list is not new: a list more would change the order of sums."""
    scene = stirred(**changes)
    whole = Solver(scene)
    whole.start()
    whole.advance(stop)
    other = Solver(scene)
    other.load_state_dict(whole.state_dict())
    for solver in (whole, other):
        solver.advance(300)
        solver.write_step(last=True)
    same(whole.frame(), other.frame())
    assert whole.neighbors.rebuilds == other.neighbors.rebuilds
    assert whole.wall_work() == other.wall_work() != 0


def test_steps_in_pieces_and_reading_change_nothing():
    scene = stirred()
    with Simulation(scene) as one, Simulation(scene) as other:
        one.step(500)
        for piece in (1, 63, 100, 7, 329):
            other.step(piece)
            other.read("position")
            other.observe("kinetic_energy")
        for name in ("position", "velocity", "force", "torque"):
            assert np.array_equal(one.read(name).numpy(), other.read(name).numpy()), name


def test_halves_of_a_run_directory(tmp_path):
    """Through the files of a run, as a user resumes it."""
    from tests.gpudem.test_restart import stopped_and_resumed

    scene = stirred(output={"frames_every": 0.01, "history_every": 0.001, "restart_every": 0.005})
    whole = simulate(scene, tmp_path / "whole")
    parts = stopped_and_resumed(scene, tmp_path / "parts", at=scene.steps(0.0255))
    for a, b in zip(whole.frames, parts.frames, strict=True):
        same(a, b)
    assert whole.history is not None
    assert whole.history.equals(parts.history)


# -- integrator, precision, sides --------------------------------------------------------------------------


def test_path_is_of_second_order_at_a_moving_wall():
    """A damped hit by an oscillating wall. Catches a wall's velocity of another time than the step's."""
    wall = {**PLANE, "motion": [{"type": "oscillate", "amplitude": (0, 0, 0.003), "period": 0.03}]}

    def leaves(steps: int) -> float:
        pairs = [{**p, "friction": 0.0} for p in PAIRS]
        scene = grid(wall, time={"step": 0.016 / steps, "duration": 0.016}, output={}, pairs=pairs,
                     solver={"integrator": "path"})  # fmt: skip
        return float(ended(scene)["velocity"][0, 2])

    exact = leaves(32_000)
    assert exact > 0.5
    coarse, fine = (abs(leaves(steps) - exact) for steps in (1000, 4000))
    assert np.log(coarse / fine) / np.log(4) > 1.7


@pytest.mark.parametrize("precision", ["float32", "mixed"])
def test_precision(precision):
    """The same hit in every precision, of a mesh that turns."""
    scene = grid(*MOVING["mesh, rotate"], output={})
    found, expected = (
        ended(scene.replace(solver={"precision": p}))["velocity"] for p in (precision, "float64")
    )
    assert np.abs(found - expected).max() < 2e-3 * np.abs(expected).max()


# -- energy, guards ----------------------------------------------------------------------------------------


def test_work_of_a_turning_wall():
    """Elastic, without friction: the kinetic energy is the wall's work, whatever the step; second order."""
    elastic = [{**p, "friction": 0.0, "restitution": 1.0} for p in PAIRS]
    for kind in (PLANE, PLATE):
        history = simulate(grid({**kind, "motion": MOTIONS["rotate"]}, pairs=elastic)).history
        assert history is not None
        assert history.contacts.iloc[-1] == 0
        assert history.work.iloc[-1] > 1e-6
        assert history.kinetic_energy.iloc[-1] == pytest.approx(history.work.iloc[-1], rel=1e-3)


def test_work_counts_the_rolling_torque():
    """Force times velocity of the wall's point, less rolling torque times its spin, summed over the steps."""
    rolls = [{**p, "rolling_friction": 0.3} for p in PAIRS]
    scene = grid({**PLANE, "motion": MOTIONS["rotate"]}, pairs=rolls, contact={"rolling": "cdt"})
    run = simulate(scene)
    trace, wall = run.trace, scene.wall_elements[0]
    assert trace is not None
    poses = WallPath(wall.motion, DT).at(0, scene.n_steps + 1)  # type: ignore[arg-type]
    work, of_torque = 0.0, 0.0
    for n in range(1, scene.n_steps + 1):
        normal = poses.rotation[n] @ np.array(wall.normal)  # type: ignore[attr-defined]
        gap = wall.gap((trace["position"][n] - poses.shift[n]) @ poses.rotation[n])
        force, lever = trace["force"][n], R - (R - gap) / 2
        rolling = -trace["torque"][n] - lever[:, None] * np.cross(normal, force)
        q = trace["position"][n] - gap[:, None] * normal
        velocity = poses.velocity[n] + np.cross(poses.spin[n], q - poses.center[n])
        work += DT * (force * velocity).sum()
        of_torque -= DT * (rolling[np.abs(force).max(axis=1) > 0] @ poses.spin[n]).sum()
    assert run.history is not None
    assert abs(of_torque) > 1e-6 * abs(work)
    assert run.history.work.iloc[-1] == pytest.approx(work + of_torque, rel=1e-9)


def test_guards_count_the_speed_of_walls():
    """The guard's limit, the time step's top speed; a wall at rest has none."""
    moving = {**PLANE, "motion": [{"type": "linear", "velocity": (0, 0, 3.0)}]}
    still, fast = grid(PLANE), grid(moving)
    assert still.wall_speeds == [0.0]
    assert fast.wall_speeds == [3.0]
    assert guards.speed_limit(still) - guards.speed_limit(fast) == pytest.approx(3.0)
    assert top_speed(fast) - top_speed(still) == pytest.approx(6.0)  # what an elastic hit adds


def test_a_wall_faster_than_a_radius_a_step():
    """Refused with both numbers; waived by name."""
    fast = {**PLANE, "motion": [{"type": "linear", "velocity": (0, 0, 200.0)}]}
    message = r"up to 200 m/s .*0\.004 m in a step; .*radius, 0\.003 m; waive with allow = \['speed'\]"
    with pytest.raises(SceneError, match=message):
        grid(fast, allow=["time_step"])
    assert grid(fast, allow=["time_step", "speed"]).wall_speeds == [200.0]


def test_no_energy_warning_of_a_wall_that_does_work():
    """Catches an accusation of the time step; nor of a wall that comes where a ball is."""
    run = simulate(grid({**PLANE, "motion": MOTIONS["linear"]}))
    assert not [note for note in run.warnings if "energy" in note]
    late = {**PLANE, "point": (0, 0, -0.8 * R), "present": (0.004,)}
    run = simulate(grid(late))
    assert run.history is not None
    assert run.history.kinetic_energy.iloc[-1] > 0
    assert not [note for note in run.warnings if "energy" in note]


def test_a_mesh_that_leaves_through_a_periodic_side():
    """It meets, 2.3 periods on, the balls that meet it at rest when they come the same way."""
    plate = {**PLATE, "vertices": [(0.5 * x, y, -0.0045) for x, y, _ in PLATE["vertices"]]}
    sides = {"domain": {"lo": (-0.1, -0.3, -0.3), "hi": (0.12, 0.4, 0.3), "periodic": (True, False, False)}}
    velocity = np.array([22.0, 0.0, 0.1037])
    moving = {**plate, "motion": [{"type": "linear", "velocity": tuple(velocity)}]}
    data = grid().particles.model_dump() | {"velocity": [tuple(-velocity)] * 12}
    frictionless = {"pairs": [{**p, "friction": 0.0} for p in PAIRS], "output": {}, "allow": ["time_step"]}
    one = ended(grid(moving, **sides, **frictionless))["velocity"]
    other = ended(grid(plate, particles=data, **sides, **frictionless))["velocity"]
    assert np.abs(one[:, 2]).max() > 0.1
    assert np.abs(one - velocity - other).max() < 1e-6
