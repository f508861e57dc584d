"""Scenes with meshes, and the forces of balls put at many places about a mesh."""

from typing import Any

import numpy as np

from gpudem.scene import Scene
from gpudem.solver.solver import Solver

#: Triangles of all copies of a mesh, about.
MOST = 2000
YOUNG, POISSON, DENSITY = 5e6, 0.3, 2500.0
MATERIALS = {
    "ball": {"young": YOUNG, "poisson": POISSON, "density": DENSITY},
    "wall": {"young": YOUNG, "poisson": POISSON, "density": DENSITY},
}


def mesh(corners: np.ndarray, name: str = "mesh", **keys: Any) -> dict[str, Any]:
    """A wall of these triangles, shape (k, 3, 3)."""
    triangles = np.arange(3 * len(corners)).reshape(-1, 3)
    return {"kind": "mesh", "name": name, "material": "wall",
            "vertices": np.reshape(corners, (-1, 3)), "triangles": triangles, **keys}  # fmt: skip


def mesh_scene(
    walls: list[dict[str, Any]], position: Any, *, radius: float = 0.05, velocity: Any = None,
    spin: Any = None, friction: float = 0.0, restitution: float = 1.0, rolling: float = 0.0,
    **changes: Any,
) -> Scene:  # fmt: skip
    """Balls about walls in a domain of 100 m, frictionless and elastic unless told; no gravity."""
    position = np.atleast_2d(np.asarray(position, float))
    particles: dict[str, Any] = {
        "source": "explicit",
        "material": "ball",
        "radius": radius,
        "position": position,
    }
    for key, value in (("velocity", velocity), ("angular_velocity", spin)):
        if value is not None:
            particles[key] = np.broadcast_to(np.asarray(value, float), position.shape)
    law = {"restitution": restitution, "friction": friction, "rolling_friction": rolling}
    data: dict[str, Any] = {
        "name": "mesh", "materials": MATERIALS, "particles": particles, "walls": walls,
        "pairs": [{"materials": ("ball", m), **law} for m in MATERIALS],
        "domain": {"lo": (-50, -50, -50), "hi": (50, 50, 50)},
        "time": {"step": 1e-4, "duration": 0.1}, "allow": ["overlap"],
    }  # fmt: skip
    return Scene(**{**data, **changes})


def hertz(overlap: Any, radius: float) -> Any:
    """Force of an elastic contact with a wall of `MATERIALS` [N]."""
    stiffness = 4 / 3 * YOUNG / (2 * (1 - POISSON**2)) * np.sqrt(radius)
    return stiffness * np.maximum(overlap, 0.0) ** 1.5


def total_force(contacts: list[tuple[float, np.ndarray]], radius: float) -> np.ndarray:
    """Sum of the Hertz forces of contacts (distance [m], normal) [N]."""
    return sum((hertz(radius - gap, radius) * normal for gap, normal in contacts), np.zeros(3))


def forces(
    corners: np.ndarray | list[np.ndarray], positions: np.ndarray, radius: float, *, copies: int = 200,
    contact: dict[str, Any] | None = None, turn: np.ndarray | None = None, **options: Any,
) -> np.ndarray:  # fmt: skip
    """Set-up force on a ball at each position [N]: `copies` at once, each at a copy of the mesh of its own.

    corners: one mesh, or several. turn: a rotation of the whole scene; the forces are turned back.
    """
    parts = corners if isinstance(corners, list) else [corners]
    copies = min(copies, 1 + MOST // sum(map(len, parts)))
    turn = np.eye(3) if turn is None else turn
    count = min(copies, len(positions))
    side = int(np.ceil(count ** (1 / 3)))
    extent = max(float(np.abs(p).max()) for p in [*parts, positions]) + 3 * radius
    grid = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)[:count]
    offsets = (grid - (side - 1) / 2) * 2 * extent
    walls = [mesh(_at(p, offsets, turn), f"part{k}") for k, p in enumerate(parts)]
    changes: dict[str, Any] = {"contact": contact or {}}
    if "precision" in options:
        changes["solver"] = {"precision": options.pop("precision")}
    scene = mesh_scene(walls, (positions[:count] + offsets) @ turn.T, radius=radius, **changes)
    solver = Solver(scene, threads=1, **options)
    found = []
    for first in range(0, len(positions), count):
        chosen = positions[first : first + count]
        places = np.concatenate([chosen, positions[: count - len(chosen)]])
        _put(solver, (places + offsets) @ turn.T)
        solver.start(write=True)
        found.append(solver.column("force")[: len(chosen)] @ turn)
    solver.close()
    return np.concatenate(found)


def _at(corners: np.ndarray, offsets: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Copies of a mesh at the offsets, all turned."""
    return (corners[None] + offsets[:, None, None, :]).reshape(-1, 3, 3) @ turn.T


def _put(solver: Solver, positions: np.ndarray) -> None:
    """Every ball at rest at its new place, by id."""
    bodies: Any = solver.state.now.numpy()
    bodies[:] = np.zeros(1, bodies.dtype)
    bodies["position"] = positions[solver.state.particles.id.numpy()]
    solver.state.now.assign(bodies)


def random_turn(seed: int) -> np.ndarray:
    """A random rotation matrix."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(np.random.default_rng(seed).normal(size=4)).as_matrix()
