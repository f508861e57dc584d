"""Scenes at the ends of what a DEM user may state, each with its result in closed form."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from comparisons.cases.side_by_side import LIGGGHTS_RULE, every_pair, mesh, plane, traced
from comparisons.oracles.bodies import bodies
from comparisons.oracles.closed_forms import static_overlap
from comparisons.oracles.impact import impact
from comparisons.oracles.mesh_shapes import rectangle
from comparisons.oracles.several import row_of_spheres, squeezed
from gpudem.output.run import Run
from gpudem.scene import Explicit, Material, Pair, Scene

R, E, NU, RHO = 0.003, 5e6, 0.34, 1768.0
SPEED, RESTITUTION, FRICTION = 1.0, 0.9, 0.3
#: 700 and more steps in a contact of a ball of radius R at SPEED: an impact errs by (|ln e| + 0.1)/steps.
STEP, DURATION = 1e-6, 4e-3
SPEEDS = (1e-3, 1e-2, 0.1, 1.0, 3.0)
SIZES = (1, 2, 5, 10, 20, 50)
DENSITIES = (1.0, 10.0, 1e2, 1e3, 1e4, 1e5)
RESTITUTIONS = (0.06, 0.1, 0.3, 0.5, 0.9, 1.0)
FRICTIONS = (0.0, 0.1, 0.5, 1.0, 2.0, 5.0)
#: Lightest ball of the density ratios; light balls and heavy ones, a thousand times as dense [kg/m3].
LIGHT, SLIGHT, MASSIVE = 10.0, 100.0, 1e5

Measure = Callable[[Run], float]


@dataclasses.dataclass(frozen=True)
class Extreme:
    """One extreme: its scene and what is asked of a run that comes to its end."""

    name: str
    """Label of its runs."""
    title: str
    scene: Scene
    error: Measure
    """Largest error against the closed form, relative; NaN where no run should come to its end."""
    tolerance: float
    unguarded: bool = False
    """Also through LIGGGHTS without the guards of our decks and runner."""


class Builder:
    """Collects balls, materials and walls of a scene.

    A bystander of another size and material lies in each, so that all scenes share one kernel.
    """

    def __init__(self, unit: float = R, origin: float = 0.0, young: float = E, bystander=(-10, 0, 20)):
        self.unit, self.origin, self.young = unit, origin, young
        self.materials: dict[str, Material] = {}
        self.pairs: dict[frozenset[str], Pair] = {}
        self.balls: list[tuple] = []
        self.material("wall")
        self.ball("bystander", 1.4 * unit, unit * np.array(bystander, float), (0, 0, 0))

    def material(self, name: str, density: float = RHO) -> None:
        """A material of that name, made once."""
        self.materials.setdefault(name, Material(young=self.young, poisson=NU, density=density))

    def ball(self, material: str, radius: float, position, velocity, density: float = RHO) -> int:
        """Add a ball, its position relative to the scene's origin; returns its row."""
        self.material(material, density)
        self.balls.append((material, radius, np.array(position, float) + self.origin, velocity))
        return len(self.balls) - 1

    def meet(self, a: str, b: str, restitution: float = RESTITUTION, friction: float = FRICTION) -> None:
        """State the pair of two materials."""
        self.pairs[frozenset((a, b))] = Pair(materials=(a, b), restitution=restitution, friction=friction)

    def scene(
        self, name: str, sides: Sequence[str] = ("zlo",), walls: Sequence[Any] = (),
        duration: float = DURATION, **changes: Any,
    ) -> Scene:  # fmt: skip
        """The scene: planes through the origin at the named sides, and further walls; traced at its end."""
        material, radius, position, velocity = zip(*self.balls, strict=True)
        largest, room = np.max(radius), 10 * self.unit
        lo, hi = np.min(position, axis=0) - largest - room, np.max(position, axis=0) + largest + room
        planes = [plane(f"side_{s}", (self.origin,) * 3, np.eye(3)["xyz".index(s[0])]) for s in sides]
        return traced(
            name, Explicit(position=position, velocity=velocity, radius=radius, material=material),
            duration=duration, every=duration, materials=self.materials, walls=[*planes, *walls],
            pairs=every_pair(list(self.materials), list(self.pairs.values()), restitution=RESTITUTION,
                             friction=FRICTION),
            **{"step": STEP, "lo": tuple(lo), "hi": tuple(hi)} | changes,
        )  # fmt: skip


