"""The scenes of MFIX-DEM's verification cases DEM01 to DEM05, their linear springs stated through `hooke`."""

from __future__ import annotations

import math

import numpy as np

from comparisons.cases.side_by_side import every_pair, floor, plane, traced
from comparisons.cases.single_contact.meetings import Meeting
from comparisons.oracles import linear
from gpudem.scene import Contact, Explicit, Material, Pair, Scene

GRAVITY = 9.80665
DOWN = (0.0, 0.0, -GRAVITY)
#: Velocity [m/s] at which `hooke` takes its stiffness from E; arbitrary, since E is computed for it.
SPEED = 1.0
POISSON = 0.3
HARD = 1e12

# DEM01 and DEM02: a sphere of 0.1 m dropped by 0.4 m.
BALL, DENSITY, DROP = 0.1, 2600.0, 0.4
MASS = 4 / 3 * math.pi * BALL**3 * DENSITY
#: (stiffness [N/m], restitution) of DEM01: as in MFIX, without e = 1 at 1e4, where it sinks through 0.
FALLS = tuple((k, e) for k in (1e4, 2.5e4, 5e4, 1e5) for e in (1.0, 0.9, 0.8, 0.7, 0.6) if (k, e) != (1e4, 1))
STIFFNESSES, RESTITUTIONS = (5e4, 5e5, 5e6), (1.0, 0.9, 0.8, 0.7, 0.6, 0.5)
BOUNCES = tuple((k, e) for k in STIFFNESSES for e in RESTITUTIONS)

# DEM03: two spheres compressed between floor and roof; overlaps 10 % and 20 % of the radius.
GRAIN, ROOF, SPRING, HEIGHTS = 5e-4, 0.0018, 1e3, (4.5e-4, 1.35e-3)
DENSITIES = (2e4, 1e4)

# DEM04: a sphere thrown along a floor.
THROWN_DENSITY, THROWN_SPRING, THROW = 1e4, 1e4, 0.1
FRICTIONS = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)

# DEM05: 5 mm alumina spheres on thick glass at 3.9 m/s (Kharaz, Gorham and Salman 2001).
ALUMINA = Material(young=380e9, poisson=0.23, density=4000.0)
GLASS = Material(young=70e9, poisson=0.25, density=2500.0)
PELLET, IMPACT, SLIDING = 2.5e-3, 3.9, 0.092
ANGLES = (2.0, 5.0, 10.0, 15.0, 20.0, 30.0, 45.0, 60.0)
#: The first touch falls in the middle of a step.
FLIGHT, PELLET_STEP = 6.05e-7, 1e-8


def sphere_mass(radius: float, density: float) -> float:
    """Mass [kg]."""
    return 4 / 3 * math.pi * radius**3 * density


def ball(stiffness: float, radius: float, density: float) -> Material:
    """The material whose contact with a floor of `HARD` modulus has the stiffness wanted [N/m]."""
    star = linear.young_star(stiffness, radius, sphere_mass(radius, density), SPEED)
    young = (1 - POISSON**2) / (1 / star - (1 - POISSON**2) / HARD)
    return Material(young=young, poisson=POISSON, density=density)


FLOOR = Material(young=HARD, poisson=POISSON, density=2500.0)
HOOKE = Contact(normal="hooke", characteristic_velocity=SPEED)


def falls(
    name: str, rows: tuple[tuple[float, float], ...], step: float, duration: float, every: float
) -> Scene:
    """DEM01 and DEM02: one dropped sphere for each (stiffness, restitution), side by side."""
    names = [f"ball_{k}" for k in range(len(rows))]
    pairs = [Pair(materials=(n, "floor"), restitution=e) for n, (_, e) in zip(names, rows, strict=True)]
    materials = {n: ball(k, BALL, DENSITY) for n, (k, _) in zip(names, rows, strict=True)}
    place = [(0.3 * k, 0.0, BALL + DROP) for k in range(len(rows))]
    return traced(
        name, Explicit(position=place, radius=BALL, material=names),
        materials=materials | {"floor": FLOOR}, pairs=every_pair(names, pairs), contact=HOOKE,
        gravity=DOWN, walls=[floor()], lo=(-0.2, -0.2, -0.1), hi=(0.3 * len(rows), 0.2, 0.7),
        step=step, duration=duration, every=every,
        allow=["large_overlap"],  # at 1e4 N/m as in MFIX: the softest sinks in by more than half its radius
    )  # fmt: skip


