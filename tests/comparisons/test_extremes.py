"""No extreme scene ends in a hang, a silent NaN or a wrong number without a message from gpudem."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from comparisons.cases.limits.extreme_scenes import Extreme
from comparisons.cases.limits.extremes import scenes
from gpudem import driver
from gpudem.errors import SimulationError
from gpudem.output.run import Run
from gpudem.scene import checks

#: Scenes that no code can bring to an end, and the words that gpudem must have for them.
WORDS = {
    "fast_30": "overlaps wall side_zlo by more than", "fast_300": "overlaps wall side_zlo by more than",
    "concentric": "is not a number (NaN)", "leaves": "left the domain",
    "fast_wall": "overlaps wall plate by more than", "crushed": "overlaps wall",
}  # fmt: skip
EXTREMES = {x.name: x for x in scenes()}


def outcome(x: Extreme, precision: str) -> str:
    """ "right", "wrong, silently", or what was said."""
    try:
        run = driver.simulate(x.scene, precision=precision)
    except SimulationError as error:
        return str(error)
    of_the_result = [w for w in run.warnings if w not in checks.scene_warnings(x.scene)]
    return "; ".join(of_the_result) or ("right" if x.error(run) <= x.tolerance else "wrong, silently")


@pytest.mark.parametrize("precision", ["float64", "mixed"])
@pytest.mark.parametrize("name", EXTREMES)
def test_right_or_said(name: str, precision: str):
    """Catches balls that pass through walls, NaN written on, lost particles, an edge counted once."""
    said = outcome(EXTREMES[name], precision)
    if name in WORDS:
        assert WORDS[name] in said
        assert "particle" in said
        assert " at t = " in said
    else:
        assert said == "right"


def test_a_silent_wrong_number_is_seen():
    """The table can fail: float32 is wrong 1 km from the origin, which a warning says."""
    far = EXTREMES["far"]
    assert outcome(far, "float32").startswith(
        "solver.precision = 'float32': positions at 1000.09 m are 6.1e-05"
    )
    assert (
        outcome(dataclasses.replace(far, error=lambda run: 2 * far.tolerance), "float64") == "wrong, silently"
    )


@pytest.mark.parametrize("name", [name for name in EXTREMES if name not in WORDS])
def test_a_run_that_did_nothing_is_wrong(name: str):
    """Catches an error measure that holds whatever happens: balls that stay as they started, or NaN."""
    x = EXTREMES[name]
    run = driver.simulate(x.scene.replace(time={"duration": x.scene.time.step}, output={"trace_every": 1e-9}))
    assert run.trace is not None
    for value in (None, np.nan):
        trace = {k: v if value is None else np.full_like(v, value, dtype=float) for k, v in run.trace.items()}
        still: Run = dataclasses.replace(run, trace=trace)
        if value is None and name == "touching":
            continue  # it is to stay as it started
        assert not x.error(still) <= x.tolerance
