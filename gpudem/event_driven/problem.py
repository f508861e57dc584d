"""A scene as a hard-sphere problem: radii, masses, restitutions, walls at the sides of a box (no Warp)."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from scipy.spatial import KDTree

from gpudem.errors import SceneError
from gpudem.scene import Plane, Scene, flow
from gpudem.scene.walls import Side, Wall

SIDES: tuple[Side, ...] = ("xlo", "xhi", "ylo", "yhi", "zlo", "zhi")
#: Shortest period of a vibrating wall by the duration of the run: times must resolve the phase of the wall.
MIN_PERIOD_SHARE = 1e-9
#: Overlap in diameters at the start that is taken for rounding; more is an error.
OVERLAP_TOLERANCE = 1e-9
#: How many overlaps at the start an error lists.
MAX_OVERLAPS_LISTED = 10


@dataclasses.dataclass(frozen=True)
class SideWalls:
    """At most one wall a side of the domain: of several planes the innermost."""

    present: np.ndarray
    """(6,) bool, in the order of SIDES."""
    position: np.ndarray
    """(6,) coordinate along the axis of the side [m]; of a vibrating wall its lowest position."""
    restitution: np.ndarray
    """(6, materials) e [1]."""
    friction: np.ndarray
    """(6, materials) mu [1]; 0 for smooth spheres."""
    speed: np.ndarray
    """(6,) U of a vibrating wall along its inward normal [m/s]; 0 for a wall at rest."""
    amplitude: np.ndarray
    """(6,) A of its sawtooth [m]; 0 is the zero-amplitude limit."""
    names: tuple[str, ...]


@dataclasses.dataclass(frozen=True)
class HardSphereProblem:
    """Initial state and parameters of a hard-sphere simulation; disks are spheres in one layer."""

    position: np.ndarray
    """(n, 3) [m]."""
    velocity: np.ndarray
    """(n, 3) [m/s]."""
    angular_velocity: np.ndarray
    """(n, 3) [rad/s]."""
    radius: np.ndarray
    """(n,) [m]."""
    mass: np.ndarray
    """(n,) [kg], of spheres, also in a layer."""
    material: np.ndarray
    """(n,) index."""
    restitution: np.ndarray
    """(materials, materials) e [1]; 1 for pairs that the scene does not define."""
    friction: np.ndarray
    """(materials, materials) mu [1]; 0 for pairs that the scene does not define, and for smooth spheres."""
    tangential_restitution: float
    """beta0 of Walton's rule [1]; -1 for smooth spheres, which have no tangential impulse."""
    gravity: np.ndarray
    """(3,) [m/s2]."""
    lo: np.ndarray
    """(3,) lower corner of the domain [m]."""
    hi: np.ndarray
    """(3,) upper corner of the domain [m]."""
    periodic: np.ndarray
    """(3,) bool."""
    layer: np.ndarray
    """(3,) bool: axes along which nothing moves, and all centers have one coordinate (a layer of disks)."""
    segments: tuple[tuple[float, float, SideWalls], ...]
    """(from [s], to [s], walls) between removals of gates."""
    guard: float
    """t_c of the TC model [s]; 0: off."""

    @property
    def rough(self) -> bool:
        """Collisions have a tangential impulse and change angular velocities."""
        return self.tangential_restitution > -1

    @classmethod
    def from_scene(
        cls, scene: Scene, guard: float = 0.0, tangential_restitution: float | None = None
    ) -> HardSphereProblem:
        """Hard spheres of a scene.

        Args:
            scene: Its elastic constants are not used.
            guard: t_c of the TC model [s], 0 or more; 0: off.
            tangential_restitution: beta0 [1], -1 to 1; required by scenes with friction, refused by others.

        Raises:
            SceneError: listing what the event-driven engine does not support, and overlaps at the start.
        """
        problems = _unsupported_features(scene, guard, tangential_restitution)
        if problems:
            raise SceneError(f"{scene.name} (event-driven)", problems)
        state = scene.state
        density = np.array([m.density for m in scene.materials.values()])
        restitution, friction = _pair_tables(scene)
        problem = cls(
            position=state.position.copy(),
            velocity=state.velocity.copy(),
            angular_velocity=state.angular_velocity.copy(),
            radius=state.radius.copy(),
            mass=density[state.material] * 4 / 3 * math.pi * state.radius**3,
            material=state.material.copy(),
            restitution=restitution,
            friction=friction,
            tangential_restitution=-1.0 if tangential_restitution is None else tangential_restitution,
            gravity=np.array(scene.gravity),
            lo=np.array(scene.domain.lo),
            hi=np.array(scene.domain.hi),
            periodic=np.array(scene.domain.periodic),
            layer=_layer_axes(scene),
            segments=tuple(
                (a * scene.time.step, b * scene.time.step, _side_walls(walls, scene, restitution, friction))
                for a, b, walls in scene.segments
            ),
            guard=guard,
        )
        overlaps = problem.overlaps()
        if overlaps:
            raise SceneError(f"{scene.name} (event-driven)", overlaps)
        return problem

    def overlaps(self) -> list[str]:
        """Overlaps at the start above OVERLAP_TOLERANCE, one line each, at most MAX_OVERLAPS_LISTED."""
        found: list[str] = []
        x, largest = self.position, 2 * float(self.radius.max())
        box = np.where(self.periodic, self.hi - self.lo, 0.0)
        tree = KDTree(np.where(self.periodic, (x - self.lo) % np.where(box > 0, box, 1.0), x), boxsize=box)
        for i, j in sorted(tree.query_pairs(largest)):
            r = x[i] - x[j]
            r -= box * np.round(r / np.where(box > 0, box, 1.0))
            d = self.radius[i] + self.radius[j]
            overlap = (d - math.sqrt(float(r @ r))) / d
            if overlap > OVERLAP_TOLERANCE:
                found.append(
                    f"particles {i + 1} and {j + 1} overlap by {overlap:.3g} diameters at the start;"
                    f" allowed: {OVERLAP_TOLERANCE:g}"
                )
        walls = self.segments[0][2]
        for side in np.flatnonzero(walls.present):
            depth = self.radius - distance_from_wall(x, int(side), walls)
            for i in np.flatnonzero(depth > OVERLAP_TOLERANCE * 2 * self.radius):
                found.append(
                    f"particle {i + 1} overlaps wall {walls.names[side]!r} by {depth[i]:.3g} m at the start;"
                    f" allowed: {OVERLAP_TOLERANCE:g} diameters"
                )
        return found[:MAX_OVERLAPS_LISTED]