def rebound_error(items: list[tuple[int, int | None, float]], axes: Any = 2) -> Measure:
    """Largest |parting / approach speed - e| along the axes of (row, other row or None for a wall, e)."""

    def error(run: Run) -> float:
        v = run.trace["velocity"][..., axes]
        apart = [(v[:, row] - (0 if other is None else v[:, other]), e) for row, other, e in items]
        return float(np.max([abs(-u[-1] / u[0] - e) for u, e in apart]))  # NaN stays NaN

    return error


def no_result(run: Run) -> float:
    """No run should come to its end."""
    return math.nan


def speeds() -> Extreme:
    """Rebound from the floor, slow to fast."""
    b = Builder()
    rows = [
        b.ball("ball", R, (3 * R * k, 0, R + 2e-3 * R + 1.5 * v * STEP), (0, 0, -v))
        for k, v in enumerate(SPEEDS)
    ]
    scene = b.scene("speeds", duration=1.2 * 2e-3 * R / SPEEDS[0] + 8e-3)
    error = rebound_error([(row, None, RESTITUTION) for row in rows])
    return Extreme("speeds", "impact speed 1e-3 to 3 m/s", scene, error, 2e-3)


def fast(speed: float, step: float) -> Extreme:
    """So fast that the overlap exceeds the radius: no law holds there."""
    b = Builder()
    row = b.ball("ball", R, (0, 0, 2 * R), (0, 0, -speed))
    scene = b.scene(
        "fast", step=step, duration=math.ceil((4 * R / speed + 1e-3) / step) * step,
        lo=(-0.05, -0.02, -0.5), hi=(0.02, 0.02, 0.5),
    )  # fmt: skip
    title = f"impact at {speed:g} m/s on 5 MPa: overlap beyond the radius"
    return Extreme(f"fast_{speed:g}", title, scene, rebound_error([(row, None, RESTITUTION)]), 2e-3, True)


def pairs(name: str, title: str, partners: list[tuple[str, float, float, float]], falling=RHO) -> Extreme:
    """A ball of density `falling` falls on each partner (material, radius, density, e), both free."""
    b, items, x = Builder(), [], 0.0
    for material, radius, density, e in partners:
        x += 2 * radius + R
        low = b.ball(material, radius, (x, 0, radius + 5 * R), (0, 0, 0), density)
        ball = b.ball(f"on_{material}", R, (x, 0, 2 * radius + 6 * R + 2e-3 * R), (0, 0, -SPEED), falling)
        b.meet(material, f"on_{material}", e)
        items.append((ball, low, e))
        x += 2 * radius
    return Extreme(name, title, b.scene(name), rebound_error(items), 4e-3)


def frictions() -> Extreme:
    """Oblique impacts on the floor against the ODE; stick and slip change."""
    b, rows = Builder(), []
    for k, mu in enumerate(FRICTIONS):
        name = f"mu_{round(10 * mu)}"
        rows.append(b.ball(name, R, (0, 3 * R * k, R + 2e-3 * R), (SPEED, 0, -SPEED)))
        b.meet(name, "wall", RESTITUTION, mu)
    scene = b.scene("frictions")

    def error(run: Run) -> float:
        last, v = np.array([scene.n_steps * scene.time.step]), run.trace["velocity"][-1]
        truth = [impact(scene, row, "side_zlo").at(last)["velocity"][0, 0] for row in rows]
        return float(np.abs(v[rows] - truth).max() / SPEED)

    return Extreme("frictions", "friction 0 to 5", scene, error, 1e-2)


def scaled(name: str, title: str, unit: float, young: float, origin: float = 0.0) -> Extreme:
    """A drop on the floor at another size, or elsewhere; the step is proportional to the size."""
    b = Builder(unit, origin, young)
    step = STEP * unit / R * math.sqrt(E / young)
    row = b.ball("ball", unit, (0, 0, 1.005 * unit), (0, 0, -SPEED))
    allow = ("rounding",) if origin else ()  # what float32 does there is shown
    scene = b.scene(name, step=step, duration=6000 * step, allow=allow)
    return Extreme(name, title, scene, rebound_error([(row, None, RESTITUTION)]), 2e-3)


def concentric() -> Extreme:
    """Two balls at one place: the contact has no normal."""
    b = Builder()
    for _ in range(2):
        b.ball("ball", R, (0, 0, 5 * R), (0, 0, 0))
    scene = b.scene("concentric", allow=("overlap",))
    return Extreme("concentric", "two balls at one place", scene, no_result, 0.0, True)


