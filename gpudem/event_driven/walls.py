# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false
"""When a particle reaches a wall: at rest, vibrating in the zero-amplitude limit, or moving in a sawtooth."""

import functools
from typing import Any

import warp as wp

from gpudem.event_driven.collision_times import time_to_plane
from gpudem.event_driven.event_state import (
    NEVER,
    NO_PARTNER,
    SAWTOOTH_ROOT_NOT_FOUND,
    WALL_PARTNER,
    EventState,
    real,
    report_error,
)


@wp.func
def sawtooth_collision_time(t: real, h: real, w: real, a: real, speed: real, amplitude: real):
    """First time >= t [s] at which a surface meets a wall at U (t mod A/U); NEVER if it does not.

    t: present time [s]; h: height of the surface over the lowest position of the wall [m]; w, a: its velocity
    and acceleration away from the wall; speed, amplitude: U [m/s] and A [m].

    Within a period the wall has no acceleration: one quadratic. Flight above the amplitude is skipped in
    closed form. A surface below the amplitude at the start of a period is hit in that period or leaves
    upwards, and comes down at most once: fewer than 8 periods need a look, however long the flight. Returns
    -1 if that bound did not hold (the period is too short to be resolved by the time).
    """
    period = amplitude / speed
    k = wp.floor(t / period)
    if (k + real(1.0)) * period <= t:  # rounding of t / period: the wall is at its lowest position again
        k = k + real(1.0)
    begin = real(0.0)
    periods = wp.int32(8)
    for _period in range(periods):
        above = h + begin * (w + real(0.5) * a * begin) - amplitude
        if above > real(0.0):
            fall = time_to_plane(above, w + a * begin, a)
            if fall >= NEVER:
                return NEVER
            begin = begin + fall
            k = wp.max(k, wp.floor((t + begin) / period))  # mutate: tooth_after_flight
            if (k + real(1.0)) * period <= t + begin:
                k = k + real(1.0)
        end = (k + real(1.0)) * period - t
        gap = h + begin * (w + real(0.5) * a * begin) - speed * (t + begin - k * period)  # mutate: tooth_gap
        after = begin + time_to_plane(gap, w + a * begin - speed, a)  # mutate: time_to_floor
        if after <= end:
            return t + after
        begin = end
        k = k + real(1.0)
    return real(-1.0)


@functools.cache
def wall_prediction(sawtooth: bool) -> Any:
    """A function (state, i, t, known) -> (time, partner): first wall reached before `known`, or NO_PARTNER.

    Args:
        sawtooth: At least one wall vibrates with a finite amplitude.
    """

    @wp.func
    def wall_collision_time(s: EventState, i: int, side: int, t: real, h: real, w: real, a: real):
        """Time at which i, whose local time is t, meets the wall of a side; h: gap to its rest position."""
        if wp.static(sawtooth):
            if s.wall_amplitude[side] > real(0.0):
                after = sawtooth_collision_time(t, h, w, a, s.wall_speed[side], s.wall_amplitude[side])
                if after < real(0.0):
                    report_error(s, SAWTOOTH_ROOT_NOT_FOUND, i)
                return after
        return t + time_to_plane(h, w, a)

    @wp.func
    def predict_wall_collision(s: EventState, i: int, t: real, known: real):
        """Earliest wall that i, whose local time is t, reaches, if before `known`."""
        x, v, radius = s.x[i], s.v[i], s.radius[i]
        best = known + real(0.0)
        partner = wp.int32(NO_PARTNER)
        for axis in range(3):
            if s.wall_present[2 * axis] > 0:
                h = x[axis] - s.wall_position[2 * axis] - radius
                after = wall_collision_time(s, i, 2 * axis, t, h, v[axis], s.gravity[axis])
                if after < best:
                    best = after
                    partner = WALL_PARTNER - 2 * axis
            if s.wall_present[2 * axis + 1] > 0:
                h = s.wall_position[2 * axis + 1] - x[axis] - radius
                after = wall_collision_time(s, i, 2 * axis + 1, t, h, -v[axis], -s.gravity[axis])
                if after < best:
                    best = after
                    partner = WALL_PARTNER - (2 * axis + 1)
        return best, partner

    return predict_wall_collision
