"""The folder in which Warp keeps compiled kernels, and the error where it cannot be written."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

from gpudem.errors import SimulationError


class KernelCacheError(SimulationError):
    """Warp cannot keep compiled kernels: its folder cannot be made or written, or the disk is full."""

    exit_code = 3


@contextlib.contextmanager
def kernel_cache() -> Iterator[None]:
    """Start Warp and compile in this block.

    Raises:
        KernelCacheError: in place of any OSError; names the folder and WARP_CACHE_PATH.
    """
    try:
        yield
    except OSError as error:
        import warp

        folder = warp.config.kernel_cache_dir or error.filename
        raise KernelCacheError(
            f"{folder}: Warp cannot keep compiled kernels there: {error.strerror or error}; set the"
            " environment variable WARP_CACHE_PATH to a folder that can be written"
        ) from error
