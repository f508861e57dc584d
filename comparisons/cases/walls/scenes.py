"""Balls on walls of triangles and on what these stand for, under gravity; and what the cases share."""

from __future__ import annotations

from typing import Any

import numpy as np

from comparisons.cases.side_by_side import every_pair, traced
from comparisons.oracles.bodies import Bodies, bodies
from comparisons.oracles.closed_forms import static_overlap
from gpudem.scene import Explicit, Material, Pair, Scene

RADIUS, GRAVITY, FRICTION, RESTITUTION = 0.003, 9.81, 0.5, 0.5
BALL = Material(young=5e7, poisson=0.3, density=2500.0)
#: 60 steps in a contact at 0.1 m/s, 1200 in the period of a turntable.
STEP = 1e-5
HALF = 0.04


def mesh(name: str, corners: np.ndarray, **keys: Any) -> dict[str, Any]:
    """A wall of these triangles [m], shape (k, 3, 3)."""
    rows = np.arange(3 * len(corners)).reshape(-1, 3)
    points = np.reshape(corners, (-1, 3))
    return {"kind": "mesh", "name": name, "material": "wall", "vertices": points, "triangles": rows, **keys}


def scene(
    name: str, walls: list[Any], position: Any, velocity: Any, spin: Any = None, *, duration: float,
    rule: str = "liggghts", friction: float = FRICTION, restitution: float = RESTITUTION,
    step: float = STEP, every: float | None = None, half: float = HALF, ball: Material = BALL,
    gravity: tuple[float, float, float] = (0.0, 0.0, -GRAVITY), **more: Any,
) -> Scene:  # fmt: skip
    """Balls at these places in a box of half the side `half` [m]; a trace every step, or as `every` says."""
    position = np.asarray(position, float)
    motion = {"velocity": np.broadcast_to(velocity, position.shape)}
    if spin is not None:
        motion["angular_velocity"] = np.broadcast_to(spin, position.shape)
    pairs = [Pair(materials=("ball", "wall"), restitution=restitution, friction=friction)]
    return traced(
        name, Explicit(position=position, radius=RADIUS, material="ball", **motion),
        materials={"ball": ball, "wall": ball}, pairs=every_pair(["ball", "wall"], pairs, restitution=0.5),
        walls=walls, gravity=gravity, step=step, duration=duration, every=every, lo=(-half,) * 3,
        hi=(half,) * 3, contact={"mesh_contacts": rule}, **more,
    )  # fmt: skip


def on_floor() -> tuple[float, Bodies]:
    """(overlap [m] of a ball at rest on a floor, the two bodies)."""
    floor = {"kind": "plane", "name": "floor", "material": "wall", "point": (0, 0, 0), "normal": (0, 0, 1)}
    c = bodies(scene("rest", [floor], [[0.0, 0.0, RADIUS]], 0.0, duration=STEP), 0, "floor")
    return static_overlap(c, GRAVITY), c
