# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false
"""The first rung of the ladder: all pairs at every event, one clock, no cells, no tree. O(N^2) an event.

For comparisons of cost, with the rules and the compiler of the event loop. Sides are not periodic.
"""

import functools
from typing import Any

import warp as wp

from gpudem.event_driven.events import (
    BUSY,
    DONE,
    FAR,
    LOST,
    NOBODY,
    WALL,
    Events,
    bring,
    meeting_time,
    real,
)
from gpudem.event_driven.rules import rules
from gpudem.event_driven.walls import wall_prediction


@functools.cache
def all_pairs(saw: bool, rough: bool) -> Any:
    """The kernel (events, t_stop, most events), in the place of the loop's `advance`."""
    of_wall, of_pair = rules(saw, rough)
    predict_walls = wall_prediction(saw)

    @wp.func
    def fly(s: Events, i: int, t: real):
        """Bring i to t, unless it has left."""
        bring(s, i, t)
        for axis in range(3):
            side = wp.int32(-1)
            if s.x[i][axis] < s.lo[axis] and s.wall[2 * axis] == 0:
                side = 2 * axis
            if s.x[i][axis] > s.lo[axis] + s.size[axis] and s.wall[2 * axis + 1] == 0:
                side = 2 * axis + 1
            if side >= 0:
                s.cross_side[i] = side
                s.status[0] = LOST
                s.status[1] = i

    @wp.kernel(module="unique", enable_backward=False)
    def advance(s: Events, t_stop: real, events: int):
        for _k in range(events):
            now = s.clock[0]
            best = real(FAR)
            first = wp.int32(0)
            partner = wp.int32(NOBODY)
            for i in range(s.n):
                sooner, side = predict_walls(s, i, now, best)
                if side != NOBODY:
                    best = sooner
                    first = i
                    partner = side
                for j in range(i + 1, s.n):
                    after = now + meeting_time(s.x[i] - s.x[j], s.v[i] - s.v[j], s.radius[i] + s.radius[j])
                    if after < best:
                        best = after
                        first = i
                        partner = j
            if best > t_stop:
                s.status[0] = DONE
                s.now[0] = t_stop
                break
            s.now[0] = best
            for i in range(s.n):
                fly(s, i, best)
            if s.status[0] == BUSY:
                if partner < 0:
                    of_wall(s, first, WALL - partner, best)
                else:
                    of_pair(s, first, partner, best)
            if s.status[0] != BUSY:
                break

    return advance
