"""What can go wrong with LIGGGHTS. Every message names the thing, where it happened and what to do."""

from __future__ import annotations

from gpudem.errors import GpudemError
from reference.errors import CannotState, CodeMissing, CodeNotStarted, CodeTimeout

INSTALL = "apt-get install liggghts"


class LiggghtsNotFound(CodeMissing):
    """No LIGGGHTS binary, and no recorded output for this deck."""


class LiggghtsCannotState(CannotState):
    """The scene holds something that LIGGGHTS has no words for; names the item of the scene."""


class LiggghtsNotStarted(CodeNotStarted):
    """The binary, or MPI under it, ended before the first command of the deck; names the log."""


class LiggghtsFailed(GpudemError):
    """LIGGGHTS stopped, was killed or produced NaN: its first ERROR line, the deck line and the log."""


class LiggghtsTimeout(CodeTimeout):
    """LIGGGHTS did not end within the time allowed and was ended."""


class LiggghtsOutputError(GpudemError):
    """A dump is missing, truncated or not what was asked for; names file and step."""
