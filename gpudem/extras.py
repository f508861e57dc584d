"""Packages that only an extra of gpudem brings: one clear line where one is missing."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

from gpudem.errors import GpudemError

#: Top-level module -> the extra of pyproject.toml with its package.
EXTRAS = {
    "click": "compare",
    "jinja2": "compare",
    "matplotlib": "compare",
    "PIL": "compare",
    "psutil": "compare",
    "pyvista": "compare",
    "vtkmodules": "compare",
    "rich": "compare",
    "imageio_ffmpeg": "video",
}


class MissingExtraError(GpudemError, ImportError):
    """A package is not installed; names the extra that brings it."""

    exit_code = 3


@contextlib.contextmanager
def from_extra() -> Iterator[None]:
    """Import packages of an extra in its block. Raises MissingExtraError with the command that installs them.

    Other packages that are missing raise ModuleNotFoundError, as ever.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        module = (error.name or "").split(".")[0]
        if module not in EXTRAS:
            raise
        raise MissingExtraError(
            f"{module} is not installed: pip install 'gpudem[{EXTRAS[module]}]'"
        ) from None
