"""What the page shows, worked out of a comparison: order of checks, coverage, the ratio axis, files."""

from __future__ import annotations

import csv
import dataclasses
import functools
import io
import math
import re
from pathlib import Path

from markupsafe import Markup, escape

from comparisons.harness import attribution, brought, codes
from comparisons.harness.folder import DECK, Folder, Refused
from comparisons.harness.numbers import DASH, MINUS, number
from comparisons.harness.results import (
    CaseResult,
    CheckResult,
    Comparison,
    FindingResult,
    RunResult,
    TimingResult,
)  # fmt: skip

#: The ratio axis: value / tolerance from 10^LOW to 10^HIGH.
LOW, HIGH = -8, 2
TICKS = range(LOW, HIGH + 1, 2)

MARKS = {
    "A": "closed form, ODE solution or exact invariance",
    "P": "published measurement or computation",
    "X": "another code on the same scene",
    "R": "another run of the same code: with another option, or an earlier one that is stored",
}

WORDS = {"pass": "PASS", "fail": "FAIL", "error": "ERROR", "left_out": "LEFT OUT"}

_SEVERITY = {"error": 0, "fail": 1, "pass": 2, "left_out": 3}

#: Files of a run worth a link, in this order; patterns within the run's folder.
FILES = (
    "deck*",
    "in.*",
    "*.data",
    "scene.json",
    "run.json",
    "run.pvd",
    "history.csv",
    "trace.npz",
    "log*",
    "error.txt",
)

#: Checks that do not hold, at the top of the page.
FAILURES = 10

#: Decks printed in the page per case; further ones are linked.
MAX_DECKS = 12


@dataclasses.dataclass(frozen=True)
class Deck:
    """A deck printed in the page."""

    variant: str
    text: str


def missing_codes(comparison: Comparison) -> list[str]:
    """For page and terminal: which codes are not on the machine, how to get them, what that leaves out."""
    found = []
    for code, why in comparison.missing.items():
        stored = comparison.recorded_runs(code)
        away = sum(run.code == code and run.status == "left_out" for run in comparison.runs)
        found.append(
            f"{codes.title(code)} is missing: {why}. Its output of {stored} runs was recorded earlier;"
            f" {away} runs, and the checks that need them, are left out."
        )
    return found


def own_codes(comparison: Comparison) -> list[str]:
    """For page and terminal: what was found of each code that a user brought over several cases, a sentence
    each; none where one case says it.
    """
    made = []
    for code in dict.fromkeys(code for case in comparison.cases for code in case.differs):
        found: dict[str, list[str]] = {}
        for case in comparison.cases:
            if code in case.differs:
                found.setdefault(case.differs[code].partition(":")[0], []).append(case.name)
        if sum(map(len, found.values())) < 2:
            continue
        parts = [f"{what} in {_some(names)}" for what, names in sorted(found.items(), key=_follows_last)]
        mine = [c for c in comparison.checks if code in c.needs and c.status != "left_out"]
        bad = sum(c.status != "pass" for c in mine)
        checks = f"{bad} of its {len(mine)} checks do not hold" if bad else f"all {len(mine)} checks hold"
        made.append(f"{codes.title(code)}: {'; '.join(parts)}; {checks}.")
    return made


def headlines(comparison: Comparison) -> list[tuple[str, str]]:
    """(case, what was found in it) for page and terminal; first, without a case, what was found of a user's
    codes over all cases, which then stands in place of the sentences of cases that speak of them only.
    """
    own = own_codes(comparison)
    found = [("", sentence) for sentence in own]
    for case in comparison.cases:
        summed_up = bool(own) and any(case.headline.startswith(f"{codes.title(c)}: ") for c in case.differs)
        if case.headline and not summed_up:
            found.append((case.name, case.headline))
    return found


def _follows_last(item: tuple[str, list[str]]) -> tuple[bool, int]:
    """What differs first, in most cases first."""
    what, names = item
    return what in (attribution.FOLLOWED, brought.UNKNOWN), -len(names)


def _some(names: list[str]) -> str:
    """Names of cases; of many their number."""
    if len(names) > 4:
        return f"{len(names)} cases"
    return " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))


