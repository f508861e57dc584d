"""Distributions of radii: against scipy.stats, in shares by number and by mass, with cut-offs drawn again."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import integrate, stats

from gpudem.scene import distributions
from gpudem.scene.distributions import DISTRIBUTIONS, Distribution

COUNT = 20_000
#: A correct sample fails at this level once in a million seeds; the seed is fixed.
LEVEL = 1e-6

R = 1e-3
TABLE: dict[str, Any] = {"radii": (1e-3, 2e-3, 4e-3), "cumulative": (0.0, 0.3, 1.0)}
#: Name -> (statement, the same of scipy.stats without cut-offs).
STATED: dict[str, tuple[dict[str, Any], Any]] = {
    "uniform": ({"kind": "uniform", "lo": R, "hi": 3 * R}, stats.uniform(R, 2 * R)),
    "normal": ({"kind": "normal", "mean": 3 * R, "sigma": 0.4 * R}, stats.norm(3 * R, 0.4 * R)),
    "normal, cut": ({"kind": "normal", "mean": 3 * R, "sigma": R, "lo": 2.5 * R, "hi": 5 * R},
        stats.norm(3 * R, R)),
    "lognormal": ({"kind": "lognormal", "median": R, "sigma": 0.4}, stats.lognorm(0.4, scale=R)),
    "lognormal, cut": ({"kind": "lognormal", "median": R, "sigma": 0.4, "lo": 0.8 * R, "hi": 2 * R},
        stats.lognorm(0.4, scale=R)),
    "weibull": ({"kind": "weibull", "scale": R, "shape": 2.5}, stats.weibull_min(2.5, scale=R)),
    "weibull, cut": ({"kind": "weibull", "scale": R, "shape": 2.5, "lo": 0.5 * R, "hi": 1.2 * R},
        stats.weibull_min(2.5, scale=R)),
    "table": ({"kind": "table", **TABLE},
        stats.rv_histogram((np.array([0.3, 0.7]) / [R, 2 * R], [R, 2 * R, 4 * R]), density=True)),
}  # fmt: skip
CUT = [name for name, (stated, _) in STATED.items() if "lo" in stated]


def made(stated: dict[str, Any], **more: Any) -> Distribution:
    return DISTRIBUTIONS[stated["kind"]](**stated, **more)


def drawn(distribution: Distribution, count: int = COUNT, seed: int = 7) -> np.ndarray:
    return distribution.draw(np.random.Generator(np.random.PCG64(seed)), count)


def expected_below(name: str, mass: bool = False):
    """Share by number below a radius, from scipy's density: cut off, and over r^3 for shares of mass."""
    stated, theirs = STATED[name]
    low, high = stated.get("lo", theirs.ppf(1e-12)), stated.get("hi", theirs.ppf(1 - 1e-12))
    grid = np.linspace(max(low, 1e-9), high, 40_001)
    density = theirs.pdf(grid) / (grid**3 if mass else 1.0)
    sums = integrate.cumulative_trapezoid(density, grid, initial=0.0)
    return lambda r: np.interp(r, grid, sums / sums[-1])


@pytest.mark.parametrize("name", STATED)
def test_shares_by_number(name):
    """Detects: another parameter than stated, cut-offs onto which radii are moved, a wrong inverse."""
    radius = drawn(made(STATED[name][0]))
    assert stats.kstest(radius, expected_below(name)).pvalue > LEVEL
    assert len(np.unique(radius)) > 0.98 * COUNT


@pytest.mark.parametrize("name", CUT)
def test_shares_of_mass(name):
    """Detects: shares of mass taken for shares of number, another power of the radius."""
    radius = drawn(made(STATED[name][0], by="mass"))
    assert stats.kstest(radius, expected_below(name, mass=True)).pvalue > LEVEL
    assert stats.kstest(radius, expected_below(name)).pvalue < LEVEL


@pytest.mark.parametrize("name", CUT)
def test_cut_offs(name):
    """Detects: a radius beyond a cut-off by rounding, or a cut-off that is never reached."""
    stated, _ = STATED[name]
    radius = drawn(made(stated))
    assert stated["lo"] <= radius.min() < stated["lo"] + 0.01 * R
    assert stated["hi"] - 0.05 * R < radius.max() <= stated["hi"]


@pytest.mark.parametrize("name", STATED)
@pytest.mark.parametrize("power", [1, 2, 3])
def test_moments(name, power):
    """Detects: a quadrature that misses an end; the power of the radius of shares of mass."""
    stated, theirs = STATED[name]
    low, high = stated.get("lo", -np.inf), stated.get("hi", np.inf)
    if name == "table":
        low, high = 1e-3, 4e-3

    def mean(p: int) -> float:
        pieces = [(1e-3, 2e-3), (2e-3, 4e-3)] if name == "table" else [(max(low, 1e-12), min(high, 0.1))]
        options: dict[str, Any] = {"points": [R, 3 * R], "epsrel": 1e-12, "limit": 200}
        total = sum(integrate.quad(lambda r: r**p * theirs.pdf(r), a, b, **options)[0] for a, b in pieces)
        return total / (theirs.cdf(high) - theirs.cdf(low))

    assert made(stated).moment(power) == pytest.approx(mean(power), rel=1e-6)
    if name in CUT:
        assert made(stated, by="mass").moment(power) == pytest.approx(mean(power - 3) / mean(-3), rel=1e-6)


def test_discrete():
    """Detects: shares of mass taken for shares of number, radii in another order."""
    stated = {"kind": "discrete", "radii": (3e-3, 1e-3, 2e-3), "shares": (0.5, 0.2, 0.3)}
    for by, weight in (("number", (0.5, 0.2, 0.3)), ("mass", (0.5 / 27, 0.2, 0.3 / 8))):
        share = np.array(weight) / sum(weight)
        radius = drawn(made(stated, by=by))
        counts = [int((radius == r).sum()) for r in stated["radii"]]
        assert sum(counts) == COUNT
        assert stats.chisquare(counts, share * COUNT).pvalue > LEVEL
        assert made(stated, by=by).moment(3) == pytest.approx(
            share @ np.array(stated["radii"]) ** 3, rel=1e-14
        )


def test_same_bits_on_every_machine():
    """Detects: radii with the last bits of this machine's exp and log: only 24 bits are drawn."""
    radius = drawn(made(STATED["lognormal"][0]), 1000)
    mantissa = np.frexp(radius)[0] * 2.0**24
    assert np.array_equal(mantissa, np.rint(mantissa))
    off = radius * (1 + np.random.default_rng(1).integers(-4, 5, 1000) * 2.0**-52)
    assert np.array_equal(distributions.rounded(off), radius)
    assert np.array_equal(drawn(made(STATED["lognormal"][0]), 1000), radius)
    assert not np.array_equal(drawn(made(STATED["lognormal"][0]), 1000, seed=8), radius)


def test_normal_numbers():
    """Detects: velocities that are not normally distributed."""
    found = distributions.normal(np.random.default_rng(3).random(COUNT))
    assert stats.kstest(found, stats.norm.cdf).pvalue > LEVEL
