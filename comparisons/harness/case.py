"""Cases as data: Case = scenes + checks + findings + figures + prose; Check = measure, tolerance, reason."""

from __future__ import annotations

import dataclasses
import math
import re
import statistics
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Generic, Literal, TypeVar

from comparisons.harness import codes as registry
from gpudem.errors import GpudemError
from gpudem.output.run import Run
from gpudem.scene import Scene

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure as MatplotlibFigure

    from comparisons.harness.results import CheckResult

Tier = Literal["quick", "standard", "full"]
TIERS: tuple[Tier, ...] = ("quick", "standard", "full")

#: Held against: Analytical (closed form, ODE, invariance), Published data, cross-code (X), Regression.
Mark = Literal["A", "P", "X", "R"]

#: Where a figure or table stands in the report: with its case, or in a section that collects from all cases.
Section = Literal["case", "lead", "advice", "work_precision", "speed", "limits", "leaves_out"]


#: Names of cases and labels of variants: they name folders and stand in links.
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.+-]*")


def _require_name(what: str, name: str) -> None:
    if not _NAME.fullmatch(name):
        raise GpudemError(
            f"{what} {name!r}: names a folder; allowed are letters, digits, '_', '-', '.' and '+', the first"
            " a letter, a digit or '_'"
        )


class Unmeasured(GpudemError):
    """A measure's tool is not on this machine: the check, figure or table is left out, and says so."""


@dataclasses.dataclass(frozen=True)
class Variant:
    """One scene of a case; runs once through each code."""

    label: str
    """Short and unique within the case; letters, digits, `_`, `-`, `.`, `+`; names the run directory."""
    scene: Scene
    codes: tuple[str, ...] | None = None
    """Codes that run it; None: each that advances a scene step by step. A code that a user brought runs every
    variant of gpudem's for which gpudem has no options."""
    options: dict[str, dict[str, Any]] = dataclasses.field(default_factory=dict)
    """Keyword arguments of a code's run function, by code: {"liggghts": {"ranks": 2}}."""
    _: dataclasses.KW_ONLY
    open: bool = False
    """A scene of the user: a code that cannot be given it is left out; of a scene of ours, it is an error."""
    may_end: bool = False
    """The scene is there to find out whether codes come through: an error of a code is a result, kept in
    `Results.ended`, and no failure of the comparison."""
    timed: bool = False
    """A check, figure or table reads the times of its runs: nothing runs beside them."""

    def __post_init__(self) -> None:
        _require_name("variant", self.label)

    def names(self, code: str) -> bool:
        """Whether it has been written for a code: it says so, or the code is gpudem or a reference."""
        if self.codes is not None:
            return code in self.codes
        return not self.open and not registry.brought(code)

    def codes_of(self, selected: Sequence[str]) -> tuple[str, ...]:
        """Those of the selected codes that run it, in order."""
        named = registry.stepped(tuple(registry.CODES)) if self.codes is None else self.codes
        plain = "gpudem" in named and "gpudem" not in self.options
        own = [code for code in selected if registry.brought(code)] if plain else []
        return tuple(code for code in dict.fromkeys([*named, *own]) if code in selected)


@dataclasses.dataclass(frozen=True)
class Results:
    """The runs of a case: `results["dt_1e-6", "liggghts"]`."""

    tier: Tier
    runs: dict[tuple[str, str], Run]
    cache: dict[Any, Any] = dataclasses.field(default_factory=dict)
    """For what several checks share (an oracle's solution): `results.once(key, function)`."""
    ended: dict[tuple[str, str], str] = dataclasses.field(default_factory=dict)
    """What a code said when it gave up a variant that may end early; such a variant has no run."""
    left_out: dict[tuple[str, str], str] = dataclasses.field(default_factory=dict)
    """Runs that do not exist since the code is missing or cannot be given the scene: why."""
    failed: dict[tuple[str, str], str] = dataclasses.field(default_factory=dict)
    """Runs that ended with an error of the code: why."""

    def __getitem__(self, key: tuple[str, str]) -> Run:
        return self.runs[key]

    def labels(self, *codes: str, prefix: str = "") -> list[str]:
        """Variant labels in order that start with `prefix`: all, or those that each of the codes ran."""
        labels = dict.fromkeys(label for label, _ in self.runs if label.startswith(prefix))
        return [label for label in labels if all((label, code) in self.runs for code in codes)]

    def finest(self, prefix: str = "") -> str:
        """Label of the variant with the smallest time step among those that start with `prefix`."""
        steps = {lab: run.scene.time.step for (lab, _), run in self.runs.items() if lab.startswith(prefix)}
        return min(steps, key=lambda label: steps[label])

    def codes(self, label: str | None = None) -> list[str]:
        """Codes that ran, all or for one variant."""
        return list(dict.fromkeys(c for lab, c in self.runs if label in (None, lab)))

    def of(self, code: str) -> Iterator[tuple[str, Run]]:
        """(label, run) of one code."""
        return ((label, run) for (label, c), run in self.runs.items() if c == code)

    def once(self, key: Any, compute: Callable[[], Any]) -> Any:
        """compute() the first time, the stored value afterwards."""
        if key not in self.cache:
            self.cache[key] = compute()
        return self.cache[key]


