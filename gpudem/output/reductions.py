# pyright: reportInvalidTypeForm=false, reportIndexIssue=false, reportArgumentType=false, reportCallIssue=false
"""Sums and extremes over particles on a device, in float64 and in a fixed order.

Thread t of THREADS takes rows t, t + THREADS, ... one after the other; the host adds up what they leave. The
order depends on the number of rows only: a repeated run gives the same bits on the same kind of device.
"""

import functools
from typing import Any

import numpy as np
import warp as wp

from gpudem.solver.device import quiet

#: Partial results that are downloaded: 100 kB, and enough threads for any device.
THREADS = 4096
_SUM, _SQUARES, _MAX, _NORM = 0, 1, 2, 3


@functools.cache
def _kernel(precision: str) -> Any:
    """The kernel for vectors of float64 or float32."""
    vec3 = {"float64": wp.vec3d, "float32": wp.vec3f}[precision]

    @wp.kernel(module="unique", enable_backward=False)
    def reduce(
        # params
        mode: wp.int32,
        sign: wp.float64,
        threads: wp.int32,
        # in
        values: wp.array[vec3],
        weights: wp.array[wp.float64],
        # out
        partial: wp.array[wp.vec3d],
    ):
        t = wp.tid()
        x, y, z = wp.float64(0.0), wp.float64(0.0), wp.float64(0.0)
        row = t
        while row < values.shape[0]:
            a = wp.vec3d(wp.float64(values[row][0]), wp.float64(values[row][1]), wp.float64(values[row][2]))
            if mode == 0:
                x += weights[row] * a[0]
                y += weights[row] * a[1]
                z += weights[row] * a[2]
            elif mode == 1:
                x += weights[row] * wp.dot(a, a)
            elif mode == 2:
                first = row == t
                x = wp.where(first, sign * a[0], wp.max(x, sign * a[0]))
                y = wp.where(first, sign * a[1], wp.max(y, sign * a[1]))
                z = wp.where(first, sign * a[2], wp.max(z, sign * a[2]))
            else:
                x = wp.max(x, wp.dot(a, a))
            row += threads
        partial[t] = wp.vec3d(x, y, z)

    return reduce


def _reduced(mode: int, values: Any, weights: Any = None, sign: float = 1.0) -> np.ndarray:
    """Partial results of the threads, shape (threads, 3)."""
    threads = min(THREADS, len(values))
    precision = values.dtype._wp_scalar_type_.__name__
    partial = wp.empty(threads, dtype=wp.vec3d, device=values.device)
    with quiet():  # the first launch compiles
        wp.launch(
            _kernel(precision),
            threads,
            inputs=[mode, sign, threads, values, weights],
            outputs=[partial],
            device=values.device,
        )
    return partial.numpy()


def weighted_sum(values: Any, weights: Any, squared: bool = False) -> Any:
    """Sum of w_i a_i, shape (3,), or, `squared`, of w_i a_i . a_i; Warp arrays of vectors and of float64."""
    parts = _reduced(_SQUARES if squared else _SUM, values, weights).sum(axis=0)
    return float(parts[0]) if squared else parts


def extreme(values: Any, sign: int) -> np.ndarray:
    """Largest (`sign` 1) or smallest (-1) value of each component."""
    return sign * _reduced(_MAX, values, sign=float(sign)).max(axis=0)


def largest(values: Any) -> float:
    """Largest magnitude."""
    return float(np.sqrt(_reduced(_NORM, values)[:, 0].max()))
