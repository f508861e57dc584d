"""The sections of a scene, each with its keys, units and defaults: what a scene file may state.

[materials.NAME]  [[pairs]]  [contact]  [particles]  [[walls]]  [domain]  [time]  [output]  [solver]
"""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    PlainValidator,
    SerializeAsAny,
    Tag,
    TypeAdapter,
    ValidationInfo,
    field_validator,
)
from pydantic_core import PydanticCustomError

from gpudem.output import observables
from gpudem.scene.files import OneOf, nearest
from gpudem.scene.types import (
    Flag,
    Flags,
    Model,
    Name,
    Vector,
    array,
    as_python,
    each,
    law_name,
    names,
    number,
    positive,
    vector,
)
from gpudem.walls import registry

Side = Literal["xlo", "xhi", "ylo", "yhi", "zlo", "zhi"]

#: Components of a unit normal up to this size are rounding, and count as zero: cos, sin and products of a few
#: rotation matrices leave some 1e-16, and a tilt of 1e-12 moves a plane by a nanometre at a kilometre.
NORMAL_ROUNDING = 1e-12


#: Particles of a scene at most: the neighbor search numbers 24 candidates of each with 32-bit integers.
MAX_PARTICLES = 2**31 // 24


class Material(Model):
    """Elastic material of particles or walls."""

    young: Annotated[float, positive("Pa")]
    """Young's modulus E [Pa]."""
    poisson: Annotated[float, number("1", 0, 0.5)]
    """Poisson's ratio nu [1], 0 to 0.5."""
    density: Annotated[float, positive("kg/m3")]
    """Density [kg/m3]."""


class Pair(Model):
    """Contact properties of two materials (or of one with itself); symmetric.

    A law of another package may declare further keys (`gpudem.contact.law.Parameter`).
    """

    model_config = ConfigDict(extra="allow")

    materials: tuple[Name, Name]
    """The two materials; the same twice for contacts of one material with itself."""
    restitution: Annotated[float, positive("1", 1)] = 1.0
    """Coefficient of restitution e [1], 0 < e <= 1."""
    friction: Annotated[float, number("1", 0)] = 0.0
    """Coulomb friction mu [1]."""
    rolling_friction: Annotated[float, number("1", 0)] = 0.0
    """Rolling friction mu_r [1]."""
    kn: Annotated[float, number("N/m2", 0)] | None = None
    """Normal stiffness constant of `hertz/stiffness`: k_n = kn sqrt(R* overlap) [N/m2]."""
    kt: Annotated[float, number("N/m2", 0)] | None = None
    """Tangential stiffness constant of `hertz/stiffness` [N/m2]."""
    gamma_n: Annotated[float, number("1/(m s)", 0)] | None = None
    """Normal damping constant of `hertz/stiffness`: c_n = gamma_n m* sqrt(R* overlap) [1/(m s)]."""
    gamma_t: Annotated[float, number("1/(m s)", 0)] | None = None
    """Tangential damping constant of `hertz/stiffness` [1/(m s)]."""


class Contact(Model):
    """The contact law by slots, in LIGGGHTS' words.

    A law of another package may declare further keys (`gpudem.contact.law.Parameter`).
    """

    model_config = ConfigDict(extra="allow")

    normal: Annotated[str, law_name("normal")] = "hertz"
    """hertz, hertz/stiffness, hooke, or a law of another package."""
    tangential: Annotated[str, law_name("tangential")] = "history"
    """off, no_history, history, or a law of another package."""
    rolling: Annotated[str, law_name("rolling")] = "off"
    """off, cdt, epsd2, or a law of another package."""
    limit_force: Flag = False
    """Clip the normal force at zero (no attraction late in a rebound)."""
    tangential_damping: Flag = True
    """Tangential dashpot; with `no_history` it is the whole tangential force."""
    frictionless_dashpot: Flag = False
    """As in LIGGGHTS, a contact with friction 0 in a scene with friction elsewhere feels the tangential
    dashpot of `history` at each set-up (start, removal of a gate); by default it has no tangential force."""
    characteristic_velocity: Annotated[float, positive("m/s")] | None = None
    """Impact speed at which `hooke` is as stiff as `hertz` [m/s]."""


