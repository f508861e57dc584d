"""Regions of space that particles are inserted into, and faces that they are inserted through.

A region has a depth: the distance [m] of a point from its surface, positive inside, negative outside. A
particle is in a region where the depth of its center is at least its radius, so that the whole particle is
inside. Of unions and cuts the depth is a lower bound: no particle that reaches out is taken to be inside, but
neither is one that lies across the common side of two parts of a union.
"""

from __future__ import annotations

import functools
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, Field, PlainValidator, SerializeAsAny, model_validator

from gpudem.scene.files import OneOf
from gpudem.scene.mesh import Mesh, Placement
from gpudem.scene.mesh_distance import distance_to_triangles
from gpudem.scene.types import Model, Vector, number, of_kind, positive, vector

#: Points at which the volume of a union or a cut is measured: 2 to this power, of a Sobol sequence.
VOLUME_POINTS = 17
#: Pairs of a point and a triangle at once: some 50 MB.
CHUNK = 500_000
#: Largest |cosine| of the angle between the edges of a rectangle.
SKEW = 1e-9


class Region(Model):
    """Part of space; `kind` names the class."""

    kind: str
    """Kind of region."""

    def depth(self, points: np.ndarray) -> np.ndarray:
        """Distance [m] from the surface of points, shape (n, 3): positive inside; at most the exact one."""
        raise NotImplementedError

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper corner [m]."""
        raise NotImplementedError

    @property
    def volume(self) -> float:
        """Volume [m3]."""
        raise NotImplementedError

    def points(self, uniform: np.ndarray) -> np.ndarray:
        """Points [m] uniformly in the box around it, from numbers of [0, 1), shape (n, 3)."""
        low, high = self.bounds()
        return low + uniform * (high - low)


class Block(Region):
    """Axis-aligned box."""

    kind: Literal["block"]  # type: ignore[assignment]
    """Kind of region."""
    lo: Annotated[Vector, vector("m")]
    """Lower corner [m]."""
    hi: Annotated[Vector, vector("m")]
    """Upper corner [m]."""

    @model_validator(mode="after")
    def _not_empty(self) -> Block:
        if not all(b > a for a, b in zip(self.lo, self.hi, strict=True)):
            raise ValueError(f"hi = {self.hi}: must be above lo = {self.lo} in x, y and z [m]")
        return self

    def depth(self, points: np.ndarray) -> np.ndarray:
        """Distance [m] from the surface, positive inside."""
        inner = np.minimum(points - np.array(self.lo), np.array(self.hi) - points)
        outside = np.minimum(inner, 0.0)
        return np.where((inner >= 0).all(axis=1), inner.min(axis=1), -_length(outside))

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Its corners [m]."""
        return np.array(self.lo), np.array(self.hi)

    @property
    def volume(self) -> float:
        """Volume [m3]."""
        return float(np.prod(np.array(self.hi) - np.array(self.lo)))


class Sphere(Region):
    """Ball."""

    kind: Literal["sphere"]  # type: ignore[assignment]
    """Kind of region."""
    center: Annotated[Vector, vector("m")]
    """Center [m]."""
    radius: Annotated[float, positive("m")]
    """Radius [m]."""

    def depth(self, points: np.ndarray) -> np.ndarray:
        """Distance [m] from the surface, positive inside."""
        return self.radius - _length(points - np.array(self.center))

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners [m] of the box around it."""
        return np.array(self.center) - self.radius, np.array(self.center) + self.radius

    @property
    def volume(self) -> float:
        """Volume [m3]."""
        return 4 / 3 * np.pi * self.radius**3


class _Round(Region):
    """Body of revolution with two flat ends, of radii that may differ."""

    point: Annotated[Vector, vector("m")]
    """Center of the first end [m]."""
    axis: Annotated[Vector, vector("1", nonzero=True)]
    """Direction of the axis, of any length, towards the second end."""
    length: Annotated[float, positive("m")]
    """Length along the axis [m]."""
    radius: Annotated[float, number("m", 0)]
    """Radius [m]; of a cone at `point`."""

    @property
    def _end(self) -> float:
        return self.radius

    def depth(self, points: np.ndarray) -> np.ndarray:
        """Distance [m] from the surface, positive inside."""
        axis, d = _unit(self.axis), points - np.array(self.point)
        z = _dot(d, axis)
        rho = _length(d - z[:, None] * axis)
        first, second, length = self.radius, self._end, self.length
        corners = np.array([(0.0, 0.0), (first, 0.0), (second, length), (0.0, length)])
        distance = np.min([_to_segment(rho, z, corners[k], corners[k + 1]) for k in range(3)], axis=0)
        inside = (z >= 0) & (z <= length) & (rho <= first + (second - first) * z / length)
        return np.where(inside, distance, -distance)

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners [m] of the box around it."""
        axis, begin = _unit(self.axis), np.array(self.point)
        across, end = np.sqrt(np.maximum(0.0, 1 - axis**2)), begin + self.length * axis
        low = np.minimum(begin - self.radius * across, end - self._end * across)
        return low, np.maximum(begin + self.radius * across, end + self._end * across)

    @property
    def volume(self) -> float:
        """Volume [m3]."""
        a, b = self.radius, self._end
        return np.pi / 3 * self.length * (a * a + a * b + b * b)


