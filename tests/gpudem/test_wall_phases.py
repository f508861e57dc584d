"""Walls whose motion, presence, belt or material changes during the run."""

from __future__ import annotations

import functools
import itertools
from typing import Any

import numpy as np
import pytest

from gpudem.driver import simulate as run
from gpudem.output.vtu import read_vtu_and_cells
from gpudem.scene import Scene
from gpudem.scene.placed import Placed, walls_at
from gpudem.solver.solver import Solver
from gpudem.walls.motion import PhasedPath, WallPath
from tests.gpudem.beds import MATERIALS, PAIRS, falling_bed, finish, same
from tests.gpudem.test_phases import STEP, one
from tests.gpudem.test_restart import stopped_and_resumed

FLOOR = {"kind": "plane", "name": "floor", "material": "wall", "point": (0, 0, 0), "normal": (0, 0, 1)}
SLIDE = {"type": "linear", "velocity": (2.0, 0, 0)}
LIFT = {"type": "oscillate", "amplitude": (0.01, 0, 0.004), "period": 0.03}
TURN = {"type": "rotate", "axis": (0.2, 0, 1), "point": (0.02, 0.01, 0), "period": 0.2}
SWING = {"type": "swing", "axis": (0, 1, 0), "point": (0.05, 0, 0), "amplitude": 0.1, "period": 0.04}


def floor(*changes: tuple[float, dict[str, Any]], **more: Any) -> Scene:
    """A ball at rest on a floor that changes at stated times."""
    ball = {"source": "explicit", "position": [(0.0, 0, 0.01)], "radius": 0.01, "material": "ball"}
    wall = more.pop("wall", {})
    wall = wall if "kind" in wall else {**FLOOR, **wall}
    phases = [{"start": start, "walls": [{"name": "floor", **change}]} for start, change in changes]
    return one(**{"walls": [wall], "particles": ball, "phases": phases, **more})


def speeds(scene: Scene) -> np.ndarray:
    """Velocity of the ball along x in every tenth step."""
    trace = run(scene).trace
    assert trace is not None
    return trace["velocity"][:, 0, 0]


def slope(v: np.ndarray, a: int, b: int) -> float:
    """Mean acceleration between two rows [m/s2]."""
    return (v[b] - v[a]) / ((b - a) * 10 * STEP)


def stiff(friction: float = 0.3) -> list[dict[str, Any]]:
    """Pairs with this friction at the wall."""
    return [PAIRS[0], {**PAIRS[1], "friction": friction}]


@pytest.mark.parametrize("change", [{"motion": [SLIDE]}, {"surface_velocity": (2.0, 0, 0)}], ids=str)
def test_friction_of_a_floor_that_starts_and_stops(change):
    """A floor faster than the ball accelerates it by mu g; at rest it brakes it by mu g.

    Detects: a motion or a belt a phase early or late, a stop that does not stop.
    """
    stop: dict[str, Any] = {"motion": []} if "motion" in change else {"surface_velocity": (0, 0, 0)}
    v = speeds(floor((0.03, change), (0.06, stop)))
    assert (v[:301] == 0).all()
    # the load swings after the drop onto the floor: the mean over the phase is a little off
    assert [slope(v, 310, 590), slope(v, 610, 900)] == pytest.approx([3.0, -3.0], rel=0.03)


def test_material_of_each_phase():
    """Detects: coefficients of the material before, or of another wall; laws of one phase only."""
    materials = {**MATERIALS, "ice": MATERIALS["wall"]}
    pairs = [*stiff(), {"materials": ("ball", "ice"), "restitution": 0.7, "friction": 0.0}]
    changes = (0.03, {"material": "wall"}), (0.06, {"material": "ice"})
    wall = {"material": "ice", "surface_velocity": (2.0, 0, 0)}
    scene = floor(*changes, wall=wall, materials=materials, pairs=pairs)
    v = speeds(scene)
    assert (v[:301] == 0).all()
    assert slope(v, 310, 590) == pytest.approx(3.0, rel=0.03)
    assert slope(v, 620, 990) == 0
    assert [placed.material for t in (0.01, 0.03, 0.04, 0.07) for placed in walls_at(scene, t)] == [
        "ice", "ice", "wall", "ice",
    ]  # fmt: skip


def test_a_wall_that_goes_and_comes():
    """Detects: presence a step apart, a wall that comes once only."""
    position, v = 0.0, run(floor((0.03, {"present": False}), (0.031, {"present": True}))).trace
    assert v is not None
    z = v["velocity"][:, 0, 2]
    position = v["position"][:, 0, 2]
    fall = np.diff(z[300:311]) / (10 * STEP)
    assert fall == pytest.approx(-10.0, rel=1e-6)
    assert position[990] == pytest.approx(0.00997, abs=3e-5)


PARTS: list[tuple[int, list[dict[str, Any]]]] = [
    (0, [LIFT]), (700, [SLIDE, TURN]), (1000, []), (1100, [SWING, LIFT]), (2000, [TURN]),
]  # fmt: skip


