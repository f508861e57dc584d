"""Compare two commits: final states of scenes over every law, wall, precision and list, bit by bit.

    python tools/compare_commits.py 39dcc83            # the working tree against a commit
    python tools/compare_commits.py A B --scenes gate  # two commits, scenes whose name contains "gate"

Each commit's sources are unpacked into a temporary folder and run in a process of its own with this Python.
Prints a line per scene: identical, or the largest difference relative to the largest value of that column.
Exit code 0: all identical; 1: some differ (more than --tolerance, where given); 2: a scene could not run.
"""

from __future__ import annotations

import argparse
import io
import os
import subprocess
import sys
import tarfile
import tempfile
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
Table = dict[str, np.ndarray]

MATERIALS = {
    "ball": {"young": 5e6, "poisson": 0.34, "density": 1768.0},
    "heavy": {"young": 2e7, "poisson": 0.25, "density": 7800.0},
    "wall": {"young": 8e6, "poisson": 0.37, "density": 1185.0},
}
PAIRS = [
    {"materials": ("ball", "ball"), "restitution": 0.8, "friction": 0.4},
    {"materials": ("ball", "wall"), "restitution": 0.7, "friction": 0.3},
    {"materials": ("heavy", "heavy"), "restitution": 0.5, "friction": 0.2},
    {"materials": ("heavy", "ball"), "restitution": 0.6, "friction": 0.25},
    {"materials": ("heavy", "wall"), "restitution": 0.4, "friction": 0.5},
]
STIFFNESS = {"kn": 4e6, "kt": 5e6, "gamma_n": 3e4, "gamma_t": 1e4}
BOX = {"kind": "box", "name": "box", "material": "wall", "lo": (0, 0, 0), "hi": (0.1, 0.05, 0.3)}
GATE = {"kind": "plane", "name": "gate", "material": "wall", "point": (0.05, 0, 0), "normal": (-1, 0, 0)}
#: Tilted, so that its normal has no zero but one.
CHUTE = {
    "kind": "plane",
    "name": "chute",
    "material": "wall",
    "point": (0, 0, -0.002),
    "normal": (-0.05, 0, 1),
}
PERIODIC_BOX = {**BOX, "sides": ("zlo", "zhi", "ylo", "yhi")}


def bed(count: int = 1200, **changes: Any) -> dict[str, Any]:
    """Balls with random velocities fall into a box and onto each other."""
    data: dict[str, Any] = {
        "name": "bed",
        "materials": MATERIALS,
        "pairs": PAIRS,
        "particles": {
            "source": "lattice", "material": "ball", "count": count, "radius": 0.003, "seed": 1,
            "lo": (0, 0, 0), "hi": (0.05, 0.05, 0.3), "velocity_rms": 0.3,
        },
        "gravity": (0, 0, -9.81),
        "walls": [BOX],
        "domain": {"lo": (-0.001, -0.001, -0.001), "hi": (0.101, 0.051, 0.301)},
        "time": {"step": 2e-5, "duration": 0.016},
        "output": {"trace_every": 0.016, "history_every": 0.004},
    }  # fmt: skip
    return {**data, **changes}


