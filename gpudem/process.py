"""Memory use and version of the running process, for the records of a run."""

from __future__ import annotations

import resource
import sys
from pathlib import Path

from gpudem._version import __version__


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
    """Gpudem's."""
    return __version__
