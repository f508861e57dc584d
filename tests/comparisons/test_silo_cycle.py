"""The checks of the case silo_cycle fail on runs that lose, keep or count balls otherwise."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

from comparisons.cases.machines import silo_cycle as case
from comparisons.harness.case import Results
from gpudem.driver import simulate
from gpudem.output.run import Run


@pytest.fixture(scope="module")
def right() -> Run:
    return simulate(case.chute(), threads=1)


def results(run: Run, other: Run) -> Results:
    return Results("quick", {(case.CHUTE, "gpudem"): run, (case.CHUTE, "liggghts"): other}, {})


def changed(run: Run, change: Callable[[Run], None]) -> Run:
    """A copy of a run with other output."""
    made = dataclasses.replace(run, history=copy.deepcopy(run.history), trace=copy.deepcopy(run.trace))
    change(made)
    return made


def test_a_right_run_is_right(right):
    """Detects: a measure that cannot hold, or is of nothing."""
    found = results(right, right)
    assert [m.value for m in case.counted(found, "gpudem").values()] == [0]
    assert case.weighed(found, "gpudem")[case.CHUTE] < 1e-14
    assert case.back_again(found, "gpudem") == {case.CHUTE: 0}
    assert case.elsewhere(found, "gpudem")[case.CHUTE].value < 0.05
    assert case.together(found, "gpudem", "liggghts").value == 0


def test_another_skin_is_another_step(right):
    """Detects: a comparison of the steps of leaving that no difference of rebuilds shows."""
    other = simulate(case.chute().replace(solver={"skin": 0.002}), threads=1)
    assert case.together(results(right, other), "gpudem", "liggghts").value > 0


def test_wrong_counts_masses_and_balls(right):
    """Detects: a check that holds whatever the history and the trace say."""
    gone = int(np.flatnonzero(case.absent(right)[-1] & ~case.absent(right)[100])[0])  # late enough
    rows = np.flatnonzero(case.absent(right)[:, gone])

    def uncounted(run: Run) -> None:
        assert run.history is not None
        run.history.loc[run.history.index[-1], "removed_xlo"] -= 1

    def mean_mass(run: Run) -> None:
        assert run.history is not None
        run.history["removed_mass_xlo"] = run.history.removed_xlo * run.scene.masses.mean()

    def returned(run: Run) -> None:
        assert run.trace is not None
        run.trace["position"][rows[3], gone] = 0.01

    def inside(run: Run) -> None:
        assert run.trace is not None
        run.trace["position"][rows[0] - 60 :, gone] = np.nan

    for change, measure in [
        (uncounted, lambda found: case.counted(found, "gpudem")[case.CHUTE].value),
        (mean_mass, lambda found: case.weighed(found, "gpudem")[case.CHUTE] / 1e-12),
        (returned, lambda found: case.back_again(found, "gpudem")[case.CHUTE]),
        (inside, lambda found: case.elsewhere(found, "gpudem")[case.CHUTE].value / 0.05),
    ]:
        wrong = changed(right, change)
        assert measure(results(wrong, right)) >= 1, change.__name__
