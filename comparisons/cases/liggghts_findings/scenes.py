"""Scenes in which LIGGGHTS' own behaviours show, one each, and what is read from their runs."""

from __future__ import annotations

import numpy as np

from comparisons import kit
from comparisons.bench.beds import COUNT, STEP, bed_scene, bench_scene, tiled
from comparisons.cases.side_by_side import every_pair, floor, traced
from gpudem.output.run import Run
from gpudem.scene import Contact, Domain, Explicit, Material, Output, Pair, Scene, Time

RADIUS = 0.003
BALL = Material(young=5e6, poisson=0.34, density=1768.0)
WALL = Material(young=3.2e9, poisson=0.37, density=1190.0)
FLOOR = floor("wall")
CUBE = Domain(lo=(-0.03, -0.03, -0.03), hi=(0.03, 0.03, 0.03))
#: Speed of the first impact of the hopping ball [m/s].
HOP = 0.2
#: Impacts in gross sliding: restitution of each sphere, its normal and tangential speed [m/s], friction.
SLIDES, SPEED, SLIP, FRICTION = (0.3, 0.5, 0.7, 0.9), 1.0, 3.0, 0.3
LAWS = {
    "default": Contact(),
    "limit_force": Contact(limit_force=True),
    "dashpot_off": Contact(tangential_damping=False),
    "coulomb": Contact(limit_force=True, tangential_damping=False),
}
#: Time of the flow [s], the time from which it has energy to compare, the time before chaos hides causes.
FLOW, MOVING, EARLY = 0.16, 0.01, 0.05
#: Interval of its history [s].
DENSE = 5e-4


def _scene(name: str, position, velocity, *, steps: int, every: int = 1, e=0.5, mu=0.3, **more) -> Scene:
    """Spheres of radius RADIUS in a 60 mm cube, dt = 1 us."""
    walls = more.pop("walls", [])
    pairs = [Pair(materials=("ball", "ball"), restitution=e, friction=mu)]
    pairs += [Pair(materials=("ball", "wall"), restitution=0.6, friction=0.2)] if walls else []
    step, spin = 1e-6, more.pop("spin", None)
    return Scene(
        name=name, materials={"ball": BALL} | ({"wall": WALL} if walls else {}), pairs=pairs, walls=walls,
        particles=Explicit(
            position=position, velocity=velocity, angular_velocity=spin, radius=RADIUS, material="ball"
        ),
        domain=CUBE, time=Time(step=step, duration=steps * step),
        output=Output(trace_every=every * step, history_every=every * step), **more,
    )  # fmt: skip


def hop() -> Scene:
    """A ball hops on a ball: they part and meet again before the neighbour list is rebuilt."""
    return _scene(
        "hop", [[0, 0, 0.003], [0.0002, 0.0001, 0.00905]], [[0, 0, 0], [0.1, 0, -HOP]], steps=7000, every=10,
        e=0.7, mu=0.5, walls=[FLOOR], gravity=(0.0, 0.0, -200.0),
    )  # fmt: skip


def collide(every: int = 1) -> Scene:
    """Two spinning spheres meet obliquely; at 300 of the 800 steps they are in contact."""
    return _scene(
        "collide", [[-0.0031, 0, 0], [0.0031, 0.001, 0.0005]], [[0.5, 0.3, 0], [-0.5, -0.3, 0.1]], steps=800,
        every=every, spin=[[30.0, -10.0, 20.0], [-5.0, 15.0, 40.0]],
    )  # fmt: skip


def slide(law: str) -> Scene:
    """One sphere for each restitution slides through a whole impact on a floor."""
    names = [f"ball_{k}" for k in range(len(SLIDES))]
    pairs = [
        Pair(materials=(n, "wall"), restitution=e, friction=FRICTION)
        for n, e in zip(names, SLIDES, strict=True)
    ]
    particles = Explicit(
        position=[(0.0, 0.01 * k, RADIUS + 1.05e-5) for k in range(len(SLIDES))],
        velocity=[(SLIP, 0.0, -SPEED)] * len(SLIDES), radius=RADIUS, material=names,
    )  # fmt: skip
    return traced(
        "slide", particles, materials=dict.fromkeys(names, BALL) | {"wall": WALL},
        pairs=every_pair(names, pairs), walls=[FLOOR], contact=LAWS[law], step=5e-7, duration=1.5e-3,
        lo=(-0.01, -0.01, -0.001), hi=(0.01, 0.05, 0.02),
    )  # fmt: skip