def touching() -> Extreme:
    """Two balls that exactly touch, and one that touches the floor, stay where they are."""
    b = Builder()
    rows = [b.ball("ball", R, p, (0, 0, 0)) for p in ((0, 0, 5 * R), (2 * R, 0, 5 * R), (0, 9 * R, R))]

    def error(run: Run) -> float:
        return float(np.abs(run.trace["velocity"][:, rows]).max() / SPEED)

    return Extreme("touching", "exactly touching, at rest", b.scene("touching"), error, 1e-9)


def corner() -> Extreme:
    """Into a corner of three walls: each component by itself, without friction."""
    b = Builder(bystander=(20, 20, 20))
    b.meet("ball", "wall", RESTITUTION, 0.0)
    row = b.ball("ball", R, (1.002 * R,) * 3, (-SPEED, -0.7 * SPEED, -0.5 * SPEED))

    scene = b.scene("corner", ("xlo", "ylo", "zlo"))
    error = rebound_error([(row, None, RESTITUTION)], slice(3))
    return Extreme("corner", "into a corner of three walls", scene, error, 2e-3)


def edge() -> Extreme:
    """At rest in the edge of two planes under gravity across it: (m g_i/k)^(2/3) into each."""
    b = Builder(bystander=(20, 20, 20))
    b.meet("ball", "wall", 0.2, 0.0)
    row = b.ball("ball", R, (R, 9 * R, R), (0, 0, 0))
    pull = (-6.0, 0.0, -8.0)
    scene = b.scene("edge", ("xlo", "zlo"), step=2e-5, duration=0.06, gravity=pull)

    def error(run: Run) -> float:
        c, x = bodies(scene, row, "side_xlo"), run.trace["position"][-1, row]
        return max(abs((R - x[axis]) / static_overlap(c, -pull[axis]) - 1) for axis in (0, 2))

    return Extreme("edge", "at rest in the edge of two planes", scene, error, 1e-4)


def gate() -> Extreme:
    """A gate is removed while a ball is pressed into it: the ball keeps its velocity of that moment, to the
    step at which the gate is removed.
    """
    b = Builder()
    b.meet("ball", "wall", RESTITUTION, 0.0)
    row = b.ball("ball", R, (0, 0, 5 * R), (SPEED, 0, 0))
    opens = 4e-4
    shut = plane("gate", (1.02 * R, 0, 0), (-1, 0, 0), removed_at=opens)
    scene = b.scene("gate", walls=[shut])

    def error(run: Run) -> float:
        truth = impact(scene, row, "gate").at(np.array([opens]))["velocity"][0, 0]
        return float(np.abs(run.trace["velocity"][-1, row] - truth).max() / SPEED)

    return Extreme("gate", "pressed into a gate as it opens", scene, error, 5e-3)


def heavy_on_bed() -> Extreme:
    """A heavy ball comes to rest on four light ones in a box; statics from the balance of forces."""
    b = Builder(young=10 * E, bystander=(2, 2, 800))
    for name, density in (("light", MASSIVE / 100), ("heavy", MASSIVE)):
        b.material(name, density)
        for other in ("light", "heavy", "wall"):
            b.meet(name, other, 0.06, 0.0)
    low, *_ = [b.ball("light", R, (x, y, R), (0, 0, 0)) for x in (R, 3 * R) for y in (R, 3 * R)]
    high = R + math.sqrt(4.25) * R
    top = b.ball("heavy", 1.5 * R, (2 * R, 2 * R, high), (0, 0, 0))
    far = [plane(f"far_{k}", (4 * R, 4 * R, 0), -np.eye(3)[k]) for k in (0, 1)]
    scene = b.scene(
        "heavy_on_bed", ("xlo", "ylo", "zlo"), far, step=5e-6, duration=0.6, gravity=(0, 0, -9.81)
    )
    place = squeezed(bodies(scene, low, "side_zlo"), bodies(scene, top, low), 9.81)

    def error(run: Run) -> float:
        x = run.trace["position"][-1]
        sunk = np.array([R - x[low, 0], R - x[low, 2], high - x[top, 2]])
        return float(np.abs(sunk / place - 1).max())

    title = "a heavy ball on a bed of light ones, density 100 to 1"
    return Extreme("heavy_on_bed", title, scene, error, 1e-5)


