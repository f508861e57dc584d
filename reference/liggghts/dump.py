"""LIGGGHTS output -> the common form: VTU frames, trace arrays, history table."""

from __future__ import annotations

import shutil
import struct
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gpudem.output import observables
from gpudem.output.frames import FrameWriter
from gpudem.output.run import HISTORY_COLUMNS, TRACE_COLUMNS
from gpudem.output.vtu import Frame, FrameError, read_vtu
from gpudem.scene import Scene
from reference.liggghts import flow, groups, removal, wall_loads
from reference.liggghts.deck import RAW, history_columns, thermo_stride
from reference.liggghts.errors import LiggghtsOutputError

if TYPE_CHECKING:
    import pandas

#: Array of a LIGGGHTS .vtu -> column of a frame.
VTU_COLUMNS = {
    "id": "id", "type": "material", "c_position[1-3]": "position",
    "v": "velocity", "omega": "angular_velocity",
    "radius": "radius", "f": "force", "tq": "torque",
}  # fmt: skip
#: Columns of the trace: id and five vectors.
TRACE_WIDTH = 16
SNAPSHOT, CHUNK = struct.Struct("=qq7i6dii"), struct.Struct("=i")


def frames(scene: Scene, directory: Path) -> None:
    """Convert every raw frame into frames/ and run.pvd, then delete the raw ones.

    Raises LiggghtsOutputError naming file and step where one is missing, truncated, incomplete or not finite.
    """
    writer, ways = FrameWriter(directory, scene), wall_loads.servo_ways(scene, directory / RAW)
    for step in range(0, scene.n_steps + 1, scene.frame_stride):
        raw = frame(scene, directory / RAW / f"p_{step:09d}.vtu", step)
        forces = wall_loads.triangle_forces(scene, directory / RAW, step)
        writer.add(step, raw, {name: way[step] for name, way in ways.items()}, forces)
    shutil.rmtree(directory / RAW)


def frame(scene: Scene, path: Path, step: int) -> Frame:
    """One raw LIGGGHTS .vtu as a frame, in order of id. Raises LiggghtsOutputError naming file and step."""
    try:
        raw = read_vtu(path)
    except FrameError as error:
        raise LiggghtsOutputError(f"step {step}: {error}") from error
    missing = [name for name in VTU_COLUMNS if name not in raw]
    if missing:
        raise LiggghtsOutputError(
            f"{path}: step {step}: no array {', '.join(missing)}; found: {', '.join(raw)}"
        )
    table = {column: raw[name] for name, column in VTU_COLUMNS.items()}
    if groups.any_frozen(scene):
        for column in ("force", "torque"):
            table[column] = table[column] + raw[f"f_frozen_{column}[1-3]"]
    ids = table["id"].astype(np.int64)
    order = np.argsort(ids, kind="stable")
    ids, table = ids[order], {name: column[order] for name, column in table.items()}
    if wrong := _wrong_ids(scene, ids, step):
        raise LiggghtsOutputError(f"{path}: step {step}: {len(ids)} particles, {wrong}")
    broken = [name for name, column in table.items() if not np.isfinite(column).all()]
    if broken:
        raise LiggghtsOutputError(f"{path}: step {step}: {', '.join(broken)} not finite")
    table["id"] = ids
    table["material"] = table["material"].astype(np.int32) - 1
    table["position"] = wrap(scene, table["position"])
    return table


def _wrong_ids(scene: Scene, ids: np.ndarray, step: int) -> str:
    """What is wrong with the ids of a step, as a list in order; "" if nothing is."""
    come = scene.count_at(step)
    if not scene.exits:
        return "" if np.array_equal(ids, np.arange(1, come + 1)) else f"not ids 1 to {come} in order"
    inside = len(ids) == 0 or (ids[0] >= 1 and ids[-1] <= come)
    return "" if inside and (np.diff(ids) > 0).all() else f"not some of the ids 1 to {come} in order"


