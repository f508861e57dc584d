"""Contacts at rest and impacts at many steps in one scene, for the map of stable steps.

A step is long or short by the size of the ball alone: the Rayleigh time goes with the radius. So one scene
at one step holds the whole ladder, a ball of another radius for each rung, and every contact is one of many
that do not touch each other.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from comparisons.oracles import step_limit
from comparisons.oracles.bodies import Bodies
from gpudem.output.run import Run
from gpudem.scene import Contact, Domain, Explicit, Material, Output, Pair, Plane, Scene, Time

BALL = Material(young=5e6, poisson=0.34, density=1768.0)
STEP, GRAVITY, IMPACT = 1e-4, 9.81, 1.0
RESTITUTIONS, FRICTIONS = (0.1, 0.3, 0.5, 0.9, 1.0), (0.0, 0.5)
#: Balls in a column; steps of a run at rest; rows of its trace.
COLUMN, REST_STEPS, ROWS = 20, 600, 10
#: Characteristic velocity of `hooke` [m/s]: that of the impacts.
HOOKE = IMPACT
#: A contact at rest is unstable where a push has grown so many times: near the limit a stable mode of finite
#: amplitude swells less, an unstable one by a factor a step.
GROWN = 100.0
#: The push [share of sqrt(g overlap)]: small, so that the contact stays linear.
PUSH = 1e-4
#: The ladder ends so far above the closed form's limit: beyond, balls only fly further.
BEYOND = 1.3
#: Room along y, and above and below the floor, for balls thrown out [m]; LIGGGHTS bins all of it.
ROOM = {"rest": (0.0, 0.5), "column": (0.0, 0.2), "impact": (1.2, 1.6)}
#: Guards that the ladders waive: one ball beyond its limit must not end the run of the others.
WAIVED = ("time_step", "speed", "large_overlap")
#: Moments of the first touch within a step that an impact is tried at.
PHASES = 8
#: An impact is unstable above this gain of energy over the law's, inaccurate above this error of the rebound.
GAIN, INACCURATE = 0.01, 0.01
STABLE, POOR, UNSTABLE = 0, 1, 2


@dataclasses.dataclass(frozen=True)
class Spot:
    """One contact or column: its place in the map."""

    kind: str
    """"rest", "column" or "impact"."""
    share: float
    """Step / Rayleigh time."""
    restitution: float
    friction: float
    rows: tuple[int, ...]


def ladder(first: float, last: float, ratio: float) -> list[float]:
    """Steps as shares of the Rayleigh time, from `first` up to `last` by a fixed ratio."""
    count = round(math.log(last / first) / math.log(ratio))
    return [first * ratio**k for k in range(count + 1)]


def radius_of(share: float) -> float:
    """Radius [m] of the ball for which STEP is this share of the Rayleigh time."""
    return STEP / (share * step_limit.rayleigh_time(1.0, BALL.young, BALL.poisson, BALL.density))


def _name(e: float, mu: float) -> str:
    return f"e{round(100 * e)}_mu{round(100 * mu)}"


GROUPS = {_name(e, mu): (e, mu) for e in RESTITUTIONS for mu in FRICTIONS}


def _scene(
    name: str, contact: Contact, balls: list[tuple], room: tuple[float, float], allow=WAIVED, **changes
) -> Scene:  # fmt: skip
    """Balls (material, radius, position, velocity, spin) over a floor."""
    names = list(dict.fromkeys(ball[0] for ball in balls))
    partners = [*names, "floor"]
    pairs = [
        Pair(materials=(a, b), restitution=GROUPS[a][0], friction=GROUPS[a][1])
        for k, a in enumerate(names) for b in partners[k:]
    ]  # fmt: skip
    material, radius, position, velocity, spin = zip(*balls, strict=True)
    side = 2 * max(radius)
    top = np.max(np.array(position) + np.array(radius)[:, None], axis=0)
    return Scene(
        name=name, materials=dict.fromkeys(partners, BALL), pairs=pairs, contact=contact,
        particles=Explicit(position=position, velocity=velocity, angular_velocity=spin, radius=radius,
                           material=material),
        walls=[Plane(name="floor", material="floor", point=(0, 0, 0), normal=(0, 0, 1))],
        domain=Domain(
            lo=(-side, -side - room[0], -room[1]),
            hi=(float(top[0]) + side, float(top[1]) + side + room[0], room[1]),
        ),
        allow=allow, **changes,
    )  # fmt: skip


def law(normal: str) -> Contact:
    """`hertz` or `hooke`, with friction springs."""
    return Contact(normal="hooke", characteristic_velocity=HOOKE) if normal == "hooke" else Contact()


def _hooke(normal: str) -> float | None:
    return HOOKE if normal == "hooke" else None


def _bodies(radius: float, e: float, mu: float, pair: bool = False) -> Bodies:
    mass = 4 / 3 * math.pi * radius**3 * BALL.density
    young = BALL.young / (2 * (1 - BALL.poisson**2))
    shear = BALL.young / (4 * (2 - BALL.poisson) * (1 + BALL.poisson))
    other = (mass, radius) if pair else (math.inf, math.inf)
    return Bodies((mass, other[0]), (radius, other[1]), young, shear, e, mu)


def _resting(normal: str, share: float, name: str, count: int, x: float, y: float) -> list[tuple]:
    """A ball, or a column, at rest under its own weight; the topmost is given a push down and, with friction,
    sideways so that the surface slips and nothing rolls.
    """
    e, mu = GROUPS[name]
    radius, z, found = radius_of(share), 0.0, []
    floor, pair = _bodies(radius, e, mu), _bodies(radius, e, mu, pair=True)
    for k in range(count):
        load = (count - k) * floor.mass[0] * GRAVITY
        overlap = step_limit.rest(floor if k == 0 else pair, load, _hooke(normal))[0]
        z += (radius if k == 0 else 2 * radius) - overlap
        v = PUSH * math.sqrt(GRAVITY * overlap)
        side = v if mu else 0.0
        velocity = (side, 0.0, -v) if k == count - 1 else (0.0, 0.0, 0.0)
        found.append((name, radius, (x, y, z), velocity, (0.0, -2.5 * side / radius, 0.0)))
    return found


def _rest_scene(name: str, normal: str, balls: list[tuple], allow: tuple[str, ...] = WAIVED) -> Scene:
    return _scene(
        f"{name}_{normal}", law(normal), balls, ROOM[name], allow, gravity=(0.0, 0.0, -GRAVITY),
        time=Time(step=STEP, duration=REST_STEPS * STEP),
        output=Output(trace_every=REST_STEPS // ROWS * STEP),
    )  # fmt: skip


def at_rest(normal: str, shares: list[float]) -> tuple[Scene, list[Spot]]:
    """Single balls at rest on a floor, all groups and all steps up to BEYOND times the limit."""
    balls, spots, y = [], [], 0.0
    for name, (e, mu) in GROUPS.items():
        x, widest = 0.0, 0.0
        for share in shares:
            spot = Spot("rest", share, e, mu, (len(balls),))
            if share > BEYOND * limit(spot, normal):
                continue
            radius = radius_of(share)
            balls += _resting(normal, share, name, 1, x + 1.5 * radius, y)
            spots.append(spot)
            x, widest = x + 3 * radius, max(widest, radius)
        y += 3 * widest
    return _rest_scene("rest", normal, balls), spots


def column(normal: str, e: float, share: float) -> tuple[Scene, Spot]:
    """One column without friction: what is unstable throws its balls out at kilometres a second."""
    balls = _resting(normal, share, _name(e, 0.0), COLUMN, 0.0, 0.0)
    spot = Spot("column", share, e, 0.0, tuple(range(COLUMN)))
    return _rest_scene("column", normal, balls, ("time_step",)), spot


def column_limit(normal: str, e: float) -> float:
    """Step / Rayleigh time at which the closed form of a column's limit equals the step, by iteration."""
    share = 1.0
    for _ in range(60):
        share = limit(Spot("column", share, e, 0.0, ()), normal)
    return share


