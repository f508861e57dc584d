"""The threads of the CPU: every slice ends before a launch returns, and no thread is left over."""

import gc
import threading
import time

import pytest

from gpudem.errors import GpudemError, SimulationError
from gpudem.solver import thread_pool
from gpudem.solver.device import find_device
from gpudem.solver.thread_pool import CpuThreadPool


class Slice:
    """In the place of a recorded launch: takes a while, then marks that it is done, or raises."""

    def __init__(self, done: list[int], k: int, seconds: float = 0.0, error: BaseException | None = None):
        self.done, self.k, self.seconds, self.error = done, k, seconds, error

    def launch(self) -> None:
        time.sleep(self.seconds)
        self.done.append(self.k)
        if self.error:
            raise self.error


@pytest.fixture
def pool():
    pool = CpuThreadPool(300, 100, find_device("cpu"), threads=3)
    yield pool
    pool.close()


@pytest.mark.parametrize("error", [KeyboardInterrupt(), RuntimeError("one slice")])
@pytest.mark.parametrize("where", [0, 1, 2])
def test_an_error_in_one_slice_waits_for_the_others(pool, where, error):
    """Catches results of an interrupted launch that are taken for those of the next one: a data race."""
    done: list[int] = []
    slices = [Slice(done, k, 0.05 * (k > 0), error if k == where else None) for k in range(3)]
    with pytest.raises(type(error)):
        pool._run(slices)
    assert sorted(done) == [0, 1, 2]
    again: list[int] = []
    pool._run([Slice(again, k, 0.1 * (k > 0)) for k in range(3)])
    assert sorted(again) == [0, 1, 2]


def test_use_after_close_raises(pool):
    """Catches a wait for threads that have ended."""
    pool.close()
    pool.close()
    with pytest.raises(GpudemError, match="closed"):
        pool._run([Slice([], k) for k in range(3)])


def test_threads_end_with_the_object():
    """Closed, or dropped without it."""
    before = set(threading.enumerate())
    kept = CpuThreadPool(300, 100, find_device("cpu"), threads=3)
    dropped = CpuThreadPool(300, 100, find_device("cpu"), threads=3)
    own = set(threading.enumerate()) - before
    assert len(own) == 4
    kept.close()
    del dropped
    gc.collect()
    for thread in own:
        thread.join(10)
        assert not thread.is_alive()


def test_a_parallel_launch_is_noticed(monkeypatch):
    """A Warp whose launches take particles in another order: catches a half list that would lose forces."""
    thread_pool.require_serial_launches()
    thread_pool.require_serial_launches.cache_clear()
    launch = thread_pool.wp.launch

    def in_another_order(kernel, dim, **options):
        launch(kernel, dim, **options)
        launch(kernel, dim, **options)  # as if the second half had been first

    monkeypatch.setattr(thread_pool.wp, "launch", in_another_order)
    with pytest.raises(SimulationError, match="runs a CPU launch in parallel; a half list needs it serial"):
        thread_pool.require_serial_launches()
    thread_pool.require_serial_launches.cache_clear()
