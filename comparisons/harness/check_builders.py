"""Checks that stand in many cases: one for each code, configuration or pair of codes, agreement step by step,
observed order in the time step; and the table of what they found.

In all of them but `check` `tolerance` may be {tier: tolerance}, and a measure may return several errors by
name, of which the largest counts.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from comparisons.harness import codes
from comparisons.harness.case import (
    Check,
    Measured,
    PerCode,
    PerPair,
    Results,
    Table,
    Tier,
    largest,
    relative,
)
from comparisons.harness.configurations import Configuration, Configurations
from comparisons.metrics import trace
from gpudem.output.run import Run

if TYPE_CHECKING:
    import pandas


#: A number beside what it should be: (number, what it should be), or with an error of its own.
Compared = Measured | tuple[float, float]
#: What a measure finds: one error, of a pair the relative one; or several, of which the largest counts:
#: {"e = 0.3": error, ...}.
Found = float | Compared | Mapping[str, float | Compared]
#: What the runs of a code show: {"spin [rad/s]": {"20 deg": (spin, what it should be), ...}, ...}.
Observe = Callable[[Results, str], Mapping[str, Mapping[str, Compared]]]


def error(found: Found) -> Measured | float:
    """The one error that a check holds to its tolerance."""
    if isinstance(found, Mapping):
        errors = {where: relative(*one) if isinstance(one, tuple) else one for where, one in found.items()}
        return largest(errors)
    return relative(*found) if isinstance(found, tuple) else found


def check(name: str, measure: Callable[[Results], Found], **fields: Any) -> Check:
    """One check. `fields` go to `Check`; unit "1", mark A."""
    fields = {"unit": "1", "mark": "A"} | fields
    return Check(name=name, measure=lambda results: error(measure(results)), **fields)


def checks(
    name: str,
    measure: Callable[[Results], Found],
    tolerance: float | Mapping[Tier, float],
    **fields: Any,
) -> tuple[Check, ...]:
    """One check; with {tier: tolerance} one for each of these tiers, which `{tier}` in the name stands for.
    `fields` go to `check`.
    """
    if not isinstance(tolerance, Mapping):
        return (check(name, measure, tolerance=tolerance, **fields),)
    return tuple(
        check(name.replace("{tier}", tier), measure, **{**fields, "tolerance": held, "tiers": (tier,)})
        for tier, held in tolerance.items()
    )


def per_code(
    name: str,
    measure: Callable[[Results, str], Found],
    *,
    also: tuple[str, ...] = (),
    beside: tuple[str, ...] = (),
    **fields: Any,
) -> PerCode[Check]:
    """One check for each code at hand, and for the engines `also`; measure(results, code). `beside`: further
    codes whose runs each reads. `fields` go to `checks`.
    """

    def make(code: str) -> tuple[Check, ...]:
        return checks(
            f"{name} ({code})", lambda results: measure(results, code), needs=(code, *beside), **fields
        )

    return PerCode(make, also)


def per_configuration(
    configurations: Configurations,
    name: str,
    measure: Callable[[Results, Configuration], Found],
    *,
    without: Sequence[Configuration] = (),
    changes: Mapping[str, Mapping[str, Any]] = MappingProxyType({}),
    **fields: Any,
) -> PerCode[Check]:
    """One check for each configuration of each code at hand but those of `without`;
    measure(results, configuration). `fields` go to `checks`; `changes` has other fields for a configuration,
    by its title: {"gpudem mixed": {"tolerance": 1e-5}}.
    """

    def make(code: str) -> tuple[Check, ...]:
        made = (
            checks(
                f"{name} ({one.title})",
                lambda results, one=one: measure(results, one),
                needs=(code,),
                **{**fields, **changes.get(one.title, {})},
            )
            for one in configurations.of(code)
            if one not in without
        )
        return tuple(itertools.chain(*made))

    return PerCode(make)


def per_quantity(
    observe: Observe, catches: Mapping[str, str], name: str = "{}, relative error", **fields: Any
) -> tuple[PerCode[Check], ...]:
    """For each quantity, which `catches` names with what its check would catch, one check for each code.

    `{}` in `name` stands for the quantity, without its unit; `fields` go to `per_code`.
    """

    def one(key: str, what: str) -> PerCode[Check]:
        title = name.format(key.partition(" [")[0])
        return per_code(title, lambda results, code: observe(results, code)[key], catches=what, **fields)

    return tuple(one(key, what) for key, what in catches.items())


def table(
    title: str,
    caption: str,
    observe: Observe | Mapping[str, Callable[[Results, str], Mapping[str, Compared]]],
    *,
    rows: str = "impact",
    reference: str = "closed form",
    **fields: Any,
) -> Table:
    """What each code gives, beside what is expected: a column for each quantity and code, all with the same
    rows. `observe` may be a measure(results, code) for each quantity. `rows` is the title of the first
    column; `fields` go to `Table`.
    """

    def of(results: Results, code: str) -> Mapping[str, Mapping[str, Compared]]:
        if isinstance(observe, Mapping):
            return {quantity: measure(results, code) for quantity, measure in observe.items()}
        return observe(results, code)

    def make(results: Results) -> pandas.DataFrame:
        import pandas

        lines: dict[str, dict[str, Any]] = {}
        ran = {code: of(results, code) for code in results.codes()}
        for quantity in dict.fromkeys(key for found in ran.values() for key in found):
            for code, found in ran.items():
                for where, one in found[quantity].items():
                    got, want = one if isinstance(one, tuple) else (one.measured, one.expected)
                    cells = lines.setdefault(where, {rows: where})
                    cells[f"{reference}: {quantity}"] = want
                    cells[f"{codes.title(code)}: {quantity}"] = got
        return pandas.DataFrame(list(lines.values()))

    return Table(title, caption, make, **fields)


def per_pair(
    name: str, measure: Callable[[Results, str, str], Found], *, brought: bool = True, **fields: Any
) -> PerPair[Check]:
    """One check for each code under test and its reference; measure(results, code, reference). `fields` go to
    `checks`; mark X, held against the reference, whose title replaces `{other}` in the name. If not
    `brought`, codes that a user brings are not compared.
    """

    def make(code: str, other: str) -> tuple[Check, ...]:
        if codes.brought(code) and not brought:
            return ()
        title = codes.title(other)
        of = {"mark": "X", "against": title, "needs": (code, other)} | fields
        return checks(name.replace("{other}", title), lambda results: measure(results, code, other), **of)

    return PerPair(make)


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