def impacts(normal: str, shares: list[float]) -> tuple[Scene, list[Spot]]:
    """Balls that fly at the floor at IMPACT, head-on or (with friction) as fast along it; no gravity."""
    balls, spots, y, longest = [], [], 0.0, 0.0
    for name, (e, mu) in GROUPS.items():
        x, widest = 0.0, 0.0
        for share in shares:
            radius, first = radius_of(share), len(balls)
            for phase in range(PHASES):
                gap = IMPACT * STEP * (1 + (phase + 0.5) / PHASES)
                velocity = (0.0, IMPACT if mu else 0.0, -IMPACT)
                balls.append((name, radius, (x + 1.5 * radius, y, radius + gap), velocity, (0.0, 0.0, 0.0)))
                x += 3 * radius
            spots.append(Spot("impact", share, e, mu, tuple(range(first, len(balls)))))
            widest = max(widest, radius)
            c = _bodies(radius, e, mu)
            longest = max(longest, contact_time(c, normal))
        y += 3 * widest + 0.03
    steps = math.ceil(2 * longest / STEP) + 8
    stated = _scene(
        f"impact_{normal}", law(normal), balls, ROOM["impact"],
        time=Time(step=STEP, duration=steps * STEP), output=Output(trace_every=steps * STEP),
    )  # fmt: skip
    return stated, spots


