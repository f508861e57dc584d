"""What the CPU makes of the scenes of test_cuda.py, live or as kept for a machine that only has a GPU.

Warp without its CPU compiler still has CUDA devices. After a wanted change of the results:
python -m tests.gpudem.on_cpu; look at what moved, and by how much.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path

import numpy as np

from gpudem.device import wp

Table = dict[str, np.ndarray]
KEPT = Path(__file__).parent / "golden" / "cpu.npz"
#: Of a frame, one particle in so many is kept.
EVERY = 25
#: Name -> what runs it on the CPU.
RUNS: dict[str, Callable[[], Table]] = {}


@functools.cache
def on_cpu(name: str) -> Table:
    """Columns of a run of RUNS: the whole of it where the CPU can run it, else what is kept."""
    return RUNS[name]() if wp.is_cpu_available() else kept(name)


def kept(name: str) -> Table:
    """Columns of a run as the file has them; those of a frame for the particles of its column `id`."""
    with np.load(KEPT) as file:
        return {key.partition("/")[2]: file[key] for key in file.files if key.partition("/")[0] == name}


def thin(table: Table) -> Table:
    """Every so many rows of a frame; a table without `id` as it is."""
    return {k: v[EVERY // 2 :: EVERY] for k, v in table.items()} if "id" in table else table


def apart(theirs: Table, ours: Table) -> float:
    """Largest difference of a column, over the particles that the first has, by its largest value."""
    rows = theirs["id"] - 1 if "id" in theirs else slice(None)
    found = [0.0]
    for column, values in theirs.items():
        if (scale := float(np.abs(values).max())) > 0:
            found.append(float(np.abs(values - ours[column][rows]).max()) / scale)
    return max(found)


def renew() -> None:
    """Write the file anew."""
    from tests.gpudem import test_cuda  # noqa: F401  (enters its runs)

    KEPT.parent.mkdir(exist_ok=True)
    tables = {name: thin(on_cpu(name)) for name in RUNS}
    np.savez_compressed(
        KEPT, **{f"{name}/{column}": v for name, table in tables.items() for column, v in table.items()}
    )


if __name__ == "__main__":
    from tests.gpudem.on_cpu import renew as run_renew  # this file, under the name that test_cuda knows it by

    run_renew()
