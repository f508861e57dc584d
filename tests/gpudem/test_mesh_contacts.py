"""Real corners and curved surfaces under the rule "unique": how many contacts, and where they lead.

Detects: a corner with one contact, a faceted curve with two, a convex wedge with none, a force that jumps
from facet to facet, energy made at an edge, springs lost at one.
"""

from typing import Any

import numpy as np
import pytest

from comparisons.oracles.mesh_shapes import corner, faceted_cylinder, rectangle
from gpudem.scene.sections import Contact
from gpudem.solver.solver import Solver
from tests.gpudem.beds import finish
from tests.gpudem.meshes import forces, hertz, mesh, mesh_scene

pytestmark = pytest.mark.long

RADIUS = 0.05
MERGE = Contact.model_fields["merge_angle"].default


@pytest.mark.parametrize("degrees", [5, 10, 18, 20, 22.5, 25, 45, 90, 120])
def test_a_corner_keeps_two_contacts_above_the_merge_angle(degrees):
    """A ball equally deep in both faces: below the angle one of them, above it both."""
    angle = np.radians(degrees)
    # over the bisector, 5 mm into each face
    way = np.array([-np.sin(angle / 2), 0, np.cos(angle / 2)])
    place = way * 0.045 / np.cos(angle / 2) + [0, 0.013, 0]
    (force,) = forces(corner(angle, 0.3), place[None], RADIUS)
    one = float(hertz(0.005, RADIUS))
    expected = one if degrees < MERGE else 2 * one * np.cos(angle / 2)
    assert np.linalg.norm(force) == pytest.approx(expected, rel=1e-9)


def test_default_angle_is_between_common_numbers_of_facets():
    """18 facets a turn (20 degrees) are a curve, 16 (22.5 degrees) corners; neither is left to rounding."""
    assert 20 + 0.5 < MERGE < 22.5 - 0.5


@pytest.mark.parametrize("degrees", [-0.2, -10, -60, -90])
def test_no_gap_in_a_convex_wedge(degrees):
    """From one face over the edge to the other: always one contact, its force that of the distance."""
    angle = np.radians(degrees)
    around = np.linspace(-0.4, 0.4 - angle, 60)  # direction from the edge: from beside one face to the other
    ways = np.stack([np.sin(around), 0 * around, np.cos(around)], axis=1)
    places = 0.045 * ways + [0, 0.013, 0]
    found = forces(corner(angle, 0.3), places, RADIUS)
    beside, beyond = around < 0, around > -angle
    gap = 0.045 * np.where(beside, np.cos(around), np.where(beyond, np.cos(around + angle), 1.0))
    assert np.linalg.norm(found, axis=1) == pytest.approx(hertz(RADIUS - gap, RADIUS), rel=1e-9)


FACETS = (12, 24, 48, 96, 192)


def order(errors: list[float]) -> float:
    """Of convergence, by the slope over all numbers of facets."""
    return -float(np.polyfit(np.log(FACETS), np.log(errors), 1)[0])


def test_depth_in_a_faceted_cylinder_is_of_second_order():
    """The largest difference of the overlap from the cylinder's, at 50 places around: d (1 - cos(pi/n)) for a
    center at distance d from the axis. Two contacts would be seen at half the places.
    """
    angle = np.linspace(0, 2 * np.pi, 50, endpoint=False)
    places = 0.105 * np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=1) + [0, 0.01, 0]
    errors = []
    for n in FACETS:
        found = forces(faceted_cylinder(n, 0.15, turned=0.1), places, RADIUS, copies=10)
        overlap = 0.005 * (np.linalg.norm(found, axis=1) / hertz(0.005, RADIUS)) ** (2 / 3)
        errors.append(float(np.abs(overlap - 0.005).max()))
        assert errors[-1] <= 0.105 * (1 - np.cos(np.pi / n)) * (1 + 1e-9)
    assert order(errors) == pytest.approx(2.0, abs=0.15)


def swing(wall: dict, **changes: Any) -> dict[str, np.ndarray]:
    """Position, velocity, force of a ball that starts 60 degrees up in a cylinder of 0.15 m, step by step."""
    angle = np.radians(60)
    scene = mesh_scene(
        [wall], 0.1002 * np.array([np.sin(angle), 0.0, -np.cos(angle)]), radius=RADIUS,
        gravity=(0, 0, -9.81), domain={"lo": (-0.3, -0.3, -0.3), "hi": (0.3, 0.3, 0.3)},
        time={"step": 1e-4, "duration": 0.5}, **changes,
    )  # fmt: skip
    solver = Solver(scene, threads=1)
    solver.start(write=True)
    rows: dict[str, list] = {
        name: [] for name in ("position", "velocity", "angular_velocity", "force", "torque")
    }
    for _ in range(scene.n_steps):
        solver.write_step()
        for name, column in rows.items():
            column.append(solver.column(name)[0])
    solver.close()
    return {name: np.array(column) for name, column in rows.items()} | {"mass": scene.masses[:1]}


