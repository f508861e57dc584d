"""Net flow through planes: from the particles and mass beyond each plane in the thermo rows.

What has passed is what is beyond, and what left from there, less what came there.
"""

from __future__ import annotations

import numpy as np

from gpudem.scene import Scene
from gpudem.scene.flow import beyond
from gpudem.scene.sections import FlowPlane
from reference.liggghts.walls import number


def formulas(scene: Scene) -> dict[str, str]:
    """Name -> the formula of a variable that is 1 for a particle beyond a plane."""
    found = {}
    for plane in scene.output.flow:
        terms = [
            f"({number(n)})*({a}-({number(p)}))"
            for a, n, p in zip("xyz", plane.normal, plane.point, strict=True)
            if n
        ]
        found[plane.name] = f"({'+'.join(terms)})>0"
    return found


def columns(scene: Scene) -> list[str]:
    """Columns of a thermo line: particles and mass [kg] beyond each plane."""
    return [f"{what}_{plane.name}" for plane in scene.output.flow for what in ("beyond", "mass_beyond")]


def _side_of_exit(scene: Scene, plane: FlowPlane) -> bool | None:
    """Whether all that leaves is beyond a plane; None: it may be or not."""
    if len(scene.exits) != 1:
        return None if scene.exits else False
    (side,) = scene.exits
    axis = "xyz".index(side.name[0])
    if any(n for k, n in enumerate(plane.normal) if k != axis):
        return None
    return plane.normal[axis] * side.vector[axis] < 0


def history(scene: Scene, column: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """flow_count_NAME and flow_mass_NAME from the columns of thermo lines, and `step`."""
    found, steps = {}, column["step"]
    come = np.searchsorted(scene.arrival_steps, steps, side="right")
    for plane in scene.output.flow:
        left_beyond = _side_of_exit(scene, plane)
        if left_beyond is None:
            continue
        first = beyond(plane, scene.state.position)
        for what, weight, gone in (
            ("count", np.ones(len(first)), "removed"),
            ("mass", scene.masses, "removed_mass"),
        ):
            total = np.concatenate([[0.0], np.cumsum(weight * first)])[come]
            name = f"beyond_{plane.name}" if what == "count" else f"mass_beyond_{plane.name}"
            left = column[f"{gone}_{scene.exits[0].name}"] if left_beyond else 0
            found[f"flow_{what}_{plane.name}"] = column[name] + left - total
        found[f"flow_count_{plane.name}"] = np.rint(found[f"flow_count_{plane.name}"]).astype(np.int64)
    return found


def warnings(scene: Scene) -> list[str]:
    """What a history of LIGGGHTS leaves out."""
    unknown = [plane.name for plane in scene.output.flow if _side_of_exit(scene, plane) is None]
    return [
        f"history columns flow_*_{name} are left out: LIGGGHTS does not tell on which side of the plane a"
        " particle was when it left"
        for name in unknown
    ]
