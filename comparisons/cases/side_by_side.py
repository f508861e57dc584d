"""Spheres side by side, each of a material of its own, so that each has its own restitution and friction."""

from __future__ import annotations

import math
from typing import Any, get_args

import numpy as np

from gpudem.scene import Contact, Domain, Explicit, Output, Pair, Plane, Scene, Time

#: Rules of mesh contacts: gpudem's own, which no other code has, and that of LIGGGHTS.
OWN_RULE, LIGGGHTS_RULE = get_args(Contact.model_fields["mesh_contacts"].annotation)


class Spheres:
    """Particles of a scene, collected one by one."""

    def __init__(self):
        self._rows: list[tuple[np.ndarray, np.ndarray, np.ndarray, float, str]] = []

    def add(self, position, velocity, spin=(0.0, 0.0, 0.0), radius: float = 0.003, material: str = "ball"):
        """Add one; its row."""
        at, moves, turns = (np.array(vector, float) for vector in (position, velocity, spin))
        self._rows.append((at, moves, turns, radius, material))
        return len(self._rows) - 1

    def explicit(self, **same: Any) -> Explicit:
        """The particles of a scene; `same`: what is stated once for all of them."""
        position, velocity, spin, radius, material = zip(*self._rows, strict=True)
        own = {"position": position, "velocity": velocity, "angular_velocity": spin, "radius": radius}
        return Explicit(**{**own, "material": list(material), **same})


def turned(angle: float, tilt: float = 0.0) -> np.ndarray:
    """Unit vectors normal and tangent, by rows: z and a direction across it, then tilted together."""
    up, tangent = np.array([0.0, 0.0, 1.0]), np.array([math.cos(angle), math.sin(angle), 0.0])
    cos, sin = math.cos(tilt), math.sin(tilt)
    return np.array([cos * up + sin * tangent, cos * tangent - sin * up])


def traced(
    name: str, particles: Explicit, *, step: float, duration: float, lo, hi, every: float | None = None,
    periodic: tuple[bool, bool, bool] = (False, False, False), **more: Any,
) -> Scene:  # fmt: skip
    """A scene in the box from lo to hi with a trace of each step, or at the interval `every` [s]."""
    return Scene(
        name=name, particles=particles, domain=Domain(lo=lo, hi=hi, periodic=periodic),
        time=Time(step=step, duration=duration), output=Output(trace_every=every or step), **more,
    )  # fmt: skip


def every_pair(names: list[str], stated: list[Pair], **others: Any) -> list[Pair]:
    """The pairs stated, and all others of these materials, which never meet: both codes want the whole table.

    `others`: properties of the others; e = 1 without friction if none are given.
    """
    known = {frozenset(p.materials) for p in stated}
    rest = [(a, b) for k, a in enumerate(names) for b in names[k:] if frozenset((a, b)) not in known]
    return [*stated, *(Pair(materials=pair, **others) for pair in rest)]


def plane(name: str, point, normal, material: str = "wall", **more: Any) -> Plane:
    """A plane wall."""
    return Plane(name=name, material=material, point=point, normal=normal, **more)


def floor(material: str = "floor") -> Plane:
    """The plane z = 0, named "floor"."""
    return plane("floor", (0, 0, 0), (0, 0, 1), material)


def mesh(name: str, corners: np.ndarray, **keys: Any) -> dict[str, Any]:
    """A wall of these triangles [m], shape (k, 3, 3)."""
    rows = np.arange(3 * len(corners)).reshape(-1, 3)
    points = np.reshape(corners, (-1, 3))
    return {"kind": "mesh", "name": name, "material": "wall", "vertices": points, "triangles": rows, **keys}
