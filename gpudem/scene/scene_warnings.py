"""What a valid scene states in vain or other than it will be: settings without effect, rounded times.

Each function reads a scene and returns sentences, each naming key, value and reason. Values at their defaults are
never warned of, since a scene does not tell whether they were stated.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from gpudem.scene.sections import FromFile, Lattice
from gpudem.scene.time_step import step_for

if TYPE_CHECKING:
    from gpudem.scene.model import Scene
    from gpudem.scene.sections import Pair, Plane

#: A time that rounding to whole steps, or extending to whole frames, changes by more than this share is warned of.
ROUNDING = 1e-3
#: Bytes of a frame for each particle.
FRAME_BYTES = 150
#: Frames above this size [bytes] are warned of.
MANY_BYTES = 2e9


# -- settings without effect ---------------------------------------------------------------------------------


def without_effect(scene: Scene) -> list[str]:
    """Settings that nothing in this scene reads, or that cannot act in it."""
    return [
        f"{sentence.rstrip()}"
        for check in (_materials, _pairs, _contact, _particles, _solver)
        for sentence in check(scene)
    ]


def _materials(scene: Scene) -> Iterator[str]:
    used = {*scene.particle_materials, *(wall.material for wall in scene.walls)}
    for name in scene.materials:
        if name not in used:
            yield f"materials.{name}: no effect, no particle and no wall is of it"


def _pairs(scene: Scene) -> Iterator[str]:
    meeting = {frozenset(pair.materials) for pair in scene.contact_pairs}
    for i, pair in enumerate(scene.pairs):
        key = f"pairs[{i}] ({' / '.join(pair.materials)})"
        if frozenset(pair.materials) not in meeting:
            yield f"{key}: no effect, no particle meets a particle or wall of this pair"
            continue
        yield from (f"{key}{text}" for text in _pair(scene, pair))


def _pair(scene: Scene, pair: Pair) -> Iterator[str]:
    """The properties of one pair that its contacts do not read."""
    contact = scene.contact
    if contact.normal == "hertz/stiffness":
        if pair.restitution != 1:
            yield (
                f".restitution = {pair.restitution:g}: no effect with contact.normal = 'hertz/stiffness', which"
                " damps by gamma_n"
            )
    else:
        stated = [key for key in ("kn", "kt", "gamma_n", "gamma_t") if getattr(pair, key) is not None]
        if stated:
            yield f".{', .'.join(stated)}: no effect with contact.normal = {contact.normal!r}"
    if pair.friction > 0:
        reason = _no_tangential_force(scene, pair)
        if reason:
            yield f".friction = {pair.friction:g}: no effect, {reason}"
    if pair.rolling_friction > 0 and contact.rolling == "off":
        yield f".rolling_friction = {pair.rolling_friction:g}: no effect with contact.rolling = 'off'"


def _no_tangential_force(scene: Scene, pair: Pair) -> str:
    """Why a pair with friction has no tangential force; empty where it has."""
    contact, own = scene.contact, scene.contact.normal == "hertz/stiffness"
    if contact.tangential == "off":
        return "contact.tangential = 'off'"
    damped = contact.tangential_damping and (bool(pair.gamma_t) if own else pair.restitution < 1)
    sprung = contact.tangential == "history" and (bool(pair.kt) or not own)
    if damped or sprung:
        return ""
    if contact.tangential == "history":
        return "kt and the tangential damping are zero"
    if not contact.tangential_damping:
        return "'no_history' is a dashpot alone, and contact.tangential_damping = false"
    return f"'no_history' is a dashpot alone, and {'gamma_t = 0' if own else 'restitution = 1'} has none"


def _contact(scene: Scene) -> Iterator[str]:
    contact, needs = scene.contact, scene.needs
    if contact.tangential == "no_history" and not any(p.friction > 0 for p in scene.contact_pairs):
        yield "contact.tangential = 'no_history': no effect, no pair has friction"
    if contact.rolling != "off" and not needs.rolling:
        yield f"contact.rolling = {contact.rolling!r}: no effect, no pair has rolling_friction"
    if contact.limit_force and not needs.damping:
        yield "contact.limit_force: no effect, without damping no normal force attracts"
    if not contact.tangential_damping and not needs.tangential:
        reason = "contact.tangential = 'off'" if contact.tangential == "off" else "no pair has friction"
        yield f"contact.tangential_damping = false: no effect, {reason}"
    if contact.characteristic_velocity is not None and contact.normal != "hooke":
        yield (
            f"contact.characteristic_velocity = {contact.characteristic_velocity:g} m/s: no effect with"
            f" contact.normal = {contact.normal!r}"
        )


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
            " jitter = 0 says so"
        )
    mixed = isinstance(particles.radius, tuple)
    if particles.seed and not (shifted or mixed or particles.velocity_rms):
        yield f"particles.seed = {particles.seed}: no effect, nothing is random without jitter, mixture or velocity_rms"
    if isinstance(particles.radius, tuple):
        drawn = set(np.unique(scene.state.radius).tolist())
        for k, part in enumerate(particles.radius):
            if part.radius not in drawn:
                yield (
                    f"particles.radius[{k}] = {part.radius:g} m: none of the {particles.count} particles has it;"
                    f" its share is {part.share:g}"
                )


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
    """Times that the run takes otherwise than stated: rounded to whole steps, extended, never reached."""
    return [*_duration(scene), *_intervals(scene), *(s for p in scene.planes for s in _gate(scene, p))]


def _duration(scene: Scene) -> Iterator[str]:
    stated, actual = scene.time.duration, scene.n_steps * scene.time.step
    if abs(actual - stated) > ROUNDING * stated:
        yield (
            f"time.duration = {stated:g} s: the run takes {actual:.6g} s, rounded up to whole frames"
            f" of {scene.frame_stride * scene.time.step:.6g} s"
            if scene.output.frames_every is not None
            else f"time.duration = {stated:g} s: the run takes {actual:.6g} s, rounded to whole steps"
        )


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


def _gate(scene: Scene, plane: Plane) -> Iterator[str]:
    if plane.removed_at is None:
        return
    key, step = f"walls: {plane.name}.removed_at = {plane.removed_at:g} s", scene.steps(plane.removed_at)
    if step == 0:
        yield f"{key}: less than half a time step; the wall is never there"
    elif step >= scene.n_steps:
        yield f"{key}: the run takes {scene.n_steps * scene.time.step:.6g} s; the wall is never removed"
    elif abs(step * scene.time.step - plane.removed_at) > ROUNDING * plane.removed_at:
        yield f"{key}: rounded to step {step}, {step * scene.time.step:.6g} s"


# -- what else deserves a second look ------------------------------------------------------------------------


def unexpected(scene: Scene) -> list[str]:
    """A scene in which nothing moves, or everything leaves, or whose frames fill the disk."""
    found = []
    state, needs = scene.state, scene.needs
    if not (needs.gravity or needs.vibration or state.velocity.any() or state.angular_velocity.any()):
        found.append("no gravity and no start velocity: nothing moves unless particles overlap")
    if needs.gravity and not scene.walls and not needs.periodic:
        found.append("gravity and no wall: particles leave the domain, which ends the run")
    size = scene.n_steps // scene.frame_stride * len(state) * FRAME_BYTES
    if size > MANY_BYTES:
        found.append(f"output.frames_every: the frames take about {size / 1e9:.1f} GB")
    return found
