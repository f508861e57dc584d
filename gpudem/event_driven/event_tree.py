# pyright: reportGeneralTypeIssues=false
"""Tournament tree: the particle with the earliest event is at the root; an update costs O(log N)."""

import warp as wp

from gpudem.event_driven.event_state import EventState


@wp.func
def update_event_tree(s: EventState, i: int):
    """Replay the matches of particle i from its leaf upwards after its event time has changed.

    Stops at a node whose winner is the one it was before and is not i: nothing changes above it.
    """
    node = (s.n_leaves + i) >> 1
    a = i & -2
    won = a
    if s.event_time[a + 1] < s.event_time[a]:
        won = a + 1
    old = s.tree[node]
    s.tree[node] = won
    while node > 1 and (won != old or won == i):  # mutate: tree_update
        node = node >> 1
        a = s.tree[2 * node]
        b = s.tree[2 * node + 1]
        won = a
        if s.event_time[b] < s.event_time[a]:
            won = b
        old = s.tree[node]
        s.tree[node] = won


@wp.func
def build_event_tree(s: EventState):
    """Play all matches, from the leaves to the root."""
    for k in range(1, s.n_leaves):
        node = s.n_leaves - k
        a = 2 * node - s.n_leaves
        b = a + 1
        if 2 * node < s.n_leaves:
            a = s.tree[2 * node]
            b = s.tree[2 * node + 1]
        s.tree[node] = a
        if s.event_time[b] < s.event_time[a]:
            s.tree[node] = b
