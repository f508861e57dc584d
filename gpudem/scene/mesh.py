"""A wall of triangles: `kind = "mesh"`, from a file or from arrays, scaled, turned and moved into place."""

from __future__ import annotations

import functools
import os
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, model_validator

from gpudem.scene.mesh_distance import distance_to_triangles
from gpudem.scene.mesh_files import Triangles, read_mesh
from gpudem.scene.mesh_repair import Surface, repaired
from gpudem.scene.motion import rotations
from gpudem.scene.types import Model, Vector, array, indices, number, positive, vector
from gpudem.scene.walls import Wall, box_corners

#: Corners of a hull up to which it is used to say how far a mesh moves.
MAX_HULL = 256


class Placement(Model):
    """A turn about an axis through a point."""

    axis: Annotated[Vector, vector("1", nonzero=True)]
    """Direction of the axis, of any length."""
    angle: Annotated[float, number("deg")]
    """Angle by the right-hand rule [deg]."""
    point: Annotated[Vector, vector("m")] = (0.0, 0.0, 0.0)
    """A point of the axis [m]."""


class Mesh(Wall):
    """Triangles, from a file or as stated, touched from both sides; first scaled, then turned, then moved."""

    kind: Literal["mesh"] = "mesh"  # type: ignore[assignment]
    """Kind of wall."""
    file: Annotated[str, AfterValidator(os.path.abspath)] | None = None
    """STL (ASCII or binary), OBJ, PLY, VTK or NPZ (`gpudem.scene.mesh_files`); a relative path counts from
    the scene file."""
    vertices: Annotated[np.ndarray, array(3, "m")] | None = None
    """In the place of a file: vertices [m], shape (p, 3)."""
    triangles: Annotated[np.ndarray, indices(3)] | None = None
    """The three rows of `vertices` of each triangle, from 0, shape (k, 3)."""
    scale: Annotated[float, positive("1")] = 1.0
    """Factor on every coordinate: 0.001 for a file in millimetres."""
    rotate: Placement | None = None
    """Turn, after scaling."""
    move: Annotated[Vector, vector("m")] = (0.0, 0.0, 0.0)
    """Displacement, last [m]."""

    @model_validator(mode="after")
    def _one_source(self) -> Mesh:
        given = [key for key in ("vertices", "triangles") if getattr(self, key) is not None]
        if self.file is not None and given:
            raise ValueError(f"file = {self.file!r}: beside {' and '.join(given)}; state one of the two")
        if self.file is None and not given:
            raise ValueError("file: missing; state file, or vertices and triangles")
        if len(given) == 1:
            missing = "triangles" if given == ["vertices"] else "vertices"
            raise ValueError(f"{missing}: missing beside {given[0]}")
        return self

    @functools.cached_property
    def stated(self) -> Triangles:
        """(vertices, rows) as the file or the scene states them. Raises ValueError: an unusable file."""
        if self.vertices is not None and self.triangles is not None:
            return self.vertices, self.triangles
        assert self.file is not None
        return read_mesh(Path(self.file))

    @functools.cached_property
    def surface(self) -> Surface:
        """The triangles after repair, and what was repaired. Raises ValueError: nothing usable."""
        return repaired(*self.stated)

    @functools.cached_property
    def corners(self) -> np.ndarray:
        """Corners of every triangle in place [m], shape (k, 3, 3). Raises ValueError: an unusable mesh."""
        points = self.surface.points * self.scale
        if self.rotate is not None:
            axis, point = np.array(self.rotate.axis), np.array(self.rotate.point)
            turn = rotations(axis / np.linalg.norm(axis), np.radians([self.rotate.angle]))[0]
            points = (points - point) @ turn.T + point
        corners = (points + np.array(self.move))[self.surface.rows]
        corners.setflags(write=False)
        return corners

    def reach_points(self) -> np.ndarray:
        """Corners of its convex hull or, where they are many or lie in a plane, of the box around it [m]."""
        return self._hull

    @functools.cached_property
    def _hull(self) -> np.ndarray:
        from scipy.spatial import ConvexHull, QhullError

        points = np.unique(self.corners.reshape(-1, 3), axis=0)
        try:
            found = points[ConvexHull(points).vertices]
        except QhullError:  # a flat mesh
            found = points
        return found if len(found) <= MAX_HULL else box_corners(points.min(axis=0), points.max(axis=0))

    def shape(self) -> tuple[Vector, Vector, Vector]:
        """Nothing: a mesh has tables of its own."""
        zero = (0.0, 0.0, 0.0)
        return zero, zero, zero

    def gap(self, points: np.ndarray) -> np.ndarray:
        """Distance [m] from the nearest triangle."""
        return distance_to_triangles(points, self.corners)

    def overlap(self, points: np.ndarray, radius: np.ndarray) -> np.ndarray:
        """Overlap [m] at the nearest point of the mesh; -inf for particles far from it."""
        found = np.full(len(points), -np.inf)
        low, high = self.bounds()
        reach = float(radius.max(initial=0.0))
        near = ((points > low - reach) & (points < high + reach)).all(axis=1)
        found[near] = radius[near] - distance_to_triangles(points[near], self.corners, reach)
        return found

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper corner [m]."""
        return self.corners.min(axis=(0, 1)), self.corners.max(axis=(0, 1))

    def outline(self, lo: np.ndarray, hi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The triangles, as quads whose last two corners agree."""
        rows = np.arange(3 * len(self.corners)).reshape(-1, 3)
        return self.corners.reshape(-1, 3), rows[:, [0, 1, 2, 2]]
