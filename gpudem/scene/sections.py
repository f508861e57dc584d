"""The sections of a scene, each with its keys, units and defaults: what a scene file may state.

[materials.NAME]  [[pairs]]  [contact]  [particles]  [[walls]]  [domain]  [time]  [output]  [solver]
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    ValidationInfo,
    field_validator,
    model_validator,
)

from gpudem.output import observables
from gpudem.scene.distributions import Size
from gpudem.scene.files import nearest
from gpudem.scene.regions import FaceSection
from gpudem.scene.types import (
    Flag,
    Flags,
    Model,
    Name,
    Side,
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

#: Keys of `[contact]` that a hash leaves out at their default: older scenes keep their hash.
LATER_OF_CONTACT = {"cohesion": "off", "tangential_reduce": False, "torsion": False}
#: Keys of `[contact]` that have no effect without meshes.
OF_MESHES = ("mesh_contacts", "merge_angle", "mesh_curvature")
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
    kn: Annotated[float, number("N/m2, hooke/stiffness N/m", 0)] | None = None
    """Normal stiffness constant of `hertz/stiffness`: k_n = kn sqrt(R* overlap) [N/m2]; of `hooke/stiffness`:
    k_n = kn [N/m]."""
    kt: Annotated[float, number("N/m2, hooke/stiffness N/m", 0)] | None = None
    """Tangential stiffness constant of `hertz/stiffness` [N/m2], of `hooke/stiffness` [N/m]."""
    gamma_n: Annotated[float, number("1/(m s), hooke/stiffness 1/s", 0)] | None = None
    """Normal damping constant of `hertz/stiffness`: c_n = gamma_n m* sqrt(R* overlap) [1/(m s)]; of
    `hooke/stiffness`: c_n = gamma_n m* [1/s]."""
    gamma_t: Annotated[float, number("1/(m s), hooke/stiffness 1/s", 0)] | None = None
    """Tangential damping constant of `hertz/stiffness` [1/(m s)], of `hooke/stiffness` [1/s]."""


class Contact(Model):
    """The contact law by slots, in LIGGGHTS' words.

    A law of another package may declare further keys (`gpudem.contact.law.Parameter`).
    """

    model_config = ConfigDict(extra="allow")

    normal: Annotated[str, law_name("normal")] = "hertz"
    """hertz, hertz/stiffness, hooke, hooke/stiffness, jkr, or a law of another package."""
    tangential: Annotated[str, law_name("tangential")] = "history"
    """off, no_history, history, history_rotated, history_incremental, history_capped, or
    a law of another package."""
    rolling: Annotated[str, law_name("rolling")] = "off"
    """off, cdt, epsd, epsd2, epsd3, or a law of another package."""
    cohesion: Annotated[str, law_name("cohesion")] = "off"
    """off, sjkr, sjkr2, or a law of another package."""
    limit_force: Flag = False
    """Clip the normal force at zero (no attraction late in a rebound)."""
    tangential_reduce: Flag = False
    """The limits of friction and rolling torque are of the normal force with cohesion; else they leave it
    out."""
    torsion: Flag = False
    """The rolling law resists the relative spin along the normal too (twisting friction)."""
    tangential_damping: Flag = True
    """Tangential dashpot; with `no_history` it is the whole tangential force."""
    frictionless_dashpot: Flag = False
    """As in LIGGGHTS, a contact with friction 0 in a scene with friction elsewhere feels the tangential
    dashpot of `history` at each set-up (start, removal of a gate); by default it has no tangential force."""
    mesh_contacts: Literal["unique", "liggghts"] = "unique"
    """Which triangles near a particle count. `unique`: one contact for each place where the surface is
    nearest, whatever the triangles; `liggghts`: its rule, for agreement to rounding."""
    merge_angle: Annotated[float, number("deg", 0, 90)] = 21.0
    """With `unique`: contacts with meshes whose normals differ by less are one, the deepest [deg]."""
    mesh_curvature: Annotated[float, number("deg", 0, 180)] = 0.256235
    """With `liggghts`: triangles whose normals differ by no more are one face (its `curvature`) [deg]."""
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
    at_rest: Flag = False
    """Velocities and angular velocities of the file count as 0: of a bed that groups hold."""


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
        Annotated[Size, Tag("<one>")]
        | Annotated[tuple[RadiusShare, ...], Field(min_length=1), Tag("<mixture>")],
        Discriminator(lambda radius: "<mixture>" if isinstance(radius, list | tuple) else "<one>"),
    ]
    """One radius [m], a mixture, or a distribution of radii as of `[[insert]]`, drawn by the seed."""
    spacing: Annotated[float, number("largest diameters", 1)] = 1.05
    """Distance of neighboring lattice sites [largest diameters]; of a distribution the largest drawn."""
    jitter: Annotated[float, number("free gap", 0, 1)] = 0.9
    """Random shift as a share of the gap between lattice neighbors [1]; below 1 nothing overlaps."""
    velocity_rms: Annotated[float, number("m/s", 0)] = 0.0
    """Root mean square of each (normally distributed) velocity component [m/s]."""
    seed: Annotated[int, Field(strict=True, ge=0), BeforeValidator(as_python)] = 0
    """Seed of the random shifts, radii and velocities."""


class Domain(Model):
    """Where particles may be: one that leaves lo..hi is an error, except through periodic or open sides."""

    lo: Annotated[Vector, vector("m")]
    """Lower corner [m]."""
    hi: Annotated[Vector, vector("m")]
    """Upper corner [m]."""
    periodic: Flags = (False, False, False)
    """Whether the sides across x, y and z are periodic."""
    sides: dict[Side, Literal["outflow"]] = Field(default_factory=dict)
    """Open sides, of `xlo`, `xhi`, `ylo`, `yhi`, `zlo`, `zhi`: at the first rebuild of the neighbor list that
    finds its center beyond one, a particle leaves the run; it is counted in the history."""


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


class FlowPlane(Model):
    """A plane across the domain, or a face in it, through which flow is counted; it acts on nothing."""

    name: Name
    """Name of its columns of the history."""
    point: Annotated[Vector, vector("m")] | None = None
    """A point of the plane [m]."""
    normal: Annotated[Vector, vector("1", nonzero=True)] | None = None
    """The direction in which flow counts as positive, of any length."""
    face: FaceSection | None = None
    """In the place of point and normal: a `disc` or a `rectangle`. A particle passes where the path of its
    center meets it. Positive is the flow along the axis of a disc, and along the cross product of the first
    and the second edge of a rectangle."""

    @model_validator(mode="after")
    def _one_surface(self) -> FlowPlane:
        plane = [key for key in ("point", "normal") if getattr(self, key) is not None]
        if self.face is not None and plane:
            raise ValueError(
                f"face: beside {' and '.join(plane)}; state a face, or the point and normal of a plane"
            )
        if self.face is None and len(plane) < 2:
            missing = next(key for key in ("point", "normal") if key not in plane)
            raise ValueError(
                f"{missing}: missing; a plane has point and normal, and a face of limited size has face"
            )
        return self

    @property
    def origin(self) -> np.ndarray:
        """A point of it [m]: of a face its center."""
        return np.array(self.point) if self.face is None else self.face.middle

    @property
    def direction(self) -> np.ndarray:
        """Along the flow that counts as positive: the stated normal, or the unit normal of the face."""
        return np.array(self.normal) if self.face is None else self.face.normal


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
    wall_forces: tuple[Name, ...] = ()
    """Names of walls (of a box: of its planes) whose force, torque and work the history has:
    `force_NAME_x` [N], `torque_NAME_x` [N m], ..., `work_NAME` [J]."""
    flow: tuple[FlowPlane, ...] = ()
    """Planes and faces whose net flow the history has: `flow_count_NAME` [1] and `flow_mass_NAME` [kg]
    since the start, `flow_rate_NAME` [kg/s] since the row before."""
    wall_stress: tuple[Name, ...] = ()
    """Names of meshes whose frames (`frames/walls_<step>.vtu`) have pressure and shear stress [Pa] of each
    triangle: the force of the particles on it by its area, along its normal and within it."""
    group_forces: tuple[Name, ...] = ()
    """Names of groups; the history has what free particles do to them: `force_NAME_x` [N], ...,
    `torque_NAME_z` [N m], without their weight, the torque about the group's `reference`."""
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
    cohesion: bool
    held: bool