def wrap_periodic(x: np.ndarray, lo: np.ndarray, hi: np.ndarray, periodic: np.ndarray) -> np.ndarray:
    """Positions (n, 3) [m] with the coordinates of periodic axes in [lo, hi); the others unchanged.

    lo + (x - lo) mod (hi - lo). Rounding can make that hi or more: such a position is on the face, at lo.
    """
    wrapped = lo + (x - lo) % (hi - lo)
    return np.where(periodic, np.where(wrapped < hi, wrapped, lo), x)


def distance_from_wall(x: np.ndarray, side: int, walls: SideWalls) -> np.ndarray:
    """Distance [m] of centers (n, 3) from the wall of a side, positive inside."""
    return (x[:, side // 2] - walls.position[side]) * (1 - 2 * (side % 2))


def _pair_tables(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """(restitution, friction) of all pairs of materials, (materials, materials) [1]."""
    n = len(scene.materials)
    restitution, friction = np.ones((n, n)), np.zeros((n, n))
    for pair in scene.pairs:
        a, b = (scene.material_index[m] for m in pair.materials)
        restitution[a, b] = restitution[b, a] = pair.restitution
        if scene.needs.tangential:
            friction[a, b] = friction[b, a] = pair.friction
    return restitution, friction


def _layer_axes(scene: Scene) -> np.ndarray:
    """(3,) bool: axes along which all centers have one coordinate and will not move."""
    state = scene.state
    flat = np.ptp(state.position, axis=0) == 0
    at_rest = ~state.velocity.any(axis=0) & (np.array(scene.gravity) == 0)
    # a rough sphere that rotates about another axis than the normal of the layer is driven out of it
    rotating = state.angular_velocity.any(axis=0) & scene.needs.tangential
    stays = np.array([not np.delete(rotating, axis).any() for axis in range(3)])
    return flat & at_rest & stays & (len(state) > 1)


def _side_of(plane: Plane) -> int | None:
    """Index into SIDES of the side that a plane bounds; None if it is oblique."""
    axes = [k for k in range(3) if plane.normal[k] != 0]
    return 2 * axes[0] + (plane.normal[axes[0]] < 0) if len(axes) == 1 else None


def _unsupported_features(scene: Scene, guard: float, tangential: float | None) -> list[str]:
    """What the scene or the options ask for and hard spheres do not have, one line each."""
    found: list[str] = []
    if scene.phases:
        found.append("phases: hard spheres have one gravity and one set of pairs")
    if scene.groups:
        found.append("groups: hard spheres all move freely")
    if scene.insert:
        found.append("insert: hard spheres are all there at the start")
    found += [f"{stated.name}: particles leave: hard spheres stay to the end" for stated in scene.exits]
    if "restitution" not in scene.normal_law.reads:
        found.append(
            f"contact.normal = {scene.contact.normal!r}: does not use pairs.restitution, the input of hard"
            " spheres; use 'hertz'"
        )
    elif scene.contact_range > 0:
        found.append(
            f"contact.normal = {scene.contact.normal!r}: acts across gaps up to {scene.contact_range:g} m;"
            " hard spheres interact only in contact"
        )
    if scene.needs.tangential and tangential is None:
        found.append(
            "pairs.friction: rough hard spheres need tangential_restitution (beta0), -1 to 1; for smooth"
            " spheres set contact.tangential = 'off'"
        )
    if tangential is not None and not scene.needs.tangential:
        found.append(
            f"tangential_restitution = {tangential:g}: the scene has no friction (pairs.friction,"
            " contact.tangential); leave it out"
        )
    if tangential is not None and not -1 <= tangential <= 1:
        found.append(f"tangential_restitution = {tangential:g}: must be -1 to 1")
    if scene.needs.rolling:
        found.append(
            "pairs.rolling_friction: hard-sphere collisions are instantaneous and have no rolling friction;"
            " set contact.rolling = 'off'"
        )
    if scene.needs.cohesion:
        found.append(
            "pairs.cohesion_energy_density: hard-sphere collisions are instantaneous and have no cohesion;"
            " set contact.cohesion = 'off'"
        )
    if scene.output.restart_every:
        found.append("output.restart_every: the event-driven engine writes no restart files; leave it out")
    found += [
        f"output.flow: {surface.name}.face: the event-driven engine counts what passes whole planes only"
        for surface in flow.faces(scene)
    ]
    for wall in scene.wall_elements:
        if not isinstance(wall, Plane):
            found.append(f"walls.{wall.name}.kind = {wall.kind!r}: hard spheres support only planes")
        elif _side_of(wall) is None:
            found.append(f"walls.{wall.name}.normal = {wall.normal}: must be along an axis")
        for key in wall.given_keys("contact", "motion", "surface_velocity"):
            found.append(f"walls.{wall.name}.{key}: hard spheres have no such property of a wall")
    found += _unsupported_motion(scene)
    if guard < 0 or not math.isfinite(guard):
        found.append(f"guard = {guard:g} s: must be finite and at least 0 s")
    return found


def _unsupported_motion(scene: Scene) -> list[str]:
    """Vibrating walls that the event loop cannot follow, one line each."""
    found: list[str] = []
    for plane in scene.planes:
        if plane.vibration is None or plane.vibration.amplitude == 0:
            continue
        key, period = f"walls.{plane.name}.vibration", plane.vibration.amplitude / plane.vibration.speed
        shortest = MIN_PERIOD_SHARE * scene.time.duration
        if period < shortest:
            found.append(
                f"{key}: period amplitude / speed = {period:.3g} s: must be at least {shortest:.3g} s"
                f" ({MIN_PERIOD_SHARE:g} of the duration); amplitude = 0 is that limit"
            )
        others = [p.name for p in scene.planes if p is not plane and _side_of(p) == _side_of(plane)]
        if others:
            found.append(
                f"{key}: a wall that vibrates with an amplitude must be the only one on its side; on the same"
                f" side: {', '.join(others)}"
            )
    return found


def _side_walls(walls: list[Wall], scene: Scene, restitution: np.ndarray, friction: np.ndarray) -> SideWalls:
    """The innermost plane of each side."""
    present, position, speed, amplitude = np.zeros(6, bool), np.zeros(6), np.zeros(6), np.zeros(6)
    e, mu, names = np.ones((6, len(restitution))), np.zeros((6, len(restitution))), [""] * 6
    for plane in walls:
        side = _side_of(plane) if isinstance(plane, Plane) else None
        if side is None or not isinstance(plane, Plane):
            raise TypeError(f"wall {plane.name!r} is no plane along an axis")  # refused before
        inward, coordinate = 1 - 2 * (side % 2), plane.point[side // 2]
        if present[side] and (coordinate - position[side]) * inward <= 0:
            continue  # behind another wall of this side
        present[side], position[side], names[side] = True, coordinate, plane.name
        e[side] = restitution[:, scene.material_index[plane.material]]
        mu[side] = friction[:, scene.material_index[plane.material]]
        speed[side] = plane.vibration.speed if plane.vibration else 0.0
        amplitude[side] = plane.vibration.amplitude if plane.vibration else 0.0
    return SideWalls(present, position, e, mu, speed, amplitude, tuple(names))
