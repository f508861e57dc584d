"""Launches over all particles, cut into slices for the cores of the CPU; one launch on a CUDA device.

Warp runs a CPU launch on one core and releases Python's lock meanwhile, so a small crew of threads, each with
its own slice of the particles, uses them all. A sliced kernel writes only what belongs to its own particles.
"""

from __future__ import annotations

import itertools
import queue
import threading
from collections.abc import Callable
from typing import Any

import warp as wp

from gpudem.solver.device import cores


class Crew:
    """Runs recorded launches on up to `threads` cores; the caller's thread takes the first slice."""

    def __init__(self, n: int, block: int, device: Any, threads: int | None = None):
        self.device, self.n = device, n
        self._most = 1 if device.is_cuda else threads or cores()
        self._jobs: list[queue.SimpleQueue] = []
        self._done: queue.SimpleQueue = queue.SimpleQueue()
        self.cut(block)

    def cut(self, block: int) -> None:
        """Slices of whole blocks of so many particles, for commands from now on."""
        blocks = -(-self.n // block)
        count = max(1, min(self._most, blocks))
        edges = [min(self.n, block * (blocks * k // count)) for k in range(count + 1)]
        self.slices = list(itertools.pairwise(edges))
        while len(self._jobs) < count - 1:
            self._jobs.append(queue.SimpleQueue())
            threading.Thread(target=self._work, args=(self._jobs[-1], self._done), daemon=True).start()

    @property
    def threads(self) -> int:
        """Cores in use."""
        return len(self.slices)

    @staticmethod
    def _work(jobs: queue.SimpleQueue, done: queue.SimpleQueue) -> None:
        while (launch := jobs.get()) is not None:
            try:
                launch.launch()
                done.put(None)
            except BaseException as error:
                done.put(error)

    def command(self, kernel: Any, params: Any, inputs: list[Any], outputs: list[Any]) -> Callable[[], None]:
        """A call that runs `kernel(params, begin, *inputs, *outputs)` over all particles."""
        launches = [
            wp.launch(
                kernel,
                end - begin,
                inputs=[params, begin, *inputs],
                outputs=outputs,
                device=self.device,
                record_cmd=True,
            )
            for begin, end in self.slices
        ]
        if len(launches) == 1:
            return launches[0].launch
        return lambda: self._run(launches)

    def _run(self, launches: list[Any]) -> None:
        for jobs, launch in zip(self._jobs, launches[1:], strict=False):  # fewer slices since the last cut
            jobs.put(launch)
        launches[0].launch()
        errors = [self._done.get() for _ in launches[1:]]
        for error in errors:
            if error is not None:
                raise error

    def close(self) -> None:
        """End the threads."""
        for jobs in self._jobs:
            jobs.put(None)
        self._jobs = []
