# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false
"""Event search over all pairs at every event, without cells and without a tree: O(N^2) an event.

For comparisons of cost: collision rules and compiler are those of the event loop, only the search differs.
Periodic sides are not supported.
"""

import functools
from typing import Any

import warp as wp

from gpudem.event_driven.collision_rules import collision_rules
from gpudem.event_driven.collision_times import time_to_pair_collision
from gpudem.event_driven.event_state import (
    LEFT_DOMAIN,
    NEVER,
    NO_PARTNER,
    RUNNING,
    STOP_TIME_REACHED,
    WALL_PARTNER,
    EventState,
    advance_particle,
    real,
    report_error,
)
from gpudem.event_driven.walls import wall_prediction


@functools.cache
def all_pairs_kernel(sawtooth: bool, rough: bool) -> Any:
    """A kernel with the arguments of `advance` in `build_kernels`: (state, t_stop [s], max_events)."""
    collide_with_wall, collide_pair = collision_rules(sawtooth, rough)
    predict_wall_collision = wall_prediction(sawtooth)

    @wp.func
    def advance_within_domain(s: EventState, i: int, t: real):
        """Advance i to t; an error if its center has passed a side without a wall."""
        advance_particle(s, i, t)
        for axis in range(3):
            side = wp.int32(-1)
            if s.x[i][axis] < s.lo[axis] and s.wall_present[2 * axis] == 0:
                side = 2 * axis
            if s.x[i][axis] > s.lo[axis] + s.domain_size[axis] and s.wall_present[2 * axis + 1] == 0:
                side = 2 * axis + 1
            if side >= 0:
                s.crossing_side[i] = side
                report_error(s, LEFT_DOMAIN, i)

    @wp.kernel(module="unique", enable_backward=False)
    def advance(s: EventState, t_stop: real, max_events: int):
        for _k in range(max_events):
            now = s.local_time[0]
            best = real(NEVER)
            first = wp.int32(0)
            partner = wp.int32(NO_PARTNER)
            for i in range(s.n):
                sooner, wall = predict_wall_collision(s, i, now, best)
                if wall != NO_PARTNER:
                    best = sooner
                    first = i
                    partner = wall
                for j in range(i + 1, s.n):
                    r = s.x[i] - s.x[j]
                    after = now + time_to_pair_collision(r, s.v[i] - s.v[j], s.radius[i] + s.radius[j])
                    if after < best:
                        best = after
                        first = i
                        partner = j
            if best > t_stop:
                s.status[0] = STOP_TIME_REACHED
                s.current_time[0] = t_stop
                break
            s.current_time[0] = best
            for i in range(s.n):
                advance_within_domain(s, i, best)
            if s.status[0] == RUNNING:
                if partner < 0:
                    collide_with_wall(s, first, WALL_PARTNER - partner, best)
                else:
                    collide_pair(s, first, partner, best)
            if s.status[0] != RUNNING:
                break

    return advance
