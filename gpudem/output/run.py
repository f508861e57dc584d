"""A finished run of any code, in one form on disk (`gpudem.output.directory`) and in memory."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gpudem.errors import GpudemError
from gpudem.output import directory as folder
from gpudem.output import observables
from gpudem.output.archive import ArchiveError, read_npz
from gpudem.output.atomic import WriteError, replacing, write_npz, write_text
from gpudem.output.frames import Frames
from gpudem.scene import Scene

if TYPE_CHECKING:
    import pandas

#: Of run.json; counts up when what is in it changes.
FORMAT = 2

TRACE_COLUMNS = ("position", "velocity", "angular_velocity", "force", "torque")

#: Columns of history.csv, in SI units, where a scene does not choose its own (`gpudem.output.observables`).
HISTORY_COLUMNS = (*observables.ALWAYS, *observables.DEFAULT)


@dataclasses.dataclass
class Timing:
    """Where the wall-clock time [s] of a run went, and on what."""

    particles: int
    """On average over the steps, where their number varies."""
    steps: int
    stepping_s: float
    """Stepping only: no compiling, set-up or output."""
    setup_s: float = 0.0
    """Start-up, reading or placing particles, first neighbor list."""
    compile_s: float = 0.0
    output_s: float = 0.0
    device: str = "cpu"
    cores: int = 1
    """Cores (threads) or MPI ranks."""
    precision: str = "float64"
    peak_memory_bytes: int = 0

    @property
    def rate(self) -> float:
        """Particle-steps per second of stepping (the Cundall number)."""
        return self.particles * self.steps / self.stepping_s if self.stepping_s > 0 else float("nan")


@dataclasses.dataclass
class Run:
    """What one code made of one scene."""

    code: str
    """"gpudem", "liggghts", ..."""
    version: str
    scene: Scene
    directory: Path
    timing: Timing
    warnings: list[str] = dataclasses.field(default_factory=list)
    notes: dict[str, Any] = dataclasses.field(default_factory=dict)
    """Facts for the provenance section: deck hash, recorded or live, neighbor-list rebuilds, ..."""
    trace: dict[str, np.ndarray] | None = None
    """step (t,), time (t,), and position, velocity, angular_velocity, force, torque, each (t, n, 3); n counts
    all particles of the run, and before one has come its numbers are NaN."""
    history: pandas.DataFrame | None = None
    """Observables in time: columns HISTORY_COLUMNS, or those of the scene's `output.history`."""

    @property
    def frames(self) -> Frames:
        """The frames on disk."""
        return Frames.open(self.directory)

    def save(self) -> None:
        """Write the scene, history.csv, trace.npz and, last, run.json (frames are on disk already).

        Of an older run's tables and run.json nothing stays. Raises WriteError.
        """
        directory, tables = self.directory, {}
        try:
            directory.mkdir(parents=True, exist_ok=True)
            for name in (folder.RUN, folder.HISTORY, folder.TRACE):
                (directory / name).unlink(missing_ok=True)
        except OSError as error:
            raise WriteError(directory, error) from error
        folder.save_scene(directory, self.scene)
        if self.history is not None:
            with replacing(directory / folder.HISTORY) as partial:
                self.history.to_csv(partial, index=False, float_format="%.17g", na_rep="nan")
            tables[folder.HISTORY] = {str(name): str(kind) for name, kind in self.history.dtypes.items()}
        if self.trace is not None:
            write_npz(directory / folder.TRACE, self.trace)
            tables[folder.TRACE] = list(self.trace)
        facts = {
            "format": FORMAT, "code": self.code, "version": self.version, "scene_hash": self.scene.hash,
            "tables": tables, "timing": dataclasses.asdict(self.timing), "warnings": self.warnings,
            "notes": self.notes,
        }  # fmt: skip
        write_text(directory / folder.RUN, json.dumps(facts, indent=1))

    @classmethod
    def load(cls, directory: str | Path) -> Run:
        """Read what `save` wrote, from wherever the folder now is.

        Raises:
            GpudemError: a file is missing or broken, or belongs to another scene; names it.
        """
        directory = Path(directory)
        try:
            facts = json.loads((directory / folder.RUN).read_text(encoding="utf-8"))
            if facts.get("format") != FORMAT:
                raise ValueError(f"run.json has format {facts.get('format', 1)}, this gpudem reads {FORMAT}")
            scene = folder.load_scene(directory)
            folder.require_hash(directory / folder.RUN, facts["scene_hash"], scene)
            tables = facts["tables"]
            return cls(
                code=facts["code"], version=facts["version"], scene=scene, directory=directory,
                timing=Timing(**facts["timing"]), warnings=facts["warnings"], notes=facts["notes"],
                history=_read_history(directory / folder.HISTORY, tables.get(folder.HISTORY)),
                trace=_read_trace(directory / folder.TRACE, tables.get(folder.TRACE)),
            )  # fmt: skip
        except (KeyError, TypeError, AttributeError) as error:
            what = f"{folder.RUN}: {type(error).__name__}: {error}"
            raise GpudemError(f"{directory}: not a complete run: {what}") from error
        except (OSError, ValueError, RecursionError, ArchiveError) as error:
            raise GpudemError(f"{directory}: not a complete run: {error}") from error


def conclude(run: Run, on_disk: bool, failure: BaseException | None) -> Run:
    """Save a run that has ended, with a directory, and raise what ended it, if anything did.

    Raises:
        WriteError: the results cannot be saved; where the run failed itself, this is a note of its failure.
    """
    try:
        if on_disk:
            run.save()
    except GpudemError as error:
        if failure is None:
            raise
        failure.add_note(f"and what there was could not be saved: {error}")
    if failure is not None:
        raise failure
    return run


def _read_history(path: Path, columns: dict[str, str] | None) -> pandas.DataFrame | None:
    """The table with the columns and types that run.json states, to the last bit; None if it states none."""
    import pandas

    if columns is None:
        return None
    table = pandas.read_csv(path, dtype=str, keep_default_na=False)  # as text: not every pandas reads exactly
    _require_columns(path, list(columns), [str(name) for name in table])
    return table.astype(columns)


def _read_trace(path: Path, columns: list[str] | None) -> dict[str, np.ndarray] | None:
    if columns is None:
        return None
    trace = read_npz(path)
    _require_columns(path, columns, list(trace))
    return trace


def _require_columns(path: Path, stated: list[str], found: list[str]) -> None:
    if found != stated:
        raise ValueError(f"{path}: columns {', '.join(found)}; run.json states {', '.join(stated)}")
