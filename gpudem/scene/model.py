"""The whole statement of a simulation: frozen, validated, SI units. No Warp here.

A scene carries primary inputs only (young, poisson, restitution, ...); each code derives its own
coefficients from them. `Scene.from_toml`, `Scene.from_json` and the constructor give the same object.
The sections and their keys are in `gpudem.scene.sections`.
"""

from __future__ import annotations

import bisect
import dataclasses
import functools
import hashlib
import itertools
import json
import math
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, Field, ValidationError

from gpudem.contact import registry
from gpudem.contact.law import Law, NormalLaw, PairInputs
from gpudem.contact.names import LawNames
from gpudem.errors import SceneError
from gpudem.scene import (
    checks,
    files,
    groups,
    insertion,
    laws,
    overlaps,
    phases,
    removal,
    time_step,
    wall_phases,
)
from gpudem.scene.groups import Group
from gpudem.scene.insertion import Inserted, InsertSection
from gpudem.scene.mesh import Mesh
from gpudem.scene.motion import Servo
from gpudem.scene.packing import InitialState, lattice
from gpudem.scene.particle_files import ParticleFile, read_particles
from gpudem.scene.phases import Phase
from gpudem.scene.removal import Exit, Remove
from gpudem.scene.sections import (
    LATER_OF_CONTACT,
    OF_MESHES,
    Contact,
    Domain,
    Explicit,
    FromFile,
    Lattice,
    Material,
    Needs,
    Output,
    Pair,
    Solver,
    Time,
)
from gpudem.scene.size_classes import default_skin
from gpudem.scene.types import Model, Name, Vector, vector
from gpudem.scene.wall_kinds import WallSection
from gpudem.scene.walls import Box, Plane, Wall
from gpudem.walls.motion import PhasedPath, WallPath

#: Keys of a wall that a hash leaves out where they have no value: older scenes keep their hash.
LATER_KEYS = ("present", "contact", "surface_velocity", "motion", "reference")


def _stated(wall: Wall, digest: Any) -> dict[str, Any]:
    """A wall for the hash: without later keys that have no value; arrays go into the digest.

    Of a mesh the triangles in place, however they are stated.
    """
    later = (*LATER_KEYS, "removed_at") if isinstance(wall, Box) else LATER_KEYS
    found: dict[str, Any] = {
        k: v for k, v in wall.model_dump().items() if k not in later or v not in (None, ())
    }
    if isinstance(wall, Mesh):
        found = {k: v for k, v in found.items() if k in Wall.model_fields} | {"corners": wall.corners}
    if found.get("contact") and found["contact"]["cohesion"] is None:
        found["contact"] = {k: v for k, v in found["contact"].items() if k != "cohesion"}
    return {k: _hashed(v, digest) for k, v in found.items()}


def _hashed(value: Any, digest: Any) -> Any:
    if isinstance(value, np.ndarray):
        digest.update(value.tobytes())
        return list(value.shape)
    if isinstance(value, list | tuple):
        return [_hashed(v, digest) for v in value]
    return {k: _hashed(v, digest) for k, v in value.items()} if isinstance(value, dict) else value