class Cylinder(_Round):
    """Circular cylinder with two flat ends."""

    kind: Literal["cylinder"]  # type: ignore[assignment]
    """Kind of region."""
    radius: Annotated[float, positive("m")]  # type: ignore[assignment]
    """Radius [m]."""


class Cone(_Round):
    """Frustum of a circular cone."""

    kind: Literal["cone"]  # type: ignore[assignment]
    """Kind of region."""
    end_radius: Annotated[float, number("m", 0)]
    """Radius of the second end [m]; 0: a tip."""

    @model_validator(mode="after")
    def _has_a_volume(self) -> Cone:
        if not self.radius and not self.end_radius:
            raise ValueError("end_radius = 0.0: radius is 0 too; allowed: one of the two above 0 [m]")
        return self

    @property
    def _end(self) -> float:
        return self.end_radius


class MeshRegion(Region):
    """Inside of a closed surface of triangles; first scaled, then rotated, then moved."""

    kind: Literal["mesh"]  # type: ignore[assignment]
    """Kind of region."""
    file: Annotated[str, AfterValidator(os.path.abspath)]
    """STL, OBJ, PLY, VTK or NPZ, as of a wall; a relative path counts from the scene file."""
    scale: Annotated[float, positive("1")] = 1.0
    """Factor on every coordinate: 0.001 for a file in millimeters."""
    rotate: Placement | None = None
    """Rotation, after scaling."""
    move: Annotated[Vector, vector("m")] = (0.0, 0.0, 0.0)
    """Displacement, last [m]."""

    @functools.cached_property
    def corners(self) -> np.ndarray:
        """Corners of every triangle [m], shape (k, 3, 3). Raises ValueError: not a closed surface."""
        import trimesh

        wall = Mesh(name="region", material="region", **self.model_dump(exclude={"kind"}))
        shape = trimesh.Trimesh(wall.surface.points, wall.surface.rows, process=False, validate=False)
        if not shape.is_watertight:
            raise ValueError(f"file = {Path(self.file).name!r}: not closed: an edge with one triangle only")
        if not shape.is_winding_consistent:
            raise ValueError(f"file = {Path(self.file).name!r}: neighboring triangles face opposite ways")
        return wall.corners

    def depth(self, points: np.ndarray) -> np.ndarray:
        """Distance [m] from the surface, positive inside."""
        low, high = self.bounds()
        distance = distance_to_triangles(points, self.corners)
        near = ((points >= low) & (points <= high)).all(axis=1)
        inside = np.zeros(len(points), bool)
        inside[near] = np.abs(winding_number(points[near], self.corners)) > 0.5
        return np.where(inside, distance, -distance)

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners [m] of the box around it."""
        return self.corners.min(axis=(0, 1)), self.corners.max(axis=(0, 1))

    @property
    def volume(self) -> float:
        """Volume [m3], by the divergence theorem."""
        a, b, c = (self.corners - self.corners[0, 0]).swapaxes(0, 1)
        return abs(float(_dot(a, np.cross(b, c)).sum())) / 6


class _Composed(Region):
    """Made of other regions; its volume is measured at points."""

    @functools.cached_property
    def _measured(self) -> float:
        from scipy.stats import qmc

        points = self.points(qmc.Sobol(3, scramble=False).random_base2(VOLUME_POINTS))
        low, high = self.bounds()
        return float(np.prod(high - low) * np.mean(self.depth(points) >= 0))

    @property
    def volume(self) -> float:
        """Volume [m3], at 2**VOLUME_POINTS points of a Sobol sequence."""
        return self._measured


class Union(_Composed):
    """All that is in one of several regions."""

    kind: Literal["union"]  # type: ignore[assignment]
    """Kind of region."""
    parts: Annotated[tuple[RegionSection, ...], Field(min_length=1)]
    """The regions."""

    def depth(self, points: np.ndarray) -> np.ndarray:
        """Largest of the parts' depths [m]; inside, a lower bound of the distance from the surface."""
        return np.max([part.depth(points) for part in self.parts], axis=0)

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners [m] of the box around the parts."""
        low, high = zip(*(part.bounds() for part in self.parts), strict=True)
        return np.min(low, axis=0), np.max(high, axis=0)


class Cut(_Composed):
    """What is left of a region without another one."""

    kind: Literal["cut"]  # type: ignore[assignment]
    """Kind of region."""
    part: RegionSection
    """What is cut."""
    without: RegionSection
    """What is taken away."""

    def depth(self, points: np.ndarray) -> np.ndarray:
        """The smaller of the depth in one and the distance from the other [m]."""
        return np.minimum(self.part.depth(points), -self.without.depth(points))  # mutate: region_cut

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners [m] of the box around what is cut."""
        return self.part.bounds()


