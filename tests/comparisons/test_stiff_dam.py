"""How soft a dam break may be: part by part, from seeds whose answer is known."""

import math

import numpy as np
import pytest

from comparisons.cases.dam_break import modulus
from comparisons.harness.case import Results

SHIFTS = {
    "center of mass z at rest [mm]": (1e6, 3.0),
    "run-out in flow [mm]": (0.0, 0.0),
    "time to the far wall [ms]": (5e7, 40.0),
}
"""Metric -> (largest modulus that shifts it, by how many of a seed's standard deviations)."""


@pytest.fixture
def results(monkeypatch) -> Results:
    """Metrics of ten seeds drawn at random, shifted as in SHIFTS."""

    def sample(results, young, by=modulus.FLOAT64):
        rng = np.random.default_rng(int(young % 2**31))
        found = {n: 100 + rng.normal(0, 1, 10) for n in (*modulus.METRICS, modulus.CONTACTS)}
        for name, (largest, shift) in SHIFTS.items():
            found[name] = found[name] + (shift if young <= largest else 0.0)
        return found | {modulus.DEPTH: np.full(10, 1 / young ** (2 / 3))}

    monkeypatch.setattr(modulus, "sample", sample)
    monkeypatch.setattr(
        modulus, "seconds", lambda results, young, by=modulus.FLOAT64: np.full(10, young**0.5)
    )
    return Results("full", {})


def test_the_softest_of_each_part(results):
    """Catches a part judged by another's metrics, the softest taken although a harder one differs."""
    found = {part: modulus.stiff_enough(results, part) for part in modulus.PARTS}
    assert found["the pile at rest"] == (5e6, 1e6)
    assert found["the first ball at the far wall"] == (5e8, 5e7)
    softest, softer = found["the run-out in flow"]
    assert softest == 1e5
    assert math.isnan(softer)


def test_all_metrics_belong_to_a_part():
    named = [name for part in modulus.PARTS.values() for name in part]
    assert sorted(named) == sorted(modulus.METRICS)


def test_advice_says_modulus_cost_and_what_is_left_open(results):
    """Catches a shift without its sign, a cost upside down, a unit lost."""
    said = dict(modulus.advice(results))
    ball = said["modulus, for the first ball at the far wall"]
    assert ball.startswith("5·10⁸ Pa and more: 10 seeds")
    assert "1/2.5 of the time" in ball  # root of 3.25e9/5e8
    shift = float(ball.partition("Significant at 5·10⁷ Pa: time to the far wall ")[2].removesuffix(" ms."))
    assert shift == pytest.approx(40, abs=2)
    possible = float(ball.partition("confidence intervals: time to the far wall ")[2].split()[0])
    assert 0.5 < possible < 2.5  # some two standard errors, 0.45 each, and the gap itself
    assert "At" not in said["modulus, for the run-out in flow"]


def test_a_part_that_only_the_hardest_shows(results, monkeypatch):
    monkeypatch.setitem(SHIFTS, "run-out in flow [mm]", (1e9, -9.0))
    assert dict(modulus.advice(results))["modulus, for the run-out in flow"].startswith("Only the hardest")
