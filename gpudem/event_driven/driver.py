"""Run a scene as hard spheres from start to end: output at exact times, progress, clean end on Ctrl-C."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from gpudem.errors import SceneError
from gpudem.event_driven.engine import Engine
from gpudem.event_driven.problem import HardSphereProblem
from gpudem.kernel_cache import kernel_cache
from gpudem.output.directory import check_writable
from gpudem.output.recorder import Recorder
from gpudem.output.run import Run, Timing, conclude
from gpudem.output.vtu import Frame
from gpudem.process import peak_memory, version
from gpudem.scene import Scene, checks

#: Columns of the history after HISTORY_COLUMNS, cumulative since the start: collisions [1], work of walls and
#: dissipation [J], and the sum of impulse times distance of centers over the collisions of pairs [J s].
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

    The time step only defines the times of output; Young's modulus and Poisson's ratio are not used.

    Args:
        scene: What to simulate.
        directory: Folder for frames and tables; None writes no files.
        tangential_restitution: beta0 of rough spheres (Walton 1993) [1], -1 to 1: a collision turns the
            sliding velocity g of the contact point into -beta0 g, limited by Coulomb's mu J_n. Required by
            scenes with friction, refused by others.
        guard: t_c of the TC model (Luding and McNamara 1998) [s], 0 or more: a collision sooner than t_c
            after the last one of either partner is elastic. 0: off; inelastic collapse is then an error.
        cell_edge: Edge of a cell [m], at least the largest diameter; changes only the speed.
        budget: Largest number of events of the run, 1 or more; default: no limit.
        progress: Called with the number of the scene's steps simulated so far, a few times a second.

    Returns:
        The run; its history has EVENT_COLUMNS too. On an error or Ctrl-C it is saved up to there.

    Raises:
        SceneError: the scene or an option asks for what hard spheres do not support.
        SimulationError: the event rate diverges, or a particle is lost; frames already written stay.
    """
    began = time.perf_counter()
    _check_budget(scene, budget)
    path = None if directory is None else Path(directory)
    problem = HardSphereProblem.from_scene(scene, guard, tangential_restitution)
    if path is not None:
        check_writable(path)
    with kernel_cache():
        engine = Engine(problem, cell_edge)
    recorder = Recorder(scene, path)
    events = _EventRun(scene, engine, recorder)
    setup_s = time.perf_counter() - began
    notes: dict[str, object] = {"scene_hash": scene.hash, "guard": guard}
    notes["tangential_restitution"] = tangential_restitution
    failure: BaseException | None = None
    try:
        with recorder:
            events.simulate(budget, progress)
    except KeyboardInterrupt as error:
        failure, notes["interrupted_at_step"] = error, events.step
    except Exception as error:
        failure, notes["failed"] = error, str(error)
    return conclude(events.result(path or Path(), notes, setup_s), path is not None, failure)


def _check_budget(scene: Scene, budget: int | None) -> None:
    if budget is not None and not (isinstance(budget, int | np.integer) and budget >= 1):
        raise SceneError(
            f"{scene.name} (event-driven)", [f"budget = {budget!r}: must be an integer of 1 or more"]
        )


class _EventRun:
    """The engine, advanced from output to output of one scene."""

    def __init__(self, scene: Scene, engine: Engine, recorder: Recorder):
        self.scene, self.engine, self.recorder, self.step = scene, engine, recorder, 0
        self._event_rows: list[tuple[float, ...]] = []
        self._stepping_s = self._output_s = 0.0

    def simulate(self, budget: int | None, progress: Callable[[int], None] | None) -> None:
        """Advance to the end of the scene, with output; raises what Engine.advance does."""

        def report(t: float) -> None:
            if progress:
                progress(round(t / self.scene.time.step))

        self._record()
        while self.step < self.scene.n_steps:
            stop = min(self.recorder.next_after(self.step), self.scene.n_steps)
            start = time.perf_counter()
            try:
                self.engine.advance(stop * self.scene.time.step, budget, progress=report)
            finally:
                self._stepping_s += time.perf_counter() - start
            self.step = stop
            self._record()
            report(self.engine.time)

    def _record(self) -> None:
        start = time.perf_counter()
        if self.recorder.history_stride and self.step % self.recorder.history_stride == 0:
            counts, sums = self.engine.counts, self.engine.sums
            row = (counts.collisions, counts.walls, sums.work, sums.dissipated, sums.virial)
            self._event_rows.append(row)
        self.recorder.add(self.step, self._frame(), unwrapped=self.engine.unwrapped_positions())
        self._output_s += time.perf_counter() - start

    def _frame(self) -> Frame:
        """The present state in the columns of every code; forces are 0, as collisions are instantaneous."""
        x, v = self.engine.state()
        zero = np.zeros_like(x)
        return {
            "id": np.arange(1, self.engine.n + 1, dtype=np.int64),
            "material": self.scene.state.material.astype(np.int32),
            "position": x,
            "velocity": v,
            "angular_velocity": self.engine.angular_velocity,
            "force": zero,
            "torque": zero,
            "radius": self.engine.problem.radius,
        }

    def result(self, directory: Path, notes: dict[str, object], setup_s: float) -> Run:
        """The run so far; adds the counts and sums of the engine to the notes."""
        counts, sums = self.engine.counts, self.engine.sums
        notes |= {
            "events": counts.events,
            "crossings": counts.crossings,
            "stale": counts.stale,
            "pair_collisions": counts.pairs,
            "wall_collisions": counts.walls,
            "guarded_collisions": counts.guarded,
            "largest_overlap": sums.overlap,
            "virial": sums.virial,
        }
        history = self.recorder.history
        if history is not None:
            history[list(EVENT_COLUMNS)] = np.array(self._event_rows[: len(history)])
        return Run(
            code="event_driven",
            version=version(),
            scene=self.scene,
            directory=directory,
            timing=Timing(
                particles=self.engine.n,
                steps=self.step,
                stepping_s=self._stepping_s,
                setup_s=setup_s,
                output_s=self._output_s,
                peak_memory_bytes=peak_memory(),
            ),
            warnings=checks.scene_warnings(self.scene),
            notes=notes,
            trace=self.recorder.trace,
            history=history,
        )