def wrap(scene: Scene, position: np.ndarray) -> np.ndarray:
    """Positions in lo <= x < hi along periodic sides; LIGGGHTS moves them in at list rebuilds only."""
    position = np.array(position, np.float64)
    for k in range(3):
        if scene.domain.periodic[k]:
            lo, hi = scene.domain.lo[k], scene.domain.hi[k]
            x = position[..., k]
            x[x < lo] += hi - lo
            x[x >= hi] -= hi - lo
    return position


def trace(scene: Scene, path: Path) -> dict[str, np.ndarray]:
    """The binary dump of every trace interval: step (t,), time (t,), TRACE_COLUMNS, each (t, n, 3), in id
    order; NaN before a particle has come, and after it has left.

    Raises LiggghtsOutputError naming file and step where it is missing, truncated or corrupted.
    """
    stride = scene.stride(scene.output.trace_every)
    steps, n = np.arange(0, scene.n_steps + 1, stride), len(scene.state)
    if not path.is_file():
        raise LiggghtsOutputError(f"{path}: no such dump (steps 0 to {steps[-1]} expected)")
    content, at = path.read_bytes(), 0
    values = np.full((len(steps), n, TRACE_WIDTH + 6 * groups.any_frozen(scene)), np.nan)
    for k, step in enumerate(steps):
        try:
            table, at = _snapshot(content, at, int(step), len(scene.state), values.shape[2])
            ids = table[:, 0].astype(np.int64)
            if wrong := _wrong_ids(scene, np.sort(ids), int(step)):
                raise ValueError(wrong)
            values[k, ids - 1] = table
        except (ValueError, struct.error) as error:
            raise LiggghtsOutputError(f"{path}: truncated or corrupted at step {step}: {error}") from None
    if at != len(content):
        raise LiggghtsOutputError(f"{path}: {len(content) - at} bytes after the last step {steps[-1]}")
    if groups.any_frozen(scene):
        values[..., 10:16] += values[..., 16:]  # mutate: force_on_frozen_in_trace
    columns = {name: values[..., 1 + 3 * i : 4 + 3 * i].copy() for i, name in enumerate(TRACE_COLUMNS)}
    columns["position"] = wrap(scene, columns["position"])
    return {"step": steps, "time": steps * scene.time.step, **columns}


def _snapshot(content: bytes, at: int, step: int, n: int, wanted: int) -> tuple[np.ndarray, int]:
    """One step of a LIGGGHTS binary dump from byte `at`: table of at most n rows, `wanted` columns, and where
    the next begins.

    Header: step, particles (int64), triclinic and six boundary flags (int32), box (6 float64), columns,
    chunks (int32); then a chunk per rank: its length (int32) and numbers (float64).
    """
    found_step, particles, *_, width, chunks = SNAPSHOT.unpack_from(content, at)
    if (found_step, width) != (step, wanted) or not 0 <= particles <= n:
        raise ValueError(f"found step {found_step} with {particles} particles and {width} columns")
    at += SNAPSHOT.size
    parts = []
    for _ in range(chunks):
        (length,) = CHUNK.unpack_from(content, at)
        if not 0 <= length <= n * wanted:
            raise ValueError(f"chunk of {length} numbers")
        parts.append(np.frombuffer(content, np.float64, length, at + CHUNK.size))
        at += CHUNK.size + 8 * length
    table = np.concatenate(parts).reshape(particles, wanted)
    if not np.isfinite(table).all():
        raise ValueError("not a number (nan)")
    return table, at