class Scene(Model):
    """One simulation, stated once for every code.

    Raises:
        SceneError: listing every problem, each with key, value, unit and allowed range.
    """

    name: Name
    """Short name of the scene; names files."""
    title: str = ""
    """What it shows, in a line."""
    materials: Annotated[dict[Name, Material], Field(min_length=1)]
    """Materials of particles and walls, by name."""
    pairs: tuple[Pair, ...]
    """Contact properties of every two materials that can touch."""
    contact: Contact = Contact()
    """The contact law."""
    particles: Annotated[Explicit | FromFile | Lattice, Field(discriminator="source")] | None = None
    """The particles at the start; may be left out where some are inserted."""
    insert: tuple[InsertSection, ...] = ()
    """Particles inserted during the run."""
    remove: tuple[Remove, ...] = ()
    """Particles that leave during the run."""
    groups: tuple[Group, ...] = ()
    """Particles that contacts do not move."""
    phases: tuple[Phase, ...] = ()
    """Gravity, contact properties and walls that change during the run."""
    gravity: Annotated[Vector, vector("m/s2")] = (0.0, 0.0, 0.0)
    """Acceleration of gravity [m/s2]."""
    walls: tuple[WallSection, ...] = ()
    """Walls, gates and vibrating planes."""
    domain: Domain
    """Where particles may be."""
    time: Time
    """Time step and length of the run."""
    output: Output = Output()
    """What is written, and how often."""
    solver: Solver = Solver()
    """How gpudem computes it."""
    allow: tuple[
        Literal["time_step", "unusual_units", "overlap", "large_overlap", "speed", "memory", "rounding"], ...
    ] = ()
    """Checks and guards waived by name for this scene."""

    def __init__(self, /, _source: str = "<python>", **data: Any):
        automatic, data = files.take_auto_step(data)
        try:
            BaseModel.__init__(self, **data)
        except ValidationError as error:
            found = files.problems(error, Scene)
            valid, invalid = files.partial(Scene, data)
            raise SceneError(_source, found + checks.problems(valid, invalid)) from None
        waived = ("time",) if automatic else ()
        found = checks.problems(self, waived)
        if automatic and self.time.accuracy is None:
            found.append('time.accuracy: missing; step = "auto" needs it: 1e-06 <= value <= 0.1 [1]')
        if found:
            raise SceneError(_source, found)
        if automatic:
            self._resolve_step(_source)

    def _resolve_step(self, source: str) -> None:
        """Put the step that the accuracy needs in the place of "auto". Raises SceneError: too long."""
        assert self.time.accuracy is not None
        step = time_step.step_for(self, self.time.accuracy)
        if not math.isfinite(step):
            what = "time.step = 'auto': nothing moves and nothing overlaps, so that there is no contact time"
            raise SceneError(source, [f"{what}; state the step [s]"])
        object.__setattr__(self, "time", self.time.model_copy(update={"step": step}))
        for name in set(vars(self)) - set(type(self).model_fields) - {"particle_file"}:
            vars(self).pop(name)  # what follows from the placeholder, such as the steps of insertions
        found = checks.problems(self)
        if found:
            raise SceneError(source, found)

    def __eq__(self, other: object) -> bool:
        """Same name, title and physics (`hash`); particle files by their content."""
        if not isinstance(other, Scene):
            return NotImplemented
        return (self.name, self.title, self.hash) == (other.name, other.title, other.hash)

    def __hash__(self) -> int:
        return hash(self.hash)

    # -- reading and writing -------------------------------------------------------------------------------

    @classmethod
    def from_toml(cls, path: str | Path) -> Scene:
        """Read a scene file; relative particle paths count from its folder. Raises SceneError."""
        return cls(_source=str(path), **files.read_toml(Path(path)))

    @classmethod
    def from_file(cls, path: str | Path) -> Scene:
        """Read a scene file: JSON where it ends in .json, as in the folder of a run; else TOML.

        Raises SceneError.
        """
        if Path(path).suffix != ".json":
            return cls.from_toml(path)
        return cls(_source=str(path), **files.read_json(Path(path)))

    @classmethod
    def from_json(cls, text: str, source: str = "<json>") -> Scene:
        """Read what `to_json` wrote. Raises SceneError."""
        return cls(_source=source, **files.parse_json(text, source))

    def to_json(self) -> str:
        """The resolved scene as JSON; `from_json` gives every number back to the last bit."""
        return files.json_text(self.model_dump())

    def replace(self, **changes: Any) -> Scene:
        """A copy with other values, validated anew: `scene.replace(time={"step": 1e-6}, gravity=(0, 0, 0))`.

        A mapping changes the given keys of that section only, unless it names another `source`.
        """
        data = self.model_dump()
        for key, value in changes.items():
            merge = isinstance(value, dict) and isinstance(data.get(key), dict)
            if merge and value.get("source", data[key].get("source")) == data[key].get("source"):
                value = {**data[key], **value}
            data[key] = value
        return type(self)(**data)

    def __getstate__(self) -> dict[Any, Any]:
        """For pickling: the statement, and the particles read from files; no law."""
        state = super().__getstate__()
        names = {*type(self).model_fields, "particle_file", "insertion_lists"}
        return {**state, "__dict__": {k: v for k, v in state["__dict__"].items() if k in names}}

    @functools.cached_property
    def hash(self) -> str:
        """SHA-256 of the physics: all but name and title; of files the content, not the path."""
        data, digest = self.model_dump(exclude={"name", "title", "walls"}), hashlib.sha256()
        data["walls"] = [_stated(wall, digest) for wall in self.walls]
        if not self.domain.sides:
            del data["domain"]["sides"]
        for key in ("wall_forces", "flow", "wall_stress", "group_forces"):
            if not data["output"][key]:
                del data["output"][key]
        for surface in data["output"].get("flow", ()):
            if surface["face"] is None:
                del surface["face"]
        data["contact"] = {k: v for k, v in data["contact"].items() if (k, v) not in LATER_OF_CONTACT.items()}
        data["insert"] = [_hashed(columns, digest) for columns in self._insertion_columns()]
        if not self.insert:
            del data["insert"]
        data["phases"] = [
            {k: _hashed(v, digest) for k, v in phase.items() if k != "walls" or v} for phase in data["phases"]
        ]
        for key in ("phases", "remove"):
            if not data[key]:
                del data[key]
        del data["groups"]
        if self.groups:
            data["held"] = _hashed(self.held, digest)
            data["motions"] = [
                _hashed([m.model_dump() for m in group.motion], digest) for group in groups.moving(self)
            ]
        if not self.meshes and not wall_phases.belts_change(self):
            data["contact"] = {k: v for k, v in data["contact"].items() if k not in OF_MESHES}
        arrays = {k: v for k, v in (data["particles"] or {}).items() if isinstance(v, np.ndarray)}
        if isinstance(self.particles, FromFile):
            data["particles"]["path"] = ""
            del data["particles"]["at_rest"]  # what it does is in the velocities
            start = self.particles_at_start
            arrays = {field.name: getattr(start, field.name) for field in dataclasses.fields(start)}
        for name, values in sorted(arrays.items()):
            data["particles"][name] = list(values.shape)
            digest.update(values.tobytes())
        digest.update(json.dumps(data, sort_keys=True).encode())
        return digest.hexdigest()

    def _insertion_columns(self) -> list[dict[str, Any]]:
        """What is inserted, for the hash, however it is stated."""
        if not self.insert:
            return []
        found = self.inserted
        columns = {field.name: getattr(found.state, field.name) for field in dataclasses.fields(found.state)}
        return [{**columns, "step": found.step}]

    # -- what follows from the statement -------------------------------------------------------------------

    @functools.cached_property
    def state(self) -> InitialState:
        """Positions, velocities, radii, materials when particles come, the same numbers for every code.

        First those at t = 0 (`start_count`), then those that are inserted. Along periodic sides
        lo <= x < hi: one on, or rounded to, the upper face is at the lower one.
        """
        state = self.stated_particles.within(self.domain.lo, self.domain.hi, self.domain.periodic)
        return groups.with_velocities(self, state)

    @functools.cached_property
    def particles_at_start(self) -> InitialState:
        """The particles at t = 0."""
        return self.state.rows(self.start_count)

    @functools.cached_property
    def stated_particles(self) -> InitialState:
        """All particles as stated: at the start, then inserted. Raises ValueError: they cannot be."""
        start = self.stated_at_start
        return insertion.joined([start, self.inserted.state]) if self.insert else start

    @functools.cached_property
    def insertion_lists(self) -> list[ParticleFile]:
        """What each insertion states; a file is read once. Raises ValueError: naming insertion and key."""
        return insertion.read(self)

    @functools.cached_property
    def inserted(self) -> Inserted:
        """The particles that come in the run. Raises ValueError: naming insertion and key."""
        return insertion.resolve(self)

    @functools.cached_property
    def arrival_steps(self) -> np.ndarray:
        """The step in which each particle comes, ascending, shape (n,); 0: at the start."""
        steps = np.zeros(len(self.state), np.int64)
        if self.insert:
            steps[len(steps) - len(self.inserted.step) :] = self.inserted.step
        return steps

    @functools.cached_property
    def exits(self) -> list[Exit]:
        """Where particles leave."""
        return removal.exits(self)

    def count_at(self, step: int) -> int:
        """How many particles have come by a step: those of `state` with smaller rows; some may have left."""
        return (
            int(np.searchsorted(self.arrival_steps, step, side="right")) if self.insert else len(self.state)
        )

    def mean_count(self, steps: int) -> int:
        """How many particles have come on average over the first so many steps of the run."""
        if not steps:
            return self.start_count
        return round(float(np.clip(steps + 1 - self.arrival_steps, 0, steps).sum()) / steps)

    @property
    def start_count(self) -> int:
        """How many particles there are at t = 0."""
        return self.count_at(0)

    @functools.cached_property
    def insertion_steps(self) -> list[int]:
        """The steps in which particles come, ascending, each once."""
        return np.unique(self.inserted.step).tolist() if self.insert else []

    @functools.cached_property
    def held(self) -> np.ndarray:
        """What moves each particle, shape (n,): `groups.FREE`, `groups.FROZEN` or a motion, from 1."""
        return groups.held(self)

    @property
    def loaded_groups(self) -> list[Group]:
        """The groups that `output.group_forces` names, in its order."""
        named = {group.name: group for group in self.groups}
        return [named[name] for name in self.output.group_forces]

    @functools.cached_property
    def stated_at_start(self) -> InitialState:
        """Particles at the start as the lattice, list or file states them. Raises ValueError: it cannot."""
        p = self.particles
        if p is None:
            return InitialState.none()
        if isinstance(p, Lattice):
            return lattice(p, self.material_index)
        if isinstance(p, FromFile):
            state = self.particle_file.state
            return state.at_rest() if p.at_rest else state
        return InitialState.from_explicit(p, self.material_index)

    @functools.cached_property
    def particle_file(self) -> ParticleFile:
        """What the file of particles holds. Raises ValueError: not a FromFile scene, or an unusable file."""
        p = self.particles
        if not isinstance(p, FromFile):
            raise ValueError("the scene reads no file of particles")
        return read_particles(Path(p.path), self.material_index, p.material, p.radius)

    @functools.cached_property
    def masses(self) -> np.ndarray:
        """Mass of every particle [kg], 4/3 pi R^3 rho, shape (n,)."""
        density = np.array([m.density for m in self.materials.values()])
        return 4 / 3 * np.pi * self.state.radius**3 * density[self.state.material]  # mutate: particle_masses

    @functools.cached_property
    def material_index(self) -> dict[str, int]:
        """Material name -> index in order of statement; the same order in every code."""
        return {name: i for i, name in enumerate(self.materials)}

    def pair(self, a: str, b: str) -> Pair | None:
        """Properties of a material pair, in either order; None if not stated."""
        return self.pair_table.get(frozenset((a, b)))

    @functools.cached_property
    def pair_table(self) -> dict[frozenset[str], Pair]:
        """Both materials of a pair, in no order -> its properties."""
        return {frozenset(pair.materials): pair for pair in reversed(self.pairs)}  # of two, the first

    @functools.cached_property
    def particle_materials(self) -> list[str]:
        """Names of the materials that particles are made of, in order of statement."""
        used = set(np.unique(self.stated_particles.material).tolist())
        return [name for name, i in self.material_index.items() if i in used]

    @functools.cached_property
    def wall_elements(self) -> list[Wall]:
        """All walls as elementary ones: a box as planes, named `<box>_<side>`."""
        return [e for wall in self.walls for e in wall.elements(self.domain.lo, self.domain.hi)]

    @functools.cached_property
    def wall_speeds(self) -> list[float]:
        """An upper bound of the speed of each elementary wall within the domain [m/s]; 0 at rest."""
        return [wall_phases.largest_speed(self, w) for w in range(len(self.wall_elements))]

    @functools.cached_property
    def moving_walls(self) -> frozenset[str]:
        """Names of the elementary walls that move, or whose surface has a velocity, at some time."""
        return wall_phases.moving(self)

    @property
    def walls_at_start(self) -> list[Wall]:
        """The elementary walls that are there at the start."""
        return [wall for wall in self.wall_elements if self.is_present(wall, 0)]

    @property
    def planes(self) -> list[Plane]:
        """The elementary walls that are planes."""
        return [wall for wall in self.wall_elements if isinstance(wall, Plane)]

    @functools.cached_property
    def meshes(self) -> list[Mesh]:
        """The walls of triangles."""
        return [wall for wall in self.walls if isinstance(wall, Mesh)]

    @functools.cached_property
    def servos(self) -> dict[str, list[tuple[int, Servo]]]:
        """Of each elementary wall that follows a force at some time: the steps at which servos begin, and
        the servos, by name.
        """
        return wall_phases.servos(self)

    @functools.cached_property
    def phase_scenes(self) -> tuple[Scene, ...]:
        """The scene as it is from the start on and in each of its phases: gravity, pairs and walls."""
        return phases.scenes(self)

    @functools.cached_property
    def phase_steps(self) -> list[int]:
        """The step at which each phase starts, ascending."""
        return [self.steps(phase.start) for phase in self.phases]

    def phase_after(self, step: int) -> Scene:
        """The one of `phase_scenes` that holds in the steps after this one."""
        return self.phase_scenes[bisect.bisect_right(self.phase_steps, step)]

    def gravity_at(self, steps: np.ndarray) -> np.ndarray:
        """Gravity [m/s2] in each of these steps, shape (k, 3); at the start of a phase still that before."""
        table = np.array([scene.gravity for scene in self.phase_scenes])
        return table[np.searchsorted(self.phase_steps, np.asarray(steps), side="left")]

    def inputs(self, a: str, b: str) -> PairInputs:
        """Primary inputs of two materials. Raises KeyError where the scene states no such pair."""
        pair = self.pair(a, b)
        if pair is None:
            raise KeyError(f"no pair {a} / {b}")
        return PairInputs(self.materials[a], self.materials[b], pair, self.contact)

    @functools.cached_property
    def normal_law(self) -> NormalLaw:
        """The normal law of the scene."""
        return registry.law("normal", self.contact.normal)

    @property
    def laws(self) -> tuple[Law, ...]:
        """The laws that act in this scene, in order of the slots; those of walls last."""
        groups = (self.acting_laws, *self.wall_laws.values())
        return tuple(dict.fromkeys(law for names in groups for law in names.laws))

    @functools.cached_property
    def contact_groups(self) -> dict[LawNames, list[PairInputs]]:
        """Laws as stated -> the kinds of contacts that have them; the first are those of `[contact]`."""
        return laws.contact_groups(self)

    @functools.cached_property
    def acting_laws(self) -> LawNames:
        """The laws between particles, and at walls without laws of their own."""
        names = laws.stated_laws(self)
        return laws.acting(names, self.contact_groups[names])

    @functools.cached_property
    def wall_laws(self) -> dict[str, LawNames]:
        """Name -> the laws that act at a wall where others act than those of `[contact]`."""
        own = {wall.name: laws.stated_laws(self, wall) for wall in self.wall_elements}
        act = {names: laws.acting(names, inputs) for names, inputs in self.contact_groups.items()}
        return {name: act[names] for name, names in own.items() if act[names] != self.acting_laws}

    @functools.cached_property
    def start_overlap(self) -> float:
        """The largest overlap at the start, as a share of the smaller radius [1]."""
        return overlaps.largest_start_overlap(self)

    @functools.cached_property
    def contact_range(self) -> float:
        """Largest gap [m] across which the normal law acts; 0 for a law of contact."""
        groups, largest = self.contact_groups.items(), float(self.stated_particles.radius.max())
        ranges = (names.normal_law.range(pair, largest) for names, pairs in groups for pair in pairs)
        return max(ranges, default=0.0)

    @functools.cached_property
    def contact_pairs(self) -> list[Pair]:
        """The pairs that can touch in this scene: particle with particle, particle with wall."""
        return [pair for pair in self.pairs if self.can_touch(*pair.materials)]

    def can_touch(self, a: str, b: str) -> bool:
        """Whether a particle of one material can touch a particle or a wall of the other."""
        ours, partners = self.touching_materials
        return (a in ours and b in partners) or (b in ours and a in partners)

    @functools.cached_property
    def touching_materials(self) -> tuple[set[str], set[str]]:
        """Names of the materials of particles, and of those of particles or walls."""
        ours = set(self.particle_materials)
        # mutate: pairs_in_contact
        partners = ours | {w.material for at in self.phase_scenes for w in at.walls}
        return ours, partners

    @functools.cached_property
    def needs(self) -> Needs:
        """Which physics this scene has."""
        state, groups = self.state, self.contact_groups
        acting = (self.acting_laws, *self.wall_laws.values())
        tangential = any(names.tangential != registry.OFF for names in acting)
        rolling = any(names.rolling != registry.OFF for names in acting)
        turning = any(motion.turns for group in self.groups for motion in group.motion)
        # mutate: scene_needs
        return Needs(
            tangential=tangential,
            history=any(names.history for names in acting),
            rolling=rolling,
            rotation=tangential or rolling or bool(np.any(state.angular_velocity)) or turning,
            damping=any(names.normal_law.dissipates(p) for names, pairs in groups.items() for p in pairs),
            gravity=any(any(scene.gravity) for scene in self.phase_scenes),
            walls=bool(self.walls),
            gate=any(len(steps) > 1 or steps[0] > 0 for steps in self._presence.values()),
            vibration=bool(self.moving_walls),
            periodic=any(self.domain.periodic),
            several_materials=len(self.particle_materials) > 1,
            several_radii=bool(np.ptp(state.radius) > 0),
            cohesion=any(names.cohesion != registry.OFF for names in acting),
            held=bool(self.groups),
        )

    @property
    def skin(self) -> float:
        """Neighbour-list skin [m]."""
        return self.solver.skin or default_skin(self.state.radius)

    # -- time in steps, the same for every code ------------------------------------------------------------

    def steps(self, seconds: float) -> int:
        """A time as whole steps."""
        return round(seconds / self.time.step)  # mutate: whole_steps

    def stride(self, seconds: float | None) -> int | None:
        """An output interval as whole steps, at least one."""
        return None if seconds is None else max(1, self.steps(seconds))

    @property
    def frame_stride(self) -> int:
        """Steps between frames; one frame at the end where no interval is given."""
        return self.stride(self.output.frames_every) or max(1, self.steps(self.time.duration))

    @property
    def n_steps(self) -> int:
        """Steps of the run: the duration, rounded up to a whole number of frames."""
        return (
            max(1, math.ceil(self.steps(self.time.duration) / self.frame_stride - 1e-9)) * self.frame_stride
        )

    @property
    def segments(self) -> list[tuple[int, int, list[Wall]]]:
        """(first step, last step, walls present) between changes of walls and phases; forces are set up
        anew at each.
        """
        walls = self.wall_elements
        edges = [0, *(e for e in self.changes if e < self.n_steps), self.n_steps]
        return [(a, b, [w for w in walls if self.is_present(w, a)]) for a, b in itertools.pairwise(edges)]

    @functools.cached_property
    def changes(self) -> list[int]:
        """Steps after the start at which a wall comes or goes, or a phase starts, ascending."""
        walls = {step for steps in self._presence.values() for step in steps}
        return sorted({*walls, *self.phase_steps} - {0})

    @functools.cached_property
    def wall_paths(self) -> dict[str, WallPath | PhasedPath]:
        """Where motions take the elementary walls that have some, by name; with LIGGGHTS' rule, its sums."""
        return self.paths_of_walls(self.contact.mesh_contacts == "liggghts")

    def paths_of_walls(self, sums: bool) -> dict[str, WallPath | PhasedPath]:
        """As `wall_paths`, with the sums of LIGGGHTS or without."""
        return {
            name: PhasedPath.of(parts, self.time.step, sums)
            for name, parts in wall_phases.motions(self).items()
        }

    @functools.cached_property
    def _presence(self) -> dict[str, list[int]]:
        return wall_phases.presence(self)

    def is_present(self, wall: Wall, step: int) -> bool:
        """Whether a wall is there in the steps after this one."""
        changes = sum(change <= step for change in self._presence[wall.name])  # mutate: end_of_presence
        return changes % 2 == 1

    def comings(self, wall: Wall) -> list[int]:
        """The steps after the start at which a wall comes, ascending."""
        return [step for step in self._presence[wall.name][::2] if step > 0]

    def goes(self, wall: Wall) -> bool:
        """Whether a wall goes during the run."""
        return len(self._presence[wall.name]) > 1
