"""Warp, configured once before its first use, and the devices it finds."""

import os
from typing import Any

import warp as wp

from gpudem.errors import SimulationError

wp.config.enable_backward = False  # no gradients: half the code to compile
wp.config.log_level = wp.LOG_ERROR


def find_device(name: str) -> Any:
    """A Warp device by name ("cpu", "cuda:0"). Raises SimulationError naming those found."""
    wp.init()
    try:
        return wp.get_device(name)
    except (ValueError, RuntimeError) as error:
        known = ", ".join(str(d) for d in wp.get_devices())
        raise SimulationError(f"device = {name!r}: not here; found: {known}") from error


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
