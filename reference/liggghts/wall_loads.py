"""Force, torque, position and work of walls in a history: what a deck asks for, and what is made of it.

A mesh of `mesh/surface/stress` sums force and torque itself. The force on a plane or a cylinder is the sum of
what `store_force` keeps of each particle; its torque is that force at the nearest point of the wall. Work is
derived: force times velocity of the torque point and torque times angular velocity, step by step, from a file
with a line a step. What cannot be had is left out and said.
"""

from __future__ import annotations

import dataclasses
import itertools
from pathlib import Path

import numpy as np

from gpudem.contact import registry
from gpudem.output import observables
from gpudem.scene import Scene
from gpudem.scene.mesh import Mesh
from gpudem.scene.wall_phases import belts_that_change, motions
from gpudem.scene.walls import Wall
from reference.liggghts import groups
from reference.liggghts.contact_model import laws_of
from reference.liggghts.errors import LiggghtsOutputError
from reference.liggghts.step_files import Written, lines
from reference.liggghts.walls import foot, number, path

#: A belt lies in a face if this share of its velocity, or less, is across it.
IN_FACE = 1e-12


@dataclasses.dataclass(frozen=True)
class Load:
    """What a deck asks for of one wall."""

    name: str
    moments: tuple[str, ...]
    """Of a primitive: components of the torque on the wall by one particle [N m], as formulas."""
    columns: tuple[str, ...]
    """Words of a thermo line: force and torque on the wall [N, N m], of a mesh its torque point [m] too."""
    sign: int
    """1: these are on the wall; -1: on the particles."""

    @property
    def words(self) -> str:
        """The columns as the end of a line."""
        return "".join(f" {word}" for word in self.columns)


def warnings(scene: Scene) -> list[str]:
    """What is left out of the history's columns of walls, and why, a sentence each."""
    found = []
    if scene.output.wall_stress:
        found.append(
            "output.wall_stress: nan in the first frame, for LIGGGHTS does not sum forces on meshes in the"
            " set-up"
        )
    for wall in _wanted(scene):
        loads = f"history columns of wall {wall.name!r}"
        if not _readable(scene, wall):
            found.append(
                f"{loads} are left out: LIGGGHTS tells the force only on planes and cylinders that are there"
                " all the time, and on walls whose belt does not change"
            )
            continue
        if isinstance(wall, Mesh):
            found.append(f"{loads} begin with nan: LIGGGHTS does not sum forces on meshes in the set-up")
        if _rolls(scene, wall):
            found.append(
                f"history columns torque_{wall.name} are left out: LIGGGHTS' torque has no rolling resistance"
            )
        elif any(scene.domain.periodic):
            found.append(
                f"history columns torque_{wall.name} across periodic sides are left out: LIGGGHTS moves"
                " particles in at list rebuilds only"
            )
        if not _has_work(scene, wall):
            found.append(f"history column work_{wall.name} is left out: {_why_no_work(scene, wall)}")
    return found


def chosen(scene: Scene) -> list[str] | None:
    """Names of the history's columns where a scene chooses them; None: all."""
    if scene.output.history is None:
        return None
    exits = [f"removed_{part}{stated.name}" for stated in scene.exits for part in ("", "mass_")]
    planes = [f"flow_{what}_{plane.name}" for plane in scene.output.flow for what in ("count", "mass")]
    walls = [name for wall in _wanted(scene) for name in _names(scene, wall)]
    return [*scene.output.history, *walls, *groups.names(scene), *exits, *planes, *observables.rates(scene)]


def _wanted(scene: Scene) -> list[Wall]:
    return [wall for wall in scene.wall_elements if wall.name in scene.output.wall_forces]


def _readable(scene: Scene, wall: Wall) -> bool:
    """A wall stated once: no belt that changes; a mesh, which stays known where it is not there, or a
    primitive that is there in every run.
    """
    here = all(wall in present for _, _, present in scene.segments)
    pairs = itertools.pairwise(scene.phase_scenes)
    same_belt = not any(wall.name in belts_that_change(*pair) for pair in pairs)
    return same_belt and (isinstance(wall, Mesh) or here)


def _rolls(scene: Scene, wall: Wall) -> bool:
    return laws_of(scene, wall).rolling != registry.OFF


