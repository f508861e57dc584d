"""A rotating drum of triangles for measuring speed: 5000 flowing spheres a slice, slices side by side.

`python -m comparisons.bench.drum` makes data/bed_drum.npz anew with gpudem: a slice, periodic along the axis.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np

from comparisons.bench.beds import COUNT, DATA, MATERIALS, PAIRS, RADIUS, SKIN, STEP, bench_scene
from comparisons.bench.insertion import insertion_scene
from comparisons.oracles.mesh_shapes import faceted_cylinder
from gpudem.scene import Scene

#: Of the drum [m]; of a slice along the axis y [m]; half of it is filled.
DRUM_RADIUS, SLICE = 0.125, 0.04
#: 300 triangles a slice: 1200 for 20 000 spheres.
FACETS, CELLS = 50, 3
#: Of one turn [s]: a cascading bed, omega^2 R/g = 0.13.
PERIOD = 2.0
#: How long the bed falls and turns before it is kept [s].
FLOW = 1.0


def drum_scene(
    name: str, particles: dict[str, Any], *, copies: int, periodic: bool, duration: float, **changes: Any
) -> Scene:
    """So many slices of the drum, with or without ends of planes a radius beyond the outermost centers."""
    length = SLICE * copies + (0 if periodic else 2 * RADIUS)
    shell = faceted_cylinder(FACETS, DRUM_RADIUS, length, CELLS * copies)
    shell[..., 1] += length / 2
    turning = [{"type": "rotate", "axis": (0, 1, 0), "period": PERIOD}]
    corners = {"vertices": shell.reshape(-1, 3), "triangles": np.arange(3 * len(shell)).reshape(-1, 3)}
    drum = {"kind": "mesh", "name": "drum", "material": "acrylic", "motion": turning, **corners}
    ends = [
        {"kind": "plane", "name": name, "material": "acrylic", "point": (0, y, 0), "normal": (0, side, 0)}
        for name, y, side in (("near_end", 0.0, 1), ("far_end", length, -1))
    ]
    outer = 1.01 * DRUM_RADIUS / math.cos(math.pi / FACETS)
    margin = 0.0 if periodic else 0.001
    data: dict[str, Any] = {
        "name": name, "materials": MATERIALS, "pairs": PAIRS, "particles": particles,
        "walls": [drum] if periodic else [drum, *ends], "gravity": (0.0, 0.0, -9.81),
        "domain": {"lo": (-outer, -margin, -outer), "hi": (outer, length + margin, outer),
                   "periodic": (False, periodic, False)},
        "time": {"step": STEP, "duration": duration}, "solver": {"skin": SKIN},
    }  # fmt: skip
    return Scene(**{**data, **changes})


def drum_bed(particles: int, steps: int, **changes: Any) -> Scene:
    """A drum of as many slices as so many spheres need. Raises ValueError: no multiple of 5000."""
    copies = particles // COUNT
    if copies * COUNT != particles or not copies:
        raise ValueError(f"{particles} particles: a multiple of {COUNT} is wanted in the drum")
    with np.load(DATA / "bed_drum.npz") as bed:
        columns = {k: np.tile(bed[k], (copies, 1)) for k in ("position", "velocity", "angular_velocity")}
    columns["position"][:, 1] += np.repeat(np.arange(copies) * SLICE, COUNT) + RADIUS
    stated = {"source": "explicit", "material": "polystyrene", "radius": RADIUS, **columns}
    return drum_scene(
        f"drum_{particles}", stated, copies=copies, periodic=False, duration=steps * STEP, **changes
    )


def timed_scene(bed: str, particles: int, steps: int, **changes: Any) -> Scene:
    """The scene of a row of `gpudem bench`: a `settled` or `flowing` bed, a `drum`, or an `insertion`, whose
    steps are its own.
    """
    if bed == "insertion":
        return insertion_scene(particles, **changes)
    return (drum_bed if bed == "drum" else partial(bench_scene, bed))(particles, steps, **changes)


def make() -> None:
    """Let a slice fall and turn, write its state."""
    from gpudem.solver.solver import Solver

    side = DRUM_RADIUS / math.sqrt(2)
    grid = np.stack(np.meshgrid(*[np.arange(k) for k in (29, 6, 29)], indexing="ij"), -1).reshape(-1, 3)
    position = (grid + 0.5) * [0.0061, SLICE / 6, 0.0061] - [side, 0, side]
    chosen = np.argsort(position[:, 2], kind="stable")[:COUNT]
    shift = np.random.default_rng(1).uniform(-4e-5, 4e-5, (COUNT, 3))
    loose = {"source": "explicit", "material": "polystyrene", "radius": RADIUS,
             "position": position[chosen] + shift}  # fmt: skip
    scene = drum_scene("drum", loose, copies=1, periodic=True, duration=FLOW)
    solver = Solver(scene)
    solver.start()
    solver.advance(scene.n_steps - 1)
    solver.write_step(last=True)
    frame = solver.frame()
    columns = {k: frame[k] for k in ("position", "velocity", "angular_velocity")}
    np.savez_compressed(DATA / "bed_drum.npz", **columns)  # pyright: ignore[reportArgumentType]


if __name__ == "__main__":
    make()