class View:
    """A comparison as the templates read it."""

    words, marks = WORDS, MARKS

    def __init__(self, comparison: Comparison, directory: Path):
        self.comparison, self.folder = comparison, Folder(directory)

    # -- verdict ---------------------------------------------------------------------------------------------

    @functools.cached_property
    def verdict(self) -> tuple[str, str]:
        """(status word for the colour, sentence)."""
        c = self.comparison
        n, total = c.counts(), len(c.checks)
        judged = total - n["left_out"]
        bad = [f"{n['fail']} fail"] * (n["fail"] > 0) + [f"{n['error']} could not be evaluated"] * (
            n["error"] > 0
        )
        bad += [f"{len(c.broken())} case, figure, table or finding broken"] * bool(c.broken())
        if bad:
            return "fail", f"{n['pass']} of {judged} checks hold; {', '.join(bad)}"
        if c.state == "interrupted":
            return "warn", f"Interrupted: {n['pass']} of {total} checks hold, the others were not reached"
        if c.state == "running":
            return "warn", f"Still running: {n['pass']} checks hold so far" if total else "Still running"
        if not judged:
            return "warn", "Nothing was checked"
        return "pass", f"All {judged} checks hold"

    @functools.cached_property
    def missing(self) -> list[str]:
        """A sentence for each code that is not on the machine."""
        return missing_codes(self.comparison)

    @functools.cached_property
    def headlines(self) -> list[tuple[str, str]]:
        """(case or nothing, what was found)."""
        return headlines(self.comparison)

    @functools.cached_property
    def failures(self) -> list[CheckResult]:
        """The first checks that fail or could not be evaluated."""
        return self._bad[:FAILURES]

    @functools.cached_property
    def more_failures(self) -> int:
        """How many more there are."""
        return len(self._bad) - len(self.failures)

    @functools.cached_property
    def _bad(self) -> list[CheckResult]:
        return [c for c in self.checks if c.status in ("fail", "error")]

    @functools.cached_property
    def versions(self) -> list[str]:
        """Like "gpudem 0.1" and "LIGGGHTS 3.8.0 (recorded)"."""
        found = {}
        for run in self.comparison.runs:
            if run.status == "ok":
                found.setdefault((run.code, run.version), set()).add(run.recorded)
        note = {frozenset({True}): " (recorded)", frozenset({True, False}): " (partly recorded)"}
        name = {(c, v): v if v.startswith(codes.title(c)) else f"{codes.title(c)} {v}" for c, v in found}
        return [f"{name[key]}{note.get(frozenset(r), '')}" for key, r in sorted(found.items())]

    @functools.cached_property
    def devices(self) -> list[str]:
        """Like "gpudem: cpu, 2 cores, float64", most used first."""
        found: dict[str, int] = {}
        for t in self.comparison.timings:
            unit = codes.unit(t.code) + "s" * (t.cores != 1)
            key = f"{codes.title(t.code)}: {t.device}, {t.cores} {unit}, {t.precision}"
            found[key] = found.get(key, 0) + 1
        return sorted(found, key=lambda key: -found[key])

    # -- checks ----------------------------------------------------------------------------------------------

    @functools.cached_property
    def checks(self) -> list[CheckResult]:
        """Failures first; within a status as the cases stand, most of the tolerance used first."""
        order = {case.name: k for k, case in enumerate(self.comparison.cases)}
        return sorted(
            self.comparison.checks, key=lambda c: (_SEVERITY[c.status], order.get(c.case, 0), -(c.ratio or 0))
        )

    @functools.cached_property
    def passed(self) -> list[tuple[CaseResult, list[CheckResult]]]:
        """(case, its checks that hold, most of the tolerance used first)."""
        groups = (
            (c, [k for k in self.checks if k.case == c.name and k.status == "pass"])
            for c in self.comparison.cases
        )
        return [(case, checks) for case, checks in groups if checks]

    def checks_of(self, case: str) -> list[CheckResult]:
        """The checks of a case in their own order."""
        return [c for c in self.comparison.checks if c.case == case]

    def check_id(self, check: CheckResult) -> str:
        """Anchor of a check; its place keeps it unique."""
        return f"check-{check.case}-{self.checks_of(check.case).index(check) + 1}"

    ticks = tuple((t, 100 * (t - LOW) / (HIGH - LOW)) for t in TICKS)
    limit = 100 * (0 - LOW) / (HIGH - LOW)

    @staticmethod
    def place(check: CheckResult) -> float | None:
        """Where a check's value / tolerance lies on the ratio axis [% of its width]; None without a value."""
        ratio = check.ratio
        if ratio is None:
            return None
        exponent = math.log10(ratio) if ratio > 0 else -math.inf
        return 100 * (min(max(exponent, LOW), HIGH) - LOW) / (HIGH - LOW)

    # -- coverage --------------------------------------------------------------------------------------------

    @functools.cached_property
    def coverage(self) -> list[tuple[str, list[list[tuple[str, bool]]]]]:
        """(feature, for each case the marks of its checks, each with whether all with that mark hold)."""
        cases = self.comparison.cases
        features = sorted({f for case in cases for f in case.features})
        return [(f, [self._marks(case) if f in case.features else [] for case in cases]) for f in features]

    def _marks(self, case: CaseResult) -> list[tuple[str, bool]]:
        mine = [c for c in self.comparison.checks if c.case == case.name and c.status != "left_out"]
        return [
            (mark, all(c.status == "pass" for c in mine if c.mark == mark))
            for mark in MARKS
            if any(c.mark == mark for c in mine)
        ]

    @staticmethod
    def changed(case: CaseResult) -> str:
        """Which checks of the record are made of other code than those of this page, as a sentence."""
        if case.recorded is None:
            return ""
        then = case.recorded.code
        if not then:
            return (
                "Whether the code of its checks has changed since is not known: their hashes were not kept."
            )
        names = [check.name for check in case.recorded.checks]
        other = [name for name in names if then.get(name) != case.code.get(name)]
        if not other:
            return "The code of its checks has not changed since."
        what = "(scenes, measures or reference solutions) has changed since"
        if len(other) == len(names):
            return f"The code of all its checks {what}."
        return f"The code of {len(other)} of its {len(names)} checks {what}: {'; '.join(other)}."

    # -- cases -----------------------------------------------------------------------------------------------

    def timings_of(self, case: str) -> list[TimingResult]:
        """Timings of a case."""
        return [t for t in self.comparison.timings if t.case == case]

    def findings_of(self, case: str) -> list[FindingResult]:
        """Findings of a case in their own order."""
        return [f for f in self.comparison.findings if f.case == case]

    def runs_of(self, case: str) -> list[RunResult]:
        """Runs of a case."""
        return [r for r in self.comparison.runs if r.case == case]

    def files(self, run: RunResult) -> list[tuple[str, str]]:
        """(name, its place in the folder) of the files of a run; (why, "") where they may not be read."""
        try:
            return [(name.rpartition("/")[2], name) for name in self.folder.listed(run.directory, FILES)]
        except Refused as error:
            return [(str(error), "")]

    def decks(self, case: str) -> list[Deck]:
        """The decks of a case, each text once; in place of one that is not read, why."""
        found: dict[str, str] = {}
        for run in self.runs_of(case):
            try:
                for name in self.folder.listed(run.directory, ("deck*",)):
                    text = self.folder.read(name, DECK).decode(errors="replace")
                    found.setdefault(text, run.variant)
            except Refused as error:
                found.setdefault(str(error), run.variant)
        return [Deck(variant, text) for text, variant in list(found.items())[:MAX_DECKS]]

    def status_of(self, case: CaseResult) -> str:
        """Worst status of a case, for its color and word; empty where it has nothing but findings."""
        shown = [*case.artefacts, *self.findings_of(case.name)]
        statuses = {c.status for c in self.checks_of(case.name)} | {a.status for a in shown} - {"ok"}
        if case.status == "error" or "error" in statuses:
            return "error"
        if "fail" in statuses:
            return "fail"
        return "pass" if "pass" in statuses else "left_out" if self.checks_of(case.name) else ""


