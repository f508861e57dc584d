"""What can go wrong with a code behind the harness, in the kinds that the harness tells apart."""

from __future__ import annotations

from gpudem.errors import GpudemError


class CodeMissing(GpudemError):
    """The code is not on this machine; says how to get it. What needs it is left out."""


class CannotState(GpudemError):
    """The scene holds something that the code cannot be given; names it."""


class CodeTimeout(GpudemError):
    """The code did not end within the time allowed and was stopped."""


class CodeNotStarted(GpudemError):
    """The code could not be started on this machine: nothing is known of the scene, so it is never a result,
    also where a variant may end in an error.
    """
