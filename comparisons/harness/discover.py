"""Cases found through packages: every module below `comparisons.cases` that exposes `CASE`."""

from __future__ import annotations

import difflib
import importlib
import pkgutil
from types import ModuleType

from comparisons.harness.case import Case, Tier, Variant
from gpudem.errors import GpudemError


def find_cases(package: ModuleType | None = None) -> list[Case]:
    """All cases in order. A file that does not load becomes a case whose run says so: none disappears."""
    if package is None:
        from comparisons import cases as package
    found = pkgutil.walk_packages(package.__path__, f"{package.__name__}.", onerror=_no_error)
    cases = [case for case in (_load(module.name) for module in found) if case is not None]
    return sorted(cases, key=lambda case: (case.order, case.name))


def _no_error(name: str) -> None:
    """A package that does not load: `_load` reports it."""


def select(cases: list[Case], names: tuple[str, ...], tier: Tier) -> list[Case]:
    """The named cases (all if none is named) of a tier. Raises GpudemError for an unknown name."""
    known = {case.name: case for case in cases}
    for name in names:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(known)}"
            raise GpudemError(f"no case {name!r}; {hint}")
    chosen = [known[name] for name in dict.fromkeys(names)] if names else cases
    missing = [case.name for case in chosen if tier not in case.tiers]
    if names and missing:
        raise GpudemError(
            f"case {missing[0]!r} has no {tier} tier; it has: {', '.join(known[missing[0]].tiers)}"
        )
    return [case for case in chosen if tier in case.tiers]


def _load(module: str) -> Case | None:
    """The case of a module, None for one without; one that does not load is a case that says so."""
    name = module.rpartition(".")[2]
    try:
        case = getattr(importlib.import_module(module), "CASE", None)
        if case is None:
            return None
        if not isinstance(case, Case):
            raise TypeError(f"CASE is a {type(case).__name__}, not a Case")
        return case
    except Exception as error:
        message = f"{module} does not load: {type(error).__name__}: {error}"

        def variants(tier: Tier) -> list[Variant]:
            raise GpudemError(message)

        return Case(name, name, "This case could not be loaded.", "", variants, checks=(), order=0)
