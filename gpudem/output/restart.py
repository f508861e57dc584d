"""Restart files: the exact state of a run at one step, from which it goes on as if it had never stopped.

DIRECTORY/restart.npz is written at every `output.restart_every` and replaced by the next one. It holds the
scene, the device arrays as they are (order, lists, shear springs, rolling torques, half-step velocities) and
what has been recorded so far; `gpudem.driver.resume` reads it.
"""

from __future__ import annotations

import dataclasses
import json
import zipfile
from pathlib import Path

import numpy as np

from gpudem.errors import GpudemError
from gpudem.scene import Scene

FILE = "restart.npz"
#: Counts up when what is in the file changes.
VERSION = 2


@dataclasses.dataclass(frozen=True)
class Restart:
    """What a restart file holds."""

    scene: Scene
    step: int
    arrays: dict[str, np.ndarray]
    """Of the solver, by the names of `Solver.saved`."""
    recorded: dict[str, np.ndarray]
    """History and trace up to `step`, by the names of `Recorder.saved`."""
    seconds: dict[str, float]
    """Wall-clock time so far, by the fields of `Timing`."""

    def save(self, directory: Path) -> None:
        """Write the file, whole or not at all. Raises GpudemError where it cannot be written."""
        facts = {"version": VERSION, "step": self.step, "seconds": self.seconds}
        partial = directory / "restart.part"
        columns = {f"arrays.{k}": v for k, v in self.arrays.items()}
        columns |= {f"recorded.{k}": v for k, v in self.recorded.items()}
        try:
            with partial.open("wb") as file:
                np.savez(
                    file,
                    facts=np.array(json.dumps(facts)),
                    scene=np.array(self.scene.to_json()),
                    **columns,  # pyright: ignore[reportArgumentType]
                )
            partial.replace(directory / FILE)
        except OSError as error:
            raise GpudemError(f"{directory / FILE}: cannot be written: {error.strerror}") from error

    @classmethod
    def load(cls, directory: Path) -> Restart:
        """Read DIRECTORY/restart.npz. Raises GpudemError: missing, broken, or of another version."""
        path = directory / FILE
        if not path.is_file():
            raise GpudemError(
                f"{path}: no such file; a run writes it where its scene has output.restart_every"
            )
        try:
            with path.open("rb") as file:
                columns = dict(np.load(file))
            facts = json.loads(str(columns["facts"]))
            found, step, seconds = facts["version"], facts["step"], facts["seconds"]
            scene = str(columns["scene"])
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
            raise GpudemError(f"{path}: truncated or corrupted ({type(error).__name__}: {error})") from error
        if found != VERSION:
            raise GpudemError(f"{path}: written as version {found}, this gpudem reads version {VERSION}")

        def group(prefix: str) -> dict[str, np.ndarray]:
            return {k.removeprefix(prefix): v for k, v in columns.items() if k.startswith(prefix)}

        return cls(Scene.from_json(scene, str(path)), step, group("arrays."), group("recorded."), seconds)
