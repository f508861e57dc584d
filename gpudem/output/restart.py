"""Restart files: the exact state of a run at one step, from which it continues as if it had never stopped.

DIRECTORY/restart.npz is written at every `output.restart_every` and replaced by the next one. It holds the
device arrays as they are (order, lists, shear springs, rolling torques, half-step velocities), what has been
recorded so far, and the hash of the scene, which stands beside it; `gpudem.driver.resume` reads it.
"""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np

from gpudem.errors import GpudemError
from gpudem.output import directory as folder
from gpudem.output.archive import read_npz
from gpudem.output.atomic import write_npz
from gpudem.scene import Scene

FILE = folder.RESTART
#: Counts up when what is in the file changes.
VERSION = 4


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
        """Write the file beside the scene of the run, whole or not at all. Raises WriteError."""
        facts = {"version": VERSION, "step": self.step, "seconds": self.seconds}
        facts["scene_hash"] = self.scene.hash
        columns = {"facts": np.array(json.dumps(facts))}
        columns |= {f"arrays.{k}": v for k, v in self.arrays.items()}
        columns |= {f"recorded.{k}": v for k, v in self.recorded.items()}
        write_npz(directory / FILE, columns)

    @classmethod
    def load(cls, directory: Path) -> Restart:
        """Read DIRECTORY/restart.npz and the scene beside it.

        Raises:
            GpudemError: a file is missing or broken, of another version, or of another scene.
        """
        path = directory / FILE
        if not path.is_file():
            raise GpudemError(
                f"{path}: no such file; a run writes it where its scene has output.restart_every"
            )
        columns = read_npz(path)
        try:
            facts = json.loads(str(columns["facts"]))
            found = facts["version"]
            if found != VERSION:
                raise GpudemError(f"{path}: written as version {found}, this gpudem reads version {VERSION}")
            step, seconds, stated = int(facts["step"]), dict(facts["seconds"]), facts["scene_hash"]
        except (ValueError, KeyError, TypeError) as error:
            raise GpudemError(f"{path}: not a restart file ({type(error).__name__}: {error})") from error
        scene = folder.load_scene(directory)
        folder.require_hash(path, stated, scene)

        def group(prefix: str) -> dict[str, np.ndarray]:
            return {k.removeprefix(prefix): v for k, v in columns.items() if k.startswith(prefix)}

        return cls(scene, step, group("arrays."), group("recorded."), seconds)