def contact_time(c: Bodies, normal: str) -> float:
    """Elastic contact time [s] of an impact at IMPACT."""
    if normal == "hooke":
        return math.pi * math.sqrt(c.mass_star / step_limit.hooke_stiffness(c, HOOKE))
    from comparisons.oracles.closed_forms import elastic_contact_time

    return elastic_contact_time(c, IMPACT)


def limit(spot: Spot, normal: str) -> float:
    """Closed form of the largest stable step of a contact at rest / Rayleigh time, of this spot's radius."""
    radius = radius_of(spot.share)
    floor = _bodies(radius, spot.restitution, spot.friction)
    speed, tr = _hooke(normal), STEP / spot.share
    if spot.kind == "rest":
        return step_limit.single(floor, floor.mass[0] * GRAVITY, speed) / tr
    pair = _bodies(radius, spot.restitution, spot.friction, pair=True)
    return step_limit.column(COLUMN, floor, pair, GRAVITY, speed) / tr


def growth(run: Run, spot: Spot) -> float:
    """Largest motion in the second half of the run / the push: velocity of centre and surface, and its change
    in a step, F dt/m: near the limit the velocity changes sign at each step and its mean is small.
    """
    rows, radius = list(spot.rows), radius_of(spot.share)
    mass = 4 / 3 * math.pi * radius**3 * BALL.density
    parts = (
        run.trace["velocity"][:, rows], radius * run.trace["angular_velocity"][:, rows],
        STEP / mass * run.trace["force"][:, rows],
    )  # fmt: skip
    size = np.sqrt(sum((part**2).sum(axis=2) for part in parts)).max(axis=1)
    return float(size[len(size) // 2 :].max() / size[0])


def rebound(run: Run, spot: Spot) -> tuple[float, float]:
    """(largest energy after an impact / before, largest |v_out / (e v_in) - 1|) over the moments of touch.

    Energy is that of centre and spin. A ball still below the floor at the end counts as infinite.
    """
    rows = list(spot.rows)
    velocity, spin = (run.trace[k][-1, rows] for k in ("velocity", "angular_velocity"))
    radius = radius_of(spot.share)
    energy = (velocity**2).sum(axis=1) + 0.4 * radius**2 * (spin**2).sum(axis=1)
    start = (run.trace["velocity"][0, rows] ** 2).sum(axis=1)
    error = np.abs(velocity[:, 2] / (spot.restitution * IMPACT) - 1)
    return float((energy / start).max()), float(error.max())


def judged(run: Run, spot: Spot) -> int:
    """STABLE, POOR or UNSTABLE."""
    if spot.kind != "impact":
        return UNSTABLE if not growth(run, spot) < GROWN else STABLE
    energy, error = rebound(run, spot)
    if not energy < 1 + GAIN:
        return UNSTABLE
    return STABLE if error < INACCURATE else POOR


def floor_bodies(spot: Spot) -> Bodies:
    """A ball of this spot on the floor."""
    return _bodies(radius_of(spot.share), spot.restitution, spot.friction)
