"""Particles that contacts do not move: `[[groups]]`, chosen by material, id or place, frozen or moved.

A frozen particle stays where it is, without velocity and spin; in a contact with a free one the effective
mass is the free one's (LIGGGHTS `fix freeze`). Forces on it are computed and move nothing. Between particles
of groups, and between them and walls, there are no contacts: neither could move the other.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import AfterValidator, model_validator

from gpudem.scene.files import nearest
from gpudem.scene.motion import Motion, Servo, largest_speed
from gpudem.scene.regions import RegionSection
from gpudem.scene.types import Flag, Model, Name, Vector, array, vector
from gpudem.scene.walls import box_corners
from gpudem.walls.motion import WallPath

if TYPE_CHECKING:
    from gpudem.scene.model import Scene
    from gpudem.scene.packing import InitialState

#: How particles that are inserted can be held.
INSTEAD = (
    "to hold inserted ones, insert them in a run of its own (gpudem pack), and start from its file with"
    " at_rest = true"
)
#: Values of `Scene.held`: a particle that moves freely, and one that is frozen.
FREE, FROZEN = 0, -1


def _whole(ids: np.ndarray) -> np.ndarray:
    """Ids as whole numbers. Raises ValueError: others among them."""
    bad = (ids < 1) | (ids != np.floor(ids)) | (ids >= 2**53)
    if bad.any():
        row = int(np.argmax(bad))
        raise ValueError(f"row {row + 1} is {ids[row]:g}; must be ids, whole numbers from 1")
    found = ids.astype(np.int64)
    found.setflags(write=False)
    return found


class Group(Model):
    """Particles of the start that are held: those that have every property stated."""

    name: Name
    """Name of the group; unique, and not that of a wall."""
    material: Name | None = None
    """Those of this material."""
    ids: Annotated[np.ndarray, array(0, "1"), AfterValidator(_whole)] | None = None
    """Those with these ids, counted from 1 in the order in which particles are stated, shape (k,)."""
    region: RegionSection | None = None
    """Those whose center lies in it at the start; a region as of `[[insert]]`."""
    frozen: Flag = False
    """They stay where they are, and contacts with them have the effective mass of the free particle."""
    motion: tuple[Motion, ...] = ()
    """How they move together, as walls do, in closed form; in contacts they have their own mass."""
    reference: Annotated[Vector, vector("m")] = (0.0, 0.0, 0.0)
    """Point at rest about which the torque on it is stated [m]."""

    @model_validator(mode="after")
    def _stated(self) -> Group:
        if self.material is None and self.ids is None and self.region is None:
            raise ValueError("material: missing; a group states material, ids or region")
        if not self.frozen and not self.motion:
            raise ValueError("frozen: missing; what holds the particles is frozen = true or a motion")
        if self.frozen and self.motion:
            raise ValueError("frozen: beside motion; state one of the two")
        if any(isinstance(motion, Servo) for motion in self.motion):
            raise ValueError("motion: a group has no servo; walls have")
        return self

    def rows(self, scene: Scene) -> np.ndarray:
        """Its particles as rows of `Scene.state`, ascending. Raises IndexError: an id of no particle."""
        start = len(scene.stated_particles) - (len(scene.inserted.step) if scene.insert else 0)
        chosen = np.ones(start, bool)
        if self.material is not None:
            chosen &= scene.stated_particles.material[:start] == scene.material_index[self.material]
        if self.region is not None:
            chosen &= self.region.depth(scene.stated_particles.position[:start]) >= 0
        if self.ids is not None:
            if self.ids.size and self.ids.max() > start:
                raise IndexError(int(self.ids.max()))
            listed = np.zeros(start, bool)
            listed[self.ids - 1] = True
            chosen &= listed
        return np.flatnonzero(chosen)


def held(scene: Scene) -> np.ndarray:
    """What moves each particle of `Scene.state`, (n,): FREE, FROZEN, or k, the k-th of `moving` from 1."""
    found, movers = np.full(len(scene.stated_particles), FREE, np.int32), moving(scene)
    for group in scene.groups:
        found[group.rows(scene)] = 1 + movers.index(group) if group.motion else FROZEN
    found.setflags(write=False)
    return found


def moving(scene: Scene) -> list[Group]:
    """The groups with a motion, in order of statement."""
    return [group for group in scene.groups if group.motion]


def paths(scene: Scene) -> list[WallPath]:
    """Where each of `moving` is at every step."""
    return [WallPath(group.motion, scene.time.step) for group in moving(scene)]


def with_velocities(scene: Scene, state: InitialState) -> InitialState:
    """Particles of `moving` with the velocity and spin that their motion has at the start."""
    if not moving(scene):
        return state
    velocity, spin = state.velocity.copy(), state.angular_velocity.copy()
    for group, path in zip(moving(scene), paths(scene), strict=True):
        rows, pose = group.rows(scene), path.at(0, 1)
        velocity[rows] = pose.velocity_at(state.position[rows])
        spin[rows] = pose.spin
    for values in (velocity, spin):
        values.setflags(write=False)
    return dataclasses.replace(state, velocity=velocity, angular_velocity=spin)


def top_speed(scene: Scene) -> float:
    """An upper bound of the speed of particles with a motion [m/s]."""
    corners = box_corners(np.array(scene.domain.lo), np.array(scene.domain.hi))
    position, run = scene.stated_particles.position, scene.time.duration
    speeds = [
        largest_speed(group.motion, position[group.rows(scene)], corners, run) for group in moving(scene)
    ]
    return max(speeds, default=0.0)


def contact_force(scene: Scene, step: int, rows: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Force of the contacts alone [N] on rows of `Scene.state` in a step, (k, 3), from that with weight."""
    return force - scene.masses[rows, None] * scene.gravity_at(np.array([step]))


