"""One impact under any law of the emulator, integrated to rounding: the motion as the time step goes to zero.

Two spheres, or a sphere and a plane, fly freely, touch, and part again; everything stays in one plane:

    m dv/dt = F,  I dw/dt = -lever (n x F_t),  F_n = k_n d - c_n v_n   (with `limit_force`: not below 0)
    stick: F_t = -k_t s - c_t v_t,  s' = v_t,  while k_t |s| <= mu |F_n|;   slip: F_t = -sign(s) mu |F_n|

The coefficients come from the emulator, so from its own formulas, and are functions of the overlap d. The
surfaces stick at the first touch and slip at most once: a law that sticks again, or whose normal force goes
through zero while it has friction, raises ValueError instead of a doubtful answer. Hertz with all changes
of stick and slip is solved in `comparisons.oracles.contact_ode`; the two agree (see the test of this file).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

from gpudem.scene import Scene
from tests.reference import emulator

RTOL = 1e-12


@dataclasses.dataclass(frozen=True)
class Exact:
    """The solved impact of particle rows; times count from the first touch [s]."""

    touch: float
    """Time of the first touch [s] in the scene."""
    duration: float
    """From the first touch until the force ends for good [s]."""
    peak_overlap: float
    slips: bool
    """Whether the surfaces slipped in the contact."""
    motion: Callable[[np.ndarray], np.ndarray]
    """Times since the touch (t,) -> relative position of the first sphere (t, 3) [m]."""
    spins: tuple[np.ndarray, np.ndarray]
    """Angular velocity of the first and the second body after the contact [rad/s], (3,) each."""


def exact_impact(scene: Scene, i: int, other: int | str) -> Exact:
    """Solve the impact of particle row `i` with row `other`, or with the plane of that name.

    Without gravity and rolling friction; initial spins are taken as zero. Raises ValueError where the law
    sticks again after it slipped.
    """
    plane = next((p for p in emulator.flats(scene) if p.name == other), None)
    rows = np.array([i])
    contact = emulator._contacts(scene, rows, None if plane else np.array([other]), plane)
    mass = emulator._mass(scene)
    state = scene.state
    if plane is None:
        assert isinstance(other, int)
        apart, velocity = (q[i] - q[other] for q in (state.position, state.velocity))
        reach, masses = float(state.radius[i] + state.radius[other]), (mass[i], mass[other])
        radii = (state.radius[i], state.radius[other])
        along, rest = float(apart @ velocity), float(apart @ apart) - reach**2
        touch = rest / (-along + math.sqrt(along**2 - float(velocity @ velocity) * rest))
    else:
        normal = plane.normal
        apart, velocity = state.position[i] - plane.point, state.velocity[i]
        reach, masses, radii = float(state.radius[i]), (mass[i], math.inf), (state.radius[i], math.inf)
        touch = (float(apart @ normal) - reach) / -float(velocity @ normal)
    start = apart + touch * velocity
    e1 = plane.normal if plane else start / np.linalg.norm(start)
    e2 = _across(e1, velocity)
    planar = _Planar(scene, contact, reach, masses, radii, plane is not None)
    return planar.solve(
        touch, float(velocity @ e1), float(velocity @ e2), start, velocity, np.array([e1, e2])
    )


def _across(n: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Unit vector of the velocity's part across n; any across n for a head-on impact, but for rounding."""
    across = velocity - (velocity @ n) * n
    if np.linalg.norm(across) < 1e-9 * np.linalg.norm(velocity):
        across = np.cross(n, np.eye(3)[int(np.argmin(np.abs(n)))])
    return across / np.linalg.norm(across)


@dataclasses.dataclass
class _Event:
    """A function of the state whose crossing of zero in one direction solve_ivp looks for."""

    function: Callable[[np.ndarray], float]
    direction: int
    terminal: bool = True

    def __call__(self, _t: float, y: np.ndarray) -> float:
        return self.function(y)