#: The numbers of particles, wherever they are stated: shape, unit, range.
POSITION, VELOCITY, ANGULAR_VELOCITY = array(3, "m"), array(3, "m/s"), array(3, "rad/s")
RADIUS = positive("m")


class Explicit(Model):
    """Particles listed one by one; lists do for arrays."""

    source: Literal["explicit"] = "explicit"
    """How particles are stated."""
    position: Annotated[np.ndarray, POSITION]
    """Centres [m], shape (n, 3)."""
    radius: Annotated[float | np.ndarray, each(RADIUS)]
    """One radius for all, or one for each [m]."""
    material: Annotated[str | tuple[str, ...], names()]
    """One material for all, or one for each."""
    velocity: Annotated[np.ndarray, VELOCITY] | None = None
    """Velocities [m/s], shape (n, 3)."""
    angular_velocity: Annotated[np.ndarray, ANGULAR_VELOCITY] | None = None
    """Angular velocities [rad/s], shape (n, 3)."""

    if TYPE_CHECKING:  # a type checker would take only what the fields are after validation

        def __init__(self, /, **data: Any): ...

    def __eq__(self, other: object) -> bool:
        """Equal values; an array and a list of the same numbers are the same."""
        if not isinstance(other, Explicit):
            return NotImplemented
        return self._columns() == other._columns()

    def __hash__(self) -> int:
        return hash(self._columns())

    def _columns(self) -> tuple[Any, ...]:
        values = (getattr(self, name) for name in type(self).model_fields)
        return tuple((v.shape, v.tobytes()) if isinstance(v, np.ndarray) else v for v in values)


class FromFile(Model):
    """Particles from a .csv, .npz or .vtu file; its columns: see `particle_files.read_particles`."""

    source: Literal["file"]
    """How particles are stated."""
    path: Annotated[str, AfterValidator(os.path.abspath)]
    """File; a relative path counts from the scene file, or from the working directory in Python."""
    material: Name | None = None
    """Material where the file has none."""
    radius: Annotated[float, RADIUS] | None = None
    """Radius where the file has none [m]."""


class RadiusShare(Model):
    """One radius of a mixture and its share by number."""

    radius: Annotated[float, RADIUS]
    """Radius [m]."""
    share: Annotated[float, positive("1")]
    """Share by number, relative to the sum of all shares [1]."""


def _countable(count: int) -> int:
    if count > MAX_PARTICLES:
        raise ValueError(f"too many for 32-bit indices; allowed: <= {MAX_PARTICLES} particles")
    return count


class Lattice(Model):
    """`count` particles on a jittered cubic lattice filling lo..hi from below."""

    source: Literal["lattice"]
    """How particles are stated."""
    material: Name
    """Material of all."""
    count: Annotated[int, Field(strict=True, gt=0), AfterValidator(_countable), BeforeValidator(as_python)]
    """Number of particles."""
    lo: Annotated[Vector, vector("m")]
    """Lower corner of the box that they fill [m]."""
    hi: Annotated[Vector, vector("m")]
    """Upper corner [m]."""
    radius: Annotated[
        Annotated[float, RADIUS, Tag("<one>")]
        | Annotated[tuple[RadiusShare, ...], Field(min_length=1), Tag("<mixture>")],
        Discriminator(lambda radius: "<mixture>" if isinstance(radius, list | tuple) else "<one>"),
    ]
    """One radius [m], or a mixture."""
    spacing: Annotated[float, number("largest diameters", 1)] = 1.05
    """Distance of neighboring lattice sites [largest diameters]."""
    jitter: Annotated[float, number("free gap", 0, 1)] = 0.9
    """Random shift as a share of the gap between lattice neighbors [1]; below 1 nothing overlaps."""
    velocity_rms: Annotated[float, number("m/s", 0)] = 0.0
    """Root mean square of each (normally distributed) velocity component [m/s]."""
    seed: Annotated[int, Field(strict=True, ge=0), BeforeValidator(as_python)] = 0
    """Seed of the random shifts, radii and velocities."""


