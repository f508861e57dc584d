"""A scene as hard spheres see it: radii, masses, restitutions, walls at the sides of a box. No Warp here."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from scipy.spatial import KDTree

from gpudem.errors import SceneError
from gpudem.scene import Plane, Scene
from gpudem.scene.sections import Side, Wall

SIDES: tuple[Side, ...] = ("xlo", "xhi", "ylo", "yhi", "zlo", "zhi")
#: Shortest period of a vibrating wall, by the length of the run: the clock must tell where in a tooth it is.
SHORTEST = 1e-9
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
    friction: np.ndarray
    """(6, materials) mu [1]; 0 for smooth spheres."""
    speed: np.ndarray
    """(6,) U of a vibrating wall, inwards [m/s]; 0 for a wall at rest."""
    stroke: np.ndarray
    """(6,) A of its saw-tooth [m]; 0 is the limit of a fast floor."""
    names: tuple[str, ...]


@dataclasses.dataclass(frozen=True)
class Statement:
    """What the event loop and its slow oracle start from."""

    position: np.ndarray
    """(n, 3) [m]."""
    velocity: np.ndarray
    """(n, 3) [m/s]."""
    spin: np.ndarray
    """(n, 3) [rad/s]."""
    radius: np.ndarray
    """(n,) [m]."""
    mass: np.ndarray
    """(n,) [kg], spheres also where they are one layer."""
    material: np.ndarray
    """(n,) index."""
    restitution: np.ndarray
    """(materials, materials) [1]; 1 where a pair is not stated."""
    friction: np.ndarray
    """(materials, materials) mu [1]; 0 where a pair is not stated, and for smooth spheres."""
    tangential: float
    """beta0 of Walton's rule [1]; -1 for smooth spheres, which have no tangential impulse."""
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

    @property
    def rough(self) -> bool:
        """Are there tangential impulses, and do spins change?"""
        return self.tangential > -1

    @classmethod
    def of(cls, scene: Scene, guard: float = 0.0, tangential_restitution: float | None = None) -> Statement:
        """A scene's hard spheres; `tangential_restitution` (beta0) where it has friction, and only there.

        Raises:
            SceneError: listing what hard spheres cannot state.
        """
        state, n_materials = scene.state, len(scene.materials)
        density = np.array([m.density for m in scene.materials.values()])
        restitution, friction = np.ones((n_materials, n_materials)), np.zeros((n_materials, n_materials))
        for pair in scene.pairs:
            a, b = (scene.material_index[m] for m in pair.materials)
            restitution[a, b] = restitution[b, a] = pair.restitution
            if scene.needs.tangential:
                friction[a, b] = friction[b, a] = pair.friction
        found = _unstatable(scene, guard, tangential_restitution)
        if found:
            raise SceneError(f"{scene.name} (event-driven)", found)
        lo, hi = np.array(scene.domain.lo), np.array(scene.domain.hi)
        segments = tuple(
            (a * scene.time.step, b * scene.time.step, _walls(walls, scene, restitution, friction))
            for a, b, walls in scene.segments
        )
        flat = np.ptp(state.position, axis=0) == 0
        still = ~state.velocity.any(axis=0) & (np.array(scene.gravity) == 0)
        turning = state.angular_velocity.any(axis=0) & scene.needs.tangential
        # a spin about another axis than that across the layer drives a rough sphere out of it
        held = np.array([not np.delete(turning, k).any() for k in range(3)])
        layer = flat & still & held & (len(state) > 1)
        made = cls(
            position=state.position.copy(),
            velocity=state.velocity.copy(),
            spin=state.angular_velocity.copy(),
            radius=state.radius.copy(),
            mass=density[state.material] * 4 / 3 * math.pi * state.radius**3,
            material=state.material.copy(),
            restitution=restitution,
            friction=friction,
            tangential=-1.0 if tangential_restitution is None else tangential_restitution,
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


def _unstatable(scene: Scene, guard: float, tangential: float | None) -> list[str]:
    """What a scene says that hard spheres cannot, one line each."""
    found: list[str] = []
    if scene.contact.normal == "hertz/stiffness":
        found.append("contact.normal = 'hertz/stiffness': states no restitution; use 'hertz'")
    if scene.needs.tangential and tangential is None:
        found.append(
            "pairs.friction: rough hard spheres need tangential_restitution (beta0), -1 to 1; for smooth ones"
            " set contact.tangential = 'off'"
        )
    if tangential is not None and not scene.needs.tangential:
        found.append(
            f"tangential_restitution = {tangential:g}: the scene has no friction (pairs.friction,"
            " contact.tangential); leave it out"
        )
    if tangential is not None and not -1 <= tangential <= 1:
        found.append(f"tangential_restitution = {tangential:g}: must be -1 to 1")
    if scene.needs.rolling:
        found.append("pairs.rolling_friction: a collision takes no time; set contact.rolling = 'off'")
    if scene.output.restart_every:
        found.append("output.restart_every: the event-driven engine writes no restart files")
    for wall in scene.wall_elements:
        if not isinstance(wall, Plane):
            found.append(f"walls.{wall.name}.kind = {wall.kind!r}: the event-driven engine knows planes only")
    for plane in scene.planes:
        side = _axis_side(plane)
        if side is None:
            found.append(f"walls.{plane.name}.normal = {plane.normal}: must lie along an axis")
    found += _unstatable_motion(scene)
    if guard < 0 or not math.isfinite(guard):
        found.append(f"guard = {guard:g} s: must be 0 or more")
    return found


def _unstatable_motion(scene: Scene) -> list[str]:
    """Vibrating walls that the event loop cannot follow."""
    found: list[str] = []
    for plane in scene.planes:
        if plane.vibration is None or plane.vibration.amplitude == 0:
            continue
        key, period = f"walls.{plane.name}.vibration", plane.vibration.amplitude / plane.vibration.speed
        if period < SHORTEST * scene.time.duration:
            found.append(
                f"{key}: period amplitude / speed = {period:.3g} s is below {SHORTEST:g} of the run;"
                " amplitude = 0 is that limit"
            )
        others = [p.name for p in scene.planes if p is not plane and _axis_side(p) == _axis_side(plane)]
        if others:
            found.append(
                f"{key}: bounds the same side as {', '.join(others)}; a wall that moves stands alone"
            )
    return found


def _walls(walls: list[Wall], scene: Scene, restitution: np.ndarray, friction: np.ndarray) -> Walls:
    present, at, speed, stroke = np.zeros(6, bool), np.zeros(6), np.zeros(6), np.zeros(6)
    e, mu, names = np.ones((6, len(restitution))), np.zeros((6, len(restitution))), [""] * 6
    for plane in (wall for wall in walls if isinstance(wall, Plane)):  # `_unstatable` refuses the others
        side = _axis_side(plane)
        if side is None:
            continue
        inward, where = 1 - 2 * (side % 2), plane.point[side // 2]
        if present[side] and (where - at[side]) * inward <= 0:
            continue  # behind another wall of this side
        present[side], at[side], names[side] = True, where, plane.name
        e[side] = restitution[:, scene.material_index[plane.material]]
        mu[side] = friction[:, scene.material_index[plane.material]]
        speed[side] = plane.vibration.speed if plane.vibration else 0.0
        stroke[side] = plane.vibration.amplitude if plane.vibration else 0.0
    return Walls(present, at, e, mu, speed, stroke, tuple(names))
