"""Particles that leave while a scene runs: through open sides of the domain, from regions, by age.

A particle leaves through an open side at the first rebuild of the neighbor list that finds its center beyond;
so it is in LIGGGHTS. A `[[remove]]` is decided in the steps that are multiples of its interval. In both cases
the particle is gone before the forces of that step, in contact until then. Its id is not used again.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import model_validator

from gpudem.scene.regions import Block, Cone, Cylinder, Region, RegionSection, Sphere
from gpudem.scene.types import Model, Name, Vector, positive, vector
from gpudem.scene.walls import box_corners

if TYPE_CHECKING:
    from gpudem.scene.model import Scene

#: Kinds of exits on the device.
PLANE, BLOCK, SPHERE, ROUND, AGE = range(5)


class Remove(Model):
    """Removal of particles at regular intervals: beyond a plane, in a region, or of an age."""

    name: Name
    """Name of its columns of the history."""
    every: Annotated[float, positive("s")]
    """Interval between two checks for particles to remove [s], rounded to whole steps (at least one)."""
    point: Annotated[Vector, vector("m")] | None = None
    """Of a plane [m]: those leave whose center is on the side of its normal."""
    normal: Annotated[Vector, vector("1", nonzero=True)] | None = None
    """Normal of the plane, of any length."""
    region: RegionSection | None = None
    """Those leave whose center is in it: a block, sphere, cylinder or cone."""
    age: Annotated[float, positive("s")] | None = None
    """Those leave that were inserted so long ago or longer [s]."""

    @model_validator(mode="after")
    def _one_rule(self) -> Remove:
        if (self.point is None) != (self.normal is None):
            missing, stated = ("point", "normal") if self.point is None else ("normal", "point")
            raise ValueError(f"{missing}: missing; a plane has both, and {stated} is stated")
        stated = [k for k in ("point", "region", "age") if getattr(self, k) is not None]
        if len(stated) != 1:
            what = ", ".join(stated) or "none"
            raise ValueError(f"one of point and normal, region, age must be stated, not {what}")
        if self.region is not None and not isinstance(self.region, Block | Sphere | Cylinder | Cone):
            raise ValueError(f"region.kind = {self.region.kind!r}: allowed: block, sphere, cylinder, cone")
        return self


@dataclasses.dataclass(frozen=True)
class Exit:
    """Where or when particles leave."""

    name: str
    """Of the columns of a history: removed_NAME, ..."""
    kind: int
    """PLANE, BLOCK, SPHERE, ROUND or AGE."""
    point: Vector = (0.0, 0.0, 0.0)
    """Of the plane; lower corner; center; center of the first end [m]."""
    vector: Vector = (0.0, 0.0, 0.0)
    """Unit normal, away from where particles leave [1]; upper corner [m]; -; unit axis [1]."""
    size: Vector = (0.0, 0.0, 0.0)
    """-; -; radius; radii of both ends and length [m]."""
    every: int = 0
    """Checked in steps that are multiples of it; 0: at each rebuild (open sides)."""
    age: int = 0
    """Steps since the insertion."""


def exits(scene: Scene) -> list[Exit]:
    """The open sides in the order xlo, xhi, ylo, ..., then `[[remove]]`: the first that fits counts."""
    found = []
    for side in sorted(scene.domain.sides, key=lambda s: (s[0], s != f"{s[0]}lo")):
        axis, sign = "xyz".index(side[0]), 1.0 if side.endswith("lo") else -1.0
        point = scene.domain.lo if sign > 0 else scene.domain.hi
        x, y, z = (sign * (k == axis) for k in range(3))
        found.append(Exit(side, PLANE, point, (x, y, z)))
    for stated in scene.remove:
        every = scene.stride(stated.every)
        assert every is not None
        if stated.age is not None:
            found.append(Exit(stated.name, AGE, every=every, age=max(1, scene.steps(stated.age))))
        elif stated.region is not None:
            found.append(_of_region(stated.name, stated.region, every))
        else:
            assert stated.point is not None
            found.append(Exit(stated.name, PLANE, stated.point, _unit(stated.normal, -1.0), every=every))
    return found


def _of_region(name: str, region: Region, every: int) -> Exit:
    if isinstance(region, Block):
        return Exit(name, BLOCK, region.lo, region.hi, every=every)
    if isinstance(region, Sphere):
        return Exit(name, SPHERE, region.center, size=(region.radius, 0.0, 0.0), every=every)
    assert isinstance(region, Cylinder | Cone)
    end = region.end_radius if isinstance(region, Cone) else region.radius
    return Exit(name, ROUND, region.point, _unit(region.axis), (region.radius, end, region.length), every)


def _unit(direction: Vector | None, sign: float = 1.0) -> Vector:
    x, y, z = sign * np.array(direction) / np.linalg.norm(np.array(direction))
    return float(x), float(y), float(z)


def search_box(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """(lo, hi) [m] of where particles can be at a rebuild: the domain, and a margin beyond its open sides.

    Between two rebuilds a particle moves half the skin, and in the step before the second one its radius at
    most, to which the guard of the speed holds it.
    """
    lo, hi = np.array(scene.domain.lo), np.array(scene.domain.hi)
    for side in scene.domain.sides:
        axis, margin = "xyz".index(side[0]), scene.skin + float(scene.state.radius.max())
        if side.endswith("lo"):
            lo[axis] -= margin
        else:
            hi[axis] += margin  # mutate: margin_beyond_side
    return lo, hi


def problems(scene: Scene) -> list[str]:
    """Open sides that are periodic, or closed by a wall that stays; removals that cannot act."""
    found = _removals(scene)
    for side in scene.domain.sides:
        axis = "xyz".index(side[0])
        key = f"domain.sides.{side} = 'outflow'"
        if scene.domain.periodic[axis]:
            found.append(f"{key}: {side[0]} is periodic; a side is one of both")
        low = side.endswith("lo")
        place = (scene.domain.lo if low else scene.domain.hi)[axis]
        for plane in scene.planes:
            normal = [0.0, 0.0, 0.0]
            normal[axis] = 1.0 if low else -1.0
            beside = (place - plane.point[axis]) * normal[axis] <= 0
            stays = not scene.goes(plane) and plane.name not in scene.moving_walls
            if list(plane.normal) == normal and beside and stays:
                found.append(f"{key}: wall {plane.name} stands there to the end; nothing can leave")
    return found


def _removals(scene: Scene) -> list[str]:
    found, lo, hi = [], np.array(scene.domain.lo), np.array(scene.domain.hi)
    names = Counter([*scene.domain.sides, *(stated.name for stated in scene.remove)])
    found += [
        f"remove: name {name!r} given twice; sides have their names" for name, n in names.items() if n > 1
    ]
    for k, stated in enumerate(scene.remove):
        key, run = f"remove[{k}]", scene.time.duration
        if stated.every > run:
            found.append(f"{key}.every = {stated.every:g} s: longer than time.duration = {run:g} s")
        if stated.age is not None and not scene.insert:
            found.append(f"{key}.age: only inserted particles have an age, and nothing is inserted")
        if stated.age is not None and stated.age > run:
            found.append(f"{key}.age = {stated.age:g} s: longer than time.duration = {run:g} s")
        if stated.region is not None:
            low, high = stated.region.bounds()
            if (low > hi).any() or (high < lo).any():
                found.append(f"{key}.region: outside the domain {scene.domain.lo} .. {scene.domain.hi} m")
        if stated.point is not None:
            depth = (box_corners(lo, hi) - np.array(stated.point)) @ np.array(stated.normal)
            if depth.max() <= 0 or depth.min() >= 0:
                where = "no part" if depth.max() <= 0 else "all"
                found.append(f"{key}.point: {where} of the domain is beyond the plane")
    return found