def smooth_floor(dashpot: bool) -> Scene:
    """A ball slides at 0.1 m/s, 20 um deep, on a floor without friction; pairs of balls would have friction.

    `dashpot`: gpudem takes LIGGGHTS' tangential dashpot at the set-up.
    """
    pairs = (
        Pair(materials=("ball", "ball"), restitution=0.5, friction=0.3),
        Pair(materials=("ball", "wall"), restitution=0.6, friction=0.0),
    )
    one = _scene(
        "smooth_floor", [[0, 0, RADIUS - 2e-5]], [[0.1, 0, 0]], steps=100, walls=[FLOOR],
        contact=Contact(frictionless_dashpot=dashpot),
    )  # fmt: skip
    return one.replace(pairs=pairs)


def leave() -> Scene:
    """Two balls; the second flies out of the open domain after 20 ms."""
    return _scene("leave", [[0, 0, 0], [0.01, 0, 0]], [[0, 0, 0], [1.0, 0, 0]], steps=40000, every=4000)


def coincide() -> Scene:
    """Two balls at one place: there is no direction to push."""
    return _scene("coincide", [[0, 0, 0]] * 2, [[0, 0, 0]] * 2, steps=1000, every=100, allow=("overlap",))


def burst() -> Scene:
    """A settled bed stepped 40 times too far at once: it blows up."""
    step = 40 * STEP
    return bench_scene(
        "settled", COUNT, 1, time=Time(step=step, duration=400 * step), allow=("time_step",),
        output=Output(history_every=50 * step),
    )  # fmt: skip


def still() -> Scene:
    """The settled bed of 5000 balls for ten steps: where its contacts are."""
    return bench_scene("settled", COUNT, 10)


def flow(law: str = "default") -> Scene:
    """The settled bed without its gate."""
    return bed_scene(
        "flow", tiled("settled", 1), gate=False, duration=FLOW, output=Output(history_every=DENSE),
        contact=LAWS[law],
    )  # fmt: skip


# -- read from runs ----------------------------------------------------------------------------------------


def excess(run: Run) -> np.ndarray:
    """What friction took of the tangential speed beyond mu (1 + e_out) v_n, as a share of that, by sphere.

    With the restitution that came out, so that `limit_force`, which raises it, is judged by its own rebound.
    """
    first, last = run.trace["velocity"][0], run.trace["velocity"][-1]
    return (first[:, 0] - last[:, 0]) / (FRICTION * (1 + last[:, 2] / SPEED) * SPEED) - 1


def tangential_share(run: Run) -> float:
    """Tangential over normal force of `smooth_floor` at t = 0 [1]."""
    force = run.trace["force"][0, 0]
    return float(np.hypot(force[0], force[1]) / abs(force[2]))


def energy_gap(results: kit.Results, a: tuple[str, str], b: tuple[str, str]) -> tuple[np.ndarray, np.ndarray]:
    """(time [s], difference of kinetic energy / larger of the two) of two flows."""
    time = results[a].history["time"].to_numpy()
    one, two = (results[key].history["kinetic_energy"].to_numpy() for key in (a, b))
    return time, np.abs(one - two) / np.maximum(np.maximum(one, two), 1e-300)


def points_error(run: Run) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Last raw frame: overlaps [m] by float64 positions, by the VTK points; |point - position| [m]."""
    from scipy.spatial import KDTree

    from gpudem.output.frames import read_vtu

    last = sorted((run.directory / "raw").glob("p_[0-9]*.vtu"))[-1]
    frame = read_vtu(last)
    exact, points = frame["c_position[1-3]"], np.asarray(frame["points"], np.float64)
    pairs = KDTree(exact).query_pairs(2 * RADIUS * 1.001, output_type="ndarray")

    def overlaps(x: np.ndarray) -> np.ndarray:
        return 2 * RADIUS - np.linalg.norm(x[pairs[:, 0]] - x[pairs[:, 1]], axis=1)

    return overlaps(exact), overlaps(points), np.linalg.norm(points - exact, axis=1)
