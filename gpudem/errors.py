"""Exceptions of the solver. Every message names the thing, where it happened and what to do."""

from __future__ import annotations

from typing import Any


class GpudemError(Exception):
    """Base of every error that gpudem raises on purpose.

    Survives pickling, as process pools need, whatever arguments the `__init__` of a subclass takes.
    """

    def __reduce__(self) -> tuple[Any, ...]:
        return _restore, (type(self), self.args, self.__dict__)


def _restore(kind: type[GpudemError], args: tuple[Any, ...], attributes: dict[str, Any]) -> GpudemError:
    """An exception as it was, without its `__init__`, whose arguments `args` need not be."""
    error = kind.__new__(kind, *args)
    error.args = args
    error.__dict__.update(attributes)
    return error


class SceneError(GpudemError):
    """The statement of a simulation is invalid: lists every problem found.

    Attributes:
        source: File or "<python>" that the statement came from.
        problems: One line each, naming key, value, unit and allowed range.
    """

    def __init__(self, source: str, problems: list[str]):
        self.source, self.problems = source, problems
        head = f"{source}: {len(problems)} problem{'s' if len(problems) > 1 else ''}"
        super().__init__("\n".join([head, *(f"  - {p}" for p in problems)]))


class SimulationError(GpudemError):
    """A run failed: lost particle, NaN, overflowed list. Frames already written stay on disk."""
