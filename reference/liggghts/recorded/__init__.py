"""LIGGGHTS output kept for machines without the binary, found by the hash of the deck."""

from __future__ import annotations

import datetime
import json
import platform
from pathlib import Path

import numpy as np

from gpudem.output import observables
from gpudem.output.frames import FrameWriter
from gpudem.run import HISTORY_COLUMNS, Run, Timing
from gpudem.scene import Scene, checks

FOLDER = Path(__file__).parent


def record(run: Run, folder: Path = FOLDER, frame_dtype: str = "float64") -> Path:
    """Keep a run: `<deck hash>.npz` (trace and history exact, frames as `frame_dtype`) and `<deck hash>.json`
    (date, processor, LIGGGHTS version, frame_dtype, timing).

    Keep it for small scenes only: the folder travels with the source. Returns the path of the .npz file.
    """
    key = run.notes["deck_hash"]
    arrays = {f"trace.{name}": column for name, column in (run.trace or {}).items()}
    if run.history is not None:
        arrays |= {f"history.{name}": run.history[name].to_numpy() for name in run.history}
    frames = [{k: v for k, v in frame.items() if k != "points"} for frame in run.frames]
    for name in frames[0]:
        column = np.stack([frame[name] for frame in frames])
        arrays[f"frames.{name}"] = column.astype(frame_dtype) if column.dtype == np.float64 else column
    facts = {
        "recorded": datetime.date.today().isoformat(), "machine": processor(), "version": run.version,
        "deck_hash": key, "scene": run.scene.name, "frame_dtype": frame_dtype, "warnings": run.warnings,
        "ranks": run.timing.cores, "stepping_s": run.timing.stepping_s,
    }  # fmt: skip
    np.savez_compressed(folder / f"{key}.npz", **arrays)  # pyright: ignore[reportArgumentType]
    (folder / f"{key}.json").write_text(json.dumps(facts, indent=1) + "\n")
    return folder / f"{key}.npz"


def has(key: str, folder: Path = FOLDER) -> bool:
    """Whether output of exactly this deck is kept."""
    return (folder / f"{key}.json").is_file() and (folder / f"{key}.npz").is_file()


def recall(key: str, scene: Scene, directory: Path, folder: Path = FOLDER) -> Run:
    """The run kept for exactly this deck, written out in `directory`.

    Its timing is that of the machine it was recorded on, and `warnings` and `notes` say that it was recorded.
    Raises FileNotFoundError if there is none.
    """
    import pandas

    facts_file, arrays_file = folder / f"{key}.json", folder / f"{key}.npz"
    facts = json.loads(facts_file.read_text())
    with np.load(arrays_file) as data:
        parts: dict[str, dict[str, np.ndarray]] = {"trace": {}, "history": {}, "frames": {}}
        for name in data.files:
            kind, _, column = name.partition(".")
            parts[kind][column] = data[name]
    writer = FrameWriter(directory, scene)
    for k, step in enumerate(range(0, scene.n_steps + 1, scene.frame_stride)):
        frame = {name: column[k] for name, column in parts["frames"].items()}
        writer.add(step, {n: c.astype(np.float64) if c.dtype.kind == "f" else c for n, c in frame.items()})
    where = f"{facts['recorded']} on {facts['machine']} with {facts['version']}"
    warning = f"LIGGGHTS was not run here: recorded {where}; frames as {facts['frame_dtype']}"
    timing = Timing(len(scene.state), scene.n_steps, stepping_s=facts["stepping_s"], cores=facts["ranks"])
    history, left_out = None, []
    if parts["history"]:
        table = pandas.DataFrame(parts["history"], columns=list(HISTORY_COLUMNS))
        history, left_out = observables.select(table, scene.output.history, "LIGGGHTS")
    run = Run(
        "liggghts", facts["version"], scene, directory, timing,
        warnings=list(dict.fromkeys([*checks.warnings(scene), *facts["warnings"], *left_out, warning])),
        notes={"deck_hash": key, "ranks": facts["ranks"], "recorded": True, "provenance": facts},
        trace=parts["trace"] or None,
        history=history,
    )  # fmt: skip
    run.save()
    return run


def processor() -> str:
    """Name of this machine's processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.machine())
