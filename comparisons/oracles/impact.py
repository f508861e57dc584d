"""One impact of a scene as an exact trajectory in space: flight, the contact solved to rounding, flight."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from comparisons.oracles import contact_ode
from comparisons.oracles.bodies import Bodies, bodies
from comparisons.oracles.contact_ode import Q1, Q2, V1, V2, W1, W2
from gpudem.scene import Scene

#: What is known of a body at a time.
COLUMNS = ("position", "velocity", "angular_velocity")


@dataclasses.dataclass(frozen=True)
class Impact:
    """The exact motion of particle row `first` and of row `second` (None: it met a plane)."""

    rows: tuple[int, ...]
    bodies: Bodies
    frame: np.ndarray
    """Unit vectors e1 (the normal at the first touch), e2 (along the slip), e3 = e1 x e2, by rows."""
    touch: float
    """Time [s] of the first touch."""
    start: dict[str, np.ndarray]
    """Position, velocity, angular velocity of the rows at t = 0."""
    contact: contact_ode.Contact

    @property
    def end(self) -> float:
        """Time [s] at which the contact ends."""
        return self.touch + self.contact.duration

    def at(self, times: np.ndarray) -> dict[str, np.ndarray]:
        """Position [m], velocity [m/s], angular_velocity [rad/s], each (times, rows, 3)."""
        moved = self._planar(times)
        n = len(self.rows)
        parts = [(Q1, V1, W1), (Q2, V2, W2)][:n]
        e1, e2, e3 = self.frame
        out = {}
        flat = np.stack([moved[:, q] for q, _, _ in parts], axis=1)
        speed = np.stack([moved[:, v] for _, v, _ in parts], axis=1)
        touch = self.start["position"] + self.touch * self.start["velocity"]
        drift = (self.start["velocity"] @ e3)[:, None] * e3
        out["position"] = touch + flat[..., :1] * e1 + flat[..., 1:] * e2
        out["position"] = out["position"] + (np.asarray(times) - self.touch)[:, None, None] * drift
        out["velocity"] = speed[..., :1] * e1 + speed[..., 1:] * e2 + drift
        out["angular_velocity"] = np.stack([moved[:, w] for _, _, w in parts], axis=1)[..., None] * e3
        return out

    def _planar(self, times: np.ndarray) -> np.ndarray:
        """Planar states (times, 11): free flight, the contact, free flight."""
        since = np.asarray(times) - self.touch
        before, after = since < 0, since > self.contact.duration
        states = np.empty((len(since), len(self.contact.final)))
        states[~before & ~after] = self.contact.states(since[~before & ~after])
        for part, past, state in (
            (before, since, self._at_touch()),
            (after, since - self.contact.duration, self.contact.final),
        ):
            states[part] = state
            states[part, Q1] += past[part, None] * state[V1]
            states[part, Q2] += past[part, None] * state[V2]
        return states

    def _at_touch(self) -> np.ndarray:
        return planar(self.frame, self.start["velocity"], self.start["angular_velocity"])

    @property
    def speed(self) -> float:
        """Normal approach speed [m/s] at the first touch."""
        return -contact_ode.instant(self.bodies, self._at_touch()).parting

    @property
    def slip(self) -> float:
        """Slip speed [m/s] at the first touch, along e2."""
        return contact_ode.instant(self.bodies, self._at_touch()).slip


def planar(frame: np.ndarray, velocity: np.ndarray, spin: np.ndarray) -> np.ndarray:
    """Velocities and spins of one or two bodies as a planar state at rest displacement."""
    state = np.zeros(11)
    for k, (v, w) in enumerate(((V1, W1), (V2, W2))[: len(velocity)]):
        state[v], state[w] = frame[:2] @ velocity[k], frame[2] @ spin[k]
    return state


def _first_touch(
    scene: Scene, start: dict[str, np.ndarray], rows: tuple[int, ...], other: int | str, reach: float
) -> tuple[float, np.ndarray]:
    """Time [s] and normal of the first touch. Raises ValueError if the paths do not meet."""
    x, v = start["position"], start["velocity"]
    if isinstance(other, str):
        plane = next(p for p in scene.planes if p.name == other)
        normal = np.array(plane.normal) / np.linalg.norm(plane.normal)
        approach = -float(v[0] @ normal)
        gap = float((x[0] - np.array(plane.point)) @ normal) - reach
        if approach <= 0 or gap < 0:
            raise ValueError(f"particle {rows[0] + 1} does not fly at {other}")
        return gap / approach, normal
    d, u = x[0] - x[1], v[0] - v[1]
    along, rest = float(d @ u), float(d @ d) - reach**2
    root = along**2 - float(u @ u) * rest
    if along >= 0 or root <= 0 or rest < 0:
        raise ValueError(f"particles {rows[0] + 1} and {rows[1] + 1} do not meet")
    time = rest / (-along + math.sqrt(root))
    normal = d + u * time
    return time, normal / np.linalg.norm(normal)


def impact(
    scene: Scene,
    i: int,
    other: int | str,
    rtol: float = contact_ode.RTOL,
    start: dict[str, np.ndarray] | None = None,
) -> Impact:
    """Solve the impact of particle row `i` with row `other`, or with the plane of that name.

    `start`: position, velocity, angular_velocity of these rows at time 0; default as the scene states.

    It covers one planar impact without gravity: relative velocity and surface slip in one plane with the
    normal, spins across it. Raises ValueError where the scene is not that.
    """
    if any(scene.gravity):
        raise ValueError("the impact oracle knows no gravity")
    c = bodies(scene, i, other)
    rows = (i,) if isinstance(other, str) else (i, other)
    reach = c.radius[0] + (0.0 if c.is_wall else c.radius[1])
    if start is None:
        start = {k: getattr(scene.state, k)[list(rows)] for k in COLUMNS}
    touch, normal = _first_touch(scene, start, rows, other, reach)
    relative = start["velocity"][0] - (0.0 if c.is_wall else start["velocity"][1])
    turning = sum(r * w for r, w in zip(c.radius, start["angular_velocity"], strict=False))
    slip = relative - (relative @ normal) * normal - np.cross(turning, normal)
    axis = next((a for a in (slip, relative - (relative @ normal) * normal) if np.linalg.norm(a) > 0), None)
    if axis is None:
        axis = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    axis = axis - (axis @ normal) * normal
    e2 = axis / np.linalg.norm(axis)
    frame = np.array([normal, e2, np.cross(normal, e2)])
    speed = float(np.linalg.norm(relative))
    off_plane = max(
        abs(relative @ frame[2]), float(np.abs(start["angular_velocity"] @ frame[:2].T).max()) * c.radius[0]
    )
    if off_plane > 1e-12 * speed:
        raise ValueError(f"the impact of particle {i + 1} is not planar")
    law = contact_ode.Law(
        scene.contact.tangential == "history", scene.contact.limit_force, scene.contact.tangential_damping
    )
    state = planar(frame, start["velocity"], start["angular_velocity"])
    return Impact(rows, c, frame, touch, start, contact_ode.solve(c, law, state, rtol))
