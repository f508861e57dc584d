"""A scene as hard spheres see it: radii, masses, restitutions, walls at the sides of a box. No Warp here."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from scipy.spatial import KDTree

from gpudem.errors import SceneError
from gpudem.scene import Plane, Scene
from gpudem.sections import Side

SIDES: tuple[Side, ...] = ("xlo", "xhi", "ylo", "yhi", "zlo", "zhi")
#: Overlap in diameters that rounding may leave; more at the start is an error.
ROUNDING = 1e-9


@dataclasses.dataclass(frozen=True)
class Walls:
    """At most one wall a side: the first one a particle comes to."""

    present: np.ndarray
    """(6,) bool, in the order of SIDES."""
    at: np.ndarray
    """(6,) coordinate along the axis of the side [m]."""
    restitution: np.ndarray
    """(6, materials) [1]."""
    speed: np.ndarray
    """(6,) U of the fast floor, inwards [m/s]; 0 for a wall at rest."""
    names: tuple[str, ...]


@dataclasses.dataclass(frozen=True)
class Statement:
    """What the event loop and its slow oracle start from."""

    position: np.ndarray
    """(n, 3) [m]."""
    velocity: np.ndarray
    """(n, 3) [m/s]."""
    radius: np.ndarray
    """(n,) [m]."""
    mass: np.ndarray
    """(n,) [kg], spheres also where they are one layer."""
    material: np.ndarray
    """(n,) index."""
    restitution: np.ndarray
    """(materials, materials) [1]; 1 where a pair is not stated."""
    gravity: np.ndarray
    """(3,) [m/s2]."""
    lo: np.ndarray
    hi: np.ndarray
    periodic: np.ndarray
    """(3,) bool."""
    layer: np.ndarray
    """(3,) bool: axes along which nothing ever moves; disks have one."""
    segments: tuple[tuple[float, float, Walls], ...]
    """(from, to [s], walls) between removals of gates."""
    guard: float
    """t_c of the TC model [s]; 0 is none."""

    @classmethod
    def of(cls, scene: Scene, floor_speed: float = 0.0, guard: float = 0.0) -> Statement:
        """A scene's hard spheres.

        Raises:
            SceneError: listing what hard spheres cannot state.
        """
        state, n_materials = scene.state, len(scene.materials)
        density = np.array([m.density for m in scene.materials.values()])
        restitution = np.ones((n_materials, n_materials))
        for pair in scene.pairs:
            a, b = (scene.material_index[m] for m in pair.materials)
            restitution[a, b] = restitution[b, a] = pair.restitution
        found = _unstatable(scene, floor_speed, guard)
        if found:
            raise SceneError(f"{scene.name} (event-driven)", found)
        lo, hi = np.array(scene.domain.lo), np.array(scene.domain.hi)
        segments = tuple(
            (a * scene.time.step, b * scene.time.step, _walls(planes, scene, restitution, floor_speed))
            for a, b, planes in scene.segments
        )
        flat = np.ptp(state.position, axis=0) == 0
        still = ~state.velocity.any(axis=0) & (np.array(scene.gravity) == 0)
        layer = flat & still & (len(state) > 1)
        made = cls(
            position=state.position.copy(),
            velocity=state.velocity.copy(),
            radius=state.radius.copy(),
            mass=density[state.material] * 4 / 3 * math.pi * state.radius**3,
            material=state.material.copy(),
            restitution=restitution,
            gravity=np.array(scene.gravity),
            lo=lo,
            hi=hi,
            periodic=np.array(scene.domain.periodic),
            layer=layer,
            segments=segments,
            guard=guard,
        )
        found = made.overlaps()
        if found:
            raise SceneError(f"{scene.name} (event-driven)", found)
        return made

    def overlaps(self) -> list[str]:
        """Who overlaps whom at the start by more than rounding."""
        found: list[str] = []
        x, largest = self.position, 2 * float(self.radius.max())
        box = np.where(self.periodic, self.hi - self.lo, 0.0)
        tree = KDTree(np.where(self.periodic, (x - self.lo) % np.where(box > 0, box, 1.0), x), boxsize=box)
        for i, j in sorted(tree.query_pairs(largest)):
            r = x[i] - x[j]
            r -= box * np.round(r / np.where(box > 0, box, 1.0))
            d = self.radius[i] + self.radius[j]
            overlap = (d - math.sqrt(float(r @ r))) / d
            if overlap > ROUNDING:
                found.append(f"particles {i + 1} and {j + 1} overlap by {overlap:.3g} diameters at the start")
        walls = self.segments[0][2]
        for side in np.flatnonzero(walls.present):
            depth = self.radius - distance(x, int(side), walls)
            for i in np.flatnonzero(depth > ROUNDING * 2 * self.radius):
                found.append(f"particle {i + 1} overlaps wall {walls.names[side]!r} by {depth[i]:.3g} m")
        return found[:10]


def distance(x: np.ndarray, side: int, walls: Walls) -> np.ndarray:
    """Distance [m] of centres from the wall of a side."""
    return (x[:, side // 2] - walls.at[side]) * (1 - 2 * (side % 2))


def _axis_side(plane: Plane) -> int | None:
    """Number of the side a plane bounds, None if it is oblique."""
    axes = [k for k in range(3) if plane.normal[k] != 0]
    return 2 * axes[0] + (plane.normal[axes[0]] < 0) if len(axes) == 1 else None


def _unstatable(scene: Scene, floor_speed: float, guard: float) -> list[str]:
    """What a scene says that hard spheres cannot, one line each."""
    found: list[str] = []
    if scene.contact.normal == "hertz/stiffness":
        found.append("contact.normal = 'hertz/stiffness': states no restitution; use 'hertz'")
    if scene.needs.tangential:
        found.append("pairs.friction: hard spheres are smooth; set it to 0 or contact.tangential = 'off'")
    if scene.needs.rolling:
        found.append("pairs.rolling_friction: a collision takes no time; set contact.rolling = 'off'")
    if scene.output.restart_every:
        found.append("output.restart_every: the event-driven engine writes no restart files")
    for plane in scene.planes:
        side = _axis_side(plane)
        if side is None:
            found.append(f"walls.{plane.name}.normal = {plane.normal}: must lie along an axis")
        if plane.vibration and not plane.fast_floor:
            found.append(f"walls.{plane.name}.vibration.amplitude: only 0, a fast floor")
    if floor_speed < 0 or not math.isfinite(floor_speed):
        found.append(f"floor_speed = {floor_speed:g} m/s: must be 0 or more")
    if floor_speed > 0 and not any(_axis_side(plane) == _floor(scene) for plane in scene.planes):
        found.append(f"floor_speed = {floor_speed:g} m/s: there is no wall under gravity to move")
    if guard < 0 or not math.isfinite(guard):
        found.append(f"guard = {guard:g} s: must be 0 or more")
    return found


def _floor(scene: Scene) -> int | None:
    """The side that gravity points to, None without gravity along one axis."""
    axes = [k for k in range(3) if scene.gravity[k] != 0]
    return 2 * axes[0] + (scene.gravity[axes[0]] > 0) if len(axes) == 1 else None


def _walls(planes: list[Plane], scene: Scene, restitution: np.ndarray, floor_speed: float) -> Walls:
    present, at, speed = np.zeros(6, bool), np.zeros(6), np.zeros(6)
    e, names = np.ones((6, len(restitution))), [""] * 6
    for plane in planes:
        side = _axis_side(plane)
        if side is None:
            continue
        inward, where = 1 - 2 * (side % 2), plane.point[side // 2]
        if present[side] and (where - at[side]) * inward <= 0:
            continue  # behind another wall of this side
        present[side], at[side], names[side] = True, where, plane.name
        e[side] = restitution[:, scene.material_index[plane.material]]
        speed[side] = plane.speed or (floor_speed if side == _floor(scene) else 0.0)
    return Walls(present, at, e, speed, tuple(names))
