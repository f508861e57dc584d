"""Exceptions of the solver. Every message names the thing, where it happened and what to do."""

from __future__ import annotations


class GpudemError(Exception):
    """Base of every error that gpudem raises on purpose."""


class SceneError(GpudemError):
    """The statement of a simulation is wrong: lists every problem found.

    Attributes:
        source: File or "<python>" that the statement came from.
        problems: One line each, naming key, value, unit and allowed range.
    """

    def __init__(self, source: str, problems: list[str]):
        self.source, self.problems = source, problems
        head = f"{source}: {len(problems)} problem{'s' if len(problems) > 1 else ''}"
        super().__init__("\n".join([head, *(f"  - {p}" for p in problems)]))


class SimulationError(GpudemError):
    """A run went wrong: lost particle, NaN, overflowed list. Frames already written stay on disk."""
