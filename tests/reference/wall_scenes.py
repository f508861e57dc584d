"""Small scenes with meshes, walls that move and walls with laws of their own, for both codes."""

from __future__ import annotations

from typing import Any

import numpy as np

from comparisons.oracles.mesh_shapes import folds
from gpudem.scene import Scene
from tests.reference.scenes import FLOOR, R, scene

RULE = {"mesh_contacts": "liggghts"}
#: 5 us: 8000 steps are 40 ms.
DT = 5e-6
#: Height of a ball on a floor that carries its weight at 300 m/s2 [m]; it stays in contact.
PRESSED = 0.002972


def grid(count: int, size: float, height=None, seed: int | None = None) -> dict:
    """A square of 2 count^2 triangles around the origin [m], side `size`; `height` gives z of points."""
    line = np.linspace(-size / 2, size / 2, count + 1)
    x, y = (a.ravel() for a in np.meshgrid(line, line, indexing="ij"))
    z = np.zeros_like(x) if height is None else height(x, y)
    rows = np.arange((count + 1) ** 2).reshape(count + 1, count + 1)
    a, b, c, d = rows[:-1, :-1].ravel(), rows[1:, :-1].ravel(), rows[1:, 1:].ravel(), rows[:-1, 1:].ravel()
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    if seed is not None:
        triangles = np.random.default_rng(seed).permutation(triangles)
    return {"vertices": np.stack([x, y, z], 1), "triangles": triangles}


def mesh(name: str = "floor", **more) -> dict:
    """A mesh of the wall's material."""
    return {"kind": "mesh", "name": name, "material": "wall", **more}


def strips(profile) -> dict:
    """A sheet along y through the points (x, z) of a profile, two triangles a strip, in its order."""
    points = np.array([[x, y, z] for x, z in profile for y in (-0.025, 0.025)])
    triangles = []
    for k in range(len(profile) - 1):
        a, b, c, d = 2 * k, 2 * k + 1, 2 * k + 3, 2 * k + 2
        triangles += [[a, d, c], [a, c, b]]
    return {"vertices": points, "triangles": np.array(triangles)}


def cylinder(radius: float, sides: int, half: float = 0.02) -> dict:
    """The inside of a faceted cylinder about y."""
    angle = 2 * np.pi * np.arange(sides + 1) / sides
    profile = [(radius * np.sin(a), -radius * np.cos(a)) for a in angle[:-1]]
    points = np.array([[x, y, z] for x, z in profile for y in (-half, half)])
    triangles = []
    for k in range(sides):
        j = (k + 1) % sides
        a, b, c, d = 2 * k, 2 * k + 1, 2 * j + 1, 2 * j
        triangles += [[a, d, c], [a, c, b]]
    return {"vertices": points, "triangles": np.array(triangles)}


def rolling(name: str, wall: dict | list, steps: int = 6000, **more: Any) -> Scene:
    """A ball pressed on a floor by gravity, which slides and rolls along x and y."""
    more = {"position": [[-0.0191, -0.0083, PRESSED]], "velocity": [[0.8, 0.31, 0.0]], **more}
    return scene(
        name, steps=steps, every=1, walls=wall if isinstance(wall, list) else [wall],
        gravity=more.pop("gravity", (0.0, 0.0, -300.0)), spin=more.pop("spin", [[20.0, -30.0, 5.0]]),
        contact=RULE | more.pop("contact", {}), time={"step": DT, "duration": steps * DT},
        output={"trace_every": 10 * DT, "history_every": 10 * DT, **more.pop("output", {})},
        domain={"lo": (-0.05, -0.05, -0.05), "hi": (0.05, 0.05, 0.05)},
        position=more.pop("position"), velocity=more.pop("velocity"), **more,
    )  # fmt: skip


FLAT = grid(16, 0.04)


def moved(name: str, *motions: dict, **more) -> Scene:
    """A ball on a flat mesh that moves."""
    more = {"position": [[0.0031, -0.0043, PRESSED]], "velocity": [[0.1, 0.05, 0.0]], "steps": 3000, **more}
    return rolling(name, mesh(motion=list(motions), **FLAT), **more)


