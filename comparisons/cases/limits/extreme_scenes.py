"""Scenes at the ends of what a DEM user may state, each with what must come out, by closed form."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np

from comparisons.oracles.bodies import bodies
from comparisons.oracles.closed_forms import static_overlap
from comparisons.oracles.impact import impact
from comparisons.oracles.several import row_of_spheres, squeezed
from gpudem.output.run import Run
from gpudem.scene import Domain, Explicit, Material, Output, Pair, Plane, Scene, Time

R, E, NU, RHO = 0.003, 5e6, 0.34, 1768.0
SPEED = 1.0
RESTITUTION = 0.9
#: Steps to one elastic contact time of a ball of radius R at SPEED, 1 ms by far.
STEP, DURATION = 1e-6, 4e-3
SPEEDS = (1e-3, 1e-2, 0.1, 1.0, 3.0)
SIZES = (1, 2, 5, 10, 20, 50)
DENSITIES = (1.0, 10.0, 1e2, 1e3, 1e4, 1e5)
RESTITUTIONS = (0.06, 0.1, 0.3, 0.5, 0.9, 1.0)
FRICTIONS = (0.0, 0.1, 0.5, 1.0, 2.0, 5.0)
#: Lightest ball of the density ratios [kg/m3].
LIGHT = 10.0

Measure = Callable[[Run], float]


@dataclasses.dataclass(frozen=True)
class Extreme:
    """One extreme: its scene and what is asked of a run that comes to its end."""

    name: str
    """Label of its runs."""
    title: str
    scene: Scene
    error: Measure
    """Largest error against the closed form, relative; a run without one has a wrong number."""
    tolerance: float
    reason: str
    unguarded: bool = False
    """Also through LIGGGHTS without the guards of our decks and runner."""


class Builder:
    """Collects balls, materials and walls of a scene.

    A bystander of another size and material lies in each, so that all scenes share one kernel.
    """

    def __init__(self, unit: float = R, origin: float = 0.0, young: float = E):
        self.unit, self.origin, self.young = unit, origin, young
        self.materials: dict[str, Material] = {}
        self.pairs: dict[frozenset[str], Pair] = {}
        self.balls: list[tuple] = []
        self.material("wall")
        self.ball("bystander", 1.4 * unit, (-10 * unit, 0, 20 * unit), (0, 0, 0))

    def material(self, name: str, density: float = RHO) -> str:
        """A material of that name, made once."""
        self.materials.setdefault(name, Material(young=self.young, poisson=NU, density=density))
        return name

    def ball(self, material: str, radius: float, position, velocity, density: float = RHO) -> int:
        """Add a ball, places counted from the scene's origin; its row."""
        self.material(material, density)
        self.balls.append((material, radius, np.array(position, float) + self.origin, velocity))
        return len(self.balls) - 1

    def meet(self, a: str, b: str, restitution: float = RESTITUTION, friction: float = 0.3) -> None:
        """State the pair of two materials."""
        self.pairs[frozenset((a, b))] = Pair(materials=(a, b), restitution=restitution, friction=friction)

    def scene(self, name: str, walls: tuple[str, ...] = ("zlo",), **changes) -> Scene:
        """The scene: planes through the origin at the named sides."""
        names = list(self.materials)
        for k, a in enumerate(names):
            for b in names[k:]:
                if frozenset((a, b)) not in self.pairs:
                    self.meet(a, b)
        material, radius, position, velocity = zip(*self.balls, strict=True)
        size = 10 * self.unit
        hi = np.max(position, axis=0) + np.max(radius) + size
        lo = np.min(position, axis=0) - np.max(radius) - size
        planes = [
            Plane(
                name=f"side_{w}",
                material="wall",
                point=(self.origin, self.origin, self.origin),
                normal=np.eye(3)["xyz".index(w[0])],
            )
            for w in walls
        ]  # fmt: skip
        data = {
            "particles": Explicit(position=position, velocity=velocity, radius=radius, material=material),
            "walls": [*planes, *changes.pop("walls_more", ())],
            "time": Time(step=STEP, duration=DURATION), "output": Output(trace_every=DURATION),
            "domain": Domain(lo=tuple(lo), hi=tuple(hi)),
        } | changes  # fmt: skip
        return Scene(name=name, materials=self.materials, pairs=list(self.pairs.values()), **data)


