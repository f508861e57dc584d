"""Walls that move under a ball, and a belt: closed forms, thresholds of the bouncing ball, step by step."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from comparisons import kit
from comparisons.cases.walls.scenes import (
    FRICTION,
    GRAVITY,
    HALF,
    RADIUS,
    RESTITUTION,
    STEP,
    mesh,
    on_floor,
    scene,
)
from comparisons.oracles.mesh_shapes import rectangle
from comparisons.report import plots
from gpudem.output.run import Run
from gpudem.scene import Scene
from gpudem.walls.motion import rotations

#: Speed of the plate and of the belt [m/s]; period of table, swing and shaken plate [s].
SPEED, PERIOD = 0.3, 0.1
#: Amplitudes of the swing [rad] and of the shaken plate [m].
SWING, SHAKEN = 0.2, 0.003
#: Place of a ball on a table from its axis [m]. No round numbers: a ball that comes to lie exactly over an edge
#: or a node has one contact more in LIGGGHTS for a step, decided by the last bit.
PLACE = np.array([0.0121, 0.00537])
#: Share of the velocity of the surface that a solid sphere takes over while it rolls: I/(I + m R^2).
SHARE = 2 / 7
FLAT = rectangle((-HALF, -HALF, 0), (2 * HALF, 0, 0), (0, 2 * HALF, 0), (8, 8))
#: A ball that bounces on a plate: period of the plate [s], its largest acceleration by g, periods in all and
#: those at the end that count.
BEAT, PERIODS, COUNTED = 0.04, 20, 6


def thresholds(e: float) -> tuple[float, float]:
    """Largest acceleration of the plate by g from which a ball bounces once a period, and up to which it is
    stable: pi (1 - e)/(1 + e) and sqrt((pi (1 - e)/(1 + e))^2 + (2 (1 + e^2)/(1 + e)^2)^2).

    Flights of one period T: v = g T/2 = (1 + e) u + e v, u the velocity of the plate, so u = (1 - e)/(1 + e)
    g T/2, at most its largest. The map of small deviations of time and speed has the determinant e^2 over a
    flight, and an eigenvalue of -1 where -y''(1 + e)^2/g = 2 (1 + e^2), y'' the acceleration of the plate.
    Source: Luck and Mehta 1993, Phys. Rev. E 48, 3988; Guckenheimer and Holmes 1983.
    """
    begin = math.pi * (1 - e) / (1 + e)
    return begin, math.hypot(begin, 2 * (1 + e * e) / (1 + e) ** 2)


#: Accelerations of the plates by g, two below the threshold of period doubling and two above.
BOUNCING = tuple(share * thresholds(RESTITUTION)[1] for share in (0.9, 0.97, 1.04, 1.1))


def carried(what: str, motion: dict | None, velocity: tuple[float, float], spin: np.ndarray | float,
            duration: float = 0.1, **wall: object) -> Scene:  # fmt: skip
    """A ball at rest on a plate of 128 triangles but for the velocity and spin that it starts with."""
    deep = on_floor()[0]
    motions = [] if motion is None else [motion]
    place = [[*PLACE, RADIUS - deep]]
    return scene(f"carried_{what}", [mesh("plate", FLAT, motion=motions, **wall)], place, [*velocity, 0.0], spin,
                 duration=duration, half=2 * HALF)  # fmt: skip


def on_table(what: str, motion: dict, rate: float) -> Scene:
    """A ball that rolls on a table, of the angular velocity `rate` [rad/s] at the start."""
    arm = RADIUS - on_floor()[0] / 2
    velocity = SHARE * rate * np.array([-PLACE[1], PLACE[0]])
    spin = (1 - SHARE) * rate / arm * np.array([*PLACE, 0.0])
    return carried(what, motion, (float(velocity[0]), float(velocity[1])), spin)


def shaken() -> Scene:
    """A ball that rolls on a plate shaken sideways."""
    arm = RADIUS - on_floor()[0] / 2
    most = SHAKEN * 2 * math.pi / PERIOD
    motion = {"type": "oscillate", "amplitude": (SHAKEN, 0.0, 0.0), "period": PERIOD}
    return carried("shaken", motion, (SHARE * most, 0.0), [0.0, -(1 - SHARE) * most / arm, 0.0])


def bouncing(name: str, periods: float, every: float) -> Scene:
    """Four balls, each on a plate that moves up and down at another acceleration."""
    begin = thresholds(RESTITUTION)[0]
    walls, position, velocity = [], [], []
    omega = 2 * math.pi / BEAT
    for k, strength in enumerate(BOUNCING):
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
    return scene(name, walls, position, velocity, duration=periods * BEAT, every=every)  # fmt: skip


def variants(tier: kit.Tier) -> list[kit.Variant]:
    """One scene each."""
    rate = 2 * math.pi / PERIOD
    turn = {"axis": (0, 0, 1), "period": PERIOD}
    made = [
        carried("linear", {"type": "linear", "velocity": (SPEED, 0.0, 0.0)}, (0.0, 0.0), 0.0),
        carried("belt", None, (0.0, 0.0), 0.0, surface_velocity=(SPEED, 0.0, 0.0)),
        on_table("rotate", {"type": "rotate", **turn}, rate),
        on_table("swing", {"type": "swing", "amplitude": SWING, **turn}, SWING * rate),
        shaken(),
        bouncing("bounces", 1.25, STEP),
        bouncing("doubling", PERIODS, 2e-4),
    ]
    return [kit.Variant(one.name, one) for one in made]


# -- closed forms --------------------------------------------------------------------------------------------


def set_up_kick() -> float:
    """Velocity [m/s] that a ball at rest gets from the belt in the set-up of a run, c_t V dt/(2 m).

    There the tangential dashpot acts without Coulomb's limit, in LIGGGHTS and so in gpudem.
    """
    deep, c = on_floor()
    return c.damping(c.tangential_constant) * deep**0.25 * SPEED * STEP / 2 / c.mass[0]


def started(time: np.ndarray, begin: float = 0.0) -> np.ndarray:
    """Velocity [m/s] on a surface that moves: mu g t while the ball slips, then 2/7 of its, shape (t, 2)."""
    x = np.minimum(begin + FRICTION * GRAVITY * time, SHARE * SPEED)
    return np.stack([x, np.zeros_like(x)], axis=1)


def turned(angle: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Velocity [m/s] on a table: the place turns by 2/7 of the angle of the table, (t, 2).

    m v' = F, I w' = -R z x F and the velocity of the point of contact give v' = 2/7 d(rate z x r)/dt.
    """
    place = rotations(np.array([0.0, 0.0, 1.0]), SHARE * angle)[:, :2, :2] @ PLACE
    return SHARE * rate[:, None] * np.stack([-place[:, 1], place[:, 0]], axis=1)


