"""Contacts at rest, columns and impacts at many time steps, for the map of stable steps.

The Rayleigh time is proportional to the radius. So one scene at one step holds a whole sweep: a ball of
another radius for each ratio of step and Rayleigh time, none of which touches another.
"""

from __future__ import annotations

import dataclasses
import functools
import math

import numpy as np

from comparisons.cases.side_by_side import floor, traced
from comparisons.oracles import step_limit
from comparisons.oracles.bodies import Bodies
from comparisons.oracles.closed_forms import elastic_contact_time
from gpudem.output.run import Run
from gpudem.scene import Explicit, Material, Pair, Scene

BALL = Material(young=5e6, poisson=0.34, density=1768.0)
STEP, GRAVITY, IMPACT = 1e-4, 9.81, 1.0
#: Characteristic velocity of each normal law [m/s].
VELOCITY = {"hertz": None, "hooke": IMPACT}
#: {material: (restitution, friction)}
GROUPS = {
    f"e{round(100 * e)}_mu{round(100 * mu)}": (e, mu)
    for e in (0.1, 0.3, 0.5, 0.9, 1.0) for mu in (0.0, 0.5)
}  # fmt: skip
#: Balls in a column; steps of a run at rest; rows of its trace.
COLUMN, REST_STEPS, ROWS = 20, 600, 10
#: A contact at rest is unstable where a perturbation has grown by this factor: near the limit a stable mode
#: of finite amplitude grows less, an unstable one by a factor in each step.
GROWN = 100.0
#: The perturbation / sqrt(g overlap): small, so that the contact stays linear.
PUSH = 1e-4
#: The sweep ends at this multiple of the closed form's limit: beyond, balls only fly further.
BEYOND = 1.3
#: Distance of the domain along y, and above and below the floor, for balls that are thrown out [m].
ROOM = {"rest": (0.0, 0.5), "column": (0.0, 0.2), "impact": (1.2, 1.6)}
#: Guards that the sweeps waive: one ball beyond its limit must not end the run of the others.
WAIVED = ("time_step", "speed", "large_overlap")
#: Positions of the first contact within a time step.
PHASES = 8
#: An impact is unstable above this gain of energy over that of the law, inaccurate above this rebound error.
GAIN, INACCURATE = 0.01, 0.01
STABLE, POOR, UNSTABLE = 0, 1, 2


@dataclasses.dataclass(frozen=True)
class Spot:
    """One contact or column at one step."""

    kind: str
    """"rest", "column", "impact" or "bed"."""
    share: float
    """Step / Rayleigh time."""
    restitution: float
    friction: float
    rows: tuple[int, ...] = ()
    """Its balls."""

    @property
    def radius(self) -> float:
        """Radius of its balls [m]: that for which STEP is its share of the Rayleigh time."""
        return STEP / (self.share * step_limit.rayleigh_time(1.0, BALL.young, BALL.poisson, BALL.density))

    def bodies(self, pair: bool = False) -> Bodies:
        """A ball on the floor, or two balls."""
        mass = 4 / 3 * math.pi * self.radius**3 * BALL.density
        young = BALL.young / (2 * (1 - BALL.poisson**2))
        shear = BALL.young / (4 * (2 - BALL.poisson) * (1 + BALL.poisson))
        other = (mass, self.radius) if pair else (math.inf, math.inf)
        return Bodies(
            (mass, other[0]), (self.radius, other[1]), young, shear, self.restitution, self.friction
        )


def sweep(first: float, last: float, ratio: float) -> list[float]:
    """Steps / Rayleigh time from `first` up to `last` by a fixed ratio."""
    return [first * ratio**k for k in range(round(math.log(last / first) / math.log(ratio)) + 1)]


def _scene(kind: str, normal: str, balls: list[tuple], steps: int, rows: int, allow=WAIVED, **more) -> Scene:
    """Balls (material, radius, position, velocity, spin) over a floor."""
    material, radius, position, velocity, spin = zip(*balls, strict=True)
    names, room = list(dict.fromkeys(material)), ROOM[kind]
    partners, side = [*names, "floor"], 2 * max(radius)
    top = np.max(np.array(position) + np.array(radius)[:, None], axis=0)
    return traced(
        f"{kind}_{normal}",
        Explicit(position=position, velocity=velocity, angular_velocity=spin, radius=radius,
                 material=material),
        step=STEP, duration=steps * STEP, every=steps // rows * STEP,
        lo=(-side, -side - room[0], -room[1]),
        hi=(float(top[0]) + side, float(top[1]) + side + room[0], room[1]),
        materials=dict.fromkeys(partners, BALL), walls=[floor()], allow=allow,
        pairs=[
            Pair(materials=(a, b), restitution=GROUPS[a][0], friction=GROUPS[a][1])
            for k, a in enumerate(names) for b in partners[k:]
        ],
        contact={"normal": normal, "characteristic_velocity": VELOCITY[normal]}, **more,
    )  # fmt: skip


def _resting(normal: str, share: float, name: str, count: int, x: float, y: float) -> list[tuple]:
    """A ball, or a column, at rest under its own weight. The top one is perturbed downwards and, with
    friction, sideways, with a spin so that the surface slips and does not roll.
    """
    z, found, spot = 0.0, [], Spot("rest", share, *GROUPS[name])
    for k in range(count):
        load = (count - k) * spot.bodies().mass[0] * GRAVITY
        overlap = step_limit.rest(spot.bodies(pair=k > 0), load, VELOCITY[normal])[0]
        z += (2 * spot.radius if k else spot.radius) - overlap
        v = PUSH * math.sqrt(GRAVITY * overlap)
        side = v if spot.friction else 0.0
        velocity = (side, 0.0, -v) if k == count - 1 else (0.0, 0.0, 0.0)
        found.append((name, spot.radius, (x, y, z), velocity, (0.0, -2.5 * side / spot.radius, 0.0)))
    return found


