"""Forces, torques, places and work of walls in both codes' histories, step by step; servo walls."""

from __future__ import annotations

import functools
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from gpudem.driver import simulate
from gpudem.output.run import Run
from gpudem.output.vtu import read_vtu_and_cells
from gpudem.scene import Scene
from reference import liggghts as code
from reference.liggghts import limits, recorded, wall_loads
from reference.liggghts.deck import render
from reference.liggghts.errors import LiggghtsCannotState, LiggghtsOutputError
from tests.reference.scenes import FLOOR
from tests.reference.wall_scenes import CYLINDERS, DT, FLAT, LINEAR, MESHES, ROTATE, mesh, moved, rolling

#: Of the largest force, torque, work of a wall, and of the size of the domain for places: rounding, which
#: contacts multiply.
TOLERANCE = 1e-9
SIZE = 0.1


def loaded(scene: Scene, *names: str) -> Scene:
    """The scene with columns of walls: of these, or of all."""
    return scene.replace(output={"wall_forces": names or tuple(w.name for w in scene.wall_elements)})


def press(steps: int = 3000, name: str = "press", walls: tuple[dict, ...] = (), **gains: Any) -> Scene:
    """A plate that presses a ball on a floor with 0.3 N; the ball is thrown against it."""
    servo = {"type": "servo", "axis": (0, 0, -2), "target": 0.3, "velocity_limit": 0.2} | gains
    plate = mesh("plate", move=(0, 0, 0.00601), motion=[servo], reference=(0.01, 0.02, 0.005), **FLAT)
    return rolling(
        name, [FLOOR, plate, *walls], steps=steps, position=[[0.001, 0.002, 0.00299]],
        velocity=[[0.0, 0.01, 0.3]], spin=[[0, 0, 0]], gravity=(0, 0, -9.81),
        output={"wall_forces": ("floor", "plate")},
    )  # fmt: skip


GATE = {**FLOOR, "name": "gate", "point": (0.02, 0, 0), "normal": (-1, 0, 0), "removed_at": 1500 * DT}
#: Gains: P; P and I within the limit; I at its limit, which resets; D, which answers to itself in each step.
SERVOS: dict[str, dict[str, Any]] = {
    "p": {"kp": 0.5},
    "pi": {"kp": 0.5, "ki": 50.0},
    "pi_at_limit": {"kp": 0.5, "ki": 20000.0},
    "above_limit": {"kp": 1.5, "ki": 5.0, "steps": 400},
    "pid": {"kp": 0.3, "ki": 50.0, "kd": 1e-6},
    "gate": {"kp": 0.5, "ki": 50.0, "walls": (GATE,)},
}
#: Walls of which some columns are left out: name of a scene -> what.
LEFT_OUT = {
    "mesh_cdt": {f"torque_floor_{a}" for a in "xyz"},
    "belt_over_ridge": {"work_floor"},
    "periodic_floor": {"torque_floor_x", "torque_floor_z"},
}
OF_MESHES = (
    "flat_mesh", "seam_of_two", "mesh_linear", "mesh_rotate", "mesh_oscillate", "mesh_swing", "mesh_table",
    "mesh_turn_table", "linear_then_rotate", "rotate_then_linear", "osc_swing", "belt", "belt_of_plane",
    "mesh_gate", "mesh_comes", "mesh_cdt", "belt_over_ridge", "periodic_floor",
)  # fmt: skip
SCENES: dict[str, Callable[[], Scene]] = {
    **{name: lambda make=MESHES[name]: loaded(make()) for name in OF_MESHES},
    **{name: lambda make=CYLINDERS[name]: loaded(make()) for name in ("inside_y", "belt_y")},
    **{f"servo_{name}": functools.partial(press, **gains) for name, gains in SERVOS.items()},
}
SCENES["reference"] = lambda: loaded(
    rolling(
        "reference",
        mesh(motion=[ROTATE], reference=(0.02, 0.01, 0.03), **FLAT),
        position=[[0.0031, -0.0043, 0.002972]],
        steps=3000,
    )
)


#: One of each kind; all others are long tests.
SHORT = (
    "flat_mesh", "linear_then_rotate", "belt_of_plane", "belt_y", "mesh_gate", "mesh_cdt", "reference",
    "servo_pi_at_limit", "servo_gate",
)  # fmt: skip


def table_of(run: Run) -> Any:
    """Its history."""
    assert run.history is not None
    return run.history


def scale(table, column: str) -> float:
    """Of a column: the largest norm of its quantity at its wall, or the size of the domain."""
    quantity, _, rest = column.partition("_")
    if quantity == "position":
        return SIZE
    if quantity == "work":
        return float(np.abs(table[column]).max())
    vector = table[[c for c in table if c.startswith(f"{quantity}_{rest[:-2]}_")]]
    return float(np.linalg.norm(np.nan_to_num(vector), axis=1).max())


