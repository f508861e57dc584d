"""Every check of commit 39dcc83, by name: still there, or listed with what became of it and why.

    python tools/checks_kept.py             # what is missing and not listed; exit code 1 if anything is
    python tools/checks_kept.py --table     # the whole table, before and after, in Markdown

`docs/checks/checks_39dcc83.json` holds {case: {check: tiers}}, by `Case.checks_of` of that commit.
`docs/checks/changed.toml` says of each check that is no longer there what became of it.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import re
import sys
import tomllib
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT / "docs" / "checks"
#: {case: {check: tiers that have it}}; a tier stands twice where two checks of a case have one name.
Checks = dict[str, dict[str, list[str]]]
BECAME = ("renamed", "finding", "dropped")


@dataclasses.dataclass(frozen=True)
class Change:
    """What became of checks of 39dcc83: one entry of changed.toml."""

    became: str
    """renamed: `now` is what the check is called; finding: shown, no longer held; dropped."""
    reason: str
    case: str
    """Name of the case, or a regular expression for several."""
    name: str = ""
    """Name of the check ..."""
    match: str = ""
    """... or a regular expression for the whole names of several."""
    now: str = ""
    """Of a renamed one; may hold groups of `match`: \\1."""
    now_case: str = ""
    """Where it stands in another case."""
    tiers: Sequence[str] = ("quick", "standard", "full")
    """Where it is not in all tiers that had it: those that lost it."""

    def __post_init__(self):
        if self.became not in BECAME or not self.reason or bool(self.name) == bool(self.match):
            raise ValueError(f"needs became = {' | '.join(BECAME)}, a reason, and name or match: {self}")
        if (self.became == "renamed") != bool(self.now):
            raise ValueError(f"`now` is for renamed checks, which need it: {self}")

    def concerns(self, case: str, name: str, tier: str) -> bool:
        """Whether it speaks of a check of a tier."""
        named = name == self.name if self.name else re.fullmatch(self.match, name) is not None
        return named and tier in self.tiers and re.fullmatch(self.case, case) is not None

    def place(self, case: str, name: str) -> tuple[str, str]:
        """(case, name) that a renamed check has now."""
        now = self.now if self.name else re.sub(f"^(?:{self.match})$", self.now, name)
        return self.now_case or case, now


@dataclasses.dataclass
class Comparison:
    """What became of each check."""

    rows: list[tuple[str, str, str, str]] = dataclasses.field(default_factory=list)
    """(case, check, tiers, what became of it)."""
    missing: list[str] = dataclasses.field(default_factory=list)
    """Checks that are gone and not listed; entries of the list that say nothing, or something untrue."""


def changes(path: Path = DATA / "changed.toml") -> list[Change]:
    """The list. Raises ValueError, TypeError: an entry is not as it must be."""
    return [Change(**entry) for entry in tomllib.loads(path.read_text()).get("changed", [])]


def before(path: Path = DATA / "checks_39dcc83.json") -> Checks:
    """The checks of 39dcc83."""
    return json.loads(path.read_text())


def now() -> Checks:
    """The checks of the sources beside this file, for all codes that are known."""
    sys.path.insert(0, str(ROOT))
    from comparisons.harness.discover import find_cases

    found: Checks = {}
    for case in find_cases():
        of = found.setdefault(case.name, {})
        for tier in case.tiers:
            for check in case.checks_of(tier):
                of.setdefault(check.name, []).append(tier)
    return found


def compare(old: Checks, new: Checks, listed: list[Change]) -> Comparison:
    """What became of each check of `old`."""
    result = Comparison()
    used: list[Change | None] = []
    for case, checks in old.items():
        for name, tiers in checks.items():
            gone = Counter(tiers) - Counter(new.get(case, {}).get(name, []))
            fates = {"kept": [t for t in dict.fromkeys(tiers) if t not in gone]}
            for tier in gone:
                change = next((c for c in listed if c.concerns(case, name, tier)), None)
                fate = _fate(change, case, name, tier, new)
                if change is None or fate is None:
                    why = f"listed as {change.place(case, name)}, not there" if change else "not listed"
                    result.missing.append(f"{case}: {name} [{tier}]: gone, {why}")
                    fate = "MISSING"
                used.append(change)
                fates.setdefault(fate, []).append(tier)
            result.rows += [(case, name, " ".join(at), fate) for fate, at in fates.items() if at]
    result.missing += [f"entry that explains nothing: {change}" for change in listed if change not in used]
    return result


def _fate(change: Change | None, case: str, name: str, tier: str, new: Checks) -> str | None:
    """A change in words; None if there is none or it names a check that does not exist."""
    if change is None:
        return None
    if change.became != "renamed":
        return f"{change.became}: {change.reason}"
    where, called = change.place(case, name)
    if tier not in new.get(where, {}).get(called, []):
        return None
    return f"renamed: {'' if where == case else where + ': '}{called} ({change.reason})"


def main() -> int:
    """Command line; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--table", action="store_true", help="print the whole table")
    arguments = parser.parse_args()
    result = compare(before(), now(), changes())
    if arguments.table:
        print("| case | check of 39dcc83 | tiers | now |\n|---|---|---|---|")
        for row in result.rows:
            print("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |")
    for line in result.missing:
        print(line, file=sys.stderr)
    kept = sum(fate == "kept" for *_, fate in result.rows)
    print(f"{kept} of {len(result.rows)} rows kept, {len(result.missing)} to explain", file=sys.stderr)
    return 1 if result.missing else 0


if __name__ == "__main__":
    sys.exit(main())
