"""Every check of commit 39dcc83 is kept, or listed in docs/checks/changed.toml with the reason: detects a
check that a change of the cases loses.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
_spec = importlib.util.spec_from_file_location("checks_kept", ROOT / "tools" / "checks_kept.py")
assert _spec is not None
assert _spec.loader is not None
checks_kept = importlib.util.module_from_spec(_spec)
sys.modules[_spec.name] = checks_kept  # dataclasses look their module up by name
_spec.loader.exec_module(checks_kept)
Change = checks_kept.Change

OLD = {"drop": {"energy": ["quick", "full"], "force (a)": ["quick"], "order": ["quick", "quick"]}}


def test_every_check_is_kept_or_listed():
    missing = checks_kept.compare(checks_kept.before(), checks_kept.now(), checks_kept.changes()).missing
    assert not missing, "\n".join(missing)


@pytest.mark.parametrize(
    ("now", "listed", "missing"),
    [
        (OLD, [], []),
        ({}, [], ["drop: energy [quick]", "drop: energy [full]", "drop: force (a)", "drop: order"]),
        ({"drop": OLD["drop"] | {"energy": ["quick"]}}, [], ["drop: energy [full]"]),
        ({"drop": OLD["drop"] | {"order": ["quick"]}}, [], ["drop: order [quick]"]),
        (
            {"drop": OLD["drop"] | {"energy": ["quick"]}},
            [Change("dropped", "slow", "drop", "energy", tiers=("full",))],
            [],
        ),
        (OLD, [Change("dropped", "slow", "drop", "energy")], ["entry that explains nothing"]),
        (
            {"drop": {"energy": ["quick", "full"], "force of a": ["quick"]}},
            [
                Change("renamed", "words", ".*", match=r"force \((.)\)", now=r"force of \1"),
                Change("finding", "cannot fail", "drop", "order"),
            ],
            [],
        ),
        (
            {"drop": {"energy": ["quick", "full"], "order": ["quick", "quick"]}},
            [Change("renamed", "words", "drop", "force (a)", now="force of a")],
            ["drop: force (a) [quick]: gone, listed as"],
        ),
    ],
    ids=["all", "none", "tier", "twice", "tier listed", "stale", "renamed", "renamed to nothing"],
)
def test_what_is_missing_is_said(now, listed, missing):
    found = checks_kept.compare(OLD, now, listed).missing
    assert len(found) == len(missing), found
    assert all(line.startswith(start) for line, start in zip(found, missing, strict=True)), found


@pytest.mark.parametrize(
    "entry",
    [
        {"became": "gone", "name": "energy", "reason": "x"},
        {"became": "dropped", "name": "energy", "reason": ""},
        {"became": "dropped", "reason": "x"},
        {"became": "renamed", "name": "energy", "reason": "x"},
    ],
)
def test_an_entry_that_explains_nothing_is_refused(entry):
    with pytest.raises(ValueError, match=r"needs became|`now` is for"):
        Change(case="drop", **entry)
