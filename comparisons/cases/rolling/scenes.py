"""Spheres on a plane under gravity, each at its static overlap, and the checks that these cases share."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from comparisons import kit
from comparisons.cases.side_by_side import every_pair, floor, traced
from comparisons.oracles.bodies import bodies
from comparisons.oracles.rolling import Arm
from gpudem.output.run import Run
from gpudem.scene import Explicit, Material, Pair, Scene

GRAVITY, RADIUS = 9.81, 0.003
#: Stiff enough that the static overlap (0.02 % of R) changes the lever arm by no more than that.
BALL = Material(young=1e8, poisson=0.34, density=1768.0)
FLOOR = Material(young=1e8, poisson=0.37, density=1185.0)


def on_plane(
    name: str,
    properties: Sequence[dict[str, float]],
    *,
    slope: float = 0.0,
    materials: tuple[Material, Material] = (BALL, FLOOR),
    spacing: float = 0.01,
    velocity: Sequence[tuple[float, ...]] | None = None,
    rolling: bool = False,
    **fields: Any,
) -> Scene:
    """One sphere for each entry of `properties`, those of its pair with the floor, at its static overlap: a
    higher start bounces, a deeper one hops. Gravity is tilted by `slope` [deg], not the plane.

    Velocities [m/s]: at rest if None; with `rolling` the spin that goes with a velocity along x. `fields` go
    to `traced`.
    """
    angle, names = math.radians(slope), [f"ball_{k}" for k in range(len(properties))]
    pairs = [
        Pair(materials=(n, "floor"), restitution=0.5, **p) for n, p in zip(names, properties, strict=True)
    ]

    def built(overlap: float) -> Scene:
        motion = {} if velocity is None else {"velocity": velocity}
        if rolling and velocity is not None:
            motion["angular_velocity"] = [(0.0, v[0] / (RADIUS - overlap / 2), 0.0) for v in velocity]
        position = [(0.0, spacing * k, RADIUS - overlap) for k in range(len(names))]
        return traced(
            name, Explicit(position=position, radius=RADIUS, material=names, **motion),
            materials=dict.fromkeys(names, materials[0]) | {"floor": materials[1]},
            pairs=every_pair(names, pairs, restitution=0.5),
            gravity=(GRAVITY * math.sin(angle), 0.0, -GRAVITY * math.cos(angle)), walls=[floor()],
            **fields,
        )  # fmt: skip

    return built(arm(built(0.0), slope).overlap)


def arm(stated: Scene, slope: float) -> Arm:
    """Static overlap and lever arm on a slope [deg], the same for all spheres."""
    return Arm.of(bodies(stated, 0, "floor"), GRAVITY * math.cos(math.radians(slope)))


def step_by_step(
    unit: str, speed: Callable[[Run], np.ndarray | float], **fields: Any
) -> tuple[kit.PerPair, kit.PerPair]:
    """Two codes over all traces: velocity by speed(run) [m/s], called `unit`, angular velocity by it / R."""
    fields = {"tolerance": 1e-9} | fields
    end = f"largest difference over the trace / {unit}"
    spin = f"R x angular velocity, {end}"
    return (
        kit.step_by_step(f"velocity, {end}", "velocity", speed, **fields),
        kit.step_by_step(spin, "angular_velocity", lambda run: speed(run) / RADIUS, **fields),
    )


def rate(run: Run, values: np.ndarray, since: float) -> float:
    """Slope of the straight line through `values` of the trace after the time `since` [s]."""
    late = run.trace["time"] > since
    return float(np.polyfit(run.trace["time"][late], values[late], 1)[0])