def at_rest(normal: str, shares: list[float]) -> tuple[Scene, list[Spot]]:
    """Single balls at rest on a floor: all groups, all steps up to BEYOND times the limit."""
    balls, spots, y = [], [], 0.0
    for name, group in GROUPS.items():
        x, widest = 0.0, 0.0
        for share in shares:
            spot = Spot("rest", share, *group, (len(balls),))
            if share > BEYOND * limit(spot, normal):
                continue
            balls += _resting(normal, share, name, 1, x + 1.5 * spot.radius, y)
            spots.append(spot)
            x, widest = x + 3 * spot.radius, max(widest, spot.radius)
        y += 3 * widest
    return _scene("rest", normal, balls, REST_STEPS, ROWS, gravity=(0.0, 0.0, -GRAVITY)), spots


def column(normal: str, e: float, share: float) -> tuple[Scene, Spot]:
    """One frictionless column in a scene of its own: an unstable one throws balls out at km/s."""
    balls = _resting(normal, share, f"e{round(100 * e)}_mu0", COLUMN, 0.0, 0.0)
    scene = _scene(
        "column", normal, balls, REST_STEPS, ROWS, allow=("time_step",), gravity=(0.0, 0.0, -GRAVITY)
    )
    return scene, Spot("column", share, e, 0.0, tuple(range(COLUMN)))


def column_limit(normal: str, e: float) -> float:
    """Largest stable step of a column / Rayleigh time: the step that its closed form equals, by iteration."""
    share = 1.0
    for _ in range(60):
        share = limit(Spot("column", share, e, 0.0), normal)
    return share


def impacts(normal: str, shares: list[float]) -> tuple[Scene, list[Spot]]:
    """Balls that hit the floor at IMPACT, head-on or (with friction) as fast along it; no gravity."""
    balls, spots, y, longest = [], [], 0.0, 0.0
    for name, group in GROUPS.items():
        x, widest = 0.0, 0.0
        for share in shares:
            first, spot = len(balls), Spot("impact", share, *group)
            for phase in range(PHASES):
                gap = IMPACT * STEP * (1 + (phase + 0.5) / PHASES)
                velocity, r = (0.0, IMPACT if spot.friction else 0.0, -IMPACT), spot.radius
                balls.append((name, r, (x + 1.5 * r, y, r + gap), velocity, (0.0, 0.0, 0.0)))
                x += 3 * r
            spots.append(dataclasses.replace(spot, rows=tuple(range(first, len(balls)))))
            widest, longest = max(widest, spot.radius), max(longest, contact_time(spot, normal))
        y += 3 * widest + 0.03
    return _scene("impact", normal, balls, math.ceil(2 * longest / STEP) + 8, 1), spots


def contact_time(spot: Spot, normal: str) -> float:
    """Elastic contact time [s] of an impact at IMPACT."""
    c = spot.bodies()
    if normal == "hooke":
        return math.pi * math.sqrt(c.mass_star / step_limit.hooke_stiffness(c, IMPACT))
    return elastic_contact_time(c, IMPACT)


@functools.lru_cache(4096)
def limit(spot: Spot, normal: str) -> float:
    """Closed form of the largest stable step of a contact or column at rest / Rayleigh time."""
    ball, speed, rayleigh = spot.bodies(), VELOCITY[normal], STEP / spot.share
    if spot.kind == "rest":
        return step_limit.single(ball, ball.mass[0] * GRAVITY, speed) / rayleigh
    return step_limit.column(COLUMN, ball, spot.bodies(pair=True), GRAVITY, speed) / rayleigh


def growth(run: Run, spot: Spot) -> float:
    """Largest motion in the second half of the run / the perturbation: velocity of the center and of the
    surface, and its change in a step, F dt/m: near the limit the velocity changes sign in each step and its
    mean is small.
    """
    rows = list(spot.rows)
    parts = (
        run.trace["velocity"][:, rows], spot.radius * run.trace["angular_velocity"][:, rows],
        STEP / spot.bodies().mass[0] * run.trace["force"][:, rows],
    )  # fmt: skip
    size = np.sqrt(sum((part**2).sum(axis=2) for part in parts)).max(axis=1)
    return float(size[len(size) // 2 :].max() / size[0])


def rebound(run: Run, spot: Spot) -> tuple[float, float]:
    """(largest energy of center and spin after an impact / before, largest |v_out / (e v_in) - 1|) over the
    phases. A ball below the floor at the end has a rebound of the wrong sign.
    """
    rows = list(spot.rows)
    velocity, spin = (run.trace[k][-1, rows] for k in ("velocity", "angular_velocity"))
    energy = (velocity**2).sum(axis=1) + 0.4 * spot.radius**2 * (spin**2).sum(axis=1)
    start = (run.trace["velocity"][0, rows] ** 2).sum(axis=1)
    error = np.abs(velocity[:, 2] / (spot.restitution * IMPACT) - 1)
    return float((energy / start).max()), float(error.max())


def judged(run: Run, spot: Spot) -> int:
    """STABLE, POOR or UNSTABLE; what is not a number is unstable."""
    if spot.kind != "impact":
        return STABLE if growth(run, spot) < GROWN else UNSTABLE
    energy, error = rebound(run, spot)
    if not energy < 1 + GAIN:
        return UNSTABLE
    return STABLE if error < INACCURATE else POOR
