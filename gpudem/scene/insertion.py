"""Particles that come while a scene runs: stated as lists, resolved to one list in the order of their steps.

A particle that is inserted in step S stands at its position with its velocity when the forces of step S are
computed, and gets the second half of that step's kick: v(S) = v + dt/2 F(S)/m. The others have made the first
half kick and the drift of step S. An insertion is no set-up: velocities and springs of the others go on.
Ids ascend in the order of steps, then of statement, after those of the particles at the start.
"""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, PlainValidator, SerializeAsAny, model_validator

from gpudem.scene.files import OneOf
from gpudem.scene.overlaps import near_pairs
from gpudem.scene.packing import InitialState
from gpudem.scene.particle_files import ParticleFile, read_particles
from gpudem.scene.placement import Flight
from gpudem.scene.sections import ANGULAR_VELOCITY, POSITION, RADIUS, VELOCITY
from gpudem.scene.sources import InsertPack, InsertRate, InsertStream, Source, Surroundings
from gpudem.scene.types import Model, each, names, number, of_kind

if TYPE_CHECKING:
    from gpudem.scene.model import Scene

#: When a particle comes.
TIME = each(number("s", 0))


class InsertList(Model):
    """Particles listed one by one with the time at which each comes: here, or in a file."""

    kind: Literal["list"]
    """How particles are stated."""
    path: Annotated[str, AfterValidator(os.path.abspath)] | None = None
    """A .csv or .npz file with the columns of a file of particles and `time` [s]."""
    time: Annotated[float | np.ndarray, TIME] | None = None
    """When they come [s], rounded to whole steps, at least one: one time for all, or one for each."""
    position: Annotated[np.ndarray, POSITION] | None = None
    """Centres [m], shape (n, 3)."""
    radius: Annotated[float | np.ndarray, each(RADIUS)] | None = None
    """One radius for all, or one for each [m]; of a file that has none."""
    material: Annotated[str | tuple[str, ...], names()] | None = None
    """One material for all, or one for each; of a file that has none, one."""
    velocity: Annotated[np.ndarray, VELOCITY] | None = None
    """Velocities [m/s], shape (n, 3); 0 by default."""
    angular_velocity: Annotated[np.ndarray, ANGULAR_VELOCITY] | None = None
    """Angular velocities [rad/s], shape (n, 3); 0 by default."""

    @model_validator(mode="after")
    def _one_statement(self) -> InsertList:
        listed = [key for key in ("time", "position", "velocity", "angular_velocity")
                  if getattr(self, key) is not None]  # fmt: skip
        if self.path is not None and listed:
            raise ValueError(f"{listed[0]}: stands in the file that path names; state one of both")
        if self.path is not None and not isinstance(self.radius, float | None):
            raise ValueError("radius: one for each stands in the file that path names")
        if self.path is not None and not isinstance(self.material, str | None):
            raise ValueError("material: one for each stands in the file that path names")
        if self.path is None:
            for key, unit in (("time", " [s]"), ("position", " [m]"), ("radius", " [m]"), ("material", "")):
                if getattr(self, key) is None:
                    raise ValueError(f"{key}: missing{unit}; or state a path")
        return self

    @property
    def material_names(self) -> list[tuple[str, str]]:
        """Key and name of each material that it states."""
        stated = [self.material] if isinstance(self.material, str) else dict.fromkeys(self.material or ())
        return [("material", name) for name in stated]

    def read(self, index: dict[str, int]) -> ParticleFile:
        """The particles with their times. Raises ValueError naming the key, or file, column and row."""
        if self.path is not None:
            radius = self.radius if isinstance(self.radius, float) else None
            material = self.material if isinstance(self.material, str) else None
            return read_particles(Path(self.path), index, material, radius, timed=True)
        assert self.material is not None
        assert self.position is not None
        assert self.radius is not None
        material = (
            index[self.material] if isinstance(self.material, str) else [index[m] for m in self.material]
        )
        state = InitialState.build(self.position, self.radius, material, self.velocity, self.angular_velocity)
        time = np.asarray(self.time, np.float64)
        if time.ndim and len(time) != len(state):
            raise ValueError(
                f"time has {len(time)} rows; must have one for each of the {len(state)} particles"
            )
        return ParticleFile(state, time=np.broadcast_to(time, (len(state),)))


@dataclasses.dataclass(frozen=True)
class Inserted:
    """All particles that come in a run, in the order of their ids."""

    state: InitialState
    """Position, velocity, ... in their step."""
    step: np.ndarray
    """The step in which each comes, ascending from 1, shape (n,)."""
    time: np.ndarray
    """As stated [s], shape (n,)."""
    warnings: tuple[str, ...] = ()
    """What a user may not expect of the files, one sentence each."""


#: The class of each kind of insertion.
INSERTIONS: dict[str, type[Model]] = {
    "list": InsertList, "pack": InsertPack, "rate": InsertRate, "stream": InsertStream,
}  # fmt: skip

if TYPE_CHECKING:
    InsertSection = InsertList | Source
else:
    InsertSection = Annotated[
        SerializeAsAny[Model],
        PlainValidator(of_kind(lambda kind: INSERTIONS.get(kind), Model)),
        OneOf(lambda: INSERTIONS),
    ]