def rebound_error(items: list[tuple[int, int | None, float]]) -> Measure:
    """Largest |parting / approach speed - e| of (row, other row or None for the floor, e)."""

    def error(run: Run) -> float:
        v = run.trace["velocity"]
        worst = []
        for row, other, e in items:
            u = v[:, row] - (v[:, other] if other is not None else 0)
            worst.append(abs(-u[-1, 2] / u[0, 2] - e))
        return float(np.max(worst))  # NaN stays NaN

    return error


def _floor_drop(b: Builder, material: str, radius: float, speed: float, x: float) -> int:
    return b.ball(material, radius, (x, 0, radius + 2e-3 * radius + 1.5 * speed * STEP), (0, 0, -speed))


def speeds() -> Extreme:
    """Rebound from the floor, slow to fast."""
    b = Builder()
    rows = [_floor_drop(b, "ball", R, v, 3 * R * k) for k, v in enumerate(SPEEDS)]
    slow = 1.2 * 2e-3 * R / SPEEDS[0]
    return Extreme(
        "speeds", "impact speed 1e-3 to 3 m/s", b.scene(
            "speeds", time=Time(step=STEP, duration=slow + 8e-3), output=Output(trace_every=slow + 8e-3)
        ),
        rebound_error([(r, None, RESTITUTION) for r in rows]), 2e-3, FIRST,
    )  # fmt: skip


FIRST = "first order in the step: some (|ln e| + 0.1)/steps of the contact, 700 and more steps"


def fast(speed: float, step: float) -> Extreme:
    """So fast that the overlap exceeds the radius: no law holds there."""
    b = Builder()
    row = b.ball("ball", R, (0, 0, 2 * R), (0, 0, -speed))
    depth = 4 * R / speed
    duration = math.ceil((depth + 1e-3) / step) * step
    scene = b.scene(
        "fast", time=Time(step=step, duration=duration), output=Output(trace_every=duration),
        domain=Domain(lo=(-0.05, -0.02, -0.5), hi=(0.02, 0.02, 0.5)),
    )  # fmt: skip
    return Extreme(
        f"fast_{speed:g}", f"impact at {speed:g} m/s on 5 MPa: overlap beyond the radius", scene,
        rebound_error([(row, None, RESTITUTION)]), 2e-3, FIRST, unguarded=True,
    )  # fmt: skip


def _pairs_scene(name: str, title: str, partners: list[tuple[str, float, float, float]]) -> Extreme:
    """A ball falls on each partner (material, radius, density, e), both free."""
    b, items, x = Builder(), [], 0.0
    for material, radius, density, e in partners:
        x += 2 * radius + R
        low = b.ball(material, radius, (x, 0, radius + 5 * R), (0, 0, 0), density)
        ball = b.ball(f"on_{material}", R, (x, 0, 2 * radius + 6 * R + 2e-3 * R), (0, 0, -SPEED),
                      LIGHT if name == "densities" else RHO)  # fmt: skip
        b.meet(material, f"on_{material}", e)
        items.append((ball, low, e))
        x += 2 * radius
    return Extreme(name, title, b.scene(name), rebound_error(items), 4e-3, FIRST)


def sizes() -> Extreme:
    """A small ball on a large one."""
    return _pairs_scene(
        "sizes", "size ratio 1 to 50", [(f"size_{s}", s * R, RHO, RESTITUTION) for s in SIZES]
    )


def densities() -> Extreme:
    """A light ball on a heavy one."""
    return _pairs_scene(
        "densities",
        "density ratio 1 to 1e5",
        [(f"d_{round(d)}", R, LIGHT * d, RESTITUTION) for d in DENSITIES],
    )  # fmt: skip


def restitutions() -> Extreme:
    """From nearly dead to elastic."""
    return _pairs_scene(
        "restitutions", "restitution 0.06 to 1", [(f"e_{round(100 * e)}", R, RHO, e) for e in RESTITUTIONS]
    )


def dead() -> Extreme:
    """Below what LIGGGHTS accepts."""
    return _pairs_scene("dead", "restitution 0.05", [("dead", R, RHO, 0.05)])


def frictions() -> Extreme:
    """Oblique impacts on the floor, held against the ODE."""
    b, rows = Builder(), []
    for k, mu in enumerate(FRICTIONS):
        name = f"mu_{round(10 * mu)}"
        rows.append(b.ball(name, R, (0, 3 * R * k, R + 2e-3 * R), (SPEED, 0, -SPEED)))
        b.meet(name, "wall", RESTITUTION, mu)
    scene = b.scene("frictions")

    def error(run: Run) -> float:
        last, worst = np.array([scene.n_steps * scene.time.step]), []
        for row in rows:
            truth = impact(scene, row, "side_zlo").at(last)
            worst.append(np.abs(run.trace["velocity"][-1, row] - truth["velocity"][0, 0]).max() / SPEED)
        return float(np.max(worst))

    return Extreme("frictions", "friction 0 to 5", scene, error, 1e-2, FIRST + "; stick and slip change")


