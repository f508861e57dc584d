"""The set-up of a case for a reader: the resolved scenes as rows (quantity, value, unit)."""

from __future__ import annotations

import math

import numpy as np

from gpudem.scene import Scene
from gpudem.scene_checks import hertz_time, rayleigh_time

Row = tuple[str, str, str]

#: More different values than this are shown as their range.
LISTED = 6


def rows(scenes: list[Scene]) -> list[Row]:
    """What all variants share once; what differs between them as a list of values, or their range."""
    tables = [essentials(scene) for scene in scenes]
    keys = list(dict.fromkeys(key for table in tables for key in table))
    return [(name, _merge([t[name, unit] for t in tables if (name, unit) in t]), unit) for name, unit in keys]


def essentials(scene: Scene) -> dict[tuple[str, str], str]:
    """(quantity, unit) -> value of one scene: primary inputs as stated, and what they mean for the step."""
    state, dt = scene.state, scene.time.step
    table: dict[tuple[str, str], str] = {("particles", ""): f"{len(state):,}".replace(",", " ")}
    table["radius", "m"] = _span(state.radius)
    if state.velocity.any():
        table["start speed", "m/s"] = _span(np.linalg.norm(state.velocity, axis=1))
    if state.angular_velocity.any():
        table["start spin", "rad/s"] = _span(np.linalg.norm(state.angular_velocity, axis=1))
    for name, m in scene.materials.items():
        table[f"{name}: Young's modulus", "Pa"] = f"{m.young:.6g}"
        table[f"{name}: Poisson's ratio", ""] = f"{m.poisson:.6g}"
        table[f"{name}: density", "kg/m³"] = f"{m.density:.6g}"
    for pair in scene.contact_pairs:
        name = " / ".join(dict.fromkeys(pair.materials))
        if len(set(pair.materials)) == 1:
            name += f" / {name}"
        table[f"{name}: restitution", ""] = f"{pair.restitution:g}"
        if scene.needs.tangential:
            table[f"{name}: friction", ""] = f"{pair.friction:g}"
        if scene.needs.rolling:
            table[f"{name}: rolling friction", ""] = f"{pair.rolling_friction:g}"
    c = scene.contact
    extras = ["limit_force"] * c.limit_force + ["no tangential damping"] * (not c.tangential_damping)
    slots = f"normal {c.normal}, tangential {c.tangential}, rolling {c.rolling}"
    table["contact law", ""] = ", ".join([slots, *extras])
    if any(scene.gravity):
        table["gravity", "m/s²"] = "({:g}, {:g}, {:g})".format(*scene.gravity)
    if scene.planes:
        names = [p.name + (f" (gone at {p.removed_at:g} s)" if p.removed_at else "") for p in scene.planes]
        table["walls", ""] = ", ".join(f"{n}: {p.material}" for n, p in zip(names, scene.planes, strict=True))
    size = np.array(scene.domain.hi) - np.array(scene.domain.lo)
    table["domain", "m"] = " \u00d7 ".join(f"{s:.4g}" for s in size)
    if scene.needs.periodic:
        table["periodic", ""] = ", ".join("xyz"[k] for k in range(3) if scene.domain.periodic[k])
    table["time step", "s"] = f"{dt:.4g}"
    table["time step / Rayleigh time", ""] = f"{dt / rayleigh_time(scene):.3g}"
    hertz = hertz_time(scene)
    if math.isfinite(hertz):
        table["time step / Hertz contact time", ""] = f"{dt / hertz:.3g}"
    table["duration", "s"] = f"{scene.n_steps * dt:.4g}"
    table["steps", ""] = f"{scene.n_steps:,}".replace(",", " ")
    table["precision", ""] = scene.solver.precision
    return table


def _span(values: np.ndarray) -> str:
    lo, hi = float(values.min()), float(values.max())
    different = np.unique(values)
    if len(different) <= 3:
        return ", ".join(f"{v:.4g}" for v in different)
    return f"{lo:.4g} to {hi:.4g}"


def _merge(values: list[str]) -> str:
    different = list(dict.fromkeys(values))
    if len(different) <= LISTED:
        return "; ".join(different)
    try:
        numbers = sorted(float(v.replace(" ", "")) for v in different)
        return f"{numbers[0]:.4g} to {numbers[-1]:.4g} ({len(numbers)} values)"
    except ValueError:
        return f"{different[0]}; ... ({len(different)} different)"