@functools.cache
def moved(sums: bool = False) -> Scene:
    """A floor with four changes of its motion."""
    changes = [(step * STEP, {"motion": motions}) for step, motions in PARTS[1:]]
    rule = {"mesh_contacts": "liggghts"} if sums else {}
    return floor(*changes, wall={"motion": PARTS[0][1]}, contact=rule)


@pytest.mark.parametrize("sums", [False, True])
def test_places_and_velocities(sums):
    """The velocity of points of the wall is the rate of their places; a part begins where the last one ended.

    Detects: a part composed in another order, a time that counts from the start of the run, a jump.
    """
    scene = moved(sums)
    path = scene.wall_paths["floor"]
    assert isinstance(path, PhasedPath)
    first, count = 500, 2000
    poses, points = path.at(first, count), np.array([(0.1, 0, 0), (0, 0.2, 0.05), (-0.1, 0.1, 0)])
    x = np.einsum("kij,pj->kpi", poses.rotation, points) + poses.shift[:, None]
    rate = (x[2:] - x[:-2]) / (2 * STEP)
    stated = np.stack([poses.velocity_at(x[:, p]) for p in range(len(points))], axis=1)[1:-1]
    changes = np.array([step - first - 1 for step, _ in PARTS[1:]])
    smooth = np.min(np.abs(np.arange(count - 2)[:, None] - changes), axis=1) > 1
    assert np.abs(rate - stated)[smooth].max() < (2e-2 if sums else 2e-4) * np.abs(stated).max()
    assert np.abs(np.diff(x, axis=0)).max() < 1.1 * np.abs(stated).max() * STEP
    turned = poses.rotation @ np.swapaxes(poses.rotation, 1, 2)
    assert np.abs(turned - np.eye(3)).max() < 1e-13
    alone = WallPath(scene.phase_scenes[1].wall_elements[0].motion, STEP, sums)
    begin, later = path.at(700, 1), path.at(950, 1)
    expected = alone.at(250, 1).rotation @ begin.rotation
    assert np.abs(later.rotation - expected).max() < 1e-15


def test_blocks_give_the_same_bits():
    """Detects: a pose that depends on how many are computed at once, or on what was asked for before."""
    whole = moved().wall_paths["floor"].at(0, 2500)
    other = PhasedPath.of([(step, at.wall_elements[0].motion) for (step, _), at in zip(
        PARTS, moved().phase_scenes, strict=True)], STEP)  # fmt: skip
    for first, count in ((2400, 1), (650, 100), (990, 200), (0, 3), (1099, 2)):
        part = other.at(first, count)
        for name in ("rotation", "shift", "velocity", "spin"):
            assert np.array_equal(getattr(part, name), getattr(whole, name)[first : first + count])


def test_set_up_of_a_phase():
    """Detects: the velocity of the motion before in the set-up of the phase; with LIGGGHTS' rule it is 0."""
    for sums in (False, True):
        scene = moved(sums)
        path = scene.wall_paths["floor"]
        assert isinstance(path, PhasedPath)
        ends, begins = path.at(700, 1).velocity, path.in_set_up(700).velocity
        assert np.abs(ends - path.at(699, 1).velocity).max() < 0.01
        assert begins[0].tolist() == ([0, 0, 0] if sums else [2.0, 0, 0])
        assert np.array_equal(path.at(700, 1).shift, path.in_set_up(700).shift)


def machine(**changes: Any) -> Scene:
    """Balls about a rod that turns, rests and slides, in a box that is a belt for a while; the gate goes."""
    materials = {**MATERIALS, "ice": MATERIALS["wall"]}
    pairs = [*PAIRS, {"materials": ("ball", "ice"), "restitution": 0.3, "friction": 0.02}]
    box = {"kind": "box", "name": "box", "material": "wall", "lo": (0, 0, 0), "hi": (0.2, 0.05, 0.4)}
    shelf = {"kind": "cylinder", "name": "rod", "material": "wall", "point": (0.03, -0.01, 0.03),
             "axis": (0, 1, 0), "radius": 0.01, "length": 0.07}  # fmt: skip
    gate = {"kind": "plane", "name": "gate", "material": "wall", "point": (0.1, 0, 0), "normal": (-1, 0, 0)}
    phases = [
        {"start": 0.008, "walls": [{"name": "rod", "motion": [TURN, LIFT]},
                                   {"name": "box", "surface_velocity": (0.5, 0, 0)}]},
        {"start": 0.012, "gravity": (1.0, 0, -9.0), "walls": [{"name": "gate", "present": False}]},
        {"start": 0.02, "walls": [{"name": "rod", "motion": []}, {"name": "box", "material": "ice"}]},
        {"start": 0.025, "walls": [{"name": "rod", "motion": [SLIDE]}, {"name": "gate", "motion": [SLIDE]},
                                   {"name": "box", "surface_velocity": (0, 0, 0)}]},
    ]  # fmt: skip
    data = {"materials": materials, "pairs": pairs, "walls": [box, shelf, gate], "phases": phases,
            "time": {"step": 2e-5, "duration": 0.03}, "allow": ["overlap"]}  # fmt: skip
    return falling_bed(150, **{**data, **changes})


