"""Meshes, motions, belts and gates: gpudem's rule `liggghts` and the binary agree step by step; the decks."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gpudem.driver import simulate
from gpudem.scene import Scene
from reference import liggghts as code
from reference.liggghts import limits
from reference.liggghts.deck import render
from reference.liggghts.decomposition import processors
from reference.liggghts.errors import LiggghtsCannotState
from tests.reference.scenes import FLOOR, OWN_LAWS, wall_bounce
from tests.reference.test_agreement import worst
from tests.reference.wall_scenes import (
    CENSUS,
    CYLINDERS,
    DT,
    FLAT,
    LINEAR,
    MESHES,
    ROTATE,
    RULE,
    SWING,
    across,
    grid,
    mesh,
    moved,
    objects,
    rolling,
    sticky_mesh,
)

#: Of the largest value of each column: rounding, which contacts multiply.
TOLERANCE = 1e-9


def assert_agreement(scene: Scene, folder: Path, tolerance: float) -> None:
    """Both codes step by step: every column of the trace, and the number of contacts."""
    run, ours = code.run(scene, folder), simulate(scene)
    assert run.trace is not None
    assert ours.trace is not None
    assert run.history is not None
    assert ours.history is not None
    assert np.array_equal(run.trace["step"], ours.trace["step"])
    found = worst(ours.trace, run.trace)
    assert max(found.values()) < tolerance, found
    if "contacts" in run.history:
        assert np.array_equal(run.history["contacts"], ours.history["contacts"])
        assert np.mean(run.history["contacts"]) > 0.5  # it touched


#: Five balls: contacts multiply rounding.
LOOSER = {"drum": 1e-5}


@pytest.mark.liggghts
@pytest.mark.parametrize("name", MESHES)
def test_mesh_agrees_with_binary(name, tmp_path, liggghts):
    """Detects another rule of contacts or springs at a triangle, another place or velocity of a wall."""
    assert_agreement(MESHES[name](), tmp_path, LOOSER.get(name, TOLERANCE))


@pytest.mark.parametrize("law", ["sjkr", "sjkr2"])
def test_cohesion_acts_at_meshes(law):
    """So that the two codes do not agree on nothing: it changes the path by a tenth of the radius."""
    with_it, without = (simulate(sticky_mesh(f"mesh_{law}", law, density)).trace for density in (5e4, 0.0))
    assert with_it is not None
    assert without is not None
    assert np.abs(with_it["position"] - without["position"]).max() > 3e-4


STILL: dict[str, Any] = {"velocity": [[0, 0, 0]], "spin": [[0, 0, 0]]}


def two_faces(angle: float) -> Scene:
    """A ball at rest over a ridge of two triangles whose normals differ by `angle` [deg]."""
    half = 0.02 * np.tan(np.radians(angle) / 2)
    points = [[0, -0.02, 0], [0, 0.02, 0], [0.02, 0, -half], [-0.02, 0, -half]]
    wall = mesh(vertices=points, triangles=[[0, 2, 1], [0, 1, 3]])
    return rolling("ridge", wall, steps=2, position=[[0, 0, 0.00299]], gravity=(0, 0, 0), **STILL)


#: A place counts as one of the face within 5e-9 m / 21.08 mm of the triangle's altitude, 4.74e-9 m, which a
#: ball 2.99 mm high leaves at an angle of 1.82e-4 deg between the faces.
MARGIN = {1.7e-4: True, 1.95e-4: False}


@pytest.mark.parametrize("angle", MARGIN)
def test_margin_of_a_face(angle):
    """Detects a face without LIGGGHTS' margin: over a ridge within the curvature no triangle would count."""
    assert (simulate(two_faces(angle)).trace["force"][0, 0, 2] > 0) == MARGIN[angle]


