"""The contact law evaluated on the states that a code has written, and the forces that its motion shows.

Positions and velocities at every step determine the mean force of each step. Where each particle has one
contact at a time, this is the force of that contact. It is compared with the law at the same states, whatever
led there. Hertz with tangential history, from primary inputs by `comparisons.oracles.bodies`.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from comparisons.oracles.bodies import Bodies, bodies
from gpudem.scene import Scene

Trace = dict[str, np.ndarray]

#: Steps between two searches for pairs.
SEARCHED = 64
#: Share of the normal impulse below which a tangential impulse is measured by it instead of by itself.
SMALL = 0.01


@dataclasses.dataclass(frozen=True)
class Touch:
    """A contact of particle row `i` with row `other`, or with the plane of that name."""

    i: int
    other: int | str
    alone: bool = True
    """Its particles have no other contact meanwhile."""

    def __str__(self) -> str:
        partner = self.other if isinstance(self.other, str) else self.other + 1
        return f"{self.i + 1} / {partner}"


@dataclasses.dataclass(frozen=True)
class Law:
    """The law, or the law with a classical mistake."""

    lever: bool = True
    """Lever R - overlap/2; False: R."""
    relative: bool = True
    """Friction from the velocity relative to the partner; False: from the velocity of the particle."""
    projected: bool = True
    """The spring is projected onto the tangent plane."""
    mass: str = "reduced"
    """Mass in the dashpots: reduced; first or second: that of one of the two."""
    wall: str = "plane"
    """plane: R* = R, m* = m at a wall; sphere: those of two equal spheres."""


#: Classical mistakes, in words.
MISTAKES = {
    "lever R instead of R - overlap/2": Law(lever=False),
    "friction from the absolute velocity": Law(relative=False),
    "spring not projected onto the tangent plane": Law(projected=False),
    "mass of the first particle in the damping instead of the reduced mass": Law(mass="first"),
    "mass of the second particle in the damping instead of the reduced mass": Law(mass="second"),
    "wall taken as a sphere of equal radius and mass": Law(wall="sphere"),
}


def judged(scene: Scene, trace: Trace) -> str:
    """Why the law cannot be evaluated on a trace; empty if it can."""
    law = scene.contact
    other = law.normal != "hertz" or law.tangential not in ("history", "off")
    if other or scene.needs.rolling or scene.needs.cohesion or law.frictionless_dashpot:
        return "the law is evaluated only for hertz with history, without rolling friction and cohesion"
    if scene.needs.vibration or scene.needs.periodic or scene.changes or scene.groups:
        return "the law is evaluated only with walls at rest, without periodic sides, groups and phases"
    return "" if every_step(scene, trace) else "states are not written at every step"


def every_step(scene: Scene, trace: Trace) -> bool:
    """Whether a trace has the states of all steps."""
    return len(trace["step"]) == scene.n_steps + 1


def overlap(scene: Scene, position: np.ndarray, touch: Touch) -> tuple[np.ndarray, np.ndarray]:
    """(normal towards particle i (t, 3), overlap [m] (t,)) of a contact along a trace."""
    radius = scene.state.radius
    if isinstance(touch.other, str):
        plane = next(p for p in scene.planes if p.name == touch.other)
        normal = np.broadcast_to(np.array(plane.normal), position[:, touch.i].shape)
        return normal, radius[touch.i] - plane.gap(position[:, touch.i])
    d = position[:, touch.i] - position[:, touch.other]
    distance = np.linalg.norm(d, axis=1)
    return d / distance[:, None], radius[touch.i] + radius[touch.other] - distance


def contacts(scene: Scene, position: np.ndarray) -> list[Touch]:
    """All contacts along a trace."""
    found = {}
    others = [Touch(i, plane.name) for plane in scene.planes for i in range(len(scene.state))]
    for touch in [*others, *(Touch(i, j) for i, j in _near(position, 2 * float(scene.state.radius.max())))]:
        on = overlap(scene, position, touch)[1] > 0
        if on.any():
            found[touch] = on
    count = np.zeros(position.shape[:2], int)
    for touch, on in found.items():
        for row in _rows(touch):
            count[on, row] += 1
    return [
        dataclasses.replace(touch, alone=bool((count[on][:, _rows(touch)] == 1).all()))
        for touch, on in found.items()
    ]


def _near(position: np.ndarray, reach: float) -> list[tuple[int, int]]:
    """Pairs i < j whose centers come within a reach [m] of one another anywhere in a trace, and some more."""
    from scipy.spatial import KDTree

    pairs: set[tuple[int, int]] = set()
    for first in range(0, len(position), SEARCHED):
        window = position[first : first + SEARCHED]
        moved = float(np.linalg.norm(window - window[0], axis=-1).max())
        pairs |= KDTree(window[0]).query_pairs(reach + 2 * moved)
    return sorted(pairs)


def _rows(touch: Touch) -> list[int]:
    return [touch.i] if isinstance(touch.other, str) else [touch.i, touch.other]


def verlet_error(trace: Trace) -> float:
    """Largest difference of a velocity from the central difference of positions, by the largest speed.

    Rounding for velocity Verlet, whatever the forces; of first order in the step for other schemes.
    """
    dt = trace["time"][1] - trace["time"][0]
    central = (trace["position"][2:] - trace["position"][:-2]) / (2 * dt)
    scale = np.linalg.norm(trace["velocity"], axis=-1).max()
    return float(np.linalg.norm(trace["velocity"][1:-1] - central, axis=-1).max() / scale)


def _half_step(scene: Scene, trace: Trace, rows: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """Velocities and spins of some particles half a step before each state of a velocity Verlet run."""
    dt, spin = scene.time.step, trace["angular_velocity"][:, rows]
    v, w = trace["velocity"][:, rows].copy(), spin.copy()
    v[1:] = np.diff(trace["position"][:, rows], axis=0) / dt
    if "torque" in trace:
        inertia = 0.4 * scene.masses[rows] * scene.state.radius[rows] ** 2
        w[1:] = spin[:-1] + dt / 2 * trace["torque"][:-1, rows] / inertia[:, None]
        return v, w
    # a state is the mean of its two half steps: w[k] = 2 spin[k - 1] - w[k - 1], from w[1] = spin[1]
    sign = np.where(np.arange(2, len(w)) % 2, -1.0, 1.0)[:, None, None]
    w[2:] = sign * (np.cumsum(2 * sign * spin[1:-1], axis=0) - spin[1])
    return v, w


@dataclasses.dataclass(frozen=True)
class Compared:
    """Forces of one contact on particle i, of a code and of the law at its states, and the code's torque."""

    touch: Touch
    normal: tuple[np.ndarray, np.ndarray]
    """(of the code, of the law) [N], each (steps,)."""
    tangential: tuple[np.ndarray, np.ndarray]
    """[N], each (steps, 3)."""
    torque: tuple[np.ndarray, np.ndarray]
    """(of the code, lever x its tangential force) [N m], each (steps, 3)."""

    def differences(self) -> dict[str, float]:
        """Impulse of the difference, as a share of that of the law: normal, tangential, torque [1]."""
        pushed = np.abs(self.normal[1]).sum()
        slid = max(np.linalg.norm(self.tangential[1], axis=1).sum(), SMALL * pushed)
        arm = np.linalg.norm(self.torque[1], axis=1).sum()
        arm = max(arm, SMALL * pushed * arm / max(np.linalg.norm(self.tangential[0], axis=1).sum(), 1e-300))
        found = {"normal force": np.abs(self.normal[0] - self.normal[1]).sum() / pushed}
        found["tangential force"] = (
            np.linalg.norm(self.tangential[0] - self.tangential[1], axis=1).sum() / slid
        )
        if arm > 0:
            found["torque"] = np.linalg.norm(self.torque[0] - self.torque[1], axis=1).sum() / arm
        return {name: float(value) for name, value in found.items()}

    def absent(self) -> int:
        """Steps in which the law has a force and the code has none."""
        law = np.hypot(self.normal[1], np.linalg.norm(self.tangential[1], axis=1))
        code = np.hypot(self.normal[0], np.linalg.norm(self.tangential[0], axis=1))
        return int(np.count_nonzero((law > 1e-3 * law.max()) & (code < 1e-6 * law.max())))


