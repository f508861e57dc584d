"""Checks of walls beyond their single fields: meshes that cannot be used, places, periodic sides, units.

Each check reads some sections of a scene and returns its problems, one line each (`gpudem.scene.checks`).
"""

from __future__ import annotations

import collections
import math
from typing import TYPE_CHECKING

import numpy as np

from gpudem.scene import wall_phases
from gpudem.scene.files import nearest
from gpudem.scene.mesh_repair import MAX_TRIANGLES
from gpudem.scene.motion import Servo, Translation, Turn
from gpudem.scene.round_walls import Cylinder, Round
from gpudem.scene.walls import NORMAL_ROUNDING, Box, Wall

if TYPE_CHECKING:
    from gpudem.scene.model import Scene

#: A mesh this many times as large as the domain, or as small beside the smallest radius, is in another unit.
UNLIKELY_SIZE = 100
#: Time steps in a period of a wall that moves, at least.
MIN_PERIOD = 10


def meshes(scene: Scene) -> list[str]:
    """Meshes without usable triangles, and more triangles than indices."""
    found, count = [], 0
    for mesh in scene.meshes:
        try:
            count += len(mesh.corners)
        except ValueError as error:
            found.append(f"walls: {mesh.name}.{error}")
    if count > MAX_TRIANGLES:
        found.append(f"walls: {count} triangles are too many for 32-bit indices; allowed: <= {MAX_TRIANGLES}")
    return found


def statements(scene: Scene) -> list[str]:
    """Names given twice, boxes upside down, planes across periodic sides, a saw-tooth beside other motion."""
    found = []
    for i, wall in enumerate(scene.walls):
        if isinstance(wall, Box):
            lo, hi = wall.lo or scene.domain.lo, wall.hi or scene.domain.hi
            if not all(b > a for a, b in zip(lo, hi, strict=True)):
                found.append(f"walls[{i}].hi = {hi}: must be above lo = {lo} in x, y and z [m]")
    names = [[wall.name for wall in scene.walls], [part.name for part in scene.wall_elements]]
    twice = [name for some in names for name, count in collections.Counter(some).items() if count > 1]
    found += [f"walls: name {name!r} given twice" for name in dict.fromkeys(twice)]
    servos = [wall for wall in scene.wall_elements if any(isinstance(m, Servo) for m in wall.motion)]
    found += [f"walls: {w.name}.motion: a servo beside other motions; a servo must be the only one"
              for w in servos if len(w.motion) > 1]  # fmt: skip
    for plane in scene.planes:
        if any(p and n for p, n in zip(scene.domain.periodic, plane.normal, strict=True)):
            axes = [a for a, p, n in zip("xyz", scene.domain.periodic, plane.normal, strict=True) if p and n]
            found.append(f"walls: {plane.name} bounds {', '.join(axes)}, which is periodic")
        if plane.vibration is not None and (plane.motion or plane.surface_velocity):
            key = "motion" if plane.motion else "surface_velocity"
            found.append(f"walls: {plane.name}.vibration: beside {key}; state one of the two")
    return found


def forces(scene: Scene) -> list[str]:
    """Forces and stress asked for of walls that are not there, or where there are none."""
    known, wanted = [wall.name for wall in scene.wall_elements], scene.output.wall_forces
    unknown = [name for name in wanted if name not in known]
    found = [f"output.wall_forces: {name!r} is no wall{nearest(name, known)}" for name in unknown]
    if wanted and scene.output.history_every is None:
        found.append("output.wall_forces: has no effect without output.history_every [s]")
    for name in scene.output.wall_stress:
        if name not in known:
            found.append(f"output.wall_stress: {name!r} is no wall{nearest(name, known)}")
        elif name not in [mesh.name for mesh in scene.meshes]:
            found.append(f"output.wall_stress: {name!r} is no mesh, and has no triangles")
    return found


def sizes(scene: Scene) -> list[str]:
    """Meshes in another unit of length: far larger than the domain, or far smaller than a particle."""
    if "unusual_units" in scene.allow:
        return []
    found, waive = [], "waive with allow = ['unusual_units']"
    domain = float(np.linalg.norm(np.subtract(scene.domain.hi, scene.domain.lo)))
    smallest = float(scene.stated_particles.radius.min())
    for mesh in scene.meshes:
        size = float(np.linalg.norm(np.subtract(*mesh.bounds())))
        if size > UNLIKELY_SIZE * domain:
            hint = f"a file in millimetres needs scale = {0.001 * mesh.scale:g}"
            found.append(
                f"walls: {mesh.name} is {size:.3g} m across, the domain {domain:.3g} m; {hint}; {waive}"
            )
        elif size < smallest / UNLIKELY_SIZE:
            hint = f"scaled twice? scale = {mesh.scale:g}"
            found.append(
                f"walls: {mesh.name} is {size:.3g} m across, the smallest radius {smallest:.3g} m; {hint};"
                f" {waive}"
            )
    return found


