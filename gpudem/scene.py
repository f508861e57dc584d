"""The whole statement of a simulation: frozen, validated, SI units. No Warp here.

A scene carries primary inputs only (young, poisson, restitution, ...); each code derives its own
coefficients from them. `Scene.from_toml`, `Scene.from_json` and the constructor give the same object.
"""

from __future__ import annotations

import functools
import hashlib
import itertools
import json
import math
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, ValidationError

from gpudem import scene_checks, scene_io
from gpudem.errors import SceneError
from gpudem.fields import Model, Name, array, number, vector
from gpudem.packing import InitialState, lattice, read_particles

Axis = Literal["x", "y", "z"]
Side = Literal["xlo", "xhi", "ylo", "yhi", "zlo", "zhi"]


class Material(Model):
    """Elastic material of particles or walls."""

    young: number("Pa", 0, 1e14, open_lo=True)
    """Young's modulus E [Pa]."""
    poisson: number("1", 0, 0.5)
    """Poisson's ratio nu [1], 0 to 0.5."""
    density: number("kg/m3", 0, 1e6, open_lo=True)
    """Density [kg/m3]."""


class Pair(Model):
    """Contact properties of two materials (or of one with itself); symmetric."""

    materials: tuple[Name, Name]
    restitution: number("1", 0, 1, open_lo=True) = 1.0
    """Coefficient of restitution e [1], 0 < e <= 1."""
    friction: number("1", 0, 10) = 0.0
    """Coulomb friction mu [1]."""
    rolling_friction: number("1", 0, 10) = 0.0
    """Rolling friction mu_r [1]."""
    kn: number("N/m2", 0) | None = None
    """Normal stiffness constant of `hertz/stiffness`: k_n = kn sqrt(R* overlap) [N/m2]."""
    kt: number("N/m2", 0) | None = None
    """Tangential stiffness constant of `hertz/stiffness` [N/m2]."""
    gamma_n: number("1/(m s)", 0) | None = None
    """Normal damping constant of `hertz/stiffness`: c_n = gamma_n m* sqrt(R* overlap) [1/(m s)]."""
    gamma_t: number("1/(m s)", 0) | None = None
    """Tangential damping constant of `hertz/stiffness` [1/(m s)]."""


class Contact(Model):
    """The contact law by slots, in LIGGGHTS' words."""

    normal: Literal["hertz", "hertz/stiffness", "hooke"] = "hertz"
    tangential: Literal["off", "no_history", "history"] = "history"
    rolling: Literal["off", "cdt"] = "off"
    limit_force: bool = False
    """Clip the normal force at zero (no attraction late in a rebound)."""
    tangential_damping: bool = True
    """Tangential dashpot; with `no_history` it is the whole tangential force."""
    characteristic_velocity: number("m/s", 0, 1e4, open_lo=True) | None = None
    """Impact speed at which `hooke` is as stiff as `hertz` [m/s]."""


class Explicit(Model):
    """Particles listed one by one."""

    source: Literal["explicit"] = "explicit"
    position: array(3, "m")
    radius: number("m", 0, 1e3, open_lo=True) | array(0, "m")
    material: Name | list[Name]
    velocity: array(3, "m/s") | None = None
    angular_velocity: array(3, "rad/s") | None = None


class FromFile(Model):
    """Particles from a .csv, .npz or .vtu file with columns position, radius, ... (see `packing.read_particles`)."""

    source: Literal["file"]
    path: str
    material: Name
    radius: number("m", 0, 1e3, open_lo=True) | None = None
    """Radius where the file has none [m]."""


class RadiusShare(Model):
    """One radius of a mixture and its share by number."""

    radius: number("m", 0, 1e3, open_lo=True)
    share: number("1", 0, open_lo=True)


class Lattice(Model):
    """`count` particles on a jittered cubic lattice filling lo..hi from below."""

    source: Literal["lattice"]
    material: Name
    count: Annotated[int, Field(gt=0, le=50_000_000)]
    lo: vector("m")
    hi: vector("m")
    radius: number("m", 0, 1e3, open_lo=True) | list[RadiusShare]
    spacing: number("largest diameters", 1, 100) = 1.05
    jitter: number("free gap", 0, 1) = 0.9
    """Random shift as a share of the gap between lattice neighbours [1]; below 1 nothing overlaps."""
    velocity_rms: number("m/s", 0) = 0.0
    """Root mean square of each (normally distributed) velocity component [m/s]."""
    seed: Annotated[int, Field(ge=0)] = 0


