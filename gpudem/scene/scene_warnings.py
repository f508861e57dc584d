"""Warnings of a valid scene: settings without effect, rounded and extended times, a scene that cannot move.

Each function reads a scene and returns sentences, each naming key, value and reason. A value at its default
is no setting: a scene does not record whether it was stated.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from gpudem.contact import registry
from gpudem.contact.law import Slot, TangentialLaw
from gpudem.contact.names import LawNames
from gpudem.scene import wall_phases
from gpudem.scene.groups import INSTEAD
from gpudem.scene.laws import stated_laws
from gpudem.scene.mesh import Mesh
from gpudem.scene.mesh_repair import oddities
from gpudem.scene.round_walls import Cylinder
from gpudem.scene.sections import OF_MESHES, FromFile, Lattice
from gpudem.scene.time_step import position_spacing, step_for
from gpudem.scene.walls import Plane, Wall

if TYPE_CHECKING:
    from gpudem.scene.model import Scene
    from gpudem.scene.sections import Pair

#: Rounding to whole steps that changes a time by more than this share is warned of.
ROUNDING = 1e-2
#: So is an extension to whole frames by more than half a step and this share.
EXTENSION = 1e-3
#: Keys of `[contact]` that only one rule of mesh contacts reads.
RULE_OF = {"merge_angle": "unique", "mesh_curvature": "liggghts"}
#: Bytes of a frame for each particle.
FRAME_BYTES = 150
#: Bytes of a triangle in the tables of the device, search tree included (in float64).
TRIANGLE_BYTES = 210
#: Frames, and meshes, above this size [bytes] are warned of.
MANY_BYTES = 2e9


# -- settings without effect ---------------------------------------------------------------------------------


def without_effect(scene: Scene) -> list[str]:
    """Settings that nothing in this scene reads, or that cannot act in it."""
    checks = (_materials, _pairs, _contact, _laws_of_walls, _particles, _groups, _walls, _solver)
    return [sentence for check in checks for sentence in check(scene)]


def _materials(scene: Scene) -> Iterator[str]:
    walls = (wall for at in scene.phase_scenes for wall in at.walls)
    used = {*scene.particle_materials, *(wall.material for wall in walls)}
    for name in scene.materials:
        if name not in used:
            yield f"materials.{name}: no effect, nor have its pairs: no particle and no wall is made of it"


def _read_by_laws(groups: Iterable[LawNames]) -> set[str]:
    """The fields of pairs and of the contact that these laws read."""
    return {key for names in groups for law in names.laws for key in law.reads}


def _parameters(groups: Iterable[LawNames]) -> dict[str, Slot]:
    """The further keys of pairs that these laws read -> the slot of the law."""
    laws = (law for names in groups for law in names.laws)
    return {p.name: law.slot for law in laws for p in law.parameters if p.where == "pair"}


#: Key of a pair -> the slot of the laws that may read it; all others belong to the normal law.
_SLOT = {"friction": "tangential", "rolling_friction": "rolling"}
#: Slot -> the key of a pair without which its laws do not act.
_ACTS_BY = {"tangential": "friction", "rolling": "rolling_friction", "cohesion": "cohesion_energy_density"}


def _pairs(scene: Scene) -> Iterator[str]:
    """Of the pairs that can touch, one sentence a reason; pairs of walls only complete the table."""
    unread: dict[tuple[tuple[str, ...], str], list[Pair]] = {}
    for pair in scene.contact_pairs:
        for keys, reason in _unread(scene, pair):
            unread.setdefault((keys, reason), []).append(pair)
    for (keys, reason), pairs in unread.items():
        names = ", ".join(" / ".join(pair.materials) for pair in pairs[:3])
        if len(pairs) == 1:
            stated = ", ".join(f"{key} = {getattr(pairs[0], key):g}" for key in keys)
            yield f"pairs {names}: {stated}: no effect {reason}"
        else:
            more = f" and {len(pairs) - 3} more" if len(pairs) > 3 else ""
            yield f"pairs {names}{more}: {', '.join(keys)}: no effect {reason}"


def _unread(scene: Scene, pair: Pair) -> Iterator[tuple[tuple[str, ...], str]]:
    """(keys, why) of the properties of one pair that do not act in its contacts."""
    groups = [n for n, inputs in scene.contact_groups.items() if any(p.pair is pair for p in inputs)]
    read = _read_by_laws(groups)
    unread: dict[str, list[str]] = {}
    for key, field in type(pair).model_fields.items():
        if key != "materials" and getattr(pair, key) != field.default and key not in read:
            unread.setdefault(_SLOT.get(key, "normal"), []).append(key)
    known, here = _parameters(scene.contact_groups), _parameters(groups)
    for key in pair.model_extra or {}:
        if key in known and key not in here:
            unread.setdefault(known[key], []).append(key)
    for slot, keys in unread.items():
        yield tuple(keys), f"with contact.{slot} = {getattr(groups[0], slot)!r}"
    if pair.friction > 0 and "friction" in read:
        reasons = [_no_tangential_force(scene, pair, names) for names in groups]
        if all(reasons):
            yield ("friction",), reasons[0]


def _no_tangential_force(scene: Scene, pair: Pair, names: LawNames) -> str:
    """Why a pair with friction has no tangential force under these laws; empty where it has one."""
    law, normal = registry.find("tangential", names.tangential), names.normal_law
    acts = law.acts_by if isinstance(law, TangentialLaw) else ()
    constants = normal.coefficients_of(scene.inputs(*pair.materials))
    if not scene.contact.tangential_damping:
        constants["c_tangential"] = 0.0
    if not acts or any(constants[name] > 0 for name in acts):
        return ""
    if "k_tangential" in acts:
        return "without tangential stiffness and damping"
    why = "restitution = 1" if "restitution" in normal.reads else "gamma_t = 0"
    if not scene.contact.tangential_damping:
        why = "contact.tangential_damping = false"
    return f"with contact.tangential = 'no_history', a dashpot, which is zero with {why}"


def _contact(scene: Scene) -> Iterator[str]:
    contact, needs, read = scene.contact, scene.needs, _read_by_laws(scene.contact_groups)
    frictionless = not any(pair.friction > 0 for pair in scene.contact_pairs)
    if "rolling_friction" in _read_by_laws([stated_laws(scene)]) and scene.acting_laws.rolling == "off":
        yield f"contact.rolling = {contact.rolling!r}: no effect, no pair has rolling_friction"
    if _ACTS_BY["cohesion"] in _parameters([stated_laws(scene)]) and scene.acting_laws.cohesion == "off":
        yield f"contact.cohesion = {contact.cohesion!r}: no effect, no pair has {_ACTS_BY['cohesion']}"
    if contact.tangential_reduce and not needs.cohesion:
        yield "contact.tangential_reduce = true: no effect without cohesion"
    if contact.torsion and not needs.rolling:
        yield "contact.torsion = true: no effect without rolling friction"
    if contact.limit_force and not needs.damping and scene.contact_range == 0:
        yield "contact.limit_force = true: no effect, a normal force without damping does not attract"
    if not contact.tangential_damping and (frictionless or "tangential_damping" not in read):
        reason = "no pair has friction" if frictionless else f"contact.tangential = {contact.tangential!r}"
        yield f"contact.tangential_damping = false: no effect, {reason}"
    if contact.characteristic_velocity is not None and "characteristic_velocity" not in read:
        yield (
            f"contact.characteristic_velocity = {contact.characteristic_velocity:g} m/s: no effect with"
            f" contact.normal = {contact.normal!r}"
        )


def _laws_of_walls(scene: Scene) -> Iterator[str]:
    """Laws of a wall that are those of the particles, or that act in none of its contacts."""
    usual = stated_laws(scene)
    for wall in scene.wall_elements:
        names = stated_laws(scene, wall)
        own = {slot: name for slot, name in (wall.contact or ()) if name is not None}
        if own and names == usual:
            text = ", ".join(f"{slot} = {name!r}" for slot, name in own.items())
            yield f"walls: {wall.name}.contact: {text}: no effect, so it is in [contact]"
        elif own:
            acting = scene.wall_laws.get(wall.name, scene.acting_laws)
            for slot, key in _ACTS_BY.items():
                if slot in own and getattr(names, slot) != getattr(acting, slot):
                    yield f"walls: {wall.name}.contact.{slot} = {own[slot]!r}: no effect, no pair has {key}"


def _particles(scene: Scene) -> Iterator[str]:
    particles = scene.particles
    if isinstance(particles, FromFile):
        yield from scene.particle_file.warnings
    if not isinstance(particles, Lattice):
        return
    shifted = particles.jitter > 0 and particles.spacing > 1
    if particles.jitter > 0 and not shifted:
        yield (
            f"particles.jitter = {particles.jitter:g}: no effect with spacing = 1, which leaves no gap;"
            " state jitter = 0"
        )
    mixed = not isinstance(particles.radius, float)
    if particles.seed and not (shifted or mixed or particles.velocity_rms):
        yield (
            f"particles.seed = {particles.seed}: no effect, nothing is random without jitter, several radii"
            " or velocity_rms"
        )
    if isinstance(particles.radius, tuple):
        drawn = set(np.unique(scene.state.radius).tolist())
        for k, part in enumerate(particles.radius):
            if part.radius not in drawn:
                yield (
                    f"particles.radius[{k}] = {part.radius:g} m:"
                    f" none of the {particles.count} particles has it; its share is {part.share:g}"
                )


def _groups(scene: Scene) -> Iterator[str]:
    """Groups that would have particles of the insertions too, which stay free."""
    later, first = scene.stated_particles, scene.start_count
    for k, group in enumerate(scene.groups):
        if group.ids is not None or not scene.insert:
            continue
        more = np.ones(len(later) - first, bool)
        if group.material is not None:
            more &= later.material[first:] == scene.material_index[group.material]
        if group.region is not None:
            more &= group.region.depth(later.position[first:]) >= 0
        if more.any():
            yield (
                f"groups[{k}]: no effect on {int(more.sum())} particles that are inserted during the run and"
                f" would be in {group.name!r}: they stay free; {INSTEAD}"
            )


def _walls(scene: Scene) -> Iterator[str]:
    contact, smallest = scene.contact, float(scene.state.radius.min())
    for key in OF_MESHES:
        stated, rule = getattr(contact, key), RULE_OF.get(key, contact.mesh_contacts)
        belts = key == "mesh_contacts" and wall_phases.belts_change(scene)
        if stated != type(contact).model_fields[key].default and not (scene.meshes or belts):
            yield f"contact.{key} = {stated!r}: no effect, no wall is a mesh"
        elif stated != type(contact).model_fields[key].default and rule != contact.mesh_contacts:
            yield f"contact.{key} = {stated!r}: no effect with mesh_contacts = {contact.mesh_contacts!r}"
    for wall in (wall for at in scene.phase_scenes for wall in at.walls):
        if wall.surface_velocity is not None and not scene.needs.tangential:
            yield f"walls: {wall.name}.surface_velocity: no effect, no pair has friction"
        if isinstance(wall, Plane) and wall.surface_velocity is not None:
            if not np.cross(wall.surface_velocity, wall.normal).any():
                yield f"walls: {wall.name}.surface_velocity: no effect, it is along the normal"
    for wall in scene.walls:
        if isinstance(wall, Cylinder) and wall.radius < smallest:
            yield (
                f"walls: {wall.name}.radius = {wall.radius:g} m: below that of the smallest particle,"
                f" {smallest:g} m; none fits inside"
            )
        if isinstance(wall, Mesh):
            for note in (*wall.surface.notes, *oddities(wall.corners, smallest)):
                yield f"walls: {wall.name}: {note}"


def _solver(scene: Scene) -> Iterator[str]:
    accuracy = scene.time.accuracy
    if accuracy is not None:
        automatic = step_for(scene, accuracy)
        if abs(scene.time.step - automatic) > 1e-9 * automatic:
            yield (
                f"time.accuracy = {accuracy:g}: no effect beside time.step = {scene.time.step:g} s;"
                f" step = 'auto' would give {automatic:.3g} s"
            )
    if scene.solver.integrator == "path" and not (scene.needs.damping or scene.needs.tangential):
        yield "solver.integrator = 'path': no effect, without damping and friction it is 'half_step'"


# -- rounded and extended times ------------------------------------------------------------------------------


def rounded_times(scene: Scene) -> list[str]:
    """Times of the run that differ from those stated: rounded to whole steps, extended, never reached."""
    return [
        *_duration(scene),
        *_intervals(scene),
        *(s for wall in scene.walls for s in _presence(scene, wall)),
        *_insertions(scene),
        *_phases(scene),
    ]


def _duration(scene: Scene) -> Iterator[str]:
    stated, actual = scene.time.duration, scene.n_steps * scene.time.step
    extended = actual - stated > max(0.5 * scene.time.step, EXTENSION * stated)
    if scene.output.frames_every is not None and extended:
        frame = scene.frame_stride * scene.time.step
        yield (
            f"time.duration = {stated:g} s: the run takes {actual:.6g} s, extended to whole frames, one every"
            f" {frame:.6g} s"
        )
    elif abs(actual - stated) > ROUNDING * stated:
        yield f"time.duration = {stated:g} s: the run takes {actual:.6g} s, rounded to whole steps"


def _insertions(scene: Scene) -> Iterator[str]:
    """Times of insertions that are rounded, or that the run does not reach."""
    if not scene.insert:
        return
    found, end = scene.inserted, scene.n_steps
    yield from found.warnings
    off = np.abs(found.step * scene.time.step - found.time)
    rounded = off > ROUNDING * np.maximum(found.time, scene.time.step)
    if rounded.any():
        k = int(np.argmax(off * rounded))
        yield (
            f"insert: the times of {int(rounded.sum())} particles are rounded to whole steps, the worst:"
            f" {found.time[k]:g} s to step {found.step[k]}, {found.step[k] * scene.time.step:.6g} s"
        )
    late = int((found.step > end).sum())
    if late:
        last = end * scene.time.step
        yield f"insert: {late} particles would be inserted after the end of the run, {last:.6g} s"


def _phases(scene: Scene) -> Iterator[str]:
    """Starts of phases that are rounded, or that the run does not reach."""
    for k, (phase, step) in enumerate(zip(scene.phases, scene.phase_steps, strict=True)):
        stated, actual = f"phases[{k}].start = {phase.start:g} s", step * scene.time.step
        if step >= scene.n_steps:
            yield f"{stated}: never, the run takes {scene.n_steps * scene.time.step:.6g} s"
        elif abs(actual - phase.start) > ROUNDING * phase.start:
            yield f"{stated}: rounded to step {step}, {actual:.6g} s"


def _intervals(scene: Scene) -> Iterator[str]:
    end = scene.n_steps * scene.time.step
    for name, text in _NEVER.items():
        stated = getattr(scene.output, name)
        stride = scene.stride(stated)
        if stated is None or stride is None:
            continue
        actual = stride * scene.time.step
        if abs(actual - stated) > ROUNDING * stated:
            steps = "1 step" if stride == 1 else f"{stride} steps"
            yield f"output.{name} = {stated:g} s: rounded to {steps}, {actual:.6g} s"
        if text and stride >= scene.n_steps + (name != "restart_every"):
            yield f"output.{name} = {stated:g} s: {text}, the run takes {end:.6g} s"


#: Interval -> what happens where it is not shorter than the run (that of frames extends the run).
_NEVER = {
    "frames_every": "",
    "trace_every": "only the start is recorded",
    "history_every": "only the start is recorded",
    "restart_every": "no restart file is written",
}


def _presence(scene: Scene, wall: Wall) -> Iterator[str]:
    """Of a wall that comes or goes."""
    begin, end = scene.steps(wall.begin), None if wall.end is None else scene.steps(wall.end)
    key = f"walls: {wall.name}.removed_at = {wall.removed_at:g} s" if wall.removed_at is not None else ""
    key = key or f"walls: {wall.name}.present = {list(wall.present or ())} s"
    run = f"the run takes {scene.n_steps * scene.time.step:.6g} s"
    if begin >= scene.n_steps:
        yield f"{key}: {run}; the wall is never there"
    elif end == begin:
        yield f"{key}: less than half a time step; the wall is never there"
    elif end is not None and end >= scene.n_steps:
        yield f"{key}: {run}; the wall is never removed"
    else:
        for time in (wall.begin, wall.end or 0.0):
            step = scene.steps(time)
            if abs(step * scene.time.step - time) > ROUNDING * time:
                which = f"{time:g} s " if wall.present else ""
                yield f"{key}: {which}rounded to step {step}, {step * scene.time.step:.6g} s"


# -- what else deserves a second look ------------------------------------------------------------------------


def unexpected(scene: Scene) -> list[str]:
    """A scene in which nothing moves, or everything leaves, or whose frames fill the disk."""
    found = list(_lost_steps(scene))
    state, needs = scene.state, scene.needs
    moved = needs.gravity or needs.vibration or state.velocity.any() or state.angular_velocity.any()
    moved = moved or any(group.motion for group in scene.groups)
    if not moved and not {"overlap", "large_overlap"} & set(scene.allow):
        found.append("no gravity and no start velocity: nothing moves unless particles overlap")
    if needs.gravity and not scene.walls and not needs.periodic and not scene.exits:
        found.append("gravity and no wall: particles leave the domain, which ends the run")
    triangles = sum(len(mesh.corners) for mesh in scene.meshes)
    if triangles * TRIANGLE_BYTES > MANY_BYTES:
        found.append(f"walls: {triangles} triangles take about {triangles * TRIANGLE_BYTES / 1e9:.1f} GB")
    size = scene.n_steps // scene.frame_stride * len(state) * FRAME_BYTES
    if size > MANY_BYTES:
        found.append(f"output.frames_every: the frames take about {size / 1e9:.1f} GB")
    return found


def _lost_steps(scene: Scene) -> Iterator[str]:
    """Motion that rounding of the positions loses."""
    spacing, corner = position_spacing(scene)
    fall = float(np.sqrt(4 * np.linalg.norm(scene.gravity) * scene.state.radius.min()))  # by one diameter
    speed = max(fall, float(np.linalg.norm(scene.state.velocity, axis=1).max()))
    if speed > 0 and spacing > 0.1 * speed * scene.time.step:
        moved = speed * scene.time.step
        yield (
            f"solver.precision = {scene.solver.precision!r}: positions at {corner:g} m are {spacing:.2g} m"
            f" apart, and {speed:.3g} m/s moves {moved:.2g} m in a step: motion is rounded off;"
            " take 'mixed' or a smaller domain"
        )