def two_kinds(**changes: Any) -> dict[str, Any]:
    """Two radii and two materials by turns, on a lattice with rotations."""
    i, rng = np.arange(600), np.random.default_rng(3)
    grid = np.stack([i % 7, i // 7 % 7, i // 49], axis=1)
    particles = {
        "source": "explicit", "position": 0.004 + 0.0066 * grid + rng.uniform(-2e-4, 2e-4, (600, 3)),
        "velocity": rng.normal(0, 0.3, (600, 3)), "angular_velocity": rng.normal(0, 20, (600, 3)),
        "radius": np.where(i % 3 == 0, 0.002, 0.003),
        "material": tuple("ball" if k % 2 else "heavy" for k in i),
    }  # fmt: skip
    return bed(particles=particles, time={"step": 1e-5, "duration": 0.016}, **changes)


def rolling(model: str) -> dict[str, Any]:
    """Changes that turn a rolling law on."""
    return {"contact": {"rolling": model}, "pairs": [{**p, "rolling_friction": 0.2} for p in PAIRS]}


def floor(amplitude: float) -> dict[str, Any]:
    """A bed over a vibrating floor; amplitude 0 is the fast floor."""
    sides = {**BOX, "sides": ("xlo", "xhi", "ylo", "yhi", "zhi")}
    moving = {
        "kind": "plane", "name": "floor", "material": "wall", "point": (0, 0, 0), "normal": (0, 0, 1),
        "vibration": {"speed": 0.6, "amplitude": amplitude},
    }  # fmt: skip
    return bed(
        800, walls=[sides, moving], domain={"lo": (-0.001, -0.001, -0.01), "hi": (0.101, 0.051, 0.301)}
    )


PERIODIC = {
    "walls": [PERIODIC_BOX],
    "domain": {"lo": (0, -0.001, -0.001), "hi": (0.1, 0.051, 0.301), "periodic": (True, False, False)},
    "gravity": (3.0, 0, -9.0),
}
SCENES: dict[str, dict[str, Any]] = {
    "hertz history": bed(),
    "hertz without history": bed(contact={"tangential": "no_history"}),
    "hertz frictionless": bed(contact={"tangential": "off"}),
    "hertz limit_force": bed(contact={"limit_force": True}),
    "hertz without tangential damping": bed(contact={"tangential_damping": False}),
    "hertz/stiffness": bed(contact={"normal": "hertz/stiffness"}, pairs=[{**p, **STIFFNESS} for p in PAIRS]),
    "hooke": bed(contact={"normal": "hooke", "characteristic_velocity": 0.5}),
    "cdt": bed(**rolling("cdt")),
    "epsd2": bed(**rolling("epsd2")),
    "cdt without friction": bed(
        pairs=[{**p, "friction": 0.0, "rolling_friction": 0.2} for p in PAIRS],
        contact={"rolling": "cdt", "tangential": "off"},
    ),
    "mixed": bed(solver={"precision": "mixed"}),
    "float32": bed(solver={"precision": "float32"}),
    "path": bed(solver={"integrator": "path"}),
    "path hooke": bed(
        solver={"integrator": "path"}, contact={"normal": "hooke", "characteristic_velocity": 0.5}
    ),
    "path hertz/stiffness": bed(
        solver={"integrator": "path"},
        contact={"normal": "hertz/stiffness", "limit_force": True},
        pairs=[{**p, **STIFFNESS} for p in PAIRS],
    ),
    "two kinds": two_kinds(),
    "two kinds epsd2": two_kinds(**rolling("epsd2")),
    "two kinds mixed": two_kinds(solver={"precision": "mixed"}),
    "two kinds path": two_kinds(solver={"integrator": "path"}),
    "periodic": bed(**PERIODIC),
    "periodic path": bed(**PERIODIC, solver={"integrator": "path"}),
    "gate": bed(walls=[BOX, {**GATE, "removed_at": 0.008}]),
    "gate epsd2": bed(walls=[BOX, {**GATE, "removed_at": 0.008}], **rolling("epsd2")),
    "tilted plane": bed(walls=[{**BOX, "sides": ("xlo", "xhi", "ylo", "yhi")}, CHUTE]),
    "saw-tooth": floor(0.0007),
    "fast floor": floor(0.0),
}  # fmt: skip
#: Scenes run with the other kind of list too (full on the CPU, as on a GPU), and in two parts.
FULL_LIST = (
    "hertz history", "epsd2", "mixed", "two kinds", "two kinds path", "periodic", "gate epsd2", "saw-tooth",
    "fast floor",
)  # fmt: skip
RESTARTED = ("hertz history", "epsd2", "two kinds mixed", "gate", "path", "periodic", "fast floor")
FRAME = ("position", "velocity", "angular_velocity", "force", "torque")


def simulated(data: dict[str, Any]) -> Table:
    """Trace at the end and history of a run."""
    import gpudem

    run = gpudem.simulate(gpudem.Scene(**data))
    assert run.trace is not None
    assert run.history is not None
    table = {name: run.trace[name][-1] for name in FRAME}
    return table | {f"history {name}": run.history[name].to_numpy(float) for name in run.history}


def restarted(data: dict[str, Any]) -> Table:
    """The same, resumed from the restart file at half of the run."""
    import gpudem

    scene = gpudem.Scene(**data).replace(output={"restart_every": data["time"]["duration"] / 2})
    with tempfile.TemporaryDirectory() as folder:
        gpudem.simulate(scene, Path(folder) / "run")
        run = gpudem.resume(Path(folder) / "run")
    assert run.trace is not None
    assert run.notes["resumed_at_step"] == scene.n_steps // 2
    return {name: run.trace[name][-1] for name in FRAME}


def full_list(data: dict[str, Any]) -> Table:
    """The last frame of a run with a full list."""
    import gpudem

    try:
        from gpudem.solver.solver import Solver
    except ImportError:  # before the solver was a package
        from gpudem.solver import Simulation as Solver
    solver = Solver(gpudem.Scene(**data), half_list=False)
    for first, last, planes in solver.scene.segments:
        solver.start(planes, write=first == 0)
        solver.advance(last - first - 1)
        solver.write_step(last=True)
    frame = solver.frame()
    solver.close()
    return {name: frame[name] for name in FRAME}


def jobs() -> dict[str, Callable[[], Table]]:
    """Name -> what runs it."""

    def of(function: Callable[[dict[str, Any]], Table], name: str) -> Callable[[], Table]:
        return lambda: function(SCENES[name])

    found = {name: of(simulated, name) for name in SCENES}
    found |= {f"{name}, full list": of(full_list, name) for name in FULL_LIST}
    return found | {f"{name}, restarted": of(restarted, name) for name in RESTARTED}


def work(out: Path, wanted: str) -> None:
    """Run all jobs whose name contains `wanted` with the gpudem that is importable; keep their tables."""
    tables: Table = {}
    for name, run in jobs().items():
        if wanted not in name:
            continue
        try:
            tables |= {f"{name}/{column}": values for column, values in run().items()}
        except Exception:
            tables[f"{name}/ERROR"] = np.array(traceback.format_exc())
    np.savez(out, **tables)  # pyright: ignore[reportArgumentType]


def unpack(commit: str, folder: Path) -> Path:
    """The sources of a commit in a folder of their own; the working tree for "."."""
    if commit == ".":
        return ROOT
    archive = subprocess.run(["git", "archive", commit], cwd=ROOT, capture_output=True, check=True).stdout
    target = folder / commit.replace("/", "_")
    with tarfile.open(fileobj=io.BytesIO(archive)) as file:
        file.extractall(target, filter="data")
    return target


def tables_of(commit: str, folder: Path, wanted: str) -> dict[str, Table]:
    """Name -> table, of one commit."""
    sources, out = unpack(commit, folder), folder / f"{commit.replace('/', '_').replace('.', 'tree')}.npz"
    environment = {**os.environ, "PYTHONPATH": str(sources), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, str(Path(__file__).resolve()), "--worker", str(out), "--scenes", wanted]
    subprocess.run(command, cwd=sources, env=environment, check=True)
    found: dict[str, Table] = {}
    with np.load(out) as file:
        for key in file.files:
            name, _, column = key.rpartition("/")  # names of scenes may have one too
            found.setdefault(name, {})[column] = file[key]
    return found


def difference(one: Table, other: Table) -> tuple[float, str]:
    """(largest relative difference, its column); columns that only one table has are left out."""
    worst, where = 0.0, ""
    for column in sorted(set(one) & set(other)):
        a, b = one[column], other[column]
        if a.shape != b.shape:
            return float("inf"), f"{column}: shapes {a.shape} and {b.shape}"
        if np.array_equal(a, b, equal_nan=True):
            continue
        relative = float(np.abs(a - b).max() / max(np.abs(a).max(), 1e-300))
        if not relative <= worst:
            worst, where = relative, column
    return worst, where


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("commits", nargs="*", help="one commit (against the working tree) or two")
    parser.add_argument("--scenes", default="", help="only scenes whose name contains this")
    parser.add_argument("--tolerance", type=float, default=0.0, help="largest difference that is no failure")
    parser.add_argument("--worker", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.worker:
        work(given.worker, given.scenes)
        return 0
    if len(given.commits) not in (1, 2):
        parser.error("name one commit or two")
    old, new = (given.commits[0], given.commits[1] if len(given.commits) == 2 else ".")
    with tempfile.TemporaryDirectory(prefix="commits_") as folder:
        before, after = (tables_of(c, Path(folder), given.scenes) for c in (old, new))
    status = 0
    for name in after:
        errors = [str(t["ERROR"]) for t in (before.get(name, {}), after[name]) if "ERROR" in t]
        if errors:
            print(f"{name}: ERROR\n{errors[-1]}")
            status = 2
            continue
        worst, where = difference(before[name], after[name])
        print(f"{name}: {'identical' if worst == 0 else f'{worst:.3g} in {where}'}", flush=True)
        if worst > given.tolerance:
            status = max(status, 1)
    return status


if __name__ == "__main__":
    sys.exit(main())
