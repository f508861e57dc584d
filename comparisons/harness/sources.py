"""The source code that a check is made of, as a hash: has it changed since a result was recorded?"""

from __future__ import annotations

import ast
import functools
import hashlib
import importlib.util
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from comparisons.harness.case import TIERS, Case

#: What a check is made of lies here, or in the package of its case where that is another one.
PACKAGES = (
    "comparisons.cases", "comparisons.metrics", "comparisons.oracles", "comparisons.harness.check_builders",
    "comparisons.harness.configurations",
)  # fmt: skip


def hashes(case: Case) -> dict[str, str]:
    """SHA-256 (16 digits) by check, over all tiers, of the modules that define its scenes and its measure.

    With all that these import of the case's package, of metrics and of reference solutions. The solver is not
    part of it: its version stands with the runs.
    """
    scenes = _module(case.variants)
    found = {}
    for check in [check for tier in TIERS for check in case.checks_of(tier)]:
        found[check.name] = _hash((scenes, _module(check.measure)))
    return found


@functools.cache
def _hash(start: tuple[str, ...]) -> str:
    own = {name.partition(".")[0] for name in start} - {"comparisons"}
    waiting, reached = list(start), {}
    while waiting:
        name = waiting.pop()
        source = None if name in reached else _source(name)
        if source is not None:
            reached[name] = source
            waiting += [found for found in _imports(name) if found.startswith((*PACKAGES, *own))]
    digest = hashlib.sha256()
    for name in sorted(reached):
        digest.update(f"{name}\n{reached[name]}\n".encode())
    return digest.hexdigest()[:16]


def _module(function: Callable[..., Any]) -> str:
    while isinstance(function, functools.partial):
        function = function.func
    return getattr(function, "__module__", None) or ""


@functools.cache
def _file(name: str) -> Path | None:
    """The file of a module; None for what is none, such as a function of one."""
    try:
        spec = importlib.util.find_spec(name)
    except (ImportError, AttributeError, ValueError):
        return None
    return Path(spec.origin) if spec is not None and spec.origin and spec.has_location else None


def _source(name: str) -> str | None:
    path = _file(name)
    return path.read_text(encoding="utf-8") if path is not None and path.suffix == ".py" else None


@functools.cache
def _imports(name: str) -> Iterable[str]:
    """Every name that a module imports, also within functions: modules, and names that may be one."""
    return tuple(_imported(name, ast.parse(_source(name) or "")))


def _imported(name: str, tree: ast.AST) -> Iterator[str]:
    path = _file(name)
    package = name if path is not None and path.name == "__init__.py" else name.rpartition(".")[0]
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                base = importlib.util.resolve_name("." * node.level + base, package)
            yield base
            yield from (f"{base}.{alias.name}" for alias in node.names)
