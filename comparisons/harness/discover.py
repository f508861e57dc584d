"""Cases: those below `comparisons.cases`, those of other installed packages, those of a package named."""

from __future__ import annotations

import difflib
import importlib
import pkgutil
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from types import ModuleType

from comparisons.harness import codes
from comparisons.harness.case import Case, Tier, Variant
from gpudem.entry_points import load_entry_points
from gpudem.errors import GpudemError
from reference.code import Code

#: Other packages add their cases here: the value is a package, a module or a `Case`.
ENTRY_POINTS = "gpudem.cases"
#: The project's own.
OWN = "comparisons.cases"


def known_cases(packages: Sequence[str] = ()) -> list[Case]:
    """All cases in order: the project's own, those of entry points, those of the named packages.

    Raises GpudemError: an entry point or a package does not load; two cases have one name.
    """
    found = find_cases()
    load_entry_points(ENTRY_POINTS, lambda added: found.extend(_cases_of(added)))
    for package in packages:
        found += find_cases(load_package(package))
    return _in_order(found)


def cases_to_run(names: Sequence[str], tier: Tier, packages: Sequence[str] = ()) -> list[Case]:
    """The named cases; if none is named, those of the packages; if none is given either, all that are known.

    Raises GpudemError: see `known_cases` and `select`.
    """
    known = known_cases(packages)
    if packages and not names:
        names = [case.name for package in packages for case in find_cases(load_package(package))]
        if not names:
            raise GpudemError(f"no case in {', '.join(packages)}: no module there exposes CASE")
        return [case for case in known if case.name in names and tier in case.tiers]
    return select(known, names, tier)


def load_package(name: str) -> ModuleType:
    """An importable package or module; the current folder is on the path. Raises GpudemError."""
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.insert(0, here)
    try:
        return importlib.import_module(name)
    except Exception as error:
        raise GpudemError(f"cases {name!r}: does not load: {type(error).__name__}: {error}") from error


def find_cases(package: ModuleType | None = None) -> list[Case]:
    """The cases of a module, or of every module of a package (default: the project's own) and below it.

    A module takes part by `CASE`, and by `CODE`, a code that is then known by its name. One that does not
    load becomes a case whose run says so: none disappears.
    """
    package = importlib.import_module(OWN) if package is None else package
    names = [package.__name__]
    if hasattr(package, "__path__"):
        walk = pkgutil.walk_packages(package.__path__, f"{package.__name__}.", onerror=lambda name: None)
        names += [module.name for module in walk]
    return _in_order(case for case in map(_load, names) if case is not None)


def select(cases: list[Case], names: Sequence[str], tier: Tier) -> list[Case]:
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


def _cases_of(added: object) -> list[Case]:
    """What an entry point names. Raises GpudemError if it is none of package, module and Case."""
    if isinstance(added, ModuleType):
        return find_cases(added)
    if isinstance(added, Case):
        return [added]
    raise GpudemError(f"{ENTRY_POINTS}: {added!r} is neither a package, a module nor a Case")


def _in_order(found: Iterable[Case]) -> list[Case]:
    """Each case once, by `order` and name. Raises GpudemError: two cases have one name."""
    named: dict[str, Case] = {}
    for case in found:
        if named.setdefault(case.name, case) is not case:
            raise GpudemError(f"two cases are called {case.name!r}; names must differ")
    return sorted(named.values(), key=lambda case: (case.order, case.name))


#: What could not be loaded, by module, so that it is found as one case however often it is looked for.
_BROKEN: dict[str, Case] = {}


def _load(module: str) -> Case | None:
    """The case of a module, None for one without; one that does not load is a case that says so."""
    try:
        loaded = importlib.import_module(module)
        if isinstance(code := getattr(loaded, "CODE", None), Code):
            codes.register(code)
        case = getattr(loaded, "CASE", None)
        if case is not None and not isinstance(case, Case):
            raise TypeError(f"CASE is a {type(case).__name__}, not a Case")
        return case
    except Exception as error:
        message = f"{module} does not load: {type(error).__name__}: {error}"

        def variants(tier: Tier) -> list[Variant]:
            raise GpudemError(message)

        name = module.rpartition(".")[2]
        broken = Case(name, name, "This case could not be loaded.", "", variants, checks=(), order=0)
        return _BROKEN.setdefault(module, broken)
