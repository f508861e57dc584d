"""Run a scene as hard spheres from start to end: output at exact times, progress, clean stop on Ctrl-C."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from gpudem.event_driven.engine import Engine
from gpudem.event_driven.statement import Statement
from gpudem.output.recorder import Recorder
from gpudem.output.run import Run, Timing
from gpudem.output.vtu import Frame
from gpudem.process import peak_memory, version
from gpudem.scene import Scene, checks

#: Columns of the history beside HISTORY_COLUMNS: collisions, energies [J] and the sum of impulse times
#: diameter over the collisions of pairs [J s], since the start.
EVENT_COLUMNS = ("collisions", "wall_collisions", "work", "dissipated", "virial")


def run(
    scene: Scene,
    directory: str | Path | None = None,
    *,
    tangential_restitution: float | None = None,
    guard: float = 0.0,
    cell_edge: float | None = None,
    budget: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> Run:
    """Simulate a scene's particles as hard spheres; disks are spheres in one layer.

    The time step of the scene only says when to write; Young's modulus and Poisson's ratio are not used.

    Args:
        scene: What to simulate.
        directory: Where frames and tables go; None keeps no frames.
        tangential_restitution: beta0 of rough spheres (Walton), -1 to 1: a collision turns the sliding
            velocity g of the point of contact into -beta0 g, or as far as Coulomb's mu J_n does. Scenes with
            friction need it, others may not have it.
        guard: t_c [s] of the TC model (Luding and McNamara 1998): who meets another sooner than t_c after
            the last collision does so elastically. 0: off; a scene that collapses is then an error.
        cell_edge: Edge of a cell [m]; changes the speed alone.
        budget: Most events of the run; default: as long as time goes on.
        progress: Called with the number of the scene's steps done, a few times a second.

    Returns:
        The run; its history has EVENT_COLUMNS too. On Ctrl-C what there is so far is saved first.

    Raises:
        SceneError: the scene says what hard spheres cannot state.
        SimulationError: event rate diverges, lost particle; frames already written stay.
    """
    began = time.perf_counter()
    path = None if directory is None else Path(directory)
    statement = Statement.of(scene, guard, tangential_restitution)
    recorder = Recorder(scene, path)
    engine = Engine(statement, cell_edge)
    setup_s = time.perf_counter() - began
    more: list[tuple[float, ...]] = []
    seconds = {"stepping": 0.0, "output": 0.0}
    notes: dict[str, object] = {"scene_hash": scene.hash, "guard": guard}
    notes["tangential_restitution"] = tangential_restitution
    step = 0

    def keep() -> None:
        start = time.perf_counter()
        if recorder.history_stride and step % recorder.history_stride == 0:
            counts, sums = engine.counts, engine.sums
            more.append((counts.collisions, counts.walls, sums.work, sums.dissipated, sums.virial))
        recorder.add(step, _frame(engine, scene), 0)
        seconds["output"] += time.perf_counter() - start

    def report(t: float) -> None:
        if progress:
            progress(round(t / scene.time.step))

    try:
        with recorder:
            keep()
            while step < scene.n_steps:
                stop = min(recorder.next_after(step), scene.n_steps)
                start = time.perf_counter()
                try:
                    engine.advance(stop * scene.time.step, budget, progress=report)
                finally:
                    seconds["stepping"] += time.perf_counter() - start
                step = stop
                keep()
                report(engine.time)
    except KeyboardInterrupt:
        notes["interrupted_at_step"] = step
        raise
    except Exception as error:
        notes["failed"] = str(error)
        raise
    finally:
        counts, sums = engine.counts, engine.sums
        notes |= {"events": counts.events, "crossings": counts.crossings, "stale": counts.stale}
        notes |= {"pair_collisions": counts.pairs, "wall_collisions": counts.walls}
        notes |= {
            "guarded_collisions": counts.guarded,
            "largest_overlap": sums.overlap,
            "virial": sums.virial,
        }
        history = recorder.history
        if history is not None:
            history[list(EVENT_COLUMNS)] = np.array(more[: len(history)])
        result = Run(
            code="event_driven",
            version=version(),
            scene=scene,
            directory=path or Path(),
            timing=Timing(
                particles=engine.n,
                steps=step,
                stepping_s=seconds["stepping"],
                setup_s=setup_s,
                output_s=seconds["output"],
                peak_memory_bytes=peak_memory(),
            ),
            warnings=checks.scene_warnings(scene),
            notes=notes,
            trace=recorder.trace,
            history=history,
        )
        if path is not None:
            result.save()
    return result


def _frame(engine: Engine, scene: Scene) -> Frame:
    """The present state with the columns that every code writes; a collision takes no time: forces are 0."""
    x, v = engine.state()
    none = np.zeros_like(x)
    return {
        "id": np.arange(1, engine.n + 1, dtype=np.int64),
        "material": scene.state.material.astype(np.int32),
        "position": x,
        "velocity": v,
        "angular_velocity": engine.spin,
        "force": none,
        "torque": none,
        "radius": engine.statement.radius,
    }