class Plane(Model):
    """Infinite plane wall; particles live on the side its normal points to. With `removed_at`: a gate."""

    kind: Literal["plane"] = "plane"
    name: Name
    material: Name
    point: vector("m")
    normal: vector("1")
    removed_at: number("s", 0, open_lo=True) | None = None


class Box(Model):
    """Axis-aligned planes at the chosen sides of lo..hi (default: the domain), facing inwards."""

    kind: Literal["box"]
    name: Name
    material: Name
    sides: list[Side] = ["xlo", "xhi", "ylo", "yhi", "zlo", "zhi"]
    lo: vector("m") | None = None
    hi: vector("m") | None = None


class Domain(Model):
    """Where particles may be: one that leaves lo..hi is an error, except through periodic sides."""

    lo: vector("m")
    hi: vector("m")
    periodic: tuple[bool, bool, bool] = (False, False, False)


class Time(Model):
    """Time step and length of a run."""

    step: number("s", 0, open_lo=True)
    duration: number("s", 0, open_lo=True)


class Output(Model):
    """What is kept, each as an interval in seconds, rounded to whole steps (at least one)."""

    frames_every: number("s", 0, open_lo=True) | None = None
    """VTU frames of all particles."""
    trace_every: number("s", 0, open_lo=True) | None = None
    """Full-precision table of every particle (for scenes of few particles)."""
    history_every: number("s", 0, open_lo=True) | None = None
    """Bulk quantities: energies, contacts, front, centre of mass."""


class Solver(Model):
    """How it is computed, where that changes the result."""

    precision: Literal["float64", "float32"] = "float64"
    skin: number("m", 0, open_lo=True) | None = None
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
    periodic: bool
    several_materials: bool
    several_radii: bool