@pytest.mark.liggghts
@pytest.mark.parametrize("angle", MARGIN)
def test_margin_is_that_of_the_binary(angle, tmp_path, liggghts):
    """Detects another margin than the binary's."""
    assert (code.run(two_faces(angle), tmp_path).trace["force"][0, 0, 2] > 0) == MARGIN[angle]


#: Corners around an origin where two rims meet, as directions in turn: whether the corner counts.
CORNERS = {
    "no edge goes on": ([(1, 0), (0.9, -1), (-1, -1), (-1, 0.8), (0, 1)], True),
    "an inactive edge goes on as another": ([(1, 0), (1, -1), (-1, -0.9), (-1, 1), (0, 1)], False),
    "a rim goes on as an inactive edge": ([(1, 0), (0.9, -1), (0, -1), (-1, -1), (-1, 0.8), (0, 1)], False),
    "0.2 degrees beside": ([(1, 0), (0.9, -1), (0.0035, -1), (-1, -1), (-1, 0.8), (0, 1)], False),
    "0.3 degrees beside": ([(1, 0), (0.9, -1), (0.0053, -1), (-1, -1), (-1, 0.8), (0, 1)], True),
}


def notch(name: str) -> Scene:
    """A ball in the notch of an L of triangles around the origin; the last one has the corner nearest."""
    ring, _ = CORNERS[name]
    points = [(0, 0, 0), *((0.01 * x, 0.01 * y, 0) for x, y in ring)]
    fan = np.roll([[0, k + 2, k + 1] for k in range(len(ring) - 1)], -2, axis=0)
    wall = mesh(vertices=points, triangles=fan)
    place = [[1e-4, 2e-4, 0.00299]]
    return rolling("notch", wall, steps=2, position=place, **STILL)


@pytest.mark.parametrize("name", CORNERS)
def test_corner_where_an_edge_goes_on(name):
    """Detects a corner counted beside its edges: one where any edge goes on straight does not count."""
    history = simulate(notch(name)).history
    assert history is not None
    assert int(history["contacts"].to_numpy()[0]) == (3 if CORNERS[name][1] else 2)


@pytest.mark.liggghts
@pytest.mark.parametrize("name", CORNERS)
def test_corner_is_that_of_the_binary(name, tmp_path, liggghts):
    """Detects another rule of corners than the binary's."""
    assert_agreement(notch(name), tmp_path, TOLERANCE)


def test_a_mesh_is_joined_where_its_ends_meet_across_periodic_sides():
    """Trap 41: no rim counts there. Detects rims of both ends beside the faces."""
    scene = across("joined", mesh(**grid(4, 0.1))).replace(time={"duration": 1500 * DT})
    history = simulate(scene).history
    assert history is not None
    assert int(history["contacts"].to_numpy().max()) == 1


@pytest.mark.liggghts
@pytest.mark.parametrize("shape", CENSUS)
def test_random_places(shape, tmp_path, liggghts):
    """One force for each of 60 balls at random places of an object: detects a feature counted twice or not.

    Trap 31: beyond an obtuse corner the contact is at the corner; triangles that are one plane, wound against
    each other, have no edge between them; one that is folded back has.
    """
    scene = objects(CENSUS[shape], 60, seed=7)
    theirs, ours = code.run(scene, tmp_path).trace["force"][0], simulate(scene).trace["force"][0]
    size = np.linalg.norm(theirs, axis=1)
    assert (size > 0).mean() > 0.9
    off = np.flatnonzero(np.linalg.norm(ours - theirs, axis=1) > 1e-9 * size.max())
    assert not len(off), off


@pytest.mark.liggghts
@pytest.mark.parametrize("name", CYLINDERS)
def test_cylinder_agrees_with_binary(name, tmp_path, liggghts):
    """Detects a transposed axis (trap 26), a wrong side, an effective radius with the cylinder's in it."""
    assert_agreement(CYLINDERS[name](), tmp_path, TOLERANCE)


# -- decks --------------------------------------------------------------------------------------------------


