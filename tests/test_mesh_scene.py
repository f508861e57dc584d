"""A mesh in a scene: repair, distance, hash, files beside it, the folder of a run, frames, warnings."""

from __future__ import annotations

import json
import pickle
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gpudem
from comparisons.cli import main
from gpudem.errors import GpudemError, SceneError
from gpudem.output.directory import save_scene
from gpudem.output.vtu import read_pvd
from gpudem.scene import Mesh, Scene, checks, scene_warnings
from gpudem.scene.mesh_distance import distance_to_triangles, pair_distance
from gpudem.scene.mesh_repair import oddities, repaired
from tests.test_mesh_files import ascii_stl

SQUARE = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * 0.05
ROWS = np.array([[0, 1, 2], [0, 2, 3]])


def random_surface(count: int, seed: int = 1) -> np.ndarray:
    """Triangles of sizes over three decades in a unit cube, shape (count, 3, 3)."""
    rng = np.random.default_rng(seed)
    size = 10 ** rng.uniform(-3, 0, (count, 1, 1))
    return rng.random((count, 1, 3)) + size * rng.normal(size=(count, 3, 3)) / 4


# -- repair --------------------------------------------------------------------------------------------------


def test_a_sound_mesh_is_left_alone():
    surface = repaired(SQUARE, ROWS)
    assert surface.notes == ()
    assert np.array_equal(surface.points[surface.rows], SQUARE[ROWS])


@pytest.mark.parametrize(
    ("points", "rows", "note", "left"),
    [
        (np.vstack([SQUARE, [[9, 9, 9]]]), ROWS, "1 of 5 vertices belong to no triangle; left out", 2),
        (np.vstack([SQUARE, SQUARE[2:3] + 1e-12]), [[0, 1, 2], [0, 4, 3]],
         "1 of 5 vertices lie within 1e-09 of its size of another; joined", 2),
        (SQUARE, [[0, 1, 2], [0, 2, 3], [1, 1, 2]], "1 of 3 triangles have no area; left out", 2),
        (np.vstack([SQUARE, [[0, -0.05, 0]]]), [[0, 1, 2], [0, 2, 3], [0, 4, 1]],
         "1 of 3 triangles have no area; left out", 2),
        (SQUARE, [[0, 1, 2], [0, 2, 3], [2, 1, 0]],
         "1 of 3 triangles have the corners of an earlier one; left out", 2),
    ],
    ids=["unused", "near", "equal corners", "on a line", "duplicate"],
)  # fmt: skip
def test_what_is_repaired_is_told(points, rows, note, left):
    """Each repair by its sentence; what is left keeps its order. Catches one that is silent or missing."""
    surface = repaired(np.asarray(points, float), np.asarray(rows))
    assert note in surface.notes
    assert len(surface.rows) == left
    assert np.allclose(surface.points[surface.rows], SQUARE[ROWS], atol=1e-11)


def test_joined_vertices_are_equal_to_the_last_bit():
    """Those of a chain of near ones too: LIGGGHTS and the solver ask for equal coordinates."""
    chain = SQUARE[2] + np.outer(np.arange(4), [6e-11, 0, 0])
    points = np.vstack([SQUARE, chain])
    surface = repaired(points, np.array([[0, 1, 4], [0, 5, 3], [0, 6, 3], [0, 7, 1]]))
    corner = surface.points[surface.rows]
    assert len({tuple(c) for c in corner.reshape(-1, 3).tolist()}) == 4


@pytest.mark.parametrize(
    ("points", "rows", "message"),
    [
        (SQUARE, np.zeros((0, 3), int), "triangles: none given"),
        (
            SQUARE,
            [[0, 1, 4]],
            "triangles: row 1 names vertices 0, 1, 4; must be rows of the 4 vertices, 0 to 3",
        ),
        (SQUARE, [[0, 1, 2], [0, -1, 2]], "triangles: row 2 names vertices 0, -1, 2"),
        (SQUARE * [1, np.nan, 1], ROWS, r"vertices: 1 is \(-0.05, nan, 0\); must be finite"),
        (SQUARE * 1e300, ROWS, "vertices: 1 is .*; must be finite, at most 1e"),
        (SQUARE, [[0, 0, 1], [2, 2, 2]], "triangles: none of them has an area"),
        (SQUARE[[0, 0, 0]], [[0, 1, 2]], "triangles: none of them has an area"),
    ],
    ids=["none", "above", "below", "nan", "large", "no area", "a point"],
)
def test_what_cannot_be_repaired_is_refused(points, rows, message):
    with pytest.raises(ValueError, match=message):
        repaired(np.asarray(points, float), np.asarray(rows))


