"""Checks that stand in many cases: one for each code, one for each pair of codes, agreement step by step,
observed order in the time step; and the table of what they found.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from comparisons.harness import codes
from comparisons.harness.case import Check, Measured, PerCode, PerPair, Results, Table, largest
from comparisons.metrics import trace
from gpudem.output.run import Run

if TYPE_CHECKING:
    import pandas


#: What a measure finds: one error, or several, of which the largest counts: {"e = 0.3": error, ...}.
Found = float | Measured | Mapping[str, Measured]


def per_code(name: str, measure: Callable[[Results, str], Found], **fields: Any) -> PerCode[Check]:
    """One check for each code at hand; measure(results, code). `fields` go to `Check`; unit "1", mark A."""
    fields = {"unit": "1", "mark": "A"} | fields

    def of(results: Results, code: str) -> Measured | float:
        found = measure(results, code)
        return largest(found) if isinstance(found, Mapping) else found

    return PerCode(
        lambda code: Check(
            name=f"{name} ({code})", measure=lambda results: of(results, code), needs=(code,), **fields
        )
    )


def table(
    title: str,
    caption: str,
    quantities: Mapping[str, Callable[[Results, str], Mapping[str, Measured]]],
    *,
    rows: str = "impact",
    reference: str = "closed form",
    **fields: Any,
) -> Table:
    """What each code gives, beside what is expected; quantities: {"spin [rad/s]": measure(results, code)},
    all with the same rows. `rows` is the title of the first column; `fields` go to `Table`.
    """

    def make(results: Results) -> pandas.DataFrame:
        import pandas

        lines: dict[str, dict[str, Any]] = {}
        for quantity, measure in quantities.items():
            for code in results.codes():
                for name, found in measure(results, code).items():
                    cells = lines.setdefault(name, {rows: name})
                    cells[f"{reference}: {quantity}"] = found.expected
                    cells[f"{codes.title(code)}: {quantity}"] = found.measured
        return pandas.DataFrame(list(lines.values()))

    return Table(title, caption, make, **fields)


def per_pair(
    name: str, measure: Callable[[Results, str, str], Measured | float], **fields: Any
) -> PerPair[Check]:
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
) -> PerPair[Check]:
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

    return per_pair(name, measure, **({"half_step": True} | fields))


def observed_order(
    name: str,
    error: Callable[[Results, str, str], float],
    bounds: tuple[float, float],
    *,
    prefix: str = "",
    **fields: Any,
) -> PerCode[Check]:
    """Observed order in the time step of error(results, label, code), over the variants whose label starts
    with `prefix`. `fields` go to `Check`.
    """

    def measure(results: Results, code: str) -> Measured:
        labels = results.labels(code, prefix=prefix)
        rungs = sorted((results[name, code].scene.time.step, error(results, name, code)) for name in labels)
        ends = " to ".join(f"{error:.2g} at {step:.3g} s" for step, error in (rungs[0], rungs[-1]))
        return Measured(trace.observed_order(*zip(*rungs, strict=True)), note=f"{len(rungs)} steps: {ends}")

    return per_code(name, measure, lo=bounds[0], tolerance=bounds[1], **fields)