@pytest.mark.liggghts
@pytest.mark.parametrize(
    "name", [name if name in SHORT else pytest.param(name, marks=pytest.mark.long) for name in SCENES]
)
def test_loads_agree_with_binary(name, tmp_path, liggghts):
    """Every column of every wall in every row after the set-up.

    Detects another sign, the torque about another point, one that does not move, a force of another step,
    work with another velocity or from the set-up, another controller.
    """
    scene = SCENES[name]()
    theirs, ours = table_of(code.run(scene, tmp_path)), table_of(simulate(scene))
    columns = [c for c in ours if c.rpartition("_")[0] or c.startswith("work_")]
    columns = [c for c in columns if re.match("(force|torque|position|work)_", c)]
    gone = LEFT_OUT.get(name, set()) | (
        {c for c in columns if "_gate" in c} if name == "servo_gate" else set()
    )
    assert [c for c in theirs if c in columns] == [c for c in columns if c not in gone]
    found = {
        c: float(np.abs((theirs[c] - ours[c])[1:]).max()) / max(scale(ours, c), 1e-300)
        for c in columns
        if c not in gone
    }
    assert max(found.values()) < TOLERANCE, {c: v for c, v in found.items() if v > TOLERANCE}
    largest = max(float(np.abs(ours[c]).max()) for c in columns if c.startswith("force_"))
    assert largest > 0.01  # N: there was a force to agree on


@pytest.mark.liggghts
def test_loads_change_no_trajectory(tmp_path, liggghts):
    """Bit for bit. Detects a deck whose asking for forces gives another run."""
    plain = code.run(MESHES["linear_then_rotate"](), tmp_path / "plain").trace or {}
    asked = code.run(SCENES["linear_then_rotate"](), tmp_path / "asked").trace or {}
    assert "force" in plain
    assert all(np.array_equal(plain[column], asked[column]) for column in plain)


@pytest.mark.liggghts
def test_forces_on_meshes_start_with_nan(tmp_path, liggghts):
    """The binary does not sum them in the set-up and prints 0 (trap 36); planes have theirs. Detects a 0."""
    scene = loaded(
        rolling("both", [{**FLOOR, "name": "low"}, mesh(**FLAT, move=(0, 0, 1e-5))], steps=20), "low", "floor"
    )
    run = code.run(scene, tmp_path)
    history = table_of(run)
    assert np.isnan(history.force_floor_z[0])
    assert history.force_low_z[0] < -0.01
    assert np.isfinite(history.work_floor).all()
    assert any("'floor' begin with nan" in text for text in run.warnings)


