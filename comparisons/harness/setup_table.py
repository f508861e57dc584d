"""The set-up of a case for a reader: the resolved scenes as rows (quantity, value, unit)."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from comparisons.harness.numbers import number
from gpudem.scene import Mesh, Plane, Scene, WallChange
from gpudem.scene.time_step import contact_time, rayleigh_time
from gpudem.scene.walls import Wall

Row = tuple[str, str, str]

#: More different values than this are shown as their range.
LISTED = 6
#: Names in a row; pairs are named up to three times as many.
NAMED = 5


def rows(scenes: list[Scene]) -> list[Row]:
    """What all variants share once; what differs between them as a list of values, or their range."""
    tables = [essentials(scene) for scene in scenes]
    keys = list(dict.fromkeys(key for table in tables for key in table))
    return [(name, _merge([t[name, unit] for t in tables if (name, unit) in t]), unit) for name, unit in keys]


def essentials(scene: Scene) -> dict[tuple[str, str], float | str]:
    """(quantity, unit) -> value of one scene: primary inputs as stated, and what they mean for the step."""
    state, dt = scene.state, scene.time.step
    table: dict[tuple[str, str], float | str] = {("particles", ""): len(state)}
    table["radius", "m"] = _span(state.radius)
    if state.velocity.any():
        table["start speed", "m/s"] = _span(np.linalg.norm(state.velocity, axis=1))
    if state.angular_velocity.any():
        table["start spin", "rad/s"] = _span(np.linalg.norm(state.angular_velocity, axis=1))
    for (young, poisson, density), names in _materials(scene).items():
        shown = names if len(names) <= NAMED else [*names[: NAMED - 1], f"{len(names) - NAMED + 1} more"]
        table[f"material {', '.join(shown)}", ""] = (
            f"Young's modulus {number(young)} Pa, Poisson's ratio {poisson:g},"
            f" density {number(density)} kg/m\u00b3"
        )
    if scene.contact_pairs:
        table["restitution", ""] = _pairs(scene, "restitution")
    if scene.needs.tangential:
        table["friction", ""] = _pairs(scene, "friction")
    if scene.needs.rolling:
        table["rolling friction", ""] = _pairs(scene, "rolling_friction")
    c = scene.contact
    extras = ["limit_force"] * c.limit_force + ["no tangential damping"] * (not c.tangential_damping)
    slots = f"normal {c.normal}, tangential {c.tangential}, rolling {c.rolling}"
    table["contact law", ""] = ", ".join([slots, *extras])
    physics = [name.replace("_", " ") for name, wanted in scene.needs if wanted]
    table["physics of the scene", ""] = ", ".join(physics) or "normal contact only"
    if any(scene.gravity):
        table["gravity", "m/s²"] = "({:g}, {:g}, {:g})".format(*scene.gravity)
    for phase in scene.phases:
        changed = ["({:g}, {:g}, {:g})".format(*phase.gravity)] if phase.gravity else []
        changed += [f"{' / '.join(change.materials)}: {change.stated}" for change in phase.pairs]
        changed += [f"{change.name}: {', '.join(_of_wall(change))}" for change in phase.walls]
        table[f"from {phase.start:g} s on", ""] = ", ".join(changed)
    if scene.groups:
        states = [(g.name, len(g.rows(scene)), "moving" if g.motion else "frozen") for g in scene.groups]
        table["groups", ""] = ", ".join(f"{name} ({count} {state})" for name, count, state in states)
    if scene.walls:
        stated = [f"{w.name}{_fate(w)}: {w.material}" for w in scene.wall_elements]
        table["walls", ""] = ", ".join(stated)
    size = np.array(scene.domain.hi) - np.array(scene.domain.lo)
    table["domain", "m"] = " \u00d7 ".join(f"{s:.4g}" for s in size)
    if scene.needs.periodic:
        table["periodic", ""] = ", ".join("xyz"[k] for k in range(3) if scene.domain.periodic[k])
    table["time step", "s"] = dt
    table["time step / Rayleigh time", ""] = round(dt / rayleigh_time(scene), 5)
    shortest = contact_time(scene)
    if math.isfinite(shortest):
        table["time step / shortest contact time", ""] = round(dt / shortest, 5)
    table["duration", "s"] = scene.n_steps * dt
    table["steps", ""] = scene.n_steps
    table["precision", ""] = scene.solver.precision
    return table


def _materials(scene: Scene) -> dict[tuple[float, float, float], list[str]]:
    """(young, poisson, density) -> names of the materials that have them."""
    found: dict[tuple[float, float, float], list[str]] = {}
    for name, m in scene.materials.items():
        found.setdefault((m.young, m.poisson, m.density), []).append(name)
    return found


def _pairs(scene: Scene, name: str) -> float | str:
    """A property of all pairs that can meet: one value, or each value with its pairs, the commonest last; of
    many pairs only the values.
    """
    found: dict[float, list[str]] = {}
    for pair in scene.contact_pairs:
        found.setdefault(getattr(pair, name), []).append(" / ".join(pair.materials))
    if len(found) == 1:
        return next(iter(found))
    groups = sorted(found.items(), key=lambda item: len(item[1]))
    if sum(len(pairs) for _, pairs in groups[:-1]) > 3 * NAMED:
        return f"{', '.join(f'{value:g}' for value in sorted(found))} ({len(scene.contact_pairs)} pairs)"
    shown = [f"{value:g} ({', '.join(pairs)})" for value, pairs in groups[:-1]]
    value, pairs = groups[-1]
    return ", ".join([*shown, f"{value:g} ({pairs[0]})" if len(pairs) == 1 else f"{value:g} (other pairs)"])


def _span(values: np.ndarray) -> str:
    lo, hi = float(values.min()), float(values.max())
    different = np.unique(values)
    if len(different) <= 3:
        return ", ".join(number(v) for v in different)
    return f"{number(lo)} to {number(hi)}"


def _merge(values: list[float | str]) -> str:
    different = list(dict.fromkeys(values))
    numbers = sorted(v for v in different if isinstance(v, int | float))
    if len(different) <= LISTED:
        return "; ".join(_text(v) for v in different)
    if len(numbers) == len(different):
        return f"{_text(numbers[0])} to {_text(numbers[-1])} ({len(numbers)} values)"
    return f"{_text(different[0])}; ... ({len(different)} different)"


def _text(value: float | str) -> str:
    if isinstance(value, int):
        return f"{value:,}".replace(",", " ")
    return value if isinstance(value, str) else number(value)


def _of_wall(change: WallChange) -> Iterator[str]:
    """What changes of a wall in a phase, in words."""
    if change.present is not None:
        yield "comes" if change.present else "goes"
    if change.motion is not None:
        yield ", ".join(motion.type for motion in change.motion) or "stops"
    if change.surface_velocity is not None:
        yield "belt ({:g}, {:g}, {:g}) m/s".format(*change.surface_velocity)
    if change.material is not None:
        yield change.material


def _fate(wall: Wall) -> str:
    """Kind, presence and motion of a wall, in brackets; nothing for a plane at rest."""
    facts = [] if isinstance(wall, Plane) else [wall.kind]
    facts += [f"{len(wall.corners)} triangles"] if isinstance(wall, Mesh) else []
    facts += [f"there from {wall.begin:g} s"] if wall.begin > 0 else []
    facts += [f"removed at {wall.end:g} s"] if wall.end is not None else []
    moves = wall.vibration if isinstance(wall, Plane) else None
    facts += [f"vibrates at {moves.speed:g} m/s, amplitude {moves.amplitude:g} m"] if moves else []
    facts += [", ".join(motion.type for motion in wall.motion)] if wall.motion else []
    facts += ["belt"] if wall.surface_velocity is not None else []
    return f" ({', '.join(facts)})" if facts else ""
