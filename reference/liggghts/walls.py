"""The walls of a scene in LIGGGHTS' words: primitives, meshes and their files, motions, laws of their own.

A deck has one wall of meshes for all of them, so a mesh comes or goes by stating that wall anew. Meshes and
their motions are stated at the start, also those of a mesh that comes later: a motion counts from its `fix`.

Walls that change between runs, as seen in runs of 3.8.0: a mesh whose `move/mesh` is unfixed stays where it
is; a new one begins there with its own time from 0, and in the set-up of that run the mesh has no velocity.
Several of one mesh must be unfixed in the reverse of their order. A `wall/gran` stated again under its name
ends in SIGSEGV; unfixed and stated anew it loses its springs. A mesh with a servo gets no `move/mesh`, so
where one begins or ends the mesh is stated anew, at its place then: a file of the place that stated motions
give it, moved by what servos have added.
"""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np

from gpudem.scene import Plane, Scene
from gpudem.scene.mesh import Mesh
from gpudem.scene.motion import (
    Linear,
    Motion,
    Oscillate,
    Rotate,
    Servo,
    Swing,
    TranslationTable,
    Turn,
    TurnTable,
)
from gpudem.scene.wall_phases import belts_that_change, servos_that_change
from gpudem.scene.walls import Wall
from gpudem.walls.motion import PhasedPath, WallPath
from reference.liggghts.contact_model import atom_type, model, switches

#: Added to a square of a distance [m2], for a division by zero ends the run.
AXIS = "1e-300"
#: Motions that LIGGGHTS has.
MOTIONS = (Linear, Oscillate, Rotate, Swing, TranslationTable, TurnTable, Servo)


@dataclasses.dataclass(frozen=True)
class Primitive:
    """A wall that is no mesh."""

    name: str
    type: int
    """Atom type of its material."""
    shape: str
    """Its words after the type."""
    touches: str
    """Formula of one particle: 1 in contact, else 0."""
    store: str
    """The keyword that keeps its force on each particle, or nothing."""
    model: str
    switches: str


@dataclasses.dataclass(frozen=True)
class MeshWords:
    """A mesh: its file, and its motions as words after `move/mesh mesh ID`."""

    name: str
    style: str
    type: int
    file: str
    belt: str
    """`surface_vel` and its values, or nothing."""
    loads: str
    """Point of its torque, and servo; or nothing."""
    place: tuple[tuple[str, str], ...]
    """Of a mesh stated anew where it then is: (name, words) of the variables that its `move` and point of
    torque read, evaluated before it goes.
    """
    variables: tuple[tuple[str, str], ...]
    """(name, formula) of the variables that its motions read."""
    motions: tuple[str, ...]


@dataclasses.dataclass(frozen=True)
class Change:
    """What happens to the walls between two runs, in this order."""

    removed: tuple[str, ...]
    """Names of primitives that go, or are stated anew."""
    of_meshes: bool
    """The wall of meshes goes, to be stated anew with those that are there then."""
    meshes_before: tuple[str, ...]
    """Names of the meshes that were there."""
    stopped: tuple[str, ...]
    """Names of the motions of meshes that end."""
    anew: tuple[MeshWords, ...]
    """Meshes with another belt, or of which a servo begins or ends."""
    started: tuple[MeshWords, ...]
    """Meshes with other motions."""
    meshes: tuple[str, ...]
    """Names of those that are there from now on."""
    added: tuple[Primitive, ...]
    """Primitives that come, or are stated anew."""


def number(value: float) -> str:
    """Shortest text that reads back exactly."""
    return repr(float(value))


def vector(values: np.ndarray | tuple[float, ...]) -> str:
    """Three numbers."""
    return " ".join(number(v) for v in values)


def mesh_file(name: str, phase: int = 0) -> str:
    """Name of the file of a mesh in the run directory, of one that is stated anew in a phase from 1."""
    return f"mesh_{name}_from_{phase}.stl" if phase else f"mesh_{name}.stl"


