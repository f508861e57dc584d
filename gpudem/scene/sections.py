"""The sections of a scene, each with its keys, units and defaults: what a scene file may say.

[materials.NAME]  [[pairs]]  [contact]  [particles]  [[walls]]  [domain]  [time]  [output]  [solver]
"""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, Discriminator, Field, StrictBool, Tag

from gpudem.scene.types import Model, Name, Vector, array, each, names, number, positive, vector

Side = Literal["xlo", "xhi", "ylo", "yhi", "zlo", "zhi"]


class Material(Model):
    """Elastic material of particles or walls."""

    young: Annotated[float, positive("Pa", 1e14)]
    """Young's modulus E [Pa]."""
    poisson: Annotated[float, number("1", 0, 0.5)]
    """Poisson's ratio nu [1], 0 to 0.5."""
    density: Annotated[float, positive("kg/m3", 1e6)]
    """Density [kg/m3]."""


class Pair(Model):
    """Contact properties of two materials (or of one with itself); symmetric."""

    materials: tuple[Name, Name]
    restitution: Annotated[float, positive("1", 1)] = 1.0
    """Coefficient of restitution e [1], 0 < e <= 1."""
    friction: Annotated[float, number("1", 0, 10)] = 0.0
    """Coulomb friction mu [1]."""
    rolling_friction: Annotated[float, number("1", 0, 10)] = 0.0
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
    """The contact law by slots, in LIGGGHTS' words."""

    normal: Literal["hertz", "hertz/stiffness", "hooke"] = "hertz"
    tangential: Literal["off", "no_history", "history"] = "history"
    rolling: Literal["off", "cdt", "epsd2"] = "off"
    limit_force: StrictBool = False
    """Clip the normal force at zero (no attraction late in a rebound)."""
    tangential_damping: StrictBool = True
    """Tangential dashpot; with `no_history` it is the whole tangential force."""
    characteristic_velocity: Annotated[float, positive("m/s", 1e4)] | None = None
    """Impact speed at which `hooke` is as stiff as `hertz` [m/s]."""


class Explicit(Model):
    """Particles listed one by one; lists do for arrays."""

    source: Literal["explicit"] = "explicit"
    position: Annotated[np.ndarray, array(3, "m")]
    radius: Annotated[float | np.ndarray, each(positive("m", 1e3))]
    """One radius for all, or one for each [m]."""
    material: Annotated[str | tuple[str, ...], names()]
    """One material for all, or one for each."""
    velocity: Annotated[np.ndarray, array(3, "m/s")] | None = None
    angular_velocity: Annotated[np.ndarray, array(3, "rad/s")] | None = None

    if TYPE_CHECKING:  # a type checker would take only what the fields are after validation

        def __init__(self, /, **data: Any): ...


class FromFile(Model):
    """Particles from a .csv, .npz or .vtu file; its columns: see `packing.read_particles`."""

    source: Literal["file"]
    path: Annotated[str, AfterValidator(os.path.abspath)]
    """File; a relative path counts from the scene file, or from the working directory in Python."""
    material: Name
    radius: Annotated[float, positive("m", 1e3)] | None = None
    """Radius where the file has none [m]."""


class RadiusShare(Model):
    """One radius of a mixture and its share by number."""

    radius: Annotated[float, positive("m", 1e3)]
    share: Annotated[float, positive("1")]


class Lattice(Model):
    """`count` particles on a jittered cubic lattice filling lo..hi from below."""

    source: Literal["lattice"]
    material: Name
    count: Annotated[int, Field(strict=True, gt=0, le=50_000_000)]
    lo: Annotated[Vector, vector("m")]
    hi: Annotated[Vector, vector("m")]
    radius: Annotated[
        Annotated[float, positive("m", 1e3), Tag("<one>")]
        | Annotated[tuple[RadiusShare, ...], Field(min_length=1), Tag("<mixture>")],
        Discriminator(lambda radius: "<mixture>" if isinstance(radius, list | tuple) else "<one>"),
    ]
    """One radius [m], or a mixture."""
    spacing: Annotated[float, number("largest diameters", 1, 100)] = 1.05
    jitter: Annotated[float, number("free gap", 0, 1)] = 0.9
    """Random shift as a share of the gap between lattice neighbours [1]; below 1 nothing overlaps."""
    velocity_rms: Annotated[float, number("m/s", 0)] = 0.0
    """Root mean square of each (normally distributed) velocity component [m/s]."""
    seed: Annotated[int, Field(strict=True, ge=0)] = 0


