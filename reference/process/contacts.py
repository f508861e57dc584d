"""contacts.csv: the forces of single contacts that a command may write, at the requested steps."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np

from gpudem.scene import Scene
from reference.process.states import OutputError

COLUMNS = ("step", "id", "other", "fx", "fy", "fz")


@dataclasses.dataclass(frozen=True)
class ContactTable:
    """Forces by contact: (row of the particle, row of its partner or name of the plane) -> step -> [N]."""

    forces: dict[tuple[int, int | str], dict[int, np.ndarray]]

    def force(self, i: int, other: int | str, steps: np.ndarray) -> np.ndarray:
        """Force on particle row i [N] at the steps, (steps, 3); zero where the contact is not listed."""
        found, sign = self.forces.get((i, other)), 1.0
        if found is None and not isinstance(other, str):
            found, sign = self.forces.get((other, i)), -1.0
        nothing = np.zeros(3)
        return sign * np.array([(found or {}).get(step, nothing) for step in steps.tolist()])


def read(scene: Scene, path: Path) -> ContactTable:
    """The table of a file, each contact listed once, from either side.

    Raises OutputError: a column is missing, an unknown particle or plane, a contact twice, not a number.
    """
    import pandas

    try:
        text = pandas.read_csv(path, dtype=str, keep_default_na=False, skipinitialspace=True)
    except (OSError, ValueError) as error:
        raise OutputError(f"{path}: cannot be read as a table: {error}") from None
    missing = [name for name in COLUMNS if name not in text]
    if missing:
        raise OutputError(f"{path}: line 1: no column {', '.join(missing)}; found: {', '.join(text)}")
    known: dict[str, int | str] = {str(k + 1): k for k in range(len(scene.state))}
    partners = known | {plane.name: plane.name for plane in scene.planes}
    forces: dict[tuple[int, int | str], dict[int, np.ndarray]] = {}
    for line, (step, i, other, *force) in enumerate(text[list(COLUMNS)].itertuples(index=False), 2):
        where = f"{path}: line {line}"
        if i not in known or other not in partners:
            raise OutputError(
                f"{where}: contact of {i!r} and {other!r}: ids are 1 to {len(known)}, or a plane"
            )
        try:
            number, vector = int(step), np.array([float(c) for c in force])
        except ValueError as error:
            raise OutputError(f"{where}: {error}") from None
        if not all(map(math.isfinite, vector)):
            raise OutputError(f"{where}: force {', '.join(force)}, not finite numbers")
        key = (int(i) - 1, partners[other])
        if number in forces.get(key, {}) or number in forces.get((key[1], key[0]), {}):  # type: ignore[arg-type]
            raise OutputError(f"{where}: the contact of {i} and {other} is given twice at step {number}")
        forces.setdefault(key, {})[number] = vector
    return ContactTable(forces)
