"""Scenes of a conical hopper that discharges and of a square silo at rest, and measures of their runs."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any, get_args

import numpy as np

from comparisons import kit
from comparisons.oracles import silo
from comparisons.oracles.bodies import of_material
from comparisons.oracles.mesh_shapes import revolved
from gpudem.output.run import Run
from gpudem.scene import Contact, Domain, Explicit, Material, Output, Pair, Scene, Time

#: The rules of contacts with meshes: gpudem's, and that of the reference, by which both agree to rounding.
UNIQUE, SHARED = get_args(Contact.model_fields["mesh_contacts"].annotation)
#: Round walls in the place of the mesh.
ROUND = "round"
#: Mean diameter of the balls [m], and their largest departure from it, against crystals.
DIAMETER, SPREAD = 0.006, 0.08
GRAVITY, DENSITY, FRICTION, RESTITUTION = 9.81, 1000.0, 0.5, 0.5
#: Half of the angle of the cone: 45 degrees, where the factor of Rose and Tanaka for cones is 1.
SLOPE = math.radians(45.0)
#: Triangles around the axis: two for each.
FACETS = 24
#: The floor that catches the balls, below the orifice, and half of its width beyond the bin [d].
FALL, MARGIN = 8.0, 3.0
#: Young's modulus [Pa]: the bed of the hopper sinks in by 1 % of a radius; the silo's by 0.1 %, for overlaps
#: of a percent let walls slip back, and then no friction carries the bed (Janssen's effect is lost).
SOFT, STIFF = 1e6, 5e7
#: Time step as a share of the Rayleigh time.
SHARE = 0.15
#: Shares of the mass between whose passage the rate is measured: after the start, before the bed is shallow.
WINDOW = (0.1, 0.4)
#: Volume share of a poured bed, for the length of a run only.
POURED = 0.56


def ball(young: float) -> Material:
    """The material of balls and walls."""
    return Material(young=young, poisson=0.3, density=DENSITY)


def step(young: float) -> float:
    """Time step [s]: SHARE of the Rayleigh time of the smallest ball."""
    shear = young / (2 * (1 + 0.3))
    rayleigh = math.pi * DIAMETER / 2 * (1 - SPREAD) * math.sqrt(DENSITY / shear) / (0.1631 * 0.3 + 0.8766)
    return float(f"{SHARE * rayleigh:.2g}")


def loose(
    count: int, seed: int, half_width: float, room: Callable[[np.ndarray], np.ndarray]
) -> dict[str, Any]:
    """Balls of random sizes on a lattice with random shifts and speeds, filling a vessel from below.

    Args:
        count: How many.
        seed: Of sizes, shifts and speeds.
        half_width: Of the lattice in x and y [m].
        room: Distance of points (n, 3) from the vessel [m], positive inside.

    Raises:
        ValueError: They do not fit into 100 layers.
    """
    rng, largest = np.random.default_rng(seed), DIAMETER * (1 + SPREAD)
    pitch, shift = 1.03 * largest, 0.014 * largest
    across = int((2 * half_width - largest - 4 * shift) / pitch)
    side = pitch * (np.arange(across + 1) - across / 2)
    z, y, x = np.meshgrid(largest / 2 + 2 * shift + pitch * np.arange(100), side, side, indexing="ij")
    places = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    places = places[room(places) > largest / 2 + 2 * shift][:count]
    if len(places) < count:
        raise ValueError(f"{count} balls do not fit: {len(places)} do")
    return {
        "position": places + rng.uniform(-shift, shift, places.shape),
        "velocity": rng.normal(0, 0.1, places.shape),
        "radius": DIAMETER / 2 * (1 + rng.uniform(-SPREAD, SPREAD, count)),
        "material": "grain",
    }


def statement(
    name: str, title: str, young: float, particles: dict[str, Any] | None, rule: str = SHARED
) -> dict[str, Any]:
    """What hopper and silos share; without particles at the start where they are inserted."""
    return {
        "name": name, "title": title, "materials": {"grain": ball(young)},
        "pairs": [Pair(materials=("grain", "grain"), restitution=RESTITUTION, friction=FRICTION)],
        "contact": {"mesh_contacts": rule}, "particles": None if particles is None else Explicit(**particles),
        "gravity": (0.0, 0.0, -GRAVITY),
    }  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Hopper:
    """A cone under a cylindrical bin; a gate below the orifice, z = 0, holds the balls and then goes."""

    opening: float
    """Diameter D of the orifice [d]."""
    bin: float
    """Diameter of the bin [d]."""
    count: int
    """Number of balls."""
    seed: int = 1
    walls: str = SHARED
    """A mesh, by one of the rules of contacts, or ROUND: the kinds `cone` and `cylinder`."""
    opens: float = 0.2
    """Time at which the gate goes [s]."""

    @property
    def profile(self) -> np.ndarray:
        """Rows (radius, z) [m] of the cone's lower end, its upper end and the top of the bin."""
        low, high = self.opening * DIAMETER / 2, self.bin * DIAMETER / 2
        knee = (high - low) / math.tan(SLOPE)
        layer = math.pi * high**2 * 0.3  # of a loose lattice, walls included
        top = knee + self.count * math.pi / 6 * DIAMETER**3 / layer + 2 * DIAMETER
        return np.array([(low, 0.0), (high, knee), (high, top)])

    def room(self, points: np.ndarray) -> np.ndarray:
        """Distance [m] from hopper and gate, positive inside."""
        rho, (low, high) = np.hypot(points[:, 0], points[:, 1]), self.profile[:2, 0]
        cone = (low + points[:, 2] * math.tan(SLOPE) - rho) * math.cos(SLOPE)
        return np.minimum.reduce([high - rho, cone, points[:, 2]])

    @property
    def duration(self) -> float:
        """Time [s] until WINDOW has passed, and a fifth as much again, at Beverloo's rate."""
        rate = silo.beverloo(self.opening * DIAMETER, DIAMETER, POURED * DENSITY, GRAVITY)
        return self.opens + 0.05 + 1.2 * WINDOW[1] * self.count * math.pi / 6 * DIAMETER**3 * DENSITY / rate

    def _walls(self) -> list[dict[str, Any]]:
        (low, _), (high, knee), (_, top) = self.profile
        if self.walls == ROUND:
            shared = {"material": "grain", "axis": (0, 0, 1)}
            return [
                {"kind": "cone", "name": "cone", "radius": low, "end_radius": high, "length": knee,
                 "point": (0, 0, 0), **shared},
                {"kind": "cylinder", "name": "bin", "radius": high, "length": top - knee,
                 "point": (0, 0, knee), **shared},
            ]  # fmt: skip
        corners = revolved(self.profile, FACETS)
        rows = np.arange(3 * len(corners)).reshape(-1, 3)
        points, which = np.unique(corners.reshape(-1, 3).round(12), axis=0, return_inverse=True)
        return [{"kind": "mesh", "name": "hopper", "material": "grain", "vertices": points,
                 "triangles": which.reshape(-1)[rows]}]  # fmt: skip

    def scene(self) -> Scene:
        """The whole statement."""
        width, rule = (self.bin / 2 + MARGIN) * DIAMETER, UNIQUE if self.walls == ROUND else self.walls
        top = self.profile[-1, 1] + 2 * DIAMETER
        gate = {"kind": "plane", "name": "gate", "material": "grain", "point": (0, 0, 0), "normal": (0, 0, 1)}
        tray = {"kind": "box", "name": "tray", "material": "grain",
                "sides": ["xlo", "xhi", "ylo", "yhi", "zlo"]}  # fmt: skip
        title = f"orifice {self.opening:g} d, {self.count} balls, seed {self.seed}, {self.walls}"
        particles = loose(self.count, self.seed, self.bin / 2 * DIAMETER, self.room)
        return Scene(
            **statement("hopper", title, SOFT, particles, rule),
            walls=[*self._walls(), tray, gate | {"removed_at": self.opens}],
            domain=Domain(lo=(-width, -width, -FALL * DIAMETER), hi=(width, width, top)),
            time=Time(step=step(SOFT), duration=self.duration),
            output=Output(frames_every=0.01, history_every=0.005),
        )  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Silo:
    """A square silo; once its balls are at rest the floor sinks slowly, so that they hang on the walls.

    A bed that has just fallen presses on the walls and has no direction to slide: friction carries a tenth of
    it, more or less by chance. Above a floor that sinks it slides down along all walls.
    """

    count: int = 250
    width: float = 5.65
    """[d]: five balls of the lattice, which then falls least."""
    seed: int = 1
    sinks: float = 0.15
    """Time at which the floor begins to sink [s]."""
    speed: float = 0.005
    """Its speed [m/s]: balls are at rest beside it, 0.02 sqrt(g d)."""
    ramp: float = 0.01
    """Time in which it reaches it [s]."""
    duration: float = 0.22
    """Time [s] at which the loads are read."""

    def scene(self) -> Scene:
        """The whole statement."""
        half = self.width / 2 * DIAMETER

        def room(points: np.ndarray) -> np.ndarray:
            return np.minimum(half - np.abs(points[:, :2]).max(axis=1), points[:, 2])

        particles = loose(self.count, self.seed, half, room)
        top, out = float(particles["position"][:, 2].max()) + 2 * DIAMETER, 1.05 * half
        times = [self.sinks, self.sinks + self.ramp, self.duration]
        sinking = {"type": "table", "time": times,
                   "velocity": [(0, 0, -v) for v in (0, self.speed, self.speed)]}  # fmt: skip
        sides = {"kind": "box", "name": "silo", "material": "grain", "sides": ["xlo", "xhi", "ylo", "yhi"],
                 "lo": (-half, -half, 0.0), "hi": (half, half, top)}  # fmt: skip
        floor = {"kind": "mesh", "name": "floor", "material": "grain", "triangles": [(0, 1, 2), (0, 2, 3)],
                 "vertices": [(-out, -out, 0), (out, -out, 0), (out, out, 0), (-out, out, 0)],
                 "motion": [sinking]}  # fmt: skip
        return Scene(
            **statement("silo", f"{self.count} balls in a square silo", STIFF, particles),
            walls=[sides, floor],
            domain=Domain(lo=(-1.1 * half, -1.1 * half, -DIAMETER), hi=(1.1 * half, 1.1 * half, top)),
            time=Time(step=step(STIFF), duration=self.duration),
            output=Output(
                frames_every=self.duration, history_every=0.005,
                wall_forces=("silo_xlo", "silo_xhi", "silo_ylo", "silo_yhi", "floor"),
            ),
        )  # fmt: skip


