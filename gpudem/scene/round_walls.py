"""Cylinders and cones: shells of no thickness that particles touch from inside and from outside."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import model_validator

from gpudem.scene.types import Vector, number, positive, vector
from gpudem.scene.walls import Wall, box_corners

#: Quads around an axis in the outline.
SIDES = 48


class Round(Wall):
    """A wall of revolution: its cross-section through the axis is a segment in the half-plane (rho, z)."""

    point: Annotated[Vector, vector("m")]
    """Where the axis begins [m]: the center of the first end."""
    axis: Annotated[Vector, vector("1", nonzero=True)]
    """Direction of the axis, of any length, towards the second end."""

    @property
    def unit_axis(self) -> np.ndarray:
        """The axis with length one."""
        axis = np.array(self.axis)
        return axis / np.linalg.norm(axis)

    def _section(self) -> tuple[float, float, float]:
        """(radius at the first end, radius at the second [m], length [m], 0 for infinite)."""
        raise NotImplementedError

    def gap(self, points: np.ndarray) -> np.ndarray:
        """Distance [m] from the shell."""
        first, second, length = self._section()
        d = points - np.array(self.point)
        z = d @ self.unit_axis
        rho = np.linalg.norm(d - z[:, None] * self.unit_axis, axis=1)
        if length == 0:
            return np.abs(rho - first)
        widening = second - first
        share = np.clip(((rho - first) * widening + z * length) / (widening**2 + length**2), 0, 1)
        return np.hypot(rho - first - share * widening, z - share * length)

    def outline(self, lo: np.ndarray, hi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A ring of quads; an infinite one as long as the domain."""
        first, second, length = self._section()
        axis, begin = self.unit_axis, np.array(self.point)
        if length == 0:
            heights = (box_corners(lo, hi) - begin) @ axis
            begin, length = begin + heights.min() * axis, float(np.ptp(heights))
        u = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        u /= np.linalg.norm(u)
        angle, k = np.linspace(0, 2 * np.pi, SIDES, endpoint=False), np.arange(SIDES)
        ring = np.outer(np.cos(angle), u) + np.outer(np.sin(angle), np.cross(axis, u))
        points = np.concatenate([begin + first * ring, begin + length * axis + second * ring])
        after = (k + 1) % SIDES
        return points, np.stack([k, after, after + SIDES, k + SIDES], axis=1)

    def marks(self, rotation: np.ndarray, shift: np.ndarray, lo: np.ndarray, hi: np.ndarray) -> np.ndarray:
        """Of an infinite one the points of the axis nearest to the domain's corners.

        Else the ends of the axis, and its direction times the largest radius. A turn about its own axis
        changes neither.
        """
        first, second, length = self._section()
        axis, begin = rotation @ self.unit_axis, rotation @ np.array(self.point) + shift
        if length == 0:
            heights = np.einsum("kpd,kd->kp", box_corners(lo, hi) - begin[:, None], axis)
            return begin[:, None] + heights[:, :, None] * axis[:, None]  # mutate: foot_on_axis
        return np.stack([begin, begin + length * axis, max(first, second) * axis], axis=1)

    def moved(self, marks: np.ndarray, before: np.ndarray) -> np.ndarray:
        """Of a finite one the farthest way of an end, and what a rim turns beside it."""
        if self._section()[2] == 0:
            return super().moved(marks, before)
        way = np.linalg.norm(marks - before, axis=2)
        return np.maximum(way[:, 0], way[:, 1]) + way[:, 2]

    def bounds(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Lower and upper corner [m]; None for an infinite one."""
        first, second, length = self._section()
        if length == 0:
            return None
        across = np.sqrt(np.maximum(0.0, 1 - self.unit_axis**2))  # of a circle of radius one about the axis
        begin, end = np.array(self.point), np.array(self.point) + length * self.unit_axis
        low = np.minimum(begin - first * across, end - second * across)
        return low, np.maximum(begin + first * across, end + second * across)


class Cylinder(Round):
    """Shell of a cylinder, touched from both sides: gap = |rho - radius|; without `length` it is infinite."""

    kind: Literal["cylinder"] = "cylinder"  # type: ignore[assignment]
    """Kind of wall."""
    radius: Annotated[float, positive("m")]
    """Radius [m]."""
    length: Annotated[float, positive("m")] | None = None
    """Length [m] along the axis from `point`; its ends are open. Default: infinite in both directions."""

    def _section(self) -> tuple[float, float, float]:
        return self.radius, self.radius, self.length or 0.0

    def shape(self) -> tuple[Vector, Vector, Vector]:
        """(axis, point, (radius, length or 0, 0))."""
        x, y, z = self.unit_axis.tolist()
        return (x, y, z), self.point, (self.radius, self.length or 0.0, 0.0)


class Cone(Round):
    """Frustum of a cone, touched from both sides; its ends are open."""

    kind: Literal["cone"] = "cone"  # type: ignore[assignment]
    """Kind of wall."""
    radius: Annotated[float, number("m", 0)]
    """Radius at `point` [m]."""
    end_radius: Annotated[float, number("m", 0)]
    """Radius at the second end [m]; 0: the tip of a cone."""
    length: Annotated[float, positive("m")]
    """Length [m] along the axis from `point`."""

    @model_validator(mode="after")
    def _has_a_surface(self) -> Cone:
        if self.radius == 0 and self.end_radius == 0:
            raise ValueError("end_radius = 0: must be above 0 where radius = 0 [m]")
        return self

    def _section(self) -> tuple[float, float, float]:
        return self.radius, self.end_radius, self.length

    def shape(self) -> tuple[Vector, Vector, Vector]:
        """(axis, point, (radius, end radius, length))."""
        x, y, z = self.unit_axis.tolist()
        return (x, y, z), self.point, (self.radius, self.end_radius, self.length)