@pytest.fixture(scope="module")
def plain() -> dict[str, np.ndarray]:
    frame = finish(Solver(machine(), threads=1))
    alone = finish(Solver(machine(phases=()), threads=1))
    assert np.abs(frame["position"] - alone["position"]).max() > 1e-3
    return frame


@pytest.mark.parametrize("options", [{"threads": 2}, {"chunk": 32}], ids=str)
def test_bit_identical(plain, options):
    """Detects: launches, tables of poses or lists of one phase in the next."""
    same(plain, finish(Solver(machine(), **{"threads": 1, **options})))


@pytest.mark.parametrize("stop", [400, 401, 999, 1000, 1250])
def test_two_parts_are_one_run(tmp_path, stop):
    """Detects: walls of another phase, or elsewhere, after a restart at a change, before or after it."""
    output = {"frames_every": 0.006, "history_every": 0.002, "restart_every": stop * 2e-5,
              "wall_forces": ["rod"]}  # fmt: skip
    scene = machine(output=output)
    whole = run(scene, tmp_path / "whole", threads=1)
    parts = stopped_and_resumed(scene, tmp_path / "parts", at=stop)
    for a, b in zip(whole.frames, parts.frames, strict=True):
        same(a, b)
    assert whole.history is not None
    assert whole.history.equals(parts.history)
    assert np.ptp(whole.history.work_rod) > 0
    assert type(whole).load(tmp_path / "whole").scene == scene


def test_output_has_walls_where_they_are(tmp_path):
    """Detects: frames or `walls_at` with a wall at its place at the start, or of a wall that is away."""
    scene = machine(output={"frames_every": 0.003})
    run(scene, tmp_path, threads=1)
    files = [tmp_path / "frames" / f"walls_{step:09d}.vtu" for step in range(0, 1501, 150)]
    walls = [read_vtu_and_cells(path)[0]["points"] for path in files]
    assert [len(walls[3]) - len(points) for points in walls] == [0] * 5 + [4] * 6  # the gate, at 12 ms
    rods = [points[24 : len(walls[5])] for points in walls]
    same_place = [np.array_equal(a, b) for a, b in itertools.pairwise(rods)]
    assert same_place == [True, True, False, False, False, False, False, True, False, False]
    at = {placed.name: placed for placed in walls_at(scene, 0.024)}
    later = {placed.name: placed for placed in walls_at(scene, 0.0249)}
    assert "gate" not in at
    assert isinstance(at["rod"], Placed)
    assert isinstance(later["rod"], Placed)
    assert np.array_equal(at["rod"].shift, later["rod"].shift)
    assert at["rod"].shift.any()


def test_speed_of_walls_counts_in_every_phase():
    """Detects: a guard, a recommended step or a warning that looks at the start of the run only."""
    scene = floor((0.05, {"motion": [{**SLIDE, "velocity": (3.0, 0, 0)}], "surface_velocity": (0, 2.0, 0)}))
    assert scene.wall_speeds == [5.0]
    assert scene.moving_walls == {"floor"}
    far = {"kind": "mesh", "name": "floor", "material": "wall", "triangles": [(0, 1, 2)],
           "vertices": [(0, 0, 0), (0.01, 0, 0), (0, 0.01, 0)], "motion": [SLIDE]}  # fmt: skip
    turn = {"type": "rotate", "axis": (0, 0, 1), "point": (0, 0, 0), "period": 2 * np.pi}
    ball = {"source": "explicit", "position": [(0, 0, 0.5)], "radius": 0.01, "material": "ball"}
    away = floor((0.05, {"motion": [turn]}), wall=far, particles=ball)
    assert away.wall_speeds[0] == 2.0  # turned about a point 0.1 m away it has 0.11 m/s
    assert floor(
        (0.05, {"motion": [turn]}), wall={**far, "motion": ()}, particles=away.particles
    ).wall_speeds[0] == pytest.approx(0.01)


def test_a_wall_that_comes_back_on_a_particle_is_named():
    """Detects: a message that does not say that the wall came."""
    with pytest.raises(Exception, match=r"the wall came where the particle was .* t = 0.08 s"):
        run(floor((0.03, {"present": False}), (0.08, {"present": True})))


def test_what_is_the_same_scene():
    """Detects: a hash that changes of walls do not change, or that they change in scenes without."""
    table = {"type": "table", "time": [0.0, 0.1], "velocity": [(0, 0, 0), (1, 0, 0)]}
    scene, other = (floor((0.05, {"motion": [{**table, "time": [0.0, t]}]})) for t in (0.1, 0.2))
    assert len({scene.hash, other.hash, floor().hash}) == 3
    assert Scene.from_json(scene.to_json()) == scene
    gravity = one(phases=[{"start": 0.05, "gravity": (0, 0, -1.0)}])
    assert gravity.hash == "c8e91feb51a87242304cb7cad7d3f36c51051170d774e524bca99d9cedf45c4b"
