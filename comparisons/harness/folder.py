"""The folder of a comparison, which may come from anybody: only files in it are read, up to a size."""

from __future__ import annotations

import os
from pathlib import Path, PurePosixPath
from urllib.parse import quote

from gpudem.errors import GpudemError

MIB = 2**20
#: Largest file of each kind [bytes]; those of `make verify` are a tenth or less.
FIGURE, TABLE, DECK, RESULTS = 16 * MIB, 4 * MIB, MIB, 64 * MIB
#: All that one page embeds [bytes]: a list of results could name one large file a thousand times.
PAGE = 512 * MIB


class Refused(GpudemError):
    """A file is not read: it lies outside the folder, is no regular file, is missing or too large."""


class Folder:
    """A folder whose files are read by the relative names that its results state."""

    def __init__(self, root: Path):
        self.root = Path(os.path.realpath(root))
        self._left = PAGE

    def path(self, name: str) -> Path:
        """Where a named file or folder is. Raises Refused: absolute, with `..`, or a link that leads out."""
        parts = PurePosixPath(name).parts
        if not parts or "\0" in name or PurePosixPath(name).is_absolute() or ".." in parts:
            raise Refused(f"{name!r}: not a path inside the folder of the comparison; not read")
        path = Path(os.path.realpath(self.root / name))
        if not path.is_relative_to(self.root):
            raise Refused(f"{name!r}: a link out of the folder of the comparison; not read")
        return path

    def read(self, name: str, limit: int) -> bytes:
        """The bytes of a file. Raises Refused: see `path`; not a file; more bytes than the limit."""
        path = self.path(name)
        try:
            if not path.is_file():  # a pipe would be waited for
                raise Refused(f"{name} is missing" if not path.exists() else f"{name}: not a file; not read")
            size = path.stat().st_size
            if size > min(limit, self._left):
                most = "a page holds no more" if size <= limit else f"at most {limit / MIB:g} MiB are read"
                raise Refused(f"{name}: {size / MIB:.1f} MiB; {most}")
            self._left -= size
            return path.read_bytes()
        except OSError as error:
            raise Refused(f"{name!r}: cannot be read: {error.strerror}") from None

    def listed(self, name: str, patterns: tuple[str, ...]) -> list[str]:
        """Names, relative to the folder, of the files in a folder of it. Raises Refused: see `path`."""
        directory, found = self.path(name), {}
        for pattern in patterns:
            for path in sorted(directory.glob(pattern)):
                relative = f"{name}/{path.name}"
                if path.is_file() and Path(os.path.realpath(path)).is_relative_to(self.root):
                    found[relative] = None
        return list(found)


def link(name: str) -> str:
    """A relative name as a link: whatever it holds, it leads into the folder of the page."""
    return quote(f"./{name}")
