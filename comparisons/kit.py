"""What modules of cases use, under one short name: `from comparisons import kit`, then `kit.Check(...)`."""

from __future__ import annotations

from typing import Any

from comparisons.harness.case import (
    TIERS,
    Case,
    Check,
    Figure,
    Finding,
    Measured,
    PerCode,
    PerPair,
    Results,
    Table,
    Tier,
    Unmeasured,
    Variant,
    largest,
    median,
    relative,
)
from comparisons.harness.check_builders import (
    Compared,
    Found,
    Observe,
    check,
    checks,
    observed_order,
    per_code,
    per_configuration,
    per_pair,
    per_quantity,
    step_by_step,
    table,
)
from comparisons.harness.configurations import Configuration, Configurations, precisions
from comparisons.harness.numbers import number

__all__ = [
    "LONG", "TIERS", "Case", "Check", "Compared", "Configuration", "Configurations", "Figure", "Finding",
    "Found", "Measured", "Observe", "PerCode", "PerPair", "Results", "Rows", "Table", "Tier", "Unmeasured",
    "Variant", "check", "checks", "largest", "median", "number", "observed_order", "per_code",
    "per_configuration", "per_pair", "per_quantity", "precisions", "relative", "step_by_step", "table",
]  # fmt: skip

#: The tiers that take minutes and more.
LONG: tuple[Tier, ...] = ("standard", "full")
#: Rows of a table, each by column.
Rows = list[dict[str, Any]]