def test_meshes_are_written_exactly():
    """Detects lost digits, another order of triangles or corners."""
    scene = MESHES["flat_mesh_shuffled"]()
    text = render(scene).meshes["mesh_floor.stl"]
    corners = np.array([line.split()[1:] for line in text.splitlines() if line.startswith("vertex")], float)
    assert np.array_equal(corners.reshape(-1, 3, 3), scene.meshes[0].corners)


def test_hash_knows_the_meshes():
    """A recorded run is of these triangles."""
    other = rolling("flat_mesh", mesh(**FLAT, scale=1.1))
    assert render(other).text == render(MESHES["flat_mesh"]()).text
    assert render(other).hash != render(MESHES["flat_mesh"]()).hash


def test_decks_of_walls_have_only_harmless_characters():
    for make in MESHES.values():
        deck = render(make())
        assert re.fullmatch(r"[A-Za-z0-9_ .,:;#%*/()<>=\"\[\]\n+-]*", deck.text), set(deck.text)
        for text in deck.meshes.values():
            assert re.fullmatch(r"[A-Za-z0-9_ .\n+-]*", text)


def test_deck_of_a_mesh_that_goes():
    """Trap 19: one wall of meshes, stated anew; those that stay are in it."""
    text = render(MESHES["mesh_gate"]()).text
    assert "mesh n_meshes 2 meshes mesh_floor mesh_gate\n" in text
    tail = text[text.index("run  ") :].split("\n")
    assert [" ".join(line.split()) for line in tail] == [
        "run 2000", "unfix meshes",
        "fix meshes all wall/gran model hertz tangential history mesh n_meshes 1 meshes mesh_floor",
        "run 4000", "",
    ]  # fmt: skip


def test_ranks_are_not_cut_across_a_mesh_that_goes():
    """Trap 16, for gates of every kind. Detects a gate known by `removed_at` of planes alone."""
    corners = [(-0.02, 0.01, 0), (0.02, 0.01, 0), (0, 0.01, 0.02)]
    gate = mesh("gate", vertices=corners, triangles=[(0, 1, 2)], present=(0.0, 0.01))
    assert processors(rolling("gated", [mesh(**FLAT), gate]), 2) == (2, 1, 1)
    assert processors(rolling("open", [mesh(**FLAT)]), 2) == (1, 2, 1)


@pytest.mark.liggghts
@pytest.mark.parametrize("name", ["linear_then_rotate", "mesh_gate", "belt"])
def test_two_ranks_share_meshes(name, tmp_path, liggghts):
    """One ball, which one rank has at a time: the same bits. Detects a mesh that a rank lacks."""
    one, two = (code.run(MESHES[name](), tmp_path / str(ranks), ranks=ranks).trace for ranks in (1, 2))
    assert one is not None
    assert two is not None
    assert all(np.array_equal(one[column], two[column]) for column in one)


def test_motions_count_from_the_start():
    """Trap 21: a mesh that comes later has its motion from the start, as gpudem's."""
    text = render(MESHES["mesh_comes"]()).text
    assert text.index("move_gate_1 all move/mesh mesh mesh_gate linear") < text.index("run  ")


def test_words_of_a_cylinder():
    """Trap 26: the coordinates of the axis in cyclic order."""
    text = render(CYLINDERS["inside_y"]()).text
    assert "primitive type 2 ycylinder 0.02 -0.002 0.001\n" in text  # z, x


def test_swing_in_degrees():
    """Trap 22."""
    words = re.search(r"riggle .* amplitude (\S+)\n", render(moved("swing", SWING)).text)
    assert float(words[1]) == pytest.approx(np.degrees(SWING["amplitude"]), rel=1e-15)


def test_contacts_with_meshes_that_go_are_left_out_and_said():
    """Trap 24."""
    assert any("'contacts' is left out" in text for text in limits.warnings(MESHES["mesh_gate"]()))
    assert "mesh_contacts" not in render(MESHES["mesh_gate"]()).text
    assert "mesh_contacts" in render(MESHES["flat_mesh"]()).text


