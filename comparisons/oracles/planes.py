"""Spheres that touch several planes at once: the law of `contact_ode` in three dimensions, in small steps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from comparisons.oracles.bodies import Bodies, bodies
from comparisons.oracles.impact import COLUMNS
from gpudem.scene import Scene


def on_planes(
    scene: Scene, rows: Sequence[int], names: Sequence[str], times: np.ndarray, substeps: int = 5
) -> dict[str, np.ndarray]:
    """Position [m], velocity [m/s] and angular_velocity [rad/s] of spheres at `times`, each (times, rows, 3).

    Symplectic Euler with `substeps` to each interval of `times`, which begin at 0: first order, its error at
    1500 steps to a contact is some 1e-3 of the speed. Law without `limit_force`, with the tangential
    dashpot; the spring is projected on the plane, cut at mu |F_n|/k_t; no gravity. The spheres touch nothing
    but these planes.
    """
    state = {column: getattr(scene.state, column)[list(rows)].copy() for column in COLUMNS}
    x, v, w = (state[column] for column in COLUMNS)
    planes = [next(p for p in scene.planes if p.name == name) for name in names]
    laws = [_Plane([bodies(scene, row, p.name) for row in rows], p.normal, p.point) for p in planes]
    mass = np.array([[body.mass[0]] for body in laws[0].bodies])
    inertia = np.array([[body.inertia[0]] for body in laws[0].bodies])
    kept = [np.stack([x, v, w])]
    for interval in np.diff(times):
        h = interval / substeps
        for _ in range(substeps):
            force, torque = np.zeros_like(x), np.zeros_like(x)
            for law in laws:
                push, turn = law.act(x, v, w, h)
                force += push
                torque += turn
            v = v + h * force / mass
            w = w + h * torque / inertia
            x = x + h * v
        kept.append(np.stack([x, v, w]))
    found = np.array(kept)
    return {column: found[:, k] for k, column in enumerate(COLUMNS)}


class _Plane:
    """One plane and its springs."""

    def __init__(self, of: Sequence[Bodies], normal: Sequence[float], point: Sequence[float]):
        self.bodies, self.normal, self.point = (
            list(of),
            np.array(normal) / np.linalg.norm(normal),
            np.array(point),
        )

        def column(name: str) -> np.ndarray:
            return np.array([[getattr(body, name)] for body in of])

        self.radius = np.array([[body.radius[0]] for body in of])
        self.stiff, self.damp = column("normal_constant"), column("normal_damping")
        self.shear, self.drag = column("tangential_constant"), column("tangential_damping")
        self.friction = column("friction")
        self.spring = np.zeros((len(self.bodies), 3))

    def act(self, x: np.ndarray, v: np.ndarray, w: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
        """Forces [N] and torques [N m]; springs are stretched by a step of h [s]."""
        n = self.normal
        deep = self.radius - ((x - self.point) @ n)[:, None]
        touch = deep > 0
        d = np.where(touch, deep, 0.0)
        lever = self.radius - d / 2
        parting = (v @ n)[:, None]
        slip = v - parting * n - lever * np.cross(w, n)
        push = np.where(touch, self.stiff * d**1.5 - self.damp * d**0.25 * parting, 0.0)
        spring = np.where(touch, self.spring + h * slip, 0.0)
        spring = spring - (spring @ n)[:, None] * n
        stiffness = self.shear * np.sqrt(d)
        trial = stiffness * np.linalg.norm(spring, axis=1, keepdims=True)
        limit = self.friction * np.abs(push)
        slips = trial > limit
        self.spring = np.where(slips, spring * limit / np.where(slips, trial, 1.0), spring)
        friction = -stiffness * self.spring - np.where(slips, 0.0, self.drag * d**0.25) * slip
        return push * n + friction, -lever * np.cross(n, friction)
