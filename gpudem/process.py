"""What a run says of the process that it ran in."""

from __future__ import annotations

import resource
import sys
from pathlib import Path

from gpudem._version import __version__


def peak_memory() -> int:
    """Largest resident size of this process so far [bytes].

    On Linux from the kernel's own mark: getrusage starts a new program with the size of its parent.
    """
    status = Path("/proc/self/status")
    if status.is_file():
        lines = status.read_text().splitlines()
        return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM:")) * 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def version() -> str:
    """Gpudem's."""
    return __version__
