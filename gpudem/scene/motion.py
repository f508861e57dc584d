"""How a wall moves: `[[walls.motion]]`, each type with its keys, and its closed form.

A translation gives its displacement [m] and velocity [m/s] at given times, a turn its angle [rad] and angular
velocity [rad/s]; `gpudem.walls.motion` composes them into the place of a wall. Time starts at the start of
the run, whether the wall is there or not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Discriminator, Tag, ValidationInfo, field_validator
from pydantic_core import PydanticCustomError

from gpudem.scene.types import Model, Vector, array, number, positive, vector

#: Times at which the largest displacement of a motion is looked for.
SAMPLES = 1001


def rotations(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Matrices of turns by angles [rad], (k,), about a unit axis: shape (k, 3, 3). Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    sine, versine = np.sin(angle)[:, None, None], 2 * np.sin(angle / 2)[:, None, None] ** 2
    return np.eye(3) + sine * cross + versine * (cross @ cross)  # mutate: rodrigues


def _unit(axis: Vector) -> np.ndarray:
    """The direction with length one."""
    scaled = np.array(axis) / np.abs(axis).max()
    return scaled / math.sqrt(math.fsum(scaled * scaled))


class _Motion(Model):
    """What every motion has: `way` since the start and `rate` at times [s], shape (k,)."""

    turns: ClassVar[bool] = False
    #: LIGGGHTS, too, computes its place in closed form, not as a sum over steps.
    exact: ClassVar[bool] = False

    def way(self, time: np.ndarray) -> np.ndarray:
        """Displacement [m], shape (k, 3), or angle [rad], shape (k,), since the start."""
        raise NotImplementedError

    def rate(self, time: np.ndarray) -> np.ndarray:
        """Velocity [m/s], shape (k, 3), or angular velocity about the axis [rad/s], shape (k,)."""
        raise NotImplementedError

    @property
    def largest_rate(self) -> float:
        """The largest speed [m/s] or angular speed [rad/s] at any time."""
        raise NotImplementedError

    def farthest(self, duration: float) -> float:
        """The largest displacement [m] or angle [rad] from the start in a run [s]."""
        ways = self.way(np.linspace(0.0, duration, SAMPLES))
        return float(np.abs(ways).max() if self.turns else np.linalg.norm(ways, axis=1).max())

    @property
    def cycle(self) -> float | None:
        """The time [s] after which it repeats itself; None where it does not."""
        return getattr(self, "period", None)


class Translation(_Motion):
    """Base of the motions without a turn."""


class Turn(_Motion):
    """Base of the turns about an axis through a point; positive by the right-hand rule."""

    turns: ClassVar[bool] = True
    axis: Annotated[Vector, vector("1", nonzero=True)]
    """Direction of the axis, of any length; positive turns are right-handed about it."""
    point: Annotated[Vector, vector("m")] = (0.0, 0.0, 0.0)
    """A point of the axis at the start [m]; translations stated before it carry it along."""

    @property
    def unit_axis(self) -> np.ndarray:
        """The axis with length one."""
        return _unit(self.axis)


class Linear(Translation):
    """Constant velocity V: x0 + V t."""

    exact: ClassVar[bool] = True
    type: Literal["linear"]
    """Type of motion."""
    velocity: Annotated[Vector, vector("m/s", nonzero=True)]
    """V [m/s]."""

    def way(self, time: np.ndarray) -> np.ndarray:  # noqa: D102
        return time[:, None] * np.array(self.velocity)

    def rate(self, time: np.ndarray) -> np.ndarray:  # noqa: D102
        return np.broadcast_to(np.array(self.velocity), (len(time), 3))

    @property
    def largest_rate(self) -> float:  # noqa: D102
        return float(np.linalg.norm(self.velocity))


class Oscillate(Translation):
    """x0 + A sin(2 pi t/T): it starts in the middle, at its largest speed 2 pi A/T."""

    type: Literal["oscillate"]
    """Type of motion."""
    amplitude: Annotated[Vector, vector("m", nonzero=True)]
    """A, with its direction [m]."""
    period: Annotated[float, positive("s")]
    """T [s]."""

    def way(self, time: np.ndarray) -> np.ndarray:  # noqa: D102
        phase = 2 * math.pi * time / self.period
        return np.sin(phase)[:, None] * np.array(self.amplitude)

    def rate(self, time: np.ndarray) -> np.ndarray:  # noqa: D102
        omega = 2 * math.pi / self.period
        return (omega * np.cos(omega * time))[:, None] * np.array(self.amplitude)  # mutate: oscillation_rate

    @property
    def largest_rate(self) -> float:  # noqa: D102
        return 2 * math.pi / self.period * float(np.linalg.norm(self.amplitude))

    def farthest(self, duration: float) -> float:  # noqa: D102
        return float(np.linalg.norm(self.amplitude))


class Rotate(Turn):
    """Constant angular velocity 2 pi/T about the axis: angle 2 pi t/T."""

    exact: ClassVar[bool] = True
    type: Literal["rotate"]
    """Type of motion."""
    period: Annotated[float, positive("s")]
    """Time of one turn T [s]."""

    def way(self, time: np.ndarray) -> np.ndarray:  # noqa: D102
        return 2 * math.pi * time / self.period

    def rate(self, time: np.ndarray) -> np.ndarray:  # noqa: D102
        return np.full(len(time), 2 * math.pi / self.period)

    @property
    def largest_rate(self) -> float:  # noqa: D102
        return 2 * math.pi / self.period


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
        return self.amplitude * omega * np.cos(omega * time)  # mutate: swing_rate

    @property
    def largest_rate(self) -> float:  # noqa: D102
        return 2 * math.pi / self.period * self.amplitude

    def farthest(self, duration: float) -> float:  # noqa: D102
        return self.amplitude


def _integral(time: np.ndarray, knots: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Integral from 0 of the piecewise linear function through (knots, values); constant beyond them."""
    times = np.concatenate([[0.0], knots[knots > 0]])
    at = np.interp(times, knots, values)
    sums = np.concatenate([[0.0], np.cumsum(np.diff(times) * (at[1:] + at[:-1]) / 2)])
    k = np.clip(np.searchsorted(times, time, side="right") - 1, 0, len(times) - 1)
    here = np.interp(time, knots, values)
    return sums[k] + (time - times[k]) * (at[k] + here) / 2  # mutate: integral_of_table