def test_two_turns_are_said():
    """Trap 28: LIGGGHTS takes the velocity of the first before the second has turned the mesh."""
    assert any("two turns" in text for text in limits.warnings(moved("two", ROTATE, SWING)))
    assert not any("two turns" in text for text in limits.warnings(moved("one", ROTATE, LINEAR)))


def test_another_rule_is_said():
    """Agreement to rounding cannot be asked with gpudem's own rule."""
    scene = MESHES["flat_mesh"]().replace(contact={"mesh_contacts": "unique"})
    assert any("mesh_contacts = 'unique'" in text for text in limits.warnings(scene))
    assert not any("mesh_contacts" in text for text in limits.warnings(MESHES["flat_mesh"]()))


TUBE = {
    "kind": "cylinder",
    "name": "tube",
    "material": "wall",
    "radius": 0.02,
    "point": (0, 0, 0),
    "axis": (0, 0, 1),
}
SPIN = {"type": "rotate", "axis": (0, 0, 1), "period": 1.0}


@pytest.mark.parametrize(
    ("walls", "message"),
    [
        ([mesh(**FLAT), mesh("other", contact={"rolling": "off", "tangential": "off"}, **FLAT)],
         r"walls\.other\.contact: LIGGGHTS has one contact law for all meshes; that of floor"),
        ([mesh(motion=[LINEAR], surface_velocity=(1, 0, 0), **FLAT)], r"floor\.surface_velocity: .*no belt"),
        ([{**FLOOR, "motion": [LINEAR]}], r"walls\.floor\.motion: LIGGGHTS moves meshes only"),
        ([{**FLOOR, "surface_velocity": (1, 1, 0)}], r"walls\.floor\.surface_velocity .* along one axis"),
        ([{**FLOOR, "surface_velocity": (1, 0, 1)}], r"walls\.floor\.surface_velocity .* along one axis"),
        ([{**TUBE, "length": 0.01}], r"tube\.length = 0\.01 m: LIGGGHTS has endless cylinders only"),
        ([{**TUBE, "axis": (0, 1, 1)}], r"tube\.axis: .* along x, y or z only"),
        ([{**TUBE, "motion": [SPIN]}], r"tube\.motion: .* omega times the distance"),
        ([{**TUBE, "surface_velocity": (1, 0, 1)}], r"tube\.surface_velocity .* along its axis only"),
        ([{**TUBE, "kind": "cone", "end_radius": 0.01, "length": 0.02}], r"tube\.kind = 'cone'"),
    ],
)  # fmt: skip
def test_what_a_deck_cannot_hold_is_refused_by_name(walls, message):
    with pytest.raises(LiggghtsCannotState, match=message):
        render(wall_bounce(walls=walls, contact=RULE))


# -- laws of walls -----------------------------------------------------------------------------------------


def test_wall_has_its_own_law():
    """An unnamed slot is off; a slot that acts nowhere is `no_history` with mu = 0, which is compiled in."""
    text = render(OWN_LAWS["own_tangential_off"]()).text
    assert re.search(r"pair_style +gran model hertz tangential history\n", text)
    assert re.search(r"wall_floor all wall/gran model hertz primitive", text)
    assert re.search(r"wall_side all wall/gran model hertz tangential history primitive", text)
    text = render(OWN_LAWS["own_rolling_cdt"]()).text
    assert "rolling_friction cdt primitive" in text
    assert text.count("coefficientRollingFriction") == 1


def test_properties_of_all_laws():
    """Those of a wall's law too, each once."""
    text = render(OWN_LAWS["own_hooke"]()).text
    assert text.count("youngsModulus") == text.count("characteristicVelocity") == 1
    assert text.count(" kn ") == 0
    assert render(OWN_LAWS["own_stiffness"]()).text.count("property/global kn ") == 1
