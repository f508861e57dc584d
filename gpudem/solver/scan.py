# pyright: reportIndexIssue=false
"""Exclusive prefix sums for a branch of a CUDA graph, where Warp's own, which allocates, must not stand."""

from __future__ import annotations

from typing import Any

import warp as wp

#: Numbers that one thread adds up.
GROUP = wp.constant(64)


@wp.kernel(enable_backward=False)
def group_sums(
    # in
    n: wp.int32,
    values: wp.array[wp.int32],
    # out
    sums: wp.array[wp.int32],
):
    """Sum of each group of values."""
    g = wp.tid()
    total = wp.int32(0)
    for k in range(g * GROUP, wp.min(g * GROUP + GROUP, n)):
        total += values[k]
    sums[g] = total


@wp.kernel(enable_backward=False)
def group_starts(
    # in
    n: wp.int32,
    values: wp.array[wp.int32],
    begin: wp.array[wp.int32],
    # out
    starts: wp.array[wp.int32],
):
    """Sum of all values before each one: of the groups before, and within its own."""
    g = wp.tid()
    at = begin[g] + wp.int32(0)
    for k in range(g * GROUP, wp.min(g * GROUP + GROUP, n)):
        value = values[k]
        starts[k] = at  # mutate: scan_start
        at += value


class ExclusiveScan:
    """starts[i] = values[0] + ... + values[i - 1] of two int32 arrays of one length, shape (n,)."""

    def __init__(self, values: wp.array, starts: wp.array):
        device = values.device
        #: (values, their starts), each level the sums of groups of the one before, down to a single group.
        self.levels: list[tuple[Any, Any]] = [(values, starts)]
        while (n := len(self.levels[-1][0])) > GROUP:
            groups = -(-n // GROUP)
            level = [wp.zeros(groups, dtype=wp.int32, device=device) for _ in range(2)]
            self.levels.append((level[0], level[1]))
        self._zero = wp.zeros(1, dtype=wp.int32, device=device)

    def run(self) -> None:
        """Launch it: sums up the levels, starts down."""
        device = self._zero.device
        for (values, _), (sums, _) in zip(self.levels, self.levels[1:], strict=False):
            wp.launch(group_sums, len(sums), inputs=[len(values), values], outputs=[sums], device=device)
        begin = self._zero
        for values, starts in reversed(self.levels):
            wp.launch(
                group_starts, len(begin), inputs=[len(values), values, begin], outputs=[starts], device=device
            )
            begin = starts