class Vibration(Model):
    """Saw-tooth motion of a plane along its normal: it moves at `speed` over `amplitude` and snaps back.

    Amplitude 0 is the limit of a fast floor: the plane is at rest between contacts, and a particle in
    contact sees a wall velocity U until separation; hard spheres leave with v' = (1 + e) U - e v.
    """

    speed: Annotated[float, positive("m/s")]
    """U [m/s], towards the particles."""
    amplitude: Annotated[float, number("m", 0)] = 0.0
    """Stroke A [m]; the period is A / U."""


class Wall(Model):
    """What every wall states, and the geometry of an elementary one on the host (a box consists of planes).

    A kind of another package derives from it (`gpudem.walls.registry`).
    """

    kind: str
    """Kind of wall."""
    name: Name
    """Name of the wall; unique."""
    material: Name
    """Its material."""
    removed_at: Annotated[float, positive("s")] | None = None
    """The wall is a gate: it is there until this time."""

    def elements(self, lo: Vector, hi: Vector) -> list[Wall]:
        """The elementary walls of which it consists, in a domain lo..hi [m]."""
        return [self]

    def shape(self) -> tuple[Vector, Vector, Vector]:
        """(direction, point [m], size [m]) as the kind's device function reads them."""
        raise NotImplementedError

    def gap(self, points: np.ndarray) -> np.ndarray:
        """Gap [m] of points, shape (n, 3), from the wall: positive on the particles' side."""
        raise NotImplementedError

    def outline(self, lo: np.ndarray, hi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(points [m], quads) that show the wall in a domain lo..hi: shapes (p, 3), (q, 4)."""
        raise NotImplementedError

    @property
    def fast_floor(self) -> bool:
        """It stands still between contacts, and moves at its velocity under each particle in contact."""
        return False

    @property
    def speed(self) -> float:
        """Largest speed [m/s]; 0 at rest."""
        return 0.0

    @property
    def velocity(self) -> Vector:
        """Velocity [m/s] while it moves."""
        return (0.0, 0.0, 0.0)

    @property
    def stroke(self) -> float:
        """Largest displacement [m]."""
        return 0.0

    def displacement(self, time: float) -> Vector:
        """Where it is at a time [s], from its place at the start [m]."""
        return (0.0, 0.0, 0.0)


class Plane(Wall):
    """Infinite plane wall; particles live on the side its normal points to. With `removed_at`: a gate."""

    kind: Literal["plane"] = "plane"  # type: ignore[assignment]
    """Kind of wall."""
    name: Name
    """Name of the wall; unique."""
    material: Name
    """Its material."""
    point: Annotated[Vector, vector("m")]
    """A point of the plane [m]."""
    normal: Annotated[Vector, vector("1", nonzero=True)]
    """Normal of any length, towards the particles."""
    removed_at: Annotated[float, positive("s")] | None = None
    """The plane is a gate: it is there until this time [s]."""
    vibration: Vibration | None = None
    """Saw-tooth motion along the normal."""

    def elements(self, lo: Vector, hi: Vector) -> list[Wall]:
        """The plane with `unit_normal`."""
        return [self.model_copy(update={"normal": self.unit_normal})]

    def shape(self) -> tuple[Vector, Vector, Vector]:
        """(normal, point, (normal . point, 0, 0))."""
        offset = np.einsum("i,i", np.array(self.normal), np.array(self.point))
        return self.normal, self.point, (float(offset), 0.0, 0.0)

    def gap(self, points: np.ndarray) -> np.ndarray:
        """Distance [m] along the normal."""
        return (points - np.array(self.point)) @ np.array(self.normal)

    def outline(self, lo: np.ndarray, hi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A rectangle: an axis-aligned plane cut to lo..hi, a tilted one as large as its diagonal."""
        size, normal, centre = float(np.linalg.norm(hi - lo)), np.array(self.normal), (lo + hi) / 2
        foot = centre - ((centre - np.array(self.point)) @ normal) * normal
        axis = int(np.argmax(np.abs(normal)))
        u = np.roll(np.eye(3)[axis], 1)
        u -= (u @ normal) * normal
        u /= np.linalg.norm(u)
        v = np.cross(normal, u)
        half = [np.abs((hi - lo) @ d) / 2 if np.count_nonzero(normal) == 1 else size / 2 for d in (u, v)]
        corners = [foot + a * half[0] * u + b * half[1] * v for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        return np.array(corners), np.arange(4).reshape(1, 4)

    @property
    def unit_normal(self) -> Vector:
        """The normal with length one; components of it that are rounding (`NORMAL_ROUNDING`) are zero."""
        length = math.sqrt(math.fsum(c * c for c in self.normal))
        if all(c == 0 or abs(c) > NORMAL_ROUNDING * length for c in self.normal):
            x, y, z = (c / length for c in self.normal)  # mutate: unit_normal
            return x, y, z
        clean = [c if abs(c) > NORMAL_ROUNDING * length else 0.0 for c in self.normal]
        length = math.sqrt(math.fsum(c * c for c in clean))
        return clean[0] / length, clean[1] / length, clean[2] / length

    @property
    def fast_floor(self) -> bool:
        """Vibrates with amplitude 0."""
        return self.vibration is not None and self.vibration.amplitude == 0

    @property
    def speed(self) -> float:
        """U along the normal [m/s]; 0 for a plane at rest."""
        return self.vibration.speed if self.vibration else 0.0

    @property
    def velocity(self) -> Vector:
        """U along the normal [m/s]."""
        x, y, z = self.normal
        return self.speed * x, self.speed * y, self.speed * z

    @property
    def stroke(self) -> float:
        """Amplitude of a saw-tooth [m]."""
        return self.vibration.amplitude if self.vibration else 0.0

    def displacement(self, time: float) -> Vector:
        """Of a saw-tooth from its lowest place [m]."""
        (x, y, z), shift = self.normal, self.shift(time)
        return shift * x, shift * y, shift * z

    def shift(self, time: float) -> float:
        """How far along its normal a saw-tooth is from its lowest place [m]."""
        if self.vibration is None or self.fast_floor:
            return 0.0
        return self.vibration.speed * math.fmod(time, self.vibration.amplitude / self.vibration.speed)


def _along(axis: int, value: float) -> Vector:
    return (value if axis == 0 else 0.0, value if axis == 1 else 0.0, value if axis == 2 else 0.0)


class Box(Model):
    """Axis-aligned planes at the chosen sides of lo..hi (default: the domain), facing inwards."""

    kind: Literal["box"]
    """Kind of wall."""
    name: Name
    """Name of the box; its planes are called NAME_SIDE."""
    material: Name
    """Material of its planes."""
    sides: Annotated[tuple[Side, ...], Field(min_length=1)] = ("xlo", "xhi", "ylo", "yhi", "zlo", "zhi")
    """Sides that have a plane."""
    lo: Annotated[Vector, vector("m")] | None = None
    """Lower corner [m]; default: that of the domain."""
    hi: Annotated[Vector, vector("m")] | None = None
    """Upper corner [m]; default: that of the domain."""

    def elements(self, lo: Vector, hi: Vector) -> list[Wall]:
        """One plane for each side, named `<box>_<side>`."""
        corners, planes = {"lo": self.lo or lo, "hi": self.hi or hi}, []
        for side in self.sides:  # mutate: sides_of_box
            axis, sign = "xyz".index(side[0]), 1.0 if side.endswith("lo") else -1.0
            planes.append(
                Plane(
                    name=f"{self.name}_{side}",
                    material=self.material,
                    point=_along(axis, corners[side[1:]][axis]),
                    normal=_along(axis, sign),
                )
            )
        return planes


def wall_sections() -> dict[str, type[Model]]:
    """The section class of every kind of wall, those of other packages last."""
    return {"plane": Plane, "box": Box} | registry.sections()


def _wall_section(value: Any) -> Any:
    """A wall as the section of its kind, which validates it."""
    if isinstance(value, Wall | Box):
        return value
    if not isinstance(value, dict):
        raise ValueError("must be a table")
    if "kind" not in value:
        raise PydanticCustomError("union_tag_not_found", "no kind", {"discriminator": "'kind'"})
    kind = value["kind"]
    section = {"plane": Plane, "box": Box}.get(kind) if isinstance(kind, str) else None
    section = section or wall_sections().get(str(kind))
    if section is None:
        raise PydanticCustomError(
            "union_tag_invalid", "unknown kind", {"discriminator": "'kind'", "tag": str(kind)}
        )
    return TypeAdapter(section).validate_python(value)


if TYPE_CHECKING:
    WallSection = Wall | Box
else:
    WallSection = Annotated[SerializeAsAny[Model], PlainValidator(_wall_section), OneOf(wall_sections)]


class Domain(Model):
    """Where particles may be: one that leaves lo..hi is an error, except through periodic sides."""

    lo: Annotated[Vector, vector("m")]
    """Lower corner [m]."""
    hi: Annotated[Vector, vector("m")]
    """Upper corner [m]."""
    periodic: Flags = (False, False, False)
    """Whether the sides across x, y and z are periodic."""


class Time(Model):
    """Time step and length of a run."""

    step: Annotated[float, positive("s")]
    """Time step [s], or "auto": the step that `accuracy` needs (`gpudem.scene.time_step.step_for`)."""
    duration: Annotated[float, positive("s")]
    """Length of the run [s]; rounded up to whole steps, and to whole frames where frames are written."""
    accuracy: Annotated[float, number("1", 1e-6, 0.1)] | None = None
    """Of step = "auto": largest position error in a contact, as a share of its largest overlap."""


def _observable_name(value: str) -> str:
    if value in observables.ALWAYS:
        raise ValueError(f"is a column of every history; observables: {', '.join(observables.names())}")
    if observables.find(value) is None:
        raise ValueError(f"unknown observable{nearest(value, observables.names())}")
    return value


ObservableName = Annotated[str, AfterValidator(_observable_name)]


class Output(Model):
    """What is written, each at an interval in seconds, rounded to whole steps (at least one)."""

    frames_every: Annotated[float, positive("s")] | None = None
    """VTU frames of all particles."""
    trace_every: Annotated[float, positive("s")] | None = None
    """Full-precision table of every particle (for scenes of few particles)."""
    history_every: Annotated[float, positive("s")] | None = None
    """Observables in time."""
    history: Annotated[tuple[ObservableName, ...], Field(min_length=1)] | None = None
    """Names of the observables (`gpudem.output.observables`); default: kinetic, rotational and potential
    energy, contacts, front_x, centre of mass, and the work of moving walls where there are any."""
    restart_every: Annotated[float, positive("s")] | None = None
    """The exact state, from which `gpudem resume` continues; each file replaces the last. gpudem only."""

    @field_validator("history")
    @classmethod
    def _has_an_effect(cls, value: tuple[str, ...] | None, info: ValidationInfo) -> tuple[str, ...] | None:
        repeated = [name for name in value or () if value is not None and value.count(name) > 1]
        if repeated:
            raise ValueError(f"{repeated[0]!r} is named more than once")
        if value is not None and "history_every" in info.data and info.data["history_every"] is None:
            raise ValueError("has no effect without output.history_every")
        return value


class Solver(Model):
    """How gpudem computes it, where that changes the result. LIGGGHTS is always float64 and `half_step`."""

    precision: Literal["float64", "mixed", "float32"] = "float64"
    """`mixed`: positions, velocities and radii in float64, contact laws and springs in float32."""
    integrator: Literal["half_step", "path"] = "half_step"
    """`half_step`: damping sees half-step velocities, as in LIGGGHTS; first order in the step where there is
    damping. `path`: damping acts by its exact integral along the path of the overlap; second order."""
    skin: Annotated[float, positive("m")] | None = None
    """Neighbour-list skin [m]; default 0.3 of the largest radius, or of the mean one where radii differ by
    more than a factor of 2."""


class Needs(Model):
    """Which physics a scene has; arrays, kernel branches and deck lines exist only for those."""

    tangential: bool
    history: bool
    rolling: bool
    rotation: bool
    damping: bool
    gravity: bool
    walls: bool
    gate: bool
    vibration: bool
    periodic: bool
    several_materials: bool
    several_radii: bool
