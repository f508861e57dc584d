"""A wall of triangles: `kind = "mesh"`, from a file or from arrays, scaled, turned and moved into place."""

from __future__ import annotations

import functools
import math
import os
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator

from gpudem.scene.motion import rotations
from gpudem.scene.types import Model, Vector, array, number, positive, vector
from gpudem.scene.walls import Wall


class Placement(Model):
    """A turn about an axis through a point."""

    axis: Annotated[Vector, vector("1", nonzero=True)]
    """Direction of the axis, of any length."""
    angle: Annotated[float, number("deg")]
    """Angle by the right-hand rule [deg]."""
    point: Annotated[Vector, vector("m")] = (0.0, 0.0, 0.0)
    """A point of the axis [m]."""


class Mesh(Wall):
    """Triangles; contact from both sides. First scaled, then turned, then moved."""

    kind: Literal["mesh"] = "mesh"  # type: ignore[assignment]
    """Kind of wall."""
    file: Annotated[str, AfterValidator(os.path.abspath)] | None = None
    """STL (ASCII or binary), OBJ, PLY or VTK; a relative path counts from the scene file."""
    vertices: Annotated[np.ndarray, array(3, "m")] | None = None
    """In the place of a file: corners [m], shape (p, 3)."""
    triangles: Annotated[np.ndarray, array(3, "1")] | None = None
    """Rows of `vertices` of each triangle, from 0, shape (k, 3)."""
    scale: Annotated[float, positive("1")] = 1.0
    """Factor on every coordinate: 0.001 for a file in millimetres."""
    rotate: Placement | None = None
    """Turn, after scaling."""
    move: Annotated[Vector, vector("m")] = (0.0, 0.0, 0.0)
    """Displacement, last [m]."""

    @functools.cached_property
    def corners(self) -> np.ndarray:
        """Corners of every triangle in place [m], shape (k, 3, 3)."""
        points, triangles = self._stated
        points = points * self.scale
        if self.rotate is not None:
            axis, point = np.array(self.rotate.axis), np.array(self.rotate.point)
            turn = rotations(axis / np.linalg.norm(axis), np.radians([self.rotate.angle]))[0]
            points = (points - point) @ turn.T + point
        return (points + np.array(self.move))[triangles]

    @property
    def _stated(self) -> tuple[np.ndarray, np.ndarray]:
        if self.file is not None:
            return read_mesh(Path(self.file))
        if self.vertices is None or self.triangles is None:
            raise ValueError(f"walls: {self.name}: state `file`, or `vertices` and `triangles`")
        return self.vertices, self.triangles.astype(np.int64)

    def shape(self) -> tuple[Vector, Vector, Vector]:
        """Nothing: a mesh has tables of its own."""
        zero = (0.0, 0.0, 0.0)
        return zero, zero, zero

    def gap(self, points: np.ndarray) -> np.ndarray:
        """Distance [m] from the nearest triangle."""
        return nearest_distance(points, self.corners)

    def outline(self, lo: np.ndarray, hi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The triangles, as quads whose last two corners agree."""
        rows = np.arange(3 * len(self.corners)).reshape(-1, 3)
        return self.corners.reshape(-1, 3), rows[:, [0, 1, 2, 2]]


def read_mesh(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """(points [file's unit], rows of three) of a file of triangles. Raises ValueError naming it."""
    import meshio

    mesh = meshio.read(path)
    found = [block.data for block in mesh.cells if block.type == "triangle"]
    if not found:
        raise ValueError(f"{path}: holds no triangles")
    return np.asarray(mesh.points, float), np.concatenate(found).astype(np.int64)


def nearest_distance(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Distance [m] of points, shape (n, 3), from the nearest of k triangles, shape (k, 3, 3)."""
    found = np.full(len(points), np.inf)
    for triangle in corners:
        found = np.minimum(found, np.linalg.norm(points - nearest_points(points, triangle), axis=1))
    return found


def nearest_points(points: np.ndarray, triangle: np.ndarray) -> np.ndarray:
    """The point of one triangle, shape (3, 3), nearest to each of n points: shape (n, 3) [m]."""
    a, b, c = triangle
    normal = np.cross(b - a, c - a)
    best = np.empty((len(points), 3))
    squared = np.full(len(points), np.inf)
    for p, q in ((a, b), (b, c), (c, a)):
        edge = q - p
        share = np.clip((points - p) @ edge / max(edge @ edge, 1e-300), 0, 1)
        foot = p + share[:, None] * edge
        here = ((points - foot) ** 2).sum(axis=1)
        best[here < squared] = foot[here < squared]
        squared = np.minimum(squared, here)
    inside = np.ones(len(points), bool)
    for p, q in ((a, b), (b, c), (c, a)):
        inside &= np.cross(q - p, points - p) @ normal >= 0
    area = math.sqrt(normal @ normal)
    if area > 0:
        unit = normal / area
        best[inside] = (points - ((points - a) @ unit)[:, None] * unit)[inside]
    return best
