"""The last `make mutants --record`, for the report."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

RECORDED = Path(__file__).parents[1] / "recorded" / "mutants.json"


def recorded() -> dict[str, Any] | None:
    """What was kept, with its provenance; None if nothing was."""
    return json.loads(RECORDED.read_text()) if RECORDED.is_file() else None
