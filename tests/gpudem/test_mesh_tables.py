"""Tables of triangles: size, speed, shared corners and active features, long and periodic triangles."""

import numpy as np
import pytest

from comparisons.oracles.mesh_contacts import CORNER, EDGE, LiggghtsRule, numbered_nodes
from comparisons.oracles.mesh_shapes import census, faceted_sphere, flattened, folds, rectangle, shuffled
from gpudem.errors import GpudemError
from gpudem.solver.mesh_tables import active_features, bounding_spheres, shared_corners
from gpudem.solver.solver import Solver
from tests.counting import calls
from tests.gpudem.meshes import hertz, mesh, mesh_scene

MESHES = {name: corners for name, corners, _ in census()} | {"flattened": flattened(), "folds": folds()}


@pytest.mark.parametrize("name", MESHES)
def test_active_features(name):
    """Against the rule stated plainly, triangle by triangle."""
    corners = MESHES[name]
    curvature = np.radians(0.256235)
    found = active_features(shared_corners(corners), np.cos(curvature), corners)
    rule = LiggghtsRule(corners, curvature).active
    for k, bits in enumerate(found.tolist()):
        stated = [rule[k, feature] for feature in (*range(EDGE, EDGE + 3), *range(CORNER, CORNER + 3))]
        assert [bool(bits >> j & 1) for j in range(6)] == stated, k


def test_shared_corners():
    """Numbers agree where corners do, whatever they are; rounding of 1e-12 keeps corners together."""
    corners = shuffled(faceted_sphere(), 1) + np.random.default_rng(1).uniform(-1e-13, 1e-13, (80, 3, 3))
    ours, theirs = shared_corners(corners).ravel(), numbered_nodes(corners).ravel()
    assert np.array_equal(ours[:, None] == ours, theirs[:, None] == theirs)
    assert len(np.unique(ours)) == 42


def test_spheres_hold_their_triangles():
    """Catches a sphere that leaves out a corner: a triangle that a ball then does not see."""
    corners = np.random.default_rng(2).normal(size=(500, 3, 3)) + 3
    middle, extent = bounding_spheres(corners)
    outside = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1) / extent
    assert (outside < 1).all()
    assert outside.min() > 0.999


@pytest.mark.long
def test_a_hundred_thousand_triangles(monkeypatch):
    """Tables without a loop over triangles; 1e5 balls, each on its own place of the mesh, touch it once."""
    floor = rectangle((-5, -5, 0), (10, 0, 0), (0, 10, 0), (224, 224))
    assert calls(active_features, shared_corners(floor), 1.0, floor) < 1000
    places = np.stack(np.meshgrid(*[np.linspace(-4.9, 4.9, 317)] * 2), axis=-1).reshape(-1, 2)[:100_000]
    position = np.column_stack([places, np.full(len(places), 0.0149)])
    monkeypatch.setattr("gpudem.scene.mesh.Mesh.gap", lambda mesh, points: points[:, 2])  # of the host
    scene = mesh_scene([mesh(floor)], position, radius=0.015, time={"step": 1e-5, "duration": 1e-3})
    solver = Solver(scene)
    solver.start(write=True)
    assert solver.contact_count() == len(position)
    assert 150 < solver._meshes.bytes_per_triangle < 260
    solver.close()


@pytest.mark.long
def test_a_ball_of_thousands_of_entries():
    """A ball 50 times a triangle, in disorder: the plane's contact, and its spring over rebuilds."""
    fine = shuffled(rectangle((-0.06, -0.06, 0), (0.12, 0, 0), (0, 0.12, 0), (60, 60)), 1)
    plane = {"kind": "plane", "name": "plane", "material": "wall", "point": (0, 0, 0), "normal": (0, 0, 1)}
    found = []
    for wall in (mesh(fine), plane):
        scene = mesh_scene([wall], (0, 0, 0.0495), velocity=(0.5, 0, 0), friction=0.5, restitution=0.5,
                           gravity=(0, 0, -9.81), time={"step": 1e-4, "duration": 0.03},
                           solver={"skin": 0.002})  # fmt: skip
        solver = Solver(scene, threads=1)
        solver.start(write=True)
        entries = int(solver.state.particles.start.numpy()[-1])
        solver.advance(scene.n_steps - 1)
        solver.write_step(last=True)
        found.append((entries, solver.neighbors.rebuilds, solver.frame()))
        solver.close()
    (entries, rebuilds, ours), (_, _, exact) = found
    assert entries > 400
    assert rebuilds > 3
    for column in ("position", "velocity", "angular_velocity", "torque"):
        scale = np.abs(exact[column]).max()
        assert np.abs(ours[column] - exact[column]).max() < 1e-11 * scale, column
    assert np.abs(exact["torque"]).max() > 0


@pytest.mark.long
@pytest.mark.parametrize(("precision", "tolerance"), [("float64", 1e-9), ("float32", 2e-2)])
def test_a_triangle_a_thousand_balls_long(precision, tolerance):
    """Two slivers of 100 m x 0.2 m: the force of the plane at every place, over their seam too."""
    long = rectangle((-50, -0.1, 0), (100, 0, 0), (0, 0.2, 0))
    rng = np.random.default_rng(1)
    place = np.column_stack([rng.uniform(-49, 49, 200), rng.uniform(-0.09, 0.09, 200), np.full(200, 0.045)])
    place[:100, 1] = place[:100, 0] * 0.002 + rng.normal(0, 1e-3, 100)  # about the diagonal
    place = place[np.argsort(place[:, 0])]
    place[:, 0] = np.linspace(-49, 49, 200)  # apart from each other
    scene = mesh_scene([mesh(long)], place, radius=0.05, solver={"precision": precision},
                       domain={"lo": (-51, -1, -1), "hi": (51, 1, 1)}, allow=["overlap"])  # fmt: skip
    solver = Solver(scene, threads=1)
    solver.start(write=True)
    force = solver.column("force")
    solver.close()
    assert force[:, 2] == pytest.approx(hertz(0.005, 0.05), rel=tolerance)


def test_a_triangle_too_long_for_periodic_sides_is_refused():
    """Three images of it could not be told apart."""
    floor = mesh(rectangle((-4, -0.5, 0), (8, 0, 0), (0, 1, 0)))
    domain = {"lo": (-0.5, -0.5, -0.5), "hi": (0.5, 0.5, 0.5), "periodic": (True, False, False)}
    scene = mesh_scene([floor], (0, 0, 0.049), radius=0.05, domain=domain)
    with pytest.raises(GpudemError, match=r"walls: mesh: triangle 1 is 8 m long across the periodic"):
        Solver(scene)


def test_a_ball_deep_in_a_mesh_is_named():
    """As with a plane: the run ends with the particle, the mesh and what to do."""
    floor = mesh(rectangle((-0.3, -0.3, 0), (0.6, 0, 0), (0, 0.6, 0)), "floor")
    soft = {name: {"young": 5e3, "poisson": 0.3, "density": 2500.0} for name in ("ball", "wall")}
    scene = mesh_scene([floor], (0, 0.01, 0.049), velocity=(0, 0, -3), materials=soft,
                       allow=["unusual_units"], time={"step": 1e-4, "duration": 0.05})  # fmt: skip
    solver = Solver(scene, threads=1)
    solver.start()
    with pytest.raises(GpudemError, match=r"particle 1 overlaps wall floor by more than 0\.5 of the radius"):
        solver.advance(400)
    solver.close()
