"""One impact, integrated to rounding: the continuous law that a DEM step discretises (DOP853, rtol 1e-13).

Overlap d, k_t = 8 G* sqrt(R* d), c_n and c_t ~ d^(1/4) (see `Bodies`), v_n > 0 when parting:

    F_n = k d^1.5 - c_n v_n                              (with `limit_force`: not below zero)
    stick: F_t = -k_t s - c_t v_t,   s' = v_t            while k_t |s| <= mu |F_n|
    slip:  F_t = -sign mu |F_n|,     s = sign h,  h = mu |F_n|/k_t   while sign v_t > h'

s is the tangential spring along the turning tangent, v_t the slip velocity with lever arms R - d/2. The
dashpot acts in stick only and is not capped, and friction goes by |F_n| also under tension: this is
LIGGGHTS' law, taken to dt -> 0, not Coulomb's. The spring grips again where the limit h grows faster than
the surface slips.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from comparisons.oracles.bodies import Bodies
from comparisons.oracles.closed_forms import contact_time

RTOL = 1e-13
#: Stick and slip changes in one impact beyond which the law chatters, and no continuous limit is taken.
MAX_PHASES = 60

#: Planar state: displacement, velocity and spin of both bodies since the first touch, and the spring.
Q1, V1, W1, Q2, V2, W2, SPRING = slice(0, 2), slice(2, 4), 4, slice(5, 7), slice(7, 9), 9, 10


@dataclasses.dataclass(frozen=True)
class Law:
    """The switches of the law that this scene's contact has."""

    tangential: bool
    limit_force: bool
    tangential_damping: bool


@dataclasses.dataclass(frozen=True)
class Instant:
    """Geometry and rates of the contact at one state; n points to the first body, t = e3 x n."""

    overlap: float
    n: tuple[float, float]
    parting: float
    """v_n [m/s]."""
    slip: float
    """v_t [m/s]."""
    swing: float
    """(v_rel . t)^2/r [m/s2], what the turning of n adds to v_n'."""
    raw: float
    """F_n [N] before `limit_force`."""


@dataclasses.dataclass(frozen=True)
class Phase:
    """A stretch of one mode: "stick", "slip" or "smooth", with its dense solution."""

    mode: str
    start: float
    end: float
    solution: Callable[[Any], np.ndarray]
    """State (11,) at a time, or (11, times)."""


@dataclasses.dataclass(frozen=True)
class Contact:
    """The solved contact: phases from the first touch (t = 0) to the end, and the peak overlap [m]."""

    phases: list[Phase]
    duration: float
    final: np.ndarray
    peak_overlap: float

    def state(self, time: float) -> np.ndarray:
        """Planar state at a time [s] since the first touch, 0 <= time <= duration."""
        phase = next((p for p in self.phases if time <= p.end), self.phases[-1])
        return phase.solution(time)

    def states(self, times: np.ndarray) -> np.ndarray:
        """Planar states (times, 11) at times [s] since the first touch."""
        states = np.empty((len(times), len(self.final)))
        index = np.searchsorted([p.end for p in self.phases[:-1]], times)  # of the first that ends not before
        for k in np.unique(index):
            states[index == k] = self.phases[k].solution(times[index == k]).T
        return states


class Chatter(ValueError):
    """Stick and slip follow each other without end: the law has no continuous limit for this impact."""


def instant(c: Bodies, y: np.ndarray) -> Instant:
    """Geometry of the state; the overlap without cancellation, from the displacements since the first
    touch.
    """
    a, b = y[0] - y[5], y[1] - y[6]
    vx, vy = y[2] - y[7], y[3] - y[8]
    reach = c.radius[0] if c.is_wall else c.radius[0] + c.radius[1]
    if c.is_wall:
        overlap, nx, ny, curvature = -a, 1.0, 0.0, 0.0
    else:
        r = math.hypot(reach + a, b)
        overlap, nx, ny, curvature = (
            -(2 * reach * a + a * a + b * b) / (reach + r),
            (reach + a) / r,
            b / r,
            1 / r,
        )
    d = max(overlap, 0.0)
    parting, sweep = vx * nx + vy * ny, vy * nx - vx * ny
    arms = (c.radius[0] - d / 2) * y[W1] + (0.0 if c.is_wall else (c.radius[1] - d / 2) * y[W2])
    raw = c.normal_constant * d**1.5 - c.normal_damping * d**0.25 * parting
    return Instant(overlap, (nx, ny), parting, sweep - arms, sweep * sweep * curvature, raw)


def limit_rate(c: Bodies, now: Instant) -> float:
    """H' [m/s] of the longest spring h = mu |F_n|/k_t = mu |A d - B d^(-1/4) v_n|; with limit_force, the
    same above 0.
    """
    d = max(now.overlap, 1e-300)
    ratio = c.normal_constant / c.tangential_constant
    dash = c.normal_damping / c.tangential_constant * d**-0.25
    acceleration = now.raw / c.mass_star + now.swing
    rate = -ratio * now.parting - dash * acceleration - dash / 4 / d * now.parting**2
    return c.friction * math.copysign(rate, rate * now.raw)


