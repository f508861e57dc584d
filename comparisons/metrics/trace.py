"""Measures on the dense trace of a few particles: differences, contact time, peak overlap, rebound,
observed order.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def largest_difference(a: np.ndarray, b: np.ndarray, scale: np.ndarray | float = 1.0) -> float:
    """Largest |a - b|/scale over all steps and particles; a, b (t, n, 3), scale of one number or (n,) per
    particle.

    NaN if either holds a NaN. Raises ValueError where the shapes differ: a shorter trace is not an agreement.
    """
    if a.shape != b.shape:
        raise ValueError(f"traces of different shape: {a.shape} and {b.shape}")
    return float((np.linalg.norm(a - b, axis=-1) / scale).max())


def peak(time: np.ndarray, value: np.ndarray) -> tuple[float, float]:
    """(time, value) of the maximum: vertex of the parabola through the largest sample and its neighbours.

    Uniform steps. The vertex error is of third order in the step, below that of the time stepping.
    """
    k = int(np.clip(np.argmax(value), 1, len(value) - 2))
    left, mid, right = value[k - 1 : k + 2]
    bend = left - 2 * mid + right
    if bend >= 0:
        return float(time[k]), float(value[k])
    shift = 0.5 * (left - right) / bend
    return float(time[k] + shift * (time[k + 1] - time[k])), float(mid - 0.25 * (left - right) * shift)


def contact_interval(time: np.ndarray, overlap: np.ndarray) -> tuple[float, float]:
    """(begin, end) [s] of the first contact: zero crossings of the overlap, linear between samples.

    The bodies fly freely next to the crossing, so that the straight line is right to third order in the step.
    Raises ValueError where there is no touch, or no end of it, in the trace.
    """
    inside = overlap > 0
    if inside[0] or not inside.any():
        raise ValueError("the trace holds no beginning of a contact")
    first = int(np.argmax(inside))
    after = np.flatnonzero(~inside[first:])
    if not len(after):
        raise ValueError("the contact does not end within the trace")
    last = first + int(after[0])

    def crossing(k: int) -> float:
        return float(time[k - 1] + (time[k] - time[k - 1]) * overlap[k - 1] / (overlap[k - 1] - overlap[k]))

    return crossing(first), crossing(last)


def rebound(velocity: np.ndarray, normal: np.ndarray, base: np.ndarray | float = 0.0) -> float:
    """Parting over approaching speed along `normal`, from the first and the last step; velocity (t, 3),
    relative to `base`.

    What it is not: the restitution put in; with `limit_force` or coarse steps they differ.
    """
    relative = velocity - base
    return float(-(relative[-1] @ normal) / (relative[0] @ normal))


def observed_order(step: Sequence[float] | np.ndarray, error: Sequence[float] | np.ndarray) -> float:
    """Slope of log(error) against log(step) by least squares: the observed order of convergence.

    Needs at least three steps, so that one lucky rung does not make the slope. Raises ValueError otherwise.
    """
    step, error = np.asarray(step, float), np.asarray(error, float)
    if len(step) < 3:
        raise ValueError(f"an order needs three steps or more; got {len(step)}")
    return float(np.polyfit(np.log(step), np.log(error), 1)[0])


def slip_end(time: np.ndarray, slip: np.ndarray) -> float:
    """Time [s] at which a slip [m/s] under constant friction would reach zero: a straight line through the
    middle half of its decrease. Near its end the tangential spring makes the slip oscillate.
    """
    middle = (slip < 0.75 * slip[0]) & (slip > 0.25 * slip[0]) & (time < time[np.argmin(slip)])
    slope, offset = np.polyfit(time[middle], slip[middle], 1)
    return float(-offset / slope)
