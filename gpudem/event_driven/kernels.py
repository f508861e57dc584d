# pyright: reportArgumentType=false, reportGeneralTypeIssues=false, reportIndexIssue=false, reportInvalidTypeForm=false
"""The event loop of hard disks and spheres: one thread goes from collision to collision, in float64.

Each particle has a clock of its own and lies in a linked list of its cell. Its next collision (partner, time)
and its next cell crossing are kept; a tournament tree holds the earliest event of all. A collision raises the
counters of both partners; an event whose partner's counter has moved since is stale and is predicted anew
when it comes up (lazy invalidation). That is safe because of every pair, the one who changed last has looked
at the other: the earlier of the two kept events is never later than the pair's true time.
Sources: Rapaport, J. Comput. Phys. 34 (1980) 184 (tree, cell crossings as events); Lubachevsky, J. Comput.
Phys. 94 (1991) 255 (one event a particle); Marin, Risso, Cordero, J. Comput. Phys. 109 (1993) 306 (clocks of
their own); Luding and McNamara, Granular Matter 1 (1998) 113 (TC model); Bannerman et al., Comput. Part.
Mech. 1 (2014) 191 (touching and approaching: the event is now).
"""

import functools
from typing import Any

import warp as wp

from gpudem.event_driven.events import (
    BUSY,
    CROSSINGS,
    DONE,
    FAR,
    LOST,
    NOBODY,
    STALE,
    WALL,
    Events,
    bring,
    fall_time,
    link,
    meeting_time,
    real,
    unlink,
    vec3,
    wrapped,
)
from gpudem.event_driven.rules import rules
from gpudem.event_driven.walls import wall_prediction


