"""Impacts with friction that a code may get wrong although single impacts at rest come out right: what meets,
and the scenes that hold several of them side by side, far from one another.

Steps of 0.2 us, some 300 to a contact.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from comparisons.cases import side_by_side
from comparisons.cases.side_by_side import every_pair, traced
from comparisons.cases.single_contact.meetings import Meeting
from gpudem.scene import Material, Pair, Scene

RADIUS, PARTNER_RADIUS, SPACING = 0.003, 0.004, 0.03
#: Time step [s], and time of the first touch: within a step, and within half a step, not at its end.
STEP, FLIGHT = 2e-7, 6.46e-6
FRICTION = 0.3
BALL = Material(young=3.25e9, poisson=0.34, density=1768.0)
WALL = Material(young=3.2e9, poisson=0.37, density=1185.0)


@dataclasses.dataclass(frozen=True)
class Throw:
    """An impact: speeds [m/s] of the first body against the second; spins about normal x tangent."""

    what: str
    restitution: float
    slip: float
    """Speed along the tangent."""
    spin: tuple[float, float] = (0.0, 0.0)
    """R w [m/s] of the first body and of the second."""
    speed: float = 1.0
    """Speed of approach along the normal."""

    @property
    def material(self) -> str:
        """The material of that restitution: `ball_0p6`."""
        return f"ball_{self.restitution:g}".replace(".", "p")


@dataclasses.dataclass(frozen=True)
class Encounter:
    """Impacts, in order, of particles that touch nothing else."""

    what: str
    meetings: tuple[tuple[int, int | str], ...]
    images: tuple[tuple[int, tuple[float, float, float]], ...] = ()
    """(row, shift [m]) of a particle whose periodic image meets the other."""

    @property
    def contacts(self) -> list[Meeting]:
        """As meetings, for the measures of single impacts."""
        return [Meeting(self.what, row, other) for row, other in self.meetings]


#: Label of a variant, which is the name of its scene -> what meets in it.
Encounters = Mapping[str, Sequence[Encounter]]


class Spheres(side_by_side.Spheres):
    """Particles of a scene, on demand by the throw."""

    def throw(
        self, throw: Throw, place, axes: np.ndarray, *, radii: tuple[float, ...] = (RADIUS,),
        materials: tuple[str, ...] | None = None, share: float = 0.7, frame=(0.0, 0.0, 0.0),
        image=(0.0, 0.0, 0.0),
    ):  # fmt: skip
        """Add the bodies of a throw as they are FLIGHT before the touch, at which the first is at `place`.

        axes: unit vectors normal (from the second body to the first) and tangent, by rows; one radius: it
        meets a wall; materials: default that of its restitution; share: of the relative velocity that the
        first of two has; frame: velocity [m/s] of both; image: shift [m] from the second to its image that
        the first meets.
        """
        normal, tangent = axes
        away = throw.slip * tangent - throw.speed * normal
        for k, radius in enumerate(radii):
            velocity = np.array(frame) + ((share if len(radii) > 1 else 1.0) - k) * away
            at = np.array(place) - k * (sum(radii) * normal + np.array(image)) - FLIGHT * velocity
            spin = throw.spin[k] / radius * np.cross(normal, tangent)
            self.add(at, velocity, spin, radius, materials[k] if materials else throw.material)


def scene(
    name: str, rows: Spheres, throws: Sequence[Throw] = (), partner: str | None = None, *, steps: int,
    materials: dict[str, Material] | None = None, pairs: Sequence[Pair] = (), size: float = 0.3, **more: Any,
) -> Scene:  # fmt: skip
    """A scene with a material for each restitution of the throws, and its pair with `partner` (None: itself),
    beside further `materials` and `pairs`; every other pair of materials exists but never meets.
    """
    balls = {throw.material: throw.restitution for throw in sorted(throws, key=lambda t: t.restitution)}
    used = dict.fromkeys(balls, BALL) | ({partner: WALL} if partner else {}) | (materials or {})
    stated = [
        Pair(materials=(ball, partner or ball), restitution=e, friction=FRICTION) for ball, e in balls.items()
    ]
    box: dict[str, Any] = {"lo": (-size, -size, -size), "hi": (size, size, size)} | more
    return traced(
        name, rows.explicit(), materials=used, pairs=every_pair(list(used), [*stated, *pairs]),
        step=STEP, duration=steps * STEP, **box,
    )  # fmt: skip
