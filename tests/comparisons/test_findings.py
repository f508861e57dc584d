"""What is said of LIGGGHTS is measured: no difference is no finding; a missing guard of ours fails."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from comparisons.cases.liggghts_findings import checks
from comparisons.cases.liggghts_findings import scenes as findings
from comparisons.harness.case import Check, Finding, Measured, Results
from comparisons.harness.evaluate import holds
from gpudem import driver
from gpudem.output.run import Run, Timing


def named(words: str) -> Check | Finding:
    return next(c for c in (*checks.CHECKS, *checks.FINDINGS) if words in c.name)


def value(words: str, runs: dict[tuple[str, str], Run]) -> float:
    found = named(words).measure(Results("quick", runs))
    return found.value if isinstance(found, Measured) else found


def test_no_difference_is_no_finding():
    """A LIGGGHTS whose default deck resets the spring, and whose second run changes nothing."""
    hop, collide = driver.simulate(findings.hop()), driver.simulate(findings.collide())
    assert value("spring kept", {("hop", "liggghts"): hop, ("hop_default_factor", "liggghts"): hop}) == 0
    assert (
        value(
            "run twice", dict.fromkeys([("collide", "liggghts"), ("collide_two_runs", "liggghts")], collide)
        )
        == 0
    )


def test_springs_lost_at_a_run_would_be_seen():
    """Above 1e-3 of the impact speed more than one step's forces has changed."""
    collide = driver.simulate(findings.collide())
    assert collide.trace is not None
    other = {**collide.trace, "velocity": collide.trace["velocity"] + 2e-3}
    runs = {("collide", "liggghts"): collide,
            ("collide_two_runs", "liggghts"): dataclasses.replace(collide, trace=other)}  # fmt: skip
    assert value("run twice", runs) > 1e-3


@pytest.mark.parametrize(("law", "excess"), [("default", 0.45), ("coulomb", -0.015)])
def test_excess_of_friction(law, excess):
    """45 % at e = 0.3 by default; with both options the first contact sticks and takes 1.5 % less."""
    run = driver.simulate(findings.slide(law))
    assert findings.excess(run)[0] == pytest.approx(excess, abs=0.005)
    words = "with limit_force and without tangential dashpot (gpudem)"
    check = named(words)
    assert isinstance(check, Check)
    assert holds(check, value(words, {("coulomb", "gpudem"): run})) == (law == "coulomb")


@pytest.mark.parametrize(
    ("notes", "lost"),
    [
        ({}, 1),
        ({"exit_status": 1}, math.nan),
        ({"errors": ["ERROR: Lost atoms"]}, math.nan),
        ({"lost": 0}, 0),
    ],
)
def test_a_message_or_a_status_is_no_silence(notes, lost):
    scene = findings.leave()
    ended = {"exit_status": 0, "errors": [], "steps": scene.n_steps, "lost": 1, "particles": 1, "nan": False}
    run = Run("liggghts", "", scene, Path(), Timing(2, scene.n_steps, 1.0), notes={**ended, **notes})
    assert value("particles lost by the end", {("leave", "liggghts"): run}) == pytest.approx(
        lost, nan_ok=True
    )


def test_a_scene_that_passes_a_guard_is_counted(monkeypatch):
    """Catches a guard that does not guard: gpudem that accepts a lost particle."""
    monkeypatch.setattr(driver, "simulate", lambda scene, folder: None)
    run = Run("liggghts", "", findings.leave(), Path(), Timing(2, 1, 1.0))
    assert value("pass a lost particle", {("leave", "liggghts"): run}) >= 1


def test_points_that_are_double_are_no_finding(tmp_path):
    """Our own frames, in the names of LIGGGHTS' arrays: float64 points are the position to the last bit."""
    import meshio

    position = np.random.default_rng(0).uniform(0, 0.2, (50, 3))
    (tmp_path / "raw").mkdir()
    cells: dict = {"vertex": np.arange(50)[:, None]}
    mesh = meshio.Mesh(position, cells, point_data={"c_position[1-3]": position})
    mesh.write(tmp_path / "raw" / "p_000000010.vtu")
    run = Run("liggghts", "", findings.leave(), tmp_path, Timing(50, 10, 1.0))
    assert findings.points_error(run)[2].max() == 0.0
