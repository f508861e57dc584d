"""What a comparison found, as dataclasses <-> results.json with a versioned schema.

The report page and junit.xml are made from this file and the artefacts beside it; no code runs for them.
"""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any, Literal

from pydantic import ConfigDict, TypeAdapter, ValidationError
from pydantic.json_schema import GenerateJsonSchema
from pydantic_core import from_json
from typing_extensions import TypedDict  # that of typing: not for pydantic before Python 3.12

from comparisons.harness.case import Mark, Section, Tier
from comparisons.harness.folder import RESULTS as LARGEST
from comparisons.harness.folder import Folder, Refused
from comparisons.harness.numbers import number
from gpudem.errors import GpudemError
from gpudem.output.atomic import write_bytes

#: Raised by one whenever a field changes its name or meaning.
SCHEMA_VERSION = 1

RESULTS = "results.json"

Status = Literal["pass", "fail", "error", "left_out"]


class Hardware(TypedDict):
    """The machine; memory in GiB, cores that the process may use, names of the CUDA devices."""

    cpu: str
    cores: int
    memory_gib: float
    gpus: list[str]


class Origin(TypedDict):
    """Commit, when and where."""

    commit: str
    """Short hash; "unknown" outside a checkout of the project."""
    dirty: bool
    """With uncommitted changes."""
    date: str
    """UTC, ISO 8601."""
    hardware: Hardware


class Provenance(Origin):
    """Where and with what a comparison was made."""

    command: str
    python: str
    os: str
    packages: dict[str, str]
    """Version by name."""
    packages_sha256: str


@dataclasses.dataclass(frozen=True)
class CheckResult:
    """One check: what was held against what, how close it came, and why it matters."""

    case: str
    name: str
    status: Status
    unit: str
    tolerance: float
    against: str
    mark: Mark
    reason: str
    catches: str
    needs: tuple[str, ...]
    why: str = ""
    """Why it is an error or was left out."""
    value: float | None = None
    lo: float | None = None
    measured: float | None = None
    expected: float | None = None
    note: str = ""

    @property
    def verdict(self) -> str:
        """Why it has no value, or the value and what is allowed, in words."""
        if self.why or self.value is None:
            return self.why
        unit = "" if self.unit in ("", "1") else f" {self.unit}"
        return f"{self.value:.5g}{unit}, allowed: {self.allowed}"

    @property
    def allowed(self) -> str:
        """The range in which the value must lie."""
        if self.lo is None:
            return f"\u2264 {number(self.tolerance)}"
        if math.isinf(self.tolerance):
            return f"\u2265 {number(self.lo)}"
        return f"{number(self.lo)} to {number(self.tolerance)}"

    @property
    def ratio(self) -> float | None:
        """How much of the tolerance is used: <= 1 holds. In a band: distance from its middle."""
        if self.value is None or math.isnan(self.value):
            return None
        if self.lo is None:
            return self.value / self.tolerance if self.tolerance else (0.0 if self.value <= 0 else math.inf)
        if math.isinf(self.tolerance):
            return self.lo / self.value if self.value > 0 else math.inf
        half = (self.tolerance - self.lo) / 2
        return abs(self.value - (self.lo + self.tolerance) / 2) / half if half else math.inf


@dataclasses.dataclass(frozen=True)
class FindingResult:
    """One finding: a number and what it says; neither passed nor failed."""

    case: str
    name: str
    status: Literal["ok", "error", "left_out"]
    unit: str
    sentence: str
    needs: tuple[str, ...]
    why: str = ""
    """Why it is an error or was left out."""
    value: float | None = None
    note: str = ""


@dataclasses.dataclass(frozen=True)
class TimingResult:
    """Where the wall-clock time of one run went, and on what. Times in seconds of wall clock."""

    case: str
    variant: str
    code: str
    version: str
    device: str
    cores: int
    precision: str
    particles: int
    steps: int
    stepping_s: float
    compile_s: float
    setup_s: float
    output_s: float
    wall_s: float
    """From the call to its return, all included."""
    peak_memory_bytes: int
    rate: float
    """Particle-steps per second of stepping."""
    shared: bool = False
    """Other runs ran beside it: its times are no measurement of speed."""


@dataclasses.dataclass(frozen=True)
class RunResult:
    """One variant through one code: where it lies and what it was made from."""

    case: str
    variant: str
    code: str
    version: str
    status: Literal["ok", "error", "ended", "left_out"]
    """`ended`: the code gave the run up, which this variant is there to find out. `left_out`: the code is not
    on this machine, or cannot be given the scene."""
    directory: str
    """Relative to the comparison's folder."""
    scene_hash: str
    state_hash: str
    why: str = ""
    seed: int | None = None
    deck_hash: str = ""
    recorded: bool = False
    """True: stored output of an earlier run stood in for the code."""
    warnings: list[str] = dataclasses.field(default_factory=list)
    notes: dict[str, Any] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class Artefact:
    """A figure (.svg) or table (.csv) of a case; `why` says what went wrong where there is no file."""

    kind: Literal["figure", "table"]
    title: str
    caption: str
    section: Section
    file: str = ""
    """Relative to the comparison's folder; empty if it could not be made or was left out."""
    status: Literal["ok", "error", "left_out"] = "ok"
    why: str = ""
    recorded: bool = False
    """Kept with the full tier's record."""


@dataclasses.dataclass(frozen=True)
class Recorded:
    """What an earlier, longer run of a case found, kept in the project."""

    tier: Tier
    provenance: Origin
    versions: dict[str, str]
    """By code."""
    wall_s: float
    checks: list[CheckResult]
    artefacts: list[Artefact] = dataclasses.field(default_factory=list)
    """Figures and tables kept beside it, files relative to the folder of the records."""
    findings: list[FindingResult] = dataclasses.field(default_factory=list)
    code: dict[str, str] = dataclasses.field(default_factory=dict)
    """As in `CaseResult`; empty in records of before it was kept."""
    edited: str = ""
    """Date of the last change of its texts, where they are not those of the run; no number is changed."""

    __pydantic_config__ = ConfigDict(ser_json_inf_nan="strings")


