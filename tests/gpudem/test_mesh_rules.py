"""Which triangles count, by both rules, against NumPy: random positions, and a ball that moves over faces.

Detects: an edge or corner counted twice or not at all, a triangle taken for another, the deepest contact not
chosen, an active feature of the wrong triangle, a face that does not keep its contact.
"""

import numpy as np
import pytest

from comparisons.oracles.mesh_contacts import LiggghtsRule, Surface
from comparisons.oracles.mesh_shapes import (
    census,
    corner,
    cube,
    faceted_sphere,
    flattened,
    folds,
    positions_near,
    rectangle,
)
from gpudem.solver.solver import Solver
from tests.gpudem.meshes import MATERIALS, forces, hertz, mesh, mesh_scene, total_force

pytestmark = pytest.mark.long

CENSUS = {name: (corners, radius) for name, corners, radius in census()}
#: Obtuse triangles; folds, and triangles of one plane that are wound against each other.
ODD = {"flattened": (flattened(), 0.05), "folds": (folds(), 0.05)}

#: Random positions of each mesh.
POSITIONS = 1700
UNIQUE, LIGGGHTS = {"mesh_contacts": "unique"}, {"mesh_contacts": "liggghts"}
CURVATURE = np.radians(0.256235)


def worst(found: np.ndarray, expected: np.ndarray) -> float:
    return float(np.abs(found - expected).max()) / float(np.abs(expected).max())


@pytest.mark.parametrize("name", CENSUS)
def test_unique_is_one_contact_for_each_least_distance(name):
    """Local minima of the distance, found from what meets at each edge and corner, merged or not.

    Two faces that are nearly one plane are one even with merge angle 0, see `ON_TRIANGLE`: none is here.
    """
    corners, radius = CENSUS[name]
    surface = Surface(corners)
    positions = positions_near(corners, radius, POSITIONS, seed=3)
    for merge in (0.0, 21.0):
        found = forces(corners, positions, radius, contact={**UNIQUE, "merge_angle": merge})
        contacts = [surface.unique_contacts(x, radius, np.radians(max(merge, 0.5))) for x in positions]
        assert worst(found, np.array([total_force(c, radius) for c in contacts])) < 1e-9
        assert min(len(c) for c in contacts) >= 1


@pytest.mark.long
@pytest.mark.parametrize("name", [*CENSUS, *ODD])
def test_liggghts_rule(name):
    """The six rules of its binary; `test_random_places` compares with the binary itself."""
    corners, radius = (CENSUS | ODD)[name]
    positions = positions_near(corners, radius, POSITIONS, seed=4)
    found = forces(corners, positions, radius, contact=LIGGGHTS)
    rule, expected = LiggghtsRule(corners, CURVATURE), []
    for x in positions:
        rule.touching = set()  # nothing was in contact before
        expected.append(total_force(rule.contacts(x, radius), radius))
    assert worst(found, np.array(expected)) < 1e-9


def test_rules_differ():
    """The census can tell them apart: LIGGGHTS counts more contacts at a shuffled sphere."""
    corners, radius = CENSUS["faceted sphere, shuffled"]
    positions = positions_near(corners, radius, 300, seed=5)
    one, other = (forces(corners, positions, radius, contact=rule) for rule in (UNIQUE, LIGGGHTS))
    assert worst(one, other) > 0.1


def rolled(corners: np.ndarray, curvature: float, velocity: tuple[float, float, float]) -> float:
    """Largest difference of the force of a ball that flies along a mesh from LIGGGHTS' rule, relative."""
    radius = 0.05
    start = (-0.03 * np.sign(velocity[0]), 0.013, 0.0495)
    scene = mesh_scene(
        [mesh(corners)], start, radius=radius, velocity=velocity,
        contact={**LIGGGHTS, "mesh_curvature": np.degrees(curvature)},
        materials={**MATERIALS, "ball": {**MATERIALS["ball"], "density": 2e5}},
        allow=["overlap", "unusual_units"],
    )  # fmt: skip
    solver, rule, found = Solver(scene, threads=1), LiggghtsRule(corners, curvature), []
    solver.start(write=True)
    for _ in range(300):
        x, force = solver.column("position")[0], solver.column("force")[0]
        found.append((force, total_force(rule.contacts(x, radius), radius)))
        solver.write_step()
    solver.close()
    ours, theirs = (np.array(column) for column in zip(*found, strict=True))
    assert np.ptp(np.linalg.norm(theirs, axis=1)) > 0.1 * np.abs(theirs).max()
    return worst(ours, theirs)


