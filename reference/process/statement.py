"""Scene -> the files that a code is given: scene.json, particles.csv, particles.vtu."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gpudem.output.atomic import write_text
from gpudem.output.vtu import write_vtu
from gpudem.scene import Plane, Scene
from reference.errors import CannotState
from reference.process import contract

#: Rows (particles x steps) up to which states are requested at the steps of the history as well.
HISTORY_ROWS = 2_000_000


def wanted_steps(scene: Scene) -> np.ndarray:
    """Steps whose states a code is to write: of the trace, the frames and, in small scenes, the history."""
    strides = [scene.frame_stride]
    strides += [s for s in (scene.stride(scene.output.trace_every), history_stride(scene)) if s]
    steps = [np.arange(0, scene.n_steps + 1, stride) for stride in strides]
    return np.unique(np.concatenate(steps))


def history_stride(scene: Scene) -> int | None:
    """Steps between rows of the history; None where it is not requested or would be too many states."""
    stride = scene.stride(scene.output.history_every)
    if stride is None or (scene.n_steps // stride + 1) * len(scene.state) > HISTORY_ROWS:
        return None
    return stride


def facts(scene: Scene) -> contract.SceneFacts:
    """A scene in the words of the contract.

    Raises CannotState: a wall of a kind, or with a property, that the contract does not have.
    """
    other = [wall for wall in scene.wall_elements if not isinstance(wall, Plane)]
    if other:
        raise CannotState(
            f"walls.{other[0].name}: kind {other[0].kind!r} is not in scene.json, which has planes"
        )
    for wall in scene.wall_elements:
        for key in wall.given_keys("contact", "motion", "surface_velocity", "present"):
            raise CannotState(f"walls.{wall.name}.{key}: scene.json has no such property of a wall")
    if scene.phases:
        raise CannotState("phases: scene.json has one gravity and one set of pairs")
    if scene.groups:
        raise CannotState("groups: in scene.json all particles move freely")
    if scene.insert:
        raise CannotState("insert: scene.json has the particles at the start only")
    if scene.exits:
        raise CannotState(f"{scene.exits[0].name}: particles leave: scene.json has the same to the end")
    state, steps = scene.state, wanted_steps(scene)
    names = list(scene.materials)
    return contract.SceneFacts(
        name=scene.name,
        title=scene.title,
        steps=contract.Steps(dt=scene.time.step, count=scene.n_steps),
        wanted=contract.Wanted(steps=steps.tolist(), times=(steps * scene.time.step).tolist()),
        gravity=scene.gravity,
        domain=contract.DomainFacts(**scene.domain.model_dump(exclude={"sides"})),
        materials={k: contract.MaterialFacts(**m.model_dump()) for k, m in scene.materials.items()},
        pairs=[contract.PairFacts(**pair.model_dump()) for pair in scene.pairs],
        contact=contract.ContactFacts(**scene.contact.model_dump()),
        walls=[_wall(scene, plane) for plane in scene.planes],
        particles=contract.ParticleFacts(
            id=list(range(1, len(state) + 1)),
            material=[names[k] for k in state.material.tolist()],
            radius=state.radius.tolist(),
            position=state.position.tolist(),
            velocity=state.velocity.tolist(),
            angular_velocity=state.angular_velocity.tolist(),
        ),
    )


def _wall(scene: Scene, plane: Plane) -> contract.WallFacts:
    vibration = plane.vibration and contract.VibrationFacts(**plane.vibration.model_dump())
    return contract.WallFacts(
        name=plane.name,
        material=plane.material,
        point=plane.point,
        normal=plane.normal,
        removed_at=plane.removed_at,
        removed_at_step=None if plane.removed_at is None else scene.steps(plane.removed_at),
        vibration=vibration,
    )


def write(scene: Scene, directory: Path) -> Path:
    """Write the files; the path of scene.json. Raises CannotState, WriteError."""
    stated = facts(scene)
    write_text(directory / contract.SCENE, stated.model_dump_json(indent=1) + "\n")
    write_text(directory / contract.PARTICLES, _table(stated.particles))
    state = scene.state
    write_vtu(
        directory / contract.PARTICLES_VTU,
        {
            "id": np.arange(1, len(state) + 1, dtype=np.int64),
            "material": state.material.astype(np.int32),
            "position": state.position,
            "velocity": state.velocity,
            "angular_velocity": state.angular_velocity,
            "radius": state.radius,
        },
    )
    return directory / contract.SCENE


def _table(particles: contract.ParticleFacts) -> str:
    rows = ["id,material,radius,x,y,z,vx,vy,vz,wx,wy,wz"]
    columns = zip(*(getattr(particles, name) for name in contract.ParticleFacts.model_fields), strict=True)
    for number, material, radius, position, velocity, spin in columns:
        values = (radius, *position, *velocity, *spin)
        rows.append(",".join([str(number), material, *map(repr, values)]))
    return "\n".join([*rows, ""])
