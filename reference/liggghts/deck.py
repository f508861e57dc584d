"""Scene -> LIGGGHTS input: a deck (commands) and a data file (particles), the same text for the same physics.

Nothing of a scene reaches the deck but numbers, axis letters and wall names (letters, digits, underscore):
a deck can run shell commands, so titles and other free text never enter it. Each section is one template in
`templates/`, and is rendered only where `scene.needs` asks for it.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import itertools
import math
from pathlib import Path
from typing import Any

from gpudem.extras import from_extra
from gpudem.scene import Scene
from reference.liggghts import flow, groups, insertion, limits, removal, wall_loads, walls
from reference.liggghts.contact_model import atom_types, model, properties, switches
from reference.liggghts.decomposition import processors

with from_extra():
    import jinja2

DECK, DATA, LOG, RAW = "deck.in", "particles.data", "log.liggghts", "raw"
"""Names in the run directory; RAW is the folder of unconverted dumps."""
TRACE = f"{RAW}/trace.bin"

#: Columns of dumps with the force and torque on frozen particles, which are 0 in the usual columns.
FROZEN_COLUMNS = tuple(f"f_frozen_{what}[{k}]" for what in ("force", "torque") for k in (1, 2, 3))

#: About so many progress lines per run, whatever the history interval.
PROGRESS_LINES = 100
#: Young's modulus below which LIGGGHTS wants `soft_particles yes` [Pa].
SOFT = 5e6


@dataclasses.dataclass(frozen=True)
class Segment:
    """One `run` command."""

    first: int
    """Step at its start."""
    last: int
    """Step at its end."""
    walls: tuple[str, ...]
    """Names of the walls present."""
    particles: int
    """How many there are at its end."""


@dataclasses.dataclass(frozen=True)
class Deck:
    """What LIGGGHTS is given."""

    text: str
    """Commands (deck.in)."""
    data: str
    """Particles (particles.data), 17 digits."""
    segments: tuple[Segment, ...]
    meshes: dict[str, str] = dataclasses.field(default_factory=dict)
    """Name and text of the file of each mesh (STL), 17 digits."""
    may_lose: bool = False
    """Particles may leave."""

    @functools.cached_property
    def hash(self) -> str:
        """SHA-256 over commands, particles and meshes; knows no directory, no scene name, no title."""
        parts = (self.text, self.data, *(f"{name}\0{text}" for name, text in self.meshes.items()))
        return hashlib.sha256("\0".join(parts).encode()).hexdigest()

    def write(self, directory: Path) -> None:
        """Write all files that the commands read, and the folder of raw dumps. Raises OSError."""
        (directory / RAW).mkdir(parents=True, exist_ok=True)
        for name, text in {DECK: self.text, DATA: self.data, **self.meshes}.items():
            (directory / name).write_text(text)


#: Triangles near one ball, or balls near one, that the lists of LIGGGHTS hold unless the deck says more.
TRIANGLES_IN_LIST = 2000


def render(scene: Scene, ranks: int = 1) -> Deck:
    """The deck of a scene for a number of MPI ranks.

    Raises:
        LiggghtsCannotState: naming every item of the scene that LIGGGHTS has no words for.
    """
    limits.check(scene, ranks)
    segments = tuple(
        Segment(a, b, tuple(w.name for w in present), scene.count_at(b)) for a, b, present in scene.segments
    )
    facts = {
        "scene": scene, "needs": scene.needs, "segments": segments,
        "loads": wall_loads.loads(scene), "written": wall_loads.written(scene) + groups.written(scene),
        "primitives": walls.primitives(scene), "changes": walls.changes(scene),
        **_of_meshes(scene, segments[0]),
        "most_triangles": max((len(mesh.corners) for mesh in scene.meshes), default=0),
        "triangles_in_list": TRIANGLES_IN_LIST,
        "boundary": " ".join("p" if p else "f" for p in scene.domain.periodic),
        "watched": removal.watched(scene), "beyond": removal.beyond(scene), "planes": flow.formulas(scene),
        "crossings": flow.crossings(scene), "steps_back": flow.steps_back(scene),
        "checked_every": removal.checked_every(thermo_stride(scene)),
        "soft": any(m.young < SOFT for m in scene.materials.values()),
        "properties": properties(scene), "model": model(scene), "switches": switches(scene),
        "processors": processors(scene, ranks) if ranks > 1 else None,
        "gravity": gravity_words(scene.gravity), "phases": phases(scene),
        "thermo_stride": thermo_stride(scene), "frame_stride": scene.frame_stride,
        "trace_stride": scene.stride(scene.output.trace_every),
        # as many particles as at a set-up, with other ids: LIGGGHTS sorts them beyond the ends of its arrays
        "sorted_dumps": not (scene.insert and scene.exits),
        "data_file": DATA if scene.start_count else None, "raw": RAW, "trace_file": TRACE,
        "box": [side for sides in removal.box(scene) for side in sides],
        "kinds": len(atom_types(scene)),
        "inserted_kinds": insertion.kinds(scene), "inserted": insertion.balls(scene),
        "insertion_seeds": insertion.SEEDS,
        "groups": groups.groups(scene), "group_loads": groups.loads(scene),
        "mobile": "mobile" if scene.needs.held else "all",
        "held_columns": FROZEN_COLUMNS if groups.any_frozen(scene) else (),
        "any_frozen": groups.any_frozen(scene),
    }  # fmt: skip
    sections = [
        "header", "particles", "groups", "materials", "contact", "meshes", "walls", "gravity", "frozen",
        "insertion", "integration", "history", "frames", "trace", "run",
    ]  # fmt: skip
    present = {
        "groups": scene.needs.held,
        "frozen": groups.any_frozen(scene),
        "walls": scene.needs.walls,
        "meshes": bool(scene.meshes),
        "gravity": scene.needs.gravity,
        "insertion": bool(scene.insert),
        "trace": scene.output.trace_every is not None,
    }
    text = [_environment().get_template(f"{s}.j2").render(facts) for s in sections if present.get(s, True)]
    return Deck("".join(text), data(scene), segments, walls.mesh_files(scene), bool(scene.exits))


def _of_meshes(scene: Scene, first: Segment) -> dict[str, Any]:
    """What the templates read of the meshes of a scene, if there are any."""
    if not scene.meshes:
        return {"meshes": [], "first_meshes": [], "count_mesh_contacts": False}
    return {
        "count_mesh_contacts": walls.same_meshes(scene),
        "meshes": walls.meshes(scene), "curvature": scene.contact.mesh_curvature,
        "first_meshes": [mesh.name for mesh in scene.meshes if mesh.name in first.walls],
        "mesh_model": model(scene, scene.meshes[0]), "mesh_switches": switches(scene, scene.meshes[0]),
    }  # fmt: skip


@dataclasses.dataclass(frozen=True)
class PhaseWords:
    """What is stated anew before a run."""

    gravity: str | None
    properties: dict[int, tuple[str, str]]
    """Number of the property, from 1 -> name and values."""


def gravity_words(gravity: tuple[float, float, float]) -> str:
    """Magnitude [m/s2] and direction; LIGGGHTS wants a direction for 0 too."""
    size, number = math.sqrt(math.fsum(c * c for c in gravity)), walls.number
    return f"{number(size)} vector {' '.join(number(c) for c in (gravity if size else (0.0, 0.0, -1.0)))}"


def phases(scene: Scene) -> list[PhaseWords]:
    """What changes before each run but the first."""
    found, parts = [], [scene.phase_after(first) for first, _, _ in scene.segments]
    for before, after in itertools.pairwise(parts):
        old, new = properties(scene, before), properties(scene, after)
        changed = {k: b for k, (a, b) in enumerate(zip(old, new, strict=True), 1) if a != b}
        gravity = None if before.gravity == after.gravity else gravity_words(after.gravity)
        found.append(PhaseWords(gravity, changed))  # mutate: words_of_phase
    return found


def history_columns(scene: Scene) -> list[str]:
    """What the columns of a thermo line are, in order (LIGGGHTS cuts its own headings to eight letters)."""
    columns = [
        "step",
        "time",
        "particles",
        "kinetic_energy",
        "front_x",
        "centre_x",
        "centre_y",
        "centre_z",
        "touches",
    ]
    columns += ["rotational_energy"] if scene.needs.rotation else []
    columns += [f"touch_{name}" for name in walls.primitives(scene)]
    columns += ["mesh_contacts"] if walls.same_meshes(scene) else []
    columns += removal.columns(scene)
    columns += [word for load in wall_loads.loads(scene) for word in load.columns]
    columns += [word for load in groups.loads(scene) for word in load.columns]
    return columns + flow.columns(scene)


def thermo_stride(scene: Scene) -> int:
    """Steps between thermo lines: a divisor of the history interval, fine enough to show progress."""
    wanted = max(1, scene.n_steps // PROGRESS_LINES)
    stride = scene.stride(scene.output.history_every)
    if stride is None:
        return wanted
    return max(d for d in range(1, min(stride, wanted) + 1) if stride % d == 0)


def data(scene: Scene) -> str:
    """The read_data file: box, `id type diameter density x y z`, `id vx vy vz wx wy wz`; SI units."""
    s = scene.particles_at_start
    density = [scene.materials[name].density for name in scene.material_index]
    lines = ["gpudem particles", "", f"{len(s)} atoms", f"{len(atom_types(scene))} atom types", ""]
    lines += [
        f"{lo:.17g} {hi:.17g} {a}lo {a}hi" for (lo, hi), a in zip(removal.box(scene), "xyz", strict=True)
    ]
    lines += ["", "Atoms", ""]
    columns = zip(s.material.tolist(), s.radius.tolist(), s.position.tolist(), strict=True)
    lines += [
        f"{i} {m + 1} {2 * r:.17g} {density[m]:.17g} {x:.17g} {y:.17g} {z:.17g}"
        for i, (m, r, (x, y, z)) in enumerate(columns, 1)
    ]
    if s.velocity.any() or s.angular_velocity.any():
        lines += ["", "Velocities", ""]
        moving = zip(s.velocity.tolist(), s.angular_velocity.tolist(), strict=True)
        lines += [
            f"{i} {v[0]:.17g} {v[1]:.17g} {v[2]:.17g} {w[0]:.17g} {w[1]:.17g} {w[2]:.17g}"
            for i, (v, w) in enumerate(moving, 1)
        ]
    return "\n".join([*lines, ""])


@functools.cache
def _environment() -> jinja2.Environment:
    folder = Path(__file__).parent / "templates"
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(folder), undefined=jinja2.StrictUndefined,
        trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True, autoescape=False,
    )  # fmt: skip
    environment.filters["number"] = walls.number
    return environment