def scaled(name: str, title: str, unit: float, young: float, origin: float = 0.0) -> Extreme:
    """A drop on the floor at another size, or elsewhere; the step goes with the size."""
    b = Builder(unit, origin, young)
    step = STEP * unit / R * math.sqrt(E / young)
    row = b.ball("ball", unit, (0, 0, 1.005 * unit), (0, 0, -SPEED))
    duration = 6000 * step
    scene = b.scene(
        name,
        time=Time(step=step, duration=duration),
        output=Output(trace_every=duration),
        allow=("rounding",) if origin else (),  # what float32 does there is what is shown
    )
    return Extreme(name, title, scene, rebound_error([(row, None, RESTITUTION)]), 2e-3, FIRST)


def concentric() -> Extreme:
    """Two balls at one place: there is no direction to push."""
    b = Builder()
    for _ in range(2):
        b.ball("ball", R, (0, 0, 5 * R), (0, 0, 0))
    return Extreme(
        "concentric", "two balls at one place", b.scene("concentric", allow=("overlap",)),
        lambda run: math.nan, 0.0, "nothing can come out: a run to the end is wrong", unguarded=True,
    )  # fmt: skip


def touching() -> Extreme:
    """Two balls that exactly touch, and one that touches the floor, stay where they are."""
    b = Builder()
    rows = [b.ball("ball", R, p, (0, 0, 0)) for p in ((0, 0, 5 * R), (2 * R, 0, 5 * R), (0, 9 * R, R))]

    def error(run: Run) -> float:
        return float(np.abs(run.trace["velocity"][:, rows]).max() / SPEED)

    return Extreme("touching", "exactly touching, at rest", b.scene("touching"), error, 1e-9, "no force")


def corner() -> Extreme:
    """Into a corner of three walls: each component by itself, without friction."""
    b = Builder()
    b.meet("ball", "wall", RESTITUTION, 0.0)
    row = b.ball("ball", R, (1.002 * R,) * 3, (-SPEED, -0.7 * SPEED, -0.5 * SPEED))
    b.balls[0] = (*b.balls[0][:2], np.array([20.0 * R] * 3), b.balls[0][3])

    def error(run: Run) -> float:
        v = run.trace["velocity"][:, row]
        return float(np.abs(-v[-1] / v[0] - RESTITUTION).max())

    return Extreme(
        "corner", "into a corner of three walls", b.scene("corner", ("xlo", "ylo", "zlo")), error, 2e-3, FIRST
    )


def edge() -> Extreme:
    """At rest in the edge of two planes under gravity across it: (m g_i/k)^(2/3) into each."""
    b = Builder()
    b.meet("ball", "wall", 0.2, 0.0)
    row = b.ball("ball", R, (R, 9 * R, R), (0, 0, 0))
    b.balls[0] = (*b.balls[0][:2], np.array([20.0 * R] * 3), b.balls[0][3])
    pull = (-6.0, 0.0, -8.0)
    scene = b.scene(
        "edge", ("xlo", "zlo"), gravity=pull, time=Time(step=2e-5, duration=0.06),
        output=Output(trace_every=0.06),
    )  # fmt: skip

    def error(run: Run) -> float:
        c, x = bodies(scene, row, "side_xlo"), run.trace["position"][-1, row]
        return max(
            abs((R - x[axis]) / static_overlap(c, -pull[axis]) - 1) for axis in (0, 2)
        )  # fmt: skip

    return Extreme(
        "edge", "at rest in the edge of two planes", scene, error, 1e-4, "what is left of the swing"
    )


def gate() -> Extreme:
    """A gate goes while a ball is pressed into it: the ball flies on as it was at that moment."""
    b = Builder()
    b.meet("ball", "wall", RESTITUTION, 0.0)
    row = b.ball("ball", R, (0, 0, 5 * R), (SPEED, 0, 0))
    opens = 4e-4
    shut = Plane(name="gate", material="wall", point=(1.02 * R, 0, 0), normal=(-1, 0, 0), removed_at=opens)
    scene = b.scene("gate", walls_more=(shut,))

    def error(run: Run) -> float:
        truth = impact(scene, row, "gate").at(np.array([opens]))["velocity"][0, 0]
        return float(np.abs(run.trace["velocity"][-1, row] - truth).max() / SPEED)

    return Extreme("gate", "pressed into a gate as it opens", scene, error, 5e-3,
                   "first order in the step, and the step at which the gate goes")  # fmt: skip