def _turns(scene: Scene, wall: Wall) -> bool:
    parts = motions(scene).get(wall.name, [])
    return any(motion.turns for _, stated in parts for motion in stated)


def _has_work(scene: Scene, wall: Wall) -> bool:
    """Whether the work follows from force and torque on the wall."""
    if _turns(scene, wall):
        return not _rolls(scene, wall)
    if isinstance(wall, Mesh) and wall.surface_velocity is not None:
        belt, edges = np.array(wall.surface_velocity), np.diff(wall.corners, axis=1)
        normal = np.cross(edges[:, 0], edges[:, 1])
        across = np.abs(normal @ belt) / np.linalg.norm(normal, axis=1)
        return bool(across.max() <= IN_FACE * np.linalg.norm(belt))
    return True


def _why_no_work(scene: Scene, wall: Wall) -> str:
    if _turns(scene, wall):
        return "the wall turns, and LIGGGHTS' torque has no rolling resistance"
    return "the belt has another direction on each face"


def _torques(scene: Scene, wall: Wall) -> list[int]:
    """The components of its torque that the history has: about a periodic axis the place along it is free."""
    if _rolls(scene, wall):
        return []
    return [k for k in range(3) if not any(scene.domain.periodic[j] for j in range(3) if j != k)]


def _names(scene: Scene, wall: Wall) -> list[str]:
    """The history's columns of a wall, in the order of gpudem's."""
    if not _readable(scene, wall):
        return []
    out = {f"torque_{wall.name}_{a}" for k, a in enumerate("xyz") if k not in _torques(scene, wall)}
    out |= set() if _has_work(scene, wall) else {f"work_{wall.name}"}
    return [column.name for column in observables.of_wall(wall.name) if column.name not in out]


# -- the deck ----------------------------------------------------------------------------------------------


def loads(scene: Scene) -> list[Load]:
    """Every wall whose load is in the thermo lines."""
    return [_load(wall) for wall in _wanted(scene) if _readable(scene, wall)]


def _load(wall: Wall) -> Load:
    if isinstance(wall, Mesh):
        return Load(wall.name, (), tuple(f"f_mesh_{wall.name}[{k}]" for k in range(1, 10)), 1)
    force = [f"f_force_wall_{wall.name}[{k}]" for k in (1, 2, 3)]
    lever = [f"({q}-({number(r)}))" for q, r in zip(foot(wall), wall.torque_point, strict=True)]
    pairs = ((1, 2), (2, 0), (0, 1))
    moments = tuple(f"{lever[i]}*{force[j]}-{lever[j]}*{force[i]}" for i, j in pairs)
    return Load(wall.name, moments, tuple(f"c_load_{wall.name}[{k}]" for k in range(1, 7)), -1)


def written(scene: Scene) -> list[Written]:
    """The walls of which each step's load is written: those with work, and servos for their way."""
    found = []
    for wall in scene.wall_elements:
        servo = wall.name in scene.servos
        worked = wall in _wanted(scene) and _readable(scene, wall) and _has_work(scene, wall)
        worked = worked and wall.name in scene.moving_walls
        if servo or worked:
            ways = [
                f"f_mesh_{wall.name}[{k}]-({number(x)})" for k, x in enumerate(wall.torque_point, 7) if servo
            ]
            found.append(Written(wall.name, tuple(ways), _load(wall).columns[:6]))
    return found


# -- what the binary has written ---------------------------------------------------------------------------


def servo_ways(scene: Scene, folder: Path) -> dict[str, np.ndarray]:
    """How far servos have moved their walls beyond the motions of the scene [m], in every step, by name.

    Shape (steps + 1, 3).
    """
    found = {}
    for wall in scene.wall_elements:
        if wall.name in scene.servos:
            moved = lines(scene, folder, wall.name)[:, 6:]
            point = np.array(wall.torque_point)
            found[wall.name] = moved - (scene.wall_paths[wall.name].at(0, len(moved)).place_of(point) - point)
    return found


def triangle_forces(scene: Scene, folder: Path, step: int) -> dict[str, np.ndarray]:
    """Force of the particles on each triangle at a frame [N], (k, 3), of the meshes of `output.wall_stress`.

    NaN in the set-up, in which the binary does not sum them. Raises LiggghtsOutputError.
    """
    found = {}
    for mesh in scene.meshes:
        if mesh.name in scene.output.wall_stress:
            edges = np.diff(mesh.corners, axis=1)
            area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) / 2
            stress = _stress(folder / f"stress_{mesh.name}_{step:09d}.vtk", len(area))
            found[mesh.name] = stress * area[:, None] if step else np.full((len(area), 3), np.nan)
    return found