@dataclasses.dataclass(frozen=True)
class Measured:
    """What a measure returns: the error (or statistic) held to the tolerance, and what it came from."""

    value: float
    measured: float | None = None
    """The quantity itself, where the check is about one number: contact time, restitution, ..."""
    expected: float | None = None
    note: str = ""


def relative(got: float, wanted: float) -> Measured:
    """Relative error `|got/wanted - 1|`, with both."""
    return Measured(abs(got / wanted - 1), got, wanted)


def median(values: Iterable[float], of: str = "repeats") -> Measured:
    """Median of several values, with their number and range in the note; `of` says what they are."""
    found = [float(value) for value in values]
    note = f"{len(found)} {of}, {min(found):.2f} to {max(found):.2f}"
    return Measured(statistics.median(found), note=note)


def largest(found: Mapping[str, float | Measured], note: str = "") -> Measured:
    """The largest of several errors, and where: {"dt_1e-6": error, ...}. One that is not a number is largest.

    Raises ValueError if there is none: nothing was measured.
    """
    if not found:
        raise ValueError("nothing was measured")
    values = {where: x if isinstance(x, Measured) else Measured(float(x)) for where, x in found.items()}
    where = max(values, key=lambda k: math.inf if math.isnan(values[k].value) else values[k].value)
    texts = [
        text for text in (note, f"largest in {where}" if len(values) > 1 else "", values[where].note) if text
    ]
    return dataclasses.replace(values[where], note="; ".join(texts))


@dataclasses.dataclass(frozen=True)
class Check:
    """One number that must lie within its tolerance.

    It passes if value <= tolerance (or lo <= value <= tolerance where `lo` is given); NaN fails.
    """

    name: str
    """Metric in words, with the norm: "position, largest difference over all steps / diameter"."""
    measure: Callable[[Results], Measured | float]
    """Pure function of the results; computes its own expected value, independent of `gpudem.contact`."""
    tolerance: float
    unit: str
    against: str
    """"LIGGGHTS", "ODE (DOP853, rtol 1e-13)", "closed form", "Park et al. 2014", ..."""
    mark: Mark
    reason: str
    """Why this tolerance."""
    catches: str
    """Which wrong implementation it would catch."""
    needs: tuple[str, ...] = ("gpudem",)
    """Codes whose runs it reads; left out, and said so, where one is not selected."""
    tiers: tuple[Tier, ...] = TIERS
    lo: float | None = None
    half_step: bool = False
    """Holds only of LIGGGHTS' half-step scheme at the step of the scene: agreement step by step. It is not
    required of a code that declares another."""


@dataclasses.dataclass(frozen=True)
class Finding:
    """A number that is worth knowing and that no tolerance can judge: shown, never passed, failed or counted.

    For timings, for what a reference code does, and for results of earlier runs. What must hold is a `Check`.
    """

    name: str
    """Quantity in words, with the norm."""
    measure: Callable[[Results], Measured | float]
    unit: str
    sentence: str
    """What the number says to the reader, in one sentence."""
    needs: tuple[str, ...] = ("gpudem",)
    """Codes whose runs it reads; left out, and said so, where one is not selected."""
    tiers: tuple[Tier, ...] = TIERS


#: What a case lists, or has made for each code or pair of codes.
Item = TypeVar("Item", Check, Finding)


@dataclasses.dataclass(frozen=True)
class PerCode(Generic[Item]):
    """The same checks or findings for each code at hand that advances a scene step by step."""

    make: Callable[[str], Item | tuple[Item, ...]]
    """Name of a code -> its checks; their names hold the code's name, `needs` is that code."""
    also: tuple[str, ...] = ()
    """Engines, which have no time step, that they are made for as well."""


