"""Run a scene from start to end: segments between gate removals, output, progress, clean stop on Ctrl-C."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import warp

from gpudem.hooks import Hook
from gpudem.kernel_cache import kernel_cache
from gpudem.output.directory import check_writable
from gpudem.output.recorder import Recorder
from gpudem.output.restart import Restart
from gpudem.output.run import Run, Timing, conclude
from gpudem.process import peak_memory, version
from gpudem.scene import Scene, checks
from gpudem.simulation import Simulation
from gpudem.solver import guards
from gpudem.solver.solver import Solver

if TYPE_CHECKING:
    import pandas

#: Steps between two looks at the clock, for progress.
CHUNK = 64


def simulate(
    scene: Scene,
    directory: str | Path | None = None,
    *,
    device: str = "cpu",
    threads: int | None = None,
    precision: str | None = None,
    integrator: str | None = None,
    specialize: bool = True,
    progress: Callable[[int], None] | None = None,
    hooks: Sequence[Hook] = (),
) -> Run:
    """Simulate a scene; with a directory, frames and tables are written there while it runs.

    Args:
        scene: What to simulate.
        directory: Folder of the run (`gpudem.output.directory`), made if missing; the files of an older run
            in it are removed once the solver is set up, other files stay. None: no frames.
        device: Warp device, "cpu" or "cuda:0".
        threads: CPU threads; default: one for each core, fewer for few particles.
        precision: Overrides the scene's.
        integrator: Overrides the scene's.
        specialize: False: carry what any scene may have, though this one does not need it: slower, to measure
            what specialisation saves.
        progress: Called with the number of steps done, a few times a second.
        hooks: Functions called every so often (`gpudem.every`) with the run's `gpudem.Simulation`.

    Returns:
        The run; on Ctrl-C what there is so far is saved first, then KeyboardInterrupt is raised again.

    Raises:
        SimulationError: lost particle, NaN; frames already written stay.
        KernelCacheError: Warp has no folder for its kernels; nothing is written.
        WriteError: directory cannot be written, disk full; what is complete stays.
    """
    overrides = {"precision": precision, "integrator": integrator}
    if any(overrides.values()):
        scene = scene.replace(solver={k: v for k, v in overrides.items() if v})
    path = None if directory is None else Path(directory)
    return _run(scene, path, device, threads, progress, hooks, specialize=specialize)


def resume(
    directory: str | Path,
    *,
    device: str = "cpu",
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
    hooks: Sequence[Hook] = (),
) -> Run:
    """Continue from DIRECTORY/restart.npz; on the same kind of device to the last bit as if never stopped.

    The folder holds all that is needed and may have been moved; frames after the restart's step are written
    again. Arguments, result and errors as in `simulate`.

    Raises:
        GpudemError: no restart file, a broken one, or one of another scene than the folder's.
    """
    restart = Restart.load(Path(directory))
    return _run(restart.scene, Path(directory), device, threads, progress, hooks, restart)


def _run(
    scene: Scene,
    path: Path | None,
    device: str,
    threads: int | None,
    progress: Callable[[int], None] | None,
    hooks: Sequence[Hook],
    restart: Restart | None = None,
    specialize: bool = True,
) -> Run:
    if path is not None:
        check_writable(path)
    begin = time.perf_counter()
    with kernel_cache():
        simulation = Solver(scene, device, threads, specialize=specialize)
    timer = PhaseTimer(progress)
    timer.setup_s = time.perf_counter() - begin - simulation.compile_s
    notes: dict[str, object] = {}
    if restart:
        notes["resumed_at_step"] = restart.step
        timer.add(restart.seconds)
    with contextlib.closing(simulation):
        # only now, with the solver set up, is the folder of an older run touched or a new one made
        recorder = Recorder(scene, path, restart)
        failure: BaseException | None = None
        try:
            with recorder:
                output = _Output(simulation, recorder, timer, path, hooks)
                _segments(simulation, output, timer, restart)
                with timer.output():
                    recorder.flush()
        except KeyboardInterrupt as error:
            failure, notes["interrupted_at_step"] = error, simulation.step_count
        except Exception as error:
            failure, notes["failed"] = error, str(error)
        rounded = [warning for hook in hooks for warning in hook.warnings(scene)]
        result = _result(simulation, recorder, timer, path, notes, rounded)
        return conclude(result, path is not None, failure)


def _energy_warnings(simulation: Solver, history: pandas.DataFrame | None) -> list[str]:
    """Of the energies in time, where the history has them all."""
    scene, left = simulation.scene, simulation.departures
    if history is None or not {"kinetic_energy", "rotational_energy", "potential_energy"} <= set(history):
        return []
    return guards.energy_warnings(scene, history, left.energy_up_to(history.step.to_numpy()))


def _result(
    simulation: Solver,
    recorder: Recorder,
    timer: PhaseTimer,
    path: Path | None,
    notes: dict[str, object],
    rounded: list[str],
) -> Run:
    """The run as far as it came."""
    scene = simulation.scene
    notes |= {"rebuilds": simulation.neighbors.rebuilds, "scene_hash": scene.hash}
    notes["list"] = simulation.neighbors.tuning()
    notes["arrays"] = simulation.memory_bytes()
    return Run(
        code="gpudem",
        version=version(),
        scene=scene,
        directory=path or Path(),
        timing=Timing(
            particles=simulation.departures.mean_count(simulation.step_count),
            steps=simulation.step_count,
            stepping_s=timer.stepping_s,
            setup_s=timer.setup_s,
            compile_s=simulation.compile_s,
            output_s=timer.output_s,
            device=str(simulation.device),
            cores=simulation.pool.threads,
            precision=scene.solver.precision,
            peak_memory_bytes=peak_memory(),
        ),
        warnings=checks.warnings(scene) + rounded + _energy_warnings(simulation, recorder.history),
        notes=notes,
        trace=recorder.trace,
        history=recorder.history,
    )


class _Output:
    """Output, restart files and hooks of one run, at the steps at which they are wanted."""

    def __init__(
        self,
        simulation: Solver,
        recorder: Recorder,
        timer: PhaseTimer,
        path: Path | None,
        hooks: Sequence[Hook],
    ):
        self.simulation, self.recorder, self.timer, self.path = simulation, recorder, timer, path
        self.hooks = [(hook.stride(simulation.scene), hook.action) for hook in hooks]
        self._public = Simulation.of_solver(simulation)

    def next_after(self, step: int) -> int:
        """The next step that has output, a restart file or a hook."""
        return min([self.recorder.next_after(step), *((step // s + 1) * s for s, _ in self.hooks)])

    def record(self, step: int, last: bool = False) -> None:
        """Write what is wanted of a step that the solver has written; the `last` of a segment is checked."""
        if last or self.recorder.is_output_step(step):
            with self.timer.output():
                view = self._public.view(step)
                if last:
                    view.require_finite()
                self.recorder.record(view)

    def call_hooks(self, step: int) -> None:
        """Call those whose step this is, after its output."""
        for stride, action in self.hooks:
            if step % stride == 0:
                with self.timer.output():
                    action(self._public)

    def save_restart(self, step: int) -> None:
        """Write the restart file, if it is the step for one and output is on disk up to here."""
        if self.path is not None and self.recorder.is_restart_step(step):
            with self.timer.output():
                self.recorder.flush()
                arrays, recorded = self.simulation.state_dict(), self.recorder.saved()
                restart = Restart(self.simulation.scene, step, arrays, recorded, self.timer.seconds())
                restart.save(self.path)


def _segments(simulation: Solver, output: _Output, timer: PhaseTimer, restart: Restart | None) -> None:
    """Between gate removals: set-up, then steps up to each output, the last one with full-step velocities."""
    for first, last, walls in simulation.scene.segments:
        if restart and last <= restart.step:
            continue
        continued = restart is not None and first <= restart.step
        with timer.setup(simulation):
            if restart and continued:
                simulation.load_state_dict(restart.arrays, walls)  # mutate: restart_resume
            else:
                simulation.start(walls, write=first == 0)
        if first == 0 and not continued:
            output.record(0)
            output.call_hooks(0)
        if not continued:
            output.save_restart(first)  # at the removal of a gate: with the set-up behind it
        while simulation.step_count < last:
            stop = min(output.next_after(simulation.step_count), last)
            while simulation.step_count < stop - 1:
                with timer.stepping(simulation):
                    simulation.advance(min(CHUNK, stop - 1 - simulation.step_count))
            with timer.stepping(simulation):
                simulation.write_step(last=stop == last)
            output.record(stop, last=stop == last)
            output.call_hooks(stop)
            if stop < last:
                output.save_restart(stop)


class PhaseTimer:
    """Adds up set-up (of each segment), stepping and output time; reports progress a few times a second."""

    def __init__(self, progress: Callable[[int], None] | None):
        self.setup_s = self.stepping_s = self.output_s = 0.0
        self._progress, self._reported = progress, 0.0
        self._begin, self._attribute = 0.0, ""
        self._simulation: Solver | None = None

    def setup(self, simulation: Solver) -> PhaseTimer:
        """Count the block as set-up."""
        self._attribute, self._simulation = "setup_s", simulation
        return self

    def stepping(self, simulation: Solver) -> PhaseTimer:
        """Count the block as stepping."""
        self._attribute, self._simulation = "stepping_s", simulation
        return self

    def output(self) -> PhaseTimer:
        """Count the block as output."""
        self._attribute = "output_s"
        return self

    def seconds(self) -> dict[str, float]:
        """Wall-clock time so far, by the fields of Timing."""
        return {name: getattr(self, name) for name in ("setup_s", "stepping_s", "output_s")}

    def add(self, seconds: dict[str, float]) -> None:
        """Count what another process has spent on this run."""
        for name, value in seconds.items():
            setattr(self, name, getattr(self, name) + value)

    def __enter__(self) -> None:
        self._begin = time.perf_counter()

    def __exit__(self, *error: object) -> None:
        if self._simulation and self._simulation.device.is_cuda:
            warp.synchronize_device(self._simulation.device)
        now = time.perf_counter()
        setattr(self, self._attribute, getattr(self, self._attribute) + now - self._begin)
        if self._progress and self._simulation and now - self._reported > 0.2:
            self._reported = now
            self._progress(self._simulation.step_count)