class _Table(_Motion):
    """Velocity given at times, linear between them, constant before and after."""

    type: Literal["table"]
    """Type of motion."""
    time: Annotated[np.ndarray, array(0, "s")]
    """Times, ascending [s]; before the first and after the last the velocity is constant."""

    @field_validator("time")
    @classmethod
    def _ascends(cls, time: np.ndarray) -> np.ndarray:
        if len(time) == 0:
            raise ValueError("has no rows; at least one is needed [s]")
        if (np.diff(time) <= 0).any():
            row = int(np.argmax(np.diff(time) <= 0)) + 1
            raise ValueError(f"must ascend; row {row + 1}, {time[row]:g}, is not above {time[row - 1]:g} [s]")
        return time


def _one_row_a_time(values: np.ndarray, info: ValidationInfo) -> np.ndarray:
    time = info.data.get("time")
    if time is not None and len(values) != len(time):
        raise ValueError(f"has {len(values)} rows for {len(time)} times")
    return values


class TranslationTable(_Table, Translation):
    """A table of velocities, linear between its rows; the displacement is their integral from t = 0."""

    velocity: Annotated[np.ndarray, array(3, "m/s"), AfterValidator(_one_row_a_time)]
    """Velocity at each time [m/s], shape (k, 3)."""

    def way(self, time: np.ndarray) -> np.ndarray:  # noqa: D102
        return np.stack([_integral(time, self.time, column) for column in self.velocity.T], axis=1)

    def rate(self, time: np.ndarray) -> np.ndarray:  # noqa: D102
        return np.stack([np.interp(time, self.time, column) for column in self.velocity.T], axis=1)

    @property
    def largest_rate(self) -> float:  # noqa: D102
        return float(np.linalg.norm(self.velocity, axis=1).max())


class TurnTable(_Table, Turn):
    """A table of angular velocities about an axis; the angle is their integral from t = 0."""

    tag: ClassVar[str] = "table of angular velocity"
    angular_velocity: Annotated[np.ndarray, array(0, "rad/s"), AfterValidator(_one_row_a_time)]
    """Angular velocity at each time [rad/s], shape (k,)."""

    def way(self, time: np.ndarray) -> np.ndarray:  # noqa: D102
        return _integral(time, self.time, self.angular_velocity)

    def rate(self, time: np.ndarray) -> np.ndarray:  # noqa: D102
        return np.interp(time, self.time, self.angular_velocity)

    @property
    def largest_rate(self) -> float:  # noqa: D102
        return float(np.abs(self.angular_velocity).max())


