"""Beds for measuring speed: 5000 settled or flowing spheres of the dam break, tiled along the periodic depth.

`python -m comparisons.bench.beds` makes data/bed_*.npz anew with gpudem; both codes start from these numbers.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from gpudem.scene import Scene

DATA = Path(__file__).parent / "data"
COUNT, RADIUS, DEPTH, GATE = 5000, 0.003, 0.03, 0.2
SETTLE, FLOW = 0.5, 0.15
#: The skin suits both: LIGGGHTS' speed is flat from 0.3 to 2 mm, gpudem gains by fewer rebuilds.
STEP, SKIN = 2e-5, 0.0018

MATERIALS = {
    "polystyrene": {"young": 5e6, "poisson": 0.34, "density": 1768.0},
    "acrylic": {"young": 5e6, "poisson": 0.37, "density": 1185.0},
}
PAIRS = [
    {"materials": ("polystyrene", "polystyrene"), "restitution": 0.9, "friction": 0.3},
    {"materials": ("polystyrene", "acrylic"), "restitution": 0.9, "friction": 0.24},
]
FRICTIONLESS = [{**pair, "friction": 0.0} for pair in PAIRS]


def bed_scene(
    name: str,
    particles: dict[str, Any] | None,
    *,
    gate: bool,
    copies: int = 1,
    duration: float,
    **changes: Any,
) -> Scene:
    """A slice of the dam break, 0.9 m long, `copies` x 30 mm deep, periodic in y; softened to 5 MPa."""
    depth = DEPTH * copies
    walls: list[dict[str, Any]] = [
        {"kind": "box", "name": "box", "material": "acrylic", "sides": ["xlo", "xhi", "zlo"],
         "lo": (0, 0, 0), "hi": (0.9, depth, 0.5)},
    ]  # fmt: skip
    if gate:
        normal = (-1.0, 0.0, 0.0)
        point = (GATE, 0.0, 0.0)
        walls.append(
            {"kind": "plane", "name": "gate", "material": "acrylic", "point": point, "normal": normal}
        )
    data: dict[str, Any] = {
        "name": name, "materials": MATERIALS, "pairs": PAIRS, "particles": particles, "walls": walls,
        "gravity": (0.0, 0.0, -9.81),
        "domain": {"lo": (-0.001, 0, -0.001), "hi": (0.901, depth, 0.5), "periodic": (False, True, False)},
        "time": {"step": STEP, "duration": duration}, "solver": {"skin": SKIN},
    }  # fmt: skip
    return Scene(**{**data, **changes})


def tiled(state: str, copies: int, lowest: int = COUNT) -> dict[str, Any]:
    """The particles of data/bed_<state>.npz, or the `lowest` of them, `copies` times side by side along y."""
    with np.load(DATA / f"bed_{state}.npz") as bed:
        chosen = np.sort(np.argsort(bed["position"][:, 2], kind="stable")[:lowest])
        names = ("position", "velocity", "angular_velocity")
        columns = {k: np.tile(bed[k][chosen], (copies, 1)) for k in names}
    columns["position"][:, 1] += np.repeat(np.arange(copies) * DEPTH, lowest)
    return {"source": "explicit", "material": "polystyrene", "radius": RADIUS, **columns}


def bench_scene(state: str, particles: int, steps: int, **changes: Any) -> Scene:
    """A `settled` bed behind its gate, or a `flowing` one 0.15 s after the gate has gone.

    A multiple of 5000 particles, or fewer: then the lowest of one bed.
    """
    copies, lowest = max(1, particles // COUNT), min(particles, COUNT)
    if copies * lowest != particles:
        raise ValueError(f"{particles} particles: fewer than {COUNT}, or a multiple of {COUNT}, are wanted")
    return bed_scene(
        f"{state}_{particles}", tiled(state, copies, lowest), gate=state == "settled", copies=copies,
        duration=steps * STEP, **changes,
    )  # fmt: skip


def make() -> None:
    """Settle a bed, let it flow, write both states."""
    from gpudem.solver.solver import Solver

    loose = {
        "source": "lattice", "material": "polystyrene", "radius": RADIUS, "count": COUNT, "seed": 1,
        "lo": (0.0, 0.0, 0.0), "hi": (GATE, DEPTH, 0.5),
    }  # fmt: skip
    scene = bed_scene("bed", loose, gate=True, duration=SETTLE)
    for state, steps in (("settled", SETTLE), ("flowing", FLOW)):
        simulation = Solver(scene)
        simulation.start()
        simulation.advance(scene.steps(steps) - 1)
        simulation.write_step()
        frame = simulation.frame()
        columns = {k: frame[k] for k in ("position", "velocity", "angular_velocity")}
        np.savez_compressed(DATA / f"bed_{state}.npz", **columns)  # pyright: ignore[reportArgumentType]
        particles = {"source": "explicit", "material": "polystyrene", "radius": RADIUS, **columns}
        scene = bed_scene("bed", particles, gate=False, duration=FLOW)


if __name__ == "__main__":
    make()
