"""Open sides in LIGGGHTS' words, and how a loss that the scene does not want is told from others.

At a side of boundary `f` a particle is dropped by the first rebuild of the list that finds its center beyond;
`thermo_modify lost ignore` lets the run go on. At the other sides of such a scene the box is larger than the
domain by the way of `checked_every` steps at the guard's largest speed, and as often the particles beyond the
domain are counted. (Boundaries that grow, `m`, have `insert/pack` draw other places.) The box is larger too
where meshes come beyond closed sides (`mesh_reach`), and particles beyond the domain are counted likewise.
"""

from __future__ import annotations

import numpy as np

from gpudem.scene import Scene
from reference.liggghts import mesh_reach
from reference.liggghts.errors import LiggghtsFailed
from reference.liggghts.walls import number

#: Steps between two counts of the particles beyond closed sides, at most.
MOST_STEPS = 10


def problems(scene: Scene) -> list[str]:
    """What LIGGGHTS has no words for."""
    return [
        f"remove.{stated.name}: in LIGGGHTS particles leave through open sides only"
        for stated in scene.remove
    ]


def watched(scene: Scene) -> bool:
    """Whether particles beyond closed sides are counted: the box is much larger than the domain there."""
    return bool(scene.exits) or bool(mesh_reach.beyond(scene))


def checked_every(stride: int) -> int:
    """Steps between two counts of the particles beyond closed sides; `stride`: those between thermo lines."""
    return max(d for d in range(1, min(stride, MOST_STEPS) + 1) if stride % d == 0)


def box(scene: Scene) -> list[tuple[float, float]]:
    """(lo, hi) [m] of the simulation box along x, y, z: the domain where periodic or open, else larger.

    LIGGGHTS takes an atom on the upper face of a fixed box for one outside; a margin of a tenth of a radius
    keeps it in, at an open side the next floating-point number.
    """
    radius, found = float(scene.state.radius.max()), []
    margin = (MOST_STEPS + 1) * radius if scene.exits else 0.1 * radius
    of_meshes = mesh_reach.beyond(scene)
    sides = zip("xyz", scene.domain.lo, scene.domain.hi, scene.domain.periodic, strict=True)
    for axis, lo, hi, periodic in sides:
        if not periodic:
            below, above = (margin + of_meshes.get(f"{axis}{end}", 0.0) for end in ("lo", "hi"))
            lo = lo if f"{axis}lo" in scene.domain.sides else lo - below
            hi = float(np.nextafter(hi, np.inf)) if f"{axis}hi" in scene.domain.sides else hi + above
        found.append((lo, hi))
    return found


def beyond(scene: Scene) -> str:
    """The formula of a variable that is 1 for a particle beyond a closed side."""
    found = []
    for k, axis in enumerate("xyz"):
        if not scene.domain.periodic[k]:
            for end, sign in (("lo", "<"), ("hi", ">")):
                if f"{axis}{end}" not in scene.domain.sides:
                    found.append(f"({axis}{sign}{number(getattr(scene.domain, end)[k])})")
    return "||".join(found) or "0"


def columns(scene: Scene) -> list[str]:
    """Columns of a thermo line: mass where particles leave, particles beyond closed sides on average."""
    return [*["mass"] * bool(scene.exits), *["beyond"] * watched(scene)]


def check(scene: Scene, column: dict[str, np.ndarray]) -> None:
    """Raises LiggghtsFailed where a particle was beyond a side that is not open."""
    bad = column.get("beyond", np.zeros(1)) > 0
    if bad.any():
        step = int(column["step"][np.argmax(bad)])
        names = ", ".join(stated.name for stated in scene.exits)
        raise LiggghtsFailed(
            f"a particle left the domain through a side that is not open, in or before step {step};"
            f" open: {names or 'none'}"
        )


def history(
    scene: Scene, column: dict[str, np.ndarray], come: np.ndarray, mass: np.ndarray
) -> dict[str, np.ndarray]:
    """removed_NAME and removed_mass_NAME from what has come and what is there: of one open side only."""
    if len(scene.exits) != 1:
        return {}
    name = scene.exits[0].name
    gone = come - np.rint(column["particles"]).astype(np.int64)
    return {f"removed_{name}": gone, f"removed_mass_{name}": np.where(gone > 0, mass - column["mass"], 0.0)}


def warnings(scene: Scene) -> list[str]:
    """What a history of LIGGGHTS leaves out."""
    if len(scene.exits) < 2 or scene.output.history_every is None:
        return []
    names = ", ".join(exit.name for exit in scene.exits)
    return [
        f"history columns removed_* and removed_mass_* are left out: LIGGGHTS does not tell through which of"
        f" {names} a particle left"
    ]
