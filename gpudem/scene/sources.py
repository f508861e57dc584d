"""Particles drawn at random and inserted into a region or through a face: resolved into lists before the run.

    pack      a region is filled once, or every so often until the stated number or mass has come
    rate      so many particles, or so much mass, a second, in a region
    stream    the same through a face, pushed along a velocity

Positions, radii, materials and velocities follow from the statement, its seed and its number among the
insertions (NumPy's PCG64). Every code gets the same list.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from gpudem.scene import distributions
from gpudem.scene.distributions import SHARE, Size
from gpudem.scene.packing import InitialState
from gpudem.scene.particle_files import ParticleFile
from gpudem.scene.placement import CLEARANCE, Flight, place
from gpudem.scene.regions import FaceSection, Region, RegionSection
from gpudem.scene.sections import MAX_PARTICLES
from gpudem.scene.types import Model, Name, Vector, as_python, number, positive, vector

if TYPE_CHECKING:
    from gpudem.scene.sections import Material

#: Largest volume fraction that may be requested: the densest packing of equal spheres has 0.7405.
MAX_FRACTION = 0.74
#: Particles considered for one filling: so much of the region, a little beyond what random addition reaches.
FILLING = 0.4
#: With further fillings: share taken of those that fitted where some did not; how many more the next tries.
SHORTER, MORE = 0.9, 1.25
#: A layer of a stream: its cross-sections cover at most this share of the area in which centers may lie.
COVERED = 0.4
#: Particles drawn at once for a mass.
DRAWN = 256


@dataclasses.dataclass(frozen=True)
class Surroundings:
    """What a source needs of its scene."""

    materials: dict[str, Material]
    """In order of statement."""
    step: float
    """Time step [s]; 0 where it is not known yet."""
    end: float
    """Length of the run [s]."""
    lo: np.ndarray
    """Lower corner of the domain [m]."""
    hi: np.ndarray
    """Upper corner [m]."""
    number: int
    """Which insertion of the scene it is, from 0."""
    flight: Flight
    """Particles of the start and of insertions stated before."""

    def on_step(self, time: float) -> float:
        """A time rounded to whole steps, at least one [s]."""
        return max(1, round(time / self.step)) * self.step if self.step else time

    def require_inside(self, key: str, region: Region) -> None:
        """Raises ValueError: a region that cannot be, or that reaches out of the domain."""
        try:
            low, high = region.bounds()
        except ValueError as error:  # of a mesh
            raise ValueError(f"{key}.{error}") from None
        tolerance = 1e-9 * (self.hi - self.lo)
        if (low < self.lo - tolerance).any() or (high > self.hi + tolerance).any():
            raise ValueError(
                f"{key}: reaches from {_point(low)} to {_point(high)} m, outside the domain"
                f" {_point(self.lo)} .. {_point(self.hi)} m"
            )


def _point(values: np.ndarray) -> str:
    return f"({', '.join(f'{v:.6g}' for v in values)})"


class Part(Model):
    """One kind of particle of a mixture."""

    material: Name
    """Its material."""
    radius: Size
    """One radius [m], or a distribution of radii."""
    share: Annotated[float, SHARE]
    """Its share [1]; the shares of a mixture add up to 1."""


class Source(Model):
    """What all random insertions state."""

    material: Name | None = None
    """Material of all; or a mixture."""
    radius: Size | None = None
    """One radius for all [m], or a distribution of radii; or a mixture."""
    mixture: Annotated[tuple[Part, ...], Field(min_length=1)] | None = None
    """In the place of material and radius: kinds of particles with their shares."""
    share_by: Literal["number", "mass"] = "number"
    """Whether the shares of a mixture are of the number of particles or of their mass."""
    velocity: Annotated[Vector, vector("m/s")] = (0.0, 0.0, 0.0)
    """Mean velocity [m/s]."""
    velocity_spread: Annotated[float, number("m/s", 0)] = 0.0
    """Standard deviation of each component of the velocity, normally distributed [m/s]."""
    angular_velocity: Annotated[Vector, vector("rad/s")] = (0.0, 0.0, 0.0)
    """Angular velocity of all [rad/s]."""
    attempts: Annotated[int, Field(strict=True, ge=1, le=100_000), BeforeValidator(as_python)] = 1000
    """Points tried for each particle at each insertion, before it is left out."""
    seed: Annotated[int, Field(strict=True, ge=0), BeforeValidator(as_python)] = 0
    """Seed of everything that is drawn."""

    @model_validator(mode="after")
    def _one_statement_of_particles(self) -> Source:
        if self.mixture is not None:
            for key in ("material", "radius"):
                if getattr(self, key) is not None:
                    raise ValueError(f"{key}: stands in the mixture; state one of both")
            distributions.require_shares("mixture.share", tuple(part.share for part in self.mixture))
            return self
        if self.share_by == "mass":
            raise ValueError("share_by = 'mass': no effect without a mixture")
        for key, unit in (("material", ""), ("radius", " [m]")):
            if getattr(self, key) is None:
                raise ValueError(f"{key}: missing{unit}; or state a mixture")
        return self

    @property
    def parts(self) -> tuple[Part, ...]:
        """The kinds of particles."""
        if self.mixture is not None:
            return self.mixture
        assert self.material is not None
        assert self.radius is not None
        return (Part(material=self.material, radius=self.radius, share=1.0),)

    @property
    def material_names(self) -> list[tuple[str, str]]:
        """Key and name of each material that it states."""
        if self.mixture is None:
            return [("material", self.parts[0].material)]
        return [(f"mixture[{k}].material", part.material) for k, part in enumerate(self.mixture)]

    def resolve(self, around: Surroundings) -> ParticleFile:
        """All its particles with their times. Raises ValueError naming the key."""
        raise NotImplementedError


def _require_possible(stated: str, count: float) -> None:
    """Raises ValueError: more particles than a scene may have."""
    if count > MAX_PARTICLES:
        raise ValueError(f"{stated}: about {count:.3g} particles; allowed: <= {MAX_PARTICLES}")


class _Drawn:
    """Particles of a source, drawn in order: radius, material, mass."""

    def __init__(self, source: Source, around: Surroundings):
        self.source, self.materials = source, around.materials
        self.rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence((source.seed, around.number))))
        shares = np.array([part.share for part in source.parts])
        self.part_mass = np.array([
            4 / 3 * np.pi * distributions.moment(part.radius, 3) * around.materials[part.material].density
            for part in source.parts
        ])  # fmt: skip
        if source.share_by == "mass":
            shares = shares / self.part_mass  # mutate: mixture_by_mass
        self.shares = shares / shares.sum()
        self.radius, self.material, self.mass = np.empty(0), np.empty(0, np.int32), np.empty(0)

    def moment(self, power: int) -> float:
        """Mean of radius^power [m^power]."""
        parts = self.source.parts
        return float(
            sum(s * distributions.moment(p.radius, power) for s, p in zip(self.shares, parts, strict=True))
        )

    def mean(self, what: str) -> float:
        """Mean "mass" [kg] or "volume" [m3] of a particle."""
        return float(self.shares @ self.part_mass) if what == "mass" else 4 / 3 * np.pi * self.moment(3)

    def amounts(self, what: str) -> np.ndarray:
        """Of each particle the "mass" [kg] or "volume" [m3]."""
        return self.mass if what == "mass" else 4 / 3 * np.pi * self.radius**3

    def draw(self, count: int) -> None:
        """So many more particles."""
        parts, index = self.source.parts, list(self.materials)
        part = distributions.chosen(self.shares, self.rng.random(count))
        radius = np.empty(count)
        for k, one in enumerate(parts):
            own = part == k
            radius[own] = distributions.draw(one.radius, self.rng, int(own.sum()))
        material = np.array([index.index(p.material) for p in parts], np.int32)[part]
        density = np.array([self.materials[p.material].density for p in parts])[part]
        self.radius = np.concatenate([self.radius, radius])
        self.material = np.concatenate([self.material, material])
        self.mass = np.concatenate([self.mass, 4 / 3 * np.pi * radius**3 * density])

    def until(self, what: str, amount: float, stated: str) -> None:
        """Draw until there is so much "mass" [kg] or "volume" [m3]. Raises ValueError: too many particles."""
        _require_possible(stated, amount / self.mean(what))
        while (have := float(self.amounts(what).sum())) < amount:
            self.draw(max(DRAWN, math.ceil((amount - have) / self.mean(what))))

    def count_for(self, what: str, amount: np.ndarray) -> np.ndarray:
        """How many of the first particles come nearest to each "mass" [kg] or "volume" [m3]."""
        each = self.amounts(what)
        return np.searchsorted(np.cumsum(each) - each / 2, amount, side="right")  # mutate: nearest_mass

    def velocities(self, count: int) -> np.ndarray:
        """Velocities [m/s] of so many particles, shape (n, 3)."""
        spread = self.source.velocity_spread
        mean = np.tile(np.array(self.source.velocity), (count, 1))
        if spread == 0:
            return mean
        return mean + spread * distributions.normal(self.rng.random((count, 3)))


class _Inserter:
    """Places particles of a source, event by event, and collects them."""

    def __init__(self, source: Source, region: Region, around: Surroundings):
        self.drawn = _Drawn(source, around)
        self.source, self.region, self.around = source, region, around
        self.rows: list[np.ndarray] = []
        self.states: list[InitialState] = [InitialState.none()]
        self.times: list[np.ndarray] = [np.empty(0)]
        self.velocity = np.empty((0, 3))

    def insert(self, rows: np.ndarray, time: float, whole: bool = False) -> np.ndarray:
        """Place these of the particles drawn; the rows of those that found no position.

        whole: only so many of the first that all of them find one, so that sizes come as they were drawn, not
        the small ones first.
        """
        drawn, source, count = self.drawn, self.source, len(rows)
        while True:
            position, placed = place(
                self.region, drawn.radius[rows[:count]], drawn.rng, source.attempts, self.around.flight, time
            )
            if not whole or placed.all():  # mutate: sizes_as_drawn
                break
            count = int(SHORTER * placed.sum())
        own = rows[:count][placed]
        spin = np.tile(np.array(source.angular_velocity), (len(own), 1))
        state = InitialState.build(
            position[placed], drawn.radius[own], drawn.material[own], drawn.velocities(len(own)), spin
        )
        times = np.full(len(own), time)
        self.around.flight.add(state, times)
        self.states.append(state)
        self.times.append(times)
        return np.concatenate([rows[:count][~placed], rows[count:]])

    def occupied(self, time: float) -> float:
        """Volume [m3] of the particles whose centers are in the region by free flight."""
        position, radius = self.around.flight.near(self.region, 0.0, time)
        return float((4 / 3 * np.pi * radius[self.region.depth(position) >= 0] ** 3).sum())

    def result(self, requested: int, missing: np.ndarray, hint: str) -> ParticleFile:
        """What has been inserted, with a warning about what was not. Raises ValueError: nothing fits."""
        columns = {
            field.name: np.concatenate([getattr(s, field.name) for s in self.states])
            for field in dataclasses.fields(InitialState)
        }
        state, warnings = InitialState.build(**columns), ()
        if len(missing):
            radius = self.drawn.radius[missing]
            sizes = f"of radius {radius.min():.4g}" + (f" to {radius.max():.4g}" if np.ptp(radius) else "")
            if not len(state):
                raise ValueError(f"{self.key}: no particle {sizes} m fits; allowed: a larger region")
            mass, all_mass = self.drawn.mass[missing].sum(), self.drawn.mass[:requested].sum()
            warnings = (
                f"insert[{self.around.number}]: {len(missing)} of {requested} particles did not fit,"
                f" {sizes} m, {mass:.4g} of {all_mass:.4g} kg; {hint}",
            )
        return ParticleFile(state, warnings, np.concatenate(self.times))

    @property
    def key(self) -> str:
        """What the statement calls the place."""
        return "face" if isinstance(self.source, InsertStream) else "region"


class InsertPack(Source):
    """Particles at random positions fill a region, once or every so often until a target is reached."""

    kind: Literal["pack"]
    """How particles are stated."""
    region: RegionSection
    """Where: whole particles are inside."""
    count: Annotated[int, Field(strict=True, gt=0, le=MAX_PARTICLES), BeforeValidator(as_python)] | None = (
        None
    )
    """Target: number of particles."""
    mass: Annotated[float, positive("kg")] | None = None
    """Target: mass of all particles [kg]; the number that comes nearest to it."""
    volume_fraction: Annotated[float, positive("1", MAX_FRACTION)] | None = None
    """Target: volume of all particles, in volumes of the region [1]; about 0.3 is reached in one filling."""
    time: Annotated[float, number("s", 0)] = 0.0
    """When it is filled first [s]; rounded to whole steps, at least one."""
    every: Annotated[float, positive("s")] | None = None
    """Interval of further fillings [s] with what did not fit before, in the order drawn, so that each has the
    stated sizes; default: a single filling."""

    @model_validator(mode="after")
    def _one_target(self) -> InsertPack:
        stated = [key for key in ("count", "mass", "volume_fraction") if getattr(self, key) is not None]
        if len(stated) != 1:
            what = f"{' and '.join(stated)}: stated together" if stated else "count: missing"
            raise ValueError(f"{what}; state one of count, mass [kg] and volume_fraction [1]")
        return self

    def resolve(self, around: Surroundings) -> ParticleFile:
        """All its particles with their times. Raises ValueError naming the key."""
        around.require_inside("region", self.region)
        inserter = _Inserter(self, self.region, around)
        drawn, volume = inserter.drawn, self.region.volume
        count = self.draw(drawn, volume)
        volumes = 4 / 3 * np.pi * drawn.radius[:count] ** 3
        rows = np.arange(count)
        fitted = FILLING * volume
        for time in self._times(around):
            room = min(FILLING * volume - inserter.occupied(time), fitted)
            few = int(np.searchsorted(np.cumsum(volumes[rows]), room)) + 1
            left = inserter.insert(rows[:few], time, whole=self.every is not None)
            fitted = max(MORE * volumes[rows[: few - len(left)]].sum(), volumes[rows[0]])
            rows = np.concatenate([left, rows[few:]])
            if not len(rows):
                break
        hint = "a larger region, more attempts, or every [s] for more fillings would hold more"
        if self.every is not None:
            hint = "until the end of the run; a shorter interval, or particles that leave faster, would"
        return inserter.result(count, rows, hint)

    def draw(self, drawn: _Drawn, volume: float) -> int:
        """Draw what is requested; how many particles. Raises ValueError: none, or too many."""
        if self.count is not None:
            drawn.draw(self.count)
            return self.count
        if self.mass is not None:
            key, what, value, unit, amount = "mass", "mass", self.mass, "kg", self.mass
        else:
            assert self.volume_fraction is not None
            key, what, value, unit = "volume_fraction", "volume", self.volume_fraction, "[1]"
            amount = value * volume
        stated = f"{key} = {value:g} {unit}"
        drawn.until(what, amount, stated)
        count = int(drawn.count_for(what, np.array([amount]))[0])
        if not count:
            least = drawn.amounts(what)[0] / 2 / (1.0 if self.mass is not None else volume)
            raise ValueError(f"{stated}: less than half a particle; allowed: >= {least:.3g} {unit}")
        return count

    def _times(self, around: Surroundings) -> Iterator[float]:
        """Times of the fillings [s]."""
        yield around.on_step(self.time)
        k = 1
        while self.every is not None and (time := self.time + k * self.every) <= around.end:
            yield around.on_step(time)
            k += 1


def drawn_for(pack: InsertPack, around: Surroundings) -> tuple[np.ndarray, np.ndarray, np.random.Generator]:
    """(radii [m], materials, generator for what else is drawn) of all that a pack requests.

    Raises ValueError: none, or too many.
    """
    around.require_inside("region", pack.region)
    drawn = _Drawn(pack, around)
    count = pack.draw(drawn, pack.region.volume)
    return drawn.radius[:count], drawn.material[:count], drawn.rng


class Rated(Source):
    """What sources of a stated rate have in common."""

    number_rate: Annotated[float, positive("1/s")] | None = None
    """Particles per second [1/s]."""
    mass_rate: Annotated[float, positive("kg/s")] | None = None
    """In its place: mass per second [kg/s]."""
    start: Annotated[float, number("s", 0)] = 0.0
    """When it begins [s]."""
    end: Annotated[float, positive("s")] | None = None
    """When it ends [s]; default: the end of the run."""

    @model_validator(mode="after")
    def _one_rate(self) -> Rated:
        if (self.number_rate is None) == (self.mass_rate is None):
            what = "number_rate: missing" if self.number_rate is None else "number_rate: beside mass_rate"
            raise ValueError(f"{what}; state one of number_rate [1/s] and mass_rate [kg/s]")
        if self.end is not None and not self.end > self.start:
            raise ValueError(f"end = {self.end:g}: must be above start = {self.start:g} [s]")
        return self

    @property
    def _rate(self) -> tuple[str, float, str]:
        """Key, value and unit of the rate."""
        if self.number_rate is not None:
            return "number_rate", self.number_rate, "1/s"
        assert self.mass_rate is not None
        return "mass_rate", self.mass_rate, "kg/s"

    def _at_times(self, inserter: _Inserter, interval: float, hint: str) -> ParticleFile:
        """Insert at intervals [s] what the rate brings by the end of each. Raises ValueError: nothing."""
        around, drawn = inserter.around, inserter.drawn
        end = around.end if self.end is None else min(self.end, around.end)
        events = math.floor((end - self.start) / interval + 1e-9)
        key, rate, unit = self._rate
        if events < 1:
            raise ValueError(
                f"start = {self.start:g} s: less than {interval:.4g} s before the end, {end:g} s"
            )
        stated = f"{key} = {rate:g} {unit}"
        _require_possible(stated, events)
        amount = rate * interval * np.arange(events + 1)
        if self.number_rate is not None:
            _require_possible(stated, amount[-1])
            counts = np.floor(amount + 1e-9).astype(np.int64)
            drawn.draw(int(counts[-1]))
        else:
            drawn.until("mass", float(amount[-1]), stated)
            counts = drawn.count_for("mass", amount)
        if not counts[-1]:
            raise ValueError(f"{stated}: no particle until {end:g} s")
        missing = [
            inserter.insert(np.arange(a, b), around.on_step(self.start + k * interval))
            for k, (a, b) in enumerate(itertools.pairwise(counts.tolist())) if b > a
        ]  # fmt: skip
        return inserter.result(int(counts[-1]), np.concatenate(missing), hint)


class InsertRate(Rated):
    """So many particles, or so much mass, a second at random places of a region."""

    kind: Literal["rate"]
    """How particles are stated."""
    region: RegionSection
    """Where: whole particles are inside."""
    every: Annotated[float, positive("s")]
    """Interval of insertions [s]: each brings what the rate amounts to until the next."""

    def resolve(self, around: Surroundings) -> ParticleFile:
        """All its particles with their times. Raises ValueError naming the key."""
        around.require_inside("region", self.region)
        inserter = _Inserter(self, self.region, around)
        key, rate, unit = self._rate
        each = inserter.drawn.mean("volume") if self.number_rate is not None else (
            inserter.drawn.mean("volume") / inserter.drawn.mean("mass"))  # fmt: skip
        allowed = FILLING * self.region.volume / self.every / each
        if rate > allowed:
            raise ValueError(
                f"{key} = {rate:g} {unit}: more than {FILLING:g} of the region every {self.every:g} s;"
                f" allowed: <= {allowed:.4g} [{unit}]"
            )
        return self._at_times(inserter, self.every, "a larger region, or a lower rate, would hold them")


class InsertStream(Rated):
    """A stream through a face: layer after layer, each as soon as the one before has left its place.

    The interval of the layers is the time in which the largest particle moves by its diameter from the face.
    """

    kind: Literal["stream"]
    """How particles are stated."""
    face: FaceSection
    """Where centers are when they are inserted: whole cross-sections are inside."""

    def resolve(self, around: Surroundings) -> ParticleFile:
        """All its particles with their times. Raises ValueError naming the key."""
        around.require_inside("face", self.face)
        inserter = _Inserter(self, self.face, around)
        drawn = inserter.drawn
        largest = max(distributions.largest(part.radius) for part in self.parts)
        if not math.isfinite(largest):
            raise ValueError("radius.hi: missing [m]; a stream needs a largest radius")
        interval = self._interval(largest, around)
        area = math.pi * drawn.moment(2)
        layer = max(1.0, COVERED * self.face.inner_area(largest) / area)
        key, rate, unit = self._rate
        allowed = layer / interval * (1.0 if self.number_rate is not None else drawn.mean("mass"))
        if self.face.inner_area(largest) == 0:
            raise ValueError(f"face: no particle of radius {largest:g} m passes; allowed: a larger face")
        if rate > allowed:
            raise ValueError(
                f"{key} = {rate:g} {unit}: more than the face passes at this velocity; allowed: <="
                f" {allowed:.4g} [{unit}]"
            )
        return self._at_times(inserter, interval, "a larger face, or a lower rate, would pass them")

    def _interval(self, largest: float, around: Surroundings) -> float:
        """Time between layers [s], in whole steps. Raises ValueError: they do not leave the face."""
        normal = self.face.normal
        speed = float((np.array(self.velocity) * normal).sum())
        end = around.end if self.end is None else self.end
        pull = around.flight.pull(normal * (1 if speed >= 0 else -1), self.start, end)
        speed, way = abs(speed), 2 * largest * (1 + 10 * CLEARANCE)
        if speed <= 1e-9 * math.hypot(*self.velocity) or speed == 0:
            raise ValueError(f"velocity = {self.velocity}: does not lead through the face [m/s]")
        if pull < 0 and speed * speed <= -2 * pull * way:
            least = math.sqrt(-2 * pull * way)
            raise ValueError(
                f"velocity = {self.velocity}: gravity turns it back within a diameter; allowed: >="
                f" {least:.4g} m/s across the face"
            )
        time = way / speed if pull >= 0 else (speed - math.sqrt(speed * speed + 2 * pull * way)) / -pull
        return math.ceil(time / around.step + 1e-9) * around.step if around.step else time
