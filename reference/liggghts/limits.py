"""What LIGGGHTS 3.8.0 refuses or has no words for, said before the deck is written, in the scene's terms."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from gpudem.scene import Pair, Plane, Scene
from gpudem.scene.laws import acting
from gpudem.scene.mesh import Mesh
from gpudem.scene.motion import Servo
from gpudem.scene.wall_phases import belts_that_change, servos_that_change
from gpudem.scene.walls import Wall
from reference.liggghts import flow, groups, mesh_reach, removal, wall_loads
from reference.liggghts.contact_model import laws_of, pairs_of
from reference.liggghts.errors import LiggghtsCannotState
from reference.liggghts.insertion import MOST
from reference.liggghts.walls import MOTIONS, same_meshes

#: LIGGGHTS: `ERROR: 0.05 < coefficientRestitution <= 1 required` (fix property/global, SI units).
MIN_RESTITUTION = 0.05
#: LIGGGHTS: `ERROR: characteristicVelocity >= 1e-2 required for SI units` [m/s].
MIN_CHARACTERISTIC_VELOCITY = 0.01
#: LIGGGHTS: `rollingStiffness` below 1 is refused in SI units [1].
MIN_ROLLING_STIFFNESS = 1.0


def warnings(scene: Scene) -> list[str]:
    """What LIGGGHTS does otherwise than the scene says, one sentence each.

    Its tangential law `history` applies the dashpot at each set-up without regard to friction, and one deck
    cannot give some pairs of particles another tangential law (pair_style hybrid of two `gran` crashes). Its
    rule of mesh contacts is its own.
    """
    found = []
    if scene.meshes and scene.contact.mesh_contacts != "liggghts":
        found.append(
            f"contact.mesh_contacts = {scene.contact.mesh_contacts!r}: LIGGGHTS has a rule of its own, which"
            " depends on the order of the triangles; mesh_contacts = 'liggghts' has gpudem follow it"
        )
    for mesh in scene.meshes:
        if sum(motion.turns for motion in mesh.motion) > 1:
            found.append(
                f"walls.{mesh.name}.motion: two turns: LIGGGHTS gives the mesh the velocity of the first"
                " before the second has turned it in the step; contact velocities differ by angular"
                " velocity times time step"
            )
    if scene.meshes and not same_meshes(scene) and scene.output.history_every is not None:
        found.append(
            "history column 'contacts' is left out: LIGGGHTS cannot count contacts with meshes that come"
            " or go, whose belt changes, or of which a servo begins or ends"
        )
    for name, servo in ((name, servo) for name, parts in scene.servos.items() for _, servo in parts):
        if servo.ki > 0 and scene.contact.mesh_contacts != "liggghts":
            found.append(
                f"walls.{name}.motion: ki = {servo.ki:g} 1/s: where the controller is"
                " at its limit LIGGGHTS resets the integral so that the wall goes the other way;"
                " mesh_contacts = 'liggghts' has gpudem follow it"
            )
    if scene.contact.mesh_contacts != "liggghts":
        found += _lost_springs(scene)
    found += [
        *wall_loads.warnings(scene),
        *groups.warnings(scene),
        *removal.warnings(scene),
    ]
    contact = scene.contact
    at_setup = scene.needs.history and contact.tangential_damping and not contact.frictionless_dashpot
    kinds = scene.contact_groups.items()
    with_history = [pairs for names, pairs in kinds if acting(names, pairs).history]
    without = [p.pair for pairs in with_history for p in pairs if p.pair.friction == 0] if at_setup else []
    if without and (len(scene.segments) > 1 or scene.start_overlap > 0):
        names = ", ".join(dict.fromkeys(" / ".join(pair.materials) for pair in without))
        found.append(
            f"pairs {names}: friction = 0 beside pairs with friction: LIGGGHTS applies its tangential dashpot"
            " to their contacts at each set-up; contact.frictionless_dashpot = true does so in gpudem"
        )
    return found


def _lost_springs(scene: Scene) -> Iterator[str]:
    """A wall with another belt, or whose servo begins or ends, is stated anew, and loses its springs."""
    for k, (before, after) in enumerate(itertools.pairwise(scene.phase_scenes)):
        for name in sorted(belts_that_change(before, after)):
            yield (
                f"phases[{k}].walls: {name}.surface_velocity: LIGGGHTS states the wall anew, and its contacts"
                " lose their springs; mesh_contacts = 'liggghts' has gpudem follow it"
            )
    for k, step in enumerate(scene.phase_steps):
        for name in sorted(servos_that_change(scene, step)):
            yield (
                f"phases[{k}].walls: {name}.motion: where a servo begins or ends LIGGGHTS states the mesh"
                " anew, and the contacts of all meshes lose their springs; mesh_contacts = 'liggghts' has"
                " gpudem follow it"
            )


def check(scene: Scene, ranks: int = 1) -> None:
    """Raises LiggghtsCannotState listing every item of the scene that LIGGGHTS cannot state."""
    found = [
        *_pairs(scene),
        *_laws(scene),
        *_insertions(scene, ranks),
        *removal.problems(scene),
        *flow.problems(scene),
        *_groups(scene),
    ]
    for wall in (wall for at in scene.phase_scenes for wall in at.wall_elements):
        if isinstance(wall, Plane):
            found += [f"walls.{wall.name}{problem}" for problem in _plane(wall)]
        elif isinstance(wall, Mesh):
            found += [f"walls.{wall.name}{problem}" for problem in _mesh(scene, wall)]
        elif wall.kind == "cylinder":
            found += [f"walls.{wall.name}{problem}" for problem in _cylinder(wall)]
        else:
            found.append(
                f"walls.{wall.name}.kind = {wall.kind!r}: LIGGGHTS gets planes, endless cylinders and meshes"
            )
    found += [*_belts_of_meshes(scene), *_servos(scene), *_laws_of_meshes(scene)]
    found = list(dict.fromkeys(found))
    if found:
        raise LiggghtsCannotState(
            "\n".join(["LIGGGHTS cannot state this scene:", *(f"  - {f}" for f in found)])
        )


def _pairs(scene: Scene) -> Iterator[str]:
    reads = {key for names in scene.contact_groups for key in names.normal_law.reads}
    groups = scene.contact_groups.items()
    damped = [p.pair for names, pairs in groups for p in pairs if "restitution" in names.normal_law.reads]
    for pair in dict.fromkeys(id(p) for p in damped if p.restitution <= MIN_RESTITUTION):
        yield _restitution(next(p for p in damped if id(p) == pair))
    speed = scene.contact.characteristic_velocity
    if "characteristic_velocity" in reads and speed is not None and speed < MIN_CHARACTERISTIC_VELOCITY:
        yield (
            f"contact.characteristic_velocity = {speed:g} m/s: LIGGGHTS wants at least"
            f" {MIN_CHARACTERISTIC_VELOCITY:g} m/s"
        )


def _laws(scene: Scene) -> Iterator[str]:
    for law in scene.laws:
        if law.liggghts is None:
            yield f"contact.{law.slot} = {law.name!r}: LIGGGHTS has no such law"
            continue
        for kind, _, value, _ in law.liggghts.properties:
            stated = sorted({value(pair) for pair in pairs_of(scene, law)}) if kind == "common" else []
            if len(stated) > 1:
                yield (
                    f"pairs.{law.parameters[-1].name}: {', '.join(f'{s:g}' for s in stated)} with"
                    f" contact.{law.slot} = {law.name!r}: LIGGGHTS has one number for all pairs"
                )
            elif stated and stated[0] < MIN_ROLLING_STIFFNESS:
                yield (
                    f"pairs.{law.parameters[-1].name} = {stated[0]:g}: LIGGGHTS wants at least"
                    f" {MIN_ROLLING_STIFFNESS:g}"
                )


def _insertions(scene: Scene, ranks: int) -> Iterator[str]:
    inserted = len(scene.state) - scene.start_count
    if inserted > MOST:
        yield f"insert: {inserted} particles; each is a fix of its own: allowed: <= {MOST}"
    if inserted and ranks > 1:
        yield f"insert: on {ranks} MPI ranks LIGGGHTS draws other places; allowed: 1"


def _groups(scene: Scene) -> Iterator[str]:
    if len(scene.groups) > groups.MOST:
        yield f"groups: {len(scene.groups)}; allowed: <= {groups.MOST}"
    yield from filter(None, map(groups.cannot, scene.groups))


def _plane(plane: Plane) -> Iterator[str]:
    """What LIGGGHTS has no words for, after the name of the plane."""
    if sum(c != 0 for c in plane.normal) != 1:
        yield (
            f": normal {plane.normal}: LIGGGHTS has planes across x, y or z only"
            " (a tilted wall would need a mesh); tilt gravity instead"
        )
    if plane.vibration:
        yield ".vibration: LIGGGHTS has no saw-tooth motion of a plane"
    if plane.motion:
        yield ".motion: LIGGGHTS moves meshes only; state the plane as a mesh"
    belt = plane.surface_velocity
    if belt is not None:
        along = [k for k in range(3) if belt[k] != 0]
        if len(along) != 1 or plane.normal[along[0]] != 0:
            yield (
                f".surface_velocity = {belt} m/s: LIGGGHTS moves the surface of a plane along one axis in it"
                " only; state the plane as a mesh"
            )


def _cylinder(wall: Wall) -> Iterator[str]:
    """What LIGGGHTS has no words for, after the name of the cylinder."""
    axis, _, (_, length, _) = wall.shape()
    if length > 0:
        yield f".length = {length:g} m: LIGGGHTS has endless cylinders only; state it as a mesh"
    if sum(c != 0 for c in axis) != 1:
        yield f".axis: {axis}: LIGGGHTS has cylinders along x, y or z only; state it as a mesh"
    if wall.motion:
        yield (
            ".motion: LIGGGHTS moves meshes only; the surface of a cylinder that slides along its axis is"
            " surface_velocity, one that turns gets the wrong speed there, omega times the distance of the"
            " particle's center from the axis; state it as a mesh"
        )
    belt = wall.surface_velocity
    if belt is not None and any(b != 0 and a == 0 for a, b in zip(axis, belt, strict=True)):
        yield f".surface_velocity = {belt} m/s: LIGGGHTS moves the surface of a cylinder along its axis only"


def _mesh(scene: Scene, mesh: Mesh) -> Iterator[str]:
    """What LIGGGHTS has no words for, after the name of the mesh."""
    yield from mesh_reach.problems(scene, mesh.name)
    if mesh.motion and mesh.surface_velocity is not None:
        yield ".surface_velocity: LIGGGHTS has no belt on a mesh that moves"
    for k, motion in enumerate(mesh.motion):
        limit = scene.skin / (2 * scene.time.step)
        if isinstance(motion, Servo) and motion.velocity_limit >= limit:
            yield (
                f".motion[{k}].velocity_limit = {motion.velocity_limit:g} m/s: LIGGGHTS wants less than half"
                f" the skin in a step, {limit:g} m/s"
            )
        if not isinstance(motion, MOTIONS):
            yield f".motion[{k}].type = {motion.type!r}: LIGGGHTS has no such motion"


def _belts_of_meshes(scene: Scene) -> Iterator[str]:
    """A mesh with another belt is read anew from its file."""
    for before, after in itertools.pairwise(scene.phase_scenes):
        for mesh in scene.meshes:
            if mesh.name not in belts_that_change(before, after):
                continue
            key = f"walls.{mesh.name}.surface_velocity"
            if mesh.name in scene.wall_paths:
                yield f"{key}: changes in a phase: LIGGGHTS states the mesh anew, at its place at the start"
            if mesh.name in scene.output.wall_stress:
                yield f"{key}: changes in a phase: LIGGGHTS states no mesh anew whose stress is written"


def _servos(scene: Scene) -> Iterator[str]:
    """LIGGGHTS has a servo only on a mesh that is there, and one that begins or ends restates the mesh."""
    for first, _, present in scene.segments:
        at = scene.phase_after(first).meshes
        names = {mesh.name for mesh in at if any(isinstance(motion, Servo) for motion in mesh.motion)}
        for name in sorted(names - {wall.name for wall in present}):
            yield (
                f"walls.{name}.motion: a servo from {first * scene.time.step:g} s on, where the mesh is not"
                " there: LIGGGHTS ends such a run; let a phase begin the servo when the mesh comes, or end it"
                " when the mesh goes"
            )
    for k, step in enumerate(scene.phase_steps):
        for name in sorted(servos_that_change(scene, step) & {*scene.output.wall_stress}):
            yield (
                f"phases[{k}].walls: {name}.motion: a servo begins or ends: LIGGGHTS states no mesh anew"
                " whose stress is written"
            )


def _laws_of_meshes(scene: Scene) -> Iterator[str]:
    """One deck has one wall of meshes, and so one law for all of them."""
    usual = [laws_of(scene, mesh) for mesh in scene.meshes]
    for mesh, names in zip(scene.meshes, usual, strict=True):
        if names != usual[0]:
            yield (
                f"walls.{mesh.name}.contact: LIGGGHTS has one contact law for all meshes; that of"
                f" {scene.meshes[0].name} is another one"
            )


def _restitution(pair: Pair) -> str:
    names = " / ".join(pair.materials)
    return (
        f"pairs {names}: restitution = {pair.restitution:g}:"
        f" LIGGGHTS wants {MIN_RESTITUTION:g} < restitution <= 1"
    )