@dataclasses.dataclass(frozen=True)
class _Planar:
    """State (a, b, a', b', w_i, w_j, s): displacement of i against j along e1, e2 since the touch, spins."""

    scene: Scene
    contact: emulator.Contacts
    reach: float
    masses: tuple[float, float]
    radii: tuple[float, float]
    wall: bool

    def forces(self, y: np.ndarray) -> tuple[float, float, float, float, tuple[float, float], float, float]:
        """(overlap, raw F_n, k_t, c_t, n, v_t, lever arms' common part d/2) of a state."""
        a, b, va, vb, wi, wj, _ = y
        if self.wall:
            overlap, n = -a, (1.0, 0.0)
        else:
            r = math.hypot(self.reach + a, b)
            overlap = -(2 * self.reach * a + a * a + b * b) / (self.reach + r)  # without cancellation
            n = ((self.reach + a) / r, b / r)
        d = max(overlap, 0.0)
        kn, kt, cn, ct = (
            float(q[0]) for q in emulator._coefficients(self.scene, self.contact, np.array([d]))
        )
        vn = va * n[0] + vb * n[1]
        arms = (self.radii[0] - d / 2) * wi + (0.0 if self.wall else (self.radii[1] - d / 2) * wj)
        vt = vb * n[0] - va * n[1] - arms
        return overlap, kn * d - cn * vn, kt, ct, n, vt, d

    def rate(self, mode: str, sign: float) -> Callable[[float, np.ndarray], list[float]]:
        """Time derivative of the state in one mode."""
        mu = float(self.contact.of("friction")[0])
        inverse = [1 / m for m in self.masses]
        spin = [
            0.0 if math.isinf(m) else 1 / (0.4 * m * r * r)
            for m, r in zip(self.masses, self.radii, strict=True)
        ]

        def derivative(_t: float, y: np.ndarray) -> list[float]:
            _, raw, kt, ct, n, vt, d = self.forces(y)
            fn = max(raw, 0.0) if self.scene.contact.limit_force else raw
            ft, stretch = 0.0, 0.0
            if mode == "stick":
                ft, stretch = -kt * y[6] - ct * vt, vt
            elif mode == "slip":
                ft = -sign * mu * abs(fn)
            f = (fn * n[0] - ft * n[1], fn * n[1] + ft * n[0])
            arm = (self.radii[0] - d / 2, 0.0 if self.wall else self.radii[1] - d / 2)
            total = inverse[0] + inverse[1]
            return [
                y[2],
                y[3],
                f[0] * total,
                f[1] * total,
                -arm[0] * ft * spin[0],
                -arm[1] * ft * spin[1],
                stretch,
            ]

        return derivative

    def solve(self, touch, vn, vt, start, velocity, frame) -> Exact:
        """From the first touch (normal and tangential relative velocity) to the end of the force."""
        friction = self.scene.contact.tangential == "history" and self.contact.of("friction")[0] > 0
        mode, sign, time, y = (
            ("stick" if friction else "smooth"),
            0.0,
            0.0,
            np.array([0, 0, vn, vt, 0, 0, 0.0]),
        )
        pieces, peak, slips = [], 0.0, False
        mu = float(self.contact.of("friction")[0])

        def ends(y):
            overlap, raw, *_ = self.forces(y)
            return raw if self.scene.contact.limit_force else overlap

        def slipping(y):
            _, raw, kt, *_ = self.forces(y)
            return kt * abs(y[6]) - mu * abs(raw)

        def parting(y):
            n = self.forces(y)[4]
            return n[0] * y[2] + n[1] * y[3]

        scale = self.reach / abs(vn)
        while True:
            events = [_Event(ends, -1), _Event(parting, 1, terminal=False)]
            if mode == "stick":
                events.append(_Event(slipping, 1))
            elif mode == "slip" and not self.scene.contact.limit_force:
                events.append(_Event(lambda y: self.forces(y)[1], -1))
            found = solve_ivp(
                self.rate(mode, sign), (time, time + scale), y, "DOP853", events=events, rtol=RTOL,
                atol=1e-16 * np.array([1, 1, 1e3, 1e3, 1e6, 1e6, 1]), dense_output=True,
                first_step=1e-7 * scale, max_step=1e-2 * scale,
            )  # fmt: skip
            if found.status != 1:
                raise ValueError(f"no end of the contact: {found.message}")
            peak = max([peak, *(self.forces(q)[0] for q in found.y_events[1])])
            pieces.append((time, float(found.t[-1]), found.sol))
            if mode == "slip":
                self._keeps_slipping(found, sign, mu)
            time, y = float(found.t[-1]), found.y[:, -1].copy()
            if len(found.t_events[0]):
                break
            if mode == "slip":
                raise ValueError("the normal force goes through zero while the surfaces slip")
            mode, sign, slips = "slip", math.copysign(1.0, y[6]), True

        def motion(since: np.ndarray) -> np.ndarray:
            out = start + since[:, None] * velocity
            inside = (since > 0) & (since <= time)
            for begin, stop, solution in pieces:
                rows = inside & (since > begin) & (since <= stop)
                if rows.any():
                    out[rows] = start + solution(since[rows])[:2].T @ frame
            rows = since > time
            out[rows] = start + (y[:2, None] + y[2:4, None] * (since[rows] - time)).T @ frame
            return out

        e3 = np.cross(*frame)
        return Exact(touch, time, peak, slips, motion, (y[4] * e3, y[5] * e3))

    def _keeps_slipping(self, found, sign: float, mu: float) -> None:
        """Raises ValueError where the longest spring grows faster than the surfaces slip: they stick."""
        times = np.linspace(found.t[0], found.t[-1], 400)[1:-1]
        states = np.array([found.sol(t) for t in times])
        limit = [mu * abs(f[1]) / f[2] for f in (self.forces(y) for y in states)]
        slip = np.array([sign * self.forces(y)[5] for y in states])
        if np.any(slip[1:] < np.diff(limit) / np.diff(times)):
            raise ValueError("the surfaces stick again: not solved here")
