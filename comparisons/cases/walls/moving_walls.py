"""Walls that move under a ball, and a belt: closed forms, thresholds of the bouncing ball, step by step."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable

import numpy as np

from comparisons import kit
from comparisons.cases.side_by_side import mesh
from comparisons.cases.walls.scenes import (
    FRICTION,
    GRAVITY,
    HALF,
    RADIUS,
    RESTITUTION,
    STEP,
    every_column,
    no_contact,
    on_floor,
    scene,
)
from comparisons.oracles.bouncing_ball import map_heights, thresholds
from comparisons.oracles.closed_forms import contact_time
from comparisons.oracles.mesh_shapes import rectangle
from comparisons.report import plots
from gpudem.output.run import Run
from gpudem.scene import Scene

#: Speed of the plate and of the belt [m/s]; period of table, swing and shaken plate [s], so long that a ball
#: on the table never slips, nor where its spring is loaded first: there 1.3 (2/7 w)^2 r = 2.5 m/s2 of 4.9.
SPEED, PERIOD = 0.3, 0.15
#: Amplitudes of the swing [rad] and of the shaken plate [m].
SWING, SHAKEN = 0.2, 0.003
#: Place of a ball on a table from its axis, and place of the axis [m]. No round numbers: a ball that comes
#: to lie exactly over an edge or a node has one contact more in LIGGGHTS for a step, decided by the last bit.
PLACE, AXIS = np.array([0.0121, 0.00537]), np.array([-0.0043, 0.0027])
FLAT = rectangle((-HALF, -HALF, 0), (2 * HALF, 0, 0), (0, 2 * HALF, 0), (8, 8))
#: A ball that bounces on a plate: period of the plate [s], periods in all and those at the end that count.
BEAT, PERIODS, COUNTED = 0.04, 20, 6
#: Accelerations of the plates by that of period doubling.
BOUNCING = (0.85, 0.94, 1.06, 1.1)


def carried(what: str, motion: dict | None, velocity: tuple[float, float], spin: np.ndarray | float,
            **wall: object) -> Scene:  # fmt: skip
    """A ball at rest on a plate of 128 triangles but for the velocity and spin that it starts with."""
    deep = on_floor()[0]
    motions = [] if motion is None else [motion]
    place = [[*(AXIS + PLACE), RADIUS - deep]]
    plate = mesh("plate", FLAT, motion=motions, **wall)
    return scene(f"carried_{what}", [plate], place, [*velocity, 0.0], spin, duration=0.1, half=2 * HALF)


def rolls(what: str, motion: dict, surface: tuple[float, float]) -> Scene:
    """A ball that rolls on a surface of this velocity at the start [m/s].

    In the set-up of a run the wall is at rest, and the dashpot takes k v' of the velocity and k v'/share of
    that of the point of contact, v', by which the ball starts faster (`Floor.kick` is k).
    """
    floor, surface_velocity = on_plate(), np.array(surface)
    point = surface_velocity / (1 - floor.kick / floor.share)
    velocity = floor.share * surface_velocity + floor.kick * point
    x, y = (point - velocity) / floor.arm
    return carried(what, motion, (float(velocity[0]), float(velocity[1])), np.array([y, -x, 0.0]))


def bouncing(name: str, periods: float, every: float) -> Scene:
    """Four balls, each on a plate that moves up and down at another acceleration."""
    begin, doubles = thresholds(RESTITUTION)
    walls, position, velocity = [], [], []
    omega = 2 * math.pi / BEAT
    for k, strength in enumerate(doubles * np.array(BOUNCING)):
        x = 0.02 * (k - 1.5)
        size = strength * GRAVITY / omega**2
        plate = rectangle((x - 0.008, -0.008, 0), (0.016, 0, 0), (0, 0.016, 0))
        motion = {"type": "oscillate", "amplitude": (0.0, 0.0, size), "period": BEAT}
        walls.append(mesh(f"plate{k}", plate, motion=[motion]))
        leaves = math.acos(begin / strength) / omega  # when the ball of one period a flight leaves its plate
        flown, up = BEAT - leaves, GRAVITY * BEAT / 2
        high = size * math.sin(omega * leaves) + up * flown - GRAVITY * flown**2 / 2
        position.append([x, 0.0, RADIUS + high])
        velocity.append([0.0, 0.0, up - GRAVITY * flown])
    return scene(name, walls, position, velocity, duration=periods * BEAT, every=every)


def variants(tier: kit.Tier) -> list[kit.Variant]:
    """One scene each."""
    rate = 2 * math.pi / PERIOD
    turn = {"axis": (0, 0, 1), "point": (*AXIS, 0.0), "period": PERIOD}
    table = (-rate * PLACE[1], rate * PLACE[0])
    shaken = {"type": "oscillate", "amplitude": (SHAKEN, 0.0, 0.0), "period": PERIOD}
    made = [
        carried("linear", {"type": "linear", "velocity": (SPEED, 0.0, 0.0)}, (0.0, 0.0), 0.0),
        carried("belt", None, (0.0, 0.0), 0.0, surface_velocity=(SPEED, 0.0, 0.0)),
        rolls("rotate", {"type": "rotate", **turn}, table),
        rolls("swing", {"type": "swing", "amplitude": SWING, **turn}, (SWING * table[0], SWING * table[1])),
        rolls("shaken", shaken, (SHAKEN * rate, 0.0)),
        bouncing("bounces", 1.25, STEP),
        bouncing("doubling", PERIODS, 2e-4),
    ]
    return [kit.Variant(one.name, one) for one in made]


# -- closed forms --------------------------------------------------------------------------------------------


@dataclasses.dataclass(frozen=True)
class Floor:
    """A ball at rest on a floor: its tangential contact is a spring and a dashpot, of constant overlap."""

    arm: float
    """From the center to the point of contact, R - overlap/2 [m]."""
    share: float
    """Of the surface's velocity that a ball has while it rolls: I/(I + m arm^2), 2/7 for arm R."""
    kick: float
    """Share c_t dt/(2 m) of the velocity of its point of contact that a ball loses in the set-up of a run,
    where the dashpot acts without a spring, and so without Coulomb's limit, in LIGGGHTS and in gpudem."""
    decay: float
    """Of the oscillation on spring and dashpot, c_t/(2 m share) [1/s]."""
    frequency: float
    """Of that oscillation, sqrt(k_t/(m share) - decay^2) [rad/s]."""


