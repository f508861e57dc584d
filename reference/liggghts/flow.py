"""Net flow through planes and faces.

Of a plane: from the particles and mass beyond it in the thermo rows; what has passed is what is beyond, and
what left from there, less what came there. Of a face, and of a plane where it is not known on which side a
particle was when it left: from the crossings, which are summed up in every step. (The binary's own
`fix massflow/mesh` counts one direction only.)
"""

from __future__ import annotations

import dataclasses

import numpy as np

from gpudem.scene import Scene
from gpudem.scene.flow import beyond
from gpudem.scene.regions import Disc, Rectangle
from gpudem.scene.sections import FlowPlane
from reference.liggghts.walls import number

#: A particle that has just come has no place of the step before, and LIGGGHTS gives that of another one. It
#: counts where the way from there is at most so many times that of its velocity before and after the step.
MOST_WAY = 2.0


def _counted(scene: Scene) -> list[FlowPlane]:
    """Those whose crossings are summed up."""
    return [s for s in scene.output.flow if s.face is not None or _side_of_exit(scene, s) is None]


def _watched(scene: Scene) -> list[FlowPlane]:
    """Those of which it is told what is beyond."""
    return [plane for plane in scene.output.flow if plane not in _counted(scene)]


def formulas(scene: Scene) -> dict[str, str]:
    """Name -> the formula of a variable that is 1 for a particle beyond a plane."""
    return {plane.name: f"{_distance(plane, 'x', 'y', 'z')}>0" for plane in _watched(scene)}


def _distance(plane: FlowPlane, *place: str) -> str:
    """The formula of a distance from a plane times the length of its normal, of a place in words."""
    terms = [
        f"({number(n)})*({word}-({number(p)}))"
        for word, n, p in zip(place, plane.direction.tolist(), plane.origin.tolist(), strict=True)
        if n
    ]
    return f"({'+'.join(terms)})"


@dataclasses.dataclass(frozen=True)
class CrossingWords:
    """What a deck says to sum up the crossings of one surface."""

    name: str
    variables: tuple[tuple[str, str], ...]
    """Name and formula of each of its variables; of the last two the sum is wanted: crossings, their mass."""


def crossings(scene: Scene) -> list[CrossingWords]:
    """Every surface whose crossings are summed up."""
    return [_crossing(scene, surface) for surface in _counted(scene)]


def steps_back(scene: Scene) -> dict[str, str]:
    """Name -> formula of the variables of all crossings: the way back to the step before [m], and whether it
    can be one.
    """
    found = {}
    for k, axis in enumerate("xyz"):
        found[f"back_{axis}"] = _nearest(scene, k, f"(f_before_{axis}-{axis})")
    squares = ["+".join(f"{word.format(a)}^2" for a in "xyz") for word in ("v_back_{}", "v{}", "f{}")]
    dt, slack = number(scene.time.step), number(1e-6 * float(scene.state.radius.min()))
    most = f"({number(MOST_WAY)}*{dt})^2*({squares[1]}+({dt}/mass)^2*({squares[2]}))+({slack})^2"
    found["was_here"] = f"({squares[0]})<=({most})"
    return found


def _nearest(scene: Scene, k: int, way: str) -> str:
    """A component of a way between nearest images."""
    if not scene.domain.periodic[k]:
        return way
    length = number(scene.domain.hi[k] - scene.domain.lo[k])
    return f"({way}-{length}*round({way}/{length}))"


def _crossing(scene: Scene, surface: FlowPlane) -> CrossingWords:
    name, middle = surface.name, surface.origin.tolist()
    found = [
        (f"ahead_{name}", _distance(surface, "x", "y", "z")),
        (f"behind_{name}", _distance(surface, "f_before_x", "f_before_y", "f_before_z")),
    ]
    within = "1"
    if surface.face is not None:
        apart = f"(v_ahead_{name}-v_behind_{name})"
        found.append((f"share_{name}", f"v_ahead_{name}/({apart}+({apart}==0))"))
        place = [f"v_offset_{axis}_{name}" for axis in "xyz"]
        for k, axis in enumerate("xyz"):
            way = f"({axis}+v_share_{name}*v_back_{axis}-({number(middle[k])}))"
            found.append((f"offset_{axis}_{name}", _nearest(scene, k, way)))
        within = _within(surface, place)
    sides = f"((v_ahead_{name}>0)-(v_behind_{name}>0))"
    found.append((f"crossing_{name}", f"{sides}*v_was_here*{within}"))
    found.append((f"weight_{name}", f"mass*v_crossing_{name}"))
    return CrossingWords(name, tuple(found))