def compare(
    scene: Scene,
    trace: Trace,
    touch: Touch,
    verlet: bool,
    law: Law | None = None,
    given: np.ndarray | None = None,
) -> Compared:
    """The forces of one contact.

    Args:
        scene: What was run.
        trace: The states at every step.
        touch: The contact; without `given`, its particles must have no other one meanwhile.
        verlet: Of a velocity Verlet run, whose forces at the states follow from these, and the law with
            half-step velocities; else mean forces over each step, and the law as the mean of both ends.
        law: The law, or one with a mistake.
        given: Forces of this contact as the code states them [N], (steps, 3); None: from its motion.
    """
    law, dt, i = law or Law(), scene.time.step, touch.i
    n, depth = overlap(scene, trace["position"], touch)
    rows = _rows(touch)
    if verlet:
        v, w = _half_step(scene, trace, rows)
    else:
        v, w = trace["velocity"][:, rows], trace["angular_velocity"][:, rows]
    mass, gravity = scene.masses[i], np.array(scene.gravity)
    inertia = 0.4 * mass * scene.state.radius[i] ** 2
    fn, ft, lever = _forces(scene, bodies(scene, i, touch.other), touch, law, n, depth, v, w)
    spinning = inertia * np.diff(trace["angular_velocity"][:, i], axis=0) / dt
    on = depth > 0
    used = on[1:] if verlet else on[1:] | on[:-1]
    if verlet:
        got = 2 * mass * (trace["velocity"][:, i] - v[:, 0]) / dt - mass * gravity
        got[0] = 0.0
        got = got if given is None else given.copy()
        got[~on] = 0.0
        along = (got * n).sum(axis=1)
        across = got - along[:, None] * n
        turning = -lever[:, None] * np.cross(n, across)
        turning = (turning[1:] + turning[:-1]) / 2
        normal, tangential = (along[1:], fn[1:]), (across[1:], ft[1:])
    else:
        got = mass * np.diff(trace["velocity"][:, i], axis=0) / dt - mass * gravity
        got = got if given is None else (given[1:] + given[:-1]) / 2
        middle = n[1:] + n[:-1]
        middle = middle / np.linalg.norm(middle, axis=1)[:, None]
        along = (got * middle).sum(axis=1)
        across = got - along[:, None] * middle
        turning = -((lever[1:] + lever[:-1]) / 2)[:, None] * np.cross(middle, across)
        normal, tangential = (along, (fn[1:] + fn[:-1]) / 2), (across, (ft[1:] + ft[:-1]) / 2)
    return Compared(
        touch,
        (normal[0][used], normal[1][used]),
        (tangential[0][used], tangential[1][used]),
        (spinning[used & touch.alone], turning[used & touch.alone]),
    )