def opens(run: Run) -> float:
    """Time [s] at which the gate goes."""
    return next(p.removed_at for p in run.scene.planes if p.removed_at is not None)


def profile(run: Run) -> np.ndarray:
    """(radius, z) [m] of the hopper of a run: lower end, upper end of the cone, top."""
    bounds = {wall.name: wall for wall in run.scene.wall_elements}
    if "hopper" in bounds:
        points = run.scene.meshes[0].corners.reshape(-1, 3)
        rho, z = np.hypot(points[:, 0], points[:, 1]), points[:, 2]
        shrink = math.sqrt(math.sin(2 * math.pi / FACETS) * FACETS / 2 / math.pi)
        return np.array([(shrink * rho[np.isclose(z, at)].max(), at) for at in np.unique(z.round(9))])
    cone, tube = bounds["cone"], bounds["bin"]
    low, high = cone.radius, cone.end_radius  # pyright: ignore[reportAttributeAccessIssue]
    return np.array([(low, 0.0), (high, tube.point[2]), (high, tube.point[2] + tube.length)])  # pyright: ignore[reportAttributeAccessIssue]


@dataclasses.dataclass(frozen=True)
class Passage:
    """How the balls of a run pass the orifice, from its frames."""

    time: np.ndarray
    """When [s], ascending, of those that do."""
    mass: np.ndarray
    """Mass [kg] of each."""
    astray: int
    """Balls that are outside of the hopper above the orifice in some frame, or come back from below.

    Between frames 10 ms apart a ball falls by 0.5 mm from rest: hardly a leak is missed."""


