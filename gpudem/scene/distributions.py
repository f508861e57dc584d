"""Distributions of radii: drawn from uniform numbers, so that a seed gives the same radii on every machine.

    kind        parameters            share with a radius below r, of the number of particles or of their mass
    discrete    radii, shares         sum of the shares of radii below r
    uniform     lo, hi                (r - lo) / (hi - lo)
    normal      mean, sigma           Phi((r - mean) / sigma), Phi the standard normal distribution
    lognormal   median, sigma         Phi(ln(r / median) / sigma)
    weibull     scale, shape          1 - exp(-(r / scale)^shape)
    table       radii, cumulative     linear between the points (radii[k], cumulative[k]), from 0 to 1

`lo` and `hi` of the last four are cut-offs: a radius beyond them is drawn again, so that within them the
shape of the distribution is the stated one, F(r) -> (F(r) - F(lo)) / (F(hi) - F(lo)); none is moved onto a
cut-off. With `by = "mass"` the shares are of the mass: the density by number is then proportional
to f(r)/r^3.

Radii are rounded to 24 significant bits, since the last bits of logarithms and exponentials differ between
machines.
"""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field, PlainValidator, SerializeAsAny, model_validator

from gpudem.scene.files import OneOf
from gpudem.scene.types import Model, number, of_kind, positive

#: Significant bits of what is drawn.
BITS = 24
#: Least share of a distribution between its cut-offs: fewer are a mistake, and would be drawn forever.
LEAST_WITHIN = 1e-3
#: Largest share of a normal distribution at radii below zero where no cut-off `lo` is stated.
NEGATIVE = 1e-9
#: Shares must add up to 1 within this.
SUM = 1e-6
#: Intervals of the quadrature of moments, each with a Gauss-Legendre rule of ORDER points.
INTERVALS, ORDER = 64, 20
#: Share beyond which an unbounded distribution is not integrated.
TAIL = 1e-15

SHARE = positive("1", 1)


def rounded(values: np.ndarray) -> np.ndarray:
    """Values rounded to BITS significant bits."""
    mantissa, exponent = np.frexp(values)
    return np.ldexp(np.rint(np.ldexp(mantissa, BITS)), exponent - BITS)  # mutate: rounding_of_radii


def normal(uniform: np.ndarray) -> np.ndarray:
    """Standard normal numbers from uniform ones of [0, 1), rounded."""
    from scipy.special import ndtri

    return rounded(ndtri(np.maximum(uniform, 2.0**-54)))