@pytest.mark.parametrize("direction", [1, -1])
def test_a_face_keeps_its_contact(direction):
    """Over a concave edge of 10 degrees that the curvature makes one plane: the way back is another."""
    assert rolled(corner(np.radians(10)), np.radians(15), (2.0 * direction, 0.0, -0.05)) < 1e-9


def test_minima_of_a_known_place():
    """The oracle itself: above a face, beside an edge, beyond a corner of a cube."""
    body = Surface(cube(0.2))
    for x, distance in (((0.01, 0.02, 0.13), 0.03), ((0.13, 0.14, 0.02), 0.05), ((0.13, 0.14, 0.22), 0.13)):
        gap, normal = min(body.minima(np.array(x)), key=lambda found: found[0])
        assert gap == pytest.approx(distance, rel=1e-12)
        assert np.linalg.norm(normal) == pytest.approx(1, rel=1e-12)
    inside = body.minima(np.array((0.01, 0.02, 0.03)))
    assert sorted(gap for gap, _ in inside) == pytest.approx([0.07, 0.08, 0.09, 0.11, 0.12, 0.13], rel=1e-12)


def test_known_forces_of_liggghts():
    """Its own numbers (R 50 mm, overlap 5 mm, 579.17 N an overlap): face, coplanar seam, floor and wall, an
    edge in a convex corner. Catches an emulator and a kernel that share a mistake.
    """
    one = float(hertz(0.005, 0.05))
    floor = rectangle((-0.2, -0.2, 0), (0.4, 0, 0), (0, 0.4, 0))
    places = np.array([(0.05, -0.03, 0.045), (0.0, 0.0, 0.045), (0.0401, 0.04, 0.045)])
    found = forces(floor, places, 0.05, contact=LIGGGHTS)
    assert found[:, 2] == pytest.approx(one, rel=1e-12)
    both = forces(corner(np.pi / 2, 0.2), np.array([(-0.045, 0.013, 0.045)]), 0.05, contact=LIGGGHTS)[0]
    assert (-both[0], both[2]) == pytest.approx((one, one), rel=1e-12)
    wedge = corner(np.radians(-0.2), 0.2)  # convex: no face is nearest over the edge, and LIGGGHTS has none
    over = np.array([(0.0, 0.013, 0.045)]) + 0.045 * np.array([np.sin(np.radians(-0.1)), 0, 0])
    assert forces(wedge, -over * (1, 1, -1), 0.05, contact=LIGGGHTS)[0] == pytest.approx(0, abs=1e-12)
    assert forces(wedge, -over * (1, 1, -1), 0.05, contact=UNIQUE)[0, 2] == pytest.approx(one, rel=1e-3)


def test_sphere_that_is_fine():
    """A faceted sphere of 1280 triangles from inside: one contact nearly everywhere, as in a sphere."""
    corners = faceted_sphere(0.2, 3)
    ways = np.random.default_rng(1).normal(size=(100, 3))
    places = 0.145 * ways / np.linalg.norm(ways, axis=1)[:, None]
    found = forces(corners, places, 0.06, copies=20)
    inwards = -np.einsum("ij,ij->i", found, places / 0.145)
    assert inwards == pytest.approx(hertz(0.005, 0.06), rel=0.35)
    assert np.abs(found + inwards[:, None] * places / 0.145).max() < 0.2 * hertz(0.005, 0.06)
