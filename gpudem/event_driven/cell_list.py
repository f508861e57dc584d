# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false
"""Cells of the event loop: each particle is in the doubly linked list of one cell."""

import warp as wp

from gpudem.event_driven.event_state import EventState


@wp.func
def cell_index(s: EventState, c: wp.vec3i):
    """Index of a cell into `head`."""
    return (c[2] * s.n_cells[1] + c[1]) * s.n_cells[0] + c[0]


@wp.func
def link(s: EventState, i: int, c: wp.vec3i):
    """Insert particle i at the head of the list of cell c."""
    k = cell_index(s, c)
    first = s.head[k]
    s.next[i] = first
    s.previous[i] = -1
    if first >= 0:
        s.previous[first] = i
    s.head[k] = i
    s.cell[i] = c


@wp.func
def unlink(s: EventState, i: int):
    """Remove particle i from the list of its cell."""
    before, after = s.previous[i], s.next[i]
    if before >= 0:
        s.next[before] = after
    else:
        s.head[cell_index(s, s.cell[i])] = after
    if after >= 0:
        s.previous[after] = before


@wp.func
def neighbor_cell(c: int, n: int, periodic: int):
    """Cell c, from -1 to n, of an axis with n cells: wrapped over a periodic side; -1 where there is none."""
    k = c
    if c < 0 or c >= n:
        k = -1
        if periodic > 0:
            k = c + n
            if c >= n:
                k = c - n
    return k
