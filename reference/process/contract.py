"""The files of the contract as models: `scene.json` that a code is given, `run.json` that it may write.

The JSON schemas are made from these models and published in `data/`; `python -m reference.process.contract`
writes them anew. A change that an existing adapter cannot read counts VERSION up.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

VERSION = 1
#: Names in the folder that a code is given, and in the one that it writes.
SCENE, PARTICLES, PARTICLES_VTU = "scene.json", "particles.csv", "particles.vtu"
TABLE, CONTACTS, PVD, RUN = "states.csv", "contacts.csv", "run.pvd", "run.json"
#: Exit status by which a code says that it cannot run a scene; its standard error says why.
CANNOT_STATE = 77
#: Largest distance of a written time from a requested one, in time steps.
TIME_TOLERANCE = 0.01
#: The scheme of which agreement step by step is required.
HALF_STEP = "half_step"

Vector = tuple[float, float, float]


class Section(BaseModel):
    """Base of the parts of a file."""

    model_config = ConfigDict(extra="forbid", use_attribute_docstrings=True, frozen=True)


class Steps(Section):
    """The time step, and how many steps there are."""

    dt: float
    """Time step [s]."""
    count: int
    """Number of steps; the run ends at count * dt."""


class Wanted(Section):
    """The states to write, t = 0 among them."""

    steps: list[int]
    """Steps, increasing; 0 is the initial state."""
    times: list[float]
    """The same as times [s], steps * dt."""


class MaterialFacts(Section):
    """Elastic material."""

    young: float
    """Young's modulus E [Pa]."""
    poisson: float
    """Poisson's ratio nu [1]."""
    density: float
    """Density rho [kg/m3]; the mass of a particle is 4/3 pi R^3 rho."""


class PairFacts(BaseModel):
    """Contact properties of two materials, in either order. A law of another package may add keys."""

    model_config = ConfigDict(extra="allow", use_attribute_docstrings=True, frozen=True)

    materials: tuple[str, str]
    restitution: float
    """Coefficient of restitution e [1]."""
    friction: float
    """Coulomb friction mu [1]."""
    rolling_friction: float
    """Rolling friction mu_r [1]."""
    kn: float | None = None
    """Of `hertz/stiffness` [N/m2] or `hooke/stiffness` [N/m]."""
    kt: float | None = None
    """Of `hertz/stiffness` [N/m2] or `hooke/stiffness` [N/m]."""
    gamma_n: float | None = None
    """Of `hertz/stiffness` [1/(m s)] or `hooke/stiffness` [1/s]."""
    gamma_t: float | None = None
    """Of `hertz/stiffness` [1/(m s)] or `hooke/stiffness` [1/s]."""


class ContactFacts(BaseModel):
    """The contact law by name, and its switches. A law of another package may add keys."""

    model_config = ConfigDict(extra="allow", use_attribute_docstrings=True, frozen=True)

    normal: str
    """hertz, hertz/stiffness, hooke, hooke/stiffness, jkr, or another."""
    tangential: str
    """off, no_history, history, history_rotated, history_incremental, history_capped, or
    another."""
    rolling: str
    """off, cdt, epsd, epsd2, epsd3, or another."""
    cohesion: str = "off"
    """off, sjkr, sjkr2, or another."""
    tangential_reduce: bool = False
    """The limits of friction and rolling torque are of the normal force with cohesion."""
    torsion: bool = False
    """The rolling law resists the relative spin along the normal too."""
    limit_force: bool
    """The normal force is clipped at zero."""
    tangential_damping: bool
    """With the tangential dashpot."""
    frictionless_dashpot: bool
    """Contacts with friction 0 have the tangential dashpot at a set-up (a property of LIGGGHTS)."""
    characteristic_velocity: float | None = None
    """Of `hooke` [m/s]."""


class VibrationFacts(Section):
    """Saw-tooth motion along the normal: at `speed` over `amplitude`, then back at once."""

    speed: float
    """[m/s]"""
    amplitude: float
    """[m]; 0: the wall is at rest, and moves at `speed` as long as a particle is in contact with it."""


class WallFacts(Section):
    """An infinite plane; particles are on the side to which the normal points. Boxes are given as planes."""

    name: str
    material: str
    point: Vector
    """A point of the plane [m]."""
    normal: Vector
    """Of length one."""
    removed_at: float | None
    """Time [s] until which the wall is present; null: always."""
    removed_at_step: int | None
    """The same as a step: it acts in this step, and no longer in the next."""
    vibration: VibrationFacts | None


class ParticleFacts(Section):
    """Particles at t = 0, one entry each; `particles.csv` and `particles.vtu` hold the same."""

    id: list[int]
    """1 to n."""
    material: list[str]
    radius: list[float]
    """[m]"""
    position: list[Vector]
    """Centers [m]."""
    velocity: list[Vector]
    """[m/s]"""
    angular_velocity: list[Vector]
    """[rad/s]"""


class DomainFacts(Section):
    """Where particles may be; a particle that leaves through a side that is not periodic is an error."""

    lo: Vector
    """[m]"""
    hi: Vector
    """[m]"""
    periodic: tuple[bool, bool, bool]


class SceneFacts(Section):
    """scene.json: a complete simulation in SI units, primary inputs only."""

    format: Literal["gpudem.own_code.scene"] = "gpudem.own_code.scene"
    version: Literal[1] = VERSION
    name: str
    title: str
    steps: Steps
    wanted: Wanted
    gravity: Vector
    """[m/s2]"""
    domain: DomainFacts
    materials: dict[str, MaterialFacts]
    pairs: list[PairFacts]
    contact: ContactFacts
    walls: list[WallFacts]
    particles: ParticleFacts


class RunFacts(Section):
    """run.json: what a code says of itself. The file and each key are optional."""

    name: Annotated[str, Field(max_length=100)] = ""
    version: Annotated[str, Field(max_length=100)] = ""
    scheme: Annotated[str, Field(max_length=100)] = ""
    """"half_step": the scheme of this contract, for agreement step by step; else any name."""
    time_step: Annotated[float, Field(gt=0)] | None = None
    """Time step that was used [s], if it is not that of the scene."""
    wrapped: bool = True
    """False: positions follow particles through periodic sides, and may lie outside the domain."""
    stepping_s: Annotated[float, Field(ge=0)] | None = None
    """Wall-clock time of stepping [s], without set-up and output."""
    threads: Annotated[int, Field(ge=1)] = 1


SCHEMAS: dict[str, type[BaseModel]] = {"scene": SceneFacts, "run": RunFacts}


def schema_path(name: str) -> Path:
    """The published schema file of one of SCHEMAS."""
    return Path(__file__).parent / "data" / f"{name}.schema.json"


def schema_text(name: str) -> str:
    """The JSON schema as its model states it."""
    schema = SCHEMAS[name].model_json_schema()
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    return json.dumps(schema, indent=1, sort_keys=True) + "\n"


if __name__ == "__main__":
    for each in SCHEMAS:
        schema_path(each).write_text(schema_text(each))