def slid(steps: int, dt: float, mass: float) -> np.ndarray:
    """Places of the ball in the cylinder itself: velocity Verlet of a point with its Hertz force."""
    angle = np.radians(60)
    x, v, found = 0.1002 * np.array([np.sin(angle), 0.0, -np.cos(angle)]), np.zeros(3), []

    def pull(x: np.ndarray) -> np.ndarray:
        distance = np.hypot(x[0], x[2])
        return np.array([0, 0, -9.81]) - hertz(distance + RADIUS - 0.15, RADIUS) / mass * x / distance

    force = pull(x)
    for _ in range(steps):
        v += dt / 2 * force
        x = x + dt * v
        force = pull(x)
        v += dt / 2 * force
        found.append(x)
    return np.array(found)


def test_a_ball_that_slides_in_facets_tends_to_the_cylinder():
    """Its path over 0.5 s, more than one swing of a pendulum, in 12 to 192 facets. The corners knock a ball
    that nothing damps, so the order is not that of the depth.
    """
    errors, exact = [], np.zeros((1, 3))
    for n in FACETS:
        path = swing(mesh(faceted_cylinder(n, 0.15, turned=0.1)), restitution=1.0)
        exact = slid(len(path["position"]), 1e-4, float(path["mass"][0]))
        errors.append(float(np.abs(path["position"] - exact).max()))
    assert np.ptp(exact[:, 0]) > 0.15
    assert errors[-1] < 5e-4
    assert order(errors) > 1.0


def test_net_force_does_not_jump_over_fine_facets():
    """0.2 degrees a facet. LIGGGHTS counts a second face now and then, here under its own rule too; a
    cylinder makes 0.1 weights within a step. Catches two contacts on a curve.
    """
    jumps = {}
    for rule in ("unique", "liggghts"):
        path = swing(mesh(faceted_cylinder(1800, 0.15)), restitution=0.5, contact={"mesh_contacts": rule})
        settled = path["force"][1000:]
        weight = 9.81 * float(path["mass"][0])
        jumps[rule] = float(np.linalg.norm(np.diff(settled, axis=0), axis=1).max()) / weight
    assert jumps["unique"] < 0.1
    assert jumps["liggghts"] > 0.5


@pytest.mark.parametrize("facets", [18, 48, 1800])
def test_energy_of_a_frictionless_ball_over_concave_edges(facets):
    """Kinetic, potential and elastic energy over 0.5 s: the deepest contact has a potential, the deepest
    overlap, which is continuous across an edge. What is left is the time step's error where the force bends.
    """
    path = swing(mesh(faceted_cylinder(facets, 0.15, turned=0.1)), restitution=1.0)
    mass, x, v = float(path["mass"][0]), path["position"], path["velocity"]
    normals = 2 * np.pi * (np.arange(facets) + 0.5) / facets + 0.1
    depth = x[:, :1] * np.cos(normals) + x[:, 2:] * np.sin(normals)
    overlap = np.maximum(RADIUS - 0.15 + depth.max(axis=1), 0.0)
    energy = 0.5 * mass * (v**2).sum(axis=1) + mass * 9.81 * x[:, 2] + 0.4 * hertz(overlap, RADIUS) * overlap
    swung = 0.5 * mass * (v**2).sum(axis=1).max()
    assert np.abs(energy - energy[0]).max() < 2e-3 * swung
    assert (overlap > 0).any()


