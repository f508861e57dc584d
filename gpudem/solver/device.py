"""Warp's devices, and the compilation of kernels, without a change to Warp's global settings.

No kernel of gpudem has an adjoint; each says so itself (`enable_backward=False`).
"""

import contextlib
import os
import threading
import zlib
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import warp as wp

from gpudem.errors import SimulationError

_log_level_lock = threading.Lock()
#: Files that modules share while they are compiled: two meet seldom, and then wait for one another.
LOCKS = 64


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Keep Warp's messages below an error off the output of gpudem; those of LOG_DEBUG stay.

    The level belongs to the process: it is restored at the end, and one thread at a time changes it.
    """
    with _log_level_lock:
        level = wp.config.log_level
        with wp.ScopedLogLevel(level if level <= wp.LOG_DEBUG else max(level, wp.LOG_ERROR)):
            yield


def find_device(name: str) -> Any:
    """A Warp device by name ("cpu", "cuda:0"). Raises SimulationError naming those found."""
    with quiet():
        wp.init()
    try:
        return wp.get_device(name)
    except (ValueError, RuntimeError) as error:
        known = ", ".join(str(d) for d in wp.get_devices())
        raise SimulationError(f"device = {name!r}: not here; found: {known}") from error


def compile_kernels(device: Any, kernels: Iterable[Any]) -> None:
    """Compile the modules of kernels for a device, or load them from Warp's cache, several at a time."""
    modules = list(dict.fromkeys(kernel.module for kernel in kernels))

    def load(module: Any) -> None:
        with _one_process(module.name):
            wp.force_load(device, [module])  # with the threads a block that it states

    with quiet(), ThreadPoolExecutor(cores()) as pool:
        list(pool.map(load, modules))


@contextlib.contextmanager
def _one_process(name: str) -> Iterator[None]:
    """A module that another process compiles is waited for, and then loaded.

    A file in Warp's cache is locked, no longer than the process lasts; modules share `LOCKS` of them. Where
    files cannot be locked, both compile.
    """
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(ImportError, OSError):  # not on Windows; a cache that cannot be written
            import fcntl

            file = stack.enter_context(lock_of(name).open("ab"))
            fcntl.flock(file, fcntl.LOCK_EX)
        yield


def lock_of(name: str) -> Path:
    """The file that is locked while a module is compiled."""
    return Path(wp.config.kernel_cache_dir or "") / f"gpudem_{zlib.crc32(name.encode()) % LOCKS}.lock"


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
