"""Where LIGGGHTS is, and what it says it is."""

from __future__ import annotations

import functools
import os
import shutil
import subprocess

from reference.liggghts.console import BANNER
from reference.liggghts.errors import INSTALL, LiggghtsNotFound

#: Environment variable that names another binary.
VARIABLE = "GPUDEM_LIGGGHTS"


def find_liggghts() -> str:
    """Path of the binary: $GPUDEM_LIGGGHTS if set, else `liggghts` on the path.

    Raises LiggghtsNotFound with the install command.
    """
    named = os.environ.get(VARIABLE)
    found = shutil.which(named or "liggghts")
    if found is None:
        where = f"{VARIABLE} = {named!r}: no such program" if named else "no program `liggghts` on the path"
        raise LiggghtsNotFound(f"{where}; install it: {INSTALL} (or set {VARIABLE} to its path)")
    return os.path.abspath(found)  # the run starts in another directory


@functools.cache
def version(binary: str) -> str:
    """Name and version from the banner, e.g. `LIGGGHTS-PUBLIC 3.8.0`; empty if it prints none."""
    # -h prints the banner and ends with status 1; without "-log none" it leaves a log file where it stands
    out = subprocess.run(
        [binary, "-log", "none", "-h"],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        errors="replace",
        timeout=60,
    )
    match = BANNER.search(out.stdout)
    return match[1] if match else ""
