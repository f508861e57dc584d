"""What is kept of a run while it goes: frames on disk, trace of few particles, bulk quantities in time."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gpudem.output.directory import begin, begin_again
from gpudem.output.frames import FrameWriter
from gpudem.output.restart import Restart
from gpudem.output.run import HISTORY_COLUMNS, TRACE_COLUMNS
from gpudem.output.vtu import Frame
from gpudem.scene import Scene

if TYPE_CHECKING:
    import pandas


def bulk(scene: Scene, frame: Frame, mass: np.ndarray, step: int, contacts: int) -> tuple[float, ...]:
    """One row of the history, in the order of HISTORY_COLUMNS; energies [J], front and centre of mass [m]."""
    inertia = 0.4 * mass * frame["radius"] ** 2
    centre = mass @ frame["position"] / mass.sum()
    return (
        step,
        step * scene.time.step,
        0.5 * float(mass @ (frame["velocity"] ** 2).sum(axis=1)),
        0.5 * float(inertia @ (frame["angular_velocity"] ** 2).sum(axis=1)),
        -float(mass.sum() * (centre @ np.array(scene.gravity))),
        contacts,
        float(frame["position"][:, 0].max()),
        *centre.tolist(),
    )


class Recorder:
    """Collects the output of one run: frames on disk, trace and history in memory.

    Frames are written by a thread of their own while the run goes on, one at a time; `flush` waits for it.
    """

    def __init__(self, scene: Scene, directory: Path | None, resumed: Restart | None = None):
        self.scene, self.mass = scene, scene.masses
        output = scene.output
        self.frame_stride = scene.frame_stride if directory is not None else None
        self.trace_stride, self.history_stride = (
            scene.stride(output.trace_every),
            scene.stride(output.history_every),
        )
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
        self._history: list[tuple[float, ...]] = []
        self.restart_stride = scene.stride(output.restart_every) if directory is not None else None
        if resumed:
            self._take(resumed.recorded)

    def _strides(self) -> list[int]:
        strides = (self.frame_stride, self.trace_stride, self.history_stride, self.restart_stride)
        return [s for s in strides if s]

    def is_output_step(self, step: int) -> bool:
        """Whether this step is to be written."""
        return any(step % stride == 0 for stride in self._strides())

    def next_after(self, step: int) -> int:
        """The next step to be written (the last step of the run if none is)."""
        return min([(step // s + 1) * s for s in self._strides()], default=self.scene.n_steps)

    def restart_due(self, step: int) -> bool:
        """Whether a restart file is to be written at this step."""
        return bool(self.restart_stride) and step % self.restart_stride == 0 and 0 < step < self.scene.n_steps

    def saved(self) -> dict[str, np.ndarray]:
        """What is kept in memory, for a restart file; frames are on disk."""
        kept = {"history": np.array(self._history)} if self._history else {}
        if self._trace:
            kept["trace.step"] = np.array([step for step, _ in self._trace])
            kept |= {f"trace.{k}": np.stack([f[k] for _, f in self._trace]) for k in TRACE_COLUMNS}
        return kept

    def _take(self, saved: dict[str, np.ndarray]) -> None:
        self._history = [tuple(row) for row in saved.get("history", np.empty((0, 0))).tolist()]
        for k, step in enumerate(saved.get("trace.step", np.empty(0, int)).tolist()):
            self._trace.append((step, {name: saved[f"trace.{name}"][k] for name in TRACE_COLUMNS}))

    def add(self, step: int, frame: Frame, contacts: int, work: float | None = None) -> None:
        """Keep what is wanted of this step; `work` of moving walls so far [J], where there are any."""
        if self.trace_stride and step % self.trace_stride == 0:
            self._trace.append((step, {k: frame[k] for k in TRACE_COLUMNS}))
        if self.history_stride and step % self.history_stride == 0:
            row = bulk(self.scene, frame, self.mass, step, contacts)
            self._history.append(row if work is None else (*row, work))
        if self.writer and self.frame_stride and step % self.frame_stride == 0:
            self.flush()
            self._writing = self._pool.submit(self.writer.add, step, frame)

    def flush(self) -> None:
        """Wait until the last frame is on disk. Raises what went wrong in writing it."""
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

    @property
    def trace(self) -> dict[str, np.ndarray] | None:
        """step, time (t,) and TRACE_COLUMNS (t, n, 3); None if not asked for."""
        if not self._trace:
            return None
        steps = np.array([s for s, _ in self._trace])
        columns = {k: np.stack([f[k] for _, f in self._trace]) for k in TRACE_COLUMNS}
        return {"step": steps, "time": steps * self.scene.time.step, **columns}

    @property
    def history(self) -> pandas.DataFrame | None:
        """Table of HISTORY_COLUMNS, and of `work` where walls move; None if not asked for."""
        if not self._history:
            return None
        import pandas

        columns = (*HISTORY_COLUMNS, "work")[: len(self._history[0])]
        table = pandas.DataFrame(self._history, columns=list(columns))
        return table.astype({"step": int, "contacts": int})
