"""A finished run of any code, in one form on disk and in memory.

DIRECTORY/scene.json  run.json  run.pvd  frames/p_*.vtu  history.csv  trace.npz
"""

from __future__ import annotations

import dataclasses
import json
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gpudem.errors import GpudemError
from gpudem.output.frames import Frames
from gpudem.scene import Scene

if TYPE_CHECKING:
    import pandas

TRACE_COLUMNS = ("position", "velocity", "angular_velocity", "force", "torque")

#: Columns of history.csv, in SI units; potential energy counts from the domain's origin, against gravity.
HISTORY_COLUMNS = (
    "step", "time", "kinetic_energy", "rotational_energy", "potential_energy",
    "contacts", "front_x", "centre_x", "centre_y", "centre_z",
)  # fmt: skip


@dataclasses.dataclass
class Timing:
    """Where the wall-clock time [s] of a run went, and on what."""

    particles: int
    steps: int
    stepping_s: float
    """Stepping alone: no compiling, set-up or output."""
    setup_s: float = 0.0
    """Start-up, reading or placing particles, first neighbour list."""
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
    """Facts for the provenance section: deck hash, recorded or live, neighbour-list rebuilds, ..."""
    trace: dict[str, np.ndarray] | None = None
    """step (t,), time (t,), and position, velocity, angular_velocity, force, torque, each (t, n, 3)."""
    history: pandas.DataFrame | None = None
    """Bulk quantities in time: columns HISTORY_COLUMNS."""

    @property
    def frames(self) -> Frames:
        """The frames on disk."""
        return Frames.open(self.directory)

    def save(self) -> None:
        """Write scene.json, run.json, history.csv, trace.npz (frames are on disk already)."""
        self.directory.mkdir(parents=True, exist_ok=True)
        (self.directory / "scene.json").write_text(self.scene.to_json())
        facts = {
            "code": self.code, "version": self.version, "timing": dataclasses.asdict(self.timing),
            "warnings": self.warnings, "notes": self.notes,
        }  # fmt: skip
        (self.directory / "run.json").write_text(json.dumps(facts, indent=1))
        if self.history is not None:
            self.history.to_csv(self.directory / "history.csv", index=False, float_format="%.17g")
        if self.trace is not None:
            np.savez(self.directory / "trace.npz", **self.trace)  # pyright: ignore[reportArgumentType]

    @classmethod
    def load(cls, directory: Path) -> Run:
        """Read what `save` wrote. Raises GpudemError naming the missing or broken file."""
        import pandas

        try:
            facts = json.loads((directory / "run.json").read_text())
            scene = Scene.from_json((directory / "scene.json").read_text(), str(directory / "scene.json"))
            history = directory / "history.csv"
            trace = directory / "trace.npz"
            return cls(
                code=facts["code"], version=facts["version"], scene=scene, directory=directory,
                timing=Timing(**facts["timing"]), warnings=facts["warnings"], notes=facts["notes"],
                history=pandas.read_csv(history) if history.is_file() else None,
                trace=_read_npz(trace) if trace.is_file() else None,
            )  # fmt: skip
        except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
            raise GpudemError(f"{directory}: not a complete run: {error}") from error


def _read_npz(path: Path) -> dict[str, np.ndarray]:
    with path.open("rb") as file:  # np.load leaves the file open where it is broken
        return dict(np.load(file))