LINEAR = {"type": "linear", "velocity": (0.3, -0.1, 0.02)}
ROTATE = {"type": "rotate", "axis": (0.1, 0.2, 1.0), "point": (0.004, 0.0, 0.0), "period": 0.05}
OSCILLATE = {"type": "oscillate", "amplitude": (0.002, 0.0, 0.0005), "period": 0.01}
SWING = {
    "type": "swing",
    "axis": (0.0, 1.0, 0.1),
    "point": (0.01, 0.0, 0.0),
    "period": 0.02,
    "amplitude": 0.05,
}
TABLE = {
    "type": "table",
    "time": [0.002, 0.004, 0.008],
    "velocity": [[0, 0, 0], [0.4, 0.1, 0.05], [-0.3, 0, 0]],
}
TURN_TABLE = {
    "type": "table", "axis": (0, 0, 1), "point": (0.004, 0, 0), "time": [0.001, 0.005, 0.01],
    "angular_velocity": [0.0, 80.0, -50.0],
}  # fmt: skip
FRICTION: dict[str, Any] = {"pair": {"rolling_friction": 0.02}, "wall_pair": {"rolling_friction": 0.01}}


def drum() -> Scene:
    """Five balls of two sizes in a rotating drum of 18 facets."""
    return rolling(
        "drum",
        mesh("drum", motion=[{"type": "rotate", "axis": (0, 1, 0), "period": 0.1}], **cylinder(0.02, 18)),
        steps=4000,
        particles={
            "source": "explicit",
            "material": "ball",
            "radius": [R, 0.002, R, 0.002, R],
            "position": [
                [0, 0, -0.0169],
                [0.006, 0.001, -0.0165],
                [-0.007, 0, -0.0155],
                [0.001, 0.006, -0.0175],
                [0.008, 0.007, -0.014],
            ],
            "velocity": [[0, 0, -0.1], [0.1, 0, 0], [0, 0, 0], [0, -0.1, 0], [0, 0, -0.2]],
        },
    )


def across(name: str, wall: dict, height: float = PRESSED) -> Scene:
    """A ball that goes over the place where a mesh meets itself across the periodic sides y."""
    more: dict[str, Any] = {"position": [[0.0179, 0.046, height]], "velocity": [[0.3, 0.8, 0.0]]}
    scene = rolling(name, wall, steps=3000, **more)
    return scene.replace(domain={"periodic": (False, True, False)})


def sticky_mesh(name: str, law: str, density: float = 5e4) -> Scene:
    """A ball on a rough floor, held by cohesion of some 0.4 of its weight: faces, edges and corners."""
    return rolling(
        name, mesh(**grid(16, 0.04, bumps)), steps=4000, position=[[-0.0141, -0.0083, 0.0036]],
        contact={"cohesion": law}, wall_pair={"cohesion_energy_density": density},
    )  # fmt: skip


def bumps(x, y):
    """A smooth rough floor [m]."""
    return 0.0012 * np.sin(900 * x) * np.cos(700 * y) + 0.0005 * np.sin(2000 * y + 1)


