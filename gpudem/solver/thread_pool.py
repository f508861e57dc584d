# pyright: reportIndexIssue=false, reportOperatorIssue=false
"""Launches over all particles, cut into slices for the cores of the CPU; one launch on a CUDA device.

Warp runs a CPU launch on one core and releases Python's lock meanwhile, so a few threads, each with its own
slice of the particles, use all cores. A sliced kernel writes only what belongs to its own particles.
"""

import functools
import itertools
import queue
import threading
import weakref
from collections.abc import Callable
from typing import Any

import warp as wp

from gpudem.errors import GpudemError, SimulationError
from gpudem.solver.device import compile_kernels, cores, find_device


class CpuThreadPool:
    """Runs recorded launches on up to `threads` cores; the caller's thread takes the first slice.

    The threads end with `close`, or when the object is garbage. Raises GpudemError: used after `close`.
    """

    def __init__(self, n: int, block: int, device: Any, threads: int | None = None):
        self.device, self.n = device, n
        self._max_threads = 1 if device.is_cuda else threads or cores()
        self._jobs: list[queue.SimpleQueue] = []
        self._wake: queue.SimpleQueue = queue.SimpleQueue()
        self._closed = False
        self._finalizer = weakref.finalize(self, _end, self._jobs)
        self.partition(block)

    def partition(self, block: int, n: int | None = None) -> None:
        """Slices of whole blocks of so many particles, for launches recorded from now on; `n`: of so many."""
        self.n = self.n if n is None else n
        blocks = -(-self.n // block)
        count = max(1, min(self._max_threads, blocks))
        edges = [min(self.n, block * (blocks * k // count)) for k in range(count + 1)]
        self.slices = list(itertools.pairwise(edges))
        while len(self._jobs) < count - 1:
            self._jobs.append(queue.SimpleQueue())
            threading.Thread(target=_work, args=(self._jobs[-1], self._wake), daemon=True).start()

    @property
    def threads(self) -> int:
        """Cores in use."""
        return len(self.slices)

    def record_launch(
        self, kernel: Any, params: Any, inputs: list[Any], outputs: list[Any], lanes: int = 1
    ) -> Callable[[], None]:
        """A call that runs `kernel(params, begin, *inputs, *outputs)` for all particles, in lanes."""
        if self.n == 0:
            return lambda: None
        # mutate: slice_launch
        launches = [
            wp.launch(
                kernel,
                lanes * (end - begin),
                inputs=[params, begin, *inputs],
                outputs=outputs,
                device=self.device,
                block_dim=kernel.module.options["block_dim"],
                record_cmd=True,
            )
            for begin, end in self.slices
        ]
        if len(launches) == 1:
            return launches[0].launch  # pyright: ignore[reportOptionalMemberAccess]
        return functools.partial(self._run, launches)

    def _run(self, launches: list[Any]) -> None:
        """All slices; returns, or raises the first error, only when every one of them has ended."""
        if self._closed:
            raise GpudemError("the simulation is closed")
        results: list[
            BaseException | None
        ] = []  # of this launch: what is left in `_wake` cannot be taken for it
        sent, error = 0, None
        try:
            for jobs, launch in zip(self._jobs, launches[1:], strict=False):  # there may be more threads
                jobs.put((launch, results))
                sent += 1
            launches[0].launch()
        except BaseException as own:  # Ctrl-C too: the other slices still run
            error = own
        while len(results) < sent:
            try:
                self._wake.get()
            except BaseException as own:
                error = error or own
        error = error or next((e for e in results if e is not None), None)
        if error is not None:
            raise error

    def close(self) -> None:
        """End the threads; a second call does nothing."""
        self._closed = True
        self._finalizer()


def _work(jobs: queue.SimpleQueue, wake: queue.SimpleQueue) -> None:
    while (job := jobs.get()) is not None:
        launch, results = job
        try:
            launch.launch()
            results.append(None)
        except BaseException as error:
            results.append(error)
        wake.put(None)


def _end(jobs: list[queue.SimpleQueue]) -> None:
    for queue_of_thread in jobs:
        queue_of_thread.put(None)
    jobs.clear()


@wp.kernel(enable_backward=False)
def take_turns(
    # in and out
    turn: wp.array[wp.int32],
    # out
    out_of_turn: wp.array[wp.int32],
):
    """Each thread expects to be the next one."""
    i = wp.tid()
    if turn[0] != i:
        out_of_turn[0] = 1
    turn[0] = i + 1


@functools.cache
def require_serial_launches() -> None:
    """A half list needs CPU launches that take their particles one after the other: Warp 1.19 does so.

    Raises SimulationError where this Warp does not.
    """
    compile_kernels(find_device("cpu"), [take_turns])
    turn, out_of_turn = (wp.zeros(1, dtype=wp.int32, device="cpu") for _ in range(2))
    wp.launch(take_turns, 100_000, inputs=[turn], outputs=[out_of_turn], device="cpu")
    if out_of_turn.numpy()[0]:
        raise SimulationError(
            f"Warp {wp.config.version} runs a CPU launch in parallel; a half list needs it serial:"
            " use half_list=False, and warp-lang 1.19"
        )
