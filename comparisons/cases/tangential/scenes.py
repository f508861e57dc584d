"""Oblique impacts, a contact whose normal turns, and one that is loaded and sheared in turn."""

from __future__ import annotations

import math

import numpy as np

from comparisons.cases.side_by_side import Spheres, every_pair, plane, traced, turned
from comparisons.oracles.bodies import Bodies, bodies
from comparisons.oracles.tangential import Motion, half_step
from gpudem.output.run import Run
from gpudem.scene import Contact, Material, Pair, Scene

LAWS = ("history", "history_rotated", "history_incremental", "history_capped")
MATERIALS = {
    "ball": Material(young=5e6, poisson=0.34, density=1768.0),
    "heavy": Material(young=8e6, poisson=0.25, density=4000.0),
}
#: Restitution and friction of each pair; strong dashpots.
PAIRS = {("ball", "ball"): (0.2, 0.3), ("ball", "heavy"): (0.3, 0.2), ("heavy", "heavy"): (0.5, 0.6)}
#: Radii [m] and materials of the pairs that meet.
KINDS: tuple[tuple[tuple[float, float], tuple[str, str]], ...] = (
    ((0.003, 0.003), ("ball", "ball")), ((0.003, 0.002), ("ball", "heavy")),
    ((0.002, 0.005), ("heavy", "heavy")),
)  # fmt: skip
STEP = 1e-6


def impacts(law: str) -> Scene:
    """Three pairs in oblique impacts: they stick and slip, while their normals turn."""
    rows = Spheres()
    for k, (radii, materials) in enumerate(KINDS):
        n, t = turned(0.7 * k, 0.5 + k)
        at, push = np.array([0.025 * k, 0.0, 0.02]), 0.4 * n + 0.5 * t
        rows.add(at, push, np.array([20, -30, 10]), radii[0], materials[0])
        rows.add(at + (sum(radii) + 2e-5) * n, -0.5 * push, np.array([-15, 5, 25]), radii[1], materials[1])
    pairs = [Pair(materials=names, restitution=e, friction=mu) for names, (e, mu) in PAIRS.items()]
    return traced(
        "impacts", rows.explicit(), materials=MATERIALS, pairs=every_pair(list(MATERIALS), pairs),
        contact=Contact(tangential=law), lo=(-0.05, -0.05, -0.01), hi=(0.15, 0.1, 0.1),
        step=STEP, duration=1.5e-3,
    )  # fmt: skip


# -- a wall that moves against a sphere too heavy to follow -------------------------------------------------

RADIUS, LOW, HIGH = 0.003, 3e-5, 6e-5
#: Of a density [kg/m3] with which no force moves a sphere: the motion of the wall is that of the contact.
IMMOBILE = Material(young=5e6, poisson=0.34, density=1e12)
#: Shear displacement [m], far below that at which the contact slips.
SHEAR = 3e-6


def against_wall(name: str, law: str, motion: dict, overlap: float, **fields) -> Scene:
    """The sphere at the origin, on a plane below it that moves."""
    rows = Spheres()
    rows.add((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), fields.pop("spin", (0, 0, 0)), RADIUS, "ball")
    floor = plane("floor", (0, 0, overlap - RADIUS), (0, 0, 1), "ball", motion=[motion])
    return traced(
        name, rows.explicit(), materials={"ball": IMMOBILE},
        pairs=[Pair(materials=("ball", "ball"), friction=1.0)], walls=[floor],
        contact=Contact(tangential=law), lo=(-0.02,) * 3, hi=(0.02,) * 3, allow=("unusual_units",), **fields,
    )  # fmt: skip


#: One turn of the wall [s], in which it turns about the centre of the sphere; time in which it shears before.
TURN, LEAD = 2e-3, 2e-4
#: Steps of a turn.
TURN_STEPS = (100, 200, 400)


def turning(law: str, steps: int) -> Scene:
    """A wall that first shears the contact and then makes a turn with the sphere: it slides no more."""
    step, rate = TURN / steps, 2 * math.pi / TURN
    lead = round(LEAD / step) * step
    arm = RADIUS - LOW
    faster = rate + 2 * SHEAR / (lead * arm)
    motion = {"type": "table", "axis": (0, 1, 0), "point": (0, 0, 0), "time": (0.0, lead),
              "angular_velocity": (faster, rate)}  # fmt: skip
    spin = (0.0, rate * arm / (RADIUS - LOW / 2), 0.0)
    return against_wall(
        f"turning_{steps}", law, motion, LOW, spin=spin, step=step, duration=lead + TURN,
    )  # fmt: skip


#: Steps of each of the four parts of a cycle; the wall takes up its speed, and loses it, in RAMP of them.
PART, RAMP = 200, 20
CYCLES = {
    "sheared when loaded": ((0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)),
    "loaded when sheared": ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)),
}
"""Order in which the wall goes (along x by SHEAR, along z by HIGH - LOW): four parts, back to the start."""


def cycle(law: str, order: str) -> Scene:
    """A wall that loads, shears, unloads and shears back, or shears before it loads."""
    step, times, speeds = STEP, [0.0], [(0.0, 0.0, 0.0)]
    for k, (along, up) in enumerate(CYCLES[order]):
        whole = np.array([along * SHEAR, 0.0, up * (HIGH - LOW)]) / ((PART - RAMP) * step)
        for at, share in ((RAMP, 1.0), (PART - RAMP, 1.0), (PART, 0.0)):
            times.append((k * PART + at) * step)
            speeds.append(tuple((share * whole).tolist()))
    motion = {"type": "table", "time": tuple(times), "velocity": tuple(speeds)}
    name = order.replace(" ", "_")
    return against_wall(name, law, motion, LOW, step=step, duration=4 * PART * step)


def wall_motion(run: Run) -> Motion:
    """The contact with the moving wall at every step, from the table of its motion by itself."""
    time, facts = run.trace["time"], run.scene.walls[0].model_dump()["motion"][0]
    x, dt = run.trace["position"][:, 0], run.scene.time.step
    rows = np.array(facts["time"])

    def path(rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(rate, its integral) at every step, exact for straight lines between the rows."""
        now = np.interp(time, rows, rates)
        marks = np.unique(np.concatenate([rows[rows <= time[-1]], time]))
        at = np.interp(marks, rows, rates)
        sums = np.concatenate([[0.0], np.cumsum(np.diff(marks) * (at[1:] + at[:-1]) / 2)])
        return now, np.interp(time, marks, sums)

    if "angular_velocity" in facts:
        rate, angle = path(np.array(facts["angular_velocity"]))
        normal = np.stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)], axis=1)
        gap = RADIUS - LOW + np.sum(x * normal, axis=1)
        speed = np.cross(rate[:, None] * np.array([0.0, 1.0, 0.0]), x - gap[:, None] * normal)
    else:
        both = [path(np.array(facts["velocity"])[:, k]) for k in range(3)]
        speed, moved = np.stack([b[0] for b in both], axis=1), both[2][1]
        normal = np.tile([0.0, 0.0, 1.0], (len(time), 1))
        gap = x[:, 2] - (LOW - RADIUS) - moved
    one = of_wall(run)
    velocity = half_step(run.trace or {}, 0, one.mass[0], dt) - speed
    spin = half_step(run.trace or {}, 0, one.inertia[0], dt, ("angular_velocity", "torque"))
    lever = RADIUS - (RADIUS - gap) / 2
    return Motion(RADIUS - gap, normal, velocity - np.cross(lever[:, None] * spin, normal))


def of_wall(run: Run) -> Bodies:
    """The sphere and the wall."""
    return bodies(run.scene, 0, "floor")