#: name -> scene maker
MESHES = {
    "flat_mesh": lambda: rolling("flat_mesh", mesh(**FLAT)),
    "flat_mesh_shuffled": lambda: rolling("flat_mesh_shuffled", mesh(**grid(16, 0.04, seed=3))),
    "flat_mesh_frictionless": lambda: rolling(
        "flat_mesh_frictionless", mesh(**FLAT), pair={"friction": 0.0}, wall_pair={"friction": 0.0}
    ),
    "off_the_rim": lambda: rolling(
        "off_the_rim", mesh(**grid(4, 0.02)), position=[[0.005, -0.003, PRESSED]], steps=2500
    ),
    "valley": lambda: rolling(
        "valley", mesh(**strips([(-0.03, 0.01), (0.0, 0.0), (0.03, 0.01)])), position=[[-0.015, 0, 0.0081]]
    ),
    "ridge": lambda: rolling(
        "ridge", mesh(**strips([(-0.03, -0.008), (0.0, 0.0), (0.03, -0.008)])), position=[[-0.01, 0, 0.00035]]
    ),
    "box_corner": lambda: rolling(
        "box_corner", mesh(**strips([(-0.03, 0.0), (0.0, 0.0), (0.0, 0.02)])), position=[[-0.015, 0, PRESSED]]
    ),
    "rough": lambda: rolling(
        "rough", mesh(**grid(16, 0.04, bumps, seed=5)), position=[[-0.015, -0.006, 0.0046]]
    ),
    "seam_of_two": lambda: rolling(
        "seam_of_two",
        [
            mesh("left", **grid(3, 0.03), move=(-0.015, 0, 0)),
            mesh("right", **grid(3, 0.03), move=(0.015, 0, 0)),
        ],
        position=[[-0.01, 0.001, PRESSED]],
    ),
    "drum": drum,
    "mesh_cdt": lambda: rolling("mesh_cdt", mesh(**FLAT), contact={"rolling": "cdt"}, **FRICTION),
    "mesh_epsd2": lambda: rolling("mesh_epsd2", mesh(**FLAT), contact={"rolling": "epsd2"}, **FRICTION),
    "mesh_no_history": lambda: rolling("mesh_no_history", mesh(**FLAT), contact={"tangential": "no_history"}),
    "mesh_sjkr": lambda: sticky_mesh("mesh_sjkr", "sjkr"),
    "mesh_sjkr2": lambda: sticky_mesh("mesh_sjkr2", "sjkr2"),
    "mesh_linear": lambda: moved("mesh_linear", LINEAR),
    "mesh_rotate": lambda: moved("mesh_rotate", ROTATE),
    "mesh_oscillate": lambda: moved("mesh_oscillate", OSCILLATE),
    "mesh_swing": lambda: moved("mesh_swing", SWING),
    "mesh_table": lambda: moved("mesh_table", TABLE),
    "mesh_turn_table": lambda: moved("mesh_turn_table", TURN_TABLE),
    "linear_then_rotate": lambda: moved("linear_then_rotate", LINEAR, ROTATE),
    "rotate_then_linear": lambda: moved("rotate_then_linear", ROTATE, LINEAR),
    "three_motions": lambda: moved("three_motions", OSCILLATE, SWING, LINEAR),
    "belt": lambda: rolling("belt", mesh(surface_velocity=(0.5, 0.2, 0), **FLAT)),
    "belt_over_ridge": lambda: rolling(
        "belt_over_ridge",
        mesh(surface_velocity=(0.5, 0.1, 0), **strips([(-0.03, -0.008), (0.0, 0.0), (0.03, -0.008)])),
        position=[[-0.01, 0, 0.00035]],
        velocity=[[0.0, 0.0, 0.0]],
    ),
    "belt_of_plane": lambda: rolling("belt_of_plane", {**FLOOR, "surface_velocity": (0.5, 0, 0)}),
    "mesh_gate": lambda: rolling(
        "mesh_gate",
        [
            mesh(**FLAT),
            mesh("gate", present=(0.0, 0.01), **strips([(0.0, -0.01), (0.0, 0.01)])),
            {**FLOOR, "name": "side", "point": (0, 0.012, 0), "normal": (0, -1, 0)},
        ],
        position=[[-PRESSED, 0.0, PRESSED]],
        velocity=[[0.0, 0.2, 0.0]],
        gravity=(20.0, 40.0, -300.0),
    ),
    "mesh_comes": lambda: rolling(
        "mesh_comes",
        [
            mesh(**FLAT),
            mesh("gate", present=(0.005,), motion=[LINEAR], **strips([(0.004, -0.01), (0.004, 0.01)])),
        ],
        position=[[-0.009, -0.003, PRESSED]],
    ),
    "periodic_floor": lambda: across("periodic_floor", mesh(motion=[LINEAR], **grid(4, 0.1))),
    "periodic_ridge": lambda: across(
        "periodic_ridge", mesh(**grid(4, 0.1, lambda x, y: 0.2 * np.abs(y))), height=0.0122
    ),
    "periodic_drum": lambda: periodic_drum(),
}


def periodic_drum() -> Scene:
    """A ball that slides along a drum of 24 facets which turns, and across the periodic sides at its ends."""
    turn = {"type": "rotate", "axis": (0, 1, 0), "point": (0, 0, 0), "period": 0.1}
    scene = rolling(
        "periodic_drum", mesh(motion=[turn], **cylinder(0.03, 24, half=0.05)), steps=3000,
        position=[[0.0001, 0.046, 0.00298 - 0.03]], velocity=[[0.0, 0.8, 0.0]], spin=[[0, 0, 0]],
    )  # fmt: skip
    return scene.replace(domain={"periodic": (False, True, False)})


def objects(shape: np.ndarray, count: int, seed: int, jitter: float = 0.0) -> Scene:
    """`count` turned copies of an object, shape (k, 3, 3) [m], far apart in one mesh; near each, one ball.

    The balls overlap their objects by up to a tenth of a radius at random places; triangles are shuffled.
    """
    rng = np.random.default_rng(seed)
    side = int(np.ceil(count ** (1 / 3)))
    pitch = 2 * float(np.abs(shape).max()) + 6 * R
    cells = np.stack(np.unravel_index(np.arange(count), (side,) * 3), 1) * pitch
    triangles, position = [], []
    for center in cells:
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        placed = shape @ turn.T
        weights = rng.dirichlet([1, 1, 1])
        nearest = weights @ placed[rng.integers(len(placed))]
        out = nearest / np.linalg.norm(nearest) + 0.6 * rng.normal(size=3)
        x = nearest + R * rng.uniform(0.9, 1.0) * out / np.linalg.norm(out)
        triangles.append(placed + center)
        position.append(x + center)
    corners = rng.permutation(np.concatenate(triangles))
    lo, hi = -pitch, side * pitch
    return scene(
        "objects",
        np.array(position),
        np.zeros((count, 3)),
        steps=1,
        walls=[
            mesh(
                "objects",
                vertices=corners.reshape(-1, 3),
                triangles=np.arange(3 * len(corners)).reshape(-1, 3),
            )
        ],
        contact=RULE,
        allow=("overlap",),
        domain={"lo": (lo, lo, lo), "hi": (hi, hi, hi)},
    )