@wp.func
def scan(s: Events, i: int, t: real, first: wp.vec3i, end: wp.vec3i, known: real):
    """Earliest meeting of i, whose clock is t, in cells first..end around its own, if before `known`."""
    x, v, radius, cell = s.x[i], s.v[i], s.radius[i], s.cell[i]
    best = known + real(0.0)
    partner = wp.int32(NOBODY)
    for dz in range(first[2], end[2] + 1):
        cz = wrapped(cell[2] + dz, s.cells[2], s.periodic[2])
        for dy in range(first[1], end[1] + 1):
            cy = wrapped(cell[1] + dy, s.cells[1], s.periodic[1])
            for dx in range(first[0], end[0] + 1):
                cx = wrapped(cell[0] + dx, s.cells[0], s.periodic[0])
                if cx >= 0 and cy >= 0 and cz >= 0:
                    # over a periodic side the image in that very cell, not the nearest one, is looked at
                    place = x
                    if cx != cell[0] + dx or cy != cell[1] + dy or cz != cell[2] + dz:
                        place = x - vec3(
                            real((cell[0] + dx - cx) // s.cells[0]) * s.size[0],
                            real((cell[1] + dy - cy) // s.cells[1]) * s.size[1],
                            real((cell[2] + dz - cz) // s.cells[2]) * s.size[2],
                        )
                    j = s.head[(cz * s.cells[1] + cy) * s.cells[0] + cx]
                    while j >= 0:
                        dt = t - s.clock[j]
                        vj = s.v[j]
                        r = place - (s.x[j] + dt * (vj + (real(0.5) * dt) * s.gravity))
                        u = v - (vj + dt * s.gravity)
                        after = t + meeting_time(r, u, radius + s.radius[j])
                        if after < best and j != i:
                            best = after
                            partner = j
                        j = s.next[j]
    return best, partner


@wp.func
def predict_crossing(s: Events, i: int, t: real):
    """Earliest time at which the centre of i leaves its cell, and by which side."""
    x, v, cell = s.x[i], s.v[i], s.cell[i]
    best = real(FAR)
    side = wp.int32(0)
    for axis in range(3):
        if s.reach[axis] > 0:
            low = s.lo[axis] + real(cell[axis]) * s.edge[axis]
            if cell[axis] > 0 or s.shut[2 * axis] == 0:
                after = t + fall_time(x[axis] - low, v[axis], s.gravity[axis])
                if after < best:
                    best = after
                    side = 2 * axis
            if cell[axis] < s.cells[axis] - 1 or s.shut[2 * axis + 1] == 0:
                high = s.lo[axis] + real(cell[axis] + 1) * s.edge[axis]
                after = t + fall_time(high - x[axis], -v[axis], -s.gravity[axis])
                if after < best:
                    best = after
                    side = 2 * axis + 1
    s.cross_time[i] = best
    s.cross_side[i] = side
    s.time[i] = wp.min(best, s.hit_time[i])


@wp.func
def play(s: Events, i: int):
    """Tournament: the matches of i up the tree, until one ends as before and i is not in it."""
    node = (s.leaves + i) >> 1
    a = i & -2
    won = a
    if s.time[a + 1] < s.time[a]:
        won = a + 1
    old = s.winner[node]
    s.winner[node] = won
    while node > 1 and (won != old or won == i):
        node = node >> 1
        a = s.winner[2 * node]
        b = s.winner[2 * node + 1]
        won = a
        if s.time[b] < s.time[a]:
            won = b
        old = s.winner[node]
        s.winner[node] = won


@functools.cache
def kernels(saw: bool, rough: bool, tree: bool = True) -> tuple[Any, Any]:
    """(start, advance): first prediction of all particles; the loop over a bounded number of events.

    Args:
        saw: There is a wall whose saw-tooth has an amplitude.
        rough: Collisions have a tangential impulse, and spins are part of the state.
        tree: Without it the earliest event is looked for among all particles: O(N) an event.
    """
    predict_walls = wall_prediction(saw)
    of_wall, of_pair = rules(saw, rough)

    @wp.func
    def enter(s: Events, i: int):
        """The times of i have changed."""
        if wp.static(tree):
            play(s, i)

    @wp.func
    def earliest(s: Events):
        """Whose event is the first of all; of two at once, the lower number."""
        first = wp.int32(0)
        if wp.static(tree):
            first = s.winner[1]
        else:
            for i in range(1, s.n):
                if s.time[i] < s.time[first]:
                    first = i
        return first

    @wp.func
    def predict(s: Events, i: int, t: real):
        """All next events of i, whose clock is t; enters the earliest into the tree."""
        best, partner = scan(s, i, t, -s.reach, s.reach, FAR)
        sooner, side = predict_walls(s, i, t, best)
        if side != NOBODY:
            partner = side
        s.hit_time[i] = sooner
        s.partner[i] = partner
        if partner >= 0:
            s.partner_collisions[i] = s.collisions[partner]
        predict_crossing(s, i, t)

    @wp.func
    def cross(s: Events, i: int, t: real):
        """Particle i enters the next cell and looks at the cells that come within its reach."""
        side = s.cross_side[i]
        axis = side // 2
        step = 2 * (side % 2) - 1
        bring(s, i, t)
        c = s.cell[i]
        to = wrapped(c[axis] + step, s.cells[axis], s.periodic[axis])
        if to < 0:
            s.status[0] = LOST
            s.status[1] = i
            return
        if to != c[axis] + step:
            x = s.x[i]
            x[axis] = x[axis] - real(step) * s.size[axis]
            s.x[i] = x
        unlink(s, i)
        c[axis] = to
        link(s, i, c)
        first, end = -s.reach, wp.vec3i(s.reach[0], s.reach[1], s.reach[2])
        first[axis] = step
        end[axis] = step
        best, partner = scan(s, i, t, first, end, s.hit_time[i])
        if partner >= 0:
            s.hit_time[i] = best
            s.partner[i] = partner
            s.partner_collisions[i] = s.collisions[partner]
        predict_crossing(s, i, t)
        enter(s, i)
        s.counts[CROSSINGS] = s.counts[CROSSINGS] + wp.int64(1)

    @wp.func
    def hit_wall(s: Events, i: int, side: int, t: real):
        """A collision with a wall, and what comes next."""
        of_wall(s, i, side, t)
        if s.status[0] == BUSY:
            predict(s, i, t)
            enter(s, i)

    @wp.func
    def hit_pair(s: Events, i: int, j: int, t: real):
        """A collision of two particles, and what comes next."""
        of_pair(s, i, j, t)
        predict(s, i, t)
        predict(s, j, t)
        enter(s, i)
        enter(s, j)

    @wp.kernel(module="unique", enable_backward=False)
    def start(s: Events, t: real, n: int):
        """Bring all to t, put them into their cells, predict, fill the tree."""
        for i in range(n):
            bring(s, i, t)
            link(s, i, s.cell[i])
        for i in range(n):
            predict(s, i, t)
        for k in range(1, s.leaves):
            node = s.leaves - k
            a = 2 * node - s.leaves
            b = a + 1
            if 2 * node < s.leaves:
                a = s.winner[2 * node]
                b = s.winner[2 * node + 1]
            s.winner[node] = a
            if s.time[b] < s.time[a]:
                s.winner[node] = b

    @wp.kernel(module="unique", enable_backward=False)
    def advance(s: Events, t_stop: real, events: int):
        """Event after event to t_stop, at most so many."""
        for _k in range(events):
            i = earliest(s)
            t = s.time[i]
            if t > t_stop:
                s.status[0] = DONE
                s.now[0] = t_stop
                break
            s.now[0] = t
            partner = s.partner[i]
            if s.cross_time[i] < s.hit_time[i]:
                cross(s, i, t)
            elif partner < 0:
                hit_wall(s, i, WALL - partner, t)
            elif s.collisions[partner] != s.partner_collisions[i]:
                s.counts[STALE] = s.counts[STALE] + wp.int64(1)
                bring(s, i, t)
                predict(s, i, t)
                enter(s, i)
            else:
                hit_pair(s, i, partner, t)
            if s.status[0] != BUSY:
                break

    return start, advance