def _within(surface: FlowPlane, place: list[str]) -> str:
    """Whether a place, in words from the center of the face, is within it."""
    face = surface.face
    if isinstance(face, Disc):
        return f"(({'+'.join(f'{word}^2' for word in place)})<={number(face.radius)}^2)"
    assert isinstance(face, Rectangle)
    sides = []
    for edge in face.edges:
        length = float(np.linalg.norm(edge))
        along = "+".join(f"({number(e / length)})*{w}" for e, w in zip(edge, place, strict=True) if e)
        sides.append(f"(({along})^2<={number(length / 2)}^2)")
    return "*".join(sides)


def columns(scene: Scene) -> list[str]:
    """Columns of a thermo line: particles and mass [kg] beyond each plane; of each other surface crossings
    and their mass [kg], means over the steps since the line before.
    """
    watched = [f"{what}_{plane.name}" for plane in _watched(scene) for what in ("beyond", "mass_beyond")]
    return watched + _sums(scene)


def _sums(scene: Scene) -> list[str]:
    """Names of the columns of crossings and their mass."""
    return [f"{what}_{s.name}" for s in _counted(scene) for what in ("crossed", "mass_crossed")]


def summed(scene: Scene, column: dict[str, np.ndarray], stride: int) -> dict[str, np.ndarray]:
    """The columns of crossings as sums since the start.

    column: of all thermo lines, `stride` steps apart.
    """
    return {name: np.cumsum(column[name] * stride) for name in _sums(scene)}


def _side_of_exit(scene: Scene, plane: FlowPlane) -> bool | None:
    """Whether all that leaves is beyond a plane; None: it may be or not."""
    if len(scene.exits) != 1:
        return None if scene.exits else False
    (side,) = scene.exits
    axis = "xyz".index(side.name[0])
    if any(n for k, n in enumerate(plane.direction.tolist()) if k != axis):
        return None
    return bool(plane.direction[axis] * side.vector[axis] < 0)


def history(scene: Scene, column: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """flow_count_NAME and flow_mass_NAME from the columns of thermo lines, those of `summed`, and `step`."""
    found, steps, counted = {}, column["step"], _counted(scene)
    come = np.searchsorted(scene.arrival_steps, steps, side="right")
    for surface in scene.output.flow:
        count, mass = f"flow_count_{surface.name}", f"flow_mass_{surface.name}"
        if surface in counted:
            found[count], found[mass] = (
                column[f"{what}_{surface.name}"] for what in ("crossed", "mass_crossed")
            )
        else:
            first = beyond(surface, scene.state.position)
            for name, there, weight, gone in (
                (count, f"beyond_{surface.name}", np.ones(len(first)), "removed"),
                (mass, f"mass_beyond_{surface.name}", scene.masses, "removed_mass"),
            ):
                total = np.concatenate([[0.0], np.cumsum(weight * first)])[come]
                left = column[f"{gone}_{scene.exits[0].name}"] if _side_of_exit(scene, surface) else 0
                found[name] = column[there] + left - total
        found[count] = np.rint(found[count]).astype(np.int64)
    return found


def problems(scene: Scene) -> list[str]:
    """Surfaces whose variables would have one name in a deck."""
    names = {surface.name for surface in scene.output.flow}
    return [
        f"output.flow: {name}: LIGGGHTS' deck has a variable of this name for {name[5:]}"
        for name in names
        if name.startswith("mass_") and name[5:] in names
    ]
