"""How a wall moves: `[[walls.motion]]`, each type with its keys, and its closed form.

A translation gives its way [m] and velocity [m/s] at given times, a turn its angle [rad] and angular velocity
[rad/s]; `gpudem.walls.motion` composes them into the place of a wall. Time starts at the start of the run,
whether the wall is there or not.
"""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from gpudem.scene.types import Model, Vector, array, number, positive, vector


def rotations(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Matrices of turns by angles [rad], (k,), about a unit axis: shape (k, 3, 3). Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    sine, versine = np.sin(angle)[:, None, None], 2 * np.sin(angle / 2)[:, None, None] ** 2
    return np.eye(3) + sine * cross + versine * (cross @ cross)


class Translation(Model):
    """Base of the motions without a turn."""

    turns: ClassVar[bool] = False

    def way(self, time: np.ndarray) -> np.ndarray:
        """Displacement since the start [m], shape (k, 3), at times [s], shape (k,)."""
        raise NotImplementedError

    def rate(self, time: np.ndarray) -> np.ndarray:
        """Velocity [m/s], shape (k, 3)."""
        raise NotImplementedError


class Turn(Model):
    """Base of the turns about an axis through a point; positive by the right-hand rule."""

    turns: ClassVar[bool] = True
    axis: Annotated[Vector, vector("1", nonzero=True)]
    """Direction of the axis, of any length."""
    point: Annotated[Vector, vector("m")] = (0.0, 0.0, 0.0)
    """A point of the axis at the start [m]."""

    @property
    def unit_axis(self) -> np.ndarray:
        """The axis with length one."""
        axis = np.array(self.axis)
        return axis / math.sqrt(math.fsum(axis * axis))

    def way(self, time: np.ndarray) -> np.ndarray:
        """Angle since the start [rad], shape (k,), at times [s], shape (k,)."""
        raise NotImplementedError

    def rate(self, time: np.ndarray) -> np.ndarray:
        """Angular velocity about the axis [rad/s], shape (k,)."""
        raise NotImplementedError


class Linear(Translation):
    """Constant velocity V: x0 + V t."""

    type: Literal["linear"]
    """Type of motion."""
    velocity: Annotated[Vector, vector("m/s", nonzero=True)]
    """V [m/s]."""

    def way(self, time: np.ndarray) -> np.ndarray:  # noqa: D102
        return time[:, None] * np.array(self.velocity)

    def rate(self, time: np.ndarray) -> np.ndarray:  # noqa: D102
        return np.broadcast_to(np.array(self.velocity), (len(time), 3))


class Oscillate(Translation):
    """x0 + A sin(2 pi t/T): it starts in the middle, at its largest speed 2 pi A/T."""

    type: Literal["oscillate"]
    """Type of motion."""
    amplitude: Annotated[Vector, vector("m", nonzero=True)]
    """A, with its direction [m]."""
    period: Annotated[float, positive("s")]
    """T [s]."""

    def way(self, time: np.ndarray) -> np.ndarray:  # noqa: D102
        return np.sin(2 * math.pi * time / self.period)[:, None] * np.array(self.amplitude)

    def rate(self, time: np.ndarray) -> np.ndarray:  # noqa: D102
        omega = 2 * math.pi / self.period
        return (omega * np.cos(omega * time))[:, None] * np.array(self.amplitude)


class Rotate(Turn):
    """Constant angular velocity 2 pi/T."""

    type: Literal["rotate"]
    """Type of motion."""
    period: Annotated[float, positive("s")]
    """Time of one turn T [s]."""

    def way(self, time: np.ndarray) -> np.ndarray:  # noqa: D102
        return 2 * math.pi * time / self.period

    def rate(self, time: np.ndarray) -> np.ndarray:  # noqa: D102
        return np.full(len(time), 2 * math.pi / self.period)


class Swing(Turn):
    """Angle A sin(2 pi t/T): it starts in the middle, at its largest angular velocity 2 pi A/T."""

    type: Literal["swing"]
    """Type of motion."""
    amplitude: Annotated[float, number("rad", 0, open_lo=True)]
    """A [rad]."""
    period: Annotated[float, positive("s")]
    """T [s]."""

    def way(self, time: np.ndarray) -> np.ndarray:  # noqa: D102
        return self.amplitude * np.sin(2 * math.pi * time / self.period)

    def rate(self, time: np.ndarray) -> np.ndarray:  # noqa: D102
        omega = 2 * math.pi / self.period
        return self.amplitude * omega * np.cos(omega * time)


def _integral(time: np.ndarray, knots: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Integral from 0 of the piecewise linear function through (knots, values); constant beyond them."""
    times = np.concatenate([[0.0], knots[knots > 0]])
    at = np.interp(times, knots, values)
    sums = np.concatenate([[0.0], np.cumsum(np.diff(times) * (at[1:] + at[:-1]) / 2)])
    k = np.clip(np.searchsorted(times, time, side="right") - 1, 0, len(times) - 1)
    here = np.interp(time, knots, values)
    return sums[k] + (time - times[k]) * (at[k] + here) / 2


class _Table(Model):
    """Velocity given at times, linear between them, constant before and after."""

    type: Literal["table"]
    """Type of motion."""
    time: Annotated[np.ndarray, array(0, "s")]
    """Times, ascending [s]."""


class TranslationTable(_Table, Translation):
    """A table of velocities."""

    velocity: Annotated[np.ndarray, array(3, "m/s")]
    """Velocity at each time [m/s], shape (k, 3)."""

    @model_validator(mode="after")
    def _fits(self) -> TranslationTable:
        _check_table(self.time, len(self.velocity), "velocity")
        return self

    def way(self, time: np.ndarray) -> np.ndarray:  # noqa: D102
        return np.stack([_integral(time, self.time, column) for column in self.velocity.T], axis=1)

    def rate(self, time: np.ndarray) -> np.ndarray:  # noqa: D102
        return np.stack([np.interp(time, self.time, column) for column in self.velocity.T], axis=1)


class TurnTable(_Table, Turn):
    """A table of angular velocities about an axis."""

    angular_velocity: Annotated[np.ndarray, array(0, "rad/s")]
    """Angular velocity at each time [rad/s], shape (k,)."""

    @model_validator(mode="after")
    def _fits(self) -> TurnTable:
        _check_table(self.time, len(self.angular_velocity), "angular_velocity")
        return self

    def way(self, time: np.ndarray) -> np.ndarray:  # noqa: D102
        return _integral(time, self.time, self.angular_velocity)

    def rate(self, time: np.ndarray) -> np.ndarray:  # noqa: D102
        return np.interp(time, self.time, self.angular_velocity)


def _check_table(time: np.ndarray, rows: int, name: str) -> None:
    if len(time) != rows:
        raise ValueError(f"{name}: has {rows} rows for {len(time)} times")
    if len(time) == 0 or (np.diff(time) <= 0).any():
        raise ValueError("time: must be ascending, at least one [s]")


Motion = Annotated[
    Linear | Oscillate | Rotate | Swing | TranslationTable | TurnTable, Field(union_mode="left_to_right")
]
