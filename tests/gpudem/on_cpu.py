"""The scenes of test_cuda.py, and what the CPU makes of them: live, or as kept where there is only a GPU.

Warp without its CPU compiler still has CUDA devices. After a wanted change of the results:
python -m tests.gpudem.on_cpu; look at what moved, and by how much.
"""

from __future__ import annotations

import functools
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from gpudem.driver import simulate as run
from gpudem.errors import SimulationError
from gpudem.output.run import Run
from gpudem.scene import Scene
from gpudem.solver.device import wp
from gpudem.solver.solver import Solver
from tests.gpudem.beds import MATERIALS, PAIRS, falling_bed, finish, gas
from tests.gpudem.removals import draining
from tests.gpudem.test_failures import escaping
from tests.gpudem.test_group_motion import shaken
from tests.gpudem.test_neighbor_list import layers
from tests.gpudem.test_phases import PHASES, tilted
from tests.gpudem.test_vibration import shaken_bed

Table = dict[str, np.ndarray]
KEPT = Path(__file__).parent / "golden" / "cpu.npz"
#: Of a frame, one particle in so many is kept.
EVERY = 25
ROLLS = [{**p, "rolling_friction": 0.2} for p in PAIRS]
OUTER, GATE = (wall.model_dump() for wall in falling_bed().walls)
SHORT = {"step": 2e-5, "duration": 0.015}


def bed(**changes) -> Scene:
    return falling_bed(1500, **{"time": SHORT, "walls": falling_bed().walls[:1], **changes})


def two_materials() -> Scene:
    """Of two radii as well, by turns."""
    state = bed().state
    several = {
        "source": "explicit", "position": state.position, "velocity": state.velocity,
        "radius": np.where(np.arange(1500) % 3 == 0, 0.002, 0.003),
        "material": tuple("ball" if i % 2 else "heavy" for i in range(1500)),
    }  # fmt: skip
    heavy = {"young": 2e7, "poisson": 0.25, "density": 7800.0}
    more = [
        {"materials": ("heavy", k), "restitution": 0.5, "friction": 0.2} for k in ("heavy", "ball", "wall")
    ]
    return bed(materials={**MATERIALS, "heavy": heavy}, pairs=[*PAIRS, *more], particles=several,
               time={"step": 1e-5, "duration": 0.015})  # fmt: skip


#: The beds over a floor that vibrates, until rounding has grown: of one ulp in the positions at the start
#: 1.1e-11 of a column's scale is left after 10 ms and 2e-10 to 2e-9 after 20 ms (tenfold every 6 ms); an H100
#: was 1.9e-10 from the CPU after 20 ms.
SHAKEN = {"step": 4e-5, "duration": 0.01}

#: The phases of `tilted`, within SHORT.
EARLY = [{**phase, "start": phase["start"] - 0.011} for phase in PHASES]
#: What takes particles beside the open side of `draining`.
LEAVING = [
    {"name": "corner", "every": 2.1e-3,
     "region": {"kind": "block", "lo": (0, 0, 0), "hi": (0.03, 0.05, 0.01)}},
    {"name": "old", "every": 1e-3, "age": 0.006},
]  # fmt: skip

SCENES = {
    "gas": lambda: gas(time={"step": 2e-6, "duration": 0.004}),
    "friction": bed,
    "friction without history": lambda: bed(contact={"tangential": "no_history"}),
    "gate": lambda: bed(walls=[OUTER, {**GATE, "removed_at": 0.01}]),
    "path": lambda: bed(solver={"integrator": "path"}),
    "hooke": lambda: bed(contact={"normal": "hooke", "characteristic_velocity": 0.5}),
    "cdt": lambda: bed(contact={"rolling": "cdt"}, pairs=ROLLS),
    "epsd2": lambda: bed(contact={"rolling": "epsd2"}, pairs=ROLLS),
    "two materials": two_materials,
    "saw-tooth": lambda: shaken_bed(800, 0.0007, time=SHAKEN),
    "fast floor": lambda: shaken_bed(800, 0.0, time=SHAKEN),
    "groups": lambda: shaken(count=300, time={**SHORT, "duration": 0.04}),
    "phases": lambda: tilted(500, phases=EARLY, time=SHORT),
    "removal": lambda: draining(300, remove=LEAVING, time={**SHORT, "duration": 0.02}),
}


def less_precise(precision: str) -> Scene:
    """A bed that has begun to fall onto itself."""
    return bed(solver={"precision": precision}, time={"step": 2e-5, "duration": 0.01})


def written() -> Scene:
    """With all output there is."""
    return shaken_bed(
        800, 0.0007, time={"step": 4e-5, "duration": 0.02},
        output={"frames_every": 0.004, "trace_every": 0.004, "history_every": 0.001},
    )  # fmt: skip


def columns(done: Run) -> Table:
    """History, trace and last frame of a run, of some of its particles."""
    found = {f"history {k}": done.history[k].to_numpy(float) for k in done.history}
    found |= {f"trace {k}": np.asarray(v, float) for k, v in done.trace.items()}
    found = {k: v[:, ::40] if v.ndim > 1 else v for k, v in found.items()}
    return (
        found
        | {f"frame {k}": v[::40] for k, v in done.frames[-1].items()}
        | {"frames": np.array([len(done.frames)])}
    )


def lost() -> Table:
    try:
        finish(Solver(escaping()))
    except SimulationError as error:
        return {"message": np.array(str(error))}
    raise AssertionError("nothing was lost")


def two_threads() -> Table:
    with tempfile.TemporaryDirectory() as folder:
        return columns(run(written(), folder, threads=2))


def of(scene: Callable[[], Scene]) -> Callable[[], Table]:
    return lambda: finish(Solver(scene()))


#: Name -> what runs it on the CPU.
RUNS = {name: of(scene) for name, scene in SCENES.items()}
RUNS |= {precision: of(functools.partial(less_precise, precision)) for precision in ("mixed", "float32")}
RUNS |= {"layers": of(layers), "escaping": lost, "written": two_threads}


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
    """Largest difference of a column by its largest value; infinite where the particles are others.

    The first may be `thin`.
    """
    if "id" in theirs and len(theirs["id"]) != len(ours["id"]):
        ours = thin(ours)
    if "id" in theirs and not np.array_equal(theirs["id"], ours["id"]):
        return np.inf
    found = [0.0]
    for column, values in theirs.items():
        if (scale := float(np.abs(values).max())) > 0:
            found.append(float(np.abs(values - ours[column]).max()) / scale)
    return max(found)


def renew() -> None:
    """Write the file anew."""
    tables = {name: thin(on_cpu(name)) for name in RUNS}
    np.savez_compressed(
        KEPT, **{f"{name}/{column}": v for name, table in tables.items() for column, v in table.items()}
    )


if __name__ == "__main__":
    renew()
