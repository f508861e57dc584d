"""Cost of Python code as a count of calls: the same on every machine, however busy."""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable


def calls(function: Callable[..., object], *arguments: object) -> int:
    """Calls that `function(*arguments)` makes: of Python functions, steps of generators, functions in C.

    What NumPy does with a whole array is one call, a loop over its rows at least one call a row. The
    garbage collector waits: what it ends of other tests calls functions too.
    """
    count = 0

    def seen(_frame: object, event: str, _argument: object) -> None:
        nonlocal count
        count += event in ("call", "c_call")

    before, collects = sys.getprofile(), gc.isenabled()
    gc.disable()
    sys.setprofile(seen)
    try:
        function(*arguments)
    finally:
        sys.setprofile(before)
        if collects:
            gc.enable()
    return count