def test_a_bad_vertex_of_no_triangle_does_not_matter():
    surface = repaired(np.vstack([SQUARE, [[np.nan, 0, 0]]]), ROWS)
    assert len(surface.rows) == 2


def test_extremes_are_told():
    sliver = np.array([[[0, 0, 0], [1.0, 0, 0], [1, 1e-5, 0]]])
    assert "1 of 1 triangles are more than 10000 times as long as high" in oddities(sliver, 0.1)[0]
    assert (
        "1 of 1 triangles are smaller than 0.001 of the smallest radius" in oddities(SQUARE[ROWS[:1]], 1e3)[0]
    )
    five_to_one = np.array([[[0, 0, 0], [1.0, 0, 0], [1, 0.2, 0]]])
    assert oddities(five_to_one, 0.1) == []


# -- distance ------------------------------------------------------------------------------------------------


def brute_force(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    found = [pair_distance(points, np.broadcast_to(c, (len(points), 3, 3))) for c in corners]
    return np.min(found, axis=0)


def test_distance_equals_that_to_each_triangle():
    """1000 points, 500 triangles of sizes over three decades. Catches a class or a triangle left out."""
    corners, points = random_surface(500), np.random.default_rng(2).uniform(-1, 2, (1000, 3))
    off = distance_to_triangles(points, corners) - brute_force(points, corners)
    assert np.abs(off).max() < 1e-15


def test_a_limit_leaves_near_points_exact():
    corners, points = random_surface(500), np.random.default_rng(3).uniform(0, 1, (1000, 3))
    exact, found = brute_force(points, corners), distance_to_triangles(points, corners, 0.05)
    near = exact <= 0.05
    assert 50 < near.sum() < 950
    assert np.abs(found[near] - exact[near]).max() < 1e-15
    assert (found[~near] > 0.05).all()


def test_distance_by_minimization():
    """An independent oracle: the nearest of a grid of barycentric coordinates. Catches a wrong region."""
    rng = np.random.default_rng(4)
    corners, points = rng.normal(size=(50, 3, 3)), rng.normal(size=(50, 3)) * 2
    u, v = np.meshgrid(np.linspace(0, 1, 201), np.linspace(0, 1, 201))
    inside = u + v <= 1
    weights = np.stack([1 - u[inside] - v[inside], u[inside], v[inside]], axis=1)
    for triangle, point, found in zip(corners, points, pair_distance(points, corners), strict=True):
        nearest = np.linalg.norm(weights @ triangle - point, axis=1).min()
        assert found <= nearest + 1e-12
        assert nearest - found < 0.02


def test_many_points_and_triangles_take_seconds():
    """20 000 points near 1e5 triangles of a sphere, within 30 s of processor time (measured: 2 s)."""
    n = 223
    t, p = np.meshgrid(
        np.linspace(0.01, np.pi - 0.01, n + 1), np.linspace(0, 2 * np.pi, n + 1), indexing="ij"
    )
    grid = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    corners = np.concatenate(
        [np.stack([a, b, c], -2).reshape(-1, 3, 3), np.stack([a, c, d], -2).reshape(-1, 3, 3)]
    )
    rng = np.random.default_rng(5)
    direction = rng.normal(size=(20_000, 3))
    radius = rng.uniform(0.98, 1.02, (20_000, 1))
    points = radius * direction / np.linalg.norm(direction, axis=1)[:, None]
    start = time.process_time()
    found = distance_to_triangles(points, corners)
    assert time.process_time() - start < 30
    polar = np.abs(points[:, 2]) > 0.999 * radius[:, 0]
    assert np.abs(found - np.abs(radius[:, 0] - 1))[~polar].max() < 2e-4


# -- the scene -----------------------------------------------------------------------------------------------


def scene(wall: dict[str, Any] | None = None, **changes: Any) -> Scene:
    data: dict[str, Any] = {
        "name": "mesh", "gravity": (0, 0, -9.81),
        "materials": {"a": {"young": 5e6, "poisson": 0.3, "density": 2500.0}},
        "pairs": [{"materials": ("a", "a"), "restitution": 0.3, "friction": 0.4}],
        "particles": {"source": "explicit", "material": "a", "radius": 0.003, "position": [[0, 0, 0.003]]},
        "walls": [{"kind": "mesh", "name": "floor", "material": "a", "vertices": SQUARE, "triangles": ROWS,
                   **(wall or {})}],
        "domain": {"lo": (-0.1, -0.1, -0.1), "hi": (0.1, 0.1, 0.1)},
        "time": {"step": 2e-5, "duration": 2e-3}, "output": {"frames_every": 1e-3, "trace_every": 1e-3},
    }  # fmt: skip
    return Scene(**{**data, **changes})


def from_file(path: Path, **wall: Any) -> Scene:
    return scene({"vertices": None, "triangles": None, "file": str(path), **wall})


@pytest.fixture
def stl(tmp_path: Path) -> Path:
    path = tmp_path / "square.stl"
    path.write_text(ascii_stl(SQUARE[ROWS]))
    return path


def test_scaled_then_turned_then_moved():
    """By hand: (1, 0, 0) mm -> 0.001 m -> a quarter turn about z through (0, 0.01, 0) -> + (0, 0, 1)."""
    mesh = Mesh(
        name="m", material="a", vertices=[[1, 0, 0], [2, 0, 0], [1, 1, 0]], triangles=[[0, 1, 2]],
        scale=0.001, rotate={"axis": (0, 0, 3), "angle": 90, "point": (0, 0.01, 0)}, move=(0, 0, 1),
    )  # fmt: skip
    assert np.allclose(mesh.corners[0, 0], (0.01, 0.011, 1), atol=1e-15)
    assert np.allclose(mesh.corners[0, 2], (0.009, 0.011, 1), atol=1e-15)


def test_the_hash_is_that_of_the_triangles(stl, tmp_path):
    """Not of a path or a way to state them; of every number in them. Catches a hash of the file's name."""
    stated, read = scene(), from_file(stl)
    assert stated.hash == read.hash
    assert stated == read
    copy = tmp_path / "elsewhere.stl"
    copy.write_bytes(stl.read_bytes())
    assert from_file(copy).hash == read.hash
    moved = SQUARE.copy()
    moved[0, 0] = np.nextafter(moved[0, 0], 0)
    for change in (
        {"vertices": moved},
        {"triangles": ROWS[::-1]},
        {"move": (0, 0, -1e-9)},
        {"material": "b"},
    ):
        materials = {"materials": dict.fromkeys("ab", stated.materials["a"]),
                     "pairs": [{"materials": ("a", m)} for m in "ab"]}  # fmt: skip
        assert scene(change, **materials).hash != scene(**materials).hash


def test_json_and_pickle_give_it_back(stl):
    """Arrays to the last bit; a file by its path, one row a line. Catches triangles read back as floats."""
    for one in (scene({"rotate": {"axis": (0, 0, 1), "angle": 1 / 3}}), from_file(stl)):
        again = Scene.from_json(one.to_json())
        assert again == one
        assert again.walls[0] == one.walls[0]
        assert np.array_equal(again.meshes[0].corners, one.meshes[0].corners)
        assert len(one.to_json().splitlines()) < 150
    read = pickle.loads(pickle.dumps(from_file(stl)))
    stl.unlink()
    assert np.array_equal(read.meshes[0].corners, SQUARE[ROWS])
    assert scene().walls[0] != scene({"vertices": SQUARE + 1e-9}).walls[0]
    copy = scene().meshes[0].model_copy(update={"scale": 2.0})
    assert np.array_equal(copy.corners, 2 * SQUARE[ROWS])


def test_the_scene_json_of_a_run_is_a_scene_file(stl, tmp_path, monkeypatch):
    """Its files count from its folder, wherever it is read from, also by the commands. Catches a mesh that is
    looked for in the current folder, and a command that reads TOML only.
    """
    one = from_file(stl)
    save_scene(tmp_path, one)
    stl.unlink()
    monkeypatch.chdir("/")
    again = Scene.from_file(tmp_path / "scene.json")
    assert again.hash == one.hash
    assert np.array_equal(again.meshes[0].corners, one.meshes[0].corners)
    assert main(["validate", str(tmp_path / "scene.json")]) == 0


def test_a_relative_file_counts_from_the_scene_file(stl, tmp_path, monkeypatch):
    monkeypatch.chdir("/")
    data = json.loads(from_file(stl).to_json())
    lines = [f'name = "mesh"\ngravity = {data["gravity"]}\n']
    lines.append("materials.a = {young = 5e6, poisson = 0.3, density = 2500.0}\n")
    lines.append('pairs = [{materials = ["a", "a"], restitution = 0.3, friction = 0.4}]\n')
    lines.append(
        'particles = {source = "explicit", material = "a", radius = 0.003, position = [[0, 0, 0.003]]}\n'
    )
    lines.append('walls = [{kind = "mesh", name = "floor", material = "a", file = "square.stl"}]\n')
    lines.append("domain = {lo = [-0.1, -0.1, -0.1], hi = [0.1, 0.1, 0.1]}\n")
    lines.append(
        "time = {step = 2e-5, duration = 2e-3}\noutput = {frames_every = 1e-3, trace_every = 1e-3}\n"
    )
    (tmp_path / "scene.toml").write_text("".join(lines))
    assert Scene.from_toml(tmp_path / "scene.toml") == from_file(stl)


def test_a_run_keeps_its_meshes(stl, tmp_path):
    """The folder is complete: the file may go, the folder be moved; a changed mesh is noticed."""
    run = gpudem.simulate(from_file(stl, scale=0.5), tmp_path / "run")
    stl.unlink()
    (tmp_path / "run").rename(tmp_path / "moved")
    again = gpudem.Run.load(tmp_path / "moved")
    assert again.scene == run.scene
    assert np.array_equal(again.scene.meshes[0].corners, SQUARE[ROWS] * 0.5)
    gpudem.simulate(again.scene, tmp_path / "moved")  # over itself
    with np.load(tmp_path / "moved" / "mesh_floor.npz") as arrays:
        vertices, triangles = arrays["vertices"], arrays["triangles"]
    np.savez(tmp_path / "moved" / "mesh_floor.npz", vertices=vertices * 1.01, triangles=triangles)
    with pytest.raises(GpudemError, match="parts of two runs"):
        gpudem.Run.load(tmp_path / "moved")
    (tmp_path / "moved" / "mesh_floor.npz").unlink()
    with pytest.raises(GpudemError, match=r"file = .*mesh_floor\.npz.*no such file"):
        gpudem.Run.load(tmp_path / "moved")


def test_a_run_resumes_without_the_file(stl, tmp_path):
    """Bit for bit, walls of later frames included: catches a mesh read from where it was."""
    one = from_file(stl, motion=[{"type": "linear", "velocity": (0.0, 0.0, 0.1)}])
    one = one.replace(output={"restart_every": 1e-3})
    whole = gpudem.simulate(one, tmp_path / "whole")

    def stop(sim: gpudem.Simulation) -> None:
        if sim.step_count == 60:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        gpudem.simulate(one, tmp_path / "part", hooks=[gpudem.every(2e-5, stop)])
    stl.unlink()
    resumed = gpudem.resume(tmp_path / "part")
    assert whole.trace is not None
    assert resumed.trace is not None
    assert np.array_equal(resumed.trace["position"][-1], whole.trace["position"][-1])
    for (_, a), (_, b) in zip(walls_of(tmp_path / "whole"), walls_of(tmp_path / "part"), strict=True):
        assert np.array_equal(a, b)


def test_a_new_run_removes_only_its_own_meshes(stl, tmp_path):
    """Not files of the user that are named alike. Catches a removal by pattern."""
    gpudem.simulate(from_file(stl), tmp_path / "run")
    (tmp_path / "run" / "mesh_mine.npz").write_text("mine")
    gpudem.simulate(scene(), tmp_path / "run")
    assert not (tmp_path / "run" / "mesh_floor.npz").exists()
    assert (tmp_path / "run" / "mesh_mine.npz").read_text() == "mine"


# -- frames --------------------------------------------------------------------------------------------------


def walls_of(directory: Path) -> list[tuple[float, np.ndarray]]:
    """(time, points) of the walls of each frame."""
    import meshio

    entries = [(t, name) for t, part, name in read_pvd(directory / "run.pvd") if part == 1]
    return [(t, meshio.read(directory / name).points) for t, name in entries]


def test_walls_at_rest_are_written_once(tmp_path):
    gpudem.simulate(scene(), tmp_path / "run")
    assert [path.name for path in (tmp_path / "run" / "frames").glob("walls_*")] == ["walls_0.vtu"]
    assert len(walls_of(tmp_path / "run")) == 3


def test_walls_are_written_as_they_move(tmp_path):
    """Each frame has its own: catches a pose of another step, a turn without its shift, one file for all."""
    motion = [
        {"type": "rotate", "axis": (0, 0, 1), "period": 4e-3},
        {"type": "linear", "velocity": (0, 0, -0.5)},
    ]
    run = gpudem.simulate(scene({"motion": motion}, allow=["speed"]), tmp_path / "run")
    for (t, points), turned in zip(walls_of(tmp_path / "run"), ((1, 0), (0, 1), (-1, 0)), strict=True):
        c, s = turned
        expected = SQUARE[ROWS].reshape(-1, 3) @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + [
            0,
            0,
            -0.5 * t,
        ]
        assert np.abs(points - expected).max() < 1e-14  # 100 turns one after the other
    names = sorted(path.name for path in (tmp_path / "run" / "frames").glob("walls_*"))
    assert names == [f"walls_{step:09d}.vtu" for step in (0, 50, 100)]
    gpudem.simulate(scene(), run.directory)
    assert [path.name for path in (tmp_path / "run" / "frames").glob("walls_*")] == ["walls_0.vtu"]


def test_a_box_hands_on_what_it_says(tmp_path):
    """Presence, belt, contact law and motion of a box are those of each plane. Catches a dropped key."""
    box = {"kind": "box", "name": "b", "material": "a", "sides": ["zlo", "xhi"], "present": [0.0, 1e-3],
           "surface_velocity": (1, 0, 0), "contact": {"rolling": "off"},
           "motion": [{"type": "linear", "velocity": (0, 0, -1)}]}  # fmt: skip
    for plane in scene(walls=[box]).planes:
        assert (plane.begin, plane.end, plane.surface_velocity) == (0.0, 1e-3, (1, 0, 0))
        assert plane.contact is not None
        assert plane.contact.rolling == "off"
        assert plane.motion[0].velocity == (0, 0, -1)  # type: ignore[union-attr]


def test_walls_that_are_not_there_yet_do_not_count_at_the_start():
    """Overlap and elastic energy at the start: of the walls present then. Catches one that comes later."""
    later = {"kind": "plane", "name": "p", "material": "a", "point": (0, 0, 0.02), "normal": (0, 0, 1),
             "present": [1e-3]}  # fmt: skip
    wall = {"kind": "mesh", "name": "floor", "material": "a", "vertices": SQUARE + np.array([0, 0, 1e-4]),
            "triangles": ROWS}  # fmt: skip
    assert scene(walls=[wall, later]).start_overlap == pytest.approx(1e-4 / 0.003)
    with pytest.raises(SceneError, match="outside wall p"):
        scene(walls=[wall, {**later, "present": [0.0]}])


# -- warnings ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("wall", "changes", "sentence"),
    [
        ({"present": [1.0]}, {}, "floor.present = [1.0] s: the run takes 0.002 s; the wall is never there"),
        ({"present": [0.0, 1.0]}, {}, "[0.0, 1.0] s: the run takes 0.002 s; the wall is never removed"),
        ({"present": [1e-3, 1.000001e-3]}, {}, "less than half a time step; the wall is never there"),
        ({"present": [3e-5]}, {}, "3e-05 s rounded to step 2, 4e-05 s"),
        ({"triangles": [[0, 1, 2], [0, 2, 3], [0, 0, 3]]}, {}, "walls: floor: 1 of 3 triangles have no area"),
        ({}, {"contact": {"mesh_curvature": 1.0}}, "mesh_curvature = 1.0: no effect with mesh_contacts"),
        ({}, {"contact": {"mesh_contacts": "liggghts", "merge_angle": 1.0}}, "merge_angle = 1.0: no effect"),
        ({"kind": "plane", "point": (0, 0, 0), "normal": (0, 0, 1), "vertices": None, "triangles": None},
         {"contact": {"merge_angle": 10.0}}, "contact.merge_angle = 10.0: no effect, no wall is a mesh"),
        ({"surface_velocity": (1, 0, 0)}, {"pairs": [{"materials": ("a", "a")}]},
         "floor.surface_velocity: no effect, no pair has friction"),
    ],
)  # fmt: skip
def test_warnings(wall, changes, sentence):
    """Catches a setting without effect that is silent."""
    data = {"kind": "mesh", "name": "floor", "material": "a", "vertices": SQUARE, "triangles": ROWS, **wall}
    walls = [{k: v for k, v in data.items() if v is not None}]
    found = checks.warnings(scene(walls=walls, **changes))
    assert any(sentence in text for text in found), found


def test_the_memory_of_a_mesh_is_told(monkeypatch):
    monkeypatch.setattr(scene_warnings, "MANY_BYTES", 400)
    assert "walls: 2 triangles take about 0.0 GB" in checks.warnings(scene())


def test_more_warnings_of_walls():
    plane = {"kind": "plane", "name": "p", "material": "a", "point": (0, 0, 0), "normal": (0, 0, 1),
             "surface_velocity": (0, 0, 2)}  # fmt: skip
    rod = {"kind": "cylinder", "name": "rod", "material": "a", "point": (0, 0, -0.05), "axis": (1, 0, 0),
           "radius": 0.001}  # fmt: skip
    found = checks.warnings(scene(walls=[plane, rod]))
    assert "walls: p.surface_velocity: no effect, it is along the normal" in found
    assert any("rod.radius = 0.001 m: below that of the smallest particle" in text for text in found)
    assert checks.warnings(scene()) == []