def passage(results: kit.Results, label: str, code: str) -> Passage:
    """The passage of all balls: the free fall of each traced back from the first frame below the orifice."""

    def compute() -> Passage:
        run = results[label, code]
        masses, shape, found = run.scene.masses, profile(run), []
        below, astray = np.zeros((2, len(masses)), bool)
        outer = shape[:, 0] / math.cos(math.pi / FACETS)  # corners of the polygons are farther out
        for time, frame in zip(run.frames.times, run.frames, strict=True):
            x, v = frame["position"], frame["velocity"]
            now = x[:, 2] < 0
            astray |= below & ~now
            astray |= ~now & (np.hypot(x[:, 0], x[:, 1]) > np.interp(x[:, 2], shape[:, 1], outer))
            new = np.flatnonzero(now & ~below)
            speed, fallen = -v[new, 2], -x[new, 2]
            root = np.sqrt(np.maximum(speed**2 - 2 * GRAVITY * fallen, 0.0))
            back = 2 * fallen / (speed + root)  # the smaller root of g t^2/2 - speed t + fallen = 0
            back = np.clip(back, 0.0, run.scene.output.frames_every)  # where balls have met since
            found.append(np.column_stack([time - back, masses[new]]))
            below |= now
        rows = np.concatenate(found)
        rows = rows[np.argsort(rows[:, 0])]
        return Passage(rows[:, 0], rows[:, 1], int(astray.sum()))

    return results.once(("passage", label, code), compute)