def cube(size: float) -> np.ndarray:
    """Twelve triangles around the origin: shape (12, 3, 3) [m]."""
    corner = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * size / 2
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return np.array([corner[list(t)] for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


def ball_of_triangles(radius: float, rings: int, seed: int | None = None, jitter: float = 0.2) -> np.ndarray:
    """A closed faceted sphere, its triangles wound at random: (k, 3, 3) [m].

    With a seed its nodes are moved by up to `jitter` of an edge.
    """
    from scipy.spatial import ConvexHull

    count = 6 * rings * rings
    k = np.arange(count) + 0.5
    polar, turn = np.arccos(1 - 2 * k / count), np.pi * (1 + 5**0.5) * k
    points = radius * np.stack([np.cos(turn) * np.sin(polar), np.sin(turn) * np.sin(polar), np.cos(polar)], 1)
    hull = ConvexHull(points)
    rows = hull.simplices
    if seed is not None:
        edge = np.linalg.norm(points[rows[:, 0]] - points[rows[:, 1]], axis=1).mean()
        points = points + np.random.default_rng(seed).uniform(-jitter, jitter, points.shape) * edge
    return points[rows]


#: Shapes of the census: convex edges and corners, faces below 1 degree, concave edges and obtuse corners.
CENSUS = {
    "cube": cube(2 * R),
    "facets": ball_of_triangles(3 * R, 4),
    "jittered": ball_of_triangles(2 * R, 3, seed=1),
    "small": ball_of_triangles(0.5 * R, 2, seed=2),
    "obtuse": ball_of_triangles(3 * R, 2, seed=3, jitter=0.3) * [1, 1, 0.15],
    "folds": folds() * (10 * R),
}
MESHES |= {  # compositions: which points of turns are carried along
    "osc_swing": lambda: moved("osc_swing", OSCILLATE, SWING),
    "swing_linear": lambda: moved("swing_linear", SWING, LINEAR),
}
MESHES |= {
    "linear_swing": lambda: moved("linear_swing", LINEAR, SWING),
    "table_rotate": lambda: moved("table_rotate", TABLE, ROTATE),
    "table_swing": lambda: moved("table_swing", TABLE, SWING),
    "osc_rotate": lambda: moved("osc_rotate", OSCILLATE, ROTATE),
    "linear_turntable": lambda: moved("linear_turntable", LINEAR, TURN_TABLE),
    "osc_turntable": lambda: moved("osc_turntable", OSCILLATE, TURN_TABLE),
}


def tube(name: str, axis: int, position: list[float], velocity: list[float], **more: Any) -> Scene:
    """A ball pressed by gravity on an endless cylinder of radius 20 mm along an axis, off the origin."""
    direction, point = [0.0, 0.0, 0.0], [0.001, 0.001, 0.001]
    direction[axis], point[axis], point[(axis + 1) % 3] = -2.0, 0.5, -0.002
    gravity = more.pop("gravity")
    wall = {
        "kind": "cylinder", "name": "tube", "material": "wall", "radius": 0.02, "point": tuple(point),
        "axis": tuple(direction), **more,
    }  # fmt: skip
    return rolling(
        name,
        wall,
        steps=3000,
        position=[position],
        velocity=[velocity],
        gravity=gravity,
        contact={"mesh_contacts": "unique"},
    )


#: Inside and outside, along each axis, with a belt; name -> scene maker.
CYLINDERS = {
    "inside_z": lambda: tube(
        "inside_z", 2, [0.018 - PRESSED, 0.001, 0.001], [0.05, 0.3, 0.2], gravity=(300.0, 0, 0)
    ),
    "inside_y": lambda: tube(
        "inside_y", 1, [0.001, 0.001, -0.002 - 0.02 + PRESSED], [0.3, 0.05, 0.0], gravity=(0, 0, -300.0)
    ),
    "outside_x": lambda: tube(
        "outside_x", 0, [0.001, -0.002, 0.001 + 0.02 + PRESSED], [0.2, 0.1, 0.0], gravity=(0, 0, -300.0)
    ),
    "belt_y": lambda: tube(
        "belt_y",
        1,
        [0.001, 0.001, -0.002 - 0.02 + PRESSED],
        [0.3, 0.05, 0.0],
        gravity=(0, 0, -300.0),
        surface_velocity=(0, -0.4, 0),
    ),
}
