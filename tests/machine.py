"""The lock by which workers of one run of the tests share the machine."""

from __future__ import annotations

import contextlib
import fcntl
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def machine(path: Path | None, exclusive: bool) -> Iterator[None]:
    """Share the machine with the other workers of a run, or have it without them; a file is their lock.

    Of its two bytes the first is held while one waits for the second: so a worker that waits for the others
    to end their tests is not overtaken by their next ones.
    """
    if path is None:
        yield
        return
    path.parent.mkdir(exist_ok=True)
    with path.open("a+b") as file:
        fcntl.lockf(file, fcntl.LOCK_EX, 1, 0)
        fcntl.lockf(file, fcntl.LOCK_EX if exclusive else fcntl.LOCK_SH, 1, 1)
        fcntl.lockf(file, fcntl.LOCK_UN, 1, 0)
        yield