def problems(scene: Scene) -> list[str]:
    """What is wrong with the groups of a scene whose particles and walls are valid."""
    found, taken = [], np.full(len(scene.stated_particles), -1)
    walls = {wall.name for wall in scene.wall_elements}
    names = [group.name for group in scene.groups]
    for k, group in enumerate(scene.groups):
        key = f"groups[{k}]"
        if group.name in names[:k]:
            found.append(f"{key}.name = {group.name!r}: there is another group of this name")
        if group.name in walls:
            found.append(f"{key}.name = {group.name!r}: a wall has this name")
        if group.material is not None and group.material not in scene.materials:
            known = ", ".join(sorted(scene.materials))
            found.append(f"{key}.material = {group.material!r}: no such material; known: {known}")
            continue
        try:
            rows = group.rows(scene)
        except IndexError as error:
            inserted = error.args[0] <= len(scene.stated_particles)
            what = "is inserted during the run, and stays free" if inserted else "no such particle"
            allowed = f"1 to {scene.start_count}, those at the start"
            found.append(
                f"{key}.ids: {error.args[0]}: {what}; allowed: {allowed}" + f"; {INSTEAD}" * inserted
            )
            continue
        if not len(rows):
            none = f"{key}: no particle at the start is in group {group.name!r}"
            found.append(none + f"; {INSTEAD}" * bool(scene.insert))
            continue
        both = rows[taken[rows] >= 0]
        if len(both):
            other = names[taken[both[0]]]
            found.append(f"{key}: particle {both[0] + 1} is in group {other!r} already; allowed: one group")
        taken[rows] = k
        found += _moving(scene, key, rows)
        if group.motion and scene.solver.integrator == "path":
            found.append(f"{key}.motion: solver.integrator = 'path' knows no such motion; use 'half_step'")
    found += _forces(scene, names)
    if scene.groups and not found and (taken >= 0).all():
        found.append("groups: every particle is in one; at least one must be free")
    return found


def _forces(scene: Scene, names: list[str]) -> list[str]:
    """Forces asked for of groups that there are not, or where there is no history."""
    wanted = scene.output.group_forces
    unknown = [name for name in wanted if name not in names]
    found = [f"output.group_forces: {name!r} is no group{nearest(name, names)}" for name in unknown]
    if wanted and scene.output.history_every is None:
        found.append("output.group_forces: has no effect without output.history_every [s]")
    return found


def _moving(scene: Scene, key: str, rows: np.ndarray) -> list[str]:
    """Held particles with a velocity of their own."""
    state, found = scene.stated_particles, []
    for name, unit in (("velocity", "m/s"), ("angular_velocity", "rad/s")):
        moving = getattr(state, name)[rows].any(axis=1)
        if moving.any():
            i = int(rows[np.argmax(moving)])
            value = tuple(getattr(state, name)[i].tolist())
            found.append(f"{key}: particle {i + 1} has {name} {value} {unit} of its own; must be 0")
    return found
