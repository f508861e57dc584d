"""The findings' checks fail where LIGGGHTS would not behave so, or where a guard of ours would be missing."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from comparisons.cases.liggghts_findings import checks as findings_checks
from comparisons.cases.liggghts_findings import scenes as findings
from comparisons.harness.case import Check, Results
from comparisons.harness.evaluate import holds
from gpudem import driver
from gpudem.output.run import Run, Timing


def check(words: str) -> Check:
    return next(c for c in findings_checks.CHECKS if words in c.name)


def verdict(words: str, runs: dict[tuple[str, str], Run]) -> bool:
    found = check(words).measure(Results("quick", runs))
    return holds(check(words), found if isinstance(found, float) else found.value)


def test_no_difference_is_no_finding():
    """A LIGGGHTS whose default deck resets the spring, and whose second run changes nothing."""
    hop, collide = driver.simulate(findings.hop()), driver.simulate(findings.collide())
    theirs = {("hop", "liggghts"): hop, ("hop_default_factor", "liggghts"): hop}
    assert not verdict("spring kept", theirs)
    theirs = {("collide", "liggghts"): collide, ("collide_two_runs", "liggghts"): collide}
    assert not verdict("run twice", theirs)


def test_springs_lost_at_a_run_would_be_seen():
    """Above 1e-3 of the impact speed the check says that more than one step's forces has changed."""
    collide = driver.simulate(findings.collide())
    other = {**collide.trace, "velocity": collide.trace["velocity"] + 2e-3}
    runs = {("collide", "liggghts"): collide,
            ("collide_two_runs", "liggghts"): dataclasses.replace(collide, trace=other)}  # fmt: skip
    assert not verdict("run twice", runs)


@pytest.mark.parametrize(("law", "excess"), [("default", 0.45), ("coulomb", -0.015)])
def test_excess_of_friction(law, excess):
    """45 % at e = 0.3 by default; with both options the first touch sticks and takes 1.5 % less."""
    run = driver.simulate(findings.slide(law))
    assert findings.excess(run)[0] == pytest.approx(excess, abs=0.005)
    assert verdict(
        "with limit_force and without tangential dashpot (gpudem)", {("coulomb", "gpudem"): run}
    ) == (law == "coulomb")


@pytest.mark.parametrize(
    ("notes", "silent"),
    [
        ({}, True),
        ({"exit_status": 1}, False),
        ({"errors": ["ERROR: Lost atoms"]}, False),
        ({"lost": 0}, False),
    ],
)
def test_a_word_or_a_status_is_no_silence(notes, silent):
    scene = findings.leave()
    ended = {"exit_status": 0, "errors": [], "steps": scene.n_steps, "lost": 1, "particles": 1, "nan": False}
    run = Run("liggghts", "", scene, Path(), Timing(2, scene.n_steps, 1.0), notes={**ended, **notes})
    assert verdict("particles lost by the end", {("leave", "liggghts"): run}) == silent


def test_points_that_are_double_are_no_finding(tmp_path):
    """Our own frames, in the names of LIGGGHTS' arrays: float64 points are the position to the last bit."""
    import meshio

    position = np.random.default_rng(0).uniform(0, 0.2, (50, 3))
    (tmp_path / "raw").mkdir()
    cells = [("vertex", np.arange(50)[:, None])]
    mesh = meshio.Mesh(position, cells, point_data={"c_position[1-3]": position})
    mesh.write(tmp_path / "raw" / "p_000000010.vtu")
    run = Run("liggghts", "", findings.leave(), tmp_path, Timing(50, 10, 1.0))
    assert findings.points_error(run)[2].max() == 0.0
