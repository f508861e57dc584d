"""What other installed packages add: objects behind the entry points of a group."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Callable
from typing import Any

from gpudem.errors import GpudemError


def load_entry_points(group: str, register: Callable[[Any], None]) -> None:
    """Register the object of each entry point of a group.

    Raises GpudemError: an entry does not load or is not what the group holds; names the entry and its value.
    """
    for entry in importlib.metadata.entry_points(group=group):
        try:
            register(entry.load())
        except GpudemError:
            raise
        except Exception as error:
            what = f"{type(error).__name__}: {error}"
            raise GpudemError(f"entry point {entry.name!r} of {group} ({entry.value}): {what}") from error