def _derivative(c: Bodies, law: Law, mode: str, sign: float) -> Callable[[float, np.ndarray], list[float]]:
    inverse = [1 / m for m in c.mass]
    spin = [1 / i for i in c.inertia]

    def derivative(_t: float, y: np.ndarray) -> list[float]:
        now = instant(c, y)
        d = max(now.overlap, 0.0)
        normal = max(now.raw, 0.0) if law.limit_force else now.raw
        friction, stretch = 0.0, 0.0
        if mode == "stick":
            friction = -c.tangential_constant * math.sqrt(d) * y[SPRING]
            friction -= c.tangential_damping * d**0.25 * now.slip if law.tangential_damping else 0.0
            stretch = now.slip
        elif mode == "slip":
            friction = -sign * c.friction * abs(normal)
        nx, ny = now.n
        fx, fy = normal * nx - friction * ny, normal * ny + friction * nx
        arms = (c.radius[0] - d / 2, 0.0 if c.is_wall else c.radius[1] - d / 2)
        return [
            y[2], y[3], fx * inverse[0], fy * inverse[0], -arms[0] * friction * spin[0],
            y[7], y[8], -fx * inverse[1], -fy * inverse[1], -arms[1] * friction * spin[1],
            stretch,
        ]  # fmt: skip

    return derivative


@dataclasses.dataclass
class Event:
    """A function of the state with the attributes that solve_ivp looks for."""

    function: Callable[[np.ndarray], float]
    direction: int
    terminal: bool = True

    def __call__(self, _t: float, y: np.ndarray) -> float:
        """Value at a state."""
        return self.function(y)


def _events(c: Bodies, law: Law, mode: str, sign: float, pulls: bool) -> dict[str, Event]:
    events = {
        "apart": Event(lambda y: instant(c, y).overlap, -1),
        "peak": Event(lambda y: instant(c, y).parting, +1, terminal=False),
    }
    if law.limit_force and c.damping_ratio:
        events["apart"] = Event(lambda y: instant(c, y).raw, -1)
    elif mode == "slip" and c.damping_ratio and not pulls:
        events["tension"] = Event(lambda y: instant(c, y).raw, -1)

    def excess(y: np.ndarray) -> float:
        now = instant(c, y)
        return c.tangential_constant * math.sqrt(max(now.overlap, 0.0)) * abs(y[SPRING]) - c.friction * abs(
            now.raw
        )

    def grip(y: np.ndarray) -> float:
        now = instant(c, y)
        return (sign * now.slip - limit_rate(c, now)) * max(now.overlap, 0.0) ** 1.25

    if mode == "stick":
        events["slips"] = Event(excess, +1)
    elif mode == "slip":
        events["grips"] = Event(grip, -1)
    return events


def _mode_without_spring(c: Bodies, now: Instant) -> str:
    """Mode where the spring is at rest (first touch, zero normal force): slip if v_t outruns the growing
    limit.
    """
    first_touch = now.overlap <= 0.0
    if first_touch and c.damping_ratio:
        return "stick"  # the dashpot makes F_n/k_t infinite at the first touch
    rate = (
        c.friction * c.normal_constant / c.tangential_constant * -now.parting
        if first_touch
        else limit_rate(c, now)
    )
    return "slip" if abs(now.slip) > abs(rate) else "stick"


def solve(c: Bodies, law: Law, start: np.ndarray, rtol: float = RTOL) -> Contact:
    """Integrate one contact from the first touch (`start`: velocities and spins, all else zero) to its end.

    Raises Chatter where stick and slip alternate without end, ValueError where the bodies do not approach.
    """
    y, time, sign, pulls = np.array(start, float), 0.0, 0.0, False
    first = instant(c, y)
    if not first.parting < 0:
        raise ValueError("the bodies do not approach each other")
    natural, speed = contact_time(c, -first.parting), max(np.abs(y[V1]).max(), np.abs(y[V2]).max())
    floor = np.full(11, speed * natural)
    floor[[2, 3, 7, 8]], floor[[W1, W2]] = speed, speed / c.radius[0]
    mode, phases, peak = "smooth", [], 0.0
    if law.tangential and c.friction:
        mode, sign = _mode_without_spring(c, first), math.copysign(1.0, first.slip)
    while True:
        events = _events(c, law, mode, sign, pulls)
        found = solve_ivp(
            _derivative(c, law, mode, sign), (time, time + 4 * natural), y, "DOP853",
            events=list(events.values()), rtol=rtol, atol=rtol * 1e-2 * floor, dense_output=True,
            max_step=natural / 60, first_step=1e-7 * natural,
        )  # fmt: skip
        if found.status != 1 or len(phases) >= MAX_PHASES:
            raise Chatter(f"no end of the contact: {len(phases)} phases, last {mode}, {found.message}")
        hit = {name: ys for name, ys in zip(events, found.y_events, strict=True) if len(ys)}
        peak = max([peak, *(instant(c, p).overlap for p in hit.pop("peak", ()))])
        phases.append(Phase(mode, time, float(found.t[-1]), found.sol))
        time, y = float(found.t[-1]), found.y[:, -1].copy()
        reason = next(iter(hit))
        now = instant(c, y)
        if reason == "apart":
            return Contact(phases, time, y, peak)
        if reason == "slips":
            mode, sign = "slip", math.copysign(1.0, y[SPRING])
        elif reason == "grips":  # a hair inside the limit, so that rounding does not fire the next event
            longest = c.friction * abs(now.raw) / (c.tangential_constant * math.sqrt(now.overlap))
            mode, y[SPRING] = "stick", sign * longest * (1 - 1e-12)
        else:  # normal force through zero: the limit, and with it the spring, vanishes and grows again
            y[SPRING], sign, pulls = 0.0, math.copysign(1.0, now.slip), True
            mode = _mode_without_spring(c, now)
