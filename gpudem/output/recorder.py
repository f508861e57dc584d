"""The output of a run while it advances: frames on disk, trace of few particles, observables in time."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gpudem.output import observables
from gpudem.output.directory import begin, begin_again
from gpudem.output.frames import FrameWriter
from gpudem.output.observables import Observable
from gpudem.output.restart import Restart
from gpudem.output.run import TRACE_COLUMNS
from gpudem.output.view import View
from gpudem.output.vtu import Frame
from gpudem.scene import Scene

if TYPE_CHECKING:
    import pandas


class Recorder:
    """Collects the output of one run: frames on disk, trace and history in memory.

    Frames are written by a thread of their own while the run continues, one at a time; `flush` waits for it.
    """

    def __init__(self, scene: Scene, directory: Path | None, resumed: Restart | None = None):
        """With a directory, it is made that of this run (`begin`, `begin_again`). Raises WriteError."""
        self.scene = scene
        output, on_disk = scene.output, directory is not None
        self.frame_stride = scene.frame_stride if on_disk else None
        self.trace_stride = scene.stride(output.trace_every)
        self.history_stride = scene.stride(output.history_every)
        self.restart_stride = scene.stride(output.restart_every) if on_disk else None
        self.writer = None
        if directory is not None:
            if resumed:
                begin_again(directory, resumed.step)
            else:
                begin(directory, scene)
            self.writer = FrameWriter(directory, scene, resumed.step if resumed else None)
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="frames")
        self._writing: Future[None] | None = None
        self._trace: list[tuple[int, Frame]] = []
        self._columns: list[Observable] | None = None
        self._history: list[tuple[float, ...]] = []
        if resumed:
            self._take(resumed.recorded)

    # -- which steps ---------------------------------------------------------------------------------------

    def is_output_step(self, step: int) -> bool:
        """Whether a frame, the trace or the history has an entry at this step."""
        strides = (self.frame_stride, self.trace_stride, self.history_stride)
        return any(step % stride == 0 for stride in strides if stride)

    def is_restart_step(self, step: int) -> bool:
        """Whether a restart file is to be written at this step."""
        return bool(self.restart_stride) and step % self.restart_stride == 0 and 0 < step < self.scene.n_steps

    def next_after(self, step: int) -> int:
        """The next step at which anything is to be written (the last step of the run if none is)."""
        strides = (self.frame_stride, self.trace_stride, self.history_stride, self.restart_stride)
        return min([(step // s + 1) * s for s in strides if s], default=self.scene.n_steps)

    # -- recording -----------------------------------------------------------------------------------------

    def record(self, view: View) -> None:
        """Take what is wanted of the step of a view.

        Raises:
            SimulationError: a particle's position or velocity is not a number.
            WriteError: the frame before this one could not be written.
        """
        step = view.step
        if self.trace_stride and step % self.trace_stride == 0:
            self._trace.append((step, {name: self._row(view, name) for name in TRACE_COLUMNS}))
        if self.history_stride and step % self.history_stride == 0:
            if self._columns is None:
                self._columns = self._chosen(view)
            row = (step, view.time, *(column(view) for column in self._columns))
            if not np.isfinite(row).all():
                view.require_finite()
            self._history.append(row)
        if self.writer and self.frame_stride and step % self.frame_stride == 0:
            self.flush()
            self._writing = self._pool.submit(
                self.writer.add, step, view.frame(), view.servo_ways, view.triangle_forces
            )

    def add(self, step: int, frame: Frame, contacts: int = 0, unwrapped: np.ndarray | None = None) -> None:
        """As `record`, for a code that has the step as a frame, and `unwrapped` positions [m]."""
        self.record(View.of_frame(self.scene, step, frame, contacts, unwrapped))

    def _row(self, view: View, name: str) -> np.ndarray:
        """Of all particles of the run; NaN for those that have not come yet, or have left."""
        values = view.numpy(name)
        if len(values) == len(self.scene.state):
            return values
        found = np.full((len(self.scene.state), 3), np.nan)
        found[view.rows] = values
        return found

    def _chosen(self, view: View) -> list[Observable]:
        names = self.scene.output.history
        if names is None:
            names = observables.DEFAULT if view.wall_work is None else (*observables.DEFAULT, "work")
        return [*(observables.get(name) for name in names), *self._by_scene()]

    def _by_scene(self) -> list[Observable]:
        """Of walls, groups, exits and planes of flow, which the scene names."""
        walls, exits = self.scene.output.wall_forces, [stated.name for stated in self.scene.exits]
        return [
            *(o for wall in walls for o in observables.of_wall(wall)),
            *(o for group in self.scene.loaded_groups for o in observables.of_group(group)),
            *(o for name in exits for o in observables.of_exit(name)),
            *(o for plane in self.scene.output.flow for o in observables.of_flow(plane)),
        ]

    def flush(self) -> None:
        """Wait until the last frame is on disk. Raises the error of its writing."""
        writing, self._writing = self._writing, None
        if writing is not None:
            writing.result()

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *error: object) -> None:
        try:
            self.flush()
        finally:
            self._pool.shutdown()

    # -- restart -------------------------------------------------------------------------------------------

    def saved(self) -> dict[str, np.ndarray]:
        """What is in memory, for a restart file; frames are on disk."""
        stored: dict[str, np.ndarray] = {}
        if self._columns is not None:
            stored["history"] = np.array(self._history)
            stored["history.columns"] = np.array([column.name for column in self._columns])
        if self._trace:
            stored["trace.step"] = np.array([step for step, _ in self._trace])
            stored |= {f"trace.{k}": np.stack([f[k] for _, f in self._trace]) for k in TRACE_COLUMNS}
        return stored

    def _take(self, saved: dict[str, np.ndarray]) -> None:
        if "history" in saved:
            loads = {o.name: o for o in self._by_scene()}
            names = map(str, saved["history.columns"])
            self._columns = [loads.get(name) or observables.get(name) for name in names]
            self._history = [tuple(row) for row in saved["history"].tolist()]
        for k, step in enumerate(saved.get("trace.step", np.empty(0, int)).tolist()):
            self._trace.append((step, {name: saved[f"trace.{name}"][k] for name in TRACE_COLUMNS}))

    # -- tables --------------------------------------------------------------------------------------------

    @property
    def trace(self) -> dict[str, np.ndarray] | None:
        """step, time (t,) and TRACE_COLUMNS (t, n, 3), NaN before a particle has come; None if not asked
        for.
        """
        if not self._trace:
            return None
        steps = np.array([s for s, _ in self._trace])
        columns = {k: np.stack([f[k] for _, f in self._trace]) for k in TRACE_COLUMNS}
        return {"step": steps, "time": steps * self.scene.time.step, **columns}

    @property
    def history(self) -> pandas.DataFrame | None:
        """Table of step, time [s] and the scene's observables; None if not asked for."""
        if not self._history or self._columns is None:
            return None
        import pandas

        names = [*observables.ALWAYS, *(column.name for column in self._columns)]
        table = pandas.DataFrame(self._history, columns=names)
        table = table.astype({"step": int} | {c.name: int for c in self._columns if c.integer})
        return observables.with_rates(table, self.scene)
