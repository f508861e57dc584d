"""Numbers that describe a state of many particles, from a trace, in the same way for every code."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from comparisons.metrics import contacts
from comparisons.metrics.parting import period, state_of
from gpudem.scene import Scene
from gpudem.scene.groups import FREE

#: Particles from which profiles and packing mean something.
MANY = 20
#: Share of the run, from its end, over which means in time are taken, and how many times of it.
LAST, SAMPLES = 0.25, 8
#: Places along the flow at which the height is read.
PLACES = 4
#: Quantile of the tops of particles that is the height of a bed: one particle in flight does not set it.
TOP = 0.9


def axes(scene: Scene, trace: Mapping[str, np.ndarray]) -> tuple[int | None, int]:
    """(axis along gravity, or None without; axis of the flow): the flow is along the largest displacement of
    the center of mass across gravity.
    """
    gravity = np.abs(np.array(scene.gravity))
    up = int(np.argmax(gravity)) if gravity.any() else None
    moved = scene.masses @ np.nan_to_num(trace["velocity"]).mean(axis=0)
    rest = [k for k in range(3) if k != up]
    return up, max(rest, key=lambda k: abs(float(moved[k])))


def energies(scene: Scene, trace: Mapping[str, np.ndarray], free: bool = False) -> dict[str, np.ndarray]:
    """Kinetic (with rotation) and potential energy [J] in time, each (t,); across periodic sides, along which
    gravity acts, the potential energy is not defined and is left out. Particles that are not there yet have
    none; `free`: nor have those of groups.
    """
    mass, radius = np.where(free & (scene.held != FREE), 0.0, scene.masses), scene.state.radius
    trace = {k: np.nan_to_num(trace[k]) for k in ("step", "position", "velocity", "angular_velocity")}
    inertia = 0.4 * mass * radius**2
    kinetic = 0.5 * ((trace["velocity"] ** 2).sum(axis=2) @ mass)
    rotation = 0.5 * ((trace["angular_velocity"] ** 2).sum(axis=2) @ inertia)
    found = {"kinetic": kinetic + rotation, "rotational": rotation}
    gravity = scene.gravity_at(trace["step"])
    if not (gravity * period(scene)).any():
        found["potential"] = -np.einsum("tij,tj,i->t", trace["position"], gravity, mass)
    return found


def energy_that_left(scene: Scene, trace: Mapping[str, np.ndarray]) -> tuple[np.ndarray, int]:
    """Kinetic and potential energy [J] that free particles have taken along by each time of a trace, (t,),
    and how many they are.

    Each takes what it has at the last time at which it is there; what it exchanges with others between that
    time and the step in which it leaves is left out.
    """
    there = np.isfinite(trace["position"][..., 0])
    last = len(there) - 1 - np.argmax(there[::-1], axis=0)
    rows = np.flatnonzero(there.any(axis=0) & (last < len(there) - 1) & (scene.held == FREE))
    last, mass = last[rows], scene.masses[rows]
    x, v, w = (trace[name][last, rows] for name in ("position", "velocity", "angular_velocity"))
    inertia = 0.4 * mass * scene.state.radius[rows] ** 2
    kinetic = 0.5 * (mass * (v**2).sum(axis=1) + inertia * (w**2).sum(axis=1))
    potential = -mass * np.sum(x * scene.gravity_at(trace["step"][last]), axis=1)
    taken = np.zeros(len(there))
    np.add.at(taken, last + 1, kinetic + potential)
    return np.cumsum(taken), len(rows)


def metrics(scene: Scene, trace: Mapping[str, np.ndarray], up: int | None, flow: int) -> dict[str, float]:
    """Name with unit -> value at the end of a run, or its mean over the last quarter."""
    count = len(trace["time"])
    first = int((1 - LAST) * (count - 1))
    chosen = np.unique(np.linspace(first, count - 1, min(SAMPLES, count - first)).astype(int))
    part = {k: v[chosen] for k, v in trace.items()}
    energy = energies(scene, part)
    letters = "xyz"
    found = {
        "kinetic energy, mean [J]": float(energy["kinetic"].mean()),
        "rotational energy, mean [J]": float(energy["rotational"].mean()),
    }
    if "potential" in energy:
        found["mechanical energy, end [J]"] = float(energy["kinetic"][-1] + energy["potential"][-1])
    centers = np.einsum("i,tij->tj", scene.masses, part["position"]) / scene.masses.sum()
    for axis in sorted({flow, up} - {None}):  # pyright: ignore[reportArgumentType]
        if not scene.domain.periodic[axis]:
            found[f"center of mass along {letters[axis]}, end [m]"] = float(centers[-1, axis])
    found |= _contacts(scene, part)
    if not scene.domain.periodic[flow]:
        front = part["position"][-1, :, flow] + scene.state.radius
        found[f"front along {letters[flow]}, end [m]"] = float(front.max())
    if len(scene.state) >= MANY:
        found |= _profiles(scene, part, up, flow)
    return found


def _contacts(scene: Scene, part: Mapping[str, np.ndarray]) -> dict[str, float]:
    """Contacts, coordination and overlaps, means over the times.

    Overlaps stand for the forces of single contacts, which a trace does not hold: it has the sum over the
    contacts of a particle, which at rest is its weight.
    """
    n, rows = len(scene.state), []
    for k, time in enumerate(part["time"]):
        state = state_of(scene, part["position"][k], float(time))
        share = overlaps(scene, state)
        mean = share.mean() if len(share) else 0.0
        spread = share.std() / mean if mean > 0 else 0.0
        rows.append((len(state), 2 * len(state.pairs) / n, mean, spread))
    count, coordination, mean, spread = (float(v) for v in np.mean(rows, axis=0))
    found = {
        "contacts, mean [1]": count,
        "coordination number without walls, mean [1]": coordination,
        "overlap / smaller radius of a contact, mean [1]": mean,
    }
    if n >= MANY:
        found["standard deviation / mean of the overlaps [1]"] = spread
    return found


def overlaps(scene: Scene, state: contacts.Contacts) -> np.ndarray:
    """Overlap / smaller radius of every contact, of particles and with walls, shape (contacts,)."""
    radius = scene.state.radius
    between = state.overlap / radius[state.pairs].min(axis=1) if len(state.pairs) else np.zeros(0)
    return np.concatenate([between, state.wall_overlap / radius[state.wall_pairs[:, 0]]])


def _profiles(scene: Scene, part: Mapping[str, np.ndarray], up: int | None, flow: int) -> dict[str, float]:
    """Packing fraction, heights along the flow, mean flow velocity by height."""
    radius, position = scene.state.radius, part["position"][-1]
    lo, hi = np.quantile(position, [0.1, 0.9], axis=0)
    thick = np.maximum(hi - lo, 2 * radius.max())
    inside = ((position >= lo) & (position <= hi)).all(axis=1)
    volume = float((4 / 3 * np.pi * radius[inside] ** 3).sum())
    name = "packing fraction between the 10 % and 90 % quantiles of positions, end [1]"
    found = {name: volume / float(np.prod(thick))}
    if up is None:
        return found
    sign = -np.sign(scene.gravity[up])
    found |= {
        f"height at {x:.4g} m along {'xyz'[flow]}, end [m]": h
        for x, h in zip(*height_profile(scene, position, up, flow), strict=True)
    }
    order = np.argsort(sign * part["position"], axis=1)[..., up]
    speeds = np.take_along_axis(part["velocity"][..., flow], order, axis=1)
    for name, third in zip(("lowest", "middle", "highest"), np.array_split(speeds, 3, axis=1), strict=True):
        found[f"velocity along {'xyz'[flow]}, {name} third, mean [m/s]"] = float(third.mean())
    return found


def height_profile(
    scene: Scene, position: np.ndarray, up: int, flow: int, places: int = PLACES
) -> tuple[np.ndarray, np.ndarray]:
    """(places along the flow [m], heights there [m]): the TOP quantile of tops; 0 where there is no particle.

    Heights count from the side of the domain to which gravity points.
    """
    lo, hi = scene.domain.lo, scene.domain.hi
    top = position[:, up] - lo[up] if scene.gravity[up] < 0 else hi[up] - position[:, up]
    edges = np.linspace(lo[flow], hi[flow], places + 1)
    part = np.clip(np.digitize(position[:, flow], edges) - 1, 0, places - 1)
    tops = [top[part == k] + scene.state.radius[part == k] for k in range(places)]
    heights = np.array([float(np.quantile(t, TOP)) if len(t) else 0.0 for t in tops])
    return (edges[1:] + edges[:-1]) / 2, heights