def column() -> Scene:
    """DEM03, one column for each restitution."""
    lower, upper = (sphere_mass(GRAIN, d) for d in DENSITIES)
    soft = [  # 1/E* of lower/floor, lower/upper, upper/roof: sums of the compliances of the two
        1 / linear.young_star(SPRING, r, m, SPEED)
        for r, m in ((GRAIN, lower), (GRAIN / 2, lower * upper / (lower + upper)), (GRAIN, upper))
    ]
    share = (soft[1] / 2, soft[1] / 2, soft[0] - soft[1] / 2, soft[2] - soft[1] / 2)
    made = [
        Material(young=(1 - POISSON**2) / c, poisson=POISSON, density=DENSITIES[k == 1])
        for k, c in enumerate(share)
    ]
    materials, balls, pairs = {"floor": made[2], "roof": made[3]}, [], []
    for k, e in enumerate(RESTITUTIONS):
        below, above = f"lower_{k}", f"upper_{k}"
        materials |= {below: made[0], above: made[1]}
        balls += [below, above]
        pairs += [
            Pair(materials=p, restitution=e) for p in ((below, "floor"), (below, above), (above, "roof"))
        ]
    place = [(0.002 * (k // 2), 0.0, HEIGHTS[k % 2]) for k in range(len(balls))]
    return traced(
        "dem03", Explicit(position=place, radius=GRAIN, material=balls),
        materials=materials, pairs=every_pair([*balls, "floor", "roof"], pairs), contact=HOOKE,
        gravity=DOWN, walls=[floor(), plane("roof", (0, 0, ROOF), (0, 0, -1), "roof")],
        lo=(-0.002, -0.002, 0.0), hi=(0.002 * len(RESTITUTIONS), 0.002, ROOF),
        step=1e-7, duration=1e-3, every=1e-6, allow=["overlap"],
    )  # fmt: skip


def throws() -> Scene:
    """DEM04, all frictions, each at its static overlap m g/k: MFIX' start, just touching, hops for ever."""
    names = [f"ball_{k}" for k in range(len(FRICTIONS))]
    rest = sphere_mass(GRAIN, THROWN_DENSITY) * GRAVITY / THROWN_SPRING
    pairs = [Pair(materials=(n, "floor"), friction=mu) for n, mu in zip(names, FRICTIONS, strict=True)]
    place = [(0.0, 0.002 * k, GRAIN - rest) for k in range(len(names))]
    speed = [(THROW, 0.0, 0.0)] * len(names)
    return traced(
        "dem04", Explicit(position=place, velocity=speed, radius=GRAIN, material=names),
        materials=dict.fromkeys(names, ball(THROWN_SPRING, GRAIN, THROWN_DENSITY)) | {"floor": FLOOR},
        pairs=every_pair(names, pairs), contact=HOOKE, gravity=DOWN, walls=[floor()],
        lo=(-0.001, -0.001, -0.0001), hi=(0.01, 0.002 * len(names), 0.004),
        step=1e-6, duration=0.02, every=2e-5,
    )  # fmt: skip


def pellets() -> Scene:
    """DEM05 on the wall with the Hertz law, all angles."""
    angle = np.radians(ANGLES)
    velocity = np.stack([IMPACT * np.sin(angle), 0 * angle, -IMPACT * np.cos(angle)], axis=1)
    position = [(0.0, 0.01 * k, PELLET - v * FLIGHT) for k, v in enumerate(velocity[:, 2])]
    return traced(
        "dem05", Explicit(position=position, velocity=velocity, radius=PELLET, material="alumina"),
        materials={"alumina": ALUMINA, "glass": GLASS}, walls=[floor("glass")],
        pairs=[
            Pair(materials=("alumina", "alumina")), Pair(materials=("alumina", "glass"), friction=SLIDING)
        ],
        lo=(-0.01, -0.01, -0.001), hi=(0.01, 0.01 * len(ANGLES), 0.01), step=PELLET_STEP, duration=1.8e-5,
    )  # fmt: skip


MEETINGS = [Meeting(f"{a:g} deg", k, "floor") for k, a in enumerate(ANGLES)]


#: What MFIX-DEM prints for DEM05, Hertz law, particle on wall (CurtinIDS/mfix tests/dem/DEM05). Impact angle
#: -> angle of the center's velocity after it [deg], tangential velocity after/before [1], spin [rad/s].
PUBLISHED = {
    10.0: (6.9401, 0.6903, 208.38), 20.0: (12.6178, 0.6150, 510.53), 30.0: (21.4722, 0.6813, 618.39),
    45.0: (39.2144, 0.8160, 505.29), 60.0: (57.1386, 0.8938, 357.66),
}  # fmt: skip