def test_energy_over_a_convex_edge():
    """A ball that leaves a table over its rim has the energy that gravity gave it."""
    table = rectangle((-0.5, -0.2, 0), (0.5, 0, 0), (0, 0.4, 0))
    scene = mesh_scene([mesh(table)], (-0.1, 0.01, 0.0499), velocity=(0.3, 0, 0), gravity=(0, 0, -9.81),
                       time={"step": 5e-5, "duration": 0.6})  # fmt: skip
    solver = Solver(scene, threads=1)
    solver.start(write=True)
    energies, x, v = [], np.zeros(3), np.zeros(3)
    for _ in range(scene.n_steps // 40):
        solver.advance(39)
        solver.write_step()
        x, v = solver.column("position")[0], solver.column("velocity")[0]
        edge = np.hypot(max(x[0], 0.0), x[2])
        overlap = max(RADIUS - edge, 0.0) if x[2] > 0 or x[0] > 0 else 0.0
        energies.append(0.5 * v @ v + 9.81 * x[2] + 0.4 * hertz(overlap, RADIUS) * overlap / scene.masses[0])
    solver.close()
    assert x[2] < -0.1
    assert np.ptp(energies) < 1e-3 * 0.5 * v @ v


def test_springs_go_on_over_concave_facets():
    """A ball that rolls in facets of 0.2 degrees: the torque that friction makes has no breaks, as it would
    have if its spring began anew at each facet.
    """
    path = swing(mesh(faceted_cylinder(1800, 0.15)), friction=0.5, restitution=0.3)
    torque = path["torque"][1000:, 1]
    turns = path["angular_velocity"][1000:, 1] * RADIUS
    speed = np.einsum("ij,ij->i", path["velocity"][1000:], path["position"][1000:, [2, 1, 0]] * [1, 0, -1])
    along = speed / np.linalg.norm(path["position"][1000:], axis=1)
    assert np.abs(np.abs(turns) - np.abs(along)).max() < 0.02 * np.abs(along).max()
    assert np.abs(np.diff(torque)).max() < 0.05 * np.abs(torque).max()


def held(walls: list[dict], **changes: Any) -> dict[str, np.ndarray]:
    """A ball that friction holds on a slope of 20 degrees, with rolling friction; 0.2 s."""
    tilt = np.radians(20)
    scene = mesh_scene(
        walls, (0, 0, 0.0499), gravity=(9.81 * np.sin(tilt), 0, -9.81 * np.cos(tilt)), friction=0.8,
        restitution=0.3, rolling=0.6, time={"step": 1e-4, "duration": 0.2},
        contact={"rolling": "epsd2", **changes},
    )  # fmt: skip
    return finish(Solver(scene, threads=1))


def test_springs_survive_walls_that_come_and_go():
    """Another mesh goes at 0.1 s, a third comes at 0.12 s: the ball on the first stays where it is, but for
    the half kick that each set-up takes at other velocities. Its weight is 13 N.
    """
    floor = mesh(rectangle((-0.3, -0.3, 0), (0.6, 0, 0), (0, 0.6, 0), (2, 2)), "floor")
    away = rectangle((-0.3, -0.3, 1), (0.6, 0, 0), (0, 0.6, 0))
    goes, comes = mesh(away, "goes", removed_at=0.1), mesh(away + 1, "comes", present=(0.12,))
    alone, amid = held([floor]), held([floor, goes, comes])
    early = mesh(away, "aaa", removed_at=0.1)
    first = held([early, floor, comes])
    for ours in (amid, first):
        assert np.abs(ours["position"] - alone["position"]).max() < 1e-8
        assert np.abs(ours["force"] - alone["force"]).max() < 1e-4
    assert abs(alone["position"][0, 0]) < 1e-3
    assert abs(alone["torque"][0, 1]) < 0.02  # friction alone: 0.2 N m


def test_rocks_over_a_seam_as_on_a_plane():
    """Rolling friction below its limit is a spring: its torque goes on where a ball rocks to and fro between
    two triangles.
    """
    floor = rectangle((-0.3, -0.3, 0), (0.6, 0, 0), (0, 0.6, 0), (2, 1))
    plane = {"kind": "plane", "name": "plane", "material": "wall", "point": (0, 0, 0), "normal": (0, 0, 1)}
    found = []
    for wall in (mesh(floor), plane):
        scene = mesh_scene([wall], (1e-5, 0.1, 0.0499), velocity=(0.002, 0, 0), spin=(0, 0.04, 0),
                           friction=0.8, rolling=0.6, restitution=0.5, gravity=(0, 0, -9.81),
                           contact={"rolling": "epsd2"}, time={"step": 1e-4, "duration": 0.2})  # fmt: skip
        solver = Solver(scene, threads=1)
        solver.start(write=True)
        way, torque = [], []
        for _ in range(scene.n_steps):
            solver.write_step()
            way.append(solver.column("position")[0, 0])
            torque.append(solver.column("torque")[0, 1])
        solver.close()
        found.append((np.array(way), np.array(torque)))
    (way, torque), (exact_way, exact_torque) = found
    assert np.count_nonzero(np.diff(np.sign(exact_way))) >= 2
    assert np.abs(way - exact_way).max() < 1e-9 * np.abs(exact_way).max()
    assert np.abs(torque - exact_torque).max() < 1e-9 * np.abs(exact_torque).max()
