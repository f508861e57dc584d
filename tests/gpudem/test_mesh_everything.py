"""Meshes in every setting of the solver: a bed in a box of triangles moves as in the box of planes.

Detects: a setting in which triangles are not seen, seen twice, or lose their springs - a precision, a law, an
integrator, a material, a size class, a gate, a periodic side, a full list, a graph of launches, a restart.
"""

from typing import Any

import numpy as np
import pytest

from comparisons.oracles.mesh_shapes import divided, rectangle, shuffled
from gpudem.scene import Scene
from gpudem.solver.solver import Solver
from tests.gpudem.beds import PAIRS, falling_bed, finish, same
from tests.gpudem.meshes import mesh
from tests.gpudem.on_cpu import SHORT, apart, two_materials

#: Many kernels to compile: not in the fast part of the tests.
pytestmark = pytest.mark.long

LO, HI = np.array((0.0, 0.0, 0.0)), np.array((0.2, 0.05, 0.4))
GATE = falling_bed().walls[1].model_dump()


def sides(names: str, over: float = 0.0) -> np.ndarray:
    """Both sides of the box across each axis, but for its lid, as rectangles that reach `over` [m] beyond it;
    in triangles of all shapes and in disorder.
    """
    found = []
    for axis in ("xyz".index(name) for name in names):
        along, u, v = (np.roll(np.eye(3)[axis], k) for k in range(3))
        for place in (LO, HI)[: 1 if axis == 2 else 2]:
            begin, size = np.where(along > 0, place, LO - over), HI - LO + 2 * over
            found.append(rectangle(begin, (size @ u) * u, (size @ v) * v))
    return shuffled(divided(np.concatenate(found), 1, 25), 2)


def planes(names: str) -> list[dict[str, Any]]:
    box = {"kind": "box", "name": "box", "material": "wall", "lo": tuple(LO), "hi": tuple(HI)}
    chosen = [f"{axis}{end}" for axis in names for end in ("lo", "hi") if axis + end != "zhi"]
    return [{**box, "sides": chosen}]


def bed(walls: list[dict[str, Any]], **changes: Any) -> Scene:
    data: dict[str, Any] = {"time": SHORT, "walls": walls, **changes}
    return falling_bed(data.pop("count", 700), **data)


ROLLS = [{**p, "rolling_friction": 0.2} for p in PAIRS]
SETTINGS: dict[str, dict[str, Any]] = {
    "friction": {},
    "frictionless": {"pairs": [{**p, "friction": 0.0} for p in PAIRS]},
    "no history": {"contact": {"tangential": "no_history"}},
    "path": {"solver": {"integrator": "path"}},
    "hooke": {"contact": {"normal": "hooke", "characteristic_velocity": 0.5}},
    "cdt": {"contact": {"rolling": "cdt"}, "pairs": ROLLS},
    "epsd2": {"contact": {"rolling": "epsd2"}, "pairs": ROLLS},
    "liggghts": {"contact": {"mesh_contacts": "liggghts"}},
    "mixed": {"solver": {"precision": "mixed"}},
    "float32": {"solver": {"precision": "float32"}},
}
TOLERANCE = {"mixed": 1e-4, "float32": 2e-2}
REHEARSED = {"half_list": False, "chunk": 32, "rebuild_in_graph": True}


def solve(scene: Scene, **options: Any) -> dict[str, np.ndarray]:
    solver = Solver(scene, threads=1, **options)
    solver.graphs = bool(options.get("rebuild_in_graph"))
    found = finish(solver)
    assert solver.neighbors.rebuilds > 5
    return found


@pytest.mark.parametrize("name", SETTINGS)
def test_a_box_of_triangles_is_a_box_of_planes(name):
    keys = SETTINGS[name]
    of_planes = {k: v for k, v in keys.get("contact", {}).items() if k != "mesh_contacts"}
    exact = solve(bed(planes("xyz"), **{**keys, "contact": of_planes}))
    found = solve(bed([mesh(sides("xyz"))], **keys))
    assert apart(exact, found) < TOLERANCE.get(name, 1e-8)
    touching = (exact["position"] < LO + 0.003).any(axis=1) | (exact["position"] > HI - 0.003).any(axis=1)
    assert np.count_nonzero(touching) > 20


