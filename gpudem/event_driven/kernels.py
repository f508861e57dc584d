# pyright: reportArgumentType=false, reportGeneralTypeIssues=false, reportIndexIssue=false, reportInvalidTypeForm=false
"""The event loop of hard disks and spheres: one thread processes collision after collision, in float64.

Each particle has a local time of its own and is in the linked list of its cell. It stores one predicted
collision (partner, time) and one predicted cell crossing; a tournament tree holds the earliest event of all.

Lazy invalidation: a collision increments the collision counts of both partners. A predicted collision is
stale if its partner's count is no longer that of the prediction: it is discarded when it reaches the root of
the tree, and the particle is predicted anew.

Invariant: for every pair that would collide on its present trajectories, at least one of the two particles
stores an event no later than that collision. A particle is predicted against all neighbors after each of its
collisions, and against the cells that come into its range after each crossing; hence the particle of a pair
whose trajectory or cell changed last has taken the present trajectory of the other into account. So no
collision is missed, though the stale predictions of third particles are not searched for.

Sources: Rapaport, J. Comput. Phys. 34 (1980) 184 (tree, cell crossings as events); Lubachevsky, J. Comput.
Phys. 94 (1991) 255 (one event a particle); Marin, Risso, Cordero, J. Comput. Phys. 109 (1993) 306 (local
times); Luding and McNamara, Granular Matter 1 (1998) 113 (TC model); Bannerman et al., Comput. Part. Mech. 1
(2014) 191 (touching and approaching: the collision is now).
"""

import functools
from typing import Any

import warp as wp

from gpudem.event_driven.cell_list import link, neighbor_cell, unlink
from gpudem.event_driven.collision_rules import collision_rules
from gpudem.event_driven.collision_times import time_to_pair_collision, time_to_plane
from gpudem.event_driven.event_state import (
    CELL_CROSSINGS,
    LEFT_DOMAIN,
    NEVER,
    NO_PARTNER,
    RUNNING,
    STALE_EVENTS,
    STOP_TIME_REACHED,
    WALL_PARTNER,
    EventState,
    advance_particle,
    real,
    report_error,
    vec3,
)
from gpudem.event_driven.event_tree import build_event_tree, update_event_tree
from gpudem.event_driven.walls import wall_prediction


