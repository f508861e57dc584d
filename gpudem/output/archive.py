"""The one reader of .npz archives: every file that is not a sound archive gives one kind of error."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import BinaryIO

import numpy as np

from gpudem.errors import GpudemError

_NPY = b"\x93NUMPY"
#: More than this [bytes], from a file a hundred times smaller, is refused before it fills the memory.
_LARGE, _RATIO = 2**30, 100


class ArchiveError(GpudemError):
    """An .npz archive is missing, unreadable, truncated, corrupted or mislabelled; names the file."""


def read_npz(path: Path) -> dict[str, np.ndarray]:
    """Name -> array of an .npz archive, compressed or not, all of it in memory; nothing is unpickled.

    Raises:
        ArchiveError: no such file, not readable, not an archive of arrays (also a .npy file under this name),
            truncated or corrupted, two arrays of one name, arrays of Python objects, more than fits in
            memory, or a small file that unpacks to more than 1 GiB.
    """
    try:
        with path.open("rb") as file:  # np.load leaves a file open that it cannot read
            start = file.read(len(_NPY))
            if start == _NPY:
                raise ArchiveError(f"{path}: one array (.npy), not an .npz archive of named arrays")
            if not zipfile.is_zipfile(file):
                raise ArchiveError(f"{path}: not an .npz archive, or truncated")
            file.seek(0)
            _require_plausible(path, file)
            with np.load(file, allow_pickle=False) as archive:
                twice = [name for name in archive.files if archive.files.count(name) > 1]
                if twice:
                    raise ArchiveError(f"{path}: array {twice[0]!r} given twice")
                arrays = {name: archive[name] for name in archive.files}
    except ArchiveError:
        raise
    except FileNotFoundError:
        raise ArchiveError(f"{path}: no such file") from None
    except (IsADirectoryError, PermissionError) as error:
        raise ArchiveError(f"{path}: cannot be read: {error.strerror}") from None
    except MemoryError:
        raise ArchiveError(f"{path}: its arrays do not fit in memory, or the file is corrupted") from None
    except Exception as error:  # zipfile, zlib, lzma, struct and NumPy's header parser: a dozen kinds
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise ArchiveError(f"{path}: truncated or corrupted .npz archive ({reason})") from error
    for name, array in arrays.items():
        if not isinstance(array, np.ndarray):  # a member that is no .npy file comes as bytes
            raise ArchiveError(f"{path}: member {name!r} is not an array")
    return arrays


def _require_plausible(path: Path, file: BinaryIO) -> None:
    """Raises ArchiveError: unpacked, the archive is far larger than arrays of a simulation become."""
    with zipfile.ZipFile(file) as archive:
        unpacked = sum(member.file_size for member in archive.infolist())
    packed = path.stat().st_size
    if unpacked > max(_LARGE, _RATIO * packed):
        raise ArchiveError(
            f"{path}: {packed / 2**20:.1f} MiB that unpack to {unpacked / 2**30:.1f} GiB; not read"
        )
    file.seek(0)
