"""The result of the last `make mutants ARGS=--record`, for the report."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

from comparisons.mutation.trial import CAUGHT, SURVIVED, UNKNOWN

RECORDED = Path(__file__).parents[1] / "recorded" / "mutants.json"
#: How records named a run that reached the time limit before they had an outcome.
OLD_TIME_OUT = "no end within"


@dataclasses.dataclass(frozen=True)
class Row:
    """One mutant of the record."""

    name: str
    defect: str
    outcome: str
    """`caught`, `survived` or `unknown`."""
    caught_by: tuple[str, ...]
    data: dict[str, Any]
    """The row as it stands in the file."""


@dataclasses.dataclass(frozen=True)
class Record:
    """All mutants of the last recorded run, or of several if some were run again."""

    provenance: dict[str, Any]
    seconds: float
    rows: list[Row]

    def named(self, outcome: str) -> list[str]:
        """Names of the mutants with an outcome."""
        return [row.name for row in self.rows if row.outcome == outcome]


def load_record(path: Path = RECORDED) -> Record | None:
    """The record; None if there is none. Rows without an outcome are of the format before it was stored."""
    if not path.is_file():
        return None
    data = json.loads(path.read_text())
    return Record(data["provenance"], data["seconds"], [_row(row) for row in data["mutants"]])


def _row(data: dict[str, Any]) -> Row:
    defect, caught_by = data.get("defect") or data["wrong"], data["caught_by"]
    if "outcome" in data:
        outcome = data["outcome"]
    elif any(name.startswith(OLD_TIME_OUT) for name in caught_by):
        outcome, caught_by = UNKNOWN, []
    else:
        outcome = CAUGHT if caught_by else SURVIVED
    return Row(data["name"], defect, outcome, tuple(caught_by), data)