#: Light balls and heavy ones, a thousand times as dense [kg/m3].
SLIGHT, MASSIVE = 100.0, 1e5


def heavy_on_bed() -> Extreme:
    """A heavy ball comes to rest on four light ones in a box; statics from the balance of forces."""
    b = Builder(young=10 * E)
    names = (("light", MASSIVE / 100), ("heavy", MASSIVE))
    for name, density in names:
        b.material(name, density)
        for other in ("light", "heavy", "wall"):
            b.meet(name, other, 0.06, 0.0)
    rows = [b.ball("light", R, (x, y, R), (0, 0, 0)) for x in (R, 3 * R) for y in (R, 3 * R)]
    high = R + math.sqrt(4.25) * R
    top = b.ball("heavy", 1.5 * R, (2 * R, 2 * R, high), (0, 0, 0))
    b.balls[0] = (*b.balls[0][:2], np.array([2 * R, 2 * R, 800 * R]), b.balls[0][3])
    far = [
        Plane(name=f"far_{k}", material="wall", point=(4 * R, 4 * R, 0), normal=-np.eye(3)[k]) for k in (0, 1)
    ]
    scene = b.scene(
        "heavy_on_bed", ("xlo", "ylo", "zlo"), walls_more=far, gravity=(0, 0, -9.81),
        time=Time(step=5e-6, duration=0.6), output=Output(trace_every=0.6),
    )  # fmt: skip
    place = squeezed(bodies(scene, rows[0], "side_zlo"), bodies(scene, top, rows[0]), 9.81)

    def error(run: Run) -> float:
        x = run.trace["position"][-1]
        sunk = np.array([R - x[rows[0], 0], R - x[rows[0], 2], high - x[top, 2]])
        return float(np.abs(sunk / place - 1).max())

    return Extreme(
        "heavy_on_bed", "a heavy ball on a bed of light ones, density 100 to 1", scene, error, 1e-5,
        "what is left of the swing",
    )  # fmt: skip


def light_between() -> Extreme:
    """A heavy ball strikes a light one that lies before another heavy one: it rattles between them."""
    b = Builder(young=10 * E)
    for name, density in (("heavy", MASSIVE), ("light", SLIGHT)):
        b.material(name, density)
    rows = [
        b.ball(name, R, (0, 0, z), (0, 0, v), density)
        for name, z, v, density in (
            ("heavy", 10 * R, 0.0, MASSIVE), ("light", 12.002 * R, 0.0, SLIGHT),
            ("heavy", 14.004 * R, -SPEED, MASSIVE),
        )
    ]  # fmt: skip
    scene = b.scene("light_between", time=Time(step=2e-7, duration=4e-3))
    contacts = (bodies(scene, rows[0], rows[1]), bodies(scene, rows[1], rows[2]))

    def error(run: Run) -> float:
        want = row_of_spheres(contacts, scene.state.position[rows, 2], scene.state.velocity[rows, 2], 4e-3)
        return float(np.abs(run.trace["velocity"][-1, rows, 2] - want).max() / SPEED)

    return Extreme(
        "light_between", "a light ball between heavy ones, density 1000 to 1", scene, error, 4e-3, FIRST
    )  # fmt: skip


def leaves() -> Extreme:
    """A ball flies out of the open domain."""
    b = Builder()
    b.ball("ball", R, (0, 0, 5 * R), (0, 0, 100.0))
    scene = b.scene("leaves", time=Time(step=1e-5, duration=0.02), output=Output(trace_every=0.02))
    return Extreme(
        "leaves", "flies out of the domain", scene, lambda run: math.nan, 0.0,
        "it is gone: a run to the end is wrong", unguarded=True,
    )  # fmt: skip


def extremes() -> list[Extreme]:
    """All, in the order of the table."""
    return [
        speeds(), fast(30.0, 1e-6), fast(300.0, 1e-6), sizes(), densities(), restitutions(), dead(),
        frictions(), scaled("powder", "powder of 1 micrometre", 1e-6, E),
        scaled("boulder", "boulders of 1 m, 50 GPa", 1.0, 5e10),
        scaled("far", "1 km from the origin", R, E, 1000.0), concentric(), touching(), corner(), edge(),
        gate(), heavy_on_bed(), light_between(), leaves(),
    ]  # fmt: skip