@dataclasses.dataclass(frozen=True)
class CaseResult:
    """One case: prose, set-up, artefacts. Checks, findings, runs and timings stand in the lists of the
    comparison.
    """

    name: str
    title: str
    purpose: str
    source: str
    order: int
    features: tuple[str, ...]
    status: Literal["waiting", "done", "error", "interrupted"] = "waiting"
    why: str = ""
    wall_s: float = 0.0
    setup: list[tuple[str, str, str]] = dataclasses.field(default_factory=list)
    """Rows (quantity, value, unit) of the resolved scenes."""
    artefacts: list[Artefact] = dataclasses.field(default_factory=list)
    recorded: Recorded | None = None
    """Of the full tier, where this comparison is of a shorter one."""
    headline: str = ""
    """What was found, in one sentence; empty for a case that has none."""
    differs: dict[str, str] = dataclasses.field(default_factory=dict)
    """What differs in each code that a user brought, or that nothing does, in a few words."""
    code: dict[str, str] = dataclasses.field(default_factory=dict)
    """Hash of the source code of each check, over all tiers (`sources.hashes`)."""


@dataclasses.dataclass
class Comparison:
    """Everything of one `gpudem compare`."""

    tier: Tier
    codes: tuple[str, ...]
    options: dict[str, Any]
    started: str
    """UTC, ISO 8601."""
    written: str
    """When this was written, UTC."""
    provenance: Provenance
    cases: list[CaseResult]
    checks: list[CheckResult] = dataclasses.field(default_factory=list)
    findings: list[FindingResult] = dataclasses.field(default_factory=list)
    timings: list[TimingResult] = dataclasses.field(default_factory=list)
    runs: list[RunResult] = dataclasses.field(default_factory=list)
    wall_s: float = 0.0
    missing: dict[str, str] = dataclasses.field(default_factory=dict)
    """Codes selected that are not on this machine: why, and how to get them."""
    notices: list[str] = dataclasses.field(default_factory=list)
    """What concerns the whole comparison, such as a code whose runs cannot go side by side."""
    state: Literal["running", "done", "interrupted"] = "running"
    schema_version: int = SCHEMA_VERSION

    __pydantic_config__ = ConfigDict(ser_json_inf_nan="strings")

    def counts(self) -> dict[str, int]:
        """Checks by status."""
        return {s: sum(c.status == s for c in self.checks) for s in ("pass", "fail", "error", "left_out")}

    def recorded_runs(self, code: str) -> int:
        """Runs of a code for which its stored output stood in."""
        return sum(run.recorded for run in self.runs if run.code == code)

    def broken(self) -> list[str]:
        """What went wrong outside the checks: cases, figures, tables and findings that could not be made."""
        found = [f"case {c.name}: {c.why}" for c in self.cases if c.status == "error"]
        found += [f"finding {f.name!r} of {f.case}: {f.why}" for f in self.findings if f.status == "error"]
        return found + [
            f"{a.kind} {a.title!r} of {c.name}: {a.why}"
            for c in self.cases
            for a in c.artefacts
            if a.status == "error"
        ]

    def exit_code(self) -> int:
        """0: all checks hold; 1: one fails or has no result; 3: a code could not run; 130: interrupted."""
        if self.state == "interrupted":
            return 130
        if any(r.status == "error" for r in self.runs):
            return 3
        counts = self.counts()
        return 1 if counts["fail"] or counts["error"] or self.broken() else 0

    def save(self, directory: Path) -> None:
        """Write results.json, whole or not at all."""
        data = _FORM.dump_json(self, indent=1)
        write_bytes(directory / RESULTS, data)


_FORM = TypeAdapter(Comparison)


def load(directory: Path) -> Comparison:
    """Read DIRECTORY/results.json, which may come from anybody: all of it is checked.

    Raises GpudemError: missing, too large, not JSON (also nested too deeply), of another schema, or a value
    that is not of it; names the first such value.
    """
    path = directory / RESULTS
    try:
        data = from_json(Folder(directory).read(RESULTS, LARGEST))
    except Refused as error:
        raise GpudemError(f"{directory}: {error}; is this the folder of a comparison?") from None
    except ValueError as error:
        raise GpudemError(f"{path}: not JSON: {error}") from None
    version = data.get("schema_version") if isinstance(data, dict) else None
    if version != SCHEMA_VERSION:
        raise GpudemError(f"{path}: schema {version!r:.40}; this gpudem reads schema {SCHEMA_VERSION}")
    try:
        return _FORM.validate_python(data)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise GpudemError(f"{path}: {where}: {first['msg']} ({error.error_count()} problems)") from None


class _Schema(GenerateJsonSchema):
    """Numbers as they are written: JSON has no NaN and no infinity, which stand as strings."""

    def float_schema(self, schema: Any) -> dict[str, Any]:
        return {"anyOf": [super().float_schema(schema), {"enum": ["NaN", "Infinity", "-Infinity"]}]}


def json_schema() -> dict[str, Any]:
    """JSON schema (draft 2020-12) of results.json, made from the dataclasses above."""
    made = _FORM.json_schema(mode="serialization", schema_generator=_Schema)
    title = f"results.json of gpudem, schema {SCHEMA_VERSION}"
    constant = {"const": SCHEMA_VERSION, "type": "integer"}
    made["properties"]["schema_version"] = constant
    return {"$schema": GenerateJsonSchema.schema_dialect, **made, "title": title}
