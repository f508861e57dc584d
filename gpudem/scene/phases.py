"""What changes during a run: `[[phases]]`, from the time at which each starts on.

The start of a phase is a set-up, as between two `run` commands of LIGGGHTS: forces are computed anew at the
positions and full-step velocities of that step; springs are kept. What a phase does not state stays as it
was.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

from pydantic import ConfigDict, model_validator

from gpudem.scene.sections import Pair
from gpudem.scene.types import Model, Name, Vector, number, positive, vector
from gpudem.scene.wall_phases import WallChange, changed

if TYPE_CHECKING:
    from gpudem.scene.model import Scene


class PairChange(Model):
    """Contact properties of two materials that change; those not stated stay as they were.

    Properties of a law of another package may change too.
    """

    model_config = ConfigDict(extra="allow")

    materials: tuple[Name, Name]
    """The two materials of one of `[[pairs]]`, in either order."""
    restitution: Annotated[float, positive("1", 1)] | None = None
    """Coefficient of restitution e [1], 0 < e <= 1."""
    friction: Annotated[float, number("1", 0)] | None = None
    """Coulomb friction mu [1]."""
    rolling_friction: Annotated[float, number("1", 0)] | None = None
    """Rolling friction mu_r [1]."""
    kn: Annotated[float, number("N/m2, hooke/stiffness N/m", 0)] | None = None
    """Normal stiffness constant, as in `[[pairs]]`."""
    kt: Annotated[float, number("N/m2, hooke/stiffness N/m", 0)] | None = None
    """Tangential stiffness constant, likewise."""
    gamma_n: Annotated[float, number("1/(m s), hooke/stiffness 1/s", 0)] | None = None
    """Normal damping constant, likewise."""
    gamma_t: Annotated[float, number("1/(m s), hooke/stiffness 1/s", 0)] | None = None
    """Tangential damping constant, likewise."""

    @model_validator(mode="after")
    def _changes(self) -> PairChange:
        if not self.stated:
            raise ValueError("friction: missing; a change of a pair states one property at least")
        return self

    @property
    def stated(self) -> dict[str, object]:
        """The properties that change."""
        return {k: v for k, v in self.model_dump(exclude={"materials"}).items() if v is not None}

    def of(self, pair: Pair) -> Pair:
        """The pair with the change."""
        return Pair(**{**pair.model_dump(), **self.stated})


class Phase(Model):
    """A part of the run, up to the start of the next one."""

    start: Annotated[float, positive("s")]
    """When it starts [s], rounded to whole steps, at least one."""
    gravity: Annotated[Vector, vector("m/s2")] | None = None
    """Acceleration of gravity from then on [m/s2]."""
    pairs: tuple[PairChange, ...] = ()
    """Contact properties from then on."""
    walls: tuple[WallChange, ...] = ()
    """Presence, motion, belt and material of walls from then on."""

    @model_validator(mode="after")
    def _changes(self) -> Phase:
        if self.gravity is None and not self.pairs and not self.walls:
            raise ValueError("gravity: missing; a phase states gravity, pairs or walls")
        return self


def scenes(scene: Scene) -> tuple[Scene, ...]:
    """The scene from the start on and in each phase, without phases of its own: for its gravity and pairs,
    and for motion, belt and material of its walls, whose places stay those at the start.

    Raises KeyError: no such pair.
    """
    found = [scene.model_copy(update={"phases": ()})]
    for phase in scene.phases:
        before = found[-1]
        pairs = {frozenset(pair.materials): pair for pair in before.pairs}
        for change in phase.pairs:
            key = frozenset(change.materials)
            pairs[key] = change.of(pairs[key])  # mutate: pairs_of_phase
        gravity = before.gravity if phase.gravity is None else phase.gravity
        update = {"gravity": gravity, "pairs": tuple(pairs.values()), "walls": changed(before.walls, phase)}
        found.append(before.model_copy(update=update))
    return tuple(found)


def problems(scene: Scene) -> list[str]:
    """What is wrong with the phases of a scene whose pairs are valid."""
    found, last = [], 0
    stated = {frozenset(pair.materials) for pair in scene.pairs}
    for k, phase in enumerate(scene.phases):
        key, step = f"phases[{k}]", scene.steps(phase.start)
        if step <= last:
            what = "the start of the run" if k == 0 else f"the one before, {scene.phases[k - 1].start:g} s"
            found.append(f"{key}.start = {phase.start:g} s: not a time step after {what}; phases must ascend")
        last = step
        found += [f"{key}.pairs[{i}].{problem}" for i, problem in _unknown(phase, stated)]
    return found


def _unknown(phase: Phase, stated: set[frozenset[str]]) -> Iterator[tuple[int, str]]:
    keys = [frozenset(change.materials) for change in phase.pairs]
    for i, change in enumerate(phase.pairs):
        names = " / ".join(change.materials)
        if keys[i] not in stated:
            yield i, f"materials: no [[pairs]] of {names}, which could change"
        if keys[i] in keys[:i]:
            yield i, f"materials: {names} given twice"
