# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false
"""When a particle comes to a wall: at rest, the limit of a fast floor, or a saw-tooth."""

import functools
from typing import Any

import warp as wp

from gpudem.event_driven.events import FAR, NOBODY, UNSEEN, WALL, Events, fall_time, real


@wp.func
def saw_time(t: real, h: real, w: real, a: real, speed: real, stroke: real):
    """First time from t at which a surface meets a wall at U (t mod A/U); FAR if never.

    h, w, a: its height over the wall's lowest place, its velocity and acceleration away from the wall. In a
    tooth the wall has no acceleration: one quadratic. A flight above the stroke is skipped in closed form.
    Who is within the stroke as a tooth begins is hit in it or leaves it upwards, and comes down at most once:
    fewer than 8 teeth are looked at, however slow and far the particle. -1: that was wrong.
    """
    period = stroke / speed
    k = wp.floor(t / period)
    if (k + real(1.0)) * period <= t:  # rounding of t / period: the wall is at its lowest again
        k = k + real(1.0)
    begin = real(0.0)
    teeth = wp.int32(8)
    for _tooth in range(teeth):
        above = h + begin * (w + real(0.5) * a * begin) - stroke
        if above > real(0.0):
            fall = fall_time(above, w + a * begin, a)
            if fall >= FAR:
                return FAR
            begin = begin + fall
            k = wp.max(k, wp.floor((t + begin) / period))
            if (k + real(1.0)) * period <= t + begin:
                k = k + real(1.0)
        end = (k + real(1.0)) * period - t
        gap = h + begin * (w + real(0.5) * a * begin) - speed * (t + begin - k * period)
        after = begin + fall_time(gap, w + a * begin - speed, a)
        if after <= end:
            return t + after
        begin = end
        k = k + real(1.0)
    return real(-1.0)


@functools.cache
def wall_prediction(saw: bool) -> Any:
    """A function (events, i, t, known) -> (time, partner): the first wall before `known`, or NOBODY."""

    @wp.func
    def wall_time(s: Events, i: int, side: int, t: real, h: real, w: real, a: real):
        """When i, whose clock is t, meets the wall of a side; h: its distance from the wall's place."""
        if wp.static(saw):
            if s.wall_stroke[side] > real(0.0):
                after = saw_time(t, h, w, a, s.wall_speed[side], s.wall_stroke[side])
                if after < real(0.0):
                    s.status[0] = UNSEEN
                    s.status[1] = i
                return after
        return t + fall_time(h, w, a)

    @wp.func
    def predict_walls(s: Events, i: int, t: real, known: real):
        """Earliest wall that i, whose clock is t, reaches, if before `known`."""
        x, v, radius = s.x[i], s.v[i], s.radius[i]
        best = known + real(0.0)
        partner = wp.int32(NOBODY)
        for axis in range(3):
            if s.wall[2 * axis] > 0:
                h = x[axis] - s.wall_at[2 * axis] - radius
                after = wall_time(s, i, 2 * axis, t, h, v[axis], s.gravity[axis])
                if after < best:
                    best = after
                    partner = WALL - 2 * axis
            if s.wall[2 * axis + 1] > 0:
                h = s.wall_at[2 * axis + 1] - x[axis] - radius
                after = wall_time(s, i, 2 * axis + 1, t, h, -v[axis], -s.gravity[axis])
                if after < best:
                    best = after
                    partner = WALL - (2 * axis + 1)
        return best, partner

    return predict_walls
