"""Cases as data: Case = scenes + checks + figures + prose; Check = measure, tolerance, reason."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, Literal

from gpudem.errors import GpudemError
from gpudem.output.run import Run
from gpudem.scene import Scene

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure as MatplotlibFigure

Tier = Literal["quick", "standard", "full"]
TIERS: tuple[Tier, ...] = ("quick", "standard", "full")

#: Held against: Analytical (closed form, ODE, invariance), Published data, cross-code (X), Regression.
Mark = Literal["A", "P", "X", "R"]

#: Where a figure or table stands in the report: with its case, or in a section that collects from all cases.
Section = Literal["case", "lead", "advice", "work_precision", "speed", "limits", "leaves_out"]


class Unmeasured(GpudemError):
    """A measure's tool is not on this machine: the check, figure or table is left out, and says so."""


@dataclasses.dataclass(frozen=True)
class Variant:
    """One scene of a case; runs once through each code."""

    label: str
    """Short and unique within the case; letters, digits, `_`, `-`, `.`; names the run directory."""
    scene: Scene
    codes: tuple[str, ...] = ("gpudem", "liggghts")
    options: dict[str, dict[str, Any]] = dataclasses.field(default_factory=dict)
    """Keyword arguments of a code's run function, by code: {"liggghts": {"ranks": 2}}."""
    may_end: bool = False
    """The scene is there to find out whether codes come through: an error of a code is a result, kept in
    `Results.ended`, and no failure of the comparison."""


@dataclasses.dataclass(frozen=True)
class Results:
    """The runs of a case: `results["dt_1e-6", "liggghts"]`."""

    tier: Tier
    runs: dict[tuple[str, str], Run]
    cache: dict[Any, Any] = dataclasses.field(default_factory=dict)
    """For what several checks share (an oracle's solution): `results.once(key, function)`."""
    ended: dict[tuple[str, str], str] = dataclasses.field(default_factory=dict)
    """What a code said when it gave up a variant that may end early; such a variant has no run."""

    def __getitem__(self, key: tuple[str, str]) -> Run:
        return self.runs[key]

    def labels(self, code: str | None = None) -> list[str]:
        """Variant labels in order, all or those that a code ran."""
        return list(dict.fromkeys(label for label, c in self.runs if code in (None, c)))

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
    make: Callable[[Results], pandas.DataFrame]
    tiers: tuple[Tier, ...] = TIERS
    needs: tuple[str, ...] = ("gpudem",)
    section: Section = "case"
    recorded: bool = False
    """Of the full tier: also kept with `compare --tier full --record`, for reports of shorter tiers."""


@dataclasses.dataclass(frozen=True)
class Case:
    """One comparison: what is set up, what is checked, what is shown and why it matters."""

    name: str
    title: str
    purpose: str
    """What it shows and why it matters: one paragraph."""
    source: str
    """Where set-up and expected values come from."""
    variants: Callable[[Tier], list[Variant]]
    checks: tuple[Check, ...]
    figures: tuple[Figure, ...] = ()
    tables: tuple[Table, ...] = ()
    features: tuple[str, ...] = ()
    """Rows of the coverage matrix: "normal hertz", "tangential history", "wall plane", ..."""
    order: int = 100
    """Place in the report; lower first, quick cases first."""
    tiers: tuple[Tier, ...] = TIERS