def mesh_files(scene: Scene) -> dict[str, str]:
    """Name and text of the file of each mesh, and of each that is stated anew where motions have moved it."""
    found = {mesh_file(mesh.name): stl(mesh.name, mesh.corners) for mesh in scene.meshes}
    for k, step in enumerate(scene.phase_steps, 1):
        for mesh in scene.meshes:
            if mesh.name in servos_that_change(scene, step):
                pose = path(scene, mesh.name).at(step, 1)
                corners = mesh.corners @ pose.rotation[0].T + pose.shift[0]  # mutate: place_of_mesh_anew
                found[mesh_file(mesh.name, k)] = stl(mesh.name, corners)
    return found


def primitives(scene: Scene, phase: Scene | None = None) -> dict[str, Primitive]:
    """Every wall that is no mesh, by name, as it is at the start or in a phase."""
    return {
        wall.name: Primitive(
            wall.name, atom_type(scene, wall), *_shape(wall),
            " store_force yes" if wall.name in scene.output.wall_forces else "",
            model(scene, wall), switches(scene, wall),
        )
        for wall in (phase or scene).wall_elements
        if not isinstance(wall, Mesh)
    }  # fmt: skip


def _shape(wall: Wall) -> tuple[str, str]:
    """(words, formula of a contact) of a plane across an axis, or of an endless cylinder along one."""
    return _plane(wall) if isinstance(wall, Plane) else _cylinder(wall)


def _plane(plane: Plane) -> tuple[str, str]:
    """LIGGGHTS' planes act on both sides: the facing is only for counting contacts."""
    k = axis_of(plane.normal)
    facing = 1 if plane.normal[k] > 0 else -1
    at = number(plane.point[k])
    return f"{'xyz'[k]}plane {at}{_shear(plane)}", f"{facing}*({'xyz'[k]}-({at})) <= c_radius"


def _cylinder(wall: Wall) -> tuple[str, str]:
    """LIGGGHTS wants the two coordinates of the axis in cyclic order: y z, z x, x y."""
    axis, point, (radius, *_) = wall.shape()
    k = axis_of(axis)
    across = [(k + 1) % 3, (k + 2) % 3]  # mutate: order_of_cylinder_center
    center = [number(point[j]) for j in across]
    distance = "+".join(f"({'xyz'[j]}-({c}))*({'xyz'[j]}-({c}))" for j, c in zip(across, center, strict=True))
    apart = f"sqrt({distance})-{number(radius)}"
    return (
        f"{'xyz'[k]}cylinder {number(radius)} {' '.join(center)}{_shear(wall)}",
        f"({apart} <= c_radius)*(-({apart}) <= c_radius)",
    )


def foot(wall: Wall) -> list[str]:
    """Formulas of the point [m] of a primitive nearest to a particle."""
    if isinstance(wall, Plane):
        k = axis_of(wall.normal)
        return [number(wall.point[k]) if j == k else "xyz"[j] for j in range(3)]
    axis, point, (radius, *_) = wall.shape()
    k, found = axis_of(axis), list("xyz")
    across = {j: f"({'xyz'[j]}-({number(point[j])}))" for j in range(3) if j != k}
    distance = f"sqrt({'+'.join(f'{a}*{a}' for a in across.values())}+{AXIS})"
    for j, away in across.items():
        found[j] = f"({number(point[j])})+({number(radius)})*{away}/{distance}"
    return found


def _shear(wall: Wall) -> str:
    """The belt of a primitive: LIGGGHTS knows one along an axis."""
    if wall.surface_velocity is None:
        return ""
    k = axis_of(wall.surface_velocity)
    return f" shear {'xyz'[k]} {number(wall.surface_velocity[k])}"


def axis_of(direction: tuple[float, ...]) -> int:
    """The first axis along which a direction has a component."""
    return next(k for k in range(3) if direction[k] != 0)