def reachable(scene: Scene) -> list[str]:
    """Walls beyond the domain: particles would leave it, which is an error, before they meet the wall.

    A wall that moves may come into the domain; where it stands at the start says nothing.
    """
    lo, hi = np.array(scene.domain.lo), np.array(scene.domain.hi)
    found, rounding = [], 1e-9 * float(np.linalg.norm(hi - lo))
    moving = wall_phases.with_motion(scene)
    for plane in scene.planes:
        normal, point = np.array(plane.normal), np.array(plane.point)
        nearest = np.where(normal > 0, lo, hi)  # the corner of the domain deepest behind the wall
        if plane.name not in moving:
            _outside(found, plane, float((nearest - point) @ normal), rounding)
    for wall in scene.wall_elements:
        if wall.name in moving:
            continue
        bounds = wall.bounds()
        if bounds is not None:
            apart = np.maximum(bounds[0] - hi, lo - bounds[1])
            _outside(found, wall, float(np.linalg.norm(np.maximum(apart, 0.0))), rounding)
        elif isinstance(wall, Cylinder):
            corners = np.stack(np.meshgrid(*zip(lo, hi, strict=True)), axis=-1).reshape(-1, 3) - wall.point
            away = np.linalg.norm(np.cross(corners, wall.unit_axis), axis=1)
            _outside(found, wall, wall.radius - float(away.max()), rounding)
    return found


def _outside(found: list[str], wall: Wall, gap: float, rounding: float) -> None:
    if gap > rounding:
        hint = " (a file in millimetres needs scale = 0.001)" if wall.kind == "mesh" else ""
        found.append(
            f"walls: {wall.name} lies {gap:.3g} m outside the domain; no particle can reach it{hint}"
        )


def across_periodic_sides(scene: Scene, contact_range: float) -> list[str]:
    """Cylinders and cones that particles would have to meet through a periodic side, which they cannot.

    Along its axis an infinite cylinder needs no image.
    """
    found, reach = [], float(scene.state.radius.max()) + contact_range
    for wall in scene.wall_elements:
        if not isinstance(wall, Round):
            continue
        bounds = wall.bounds()
        for k, axis in enumerate("xyz"):
            if not scene.domain.periodic[k]:
                continue
            if bounds is None:
                if abs(wall.unit_axis[k]) < 1 - 1e-12:
                    found.append(
                        f"walls: {wall.name} is infinite and not along {axis}, which is periodic; allowed: an"
                        f" axis along {axis}, or a length between the sides"
                    )
            elif bounds[0][k] - reach < scene.domain.lo[k] or bounds[1][k] + reach > scene.domain.hi[k]:
                along = isinstance(wall, Cylinder) and abs(wall.unit_axis[k]) >= 1 - 1e-12
                hint = "; without length it goes on through it" if along else ""
                found.append(
                    f"walls: {wall.name} comes within {reach:g} m (largest radius) of a side across {axis},"
                    f" which is periodic: particles beyond it would not meet the wall{hint}"
                )
    return found


def motions(scene: Scene) -> list[str]:
    """Walls that move too fast or too often for the time step, or that a periodic side does not allow."""
    found, step, radius = [], scene.time.step, float(scene.state.radius.min())
    parts = wall_phases.motions(scene)
    for wall, speed in zip(scene.wall_elements, scene.wall_speeds, strict=True):
        key = f"walls: {wall.name}.motion"
        if wall.name not in parts:
            continue
        if speed * step >= radius and "speed" not in scene.allow:
            found.append(f"{key}: moves up to {speed:.3g} m/s within the domain, {speed * step:.3g} m in a"
                         f" step; allowed: < the smallest radius, {radius:g} m;"
                         " waive with allow = ['speed']")  # fmt: skip
        for motion in (motion for _, motions in parts[wall.name] for motion in motions):
            cycle = math.inf if motion.cycle is None else motion.cycle
            if cycle < MIN_PERIOD * step and "time_step" not in scene.allow:
                found.append(f"{key}.period = {cycle:g} s: is {cycle / step:.3g} time steps;"
                             f" allowed: >= {MIN_PERIOD}; waive with allow = ['time_step']")  # fmt: skip
            found += [f"{key}: {problem}" for problem in _turn_at_periodic_side(scene, wall, motion)]
    return list(dict.fromkeys(found))


def _turn_at_periodic_side(scene: Scene, wall: Wall, motion: Translation | Turn) -> list[str]:
    """A wall without ends must go on through a periodic side unchanged: it turns about that axis only."""
    if not isinstance(motion, Turn) or wall.reach_points() is not None:
        return []
    across = [
        name
        for name, unit, periodic in zip("xyz", np.eye(3), scene.domain.periodic, strict=True)
        if periodic and np.linalg.norm(np.cross(unit, motion.unit_axis)) > NORMAL_ROUNDING
    ]
    kind = f"a {wall.kind} without ends that turns about {motion.axis}"
    return [f"{kind} would cross {', '.join(across)}, which is periodic"] if across else []
