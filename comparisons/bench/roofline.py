# pyright: reportIndexIssue=false
"""The memory bandwidth of a device, measured: the ceiling of a step that moves so many bytes."""

from __future__ import annotations

import statistics
import time

import numpy as np
import warp as wp

from gpudem.solver.device import compile_kernels, find_device
from gpudem.solver.thread_pool import CpuThreadPool

#: Doubles of each of the two arrays: 512 MiB together, far more than any cache holds.
LENGTH = 1 << 25


@wp.kernel(enable_backward=False)
def _copy(
    # params
    scale: wp.float64,
    begin: wp.int32,
    # in
    source: wp.array[wp.float64],
    # out
    target: wp.array[wp.float64],
):
    i = begin + wp.tid()
    target[i] = scale * source[i]


def bandwidth(device: str, cores: int, repeats: int = 5) -> float:
    """Bytes read and written each second by `target = scale source` on so many cores; median of the repeats.

    What a processor reads before it overwrites a line is not counted (as in STREAM, McCalpin 1995).
    """
    where = find_device(device)
    compile_kernels(where, [_copy])
    source, target = (wp.array(np.ones(LENGTH), device=where) for _ in range(2))
    pool = CpuThreadPool(LENGTH, LENGTH // 64, where, cores)
    launch = pool.record_launch(_copy, wp.float64(0.5), [source], [target])
    rates = []
    for _ in range(repeats + 1):
        begin = time.perf_counter()
        launch()
        wp.synchronize_device(where)
        rates.append(16 * LENGTH / (time.perf_counter() - begin))
    pool.close()
    return statistics.median(rates[1:])