def memory(n: float) -> str:
    """Bytes for a reader."""
    return f"{n / 2**30:.2f} GiB" if n >= 2**30 else f"{n / 2**20:.0f} MiB" if n else DASH


def prose(text: str) -> Markup:
    """A text of a case as HTML: names between backticks in the type of code."""
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(text))))


def named(text: str) -> str:
    """The name of a check or finding, with the names that people know codes by."""
    return re.sub(r"\b[a-z]\w*\b", lambda word: codes.title(word[0]), text)


def anchor(text: str) -> str:
    """A name as an HTML id."""
    return re.sub(r"[^A-Za-z0-9_-]+", "-", text)


def read_table(text: str) -> dict[str, list]:
    """CSV as header, which columns hold numbers only, and rows of text; numbers rounded for a reader, with
    their full digits as the title.

    Raises Refused where it is not CSV.
    """
    try:
        lines = list(csv.reader(io.StringIO(text)))
    except csv.Error as error:
        raise Refused(f"not a table: {error}") from None
    header, rows = lines[0] if lines else [], [[_cell(x) for x in line] for line in lines[1:]]
    numeric = [all(row[k][2] for row in rows if k < len(row)) for k in range(len(header))]
    return {"header": header, "numeric": numeric, "rows": rows}


def _cell(text: str) -> tuple[str, str, bool]:
    """(shown, full, is a number)."""
    try:
        value = float(text)
    except ValueError:
        return text, "", False
    whole = re.fullmatch(r"-?\d{1,15}", text)
    return (text.replace("-", MINUS) if whole else number(value)), text, True