class Servo(Translation):
    """Moves along an axis so that the particles press on the wall with a given force.

        e = 1 - F/target,   v = velocity_limit clip(kp e + ki integral e dt + kd de/dt, -1, 1)

    F is the force on the wall at the end of the last step, positive against the axis. The wall rests in the
    first step. So does a servo that a phase begins, whose integral counts from there. Before its first step
    e counts as 1, that without a force. Source: LIGGGHTS manual, fix mesh/surface/stress/servo; black-box
    runs of 3.8.0.
    """

    type: Literal["servo"]
    """Type of motion."""
    axis: Annotated[Vector, vector("1", nonzero=True)]
    """Direction in which it moves to press harder, of any length."""
    target: Annotated[float, positive("N")]
    """The force [N]."""
    velocity_limit: Annotated[float, positive("m/s")]
    """Largest speed [m/s]."""
    kp: Annotated[float, number("1", 0)] = 0.5
    """Proportional gain [1]: 0.5 approaches at half the largest speed."""
    ki: Annotated[float, number("1/s", 0)] = 0.0
    """Integral gain [1/s]."""
    kd: Annotated[float, number("s", 0)] = 0.0
    """Derivative gain [s]."""

    @property
    def unit_axis(self) -> np.ndarray:
        """The axis with length one."""
        return _unit(self.axis)

    def way(self, time: np.ndarray) -> np.ndarray:
        """None, for where it goes only the run can tell; it starts at rest."""
        return np.zeros((len(time), 3))

    rate = way

    @property
    def largest_rate(self) -> float:
        """Its limit [m/s]."""
        return self.velocity_limit

    def farthest(self, duration: float) -> float:
        """At its limit all the time [m]."""
        return self.velocity_limit * duration


#: Types of motion by name, in the order in which they are listed; a table is of velocity or angular velocity.
TYPES: dict[str, type[_Motion]] = {
    "linear": Linear, "oscillate": Oscillate, "rotate": Rotate, "swing": Swing, "table": TranslationTable,
    "servo": Servo, TurnTable.tag: TurnTable,
}  # fmt: skip


def _tag_of(value: Any) -> str | None:
    """The name in TYPES of a motion: of a table with keys of a turn, that of the turn."""
    if isinstance(value, _Motion):
        return next((name for name, kind in TYPES.items() if isinstance(value, kind)), None)
    turning = value["type"] == "table" and not {"angular_velocity", "axis", "point"}.isdisjoint(value)
    return TurnTable.tag if turning else value["type"]


def _typed(value: Any) -> Any:
    """A motion, or a table that names a known type. Raises what `gpudem.scene.files` words."""
    if isinstance(value, _Motion):
        return value
    if not isinstance(value, dict):
        raise ValueError("must be a table")
    if "type" not in value:
        raise PydanticCustomError("union_tag_not_found", "no type", {"discriminator": "'type'"})
    if value["type"] not in [name for name in TYPES if name != TurnTable.tag]:
        context = {"discriminator": "'type'", "tag": str(value["type"])}
        raise PydanticCustomError("union_tag_invalid", "unknown type", context)
    return value


Motion = Annotated[
    Annotated[Linear, Tag("linear")]
    | Annotated[Oscillate, Tag("oscillate")]
    | Annotated[Rotate, Tag("rotate")]
    | Annotated[Swing, Tag("swing")]
    | Annotated[TranslationTable, Tag("table")]
    | Annotated[Servo, Tag("servo")]
    | Annotated[TurnTable, Tag(TurnTable.tag)],
    Discriminator(_tag_of),
    BeforeValidator(_typed),
]


def largest_speed(
    motions: Sequence[Translation | Turn], points: np.ndarray | None, corners: np.ndarray, duration: float
) -> float:
    """An upper bound of the speed [m/s] of any point of a wall within the domain, in a run of a duration [s].

    points: points of the wall at the start whose hull holds it [m], shape (p, 3); None for a wall without
    ends. corners: those of the domain [m], shape (8, 3). Largest speeds of the translations, and of each turn
    its largest angular speed times the distance from its axis, of the wall where that stays, or else of the
    farthest corner.
    """
    total = 0.0
    for m, motion in enumerate(motions):
        if isinstance(motion, Turn):
            carried = sum(before.farthest(duration) for before in motions[:m] if not before.turns)
            reach = _from_axis(motion, corners) + carried
            if points is not None and m == len(motions) - 1 and not any(b.turns for b in motions[:m]):
                reach = min(reach, _from_axis(motion, points))
            total += motion.largest_rate * reach
        else:
            total += motion.largest_rate
    return total


def _from_axis(turn: Turn, points: np.ndarray) -> float:
    """The largest distance of points from the axis of a turn [m]."""
    return float(np.linalg.norm(np.cross(points - np.array(turn.point), turn.unit_axis), axis=1).max())