def exact(label: str, time: np.ndarray) -> np.ndarray:
    """Velocity [m/s] in the plane of the plate by closed form, shape (t, 2)."""
    rate = 2 * math.pi / PERIOD
    wave = rate * time
    forms: dict[str, Callable[[], np.ndarray]] = {
        "linear": lambda: started(time),
        "belt": lambda: started(time, set_up_kick()),
        "rotate": lambda: turned(wave, np.full_like(time, rate)),
        "swing": lambda: turned(SWING * np.sin(wave), SWING * rate * np.cos(wave)),
        "shaken": lambda: SHARE * SHAKEN * rate * np.stack([np.cos(wave), np.zeros_like(wave)], axis=1),
    }
    return forms[label]()


#: Balls that slip at first, and balls that roll from the start.
SLIPPING, ROLLING = ("linear", "belt"), ("rotate", "swing", "shaken")
#: Time after which a ball rolls that the dashpot of the set-up, where the wall still has no velocity, made slip
#: [s].
SETTLED = 5e-3


def velocity_error(results: kit.Results, code: str, labels: tuple[str, ...]) -> dict[str, float]:
    """Largest error of the velocity of each ball that is carried, by its largest velocity."""
    found = {}
    for label in labels:
        trace = results[f"carried_{label}", code].trace
        late = trace["time"] >= SETTLED
        want = exact(label, trace["time"])
        gap = np.linalg.norm(trace["velocity"][:, 0, :2] - want, axis=1)[late].max()
        found[label] = float(gap / np.linalg.norm(want, axis=1).max())
    return found


def tops(run: Run) -> list[np.ndarray]:
    """Heights of the flights of each ball over the last periods [m]: vertices of parabolas through samples."""
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


def scale(run: Run, column: str) -> float:
    """Diameter; speed of the plate, at most that of the ball; that over the radius; largest force."""
    largest = float(np.linalg.norm(run.trace[column], axis=-1).max())
    if column == "angular_velocity":
        return max(largest, float(np.linalg.norm(run.trace["velocity"], axis=-1).max()) / RADIUS)
    return 2 * RADIUS if column == "position" else largest


def no_contact(run: Run) -> str:
    """Why a run shows nothing: a ball that no plate ever pushed, or one that did not change its velocity."""
    pushed = np.abs(run.trace["force"][..., 2] + GRAVITY * run.scene.masses).max(axis=0) > 0
    moved = np.ptp(run.trace["velocity"], axis=0).max(axis=-1) > 1e-2
    return "" if pushed.all() and moved.all() else "a ball that nothing moved"