def _stress(path: Path, count: int) -> np.ndarray:
    """Force by area of each triangle [Pa], (count, 3), from a binary file of `dump mesh/vtk`."""
    try:
        content = path.read_bytes()
        columns = {}
        for name, kind, width in (("stress", "double", 3), ("meshid", "int", 1)):
            heading = f"{name} {width} {count} {kind}\n".encode()
            at = content.index(heading) + len(heading)
            dtype = ">f8" if kind == "double" else ">i4"
            columns[name] = np.frombuffer(content, dtype, count * width, at).reshape(count, width)
    except (OSError, ValueError) as error:
        raise LiggghtsOutputError(f"{path}: not the stress on {count} triangles: {error}") from None
    order = columns["meshid"][:, 0]
    if not np.array_equal(np.sort(order), np.arange(count)) or not np.isfinite(columns["stress"]).all():
        raise LiggghtsOutputError(f"{path}: not one finite stress for each of {count} triangles")
    stress = np.empty((count, 3))
    stress[order] = columns["stress"]
    return stress


def history(scene: Scene, folder: Path, thermo: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The columns of walls by name, as gpudem's, at the steps of thermo lines.

    thermo: columns by the words of the deck, and `step`. Raises LiggghtsOutputError.
    """
    found: dict[str, np.ndarray] = {}
    for wall in _wanted(scene):
        if not _readable(scene, wall):
            continue
        load = _load(wall)
        table = np.stack([thermo[word] for word in load.columns], axis=1)
        values = load.sign * table[:, :6]
        point = table[:, 6:] if isinstance(wall, Mesh) else np.tile(wall.torque_point, (len(table), 1))
        if isinstance(wall, Mesh):
            values[thermo["step"] == 0] = np.nan  # not summed in the set-up  # mutate: load_in_set_up
        columns = [*values.T, *point.T, _work(scene, wall, folder)[thermo["step"]]]
        known = {c.name: v for c, v in zip(observables.of_wall(wall.name), columns, strict=True)}
        found |= {name: known[name] for name in _names(scene, wall)}
    return found


def _work(scene: Scene, wall: Wall, folder: Path) -> np.ndarray:
    """Work of the wall on the particles since the start in every step [J], shape (steps + 1,)."""
    dt, count = scene.time.step, scene.n_steps + 1
    if wall.name not in scene.moving_walls or not _has_work(scene, wall):
        return np.zeros(count)
    table = lines(scene, folder, wall.name)
    force, torque = _load(wall).sign * table[:, :3], _load(wall).sign * table[:, 3:6]
    power = np.zeros(count)
    if wall.surface_velocity is not None:
        power = force @ np.array(wall.surface_velocity)
    else:
        poses = path(scene, wall.name).at(0, count)
        point = poses.place_of(np.array(wall.torque_point))
        if wall.name in scene.servos:
            point = table[:, 6:] + np.array(wall.torque_point)
        power = np.sum(force * poses.velocity_at(point), axis=1) + np.sum(torque * poses.spin, axis=1)
        power[1:] += np.sum(force[1:] * _servo_velocity(scene, wall, point), axis=1)
    return -np.cumsum(power) * dt  # mutate: work_of_load


def _servo_velocity(scene: Scene, wall: Wall, point: np.ndarray) -> np.ndarray:
    """Velocity of a wall while a servo moves it, otherwise 0, in each step but the set-up [m/s], (steps, 3).

    point: where its torque point is in every step [m].
    """
    found, steps = np.diff(point, axis=0) / scene.time.step, np.arange(1, len(point))
    acts = np.zeros(len(steps), bool)
    begun = {begin for begin, _ in scene.servos.get(wall.name, ())}
    parts = [*(begin for begin, _ in motions(scene).get(wall.name, ())), len(point)]
    for begin, end in itertools.pairwise(parts):
        acts |= (steps > begin) & (steps <= end) & (begin in begun)
    return np.where(acts[:, None], found, 0.0)