@functools.cache
def on_plate() -> Floor:
    """Of the balls of this case."""
    deep, c = on_floor()
    arm, mass = RADIUS - deep / 2, c.mass[0]
    share = c.inertia[0] / (c.inertia[0] + mass * arm**2)
    spring, dashpot = c.tangential_constant * deep**0.5, c.tangential_damping * deep**0.25
    decay = dashpot / (2 * mass * share)
    frequency = math.sqrt(spring / (mass * share) - decay**2)
    return Floor(arm, share, dashpot * STEP / (2 * mass), decay, frequency)


def started(time: np.ndarray, begin: float = 0.0) -> np.ndarray:
    """Velocity [m/s] of a ball from rest on a surface of velocity V, shape (t, 2); begin: from the set-up.

    It slips at the acceleration mu g, which the set-up, half a step, does not have. Where it takes over its
    share of V slip ends with the spring loaded by mu m g. With s its length, s'' + 2 decay s' + (decay^2 +
    frequency^2) s = 0 from rest, and v = share (V - s'): the spring drives the ball beyond what it keeps.
    """
    floor, rise = on_plate(), FRICTION * GRAVITY
    kept = floor.share * SPEED
    since = time - STEP / 2 - (kept - begin) / rise
    spring = np.exp(-floor.decay * np.maximum(since, 0)) * np.sin(floor.frequency * since) / floor.frequency
    x = kept + rise * np.where(since < 0, since, spring)
    return np.stack([x, np.zeros_like(x)], axis=1)


