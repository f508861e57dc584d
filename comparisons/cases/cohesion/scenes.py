"""Spheres that attract: pairs and walls in oblique impacts and at rest, and drops on an adhesive floor."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from comparisons.cases.side_by_side import Spheres, every_pair, floor, traced, turned
from comparisons.oracles.adhesion import Adhesion
from comparisons.oracles.bodies import bodies
from gpudem.scene import Contact, Material, Pair, Scene

#: Materials of the spheres and of the walls; soft, so that cohesion is a large part of the force.
MATERIALS = {
    "ball": Material(young=5e6, poisson=0.34, density=1768.0),
    "heavy": Material(young=8e6, poisson=0.25, density=4000.0),
    "floor": Material(young=2e7, poisson=0.3, density=1000.0),
}
#: Restitution, friction and cohesion energy density [J/m3] of each pair.
PAIRS = {
    ("ball", "ball"): (0.5, 0.3, 2e4), ("ball", "heavy"): (0.7, 0.2, 4e4),
    ("heavy", "heavy"): (0.8, 0.4, 1e4),
    ("ball", "floor"): (0.6, 0.3, 3e4), ("heavy", "floor"): (0.4, 0.2, 2e4),
}  # fmt: skip
#: Radii [m] and materials of the pairs; a wall's partner is one sphere.
KINDS: tuple[tuple[tuple[float, float], tuple[str, str]], ...] = (
    ((0.003, 0.003), ("ball", "ball")), ((0.003, 0.002), ("ball", "heavy")),
    ((0.002, 0.005), ("heavy", "heavy")),
)  # fmt: skip
SINGLE: tuple[tuple[float, str], ...] = ((0.003, "ball"), (0.002, "heavy"))
LAWS = ("sjkr", "sjkr2")
DENSITY = "cohesion_energy_density"
SPACING, TUBE = 0.025, 0.012
#: Overlap of the spheres at rest, by the smaller radius.
DEPTH = 0.03


def sticky(law: str, *, still: bool = False, **contact: Any) -> Scene:
    """Pairs, spheres on the floor and in a tube under one law: in oblique impacts, or overlapping at rest."""
    rows = Spheres()
    fly = 0.0 if still else 1.0
    for k, (radii, materials) in enumerate(KINDS):
        n, t = turned(0.7 * k, 0.5 + k)
        apart = sum(radii) + (-DEPTH * min(radii) if still else 2e-5)
        at, push = np.array([SPACING * k, 0.0, 0.02]), fly * (0.4 * n + 0.3 * t)
        rows.add(at, push, fly * np.array([20, -30, 10]), radii[0], materials[0])
        rows.add(at + apart * n, -0.5 * push, fly * np.array([-15, 5, 25]), radii[1], materials[1])
    for k, (radius, material) in enumerate(SINGLE):
        gap = radius * (1 - DEPTH) if still else radius + 2e-5
        place = [SPACING * k, SPACING, gap]
        rows.add(place, fly * np.array([0.3, 0.1, -0.4]), fly * np.array([20, -30, 10]), radius, material)
        inside = [4 * SPACING + TUBE - gap, 0.0, 0.03 + 0.02 * k]
        rows.add(inside, fly * np.array([0.4, 0.2, 0.3]), fly * np.array([10, 15, 30]), radius, material)
    more = {"rolling_friction": 0.1, "rolling_viscous_damping": 0.3}
    pairs = []
    for materials, (e, mu, k) in PAIRS.items():
        stated: dict[str, Any] = {"restitution": e, "friction": mu, **more} | (
            {} if law == "off" else {DENSITY: k}
        )
        pairs.append(Pair(materials=materials, **stated))
    tube = {"kind": "cylinder", "name": "tube", "material": "floor", "radius": TUBE,
            "point": (4 * SPACING, 0.0, 0.0), "axis": (0, 0, 1)}  # fmt: skip
    law_of_contact: dict[str, Any] = {"cohesion": law, "rolling": "epsd"} | contact
    return traced(
        f"{law}_{'still' if still else 'impacts'}", rows.explicit(), materials=MATERIALS,
        pairs=every_pair(list(MATERIALS), pairs), walls=[floor(), tube],
        contact=Contact(**law_of_contact),
        lo=(-0.05, -0.05, -0.01), hi=(0.15, 0.1, 0.1), step=1e-6, duration=1e-5 if still else 1.5e-3,
    )  # fmt: skip


# -- adhesion ------------------------------------------------------------------------------------------------

RADIUS = 1e-3
SOFT = Material(young=1e7, poisson=0.3, density=2500.0)
#: Work of adhesion of the spheres with the floor [J/m2].
WORKS = (0.05, 0.2, 0.8)
#: Speed of a drop by the sticking speed.
SHARES = (0.5, 0.9, 0.97, 1.03, 1.1, 1.3, 1.7, 2.5, 4.0)
STEP = 2e-7


def adhesion(scene: Scene, work: int) -> Adhesion:
    """The oracle of the spheres of WORKS[work] on the floor."""
    return Adhesion(bodies(scene, work * len(SHARES), "floor"), WORKS[work])


def drops() -> Scene:
    """From 0.1 um above the floor, no gravity: a row for each work of adhesion, a drop for each share."""

    def built(speeds: list[float]) -> Scene:
        rows = Spheres()
        for k, speed in enumerate(speeds):
            for j, share in enumerate(SHARES):
                place = (0.004 * j, 0.004 * k, RADIUS + 1e-7)
                rows.add(place, (0.0, 0.0, -share * speed), radius=RADIUS, material=f"ball_{k}")
        names = [f"ball_{k}" for k in range(len(WORKS))]
        stated = [
            Pair(materials=(n, "floor"), **{"work_of_adhesion": w}) for n, w in zip(names, WORKS, strict=True)
        ]
        return traced(
            "adhesive_drops", rows.explicit(angular_velocity=None),
            materials=dict.fromkeys([*names, "floor"], SOFT),
            pairs=every_pair(names, stated), walls=[floor()],
            contact=Contact(normal="jkr", tangential="off"),
            lo=(-0.01, -0.01, -0.01), hi=(0.05, 0.05, 0.05), step=STEP, duration=4e-3, every=1e-6,
        )  # fmt: skip

    first = built([0.01] * len(WORKS))
    return built([adhesion(first, k).sticking_speed for k in range(len(WORKS))])


def row(work: int, share: int) -> int:
    """The particle of WORKS[work] and SHARES[share]."""
    return work * len(SHARES) + share


def rebound(share: float) -> float:
    """Restitution [1] of an impact at this multiple of the sticking speed: sqrt(1 - 1/share^2)."""
    return math.sqrt(max(0.0, 1 - 1 / share**2))
