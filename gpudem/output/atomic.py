"""Files that are written whole or not at all: every file that gpudem writes is written here.

A file is written under a temporary name (`.NAME.part`) in its own folder and then renamed, so that a reader,
or the next start, sees the old file or the new one. What a killed process leaves has a temporary name and is
removed by `remove_temporary` at the next start.
"""

from __future__ import annotations

import contextlib
import errno
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from gpudem.errors import GpudemError

_PREFIX, _SUFFIX = ".", ".part"
#: Errors of the machine, not of the user's input: exit code 3.
_NO_SPACE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)


class WriteError(GpudemError):
    """A file or folder cannot be written; names it and the reason.

    Attributes:
        exit_code: 3 where the disk is full or broken, else 2 (no permission, not a folder).
    """

    def __init__(self, path: Path, error: OSError):
        super().__init__(f"{path}: cannot be written: {error.strerror or error}")
        self.exit_code = 3 if error.errno in _NO_SPACE else 2


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary path to write to; at the end of the block it becomes `path`, after an error it is removed.

    Raises:
        WriteError: in place of any OSError of the block.
    """
    partial = path.with_name(f"{_PREFIX}{path.name}{_SUFFIX}")
    try:
        partial.unlink(missing_ok=True)  # also a link, through which one would write elsewhere
        yield partial
        partial.replace(path)
    except BaseException as error:
        with contextlib.suppress(OSError):
            partial.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise WriteError(path, error) from error
        raise


def write_bytes(path: Path, data: bytes) -> None:
    """Replace a file. Raises WriteError."""
    with replacing(path) as partial:
        partial.write_bytes(data)


def write_text(path: Path, text: str) -> None:
    """Replace a text file (UTF-8). Raises WriteError."""
    write_bytes(path, text.encode())


def write_npz(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Replace an uncompressed .npz archive. Raises WriteError."""
    with replacing(path) as partial, partial.open("wb") as file:
        np.savez(file, **arrays)  # pyright: ignore[reportArgumentType]


def remove_temporary(folder: Path) -> None:
    """Remove what a killed process left half written in a folder. Raises WriteError."""
    for path in folder.glob(f"{_PREFIX}*{_SUFFIX}"):
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise WriteError(path, error) from error
