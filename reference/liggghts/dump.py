"""LIGGGHTS output -> the common form: VTU frames, trace arrays, history table."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gpudem.frames import Frame, FrameError, FrameWriter, read_vtu
from gpudem.run import HISTORY_COLUMNS, TRACE_COLUMNS
from gpudem.scene import Scene
from reference.liggghts.deck import RAW, history_columns
from reference.liggghts.errors import LiggghtsOutputError

if TYPE_CHECKING:
    import pandas

#: Array of a LIGGGHTS .vtu -> column of a frame.
VTU_COLUMNS = {
    "id": "id", "type": "material", "c_position[1-3]": "position", "v": "velocity", "omega": "angular_velocity",
    "radius": "radius", "f": "force", "tq": "torque",
}  # fmt: skip
#: Lines before the table of each step in a text dump, and columns of the table (id and five vectors).
HEADER_LINES, TEXT_COLUMNS = 9, 16


def frames(scene: Scene, directory: Path) -> None:
    """Convert every raw frame into frames/ and run.pvd, then delete the raw ones.

    Raises LiggghtsOutputError naming file and step where one is missing, truncated, incomplete or not finite.
    """
    writer = FrameWriter(directory, scene)
    for step in range(0, scene.n_steps + 1, scene.frame_stride):
        writer.add(step, frame(scene, directory / RAW / f"p_{step:09d}.vtu", step))
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
    ids = np.arange(1, len(scene.state) + 1)
    if not np.array_equal(table["id"], ids):
        raise LiggghtsOutputError(
            f"{path}: step {step}: {len(table['id'])} particles, not ids 1 to {len(ids)} in order"
        )
    broken = [name for name, column in table.items() if not np.isfinite(column).all()]
    if broken:
        raise LiggghtsOutputError(f"{path}: step {step}: {', '.join(broken)} not finite")
    table["id"] = ids.astype(np.int64)
    table["material"] = table["material"].astype(np.int32) - 1
    table["position"] = wrap(scene, table["position"])
    return table


def wrap(scene: Scene, position: np.ndarray) -> np.ndarray:
    """Positions in lo <= x < hi along periodic sides; LIGGGHTS moves them in only when it rebuilds its list."""
    position = np.array(position, np.float64)
    for k in range(3):
        if scene.domain.periodic[k]:
            lo, hi = scene.domain.lo[k], scene.domain.hi[k]
            x = position[..., k]
            x[x < lo] += hi - lo
            x[x >= hi] -= hi - lo
    return position


def trace(scene: Scene, path: Path) -> dict[str, np.ndarray]:
    """The text dump of every trace interval: step (t,), time (t,), and TRACE_COLUMNS, each (t, n, 3), in id order.

    Raises LiggghtsOutputError naming file and step where it is missing, truncated or corrupted.
    """
    stride = scene.stride(scene.output.trace_every)
    steps = np.arange(0, scene.n_steps + 1, stride)
    n = len(scene.state)
    if not path.is_file():
        raise LiggghtsOutputError(f"{path}: no such dump (steps 0 to {steps[-1]} expected)")
    values = np.empty((len(steps), n, TEXT_COLUMNS))
    with path.open("rb") as file:
        for k, step in enumerate(steps):
            head = [file.readline() for _ in range(HEADER_LINES)]
            if head[1].strip() != b"%d" % step or head[3].strip() != b"%d" % n:
                raise LiggghtsOutputError(
                    f"{path}: truncated or corrupted at step {step}: header {head[1]!r} {head[3]!r}"
                )
            values[k] = _table(b"".join(file.readline() for _ in range(n)), n, path, int(step))
    if not np.array_equal(values[..., 0], np.broadcast_to(np.arange(1, n + 1), values.shape[:2])):
        raise LiggghtsOutputError(f"{path}: ids are not 1 to {n} in every step")
    columns = {name: values[..., 1 + 3 * i : 4 + 3 * i].copy() for i, name in enumerate(TRACE_COLUMNS)}
    columns["position"] = wrap(scene, columns["position"])
    return {"step": steps, "time": steps * scene.time.step, **columns}


def _table(text: bytes, n: int, path: Path, step: int) -> np.ndarray:
    """n lines of TEXT_COLUMNS numbers."""
    words = text.split()
    try:
        if len(words) != n * TEXT_COLUMNS or not text.endswith(b"\n"):
            raise ValueError(f"{len(words)} numbers for {n * TEXT_COLUMNS}")
        table = np.array(words, dtype="S").astype(np.float64).reshape(n, TEXT_COLUMNS)
    except ValueError as error:
        raise LiggghtsOutputError(f"{path}: truncated or corrupted at step {step}: {error}") from None
    if not np.isfinite(table).all():
        raise LiggghtsOutputError(f"{path}: step {step}: not a number (nan)")
    return table


def history(scene: Scene, blocks: list[list[list[str]]]) -> pandas.DataFrame | None:
    """Thermo rows -> HISTORY_COLUMNS, one row for each multiple of the history interval.

    A gate removal ends one `run` and starts another, which prints the same step again with the gate gone: the row
    BEFORE the new set-up is kept. `contacts` = particle-particle plus particle-wall contacts; potential energy
    = - sum(m) g . centre [J]. Raises LiggghtsOutputError where a row is missing or broken.
    """
    import pandas

    stride = scene.stride(scene.output.history_every)
    if stride is None:
        return None
    names = history_columns(scene)
    parts = []
    for (_, _, planes), rows in zip(scene.segments, blocks, strict=True):
        try:
            table = pandas.DataFrame(
                np.array(rows, dtype="S").astype(np.float64).reshape(-1, len(names)), columns=names
            )
        except ValueError as error:
            raise LiggghtsOutputError(f"thermo rows are not {len(names)} numbers each: {error}") from None
        walls = table[[f"touch_{p.name}" for p in planes]].sum(axis=1)
        parts.append(table.assign(contacts=table["touches"] / 2 + walls))
    table = pandas.concat(parts, ignore_index=True)
    table = table[table["step"] % stride == 0].drop_duplicates("step", keep="first").reset_index(drop=True)
    table["step"] = table["step"].astype(np.int64)
    if not np.array_equal(table["step"], np.arange(0, scene.n_steps + 1, stride)):
        raise LiggghtsOutputError(f"thermo rows do not cover every {stride} steps to {scene.n_steps}")
    state = scene.state
    density = np.array([m.density for m in scene.materials.values()])[state.material]
    mass = float(np.sum(density * 4 / 3 * np.pi * state.radius**3))
    centre = table[["centre_x", "centre_y", "centre_z"]].to_numpy()
    table["time"] = table["step"] * scene.time.step
    table["potential_energy"] = -mass * (centre @ np.array(scene.gravity))
    table["contacts"] = table["contacts"].round().astype(np.int64)
    if "rotational_energy" not in table:
        table["rotational_energy"] = 0.0
    return table[list(HISTORY_COLUMNS)]
