"""Launches over all particles, cut into slices for the cores of the CPU; one launch on a CUDA device.

Warp runs a CPU launch on one core and releases Python's lock meanwhile, so a small crew of threads, each with
its own slice of the particles, uses them all. A sliced kernel writes only what belongs to its own particles.
"""

from __future__ import annotations

import itertools
import os
import queue
import threading
from collections.abc import Callable
from typing import Any

import warp as wp


class Crew:
    """Runs recorded launches on `threads` cores, in whole blocks; the caller's thread takes the first."""

    def __init__(self, n: int, block: int, device: Any, threads: int | None = None):
        self.device, self.n = device, n
        wanted = threads or len(os.sched_getaffinity(0))
        blocks = -(-n // block)
        self.threads = 1 if device.is_cuda else max(1, min(wanted, blocks))
        edges = [min(n, block * (blocks * k // self.threads)) for k in range(self.threads + 1)]
        self.slices = list(itertools.pairwise(edges))
        self._jobs = [queue.SimpleQueue() for _ in range(self.threads - 1)]
        self._done: queue.SimpleQueue = queue.SimpleQueue()
        for jobs in self._jobs:
            threading.Thread(target=self._work, args=(jobs, self._done), daemon=True).start()

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
        for jobs, launch in zip(self._jobs, launches[1:], strict=True):
            jobs.put(launch)
        launches[0].launch()
        errors = [self._done.get() for _ in self._jobs]
        for error in errors:
            if error is not None:
                raise error

    def close(self) -> None:
        """End the threads."""
        for jobs in self._jobs:
            jobs.put(None)
        self._jobs = []
