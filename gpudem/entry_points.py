"""What other installed packages add: objects behind the entry points of a group."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Callable
from typing import Any

from gpudem.errors import GpudemError


def load_entry_points(group: str, register: Callable[[Any], None]) -> None:
    """Register the object of each entry point of a group. Raises GpudemError: an entry does not load."""
    for entry in importlib.metadata.entry_points(group=group):
        try:
            register(entry.load())
        except (ImportError, AttributeError) as error:
            raise GpudemError(f"entry point {entry.name!r} of {group} ({entry.value}): {error}") from error
