"""LIGGGHTS output kept for machines without the binary, found by the hash of the deck: one file a run.

`<deck hash>.npz.xz` holds `facts` (JSON in UTF-8), `trace.<column>` and `history.<column>` without loss, and
`frames.<column>` as `frame_dtype`. Columns of float64 are kept as `_packed` makes them.
"""

from __future__ import annotations

import datetime
import io
import json
import lzma
import platform
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

from gpudem.output import observables
from gpudem.output.frames import FrameWriter
from gpudem.run import Run, Timing
from gpudem.scene import Scene, checks
from reference.liggghts import wall_loads

FOLDER = Path(__file__).parent
SUFFIX = ".npz.xz"
#: Prefix of a column that is packed.
PACKED = "packed."
#: Particles of each frame where their number varies: the other columns are then of all frames in a row.
COUNT = "count"


def record(
    run: Run,
    folder: Path | None = None,
    frame_dtype: str = "float64",
    leave_out: Collection[str] = (),
) -> Path:
    """Keep a run, of a small scene only: the folder travels with the source. Returns the path of the file.

    `leave_out`: columns that are not kept, such as "trace.torque".
    """
    key = run.notes["deck_hash"]
    arrays = {f"trace.{name}": column for name, column in (run.trace or {}).items()}
    if run.history is not None:
        arrays |= {f"history.{name}": run.history[name].to_numpy() for name in run.history}
    frames = [{k: v for k, v in frame.items() if k != "points"} for frame in run.frames]
    counts = [len(frame["id"]) for frame in frames]
    if len(set(counts)) > 1:
        arrays[f"frames.{COUNT}"] = np.array(counts)
    for name in frames[0]:
        columns = [frame[name] for frame in frames]
        column = np.concatenate(columns) if len(set(counts)) > 1 else np.stack(columns)
        arrays[f"frames.{name}"] = column.astype(frame_dtype) if column.dtype == np.float64 else column
    facts = {
        "recorded": datetime.date.today().isoformat(), "machine": processor(), "version": run.version,
        "deck_hash": key, "scene": run.scene.name, "frame_dtype": frame_dtype, "warnings": run.warnings,
        "ranks": run.timing.cores, "stepping_s": run.timing.stepping_s, "left_out": sorted(leave_out),
    }  # fmt: skip
    kept = {
        f"{PACKED}{k}" if a.dtype == np.float64 else k: _packed(a) if a.dtype == np.float64 else a
        for k, a in arrays.items()
        if k not in leave_out
    }
    kept["facts"] = np.frombuffer(json.dumps(facts).encode(), np.uint8)
    content = io.BytesIO()
    np.savez(content, **kept)  # pyright: ignore[reportArgumentType]
    path = _path(key, folder)
    path.write_bytes(lzma.compress(content.getvalue(), preset=9))
    return path


def has(key: str, folder: Path | None = None) -> bool:
    """Whether output of exactly this deck is kept."""
    return _path(key, folder).is_file()


def recall(key: str, scene: Scene, directory: Path, folder: Path | None = None) -> Run:
    """The run kept for exactly this deck, written out in `directory`.

    Its timing is that of the machine it was recorded on, and `warnings` and `notes` say that it was recorded.
    Raises FileNotFoundError if there is none.
    """
    import pandas

    facts, parts = _read(_path(key, folder))
    writer, frames = FrameWriter(directory, scene), dict(parts["frames"])
    if (counts := frames.pop(COUNT, None)) is not None:
        frames = {name: np.split(column, np.cumsum(counts)[:-1]) for name, column in frames.items()}
    for k, step in enumerate(range(0, scene.n_steps + 1, scene.frame_stride)):
        frame = {name: column[k] for name, column in frames.items()}
        writer.add(step, {n: c.astype(np.float64) if c.dtype.kind == "f" else c for n, c in frame.items()})
    where = f"{facts['recorded']} on {facts['machine']} with {facts['version']}"
    warning = f"LIGGGHTS was not run here: recorded {where}; frames as {facts['frame_dtype']}"
    warning += f", without {', '.join(facts['left_out'])}" if facts["left_out"] else ""
    warning += "; stress on triangles is not kept: nan" if scene.output.wall_stress else ""
    timing = Timing(len(scene.state), scene.n_steps, stepping_s=facts["stepping_s"], cores=facts["ranks"])
    history, left_out = None, []
    if parts["history"]:
        table = pandas.DataFrame(parts["history"])
        history, left_out = observables.select(table, wall_loads.chosen(scene), "LIGGGHTS")
    run = Run(
        "liggghts", facts["version"], scene, directory, timing,
        warnings=list(dict.fromkeys([*checks.warnings(scene), *facts["warnings"], *left_out, warning])),
        notes={"deck_hash": key, "ranks": facts["ranks"], "recorded": True, "provenance": facts},
        trace=parts["trace"] or None,
        history=history,
    )  # fmt: skip
    run.save()
    return run


def _path(key: str, folder: Path | None) -> Path:
    return (folder or FOLDER) / f"{key}{SUFFIX}"


def _read(path: Path) -> tuple[dict[str, Any], dict[str, dict[str, np.ndarray]]]:
    """(facts, columns by part)."""
    parts: dict[str, dict[str, np.ndarray]] = {"trace": {}, "history": {}, "frames": {}}
    with np.load(io.BytesIO(lzma.decompress(path.read_bytes())), allow_pickle=False) as data:
        facts = json.loads(data["facts"].tobytes())
        for name in data.files:
            kind, _, column = name.removeprefix(PACKED).partition(".")
            if column:
                parts[kind][column] = _unpacked(data[name]) if name.startswith(PACKED) else data[name]
    return facts, parts


def _packed(values: np.ndarray) -> np.ndarray:
    """float64 (t, ...) -> uint8 (8, t, ...), without loss: a smooth course in time becomes mostly zeros.

    Second differences in time of the bit patterns as integers, modulo 2^64, and of these first all lowest
    bytes, then all second ones, and so on. A column that is constant or linear in time takes no space.
    """
    bits = np.ascontiguousarray(values).view(np.int64)
    for _ in range(2):
        bits = np.diff(bits, axis=0, prepend=np.zeros_like(bits[:1]))
    return np.moveaxis(np.ascontiguousarray(bits)[..., None].view(np.uint8), -1, 0)


def _unpacked(planes: np.ndarray) -> np.ndarray:
    """What `_packed` was given."""
    bits = np.ascontiguousarray(np.moveaxis(planes, 0, -1)).view(np.int64)[..., 0]
    for _ in range(2):
        bits = np.cumsum(bits, axis=0, dtype=np.int64)
    return np.ascontiguousarray(bits).view(np.float64)


def processor() -> str:
    """Name of this machine's processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.machine())