@dataclasses.dataclass(frozen=True)
class PerPair(Generic[Item]):
    """The same checks or findings for each code under test and the code that it is compared with
    (`codes.pairs`).
    """

    make: Callable[[str, str], Item | tuple[Item, ...]]
    """(code under test, the other) -> checks, `needs` both. The name of the pair is added to those of pairs
    that are not gpudem and a reference."""


@dataclasses.dataclass(frozen=True)
class Figure:
    """A figure of the report."""

    title: str
    caption: str
    """What to see in it, in one to three sentences."""
    draw: Callable[[Results], MatplotlibFigure]
    tiers: tuple[Tier, ...] = TIERS
    needs: tuple[str, ...] = ("gpudem",)
    section: Section = "case"
    recorded: bool = False
    """Of the full tier: also kept with `compare --tier full --record`, for reports of shorter tiers."""


@dataclasses.dataclass(frozen=True)
class Table:
    """A table of the report; column names carry units: "contact time [s]"."""

    title: str
    caption: str
    make: Callable[[Results], pandas.DataFrame | list[dict[str, Any]]]
    """A data frame, or its rows by column."""
    tiers: tuple[Tier, ...] = TIERS
    needs: tuple[str, ...] = ("gpudem",)
    section: Section = "case"
    recorded: bool = False
    """Of the full tier: also kept with `compare --tier full --record`, for reports of shorter tiers."""


@dataclasses.dataclass(frozen=True)
class Case:
    """One comparison: what is set up, what is checked, what is shown and why it matters."""

    name: str
    """Names the case on the command line and its folder: letters, digits, `_`, `-`, `.`, `+`."""
    title: str
    purpose: str
    """What it shows and why it matters: one paragraph."""
    source: str
    """Where set-up and expected values come from."""
    variants: Callable[[Tier], list[Variant]]
    checks: tuple[Check | PerCode[Check] | PerPair[Check], ...]
    figures: tuple[Figure, ...] = ()
    tables: tuple[Table, ...] = ()
    findings: tuple[Finding | PerCode[Finding] | PerPair[Finding], ...] = ()
    """What was found that cannot fail: shown in a list of its own."""
    features: tuple[str, ...] = ()
    """Rows of the coverage matrix: "normal hertz", "tangential history", "wall plane", ..."""
    order: int = 100
    """Place in the report; lower first, quick cases first."""
    tiers: tuple[Tier, ...] = TIERS
    timed: bool = False
    """Its checks, figures or tables time programs themselves: nothing runs beside them."""
    follow_up: Callable[[Results], list[Variant]] | None = None
    """Variants that depend on what the others show: made from their results, run after them."""
    headline: Callable[[Results, Sequence[CheckResult]], str] | None = None
    """What was found, in one sentence for the top of the page."""

    def __post_init__(self) -> None:
        _require_name("case", self.name)

    def checks_of(self, tier: Tier, selected: Sequence[str] | None = None) -> list[Check]:
        """The checks of a tier in order, made for the selected codes (all that are known if None)."""
        return _made(self.checks, tier, selected)

    def findings_of(self, tier: Tier, selected: Sequence[str] | None = None) -> list[Finding]:
        """The findings of a tier in order, made like the checks."""
        return _made(self.findings, tier, selected)


def _made(
    listed: Sequence[Item | PerCode[Item] | PerPair[Item]], tier: Tier, selected: Sequence[str] | None
) -> list[Item]:
    chosen = tuple(registry.CODES) if selected is None else tuple(selected)
    return [item for entry in listed for item in _expand(entry, chosen) if tier in item.tiers]


def _expand(item: Item | PerCode[Item] | PerPair[Item], selected: tuple[str, ...]) -> Iterator[Item]:
    if isinstance(item, PerCode):
        for code in (*registry.stepped(selected), *item.also):
            yield from _several(item.make(code))
    elif isinstance(item, PerPair):
        for code, other in registry.pairs(selected):
            usual = code == "gpudem" and registry.CODES[other].role == "reference"
            names = "" if usual else f" ({registry.title(code)} against {registry.title(other)})"
            for made in _several(item.make(code, other)):
                yield dataclasses.replace(made, name=made.name + names)
    else:
        yield item


def _several(made: Item | tuple[Item, ...]) -> tuple[Item, ...]:
    return made if isinstance(made, tuple) else (made,)