def meshes(scene: Scene, phase: int = 0) -> list[MeshWords]:
    """Every mesh in order of statement, as it is at the start (0) or in a phase, counted from 1."""
    found, start = [], [0, *scene.phase_steps][phase]
    for place, mesh in zip(scene.meshes, scene.phase_scenes[phase].meshes, strict=True):
        variables: list[tuple[str, str]] = []
        servo = next((m for m in mesh.motion if isinstance(m, Servo)), None)
        moves = range(0 if servo else len(mesh.motion))
        motions = [_motion(scene, mesh, k, variables, phase, start) for k in moves]
        asked = mesh.name in (*scene.output.wall_forces, *scene.output.wall_stress, *scene.servos)
        anew = bool(phase) and mesh.name in servos_that_change(scene, start)
        at = _place_then(scene, place, phase, start) if anew else ()
        style, words = _load(place, servo, phase if anew else 0) if servo or asked else ("", "")
        belt = "" if mesh.surface_velocity is None else f" surface_vel {vector(mesh.surface_velocity)}"
        kind, name = atom_type(scene, mesh), mesh_file(mesh.name, phase if anew else 0)
        style = f"mesh/surface{style}"
        found.append(
            MeshWords(mesh.name, style, kind, name, belt, words, at, tuple(variables), tuple(motions))
        )
    return found


def _place_then(scene: Scene, mesh: Mesh, phase: int, step: int) -> tuple[tuple[str, str], ...]:
    """Variables with all digits: where the torque point of a mesh is at the start of a phase [m], and how far
    servos have moved it beyond its stated motions.
    """
    stated, found = path(scene, mesh.name).at(step, 1).place_of(np.array(mesh.torque_point))[0], []
    for k, x in enumerate(stated.tolist()):
        name, now = f"{mesh.name}_{phase}_{'xyz'[k]}", f"f_mesh_{mesh.name}[{k + 7}]"
        found += [(f"point_{name}", f"$({now})"), (f"moved_{name}", f"$({now}-({number(x)}))")]
    return tuple(found)


def _load(mesh: Mesh, servo: Servo | None, phase: int) -> tuple[str, str]:
    """(end of the style, words) of a mesh on which forces are summed; the point moves with it. phase: the one
    in which it is stated anew where it then is, or 0.
    """
    point = vector(mesh.torque_point)
    if phase:
        point = " ".join(f"${{point_{mesh.name}_{phase}_{axis}}}" for axis in "xyz")
    if servo is None:
        return "/stress", f" reference_point {point}"
    return "/stress/servo", (
        f" com {point} ctrlPV force axis {vector(servo.axis)} target_val {number(servo.target)}"
        f" vel_max {number(servo.velocity_limit)} kp {number(servo.kp)} ki {number(servo.ki)}"
        f" kd {number(servo.kd)}"
    )


def _motion(
    scene: Scene, mesh: Mesh, k: int, variables: list[tuple[str, str]], phase: int, start: int
) -> str:
    """The words of motion k of a mesh in a phase that begins with step `start`; the variables it reads are
    added to the list.
    """
    motion: Motion = mesh.motion[k]
    name = f"{mesh.name}_{k + 1}" + (f"_from_{phase}" if phase else "")
    now = f"{f'(step-{start})' if start else 'step'}*{number(scene.time.step)}"
    if isinstance(motion, Linear):
        return f"linear {vector(motion.velocity)}"
    if isinstance(motion, Oscillate):
        return f"wiggle amplitude {vector(motion.amplitude)} period {number(motion.period)}"
    if isinstance(motion, TranslationTable):
        names = [_table(now, f"{name}_{a}", motion.time, motion.velocity[:, i], variables)
                 for i, a in enumerate("xyz")]  # fmt: skip
        return f"linear/variable {' '.join(names)}"
    assert isinstance(motion, Turn), f"{motion.type}: refused by limits.check"
    axis = f"origin {vector(motion.point)} axis {vector(motion.axis)}"
    if isinstance(motion, Rotate):
        return f"rotate {axis} period {number(motion.period)}"
    if isinstance(motion, Swing):
        angle = math.degrees(motion.amplitude)  # mutate: swing_in_degrees
        return f"riggle {axis} period {number(motion.period)} amplitude {number(angle)}"
    assert isinstance(motion, TurnTable)
    omega = _table(now, name, motion.time, motion.angular_velocity, variables)
    return f"rotate/variable {axis} omega {omega}"


