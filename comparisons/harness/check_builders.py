"""Checks that stand in many cases: one for each code, one for each pair of codes, agreement step by step,
observed order in the time step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from comparisons.harness import codes
from comparisons.harness.case import Check, Measured, PerCode, PerPair, Results, largest
from comparisons.metrics import trace
from gpudem.output.run import Run


def per_code(name: str, measure: Callable[[Results, str], Measured | float], **fields: Any) -> PerCode:
    """One check for each code at hand; measure(results, code). `fields` go to `Check`; unit "1", mark A."""
    fields = {"unit": "1", "mark": "A"} | fields
    return PerCode(
        lambda code: Check(
            name=f"{name} ({code})", measure=lambda results: measure(results, code), needs=(code,), **fields
        )
    )


def per_pair(name: str, measure: Callable[[Results, str, str], Measured | float], **fields: Any) -> PerPair:
    """One check for each code under test and its reference; measure(results, code, reference). `fields` go to
    `Check`; unit "1", mark X.
    """
    fields = {"unit": "1", "mark": "X"} | fields
    return PerPair(
        lambda code, other: Check(
            name=name,
            measure=lambda results: measure(results, code, other),
            against=codes.title(other),
            needs=(code, other),
            **fields,
        )
    )


def step_by_step(
    name: str,
    column: str,
    scale: Callable[[Run], np.ndarray | float],
    *,
    prefix: str = "",
    defect: Callable[[Run], str] = lambda run: "",
    note: str = "",
    read: Callable[[Run], np.ndarray] | None = None,
    **fields: Any,
) -> PerPair:
    """Largest difference of a column of the trace between two codes, over all variants that both ran and
    whose label starts with `prefix`, by `scale(run of the reference)`. `read(run)` in place of the column.

    `defect(run)` says why a run does not show what it should ("never touched"); such a run fails the check,
    so that it cannot hold where nothing happens. `fields` go to `Check`.
    """

    def measure(results: Results, code: str, other: str) -> Measured:
        found = {}
        for label in results.labels(code, other, prefix=prefix):
            a, b = results[label, code], results[label, other]
            why = defect(a) or defect(b)
            if why:
                return Measured(float("nan"), note=f"{label}: {why}")
            ours, theirs = (run.trace[column] if read is None else read(run) for run in (a, b))
            found[label] = trace.largest_difference(ours, theirs, scale(b))
        return largest(found, f"{note}, {len(found)} variants" if note else f"{len(found)} variants")

    return per_pair(name, measure, **fields)


def observed_order(
    name: str,
    error: Callable[[Results, str, str], float],
    bounds: tuple[float, float],
    *,
    prefix: str = "",
    **fields: Any,
) -> PerCode:
    """Observed order in the time step of error(results, label, code), over the variants whose label starts
    with `prefix`. `fields` go to `Check`.
    """

    def measure(results: Results, code: str) -> Measured:
        labels = results.labels(code, prefix=prefix)
        rungs = sorted((results[name, code].scene.time.step, error(results, name, code)) for name in labels)
        ends = " to ".join(f"{error:.2g} at {step:.3g} s" for step, error in (rungs[0], rungs[-1]))
        return Measured(trace.observed_order(*zip(*rungs, strict=True)), note=f"{len(rungs)} steps: {ends}")

    return per_code(name, measure, lo=bounds[0], tolerance=bounds[1], **fields)