class Scene(Model):
    """One simulation, stated once for every code.

    Raises:
        SceneError: listing every problem, each with key, value, unit and allowed range.
    """

    name: Name
    title: str = ""
    materials: Annotated[dict[Name, Material], Field(min_length=1)]
    pairs: list[Pair]
    contact: Contact = Contact()
    particles: Annotated[Explicit | FromFile | Lattice, Field(discriminator="source")]
    gravity: vector("m/s2") = (0.0, 0.0, 0.0)
    walls: list[Annotated[Plane | Box, Field(discriminator="kind")]] = []
    domain: Domain
    time: Time
    output: Output = Output()
    solver: Solver = Solver()
    allow: list[Literal["time_step", "unusual_units", "overlap"]] = []
    """Checks waived by name for this scene."""

    def __init__(self, /, _source: str = "<python>", **data: Any):
        try:
            super().__init__(**data)
        except ValidationError as error:
            raise SceneError(_source, scene_io.problems(error, type(self))) from None
        found = scene_checks.problems(self)
        if found:
            raise SceneError(_source, found)

    # -- reading and writing -------------------------------------------------------------------------------

    @classmethod
    def from_toml(cls, path: str | Path) -> Scene:
        """Read a scene file; relative particle paths count from its folder. Raises SceneError."""
        return cls(_source=str(path), **scene_io.read_toml(Path(path)))

    @classmethod
    def from_json(cls, text: str, source: str = "<json>") -> Scene:
        """Read what `to_json` wrote. Raises SceneError."""
        return cls(_source=source, **scene_io.parse_json(text, source))

    def to_json(self) -> str:
        """The resolved scene as JSON, floats with 17 digits."""
        return json.dumps(self.model_dump(mode="json"), indent=1)

    def replace(self, **changes: Any) -> Scene:
        """A copy with other values, e.g. `scene.replace(time={"step": 1e-6}, gravity=(0, 0, 0))`; validated anew.

        A mapping changes the given keys of that section and keeps the rest.
        """
        data = self.model_dump(exclude_unset=True)
        for key, value in changes.items():
            merge = isinstance(value, dict) and isinstance(data.get(key), dict)
            data[key] = {**data[key], **value} if merge else value
        return type(self)(**data)

    @property
    def hash(self) -> str:
        """SHA-256 of the physics (everything but name and title)."""
        data = self.model_dump(mode="json", exclude={"name", "title"})
        return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()

    # -- what follows from the statement -------------------------------------------------------------------

    @functools.cached_property
    def state(self) -> InitialState:
        """Positions, velocities, radii, materials at t = 0, the same numbers for every code."""
        p = self.particles
        if isinstance(p, Lattice):
            return lattice(p, self.material_index)
        if isinstance(p, FromFile):
            return read_particles(Path(p.path), p.radius, self.material_index[p.material])
        return InitialState.from_explicit(p, self.material_index)

    @functools.cached_property
    def material_index(self) -> dict[str, int]:
        """Material name -> index in order of statement; the same order in every code."""
        return {name: i for i, name in enumerate(self.materials)}

    def pair(self, a: str, b: str) -> Pair | None:
        """Properties of a material pair, in either order; None if not stated."""
        return next((p for p in self.pairs if set(p.materials) == {a, b}), None)

    @functools.cached_property
    def particle_materials(self) -> list[str]:
        """Names of the materials that particles are made of, in order of statement."""
        used = set(np.unique(self.state.material).tolist())
        return [name for name, i in self.material_index.items() if i in used]

    @functools.cached_property
    def planes(self) -> list[Plane]:
        """All walls as planes: boxes taken apart, named `<box>_<side>`; normals of length one."""
        planes: list[Plane] = []
        for wall in self.walls:
            if isinstance(wall, Plane):
                length = math.sqrt(math.fsum(c * c for c in wall.normal))
                planes.append(wall.model_copy(update={"normal": tuple(c / length for c in wall.normal)}))
                continue
            corners = {"lo": wall.lo or self.domain.lo, "hi": wall.hi or self.domain.hi}
            for side in wall.sides:
                axis, sign = "xyz".index(side[0]), 1.0 if side.endswith("lo") else -1.0
                normal = tuple(sign if k == axis else 0.0 for k in range(3))
                point = tuple(corners[side[1:]][k] if k == axis else 0.0 for k in range(3))
                planes.append(
                    Plane(name=f"{wall.name}_{side}", material=wall.material, point=point, normal=normal)
                )
        return planes

    @functools.cached_property
    def contact_pairs(self) -> list[Pair]:
        """The pairs that can meet in this scene: particle with particle, particle with wall."""
        ours, walls = self.particle_materials, {w.material for w in self.walls}
        keys = {frozenset((a, b)) for a, b in itertools.product(ours, [*ours, *walls])}
        return [p for p in self.pairs if frozenset(p.materials) in keys]

    @functools.cached_property
    def needs(self) -> Needs:
        """Which physics this scene has."""
        state, pairs = self.state, self.contact_pairs
        tangential = self.contact.tangential != "off" and any(p.friction > 0 for p in pairs)
        rolling = self.contact.rolling != "off" and any(p.rolling_friction > 0 for p in pairs)
        stiffness = self.contact.normal == "hertz/stiffness"
        return Needs(
            tangential=tangential,
            history=tangential and self.contact.tangential == "history",
            rolling=rolling,
            rotation=tangential or rolling or bool(np.any(state.angular_velocity)),
            damping=any((p.gamma_n or 0) > 0 if stiffness else p.restitution < 1 for p in pairs),
            gravity=any(self.gravity),
            walls=bool(self.walls),
            gate=any(p.removed_at is not None for p in self.planes),
            periodic=any(self.domain.periodic),
            several_materials=len(self.particle_materials) > 1,
            several_radii=bool(np.ptp(state.radius) > 0),
        )

    @property
    def skin(self) -> float:
        """Neighbour-list skin [m]."""
        return self.solver.skin or 0.3 * float(self.state.radius.max())

    # -- time in steps, the same for every code ------------------------------------------------------------

    def steps(self, seconds: float) -> int:
        """A time as whole steps."""
        return round(seconds / self.time.step)

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
        return max(1, math.ceil(self.steps(self.time.duration) / self.frame_stride - 1e-9)) * self.frame_stride

    @property
    def segments(self) -> list[tuple[int, int, list[Plane]]]:
        """(first step, last step, planes present) between gate removals; forces are set up anew at each start."""
        events = sorted({self.steps(p.removed_at) for p in self.planes if p.removed_at is not None})
        edges = [0, *(e for e in events if 0 < e < self.n_steps), self.n_steps]
        return [
            (a, b, [p for p in self.planes if p.removed_at is None or self.steps(p.removed_at) > a])
            for a, b in itertools.pairwise(edges)
        ]
