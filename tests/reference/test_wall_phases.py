"""Walls that change in phases: gpudem and the binary agree step by step; decks; what LIGGGHTS refuses."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gpudem.driver import simulate
from gpudem.scene import Scene
from reference import liggghts as code
from reference.liggghts import limits
from reference.liggghts.deck import render
from reference.liggghts.errors import LiggghtsCannotState
from tests.reference.scenes import FLOOR
from tests.reference.test_agreement import worst
from tests.reference.wall_scenes import (
    FLAT,
    LINEAR,
    OSCILLATE,
    PRESSED,
    ROTATE,
    SWING,
    TABLE,
    TURN_TABLE,
    drum,
    mesh,
    moved,
    rolling,
)

#: Of the largest value of each column: rounding, which contacts multiply.
TOLERANCE = 1e-9
BACK = {**ROTATE, "axis": (-0.1, -0.2, -1.0)}
ICE = {"young": 4e6, "poisson": 0.3, "density": 900.0}
SIDE = {**FLOOR, "name": "side", "point": (0.006, 0, 0), "normal": (-1, 0, 0)}


def phases(*changes: tuple[float, dict[str, Any]], name: str = "floor") -> tuple[dict[str, Any], ...]:
    """One phase for each (start [s], what changes of a wall)."""
    return tuple({"start": start, "walls": [{"name": name, **change}]} for start, change in changes)


def slippery(*motions: dict, plane: bool = False, change: dict[str, Any] | None = None) -> Scene:
    """A floor that is of another material from 4 to 8 ms."""
    plain = moved("slippery", *motions)
    stated = [pair.model_dump() for pair in plain.pairs]
    more: dict[str, Any] = {
        "materials": {**plain.model_dump()["materials"], "ice": ICE},
        "pairs": [
            *stated,
            {**stated[-1], "materials": ("ball", "ice"), "friction": 0.05, "restitution": 0.4},
        ],
        "phases": phases((0.004, {"material": "ice", **(change or {})}), (0.008, {"material": "wall"})),
    }
    return rolling("slippery", FLOOR, steps=3000, **more) if plane else moved("slippery", *motions, **more)


def belt(wall: dict[str, Any]) -> Scene:
    """A belt that stops, and goes on across."""
    changes = phases((0.004, {"surface_velocity": (0, 0, 0)}), (0.008, {"surface_velocity": (0, 0.3, 0)}))
    return rolling("belt", {**wall, "surface_velocity": (0.5, 0, 0)}, steps=3000, phases=changes)


def gates(side: dict[str, Any]) -> Scene:
    """A side against which a ball rolls, which goes and comes back twice."""
    changes = phases(
        (0.004, {"present": False}), (0.0045, {"present": True}), (0.008, {"present": False}), name="side"
    )
    return rolling(
        "gates", [mesh(**FLAT), side], steps=3000, position=[[0.0031, 0, PRESSED]], gravity=(60.0, 0, -300.0),
        velocity=[[0.0, 0.2, 0.0]], phases=changes,
    )  # fmt: skip


def turned_back() -> Scene:
    """Five balls in a drum that turns, rests, and turns back."""
    back = {"type": "rotate", "axis": (0, -1, 0), "period": 0.08}
    changes = phases((0.005, {"motion": []}), (0.008, {"motion": [back]}), name="drum")
    return drum().replace(phases=changes)


SERVO = {"type": "servo", "axis": (0, 0, -2), "target": 0.3, "velocity_limit": 0.2, "kp": 0.5, "ki": 50.0}
DOWN, UP = ({"type": "linear", "velocity": (0.0, 0.0, v)} for v in (-0.05, 0.02))
TILT = {"type": "rotate", "axis": (0, -1, 0), "point": (0.03, 0, 0.006), "period": 2.0}


def press(*motions: list[dict], moves: tuple[dict, ...] = (), rule: str = "liggghts", **more: Any) -> Scene:
    """A plate over a ball that slides on a mesh; these motions of it begin after 2 ms each."""
    changes = phases(*((0.002 * k, {"motion": m}) for k, m in enumerate(motions, 1)), name="plate")
    plate = mesh("plate", move=(0, 0, 0.00605), motion=list(moves), reference=(0.01, 0.02, 0.005), **FLAT)
    return rolling(
        "press", [mesh(**FLAT), plate], steps=400 * (len(motions) + 1), position=[[0.001, 0.002, 0.00299]],
        velocity=[[0.5, 0.2, 0.0]], spin=[[0, 0, 0]], gravity=(0, 0, -9.81), phases=changes,
        contact={"mesh_contacts": rule}, output={"wall_forces": ("floor", "plate")} | more,
    )  # fmt: skip


SCENES = {
    "servo_begins": lambda: press([SERVO], moves=(DOWN,)),
    "servo_ends": lambda: press([], [{**SERVO, "kd": 1e-6}], [UP], moves=(SERVO,)),
    "servo_between_turns": lambda: press([SERVO], [TILT], [{**SERVO, "target": 0.1}], moves=(TILT,)),
    "starts": lambda: moved("starts", phases=phases((0.004, {"motion": [LINEAR]}))),
    "stops": lambda: moved("stops", LINEAR, phases=phases((0.004, {"motion": []}))),
    "turns_back": lambda: moved(
        "turns_back", ROTATE, phases=phases((0.004, {"motion": []}), (0.006, {"motion": [BACK]}))
    ),
    "sums": lambda: moved(
        "sums", OSCILLATE, phases=phases((0.004, {"motion": [SWING]}), (0.007, {"motion": [OSCILLATE]}))
    ),
    "tables": lambda: moved(
        "tables", phases=phases((0.001, {"motion": [TABLE]}), (0.01, {"motion": [TURN_TABLE]}))
    ),
    "several": lambda: moved(
        "several", LINEAR, phases=phases((0.004, {"motion": [LINEAR, ROTATE]}), (0.008, {"motion": []}))
    ),
    "drum": turned_back,
    "belt_of_plane": lambda: belt(FLOOR),
    "belt_of_mesh": lambda: belt(mesh(**FLAT)),
    "gate": lambda: gates(SIDE),
    "material_of_plane": lambda: slippery(plane=True),
    "material_of_mesh": lambda: slippery(ROTATE, change={"motion": [LINEAR]}),
}


@pytest.mark.liggghts
@pytest.mark.parametrize("name", SCENES)
def test_agrees_with_binary(name, tmp_path, liggghts):
    """Detects: a change a step apart, another place, velocity or time of a motion, springs kept or lost that
    are not so there; loads and work of a wall whose motion changes.
    """
    scene = SCENES[name]()
    if name in ("turns_back", "several"):
        scene = scene.replace(output={"wall_forces": ("floor",)})
    run, ours = code.run(scene, tmp_path), simulate(scene)
    assert run.trace is not None
    assert ours.trace is not None
    found = worst(ours.trace, run.trace)
    assert max(found.values()) < (1e-6 if name == "drum" else TOLERANCE), found
    without = simulate(scene.replace(phases=())).trace
    assert without is not None
    assert np.abs(without["position"] - ours.trace["position"]).max() > 2e-5
    assert run.history is not None
    assert ours.history is not None
    for column in [c for c in run.history if c.startswith(("force_", "torque_", "position_", "work_"))]:
        a, b = run.history[column].to_numpy(), ours.history[column].to_numpy()
        assert np.nanmax(np.abs(a - b)) < 1e-9 * max(0.1, np.nanmax(np.abs(b))), column
    if name == "turns_back":
        assert np.ptp(ours.history["work_floor"]) > 1e-6


def test_deck():
    """Detects: motions unfixed in another order than LIGGGHTS wants, a time that counts from the start of the
    run, a wall of another material without a type of its own.
    """
    changes = phases((0.004, {"motion": [TABLE]}), (0.008, {"motion": [SWING], "material": "ice"}))
    text = render(slippery(LINEAR, ROTATE).replace(phases=changes)).text
    head, middle, tail = text.split("run  ")[:3]
    assert "type 4 curvature" in head
    assert "coefficientFriction peratomtypepair 4 0.3 0.2 0.05 0.2" in head
    assert [line.split()[1] for line in middle.splitlines() if line.startswith("unfix")] == [
        "move_floor_2", "move_floor_1",
    ]  # fmt: skip
    assert "((step-800)*5e-06>=0.002)" in middle
    assert "move_floor_1 all move/mesh mesh mesh_floor linear/variable v_floor_1_from_1_x" in middle
    assert "unfix           move_floor_1" in tail
    assert "riggle" in tail
    assert "coefficientFriction peratomtypepair 4 0.3 0.2 0.05 0.05" in tail
    assert "\nfix             meshes" not in middle + tail


def test_deck_of_a_servo_that_begins_and_ends():
    """Detects: a place with fewer digits than the binary has, motions beside a servo, which it refuses, a
    mesh whose load before the servo is not written.
    """
    deck = render(press([SERVO], [TILT], moves=(DOWN,)))
    head, middle, tail = deck.text.split("run  ")[:3]
    assert "mesh/surface/stress file mesh_plate.stl type 2 curvature" in head
    assert [line.split()[1] for line in middle.splitlines() if line.startswith("unfix")] == [
        "meshes", "move_plate_1", "mesh_plate",
    ]  # fmt: skip
    assert "move_plate" not in middle.split("unfix           mesh_plate\n")[1]
    assert "variable        moved_plate_1_z string $(f_mesh_plate[9]-(0.0049" in middle
    moved = "move ${moved_plate_1_x} ${moved_plate_1_y} ${moved_plate_1_z}"
    point = "com ${point_plate_1_x} ${point_plate_1_y} ${point_plate_1_z}"
    assert f"servo file mesh_plate_from_1.stl type 2 {moved} curvature 0.256235 {point} ctrlPV" in middle
    assert "unfix           move_plate" not in tail
    assert "mesh/surface/stress file mesh_plate_from_2.stl" in tail
    assert "move_plate_1 all move/mesh mesh mesh_plate rotate" in tail
    assert list(deck.meshes) == [
        f"mesh_{name}.stl" for name in ("floor", "plate", "plate_from_1", "plate_from_2")
    ]


def test_what_liggghts_cannot_state():
    """Detects: a plane that begins to move, a mesh with another belt at another place, without a word."""
    plane = rolling("plane", FLOOR, phases=phases((0.004, {"motion": [LINEAR]})), steps=100)
    with pytest.raises(LiggghtsCannotState, match=r"walls.floor.motion: LIGGGHTS moves meshes only"):
        limits.check(plane)
    steered = moved("steered", LINEAR, phases=phases((0.004, {"motion": [], "surface_velocity": (1, 0, 0)})))
    with pytest.raises(LiggghtsCannotState, match="states the mesh anew, at its place at the start"):
        limits.check(steered)
    tilted = rolling("tilted", FLOOR, phases=phases((0.004, {"surface_velocity": (1, 1, 0)})), steps=100)
    with pytest.raises(LiggghtsCannotState, match="moves the surface of a plane along one axis"):
        limits.check(tilted)
    with pytest.raises(LiggghtsCannotState, match="states no mesh anew whose stress is written"):
        limits.check(press([SERVO], wall_stress=("plate",)))
    gone = press([SERVO], [UP]).model_dump()["phases"]
    gone[0]["walls"][0]["present"], gone[1]["walls"][0]["present"] = False, True
    with pytest.raises(
        LiggghtsCannotState, match=r"plate.motion: a servo from 0.002 s on, where the mesh is not"
    ):
        limits.check(press([SERVO], [UP]).replace(phases=gone))


def test_lost_springs_are_said():
    """Detects: springs that LIGGGHTS loses and gpudem keeps, without a word; columns left out likewise."""
    scene = belt(FLOOR).replace(contact={"mesh_contacts": "unique"}, output={"wall_forces": ("floor",)})
    words = limits.warnings(scene)
    assert sum("states the wall anew, and its contacts lose their springs" in word for word in words) == 2
    assert any("'floor' are left out" in word for word in words)
    assert not any("lose their springs" in word for word in limits.warnings(belt(FLOOR)))
    words = limits.warnings(press([SERVO], [UP], rule="unique"))
    assert sum("the contacts of all meshes lose their springs" in word for word in words) == 2
    assert any("'contacts' is left out" in word and "a servo begins" in word for word in words)
    assert not any("lose their springs" in word for word in limits.warnings(press([SERVO], [UP])))
    assert scene.hash != belt(FLOOR).replace(output={"wall_forces": ("floor",)}).hash