def light_between() -> Extreme:
    """A heavy ball strikes a light one that lies before another heavy one: it rattles between them."""
    b = Builder(young=10 * E)
    b.material("heavy", MASSIVE)
    b.material("light", SLIGHT)
    row = (("heavy", 10.0, 0.0), ("light", 12.002, 0.0), ("heavy", 14.004, -SPEED))
    rows = [b.ball(name, R, (0, 0, z * R), (0, 0, v)) for name, z, v in row]
    scene = b.scene("light_between", step=2e-7)
    contacts = (bodies(scene, rows[0], rows[1]), bodies(scene, rows[1], rows[2]))

    def error(run: Run) -> float:
        start = scene.state
        want = row_of_spheres(contacts, start.position[rows, 2], start.velocity[rows, 2], DURATION)
        return float(np.abs(run.trace["velocity"][-1, rows, 2] - want).max() / SPEED)

    title = "a light ball between heavy ones, density 1000 to 1"
    return Extreme("light_between", title, scene, error, 4e-3)


def on_mesh(
    name: str, title: str, size: tuple[float, float], cells: tuple[int, int], at: float = 0.0
) -> Extreme:
    """Rebound from a floor of triangles: a rectangle of this size [m], in cells; it falls at x = `at`."""
    b, (length, width) = Builder(), size
    row = b.ball("ball", R, (at, 0, 1.005 * R), (0, 0, -SPEED))
    flat = rectangle((-length / 2, -width / 2, 0), (length, 0, 0), (0, width, 0), cells)
    end = max(length / 2 + 10 * R, 25 * R)
    scene = b.scene(
        name, (), [mesh("floor", flat)], lo=(-end, -25 * R, -10 * R), hi=(end, 25 * R, 35 * R),
        contact={"mesh_contacts": LIGGGHTS_RULE},
    )  # fmt: skip
    return Extreme(name, title, scene, rebound_error([(row, None, RESTITUTION)]), 2e-3)


def plate_comes_down(name: str, title: str, speed: float, high: float, **changes: Any) -> Extreme:
    """A plate of triangles comes down at a speed [m/s] on a ball that lies on the floor.

    It begins at this height above the center of the ball [R]. No law of contact holds at overlaps of half R.
    """
    b = Builder()
    row = b.ball("ball", R, (0, 0, R), (0, 0, 0))
    flat = rectangle((-5 * R, -5 * R, (1 + high) * R), (10 * R, 0, 0), (0, 10 * R, 0))
    motion = [{"type": "linear", "velocity": (0.0, 0.0, -speed)}]
    scene = b.scene(name, walls=[mesh("plate", flat, motion=motion)],
                    contact={"mesh_contacts": LIGGGHTS_RULE}, **changes)  # fmt: skip

    def overlap(run: Run) -> float:
        return 1 - float(run.trace["position"][-1, row, 2]) / R

    return Extreme(name, title, scene, overlap, 0.5)


def leaves() -> Extreme:
    """A ball flies out of the open domain."""
    b = Builder()
    b.ball("ball", R, (0, 0, 5 * R), (0, 0, 100.0))
    scene = b.scene("leaves", step=1e-5, duration=0.02)
    return Extreme("leaves", "flies out of the domain", scene, no_result, 0.0, True)


@functools.cache
def scenes() -> tuple[Extreme, ...]:
    """All extremes, in the order of the table; made once."""
    return (
        speeds(), fast(30.0, 1e-6), fast(300.0, 1e-6),
        pairs("sizes", "size ratio 1 to 50", [(f"size_{s}", s * R, RHO, RESTITUTION) for s in SIZES]),
        pairs("densities", "density ratio 1 to 1e5",
              [(f"d_{round(d)}", R, LIGHT * d, RESTITUTION) for d in DENSITIES], LIGHT),
        pairs("restitutions", "restitution 0.06 to 1",
              [(f"e_{round(100 * e)}", R, RHO, e) for e in RESTITUTIONS]),
        pairs("dead", "restitution 0.05", [("dead", R, RHO, 0.05)]),  # below what LIGGGHTS accepts
        frictions(), scaled("powder", "powder of 1 micrometer", 1e-6, E),
        scaled("boulder", "boulders of 1 m, 50 GPa", 1.0, 5e10),
        scaled("far", "1 km from the origin", R, E, 1000.0), concentric(), touching(), corner(), edge(),
        gate(), heavy_on_bed(), light_between(), leaves(),
        on_mesh("small_triangles", "on triangles of R/50", (1.2 * R, 1.2 * R), (60, 60)),
        on_mesh("long_triangle", "on a triangle of 1000 diameters", (2000 * R, 20 * R), (1, 1), 300.7 * R),
        plate_comes_down("fast_wall", "a wall that moves by 1.2 radii a step", 1.2 * R / STEP, 2.5,
                         duration=20 * STEP, allow=("speed",)),
        plate_comes_down("crushed", "crushed between two walls", SPEED, 1.002),
    )  # fmt: skip