def turned(angle: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Velocity [m/s] on a table: the place turns by 2/7 of the angle of the table, (t, 2).

    m v' = F, I w' = -R z x F and the velocity of the point of contact give v' = 2/7 d(rate z x r)/dt.
    """
    share = on_plate().share
    along = 1j * share * rate * np.exp(1j * share * angle) * complex(*PLACE)
    return np.stack([along.real, along.imag], axis=1)


def exact(label: str, time: np.ndarray) -> np.ndarray:
    """Velocity [m/s] in the plane of the plate by closed form, shape (t, 2)."""
    rate = 2 * math.pi / PERIOD
    wave = rate * time
    forms: dict[str, Callable[[], np.ndarray]] = {
        "linear": lambda: started(time),
        "belt": lambda: started(time, on_plate().kick * SPEED),
        "rotate": lambda: turned(wave, np.full_like(time, rate)),
        "swing": lambda: turned(SWING * np.sin(wave), SWING * rate * np.cos(wave)),
        "shaken": lambda: (
            on_plate().share * SHAKEN * rate * np.stack([np.cos(wave), np.zeros_like(wave)], axis=1)
        ),
    }
    return forms[label]()


#: Balls that slip at first, and balls that roll from the start.
SLIPPING, ROLLING = ("linear", "belt"), ("rotate", "swing", "shaken")


def velocity_error(results: kit.Results, code: str, labels: tuple[str, ...]) -> dict[str, float]:
    """Largest error of the velocity of each ball that is carried, by its largest velocity."""
    found = {}
    for label in labels:
        run = results[f"carried_{label}", code]
        trace = run.trace
        if no_contact(run):
            return {f"{label}: {no_contact(run)}": math.nan}
        # where it rolls from the start, the spring is first to take up the force: 1e-4 of that is left then
        late = trace["time"] >= (math.log(1e4) / on_plate().decay if label in ROLLING else STEP / 2)
        want = exact(label, trace["time"])
        gap = np.linalg.norm(trace["velocity"][:, 0, :2] - want, axis=1)[late].max()
        found[label] = float(gap / np.linalg.norm(want, axis=1).max())
    return found


def map_error() -> float:
    """By which share the accelerations of the map may be off: impacts last a time t, by which flights are
    shorter, and in which the plate changes its velocity by y'' t, y'' of up to 1.11 g at the threshold.
    """
    closing = GRAVITY * BEAT / (1 + RESTITUTION)  # v - u before an impact: g T/2 + (1 - e)/(1 + e) g T/2
    return 2.11 * contact_time(on_floor()[1], closing) / BEAT


def tops(run: Run) -> list[np.ndarray]:
    """Heights of the flights of each ball over the last periods [m]: vertices of parabolas."""
    time, z = run.trace["time"], run.trace["position"][:, :, 2]
    late = time >= (PERIODS - COUNTED) * BEAT
    found = []
    for height in z[late].T:
        k = 1 + np.flatnonzero((height[1:-1] >= height[:-2]) & (height[1:-1] > height[2:]))
        before, here, after = height[k - 1], height[k], height[k + 1]
        found.append(here + (after - before) ** 2 / (8 * (2 * here - before - after)))
    return found


def doubling(run: Run) -> list[float]:
    """Difference of successive heights by g T^2/8, the height of a flight of one period, of each ball."""
    return [float(np.abs(np.diff(high)).min() / (GRAVITY * BEAT**2 / 8)) for high in tops(run)]


def once_a_period(results: kit.Results, code: str) -> dict[str, float]:
    """Differences of successive heights below the threshold."""
    found = doubling(results["doubling", code])
    return {f"{BOUNCING[k]:.3g} of the threshold": found[k] for k in (0, 1)}


def shortfall(results: kit.Results, code: str) -> dict[str, kit.Measured]:
    """How much the differences of successive heights above the threshold fall below those of the map, at the
    accelerations that the map may be off by.
    """
    found, wanted = doubling(results["doubling", code]), {}
    shift, doubles = map_error(), thresholds(RESTITUTION)[1]
    for k in (2, 3):
        least = min(
            np.abs(np.diff(map_heights(RESTITUTION, BOUNCING[k] * doubles * by))).min()
            for by in (1 - shift, 1.0, 1 + shift)
        )
        short = kit.Measured(max(float(least) - found[k], 0.0), found[k], float(least))
        wanted[f"{BOUNCING[k]:.3g} of the threshold"] = short
    return wanted


def draw(results: kit.Results) -> plots.Figure:
    """Velocities of the balls that are carried, and heights of those that bounce."""
    figure, axes = plots.figure(2, 3, width=plots.WHOLE, height=5.6)
    doubles = thresholds(RESTITUTION)[1]
    for axis, label in zip(axes.flat, (*SLIPPING, *ROLLING), strict=False):
        codes = results.codes(f"carried_{label}")
        for who in (*codes, "oracle"):
            time = results[f"carried_{label}", codes[0]].trace["time"]
            along = exact(label, time)[:, 0]
            if who != "oracle":
                time, along = (results[f"carried_{label}", who].trace[c] for c in ("time", "velocity"))
                along = along[:, 0, 0]
            axis.plot(time, along, **plots.style(who, markevery=len(time) // 20))
        axis.set(title=label, xlabel="time [s]", ylabel="velocity along x [m/s]")
    for code in results.codes("doubling"):
        for strength, heights in zip(BOUNCING, tops(results["doubling", code]), strict=True):
            above = 1e3 * (heights - RADIUS)
            axes[1, 2].plot(
                np.full(len(above), strength * doubles), above, **plots.marks(code, color=plots.color(code))
            )
    for strength in np.linspace(0.82, 1.12, 61) * doubles:
        above = 1e3 * GRAVITY * BEAT**2 / 8 * map_heights(RESTITUTION, strength)
        axes[1, 2].plot(np.full(len(above), strength), above, ",", color=plots.color("oracle"))
    axes[1, 2].axvline(doubles, color=plots.color("oracle"), linewidth=1)
    axes[1, 2].set(title="bouncing", xlabel="acceleration of the plate / g", ylabel="heights [mm]")
    plots.legend(axes[0, 0])
    return figure


COMPARED = {
    "position": "a wall that is a step ahead or behind, another order of its motions",
    "velocity": "the velocity of the wall at its center in place of its point",
    "angular_velocity": "a lever arm of another length",
    "force": "a spring that does not turn with its wall; a spring lost at an edge",
}
CASE = kit.Case(
    name="moving_walls",
    title="Walls that move",
    purpose=(
        "A ball lies on a plate of triangles that moves straight on, turns, swings or is shaken, or on a"
        " belt. It slips until it rolls, and then follows with two sevenths of the velocity of the surface,"
        " so on a turntable it turns by two sevenths of the angle. A ball that bounces on a plate that moves"
        " up and down does so once a period, up to a known acceleration, above which heights alternate."
        " LIGGGHTS moves a mesh by sums over steps in some motions; rule 'liggghts' follows it to rounding."
    ),
    source=(
        "Coulomb friction and rolling of a solid sphere, derived in comparisons/cases/walls/moving_walls.py;"
        " turntable: Weckesser 1997, Am. J. Phys. 65, 736. Bouncing ball: threshold and map derived in"
        " comparisons/oracles/bouncing_ball.py; the problem: Barroso et al. 2009, Phys. Rev. E 79, 026206."
    ),
    variants=variants,
    checks=(
        *every_column(
            COMPARED, "carried_", "carried: ", tolerance=1e-9,
            reason="same law, scheme and sums of motions: rounding, some 1e-13",
        ),
        *every_column(
            COMPARED, "bounces", "bounces: ", tolerance=1e-8,
            reason="rounding; the place of an oscillating plate is a sum of 5000 terms of up to 1e-5 m,"
            " which LIGGGHTS adds up in another order: 1e-16 m each, 5e-13 m at most of an overlap of 1e-4 m",
        ),
        kit.per_code(
            "velocity from rest on a plate and a belt, largest error / largest velocity",
            lambda results, code: velocity_error(results, code, SLIPPING), tolerance=1e-3,
            against="closed form",
            reason="slip ends within a step, so the velocity may be off by mu g dt, 5.7e-4 of it; the"
            " dashpot acts half a step late: decay dt/2 of mu g/frequency, 1e-4",
            catches="a plate or belt without velocity, of another sign or magnitude; friction not limited",
        ),
        kit.per_code(
            "velocity of a ball that rolls on a table, largest error / largest velocity",
            lambda results, code: velocity_error(results, code, ROLLING), tolerance=4e-4,
            against="closed form",
            reason="the wall of a step drives the velocity of half a step before: w dt/2, 2.1e-4, and on the"
            " table the way turns inwards by (2/7 w)^2 dt t/2, 0.7e-4; the spring lags by 2/7 m w^2/k_t,"
            " 0.5e-4",
            catches="a velocity w x r about another center, a rotation of the wrong sense, a swing or"
            " oscillation with another phase or rate",
        ),
        kit.per_code(
            "heights below the threshold, largest smallest difference / height of a flight", once_a_period,
            tolerance=0.02, against="closed form",
            reason="where in a step an impact begins changes the rebound by up to half a step of the dashpot,"
            " c_n (v dt)^(1/4) v dt/(2 m), 1 % of the velocity and 2 % of the height. Deviations of the"
            " start are gone: 0.79^14 of them are left, by the map's eigenvalue 3 % nearer to the threshold",
            catches="a velocity of the plate that does not reach the dashpot: other restitution, so period"
            " two or none",
        ),
        kit.per_code(
            "heights above the threshold, shortfall of their difference / height of a flight", shortfall,
            tolerance=0.02, against="map of impacts",
            reason="below the map's least difference at accelerations up to 3 % off, which is what the"
            " duration of a contact, 1.3 % of the period, changes; 2 % as below the threshold",
            catches="a plate with a smaller amplitude or acceleration; a ball that does not feel it",
        ),
    ),
    figures=(
        kit.Figure(
            "Balls carried by walls, and balls that bounce",
            "Velocities of the balls: the codes coincide with the closed form. Bottom right: heights of the"
            " last flights at four accelerations, over those of the map of instantaneous impacts; the line"
            " is the threshold of period doubling.",
            draw,
        ),
    ),
    features=("wall mesh", "moving wall", "damping", "tangential history", "rotation"),
    order=36,
)  # fmt: skip
