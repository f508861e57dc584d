"""Balls on walls of triangles and on what these stand for, under gravity; and what the cases share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from comparisons import kit
from comparisons.cases.side_by_side import LIGGGHTS_RULE, every_pair, traced
from comparisons.oracles.bodies import Bodies, bodies
from comparisons.oracles.closed_forms import static_overlap
from gpudem.output.run import Run
from gpudem.scene import Explicit, Material, Pair, Scene

RADIUS, GRAVITY, FRICTION, RESTITUTION = 0.003, 9.81, 0.5, 0.5
BALL = Material(young=5e7, poisson=0.3, density=2500.0)
#: 60 steps in a contact at 0.1 m/s, 1200 in the period of a turntable.
STEP = 1e-5
HALF = 0.04
#: What is compared step by step, and by what.
COLUMNS = {
    "position": "diameter", "velocity": "largest speed", "angular_velocity": "largest speed / radius",
    "force": "largest force",
}  # fmt: skip


def scene(
    name: str, walls: list[Any], position: Any, velocity: Any, spin: Any = None, *, duration: float,
    rule: str = LIGGGHTS_RULE, friction: float = FRICTION, restitution: float = RESTITUTION,
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


def scale(run: Run, column: str) -> float:
    """What differences of a column are compared with: see COLUMNS."""

    def largest(column: str) -> float:
        return float(np.linalg.norm(run.trace[column], axis=-1).max())

    if column == "angular_velocity":
        return max(largest(column), largest("velocity") / RADIUS)
    return 2 * RADIUS if column == "position" else largest(column)


def no_contact(run: Run) -> str:
    """Why a run shows nothing: a ball that feels no force beside its weight, or that stays where it is."""
    weight = run.scene.masses[:, None] * np.array(run.scene.gravity)
    felt = (np.linalg.norm(run.trace["force"] - weight, axis=-1) > 0).any(axis=0)
    moved = np.ptp(run.trace["position"], axis=0).max(axis=-1) > 0.1 * RADIUS
    return "" if (felt & moved).all() else "a ball without contact, or at rest"


def every_column(
    catches: Mapping[str, str], prefix: str = "", title: str = "", defect: Callable[[Run], str] = no_contact,
    **fields: Any,
) -> tuple[kit.PerPair, ...]:  # fmt: skip
    """Codes at every step of the variants of a prefix; one check for each column that `catches` names."""
    return tuple(
        kit.step_by_step(
            f"{title}{column.replace('_', ' ')}, largest difference over all steps / {COLUMNS[column]}",
            column, lambda run, column=column: scale(run, column), prefix=prefix, defect=defect, unit="1",
            catches=text, **fields,
        )
        for column, text in catches.items()
    )  # fmt: skip
