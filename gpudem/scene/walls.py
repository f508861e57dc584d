"""What every wall of a scene states; planes and boxes. All kinds by name: `gpudem.scene.wall_kinds`."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, ValidationInfo, field_validator

from gpudem.scene.motion import Motion, Turn, largest_speed
from gpudem.scene.types import Model, Name, Side, Vector, law_name, number, positive, span, vector

#: Components of a unit normal up to this size are rounding, and count as zero: cos, sin and products of a few
#: rotation matrices leave some 1e-16, and a tilt of 1e-12 moves a plane by a nanometre at a kilometre.
NORMAL_ROUNDING = 1e-12


def box_corners(lo: np.ndarray, hi: np.ndarray) -> np.ndarray:
    """The eight corners of the box lo..hi [m], shape (8, 3)."""
    return np.array([[(lo, hi)[i >> k & 1][k] for k in range(3)] for i in range(8)], float)


def in_wall_frame(points: np.ndarray, rotation: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """Points [m] in space, (p, 3), in the frames of walls in k poses: shape (k, p, 3)."""
    return (points - shift[:, None]) @ rotation


class Vibration(Model):
    """Saw-tooth motion of a plane along its normal: it moves at `speed` over `amplitude` and snaps back.

    Amplitude 0 is the limit of a fast floor: the plane is at rest between contacts, and a particle in
    contact sees a wall velocity U until separation; hard spheres leave with v' = (1 + e) U - e v.
    """

    speed: Annotated[float, positive("m/s")]
    """U [m/s], towards the particles."""
    amplitude: Annotated[float, number("m", 0)] = 0.0
    """Stroke A [m]; the period is A / U."""


class WallContact(Model):
    """The contact law at one wall, slot by slot, where it differs from `[contact]`."""

    normal: Annotated[str, law_name("normal")] | None = None
    """Normal law at this wall; default: that of the scene."""
    tangential: Annotated[str, law_name("tangential")] | None = None
    """Tangential law at this wall; default: that of the scene."""
    rolling: Annotated[str, law_name("rolling")] | None = None
    """Rolling law at this wall; default: that of the scene."""
    cohesion: Annotated[str, law_name("cohesion")] | None = None
    """Law of cohesion at this wall; default: that of the scene."""


class Wall(Model):
    """What every wall states, and the geometry of an elementary one on the host (a box consists of planes).

    A kind of another package derives from it (`gpudem.walls.registry`).
    """

    kind: str
    """Kind of wall."""
    name: Name
    """Name of the wall; unique."""
    material: Name
    """Its material."""
    removed_at: Annotated[float, positive("s")] | None = None
    """The wall is a gate: it is there until this time."""
    present: Annotated[tuple[float, ...], span("s")] | None = None
    """When it is there: [from] or [from, until] [s]; default: from the start to the end."""
    contact: WallContact | None = None
    """This wall's own contact law, where it differs from that of the particles."""
    surface_velocity: Annotated[Vector, vector("m/s", nonzero=True)] | None = None
    """Velocity of a belt, beside that of the wall [m/s]: turned into the surface, its magnitude kept."""
    motion: tuple[Motion, ...] = ()
    """How it moves, from the start of the run on; several motions act together, in the order given."""

    @field_validator("present")
    @classmethod
    def _one_end(cls, value: tuple[float, ...] | None, info: ValidationInfo) -> tuple[float, ...] | None:
        if value is not None and info.data.get("removed_at") is not None:
            raise ValueError("removed_at is its end already; state one of the two")
        return value

    reference: Annotated[Vector, vector("m")] | None = None
    """Point about which its torque is stated [m]; it moves with the wall. Default: the point of its first
    turn, else the origin."""

    @property
    def torque_point(self) -> Vector:
        """Point of the torque at the start [m]."""
        if self.reference is not None:
            return self.reference
        return next((m.point for m in self.motion if isinstance(m, Turn)), (0.0, 0.0, 0.0))

    @property
    def begin(self) -> float:
        """Since when it is there [s]; 0: from the start."""
        return self.present[0] if self.present else 0.0

    @property
    def end(self) -> float | None:
        """Until when it is there [s]; None: to the end of the run."""
        if self.removed_at is not None:
            return self.removed_at
        return self.present[1] if self.present and len(self.present) > 1 else None

    def given_keys(self, *keys: str) -> list[str]:
        """Those of some optional keys that have a value: for codes that do not know them."""
        return [key for key in keys if getattr(self, key) not in (None, ())]

    def elements(self, lo: Vector, hi: Vector) -> list[Wall]:
        """The elementary walls of which it consists, in a domain lo..hi [m]."""
        return [self]

    def shape(self) -> tuple[Vector, Vector, Vector]:
        """(direction, point [m], size [m]) as the kind's device function reads them."""
        raise NotImplementedError

    def gap(self, points: np.ndarray) -> np.ndarray:
        """Gap [m] of points, shape (n, 3), from the wall: positive on the particles' side."""
        raise NotImplementedError

    def outline(self, lo: np.ndarray, hi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(points [m], quads) that show the wall in a domain lo..hi: shapes (p, 3), (q, 4)."""
        raise NotImplementedError

    def overlap(self, points: np.ndarray, radius: np.ndarray) -> np.ndarray:
        """Overlap [m] of particles with the wall, shape (n,); of those apart some value of at most 0."""
        return radius - self.gap(points)

    def bounds(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Lower and upper corner [m] at the start; None for a wall without end."""
        return None

    def reach_points(self) -> np.ndarray | None:
        """Points at the start whose convex hull holds the wall [m], (p, 3); None for one without ends."""
        bounds = self.bounds()
        return None if bounds is None else box_corners(*bounds)

    def marks(self, rotation: np.ndarray, shift: np.ndarray, lo: np.ndarray, hi: np.ndarray) -> np.ndarray:
        """What `moved` compares between k poses of the wall in a domain lo..hi [m]: shape (k, p, d) [m].

        rotation, shift [m]: what is at X at the start is at rotation X + shift, shapes (k, 3, 3) and (k, 3).
        """
        points = self.reach_points()
        if points is not None:
            return points @ np.swapaxes(rotation, 1, 2) + shift[:, None]
        return in_wall_frame(box_corners(lo, hi), rotation, shift)

    def moved(self, marks: np.ndarray, before: np.ndarray) -> np.ndarray:
        """How much gaps of points in the domain differ at most from those of another pose [m], shape (k,).

        marks: of k poses, (k, p, d); before: of the other one, (p, d). No gap changes by more than the
        farthest that a point of the wall has moved or, as a gap follows from the point's place in the wall's
        frame, than the farthest that a point of the domain has moved there. Both are farthest at corners.
        """
        way = marks - before
        return np.sqrt(np.einsum("kpd,kpd->kp", way, way).max(axis=1))

    def largest_speed(
        self, lo: np.ndarray, hi: np.ndarray, duration: float, points: np.ndarray | None = None
    ) -> float:
        """An upper bound of the speed of its surface within a domain lo..hi [m], in a run of a duration [s].

        Of its motions together, and of its belt. points: its `reach_points` where the motions begin [m].
        """
        belt = float(np.linalg.norm(self.surface_velocity)) if self.surface_velocity else 0.0
        points = self.reach_points() if points is None else points
        moving = largest_speed(self.motion, points, box_corners(lo, hi), duration)
        return self.speed + moving + belt  # mutate: largest_wall_speed

    @property
    def moves(self) -> bool:
        """Its place changes in time, or its surface has a velocity."""
        return bool(self.motion) or self.surface_velocity is not None or self.speed > 0

    @property
    def fast_floor(self) -> bool:
        """It stands still between contacts, and moves at its velocity under each particle in contact."""
        return False

    @property
    def speed(self) -> float:
        """Speed of a saw-tooth [m/s]; 0 without one. Of motions: `largest_speed`."""
        return 0.0

    @property
    def velocity(self) -> Vector:
        """Velocity [m/s] while it moves."""
        return (0.0, 0.0, 0.0)

    @property
    def stroke(self) -> float:
        """Largest displacement [m]."""
        return 0.0

    def displacement(self, time: float) -> Vector:
        """Where it is at a time [s], from its place at the start [m]."""
        return (0.0, 0.0, 0.0)


class Plane(Wall):
    """Infinite plane wall; particles live on the side its normal points to. With `removed_at`: a gate."""

    kind: Literal["plane"] = "plane"  # type: ignore[assignment]
    """Kind of wall."""
    name: Name
    """Name of the wall; unique."""
    material: Name
    """Its material."""
    point: Annotated[Vector, vector("m")]
    """A point of the plane [m]."""
    normal: Annotated[Vector, vector("1", nonzero=True)]
    """Normal of any length, towards the particles."""
    removed_at: Annotated[float, positive("s")] | None = None
    """The plane is a gate: it is there until this time [s]."""
    vibration: Vibration | None = None
    """Saw-tooth motion along the normal."""

    def elements(self, lo: Vector, hi: Vector) -> list[Wall]:
        """The plane with `unit_normal`."""
        return [self.model_copy(update={"normal": self.unit_normal})]

    def shape(self) -> tuple[Vector, Vector, Vector]:
        """(normal, point, (normal . point, 0, 0))."""
        offset = np.einsum("i,i", np.array(self.normal), np.array(self.point))
        return self.normal, self.point, (float(offset), 0.0, 0.0)

    def gap(self, points: np.ndarray) -> np.ndarray:
        """Distance [m] along the normal."""
        return (points - np.array(self.point)) @ np.array(self.normal)

    def marks(self, rotation: np.ndarray, shift: np.ndarray, lo: np.ndarray, hi: np.ndarray) -> np.ndarray:
        """Heights of corners of the domain: of a plane that slides along itself they stay."""
        heights = in_wall_frame(box_corners(lo, hi), rotation, shift) @ np.array(self.normal)
        return heights[:, :, None]  # mutate: way_along_normal

    def outline(self, lo: np.ndarray, hi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A rectangle: an axis-aligned plane cut to lo..hi, a tilted one as large as its diagonal."""
        size, normal, centre = float(np.linalg.norm(hi - lo)), np.array(self.normal), (lo + hi) / 2
        foot = centre - ((centre - np.array(self.point)) @ normal) * normal
        axis = int(np.argmax(np.abs(normal)))
        u = np.roll(np.eye(3)[axis], 1)
        u -= (u @ normal) * normal
        u /= np.linalg.norm(u)
        v = np.cross(normal, u)
        half = [np.abs((hi - lo) @ d) / 2 if np.count_nonzero(normal) == 1 else size / 2 for d in (u, v)]
        corners = [foot + a * half[0] * u + b * half[1] * v for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        return np.array(corners), np.arange(4).reshape(1, 4)

    @property
    def unit_normal(self) -> Vector:
        """The normal with length one; components of it that are rounding (`NORMAL_ROUNDING`) are zero."""
        length = math.sqrt(math.fsum(c * c for c in self.normal))
        if all(c == 0 or abs(c) > NORMAL_ROUNDING * length for c in self.normal):
            x, y, z = (c / length for c in self.normal)  # mutate: unit_normal
            return x, y, z
        clean = [c if abs(c) > NORMAL_ROUNDING * length else 0.0 for c in self.normal]
        length = math.sqrt(math.fsum(c * c for c in clean))
        return clean[0] / length, clean[1] / length, clean[2] / length

    @property
    def fast_floor(self) -> bool:
        """Vibrates with amplitude 0."""
        return self.vibration is not None and self.vibration.amplitude == 0

    @property
    def speed(self) -> float:
        """U along the normal [m/s]; 0 for a plane at rest."""
        return self.vibration.speed if self.vibration else 0.0

    @property
    def velocity(self) -> Vector:
        """U along the normal [m/s]."""
        x, y, z = self.normal
        return self.speed * x, self.speed * y, self.speed * z

    @property
    def stroke(self) -> float:
        """Amplitude of a saw-tooth [m]."""
        return self.vibration.amplitude if self.vibration else 0.0

    def displacement(self, time: float) -> Vector:
        """Of a saw-tooth from its lowest place [m]."""
        (x, y, z), shift = self.normal, self.shift(time)
        return shift * x, shift * y, shift * z

    def shift(self, time: float) -> float:
        """How far along its normal a saw-tooth is from its lowest place [m]."""
        if self.vibration is None or self.fast_floor:
            return 0.0
        return self.vibration.speed * math.fmod(time, self.vibration.amplitude / self.vibration.speed)


def _along(axis: int, value: float) -> Vector:
    return (value if axis == 0 else 0.0, value if axis == 1 else 0.0, value if axis == 2 else 0.0)


class Box(Wall):
    """Axis-aligned planes at the chosen sides of lo..hi (default: the domain), facing inwards.

    What it says of presence, contact law, belt and motion holds for each of its planes.
    """

    kind: Literal["box"] = "box"  # type: ignore[assignment]
    """Kind of wall."""
    name: Name
    """Name of the box; its planes are called NAME_SIDE."""
    material: Name
    """Material of its planes."""
    sides: Annotated[tuple[Side, ...], Field(min_length=1)] = ("xlo", "xhi", "ylo", "yhi", "zlo", "zhi")
    """Sides that have a plane."""
    lo: Annotated[Vector, vector("m")] | None = None
    """Lower corner [m]; default: that of the domain."""
    hi: Annotated[Vector, vector("m")] | None = None
    """Upper corner [m]; default: that of the domain."""

    def elements(self, lo: Vector, hi: Vector) -> list[Wall]:
        """One plane for each side, named `<box>_<side>`."""
        corners, planes = {"lo": self.lo or lo, "hi": self.hi or hi}, []
        common = {key: getattr(self, key) for key in Wall.model_fields if key not in ("kind", "name")}
        for side in self.sides:  # mutate: sides_of_box
            axis, sign = "xyz".index(side[0]), 1.0 if side.endswith("lo") else -1.0
            place = {"point": _along(axis, corners[side[1:]][axis]), "normal": _along(axis, sign)}
            planes.append(Plane(name=f"{self.name}_{side}", **place, **common))
        return planes