#: The class of each kind of region.
REGIONS: dict[str, type[Region]] = {
    "block": Block, "sphere": Sphere, "cylinder": Cylinder, "cone": Cone, "mesh": MeshRegion, "union": Union,
    "cut": Cut,
}  # fmt: skip


if TYPE_CHECKING:
    RegionSection = Region
else:
    RegionSection = Annotated[
        SerializeAsAny[Model],
        PlainValidator(of_kind(lambda kind: REGIONS.get(kind), Region)),
        OneOf(lambda: REGIONS),
    ]
    Union.model_rebuild()
    Cut.model_rebuild()


# -- faces ---------------------------------------------------------------------------------------------------


class Face(Region):
    """Flat piece of a plane: the whole cross-section of a particle lies within it."""

    @property
    def normal(self) -> np.ndarray:
        """Unit normal."""
        raise NotImplementedError

    @property
    def middle(self) -> np.ndarray:
        """Center [m]."""
        low, high = self.bounds()
        return (low + high) / 2

    def inner_area(self, radius: float) -> float:
        """Area [m2] in which centers of particles of this radius [m] may lie."""
        raise NotImplementedError


class Disc(Face):
    """Circular face."""

    kind: Literal["disc"]  # type: ignore[assignment]
    """Kind of face."""
    center: Annotated[Vector, vector("m")]
    """Center [m]."""
    axis: Annotated[Vector, vector("1", nonzero=True)]
    """Normal of the face, of any length and either sign."""
    radius: Annotated[float, positive("m")]
    """Radius [m]."""

    @property
    def normal(self) -> np.ndarray:
        """Unit normal."""
        return _unit(self.axis)

    def _edges(self) -> tuple[np.ndarray, np.ndarray]:
        n = self.normal
        u = _unit(np.cross(n, np.eye(3)[np.argmin(np.abs(n))]))
        return u, np.cross(n, u)

    def points(self, uniform: np.ndarray) -> np.ndarray:
        """Points [m] of the square around it."""
        u, v = self._edges()
        a, b = (self.radius * (2 * uniform[:, k, None] - 1) for k in (0, 1))
        return np.array(self.center) + a * u + b * v

    def depth(self, points: np.ndarray) -> np.ndarray:
        """Distance [m] of points of its plane from the rim, positive inside."""
        return self.radius - _length(points - np.array(self.center))

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners [m] of the box around it."""
        across = self.radius * np.sqrt(np.maximum(0.0, 1 - self.normal**2))
        return np.array(self.center) - across, np.array(self.center) + across

    def inner_area(self, radius: float) -> float:
        """Area [m2] in which centers of particles of this radius [m] may lie."""
        return np.pi * max(0.0, self.radius - radius) ** 2


class Rectangle(Face):
    """Rectangular face."""

    kind: Literal["rectangle"]  # type: ignore[assignment]
    """Kind of face."""
    corner: Annotated[Vector, vector("m")]
    """One corner [m]."""
    edges: tuple[Annotated[Vector, vector("m", nonzero=True)], Annotated[Vector, vector("m", nonzero=True)]]
    """The two edges that begin there [m], at a right angle."""

    @model_validator(mode="after")
    def _right_angle(self) -> Rectangle:
        a, b = map(np.array, self.edges)
        if abs(float(a @ b)) > SKEW * float(np.linalg.norm(a) * np.linalg.norm(b)):
            raise ValueError(f"edges = {self.edges}: not at a right angle")
        return self

    @property
    def normal(self) -> np.ndarray:
        """Unit normal."""
        return _unit(np.cross(*self.edges))

    def points(self, uniform: np.ndarray) -> np.ndarray:
        """Points [m] of the rectangle."""
        return (np.array(self.corner) + uniform[:, 0, None] * np.array(self.edges[0])
                + uniform[:, 1, None] * np.array(self.edges[1]))  # fmt: skip

    def depth(self, points: np.ndarray) -> np.ndarray:
        """Distance [m] of points of its plane from the nearest edge, positive inside."""
        found, d = [], points - np.array(self.corner)
        for edge in self.edges:
            along = _dot(d, _unit(edge))
            found += [along, float(_length(np.array([edge]))[0]) - along]
        return np.min(found, axis=0)

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners [m] of the box around it."""
        a, b = map(np.array, self.edges)
        corners = np.array(self.corner) + np.array([0 * a, a, b, a + b])
        return corners.min(axis=0), corners.max(axis=0)

    def inner_area(self, radius: float) -> float:
        """Area [m2] in which centers of particles of this radius [m] may lie."""
        sides = [max(0.0, float(np.linalg.norm(edge)) - 2 * radius) for edge in self.edges]
        return sides[0] * sides[1]