def _table(
    now: str, name: str, time: np.ndarray, values: np.ndarray, variables: list[tuple[str, str]]
) -> str:
    """A piecewise linear function of a time, stated as a formula, as variables, one a piece, each with those
    before it: `v_...`.
    """
    pieces = [f"({now}<{number(time[0])})*({number(values[0])})"]
    for (t, s), (a, b) in zip(itertools.pairwise(time), itertools.pairwise(values), strict=True):
        slope = f"({number((b - a) / (s - t))})*({now}-({number(t)}))+({number(a)})"
        pieces.append(f"({now}>={number(t)})*({now}<{number(s)})*({slope})")
    pieces.append(f"({now}>={number(time[-1])})*({number(values[-1])})")
    for k, piece in enumerate(pieces):
        before = f"v_{name}_{k - 1}+" if k else ""
        variables.append((f"{name}_{k}", before + piece))
    return f"v_{name}_{len(pieces) - 1}"


def same_meshes(scene: Scene) -> bool:
    """Whether no mesh comes, goes or is stated anew; only then LIGGGHTS can count contacts with them.

    It wants the compute before the first run, and removes no wall of meshes that a compute reads.
    """
    return bool(scene.meshes) and not any(change.of_meshes for change in changes(scene))


def changes(scene: Scene) -> list[Change]:
    """What happens to the walls before each run but the first."""
    names = {mesh.name for mesh in scene.meshes}
    found = []
    for (earlier, _, before), (first, _, after) in itertools.pairwise(scene.segments):
        old, new = [w.name for w in before], [w.name for w in after]
        old_meshes, new_meshes = [n for n in old if n in names], [n for n in new if n in names]
        last, phase = scene.phase_after(earlier), scene.phase_after(first)
        belts = belts_that_change(last, phase)
        servos = servos_that_change(scene, first)
        stopped, anew, started = _of_meshes(scene, first, belts | servos)
        shapes = primitives(scene, phase)
        found.append(
            Change(
                removed=tuple(n for n in old if n not in names and (n not in new or n in belts)),
                of_meshes=old_meshes != new_meshes or bool((belts | servos) & {*old_meshes}),
                meshes_before=tuple(old_meshes),
                stopped=stopped, anew=anew, started=started,
                meshes=tuple(new_meshes),
                added=tuple(shapes[n] for n in new if n not in names and (n not in old or n in belts)),
            )
        )  # fmt: skip
    return found


def _of_meshes(
    scene: Scene, first: int, restated: set[str]
) -> tuple[tuple[str, ...], tuple[MeshWords, ...], tuple[MeshWords, ...]]:
    """Motions that end in a step, meshes stated anew, and meshes whose motions start there."""
    if first not in scene.phase_steps:
        return (), (), ()
    k = scene.phase_steps.index(first)
    moved = {change.name for change in scene.phases[k].walls if change.motion is not None}
    words = meshes(scene, k + 1)
    before = [mesh for mesh in scene.phase_scenes[k].meshes if mesh.name in moved]
    before = [mesh for mesh in before if not any(isinstance(motion, Servo) for motion in mesh.motion)]
    # mutate: order_of_motions_that_stop
    stopped = tuple(f"{mesh.name}_{m}" for mesh in before for m in reversed(range(1, len(mesh.motion) + 1)))
    anew = tuple(mesh for mesh in words if mesh.name in restated)
    return stopped, anew, tuple(mesh for mesh in words if mesh.name in moved)


def path(scene: Scene, name: str) -> WallPath | PhasedPath:
    """Where the motions of a wall take it in LIGGGHTS."""
    return scene.paths_of_walls(sums=True)[name]


def stl(name: str, corners: np.ndarray) -> str:
    """Triangles, (k, 3, 3) [m], as an ASCII STL file, 17 digits, in their order."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = normal / np.where(size > 0, size, 1.0)
    lines = [f"solid {name}"]
    for n, triangle in zip(normal.tolist(), corners.tolist(), strict=True):
        lines.append("facet normal {:.17g} {:.17g} {:.17g}\nouter loop".format(*n))
        lines += ["vertex {:.17g} {:.17g} {:.17g}".format(*corner) for corner in triangle]
        lines.append("endloop\nendfacet")
    return "\n".join([*lines, f"endsolid {name}", ""])