def blocks(results: kit.Results, label: str, code: str, count: int = 8) -> np.ndarray:
    """Rates [kg/s] of the parts of equal mass into which WINDOW is divided. NaN: it does not pass."""
    passed, total = passage(results, label, code), results[label, code].scene.masses.sum()
    cumulated = np.cumsum(passed.mass)
    edges = np.linspace(*WINDOW, count + 1) * total
    if not len(cumulated) or cumulated[-1] < edges[-1]:
        return np.full(count, np.nan)
    return np.diff(edges) / np.diff(np.interp(edges, cumulated, passed.time))


def rate(results: kit.Results, label: str, code: str) -> float:
    """Mass [kg/s] that passes, over the whole of WINDOW."""
    return float(1 / np.mean(1 / blocks(results, label, code)))


def bulk_density(run: Run) -> float:
    """Density [kg/m3] of the bed in the bin, between cone and the uppermost balls, before the gate goes."""
    frame, ((_, _), (radius, knee), _) = run.frames.at(opens(run) - 0.01), profile(run)
    z = frame["position"][:, 2]
    top = np.quantile(z, 0.85)
    inside = (z > knee) & (z < top)
    return float(run.scene.masses[inside].sum() / (math.pi * radius**2 * (top - knee)))


@dataclasses.dataclass(frozen=True)
class Load:
    """What the walls of the silo carry at rest [N], from the overlaps with them (Hertz)."""

    weight: float
    bottom: float
    sides: float
    """Sum of the normal forces on the four sides."""
    height: float
    """Height of the bed [m]."""
    width: float
    """Width of the silo [m]."""
    depth: np.ndarray
    """Depth [m] below the surface of each ball at a side."""
    normal: np.ndarray
    """Its normal force on that side [N]."""

    @property
    def mobilized(self) -> float:
        """Friction at the sides, which is what the bottom lacks of the weight, over normal force there."""
        return (self.weight - self.bottom) / self.sides

    def number(self, k: float) -> float:
        """Janssen's number at a ratio K of stresses, with the friction that is mobilized."""
        return 4 * self.mobilized * k * self.height / self.width


def load(run: Run) -> Load:
    """What the walls carry in the last frame."""
    frame, scene = run.frames[-1], run.scene
    x, radius = frame["position"], frame["radius"]
    constant = np.array([of_material(ball(STIFF), r, wall=True).normal_constant for r in radius])
    walls = {wall.name: wall for wall in scene.wall_elements}
    (sinking,) = walls.pop("floor").motion
    base = float(np.trapezoid(np.array(sinking.velocity)[:, 2], sinking.time))  # pyright: ignore[reportAttributeAccessIssue]

    def force(gap: np.ndarray) -> np.ndarray:
        return constant * np.maximum(radius - gap, 0.0) ** 1.5

    sides = np.sum([force(wall.gap(x)) for wall in walls.values()], axis=0)
    width = walls["silo_xhi"].shape()[1][0] - walls["silo_xlo"].shape()[1][0]
    solid = 4 / 3 * math.pi * radius**3
    height, top = x[:, 2] - base, np.quantile(x[:, 2], 0.95) - base
    inner = (height < top) & (height > DIAMETER)
    share = solid[inner].sum() / (width**2 * (top - DIAMETER))
    whole = float(solid.sum() / share / width**2)
    return Load(
        weight=float(scene.masses.sum() * GRAVITY), bottom=float(force(height).sum()),
        sides=float(sides.sum()), height=whole, width=width,
        depth=(whole - height)[sides > 0], normal=sides[sides > 0],
    )  # fmt: skip