def history(scene: Scene, blocks: list[list[str]], raw: Path) -> pandas.DataFrame | None:
    """Thermo rows -> HISTORY_COLUMNS, one row for each multiple of the history interval.

    A gate removal ends one `run` and starts another, which prints the same step again with the gate gone:
    the row BEFORE the new set-up is kept. `contacts` = particle-particle plus particle-wall contacts, left
    out where meshes come or go (`walls.same_meshes`);
    potential energy = - sum(m) g . centre [J]; columns of walls follow (`wall_loads.history`), some of them
    from files in the folder of raw output. Raises LiggghtsOutputError where a row is missing or broken.
    """
    import pandas

    stride = scene.stride(scene.output.history_every)
    if stride is None:
        return None
    names = history_columns(scene)
    parts = []
    for (_, _, present), rows in zip(scene.segments, blocks, strict=True):
        try:
            table = (
                np.array([row.split() for row in rows], dtype="S").astype(np.float64).reshape(-1, len(names))
            )
        except ValueError as error:
            raise LiggghtsOutputError(f"thermo rows are not {len(names)} numbers each: {error}") from None
        counted = [f"touch_{w.name}" for w in present if f"touch_{w.name}" in names]
        counted += ["mesh_contacts"] if "mesh_contacts" in names else []
        walls = sum(table[:, names.index(name)] for name in counted)
        # LIGGGHTS counts a contact of two particles at both
        parts.append(np.column_stack([table, table[:, names.index("touches")] / 2 + walls]))
    column = _at_rows_of_history(scene, [*names, "contacts"], np.concatenate(parts))
    centre = np.stack([column[f"centre_{a}"] for a in "xyz"], axis=1)
    column["time"] = column["step"] * scene.time.step
    mass = _mass(scene, column["step"])
    removal.check(scene, column)
    if scene.exits:
        come = np.array([scene.count_at(int(step)) for step in column["step"]])
        column |= removal.history(scene, column, come, mass)
        mass = column["mass"]
    column["particles"] = np.rint(column["particles"]).astype(np.int64)
    if scene.insert or scene.exits:
        centre = np.divide(centre, mass[:, None], out=np.full_like(centre, np.nan), where=mass[:, None] > 0)
        column |= {f"centre_{axis}": centre[:, k] for k, axis in enumerate("xyz")}
        column["front_x"] = np.where(mass > 0, column["front_x"], np.nan)
    gravity = scene.gravity_at(column["step"])
    column["potential_energy"] = -mass * np.sum(np.nan_to_num(centre) * gravity, axis=1)
    column["contacts"] = column["contacts"].round().astype(np.int64)
    column.setdefault("rotational_energy", np.zeros(len(column["step"])))
    if scene.meshes and "mesh_contacts" not in names:
        del column["contacts"]
    kept = [*HISTORY_COLUMNS, *({"particles"} & set(scene.output.history or ()))]
    usual = {name: column[name] for name in kept if name in column}
    found = usual | wall_loads.history(scene, raw, column) | groups.history(scene, raw, column)
    found |= {name: column[name] for name in column if name.startswith("removed_")}  # gpudem's order
    return observables.with_rates(pandas.DataFrame(found | flow.history(scene, column)), scene)


def _at_rows_of_history(scene: Scene, names: list[str], rows: np.ndarray) -> dict[str, np.ndarray]:
    """Columns by name of the thermo lines that are rows of the history, crossings as sums since the start.

    Raises LiggghtsOutputError where lines are missing.
    """
    stride, between = scene.stride(scene.output.history_every), thermo_stride(scene)
    assert stride is not None
    _, first = np.unique(rows[:, 0], return_index=True)
    rows = rows[first]
    rows = rows[rows[:, 0] % between == 0]  # without the ends of runs
    column = dict(zip(names, rows.T, strict=True))
    column |= flow.summed(scene, column, between)
    wanted = column["step"] % stride == 0
    column = {name: values[wanted] for name, values in column.items()}
    column["step"] = column["step"].astype(np.int64)
    if not np.array_equal(column["step"], np.arange(0, scene.n_steps + 1, stride)):
        raise LiggghtsOutputError(f"thermo rows do not cover every {stride} steps to {scene.n_steps}")
    return column


def mean_count(scene: Scene, blocks: list[list[str]]) -> int:
    """How many particles there are on average over the steps; where some leave, over the thermo rows."""
    if not scene.exits:
        return scene.mean_count(scene.n_steps)
    at = history_columns(scene).index("particles")
    return round(float(np.mean([float(row.split()[at]) for rows in blocks for row in rows])))


def _mass(scene: Scene, steps: np.ndarray) -> np.ndarray:
    """Mass of all particles that there are in these steps [kg]."""
    density = np.array([m.density for m in scene.materials.values()])[scene.state.material]
    total = np.concatenate([[0.0], np.cumsum(density * 4 / 3 * np.pi * scene.state.radius**3)])
    return total[[scene.count_at(int(step)) for step in steps]]
