# pyright: reportInvalidTypeForm=false
"""Direct access to arrays in the hot loops: Warp's own indexing allows for negative indices and strides.

That costs five instructions an access; without them a step takes 3 % less time on a CPU. Index and array are
the caller's responsibility: whole arrays (never a slice with a stride), 0 <= i < length.
"""

import functools
from typing import Any, NamedTuple

from gpudem.solver.device import wp


class Access(NamedTuple):
    """Functions for one type of array."""

    get: Any
    """get(a, i) -> value"""
    get_if: Any
    """get_if(a, i, condition) -> value, or zero where the condition does not hold"""
    put: Any
    """put(a, i, value)"""
    subtract: Any
    """subtract(a, i, value)"""


@functools.cache
def access(kind: Any) -> Access:
    """The functions for arrays of this type."""

    @wp.func_native("return a.data[i];")
    def get(a: wp.array[kind], i: wp.int32) -> kind: ...

    @wp.func_native("if (condition) return a.data[i]; return {};")
    def get_if(a: wp.array[kind], i: wp.int32, condition: bool) -> kind: ...

    @wp.func_native("a.data[i] = value;")
    def put(a: wp.array[kind], i: wp.int32, value: kind): ...

    @wp.func_native("a.data[i] = a.data[i] - value;")
    def subtract(a: wp.array[kind], i: wp.int32, value: kind): ...

    return Access(get, get_if, put, subtract)