class Distribution(Model):
    """Distribution of radii; `kind` names the class."""

    kind: str
    """Kind of distribution."""
    by: Literal["number", "mass"] = "number"
    """Whether shares are of the number of particles or of their mass."""

    def below(self, radius: np.ndarray) -> np.ndarray:
        """Stated share below each radius [m], before cut-offs."""
        raise NotImplementedError

    def at(self, share: np.ndarray) -> np.ndarray:
        """Inverse of `below`: the radius [m] with this share below it."""
        raise NotImplementedError

    def range(self) -> tuple[float, float]:
        """Smallest and largest radius [m]; (0, inf) where none is stated."""
        raise NotImplementedError

    @property
    def _within(self) -> tuple[float, float]:
        """Stated shares below the cut-offs."""
        low, high = self.range()
        a = float(self.below(np.array([low]))[0]) if low > 0 else 0.0
        return a, float(self.below(np.array([high]))[0]) if math.isfinite(high) else 1.0

    def draw(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """So many radii [m], independent of each other."""
        found, low, high = [np.empty(0)], *self.range()
        while (have := sum(map(len, found))) < count:
            uniform = rng.random((2, max(64, 2 * (count - have))))
            radius = rounded(self.at(uniform[0]))
            keep = (radius >= low) & (radius <= high) & (radius > 0)  # mutate: drawn_again
            if self.by == "mass":
                keep &= uniform[1] * radius**3 < low**3  # mutate: shares_of_mass
            found.append(radius[keep])
        return np.concatenate(found)[:count]

    def moment(self, power: int) -> float:
        """Mean of radius^power [m^power] over particles, by number."""
        return self._mean(power - 3) / self._mean(-3) if self.by == "mass" else self._mean(power)

    def _mean(self, power: int) -> float:
        """Mean of radius^power within the cut-offs, by the stated shares: Gauss-Legendre rules over them."""
        a, b = self._within
        a, b = max(a, TAIL), min(b, 1 - TAIL)
        nodes, weights = np.polynomial.legendre.leggauss(ORDER)
        # finer towards both ends, where the inverse may be steep
        edges = a + (b - a) * 0.5 * (1 - np.cos(np.pi * np.linspace(0, 1, INTERVALS + 1)))
        half = np.diff(edges)[:, None] / 2
        radius = self.at((edges[:-1, None] + half + half * nodes).ravel())
        return float(((half * weights).ravel() * radius**power).sum() / (b - a))


def require_shares(key: str, shares: tuple[float, ...]) -> None:
    """Raises ValueError: the shares under this key do not add up to 1."""
    total = math.fsum(shares)
    if abs(total - 1) > SUM:
        raise ValueError(f"{key} = {shares}: sum {total:.6g}; must add up to 1 [1]")


class Discrete(Distribution):
    """Several radii, each with its share."""

    kind: Literal["discrete"]  # type: ignore[assignment]
    """Kind of distribution."""
    radii: Annotated[tuple[Annotated[float, positive("m")], ...], Field(min_length=1)]
    """Radii [m]."""
    shares: tuple[Annotated[float, SHARE], ...]
    """Share of each [1]; they add up to 1."""

    @model_validator(mode="after")
    def _shares(self) -> Discrete:
        if len(self.shares) != len(self.radii):
            raise ValueError(
                f"shares: {len(self.shares)}; must be one for each of the {len(self.radii)} radii"
            )
        require_shares("shares", self.shares)
        return self

    @property
    def by_number(self) -> np.ndarray:
        """Share of each radius by number."""
        shares = np.array(self.shares)
        if self.by == "mass":
            shares = shares / np.array(self.radii) ** 3
        return shares / shares.sum()

    def below(self, radius: np.ndarray) -> np.ndarray:
        """Stated share of radii up to each radius [m]."""
        at_most = np.array(self.radii)[None] <= np.asarray(radius)[:, None]
        return (at_most * np.array(self.shares)).sum(axis=1)

    def range(self) -> tuple[float, float]:
        """Smallest and largest radius [m]."""
        return min(self.radii), max(self.radii)

    def draw(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """So many radii [m]."""
        return np.array(self.radii)[chosen(self.by_number, rng.random(count))]

    def moment(self, power: int) -> float:
        """Mean of radius^power [m^power] over particles, by number."""
        return float(self.by_number @ np.array(self.radii) ** power)


def chosen(shares: np.ndarray, uniform: np.ndarray) -> np.ndarray:
    """Index of the share that each uniform number of [0, 1) falls into."""
    edges = np.cumsum(shares)
    return np.minimum(np.searchsorted(edges, uniform * edges[-1], side="right"), len(shares) - 1)


class Uniform(Distribution):
    """Every radius between two limits is as likely."""

    kind: Literal["uniform"]  # type: ignore[assignment]
    """Kind of distribution."""
    lo: Annotated[float, positive("m")]
    """Smallest radius [m]."""
    hi: Annotated[float, positive("m")]
    """Largest radius [m]."""

    @model_validator(mode="after")
    def _rises(self) -> Uniform:
        _require_rising(self.lo, self.hi)
        return self

    def below(self, radius: np.ndarray) -> np.ndarray:
        """Stated share below each radius [m]."""
        return np.clip((radius - self.lo) / (self.hi - self.lo), 0, 1)

    def at(self, share: np.ndarray) -> np.ndarray:
        """The radius [m] with this share below it."""
        return self.lo + share * (self.hi - self.lo)

    def range(self) -> tuple[float, float]:
        """Smallest and largest radius [m]."""
        return self.lo, self.hi


def _require_rising(lo: float | None, hi: float | None) -> None:
    if lo is not None and hi is not None and not lo < hi:
        raise ValueError(f"hi = {hi:g}: must be above lo = {lo:g} [m]")


class _CutOff(Distribution):
    """A distribution with cut-offs."""

    lo: Annotated[float, positive("m")] | None = None
    """Smallest radius [m]: one below it is drawn again."""
    hi: Annotated[float, positive("m")] | None = None
    """Largest radius [m]: one above it is drawn again."""

    def _require_parameters(self) -> None:
        """Raises ValueError: parameters that do not go together."""

    @model_validator(mode="after")
    def _cut(self) -> _CutOff:
        self._require_parameters()
        _require_rising(self.lo, self.hi)
        low = self.range()[0]
        if self.by == "mass" and not low:
            raise ValueError("lo: missing [m]; shares of mass need a smallest radius, 0 < value")
        a, b = self._within
        if not b - a >= LEAST_WITHIN:
            raise ValueError(
                f"lo .. hi: holds {max(0.0, b - a):.3g} of the distribution; allowed: >= {LEAST_WITHIN:g} [1]"
            )
        if self.by == "mass" and low**3 * self._mean(-3) < LEAST_WITHIN:
            raise ValueError(
                f"lo = {low:g}: too small for shares of mass, nearly all particles would be of this size"
            )
        return self

    def range(self) -> tuple[float, float]:
        """The cut-offs [m]."""
        return self.lo or 0.0, self.hi or math.inf


class Normal(_CutOff):
    """Normal distribution."""

    kind: Literal["normal"]  # type: ignore[assignment]
    """Kind of distribution."""
    mean: Annotated[float, positive("m")]
    """Mean [m], before cut-offs."""
    sigma: Annotated[float, positive("m")]
    """Standard deviation [m], before cut-offs."""

    def _require_parameters(self) -> None:
        from scipy.special import ndtr

        negative = float(ndtr(-self.mean / self.sigma))
        if self.lo is None and negative > NEGATIVE:
            raise ValueError(
                f"sigma = {self.sigma:g}: {negative:.2g} of the radii would be negative; state lo [m], or"
                f" sigma <= mean/6 = {self.mean / 6:g} m"
            )

    def below(self, radius: np.ndarray) -> np.ndarray:
        """Stated share below each radius [m]."""
        from scipy.special import ndtr

        return ndtr((radius - self.mean) / self.sigma)

    def at(self, share: np.ndarray) -> np.ndarray:
        """The radius [m] with this share below it."""
        from scipy.special import ndtri

        return self.mean + self.sigma * ndtri(np.maximum(share, 2.0**-54))


class Lognormal(_CutOff):
    """Lognormal distribution: ln(radius) is normal."""

    kind: Literal["lognormal"]  # type: ignore[assignment]
    """Kind of distribution."""
    median: Annotated[float, positive("m")]
    """Median [m], before cut-offs: exp of the mean of ln(radius)."""
    sigma: Annotated[float, positive("1")]
    """Standard deviation of ln(radius) [1], before cut-offs."""

    def below(self, radius: np.ndarray) -> np.ndarray:
        """Stated share below each radius [m]."""
        from scipy.special import ndtr

        return ndtr(np.log(np.maximum(radius, 1e-300) / self.median) / self.sigma)

    def at(self, share: np.ndarray) -> np.ndarray:
        """The radius [m] with this share below it."""
        from scipy.special import ndtri

        return self.median * np.exp(self.sigma * ndtri(np.maximum(share, 2.0**-54)))

    def _mean(self, power: int) -> float:
        from scipy.special import ndtr, ndtri

        a, b = self._within
        z, shift = ndtri(np.array([a, b])), power * self.sigma
        low, high = ndtr(z - shift)
        return self.median**power * math.exp(shift**2 / 2) * float(high - low) / (b - a)


class Weibull(_CutOff):
    """Weibull (Rosin-Rammler) distribution."""

    kind: Literal["weibull"]  # type: ignore[assignment]
    """Kind of distribution."""
    scale: Annotated[float, positive("m")]
    """Radius [m] with a share 1 - 1/e = 0.632 below it."""
    shape: Annotated[float, positive("1")]
    """Exponent [1]: the larger, the narrower."""

    def below(self, radius: np.ndarray) -> np.ndarray:
        """Stated share below each radius [m]."""
        return -np.expm1(-((np.maximum(radius, 0.0) / self.scale) ** self.shape))

    def at(self, share: np.ndarray) -> np.ndarray:
        """The radius [m] with this share below it."""
        return self.scale * (-np.log1p(-share)) ** (1 / self.shape)


class Table(_CutOff):
    """Cumulative distribution in points, linear between them: as a sieve analysis gives it."""

    kind: Literal["table"]  # type: ignore[assignment]
    """Kind of distribution."""
    radii: Annotated[tuple[Annotated[float, positive("m")], ...], Field(min_length=2)]
    """Radii [m], rising."""
    cumulative: Annotated[tuple[Annotated[float, number("1", 0, 1)], ...], Field(min_length=2)]
    """Share below each [1], not falling, from 0 to 1."""

    def _require_parameters(self) -> None:
        shares = self.cumulative
        if len(shares) != len(self.radii):
            raise ValueError(
                f"cumulative: {len(shares)}; must be one for each of the {len(self.radii)} radii"
            )
        if not all(b > a for a, b in itertools.pairwise(self.radii)):
            raise ValueError(f"radii = {self.radii}: must rise [m]")
        if shares[0] != 0 or shares[-1] != 1 or any(b < a for a, b in itertools.pairwise(shares)):
            raise ValueError(f"cumulative = {shares}: must not fall, from 0 to 1 [1]")

    def below(self, radius: np.ndarray) -> np.ndarray:
        """Stated share below each radius [m]."""
        return np.interp(radius, self.radii, self.cumulative)

    def at(self, share: np.ndarray) -> np.ndarray:
        """The radius [m] with this share below it."""
        return np.interp(share, self.cumulative, self.radii)

    def range(self) -> tuple[float, float]:
        """The cut-offs, or the ends of the table [m]."""
        return max(self.lo or 0.0, self.radii[0]), min(self.hi or math.inf, self.radii[-1])


#: The class of each kind of distribution.
DISTRIBUTIONS: dict[str, type[Distribution]] = {
    "discrete": Discrete, "uniform": Uniform, "normal": Normal, "lognormal": Lognormal, "weibull": Weibull,
    "table": Table,
}  # fmt: skip


def _size(value: Any) -> float | Model:
    """One radius, or a distribution of them."""
    if isinstance(value, dict | Distribution):
        return _distribution(value)
    return RADIUS.check(value)


RADIUS = positive("m")
_distribution = of_kind(lambda kind: DISTRIBUTIONS.get(kind), Distribution)

if TYPE_CHECKING:
    Size = float | Distribution
else:
    Size = Annotated[float | SerializeAsAny[Model], PlainValidator(_size), OneOf(lambda: DISTRIBUTIONS)]


def draw(size: float | Distribution, rng: np.random.Generator, count: int) -> np.ndarray:
    """So many radii [m]."""
    return size.draw(rng, count) if isinstance(size, Distribution) else np.full(count, size)


def moment(size: float | Distribution, power: int) -> float:
    """Mean of radius^power [m^power] over particles, by number."""
    return size.moment(power) if isinstance(size, Distribution) else size**power


def largest(size: float | Distribution) -> float:
    """Largest radius [m]; inf where none is stated."""
    return size.range()[1] if isinstance(size, Distribution) else size