@pytest.mark.liggghts
def test_set_up_of_a_second_run_adds_to_the_force(tmp_path, liggghts):
    """Trap 37: the row before a gate goes is kept, so no force is counted twice."""
    scene = SCENES["mesh_gate"]()
    force = table_of(code.run(scene, tmp_path)).force_floor_z.to_numpy()
    row = int(scene.segments[0][1] // 10)
    assert abs(force[row] / force[row - 1] - 1) < 0.1


@pytest.mark.liggghts
def test_frames_show_where_the_binary_moved_a_servo_wall(tmp_path, liggghts):
    """Detects a plate drawn at its first place."""
    scene = press(steps=400).replace(output={"frames_every": 100 * DT})
    run = code.run(scene, tmp_path)
    z = table_of(run).position_plate_z
    points, _ = read_vtu_and_cells(tmp_path / "frames" / "walls_000000400.vtu")
    assert points["points"][-1, 2] - 0.00601 == pytest.approx(z.iloc[-1] - z.iloc[0], abs=1e-15)
    assert abs(z.iloc[-1] - z.iloc[0]) > 1e-6


@pytest.mark.liggghts
@pytest.mark.parametrize(
    "name",
    [
        "seam_of_two",
        *(pytest.param(n, marks=pytest.mark.long) for n in ("servo_p", "periodic_floor", "osc_swing")),
    ],
)
def test_stress_on_triangles_agrees_with_binary(name, tmp_path, liggghts):
    """Pressure and shear stress of every triangle in every frame after the set-up, of which the binary
    has none.

    Detects the stress of another triangle, another sign, the area or the normal of another place.
    """
    meshes = tuple(mesh.name for mesh in SCENES[name]().meshes)
    scene = SCENES[name]().replace(
        output={"wall_stress": meshes, "frames_every": 100 * DT}, time={"duration": 600 * DT}
    )
    theirs, ours = code.run(scene, tmp_path / "theirs"), simulate(scene, directory=tmp_path / "ours")
    assert np.isnan(theirs.frames.walls(0)["pressure"]).all()
    assert any("wall_stress: nan in the first frame" in text for text in theirs.warnings)
    seen = 0.0
    for k in range(1, 7):
        a, b = theirs.frames.walls(k), ours.frames.walls(k)
        assert np.array_equal(a["wall"], b["wall"])
        largest = max(np.nanmax(np.abs(b["pressure"])), np.nanmax(b["shear_stress"]))
        seen = max(seen, largest)
        for column in ("pressure", "shear_stress"):
            assert np.array_equal(np.isnan(a[column]), np.isnan(b[column]))
            assert np.nanmax(np.abs(a[column] - b[column])) <= TOLERANCE * largest, (k, column)
    assert seen > 1.0  # Pa: there was a stress to agree on


@pytest.mark.liggghts
def test_recorded_columns(tmp_path, liggghts, monkeypatch):
    """Detects columns of walls lost on the way through a recorded run."""
    run = code.run(SCENES["flat_mesh"]().replace(time={"duration": 100 * DT}), tmp_path / "run")
    recorded.record(run, tmp_path)
    again = recorded.recall(run.notes["deck_hash"], run.scene, tmp_path / "again", tmp_path)
    assert table_of(again).equals(table_of(run))
    assert "torque_floor_x" in table_of(again)


def test_decks_without_loads_are_as_before():
    """Recorded output is found by the deck's hash. Detects words of loads where nobody asks for them."""
    text = render(MESHES["linear_then_rotate"]()).text + render(CYLINDERS["belt_y"]()).text
    assert not re.search("stress|store_force|load_|fix .* print", text)


def test_words_of_a_servo():
    text = render(press(**SERVOS["pid"])).text
    words = "com 0.01 0.02 0.005 ctrlPV force axis 0.0 0.0 -2.0 target_val 0.3 vel_max 0.2"
    assert f" {words} kp 0.3 ki 50.0 kd 1e-06\n" in text
    assert "move/mesh" not in text


def test_a_servo_faster_than_the_skin_is_refused():
    """Trap 39: the binary ends with an error text that names no wall."""
    scene = press(velocity_limit=400.0, steps=3)
    with pytest.raises(LiggghtsCannotState, match=r"plate\.motion\[0\]\.velocity_limit .* half the skin"):
        render(scene)


def test_reset_of_the_integral_is_said():
    """gpudem's own rule keeps the integral."""
    scene = press(**SERVOS["pi"])
    assert not any("resets the integral" in text for text in limits.warnings(scene))
    other = scene.replace(contact={"mesh_contacts": "unique"})
    assert any("resets the integral" in text for text in limits.warnings(other))


def test_what_is_left_out_is_said():
    """Torques with rolling resistance, a gate's force, work of a belt over a ridge, torque across periodic
    sides."""
    cases = {
        "mesh_cdt": "torque_floor are left out: .* no rolling resistance",
        "belt_over_ridge": "work_floor is left out: the belt has another direction",
    }
    for name, text in cases.items():
        assert any(re.search(text, w) for w in limits.warnings(loaded(MESHES[name]()))), name
    gate = loaded(press(walls=(GATE,)))
    assert any(re.search("wall 'gate' are left out: .* all the time", w) for w in limits.warnings(gate))
    turned = loaded(moved("turned", ROTATE | {"axis": (0, 0, 1)}))
    assert not any("periodic sides" in w for w in limits.warnings(turned))
    wide = turned.replace(domain={"periodic": (False, False, True)})
    assert any("across periodic sides" in w for w in limits.warnings(wide))


def test_work_from_the_force_of_each_step(tmp_path):
    """A mesh that moves at V under a force that grows step by step. Detects work of the wrong sign, of the
    force a step earlier, of the set-up, and a zero for the force in the set-up."""
    scene = SCENES["mesh_linear"]()
    lines = [f"{step} {step} 0 {-2 * step} 0 0 0" for step in range(1, scene.n_steps + 1)]
    (tmp_path / "load_floor.txt").write_text("\n".join(["", *lines, ""]))
    rows = {f"f_mesh_floor[{k}]": np.zeros(2) for k in range(1, 10)}
    found = wall_loads.history(scene, tmp_path, rows | {"step": np.array([0, 3])})
    power = LINEAR["velocity"][0] - 2 * LINEAR["velocity"][2]
    assert found["work_floor"] == pytest.approx([0.0, -power * (1 + 2 + 3) * DT], rel=1e-12)
    assert np.isnan(found["force_floor_x"]).tolist() == [True, False]


def test_a_file_of_loads_that_ends_early_is_refused(tmp_path):
    """Detects work summed over the steps that are there."""
    scene = SCENES["mesh_linear"]()
    rows = {word: np.zeros(1) for word in (f"f_mesh_floor[{k}]" for k in range(1, 10))}
    (tmp_path / "load_floor.txt").write_text("\n1 0 0 0 0 0 0\n2 0 0 0 0 0 0\n")
    with pytest.raises(LiggghtsOutputError, match=r"load_floor\.txt: not a line .* steps 1 to 3000"):
        wall_loads.history(scene, tmp_path, rows | {"step": np.zeros(1, int)})
