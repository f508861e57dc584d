"""The rule "unique" knows the surface only: not its triangles, their order, corners, meshes or frame.

Detects: a contact that depends on the order of triangles or on shared corners, a seam or a T-junction with
two contacts or none, a distance or a normal that is not turned back, a flat mesh that is not its plane.
"""

import numpy as np
import pytest

from comparisons.oracles.mesh_shapes import (
    corner,
    cube,
    divided,
    faceted_cylinder,
    faceted_sphere,
    positions_near,
    rectangle,
    shuffled,
)
from gpudem.solver.solver import Solver
from tests.gpudem.beds import finish
from tests.gpudem.meshes import forces, hertz, mesh, mesh_scene, random_turn

pytestmark = pytest.mark.long

RADIUS = 0.05
SHAPES = {
    "floor and wall": corner(np.pi / 2, 0.1),
    "cube": cube(),
    "sphere": faceted_sphere(),
    "cylinder": faceted_cylinder(16),
}


def parts(corners: np.ndarray, count: int) -> list[np.ndarray]:
    """The mesh dealt out to several, each of every so many triangles: seams everywhere."""
    return [corners[k::count] for k in range(count)]


#: Name -> (the same surface otherwise: a mesh or several, turn of the scene, tolerance as a share of the
#: largest force). Coordinates in float32 move the surface by 6e-8 of them; a force is 1.5 times that of an
#: overlap, here of some 1e-3 of the coordinates at worst.
CHANGES = {
    "shuffled": lambda c: (shuffled(c, 1, renumber=False), None, 1e-10),
    "renumbered": lambda c: (shuffled(c, 2), None, 1e-10),
    "inverted": lambda c: (c[:, [0, 2, 1]], None, 1e-10),
    "divided": lambda c: (divided(c, 3, 2 * len(c)), None, 1e-9),
    "duplicated": lambda c: (np.concatenate([c, shuffled(c, 4)]), None, 1e-10),
    "two meshes": lambda c: (parts(c, 2), None, 1e-10),
    "a mesh a triangle": lambda c: (
        [*parts(c[:12], min(12, len(c))), *([c[12:]] * (len(c) > 12))],
        None,
        1e-10,
    ),
    "turned": lambda c: (c, random_turn(5), 1e-9),
    "float32": lambda c: (c.astype(np.float32).astype(float), None, 1e-4),
}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("change", CHANGES)
def test_force_is_that_of_the_surface(shape, change):
    corners = SHAPES[shape]
    positions = positions_near(corners, RADIUS, 400, seed=6)
    other, turn, tolerance = CHANGES[change](corners)
    found = forces(other, positions, RADIUS, turn=turn)
    expected = forces(corners, positions, RADIUS)
    scale = np.abs(expected).max()
    assert scale > 100
    assert np.abs(found - expected).max() < tolerance * scale


@pytest.mark.parametrize("seed", range(3))
def test_a_flat_mesh_is_a_plane(seed):
    """Cut at random, shuffled, in three meshes, in a turned frame: where it is, the force of the plane."""
    floor = shuffled(divided(rectangle((-0.4, -0.4, 0), (0.8, 0, 0), (0, 0.8, 0)), seed, 60), seed)
    rng = np.random.default_rng(seed)
    places = np.column_stack([rng.uniform(-0.3, 0.3, (500, 2)), rng.uniform(0.03, 0.0499, 500)])
    found = forces(parts(floor, 3), places, RADIUS, copies=50, turn=random_turn(seed))
    assert found[:, 2] == pytest.approx(hertz(RADIUS - places[:, 2], RADIUS), rel=1e-9)
    assert np.abs(found[:, :2]).max() < 1e-9 * found[:, 2].max()


def test_on_the_seam_itself():
    """Centers over a seam, a node and a T-junction, and there but for rounding: one contact, its normal the
    plane's. Catches the tie of a face and an edge decided by rounding, for a normal tilted by 1e-8.
    """
    floor = rectangle((-0.2, -0.2, 0), (0.4, 0, 0), (0, 0.4, 0), (2, 2))
    t_junction = np.concatenate([floor[2:], divided(floor[:2], 1, 1)])
    steps = np.array([0, 1e-17, -1e-16, 3e-12, -1e-10, 2e-9, -1e-8, 3e-8])
    places = np.array([(a, b, 0.045) for a in steps for b in (0.0, 1e-9, 0.07)])
    for body in (floor, t_junction, [floor[:4], floor[4:]]):
        found = forces(body, places, RADIUS, copies=24)
        assert found[:, 2] == pytest.approx(hertz(0.005, RADIUS), rel=1e-12)
        assert np.abs(found[:, :2]).max() < 1e-12 * found[0, 2]


def test_seam_in_float32_coordinates():
    """Two meshes whose seam agrees to float32 only, one with twice the nodes, some 3e-8 apart: one contact.

    Catches a tolerance that is rounding in float64.
    """
    one = rectangle((-0.3, -0.3, 0.1), (0.3, 0, 0), (0, 0.6, 0), (1, 3))
    other = rectangle((0, -0.3, 0.1), (0.3, 0, 0), (0, 0.6, 0), (1, 7))
    turn = random_turn(7)
    bodies = [((part @ turn.T).astype(np.float32).astype(float)) @ turn for part in (one, other)]
    assert np.abs(bodies[0] - one).max() > 1e-9
    rng = np.random.default_rng(8)
    places = np.column_stack([rng.normal(0, 0.003, 300), rng.uniform(-0.2, 0.2, 300), np.full(300, 0.145)])
    found = forces(bodies, places, RADIUS, copies=1)
    assert found[:, 2] == pytest.approx(hertz(0.005, RADIUS), rel=1e-4)


@pytest.mark.parametrize("precision", ["float64", "mixed", "float32"])
def test_rolls_over_a_shuffled_mesh_as_over_a_plane(precision):
    """0.5 m over 160 triangles in disorder, with friction and rolling friction, by its springs."""
    floor = shuffled(divided(rectangle((-0.5, -0.5, 0), (1, 0, 0), (0, 1, 0), (4, 4)), 1, 130), 1)
    plane = {"kind": "plane", "name": "plane", "material": "wall", "point": (0, 0, 0), "normal": (0, 0, 1)}

    def end(wall):
        scene = mesh_scene(
            [wall], (-0.3, -0.05, 0.0499), velocity=(2, 0.3, 0), friction=0.4, restitution=0.6,
            rolling=0.01, contact={"rolling": "epsd2"}, gravity=(0, 0, -9.81),
            time={"step": 5e-5, "duration": 0.3}, solver={"precision": precision},
            domain={"lo": (-1, -1, -1), "hi": (1, 1, 1)},
        )  # fmt: skip
        return finish(Solver(scene, threads=1))

    ours, exact = end(mesh(floor)), end(plane)
    tolerance = {"float64": 1e-11, "mixed": 1e-5, "float32": 1e-3}[precision]
    for column in ("position", "velocity", "angular_velocity"):
        scale = np.abs(exact[column]).max()
        assert np.abs(ours[column] - exact[column]).max() < tolerance * scale, column
    assert exact["position"][0, 0] > 0.1
