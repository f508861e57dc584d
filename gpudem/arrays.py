"""Direct access to arrays in the hot loop: Warp's own indexing allows for negative indices and strides.

That costs five instructions an access; without them a step takes 3 % less time on a CPU. Index and array are
the caller's responsibility: whole arrays (never a slice with a stride), 0 <= i < length.
"""

import functools
from typing import Any

from gpudem.device import wp


@functools.cache
def access(kind: Any) -> tuple[Any, Any, Any]:
    """Functions get(a, i), put(a, i, value), subtract(a, i, value) of an array of this type."""

    @wp.func_native("return a.data[i];")
    def get(a: wp.array[kind], i: wp.int32) -> kind: ...

    @wp.func_native("a.data[i] = value;")
    def put(a: wp.array[kind], i: wp.int32, value: kind): ...

    @wp.func_native("a.data[i] = a.data[i] - value;")
    def subtract(a: wp.array[kind], i: wp.int32, value: kind): ...

    return get, put, subtract