@wp.func
def predict_pair_collision(s: EventState, i: int, t: real, first: wp.vec3i, end: wp.vec3i, known: real):
    """Earliest collision of i, whose local time is t, with particles in the cells first..end around its own.

    Returns (time, partner) if before `known`, else (known, NO_PARTNER).
    """
    x, v, radius, cell = s.x[i], s.v[i], s.radius[i], s.cell[i]
    best = known + real(0.0)
    partner = wp.int32(NO_PARTNER)
    for dz in range(first[2], end[2] + 1):
        cz = neighbor_cell(cell[2] + dz, s.n_cells[2], s.periodic[2])
        for dy in range(first[1], end[1] + 1):
            cy = neighbor_cell(cell[1] + dy, s.n_cells[1], s.periodic[1])
            for dx in range(first[0], end[0] + 1):
                cx = neighbor_cell(cell[0] + dx, s.n_cells[0], s.periodic[0])
                if cx >= 0 and cy >= 0 and cz >= 0:
                    # over a periodic side: the image in exactly this cell, not the nearest image
                    place = x
                    if cx != cell[0] + dx or cy != cell[1] + dy or cz != cell[2] + dz:
                        place = x - vec3(
                            real((cell[0] + dx - cx) // s.n_cells[0]) * s.domain_size[0],
                            real((cell[1] + dy - cy) // s.n_cells[1]) * s.domain_size[1],
                            real((cell[2] + dz - cz) // s.n_cells[2]) * s.domain_size[2],
                        )
                    j = s.head[(cz * s.n_cells[1] + cy) * s.n_cells[0] + cx]
                    while j >= 0:
                        dt = t - s.local_time[j]
                        vj = s.v[j]
                        r = place - (s.x[j] + dt * (vj + (real(0.5) * dt) * s.gravity))
                        u = v - (vj + dt * s.gravity)
                        after = t + time_to_pair_collision(r, u, radius + s.radius[j])
                        if after < best and j != i:
                            best = after
                            partner = j
                        j = s.next[j]
    return best, partner


@wp.func
def predict_crossing(s: EventState, i: int, t: real):
    """Earliest time at which the center of i leaves its cell, and the side by which it leaves."""
    x, v, cell = s.x[i], s.v[i], s.cell[i]
    best = real(NEVER)
    side = wp.int32(0)
    for axis in range(3):
        if s.search_range[axis] > 0:
            low = s.lo[axis] + real(cell[axis]) * s.cell_edge[axis]
            if cell[axis] > 0 or s.side_closed[2 * axis] == 0:
                after = t + time_to_plane(x[axis] - low, v[axis], s.gravity[axis])
                if after < best:
                    best = after
                    side = 2 * axis
            if cell[axis] < s.n_cells[axis] - 1 or s.side_closed[2 * axis + 1] == 0:
                high = s.lo[axis] + real(cell[axis] + 1) * s.cell_edge[axis]
                after = t + time_to_plane(high - x[axis], -v[axis], -s.gravity[axis])
                if after < best:
                    best = after
                    side = 2 * axis + 1
    s.crossing_time[i] = best
    s.crossing_side[i] = side
    s.event_time[i] = wp.min(best, s.collision_time[i])


@functools.cache
def build_kernels(sawtooth: bool, rough: bool, tree: bool = True) -> tuple[Any, Any]:
    """(start, advance): first prediction of all particles; the loop over a bounded number of events.

    Args:
        sawtooth: At least one wall vibrates with a finite amplitude.
        rough: Collisions have a tangential impulse, and angular velocities are part of the state.
        tree: False: the earliest event is searched among all particles, O(N) an event.
    """
    predict_wall_collision = wall_prediction(sawtooth)
    collide_with_wall, collide_pair = collision_rules(sawtooth, rough)

    @wp.func
    def update_tree(s: EventState, i: int):
        """To be called when the event time of i has changed."""
        if wp.static(tree):
            update_event_tree(s, i)

    @wp.func
    def next_particle(s: EventState):
        """The particle with the earliest event; of two at the same time, the lower number."""
        first = wp.int32(0)
        if wp.static(tree):
            first = s.tree[1]
        else:
            for i in range(1, s.n):
                if s.event_time[i] < s.event_time[first]:
                    first = i
        return first

    @wp.func
    def predict_events(s: EventState, i: int, t: real):
        """Next collision and next crossing of i, whose local time is t; the tree is not updated."""
        best, partner = predict_pair_collision(s, i, t, -s.search_range, s.search_range, NEVER)
        sooner, wall = predict_wall_collision(s, i, t, best)
        if wall != NO_PARTNER:
            partner = wall
        s.collision_time[i] = sooner
        s.partner[i] = partner
        if partner >= 0:
            s.partner_count[i] = s.collision_count[partner]
        predict_crossing(s, i, t)

    @wp.func
    def process_crossing(s: EventState, i: int, t: real):
        """Particle i enters the next cell and is predicted against the cells that come into its range."""
        side = s.crossing_side[i]
        axis = side // 2
        step = 2 * (side % 2) - 1
        advance_particle(s, i, t)
        c = s.cell[i]
        to = neighbor_cell(c[axis] + step, s.n_cells[axis], s.periodic[axis])
        if to < 0:
            report_error(s, LEFT_DOMAIN, i)
            return
        if to != c[axis] + step:  # through a periodic side
            x = s.x[i]
            x[axis] = x[axis] - real(step) * s.domain_size[axis]
            s.x[i] = x
            image = s.image[i]
            image[axis] = image[axis] + step
            s.image[i] = image
        unlink(s, i)
        c[axis] = to
        link(s, i, c)
        first, end = -s.search_range, wp.vec3i(s.search_range[0], s.search_range[1], s.search_range[2])
        first[axis] = step
        end[axis] = step  # mutate: new_cells
        best, partner = predict_pair_collision(s, i, t, first, end, s.collision_time[i])
        if partner >= 0:
            s.collision_time[i] = best
            s.partner[i] = partner
            s.partner_count[i] = s.collision_count[partner]
        predict_crossing(s, i, t)
        update_tree(s, i)
        s.counts[CELL_CROSSINGS] = s.counts[CELL_CROSSINGS] + wp.int64(1)

    @wp.func
    def process_wall_collision(s: EventState, i: int, side: int, t: real):
        """Collision of i with the wall of a side, and the prediction of its next events."""
        collide_with_wall(s, i, side, t)
        if s.status[0] == RUNNING:
            predict_events(s, i, t)
            update_tree(s, i)

    @wp.func
    def process_pair_collision(s: EventState, i: int, j: int, t: real):
        """Collision of two particles, and the prediction of the next events of both."""
        collide_pair(s, i, j, t)
        predict_events(s, i, t)
        predict_events(s, j, t)
        update_tree(s, i)
        update_tree(s, j)

    @wp.kernel(module="unique", enable_backward=False)
    def start(s: EventState, t: real, n: int):
        """Advance all particles to t, link them to their cells, predict their events and build the tree."""
        for i in range(n):
            advance_particle(s, i, t)
            link(s, i, s.cell[i])
        for i in range(n):
            predict_events(s, i, t)
        build_event_tree(s)

    @wp.kernel(module="unique", enable_backward=False)
    def advance(s: EventState, t_stop: real, max_events: int):
        """Process events in the order of time up to t_stop, at most max_events of them."""
        for _k in range(max_events):
            i = next_particle(s)
            t = s.event_time[i]
            if t > t_stop:
                s.status[0] = STOP_TIME_REACHED
                s.current_time[0] = t_stop
                break
            s.current_time[0] = t
            partner = s.partner[i]
            if s.crossing_time[i] < s.collision_time[i]:
                process_crossing(s, i, t)
            elif partner < 0:
                process_wall_collision(s, i, WALL_PARTNER - partner, t)
            elif s.collision_count[partner] != s.partner_count[i]:  # mutate: stale_event
                s.counts[STALE_EVENTS] = s.counts[STALE_EVENTS] + wp.int64(1)
                advance_particle(s, i, t)
                predict_events(s, i, t)
                update_tree(s, i)
            else:
                process_pair_collision(s, i, partner, t)
            if s.status[0] != RUNNING:
                break

    return start, advance