def step_by_step(prefix: str, tolerance: float, reason: str) -> tuple[kit.PerPair, ...]:
    """Both codes at every step of the variants of a prefix."""
    columns = {
        "position": ("diameter", "a wall that is a step ahead or behind, another order of its motions"),
        "velocity": ("largest speed", "the velocity of the wall at its center in place of its point"),
        "angular_velocity": ("largest speed / radius", "a lever arm of another length"),
        "force": ("largest force", "a spring that does not turn with its wall; a spring lost at an edge"),
    }
    return tuple(
        kit.step_by_step(
            f"{prefix.rstrip('_')}: {column.replace('_', ' ')}, largest difference over all steps / {unit}",
            column, lambda run, column=column: scale(run, column), prefix=prefix, defect=no_contact,
            unit="1", tolerance=tolerance, reason=reason, catches=catches,
        )
        for column, (unit, catches) in columns.items()
    )  # fmt: skip


def once_a_period(results: kit.Results, code: str) -> dict[str, float]:
    """Differences of successive heights below the threshold."""
    found = doubling(results["doubling", code])
    return {f"{BOUNCING[k]:.3g} g": found[k] for k in (0, 1)}


def shortfall(results: kit.Results, code: str) -> dict[str, kit.Measured]:
    """How much the differences of successive heights above the threshold fall below a tenth."""
    found = doubling(results["doubling", code])
    return {f"{BOUNCING[k]:.3g} g": kit.Measured(max(0.1 - found[k], 0.0), found[k]) for k in (2, 3)}


def draw(results: kit.Results) -> plots.Figure:
    """Velocities of the balls that are carried, and heights of those that bounce."""
    figure, axes = plots.figure(2, 3, width=plots.WHOLE, height=5.6)
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
            axes[1, 2].plot(np.full(len(above), strength), above, **plots.marks(code))
    axes[1, 2].axvline(thresholds(RESTITUTION)[1], color=plots.color("oracle"), linewidth=1)
    axes[1, 2].set(title="bouncing", xlabel="acceleration of the plate / g", ylabel="heights [mm]")
    plots.legend(axes[0, 0])
    return figure


CASE = kit.Case(
    name="moving_walls",
    title="Walls that move",
    purpose=(
        "A ball lies on a plate of triangles that moves straight on, turns, swings or is shaken, or on a belt."
        " It slips until it rolls, and then follows with two sevenths of the velocity of the surface, so on a"
        " turntable it turns by two sevenths of the angle. A ball that bounces on a plate that moves up and"
        " down does so once a period, up to a known acceleration, above which heights alternate. LIGGGHTS"
        " moves a mesh by sums over steps in some motions; rule 'liggghts' follows it to rounding."
    ),
    source=(
        "Coulomb friction and rolling of a solid sphere, derived in comparisons/cases/walls/moving_walls.py;"
        " turntable: Weckesser 1997, Am. J. Phys. 65, 736. Bouncing ball: Luck and Mehta 1993, Phys. Rev. E"
        " 48, 3988."
    ),
    variants=variants,
    checks=(
        *step_by_step("carried_", 1e-9, "same law, scheme and sums of motions: rounding, some 1e-13"),
        *step_by_step(
            "bounces", 1e-8, "rounding; the place of an oscillating plate is a sum, which LIGGGHTS adds up in"
            " another order: 5e-10 of the force",
        ),
        kit.per_code(
            "velocity from rest on a plate and a belt, largest error / largest velocity",
            lambda results, code: velocity_error(results, code, SLIPPING), tolerance=0.013,
            against="closed form",
            reason="the spring gives back mu m g where slip ends: 0.0064; times two",
            catches="a plate or belt without velocity, of another sign or magnitude; friction not limited",
        ),
        kit.per_code(
            "velocity of a ball that rolls on a table, largest error / largest velocity",
            lambda results, code: velocity_error(results, code, ROLLING), tolerance=2e-3,
            against="closed form",
            reason="the contact has a spring and is carried with it, of first order in frequency of the table"
            " over that of the spring: 8e-4; times two",
            catches="a velocity w x r about another center, a rotation of the wrong sense, a swing or"
            " oscillation with another phase or rate",
        ),
        kit.per_code(
            "heights below the threshold, largest smallest difference / height of a flight", once_a_period,
            tolerance=0.03, against="closed form",
            reason="one height a period; a contact of 30 steps changes the speed by up to 1 % from one impact"
            " to the next",
            catches="a velocity of the plate that does not reach the dashpot: other restitution, so period"
            " two or none",
        ),
        kit.per_code(
            "heights above the threshold, shortfall of their difference below 0.1", shortfall, tolerance=0.0,
            against="closed form", reason="by the map of the impacts they differ by 0.4 and more",
            catches="a plate with a smaller amplitude or acceleration; a ball that does not feel it",
        ),
    ),
    figures=(
        kit.Figure(
            "Balls carried by walls, and balls that bounce",
            "Velocities of the balls: the codes coincide with the closed form. Bottom right: heights of the"
            " last flights at four accelerations; the line is the threshold of period doubling.",
            draw,
        ),
    ),
    features=("wall mesh", "moving wall", "damping", "tangential history", "rotation"),
    order=36,
)  # fmt: skip
