"""Insertion for measuring its cost: the bed behind its gate filled by a stream, layer by layer.

The layers follow each other as closely as a stream's do: each comes when the one before has moved by a
diameter. So the share of the run that insertion costs is that of a busy scene, not of one that inserts
rarely.
"""

from __future__ import annotations

import itertools
import time
from typing import Any

import warp as wp

from comparisons.bench.beds import COUNT, DEPTH, GATE, RADIUS, STEP, bed_scene
from gpudem.scene import Scene
from gpudem.solver.solver import Solver

#: Insertions, and steps from one to the next: a diameter at SPEED [m/s].
EVENTS, INTERVAL = 100, 150
SPEED = 1.001 * 2 * RADIUS / (INTERVAL * STEP)
#: Steps of the run.
STEPS = EVENTS * INTERVAL
#: Height of the face [m].
HEIGHT = 0.4


def insertion_scene(particles: int, **changes: Any) -> Scene:
    """A bed that starts empty and gets so many spheres in EVENTS layers.

    Raises ValueError: no multiple of EVENTS; more than 5000 and no multiple of it.
    """
    copies = max(1, particles // COUNT)
    if particles % EVENTS or (particles > COUNT and copies * COUNT != particles):
        raise ValueError(
            f"{particles} particles: a multiple of {EVENTS} is wanted to insert, above {COUNT} of {COUNT}"
        )
    stream = {
        "kind": "stream", "material": "polystyrene", "radius": RADIUS, "velocity": (0.0, 0.0, -SPEED),
        "number_rate": particles / (STEPS * STEP), "seed": 1,
        "face": {"kind": "rectangle", "corner": (0.0, 0.0, HEIGHT),
                 "edges": ((GATE, 0.0, 0.0), (0.0, DEPTH * copies, 0.0))},
    }  # fmt: skip
    return bed_scene(
        f"insertion_{particles}", None, gate=True, copies=copies, duration=STEPS * STEP, insert=[stream],
        **changes,
    )  # fmt: skip


def step_through(solver: Solver, steps: int) -> tuple[float, float]:
    """Do so many steps; (wall-clock time [s], how much of it insertion took [s]).

    An insertion takes what its step takes longer than the steps up to the next one do on average. The list
    that it has made anew spares a rebuild soon after, which is not deducted.
    """

    def timed(count: int) -> float:
        begin = time.perf_counter()
        solver.advance(count)
        wp.synchronize_device(solver.device)
        return time.perf_counter() - begin

    first, end = solver.step_count, solver.step_count + steps
    marks = [*(step for step in solver.scene.insertion_steps if first < step <= end), end + 1]
    total, of_insertion = timed(marks[0] - first - 1), 0.0
    for event, after in itertools.pairwise(marks):
        with_insertion, without = timed(1), timed(after - event - 1)
        total += with_insertion + without
        of_insertion += with_insertion - without / max(1, after - event - 1)
    return total, of_insertion