@pytest.mark.parametrize("name", SETTINGS)
def test_full_list_in_a_graph(name):
    """What a CUDA device does, rehearsed: as the half list, and the same bits with other launches."""
    scene = bed([mesh(sides("xyz"))], **SETTINGS[name])
    found = solve(scene, **REHEARSED)
    assert apart(solve(scene), found) < TOLERANCE.get(name, 1e-9)
    for options in ({"rebuild_in_graph": False}, {"chunk": 7}):
        same(found, solve(scene, **{**REHEARSED, **options}))


def test_two_materials_and_sizes():
    """Radius, mass and material of each ball. Catches the largest radius, or the first material, for all."""
    stated = two_materials()
    exact = solve(stated.replace(walls=planes("xyz")))
    found = solve(stated.replace(walls=[mesh(sides("xyz"))]))
    assert apart(exact, found) < 1e-8


def test_size_classes():
    """A ball of 15 mm among those of 2 mm: many entries, found again at each rebuild."""
    rng = np.random.default_rng(1)
    grid = np.stack(np.meshgrid(*[np.arange(n) for n in (20, 9, 5)], indexing="ij"), -1).reshape(-1, 3)
    small = (grid + 0.5) * 0.005 + [0.04, 0.002, 0.06] + rng.uniform(-3e-4, 3e-4, grid.shape)
    position = np.concatenate([[(0.016, 0.024, 0.02)], small])
    radius = np.concatenate([[0.015], np.full(len(small), 0.002)])
    particles = {"source": "explicit", "material": "ball", "position": position, "radius": radius,
                 "velocity": np.broadcast_to((-0.3, 0.1, -1.0), position.shape)}  # fmt: skip
    time = {"step": 1e-5, "duration": 0.05}
    exact = solve(bed(planes("xyz"), particles=particles, time=time))
    solver = Solver(bed([mesh(sides("xyz"))], particles=particles, time=time), threads=1)
    assert solver.spec.size_classes
    assert apart(exact, finish(solver)) < 1e-8


def test_a_gate_of_triangles():
    """Removed within the run, beside a mesh that stays and keeps its springs."""
    gate = {**GATE, "removed_at": 0.01}
    exact = solve(bed([*planes("xyz"), gate], time={"step": 2e-5, "duration": 0.02}))
    door = mesh(rectangle((0.1, -0.01, -0.01), (0, 0.07, 0), (0, 0, 0.5)), "gate", removed_at=0.01)
    found = solve(bed([mesh(sides("xyz")), door], time={"step": 2e-5, "duration": 0.02}))
    assert apart(exact, found) < 1e-7


@pytest.mark.parametrize("rule", ["unique", "liggghts"])
def test_goes_on_from_a_saved_state(rule):
    """Bit for bit, across periodic sides. Catches a mark, spring or image that is not stored."""
    walls = [mesh(FLOORS["fine"]), mesh(sides("x", 0.02), "ends")]
    scene = periodic(walls, contact={"mesh_contacts": rule})
    whole = solve(scene)
    first, second = Solver(scene, threads=1), Solver(scene, threads=1)
    first.start()
    first.advance(scene.n_steps - 200 - 1)
    second.load_state_dict(first.state_dict())
    second.advance(200)
    second.write_step(last=True)
    same(whole, second.frame())
    first.close()
    second.close()