def read(scene: Scene) -> list[ParticleFile]:
    """What each insertion states, one after the other: those stated later avoid the earlier ones.

    Raises ValueError naming the insertion and its key, or file, column, row.
    """
    lists: list[ParticleFile] = []
    flight = None
    for k, insert in enumerate(scene.insert):
        try:
            if isinstance(insert, InsertList):
                found = insert.read(scene.material_index)
            else:
                flight = flight or _flight(scene, lists)
                found = insert.resolve(surroundings(scene, k, flight))
                _require_apart(scene, lists, found, k)
        except (ValueError, KeyError) as error:
            raise ValueError(f"insert[{k}].{error}") from None
        if flight is not None and isinstance(insert, InsertList):
            assert found.time is not None
            flight.add(found.state, found.time)
        lists.append(found)
    return lists


def _require_apart(scene: Scene, lists: list[ParticleFile], found: ParticleFile, number: int) -> None:
    """Raises ValueError: a stream whose particles begin where those of another stream do at that time."""
    streams = [k for k in range(number) if isinstance(scene.insert[k], InsertStream)]
    if not isinstance(scene.insert[number], InsertStream):
        return
    lo = np.array(scene.domain.lo)
    period = np.where(scene.domain.periodic, np.array(scene.domain.hi) - lo, 0.0)
    assert found.time is not None
    for k in streams:
        other, first = lists[k], len(lists[k].state)
        assert other.time is not None
        if other.time.max() < found.time.min() or found.time.max() < other.time.min():
            continue
        position = np.concatenate([other.state.position, found.state.position]) - lo
        radius = np.concatenate([other.state.radius, found.state.radius])
        for i, j, distance in near_pairs(position, radius, period, 0.0):
            hit = ((i < first) != (j < first)) & (distance < radius[i] + radius[j])
            if hit.any():
                raise ValueError(
                    f"face: meets the stream of insert[{k}] while both run; allowed: faces apart, or other"
                    " times"
                )


def surroundings(scene: Scene, number: int, flight: Flight | None = None) -> Surroundings:
    """What a source needs of its scene; by default without particles in its way."""
    domain, time = scene.domain, scene.time
    # a step as long as the run stands for one that is still to be found (step = "auto")
    step = time.step if time.step < time.duration else 0.0
    return Surroundings(
        scene.materials,
        step,
        time.duration,
        np.array(domain.lo),
        np.array(domain.hi),
        number,
        flight or _flight(scene, []),
    )


def _flight(scene: Scene, lists: list[ParticleFile]) -> Flight:
    """Free flight of the particles of the start, in the first step only, and of lists."""
    domain, step = scene.domain, scene.time.step
    lo = np.array(domain.lo)
    period = np.where(domain.periodic, np.array(domain.hi) - lo, 0.0)
    gravity, step = [scene.gravity], step if step < scene.time.duration else 0.0
    for phase in scene.phases:
        gravity.append(phase.gravity or gravity[-1])
    starts = [scene.steps(phase.start) * step if step else phase.start for phase in scene.phases]
    flight = Flight(lo, period, np.array(gravity), step, np.array(starts))
    flight.start = scene.stated_at_start
    for found in lists:
        assert found.time is not None
        flight.add(found.state, found.time)
    return flight


def resolve(scene: Scene) -> Inserted:
    """The one list of a scene. Raises ValueError as `read`."""
    states, times, warnings = [InitialState.none()], [np.empty(0)], []
    for k, found in enumerate(scene.insertion_lists):
        assert found.time is not None
        states.append(found.state)
        times.append(found.time)
        warnings += [w.replace("particles.", f"insert[{k}].") for w in found.warnings]
    time = np.concatenate(times)
    step = _steps_of(scene, time)
    order = np.argsort(step, kind="stable")  # mutate: order_of_insertion
    state = joined(states)
    columns: dict[str, Any] = {
        field.name: _frozen(getattr(state, field.name)[order]) for field in dataclasses.fields(state)
    }
    return Inserted(InitialState(**columns), step[order], time[order], tuple(warnings))


def statement_of(scene: Scene, row: int) -> int:
    """Which `[[insert]]`, from 0, has stated a row of `Scene.state` that is inserted."""
    counts = [len(found.state) for found in scene.insertion_lists]
    times = np.concatenate([np.asarray(found.time) for found in scene.insertion_lists])
    order = np.argsort(_steps_of(scene, times), kind="stable")
    return int(np.repeat(np.arange(len(counts)), counts)[order][row - (len(scene.state) - len(order))])


def _steps_of(scene: Scene, time: np.ndarray) -> np.ndarray:
    """The steps in which particles of these times [s] are inserted."""
    return np.maximum(1, np.rint(time / scene.time.step).astype(np.int64))


def joined(states: list[InitialState]) -> InitialState:
    """Particles of several statements, one after the other."""
    columns: dict[str, Any] = {
        field.name: _frozen(np.concatenate([getattr(s, field.name) for s in states]))
        for field in dataclasses.fields(InitialState)
    }
    return InitialState(**columns)


def _frozen(values: np.ndarray) -> np.ndarray:
    values = np.ascontiguousarray(values)
    values.setflags(write=False)
    return values