def _forces(
    scene: Scene,
    b: Bodies,
    touch: Touch,
    law: Law,
    n: np.ndarray,
    depth: np.ndarray,
    v: np.ndarray,
    w: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(normal force (t,), tangential force (t, 3) on i, lever (t,)) by the law at the states.

    `v` and `w` are those of the contact's particles, (t, 1 or 2, 3).
    """
    i, radius, delta = touch.i, scene.state.radius, np.maximum(depth, 0.0)
    b = _mistaken(b, law)
    cut = delta / 2 if law.lever else 0.0 * delta
    relative, turning = v[:, 0], (radius[i] - cut)[:, None] * w[:, 0]
    if not isinstance(touch.other, str):
        relative = relative - v[:, 1]
        turning = turning + (radius[touch.other] - cut)[:, None] * w[:, 1]
    along = (relative * n).sum(axis=1)
    kn, kt = b.normal_constant * np.sqrt(delta), b.tangential_constant * np.sqrt(delta)
    mass = {"reduced": b.mass_star, "first": b.mass[0], "second": b.mass[1]}[law.mass]
    scale = delta**0.25 * math.sqrt(mass / b.mass_star if math.isfinite(mass) else 1.0)
    fn = kn * delta - b.normal_damping * scale * along
    if scene.contact.limit_force:
        fn = np.maximum(fn, 0.0)
    fn = np.where(depth > 0, fn, 0.0)
    slip = (relative if law.relative else v[:, 0]) - np.cross(turning, n)
    slip = slip - (slip * n).sum(axis=1)[:, None] * n
    ct = b.tangential_damping * scale * scene.contact.tangential_damping
    ft = np.zeros_like(slip)
    if scene.contact.tangential == "history" and b.friction > 0:
        _springs(scene.time.step, b.friction, law.projected, n, depth, slip, fn, kt, ct, ft)
    along = (ft * n).sum(axis=1)  # of a spring that is not projected
    return fn + along, ft - along[:, None] * n, radius[i] - cut


def _springs(dt, friction, projected, n, depth, slip, fn, kt, ct, ft) -> None:
    """Tangential forces [N] of one contact, written into `ft`; the spring is that of the states."""
    spring = np.zeros(3)
    for k in range(len(depth)):
        if depth[k] <= 0:
            spring = np.zeros(3)
            continue
        spring = spring + (dt if k else 0.0) * slip[k]
        if projected:
            spring = spring - (spring @ n[k]) * n[k]
        elastic, limit = kt[k] * math.sqrt(spring @ spring), friction * abs(fn[k])
        if elastic > limit:
            spring = spring * (limit / elastic)
            ft[k] = -kt[k] * spring
        else:
            ft[k] = -kt[k] * spring - ct[k] * slip[k]


def _mistaken(b: Bodies, law: Law) -> Bodies:
    """The bodies, or a wall as a sphere like the particle."""
    if law.wall == "sphere" and b.is_wall:
        return dataclasses.replace(b, mass=(b.mass[0],) * 2, radius=(b.radius[0],) * 2)
    return b