#: The class of each kind of face.
FACES: dict[str, type[Face]] = {"disc": Disc, "rectangle": Rectangle}

if TYPE_CHECKING:
    FaceSection = Face
else:
    FaceSection = Annotated[
        SerializeAsAny[Model],
        PlainValidator(of_kind(lambda kind: FACES.get(kind), Face)),
        OneOf(lambda: FACES),
    ]


# -- geometry: sums of three products in a stated order, so that every machine gets the same bits ------------


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def _length(d: np.ndarray) -> np.ndarray:
    return np.sqrt(_dot(d, d))


def _unit(axis: Any) -> np.ndarray:
    axis = np.array(axis, np.float64)
    return axis / _length(axis)


def _to_segment(x: np.ndarray, y: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Distance of points (x, y) of a plane from the segment a-b."""
    (dx, dy), length2 = b - a, float((b - a)[0] ** 2 + (b - a)[1] ** 2)
    if length2 == 0:
        return np.hypot(x - a[0], y - a[1])
    share = np.clip(((x - a[0]) * dx + (y - a[1]) * dy) / length2, 0, 1)
    return np.hypot(x - a[0] - share * dx, y - a[1] - share * dy)


def winding_number(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """How often a closed surface winds around points: +-1 inside, 0 outside.

    Sum of the solid angles of its triangles, shape (k, 3, 3), over 4 pi; each by A. Van Oosterom and
    J. Strackee, IEEE Trans. Biomed. Eng. 30 (1983) 125.
    """
    found, step = np.empty(len(points)), max(1, CHUNK // max(1, len(corners)))
    for k in range(0, len(points), step):
        a, b, c = (corners[None] - points[k : k + step, None, None]).transpose(2, 0, 1, 3)
        la, lb, lc = _length(a), _length(b), _length(c)
        volume = _dot(a, np.cross(b, c))
        below = la * lb * lc + _dot(a, b) * lc + _dot(b, c) * la + _dot(c, a) * lb
        found[k : k + step] = np.arctan2(volume, below).sum(axis=1) / (2 * np.pi)
    return found
