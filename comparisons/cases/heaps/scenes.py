"""Balls in a tube on a rough floor; the tube is lifted, and a heap remains. Measures of the heap."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from comparisons.cases.machines import hopper_scenes as beds
from comparisons.cases.machines.hopper_scenes import DENSITY, DIAMETER, GRAVITY, POURED, SHARED
from comparisons.cases.side_by_side import floor, mesh
from comparisons.oracles.mesh_shapes import revolved
from gpudem.output.run import Run
from gpudem.scene import Contact, Domain, Explicit, Output, Pair, Scene, Time

#: Radius of the tube [d], its facets, and the speed at which it is lifted [m/s].
TUBE, FACETS, LIFT = 4.0, 16, 0.1
#: When the tube is lifted and how long it takes up its speed [s]; time for the heap to come to rest [s].
SETTLED, RAMP, REST = 0.15, 0.02, 0.25
#: Friction and rolling friction with the floor, which is rough: balls on it neither slide nor roll.
ROUGH = 0.9
#: Half of the width of the domain [d].
WIDTH = 20.0
#: Young's modulus [Pa], for a longer time step: overlaps at the base are 1 % of a diameter.
YOUNG = 2.5e5


@dataclasses.dataclass(frozen=True)
class Heap:
    """One run."""

    friction: float
    rolling: float
    """Rolling friction of `epsd2`."""
    seed: int = 1
    count: int = 400
    young: float = YOUNG
    """[Pa]"""
    cohesion: float = 0.0
    """Cohesion energy density of `sjkr` between balls [J/m3]."""

    @property
    def bed(self) -> float:
        """Height of the bed in the tube [m], about."""
        return self.count * math.pi / 6 * DIAMETER**3 / (POURED * math.pi * (TUBE * DIAMETER) ** 2)

    def scene(self) -> Scene:
        """The whole statement."""
        radius, grain = TUBE * DIAMETER, beds.ball(self.young)

        def room(points: np.ndarray) -> np.ndarray:
            return np.minimum(radius - np.hypot(points[:, 0], points[:, 1]), points[:, 2])

        particles = beds.loose(self.count, self.seed, radius, room)
        top = float(particles["position"][:, 2].max()) + DIAMETER
        up = 1.2 * self.bed / LIFT
        times = (SETTLED, SETTLED + RAMP, SETTLED + RAMP + up, SETTLED + 2 * RAMP + up)
        lift = {"type": "table", "time": times, "velocity": [(0, 0, v) for v in (0.0, LIFT, LIFT, 0.0)]}
        tube = mesh("tube", revolved([(radius, 0.0), (radius, top)], FACETS), motion=[lift])
        more: dict[str, Any] = {"cohesion_energy_density": self.cohesion} if self.cohesion else {}
        pairs = [
            Pair(materials=("grain", "grain"), restitution=beds.RESTITUTION, friction=self.friction,
                 rolling_friction=self.rolling, **more),
            Pair(materials=("grain", "base"), restitution=beds.RESTITUTION, friction=ROUGH,
                 rolling_friction=ROUGH),
            Pair(materials=("grain", "wall"), restitution=beds.RESTITUTION),
        ]  # fmt: skip
        half = WIDTH * DIAMETER
        return Scene(
            name="heap", materials=dict.fromkeys(("grain", "base", "wall"), grain), pairs=pairs,
            title=f"{self.count} balls, mu = {self.friction:g}, mu_r = {self.rolling:g}, seed {self.seed}",
            contact=Contact(
                rolling="epsd2", cohesion="sjkr" if self.cohesion else "off", mesh_contacts=SHARED
            ),
            particles=Explicit(**particles), walls=[floor("base"), tube], gravity=(0.0, 0.0, -GRAVITY),
            domain=Domain(lo=(-half, -half, -DIAMETER), hi=(half, half, top + 1.3 * self.bed + DIAMETER)),
            time=Time(step=beds.step(self.young), duration=times[-1] + REST),
            output=Output(frames_every=SETTLED, history_every=0.005),
        )  # fmt: skip


def weight() -> float:
    """Of a ball of the mean diameter [N]."""
    return math.pi / 6 * DIAMETER**3 * DENSITY * GRAVITY


def cone_angle(run: Run) -> float:
    """Angle [deg] of the cone with the same mean height and mean distance from its axis as the balls.

    Of a cone they are H/4 and B/2: tan = H/B = 2 (mean height)/(mean distance). All balls count, by mass.
    """
    x, mass = run.frames[-1]["position"], run.scene.masses
    middle = mass @ x / mass.sum()
    away = float(mass @ np.hypot(*(x[:, :2] - middle[:2]).T) / mass.sum())
    return math.degrees(math.atan(2 * middle[2] / away))


def profile(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """(distance from the axis, height) [m] of the surface: the highest ball in each of 16 sectors, as their
    mean, in rings of 1.5 diameters.
    """
    frame = run.frames[-1]
    x, top = frame["position"], frame["position"][:, 2] + frame["radius"]
    x = x - x.mean(axis=0)
    away, sector = (
        np.hypot(x[:, 0], x[:, 1]),
        ((np.arctan2(x[:, 1], x[:, 0]) / np.pi + 1) * 8).astype(int) % 16,
    )
    at = DIAMETER * np.arange(1.0, away.max() / DIAMETER + 2, 0.5)
    height = np.zeros((len(at), 16))
    for k, ring in enumerate(at):
        near = np.abs(away - ring) < 0.75 * DIAMETER
        np.maximum.at(height[k], sector[near], top[near])
    return at, height.mean(axis=1)


def surface_angle(run: Run) -> float:
    """Slope [deg] of a straight line through the profile between 20 and 80 % of its height."""
    at, height = profile(run)
    part = (height > 0.2 * height.max()) & (height < 0.8 * height.max()) & (at > at[height.argmax()])
    if part.sum() < 2:
        return float("nan")
    return -math.degrees(math.atan(np.polyfit(at[part], height[part], 1)[0]))


def speed(run: Run) -> float:
    """Root mean square speed [m/s] at the end."""
    return float(np.sqrt((run.frames[-1]["velocity"] ** 2).sum(axis=1).mean()))
