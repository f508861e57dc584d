"""Memory use and version of the running process, for the records of a run."""

from __future__ import annotations

import importlib.metadata
import resource
import sys
from pathlib import Path


def peak_memory() -> int:
    """Largest resident set size of this process so far [bytes].

    On Linux VmHWM of /proc/self/status: getrusage counts the size of the parent before exec as well.
    """
    status = Path("/proc/self/status")
    if status.is_file():
        lines = status.read_text().splitlines()
        return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM:")) * 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def version() -> str:
    """Version of the installed distribution of gpudem; "unknown (not installed)" in a bare checkout."""
    try:
        return importlib.metadata.version("gpudem")
    except importlib.metadata.PackageNotFoundError:
        return "unknown (not installed)"
