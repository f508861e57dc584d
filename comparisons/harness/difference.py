"""What changed between two comparisons: verdicts, values, inputs, versions, times. For regression in CI."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Iterator
from typing import Any, TypeVar

import numpy as np
from pydantic import ConfigDict
from scipy import stats

from comparisons.harness.results import CheckResult, Comparison, TimingResult

#: Change of a value that is shown, in tolerances of its check.
SHOWN = 0.1
#: Level of the tests of run times, over all of them together (Bonferroni).
ALPHA = 0.01
#: A mean of fewer runs has no confidence interval.
FEWEST = 3

BAD = ("fail", "error")


@dataclasses.dataclass(frozen=True)
class Verdict:
    """A check whose verdict changed; `missing` stands for one that is not in a comparison."""

    case: str
    check: str
    before: str
    after: str
    worse: bool
    """It fails now and did not, or it held and is not judged any more."""
    why: str = ""
    """Value and allowed range now, or why there is none."""


@dataclasses.dataclass(frozen=True)
class Value:
    """A check whose value or tolerance changed."""

    case: str
    check: str
    unit: str
    before: float
    after: float
    shift: float
    """|after - before| in tolerances (of a band: half its width); infinite where one is not a number."""
    allowed_before: str
    allowed_after: str


@dataclasses.dataclass(frozen=True)
class Speed:
    """Stepping time of a code, after over before: geometric mean over the runs that both comparisons have."""

    code: str
    case: str
    """Empty: over all cases."""
    runs: int
    factor: float
    low: float | None
    high: float | None
    """95 % confidence interval from the spread over the runs (t of the logarithms); None for fewer than 3."""
    significant: bool
    """Whether the factor differs from 1 at 0.01, corrected for the number of tests."""

    def __str__(self) -> str:
        what = (
            f"{self.code}{f' in {self.case}' if self.case else ''}: {self.factor:.3g} times the stepping time"
        )
        if self.low is None or self.high is None:
            return f"{what} ({self.runs} run{'s' * (self.runs > 1)}: too few to tell from noise)"
        word = "significant" if self.significant else "no significant difference"
        interval = f"95 % confidence interval {self.low:.3g} to {self.high:.3g}, {self.runs} runs"
        return f"{what} ({interval}; {word} at {ALPHA:g})"


@dataclasses.dataclass(frozen=True)
class Setting:
    """Something that the comparisons were made with or from."""

    what: str
    before: str
    after: str


@dataclasses.dataclass(frozen=True)
class Difference:
    """All that changed between two comparisons."""

    verdicts: list[Verdict]
    values: list[Value]
    inputs: list[Setting]
    """Runs whose scene, start or deck changed, or that ended otherwise."""
    settings: list[Setting]
    """Commit, tier, codes, options, machine, versions, packages."""
    broken: list[str]
    """Cases, figures, tables and findings that could not be made, and could before."""
    speeds: list[Speed]

    __pydantic_config__ = ConfigDict(ser_json_inf_nan="strings")

    @property
    def worse(self) -> bool:
        """Whether a verdict changed for the worse, or something cannot be made any more."""
        return bool(self.broken) or any(v.worse for v in self.verdicts)


def difference(before: Comparison, after: Comparison, shown: float = SHOWN) -> Difference:
    """What changed, values by more than `shown` tolerances of their checks."""
    checks = _paired(((c.case, c.name), c) for c in before.checks), _paired(
        ((c.case, c.name), c) for c in after.checks
    )  # fmt: skip
    old = set(before.broken())
    return Difference(
        verdicts=list(_verdicts(*checks)),
        values=list(_values(*checks, shown)),
        inputs=list(_inputs(before, after)),
        settings=list(_settings(before, after)),
        broken=[line for line in after.broken() if line not in old],
        speeds=_speeds(before.timings, after.timings),
    )


def text(found: Difference) -> Iterator[str]:
    """The difference in lines for a terminal, what is worse first."""
    for verdict in sorted(found.verdicts, key=lambda v: not v.worse):
        word = "WORSE " if verdict.worse else ""
        why = f" ({verdict.why})" if verdict.why else ""
        yield f"{word}{verdict.case}: {verdict.check}: {verdict.before} -> {verdict.after}{why}"
    yield from (f"WORSE {line}" for line in found.broken)
    for value in found.values:
        unit = "" if value.unit in ("", "1") else f" {value.unit}"
        line = f"value {value.case}: {value.check}: {value.before:.6g} -> {value.after:.6g}{unit}"
        line += f", {value.shift:.3g} tolerances"
        if value.allowed_before != value.allowed_after:
            line += f"; allowed {value.allowed_before} -> {value.allowed_after}"
        yield line
    for kind, changed in (("input", found.inputs), ("made with", found.settings)):
        yield from (f"{kind} {s.what}: {s.before} -> {s.after}" for s in changed)
    yield from (f"time {speed}" for speed in found.speeds)
    worse = sum(v.worse for v in found.verdicts) + len(found.broken)
    yield f"{len(found.verdicts)} verdicts changed, {worse} for the worse; {len(found.values)} values changed"


Key = TypeVar("Key")
Item = TypeVar("Item")


def _paired(items: Iterable[tuple[Key, Item]]) -> dict[Key, Item]:
    """By key; the first of several."""
    found: dict[Key, Item] = {}
    for key, item in items:
        found.setdefault(key, item)
    return found


#: By case and name.
Checks = dict[tuple[str, str], CheckResult]


def _verdicts(before: Checks, after: Checks) -> Iterator[Verdict]:
    for key in dict.fromkeys([*before, *after]):
        one, two = before.get(key), after.get(key)
        was, now = (one.status if one else "missing"), (two.status if two else "missing")
        if was != now:
            worse = (now in BAD and was not in BAD) or (was == "pass" and now in ("missing", "left_out"))
            yield Verdict(
                *key, was.replace("_", " "), now.replace("_", " "), worse, two.verdict if two else ""
            )


def _values(before: Checks, after: Checks, shown: float) -> Iterator[Value]:
    for key, one in before.items():
        two = after.get(key)
        if two is None or one.value is None or two.value is None:
            continue
        shift = _shift(one, one.value, two.value)
        if shift > shown or one.allowed != two.allowed:
            yield Value(*key, two.unit, one.value, two.value, shift, one.allowed, two.allowed)


def _shift(check: CheckResult, before: float, after: float) -> float:
    """|after - before| in tolerances; 0 for the same value, also for the same infinity or twice no number."""
    if before == after or (math.isnan(before) and math.isnan(after)):
        return 0.0
    scale = check.tolerance
    if check.lo is not None:
        scale = abs(check.lo) if math.isinf(check.tolerance) else (check.tolerance - check.lo) / 2
    change = abs(after - before)
    return change / abs(scale) if scale and math.isfinite(change) else math.inf


def _inputs(before: Comparison, after: Comparison) -> Iterator[Setting]:
    runs = [_paired(((r.case, r.variant, r.code), r) for r in c.runs) for c in (before, after)]
    for key in runs[0].keys() & runs[1].keys():
        one, two = runs[0][key], runs[1][key]
        for field in ("status", "scene_hash", "state_hash", "deck_hash", "seed", "recorded"):
            was, now = str(getattr(one, field)), str(getattr(two, field))
            if was != now:
                short = slice(12 if field.endswith("hash") else None)
                yield Setting(f"{' '.join(key)}, {field.replace('_', ' ')}", was[short], now[short])


def _settings(before: Comparison, after: Comparison) -> Iterator[Setting]:
    facts = [_facts(before), _facts(after)]
    for what in dict.fromkeys([*facts[0], *facts[1]]):
        was, now = (each.get(what, "none") for each in facts)
        if was != now:
            yield Setting(what, was, now)


def _facts(c: Comparison) -> dict[str, str]:
    made = c.provenance
    facts = {
        "tier": c.tier, "codes": ", ".join(c.codes), "state": c.state, "Python": made["python"],
        "commit": made["commit"] + " with uncommitted changes" * made["dirty"], "system": made["os"],
    }  # fmt: skip
    facts |= {f"option {name}": str(value) for name, value in c.options.items()}
    facts |= {f"machine, {name}": str(value) for name, value in made["hardware"].items()}
    facts |= {f"version of {r.code}": r.version for r in c.runs if r.status == "ok"}
    return facts | {f"package {name}": version for name, version in made["packages"].items()}


def _speeds(before: list[TimingResult], after: list[TimingResult]) -> list[Speed]:
    """By code over all cases, then by code and case; only runs that did the same work on as many cores."""

    def by_run(timings: list[TimingResult]) -> dict[Any, float]:
        return _paired(
            ((t.case, t.variant, t.code, t.device, t.cores, t.precision, t.particles, t.steps), t.stepping_s)
            for t in timings
            if 0 < t.stepping_s < math.inf
        )

    was, now = by_run(before), by_run(after)
    logs: dict[tuple[str, str], list[float]] = {}
    for key in [key for key in was if key in now]:
        ratio = math.log(now[key] / was[key])
        for group in ((key[2], ""), (key[2], key[0])):
            logs.setdefault(group, []).append(ratio)
    for code in [code for code, case in logs if not case]:
        if len(cases := [group for group in logs if group[0] == code and group[1]]) == 1:
            del logs[cases[0]]  # the same runs
    groups = sorted(logs.items(), key=lambda item: (item[0][1] != "", item[0]))
    tests = sum(len(ratios) >= FEWEST for _, ratios in groups)
    return [_speed(*group, np.array(ratios), tests) for group, ratios in groups]


def _speed(code: str, case: str, ratios: np.ndarray, tests: int) -> Speed:
    n, mean = len(ratios), float(ratios.mean())
    if n < FEWEST:
        return Speed(code, case, n, math.exp(mean), None, None, False)
    error = float(ratios.std(ddof=1)) / math.sqrt(n)
    half = float(stats.t.ppf(0.975, n - 1)) * error
    p = float(2 * stats.t.sf(abs(mean) / error, n - 1)) if error else float(mean == 0)
    return Speed(
        code, case, n, math.exp(mean), math.exp(mean - half), math.exp(mean + half), p < ALPHA / tests
    )