class Vibration(Model):
    """Saw-tooth motion of a plane along its normal: it moves at `speed` over `amplitude` and snaps back.

    Amplitude 0 is the limit of a fast floor: the plane stands still between contacts, and whoever meets it
    finds it moving at `speed` until they part; hard spheres leave with v' = (1 + e) U - e v.
    """

    speed: Annotated[float, positive("m/s", 1e4)]
    """U [m/s], towards the particles."""
    amplitude: Annotated[float, number("m", 0, 1e3)] = 0.0
    """Stroke A [m]; the period is A / U."""


class Plane(Model):
    """Infinite plane wall; particles live on the side its normal points to. With `removed_at`: a gate."""

    kind: Literal["plane"] = "plane"
    name: Name
    material: Name
    point: Annotated[Vector, vector("m")]
    normal: Annotated[Vector, vector("1", nonzero=True)]
    removed_at: Annotated[float, positive("s")] | None = None
    vibration: Vibration | None = None

    @property
    def fast_floor(self) -> bool:
        """Vibrates with amplitude 0."""
        return self.vibration is not None and self.vibration.amplitude == 0

    @property
    def speed(self) -> float:
        """U along the normal [m/s]; 0 for a plane at rest."""
        return self.vibration.speed if self.vibration else 0.0

    def shift(self, time: float) -> float:
        """How far along its normal a saw-tooth is from its lowest place [m]."""
        if self.vibration is None or self.fast_floor:
            return 0.0
        return self.vibration.speed * math.fmod(time, self.vibration.amplitude / self.vibration.speed)


class Box(Model):
    """Axis-aligned planes at the chosen sides of lo..hi (default: the domain), facing inwards."""

    kind: Literal["box"]
    name: Name
    material: Name
    sides: Annotated[tuple[Side, ...], Field(min_length=1)] = ("xlo", "xhi", "ylo", "yhi", "zlo", "zhi")
    lo: Annotated[Vector, vector("m")] | None = None
    hi: Annotated[Vector, vector("m")] | None = None


class Domain(Model):
    """Where particles may be: one that leaves lo..hi is an error, except through periodic sides."""

    lo: Annotated[Vector, vector("m")]
    hi: Annotated[Vector, vector("m")]
    periodic: tuple[StrictBool, StrictBool, StrictBool] = (False, False, False)


class Time(Model):
    """Time step and length of a run."""

    step: Annotated[float, positive("s")]
    """Or "auto": the step that `accuracy` needs (`gpudem.scene.time_step.step_for`)."""
    duration: Annotated[float, positive("s")]
    accuracy: Annotated[float, number("1", 1e-6, 0.1)] | None = None
    """Of step = "auto": largest position error in a contact, as a share of its largest overlap."""


class Output(Model):
    """What is kept, each as an interval in seconds, rounded to whole steps (at least one)."""

    frames_every: Annotated[float, positive("s")] | None = None
    """VTU frames of all particles."""
    trace_every: Annotated[float, positive("s")] | None = None
    """Full-precision table of every particle (for scenes of few particles)."""
    history_every: Annotated[float, positive("s")] | None = None
    """Bulk quantities: energies, contacts, front, centre of mass."""
    restart_every: Annotated[float, positive("s")] | None = None
    """The exact state, from which `gpudem resume` goes on; each file replaces the last. gpudem alone."""


class Solver(Model):
    """How gpudem computes it, where that changes the result. LIGGGHTS is always float64 and `half_step`."""

    precision: Literal["float64", "mixed", "float32"] = "float64"
    """`mixed`: positions, velocities and radii in float64, contact laws and springs in float32."""
    integrator: Literal["half_step", "path"] = "half_step"
    """`half_step`: damping sees half-step velocities, as in LIGGGHTS; first order in the step where there is
    damping. `path`: damping acts by its exact integral along the path of the overlap; second order."""
    skin: Annotated[float, positive("m")] | None = None
    """Neighbour-list skin [m]; default 0.3 of the largest radius."""


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