#: A floor across the periodic side y, 50 mm long -> its triangles.
FLOORS = {
    "two triangles": rectangle((-0.01, 0, 0), (0.22, 0, 0), (0, 0.05, 0)),
    "fine": shuffled(rectangle((-0.01, 0, 0), (0.22, 0, 0), (0, 0.05, 0), (9, 7)), 1),
    "shifted": rectangle((-0.01, 0.03, 0), (0.22, 0, 0), (0, 0.05, 0)),
    "beyond both sides": rectangle((-0.01, -0.02, 0), (0.22, 0, 0), (0, 0.09, 0)),
    "divided": divided(rectangle((-0.01, -0.01, 0), (0.22, 0, 0), (0, 0.05, 0)), 2, 30),
}


def periodic(walls: list[dict[str, Any]], **changes: Any) -> Scene:
    """The bed with a wind along y, through the side and over the floor."""
    started = falling_bed(700).state
    particles = {"source": "explicit", "material": "ball", "radius": 0.003, "position": started.position,
                 "velocity": started.velocity + np.array((0, 2.0, -0.5))}  # fmt: skip
    domain = {"lo": (-0.001, 0, -0.001), "hi": (0.201, 0.05, 0.401), "periodic": (False, True, False)}
    keys = {"time": {"step": 2e-5, "duration": 0.03}, **changes}
    return bed(walls, particles=particles, domain=domain, **keys)


@pytest.mark.parametrize("name", FLOORS)
def test_across_periodic_sides(name):
    """Balls pass the side while they roll on the floor: contacts, springs, and which image of a triangle."""
    exact = solve(periodic(planes("xz")))
    found = solve(periodic([mesh(FLOORS[name]), mesh(sides("x", 0.02), "ends")]))
    assert apart(exact, found) < 1e-7
    assert np.count_nonzero(exact["position"][:, 2] < 0.003) > 5


@pytest.mark.parametrize("precision", ["float64", "mixed", "float32"])
def test_a_floor_that_moves_on_through_periodic_sides(precision):
    """0.4 m in 0.03 s, eight times the side: as the plane that moves so. With less precision for less time:
    the balls that are thrown up amplify rounding.
    """
    motion = [{"type": "linear", "velocity": (0, 13.0, 0)}]
    duration = {"float64": 0.03, "mixed": 0.015, "float32": 0.01}[precision]
    keys = {"solver": {"precision": precision}, "time": {"step": 2e-5, "duration": duration}}
    exact, found = (
        solve(periodic([{**wall, "motion": motion}, *planes("x")], **keys))
        for wall in (
            {"kind": "plane", "name": "floor", "material": "wall", "point": (0, 0, 0), "normal": (0, 0, 1)},
            mesh(FLOORS["fine"], "floor"),
        )
    )
    assert apart(exact, found) < {"float64": 1e-6, "mixed": 1e-3, "float32": 0.05}[precision]


def test_forces_on_walls_across_periodic_sides():
    """Of a floor and of ends, each to its own wall, and over its triangles. Catches the entry of an image
    taken for a triangle, the first triangles of the scene taken for those of a mesh.
    """
    loads = []
    for walls in (
        [{"kind": "plane", "name": "floor", "material": "wall", "point": (0, 0, 0), "normal": (0, 0, 1)}],
        [mesh(FLOORS["fine"], "floor")],
    ):
        meshes = ("ends", *(wall["name"] for wall in walls if wall["kind"] == "mesh"))
        output = {"history_every": 0.01, "wall_forces": ("ends", "floor"), "wall_stress": meshes}
        scene = periodic([mesh(sides("x", 0.02), "ends"), *walls], output=output)
        solver = Solver(scene, threads=1)
        solver.start()
        solver.advance(400)
        solver.write_step()
        loads.append({name: load.force for name, load in solver.wall_loads().items()})
        for name, forces in solver.triangle_forces().items():
            assert forces.sum(axis=0) == pytest.approx(loads[-1][name], rel=1e-12)
            assert len(forces) == len(next(w.corners for w in scene.meshes if w.name == name))
        solver.close()
    exact, found = loads
    assert set(exact) == {"ends", "floor"}
    for name, force in exact.items():
        assert np.abs(force).max() > 1e-3, name
        assert found[name] == pytest.approx(force, rel=1e-6), name
