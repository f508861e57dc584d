"""The public address of `Run`: `from gpudem.run import Run`."""

from gpudem.output.run import HISTORY_COLUMNS, TRACE_COLUMNS, Run, Timing

__all__ = ["HISTORY_COLUMNS", "TRACE_COLUMNS", "Run", "Timing"]
