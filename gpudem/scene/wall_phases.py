"""What changes of the walls in `[[phases]]`: presence, motion, belt, material.

A motion that stops leaves the wall where it is. One that a phase states begins where the wall then is: its
time counts from the start of the phase, its points and axes are places and directions in space at that time.
A motion of which a phase says nothing goes on, and its time with it.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import field_validator, model_validator

from gpudem.scene.files import nearest
from gpudem.scene.motion import Motion, Servo
from gpudem.scene.types import Flag, Model, Name, Vector, vector
from gpudem.scene.walls import Plane, Wall, box_corners

if TYPE_CHECKING:
    from gpudem.scene.model import Scene
    from gpudem.scene.phases import Phase


class WallChange(Model):
    """What changes of one wall; what is not stated stays, and a motion that is not stated goes on."""

    name: Name
    """Name of one of `[[walls]]`; of a box, it holds for all its planes."""
    present: Flag | None = None
    """Whether it is there from then on."""
    motion: tuple[Motion, ...] | None = None
    """How it moves from then on, beginning where it then is, with a time that counts from the start of the
    phase; [] stops it there."""
    surface_velocity: Annotated[Vector, vector("m/s")] | None = None
    """Velocity of its belt from then on [m/s]; [0, 0, 0] stops it."""
    material: Name | None = None
    """Its material from then on: contacts with it have the properties of another pair."""

    @field_validator("motion")
    @classmethod
    def _servo_alone(cls, value: tuple[Motion, ...] | None) -> tuple[Motion, ...] | None:
        if value is not None and len(value) > 1 and any(isinstance(motion, Servo) for motion in value):
            raise ValueError("a servo beside other motions; a servo must be the only one")
        return value

    @model_validator(mode="after")
    def _changes(self) -> WallChange:
        if all(value is None for key, value in self if key != "name"):
            raise ValueError("present: missing; states present, motion, surface_velocity or material")
        return self

    @property
    def drives(self) -> bool:
        """Whether it states a belt that has a velocity."""
        return self.surface_velocity is not None and any(self.surface_velocity)

    def of(self, wall: Wall) -> Wall:
        """The wall with motion, belt and material of the change; its place stays that at the start."""
        stated = {key: value for key, value in self if key in ("motion", "surface_velocity", "material")}
        update = {key: value for key, value in stated.items() if value is not None}
        if self.surface_velocity is not None and not self.drives:
            update["surface_velocity"] = None
        return wall.model_copy(update=update) if update else wall


def changed(walls: tuple[Wall, ...], phase: Phase) -> tuple[Wall, ...]:
    """The walls from the start of a phase on, from those before it."""
    changes = {change.name: change for change in phase.walls}
    return tuple(changes[wall.name].of(wall) if wall.name in changes else wall for wall in walls)


def elements(scene: Scene) -> Iterator[tuple[Wall, list[tuple[float, WallChange]]]]:
    """Each elementary wall, and what changes of it, with the start of the phase [s]."""
    found: dict[str, list[tuple[float, WallChange]]] = {}
    for phase in scene.phases:
        for change in phase.walls:
            found.setdefault(change.name, []).append((phase.start, change))
    for wall in scene.walls:
        for part in wall.elements(scene.domain.lo, scene.domain.hi):
            yield part, found.get(wall.name, [])


def motions(scene: Scene) -> dict[str, list[tuple[int, tuple[Motion, ...]]]]:
    """Of each elementary wall that moves at some time: the motions, and the step from which on they act."""
    found = {}
    for wall, changes in elements(scene):
        parts = [(0, wall.motion)]
        parts += [(scene.steps(t), change.motion) for t, change in changes if change.motion is not None]
        if any(part for _, part in parts):
            found[wall.name] = parts
    return found


def servos(scene: Scene) -> dict[str, list[tuple[int, Servo]]]:
    """Of each elementary wall that has servos at some time: the steps at which they begin, and the servos."""
    found = {}
    for name, parts in motions(scene).items():
        stated = [(step, m) for step, part in parts for m in part if isinstance(m, Servo)]
        if stated:
            found[name] = stated
    return found


def presence(scene: Scene) -> dict[str, list[int]]:
    """The steps from which on each elementary wall is there, and is not there, in turns, ascending."""
    found = {}
    for wall, changes in elements(scene):
        steps = [scene.steps(time) for time in (wall.begin, wall.end) if time is not None]
        found[wall.name] = steps + [scene.steps(t) for t, change in changes if change.present is not None]
    return found


def with_motion(scene: Scene) -> frozenset[str]:
    """Names of the elementary walls that have a motion at some time."""
    return frozenset(
        w.name for w, changes in elements(scene) if w.motion or any(c.motion for _, c in changes)
    )


def moving(scene: Scene) -> frozenset[str]:
    """Names of the elementary walls that move, or whose surface has a velocity, at some time."""
    belts = {w.name for w, changes in elements(scene) if w.moves or any(c.drives for _, c in changes)}
    return with_motion(scene) | belts


def largest_speed(scene: Scene, w: int) -> float:
    """An upper bound of the speed [m/s] of elementary wall w within the domain in any phase; 0 at rest."""
    wall, run = scene.wall_elements[w], scene.time.duration
    if wall.name not in scene.moving_walls:
        return 0.0
    lo, hi = np.array(scene.domain.lo), np.array(scene.domain.hi)
    parts = motions(scene).get(wall.name, [(0, ())])
    belts = {at.wall_elements[w].surface_velocity for at in scene.phase_scenes}
    if len(parts) == 1 and len(belts) == 1:
        return wall.largest_speed(lo, hi, run)
    belt = max(belts, key=lambda v: float(np.linalg.norm(v or 0.0)))
    points, found = wall.reach_points(), []
    for step, motion in parts:
        part, begin = wall.model_copy(update={"motion": motion, "surface_velocity": belt}), points
        if any(first < step for first, _ in scene.servos.get(wall.name, ())):
            begin = box_corners(lo, hi)  # only the run knows where it then is
        elif points is not None and wall.name in scene.wall_paths:
            pose = scene.wall_paths[wall.name].at(step, 1)
            begin = points @ pose.rotation[0].T + pose.shift[0]
        found.append(part.largest_speed(lo, hi, run, begin))
    return max(found)


def servos_that_change(scene: Scene, step: int) -> set[str]:
    """Names of the elementary walls of which a servo begins or ends at a step after the start."""
    found, parts = set(), motions(scene)
    for name in scene.servos:
        for (_, old), (begin, new) in itertools.pairwise(parts[name]):
            if begin == step and any(isinstance(motion, Servo) for motion in (*old, *new)):
                found.add(name)
    return found


def belts_that_change(before: Scene, after: Scene) -> set[str]:
    """Names of the elementary walls whose belt is another one in the second of two phases."""
    pairs = zip(before.wall_elements, after.wall_elements, strict=True)
    return {old.name for old, new in pairs if old.surface_velocity != new.surface_velocity}


def belts_change(scene: Scene) -> bool:
    """Whether the belt of a wall changes during the run."""
    return any(change.surface_velocity is not None for phase in scene.phases for change in phase.walls)


def problems(scene: Scene) -> list[str]:
    """What is wrong with the changes of walls, in a scene whose walls and starts of phases are valid."""
    found, names = [], [wall.name for wall in scene.walls]
    now = {wall.name: wall for wall in scene.walls}
    there: dict[str, bool] = {}
    for k, phase in enumerate(scene.phases):
        stated: set[str] = set()
        for i, change in enumerate(phase.walls):
            key = f"phases[{k}].walls[{i}]"
            if change.name not in names:
                found.append(f"{key}.name = {change.name!r}: is no wall{nearest(change.name, names)}")
                continue
            if change.name in stated:
                found.append(f"{key}.name = {change.name!r}: given twice in this phase")
                continue
            stated.add(change.name)
            wall = now[change.name]
            found += [f"{key}.{problem}" for problem in _of_change(scene, change, wall)]
            if change.present is not None:
                found += [f"{key}.{p}" for p in _of_presence(scene, phase, change, wall, there)]
            now[change.name] = change.of(wall)
    return found


def _of_change(scene: Scene, change: WallChange, wall: Wall) -> Iterator[str]:
    """Motion, belt and material of a change that cannot be, or that change nothing."""
    if change.motion is not None:
        if not change.motion and not wall.motion:
            yield "motion = []: the wall is at rest already"
    if change.surface_velocity is not None and not change.drives and wall.surface_velocity is None:
        yield "surface_velocity = [0, 0, 0]: the wall has no belt"
    if isinstance(wall, Plane) and wall.vibration is not None:
        if change.motion or change.drives:
            key = "motion" if change.motion else "surface_velocity"
            yield f"{key}: the wall has a vibration; state one of the two"
    if change.material is not None and change.material not in scene.materials:
        known = ", ".join(sorted(scene.materials))
        yield f"material = {change.material!r}: no such material; known: {known}"
    elif change.material == wall.material:
        yield f"material = {change.material!r}: it is this one already"


def _of_presence(
    scene: Scene, phase: Phase, change: WallChange, wall: Wall, there: dict[str, bool]
) -> Iterator[str]:
    """A wall that comes where it is there, or goes where it is not."""
    stated = f"present = {str(change.present).lower()}"
    if wall.end is not None:
        yield f"{stated}: the wall states its end itself, {wall.end:g} s; state one of the two"
        return
    comes = scene.steps(wall.begin) <= scene.steps(phase.start)
    if not comes:
        yield f"{stated}: the wall comes at {wall.begin:g} s; a phase can change that only later"
    elif change.present == there.get(wall.name, True):
        since = "already" if change.present else f"at {phase.start:g} s anyway"
        yield f"{stated}: it is {'' if change.present else 'not '}there {since}"
    there[wall.name] = bool(change.present)
