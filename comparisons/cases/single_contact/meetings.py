"""Many impacts in one scene, far apart: statement and evaluation that all cases of few particles share."""

from __future__ import annotations

import dataclasses

import numpy as np

from comparisons import kit
from comparisons.metrics import trace as measure
from comparisons.metrics.contacts import nearest_image
from comparisons.metrics.parting import period
from comparisons.oracles.impact import Impact, impact
from gpudem.output.run import Run
from gpudem.scene import Scene


@dataclasses.dataclass(frozen=True)
class Meeting:
    """One impact: particle row `row` on row `other`, or on the plane of that name."""

    label: str
    row: int
    other: int | str

    @property
    def rows(self) -> list[int]:
        """Rows of the particles in it."""
        return [self.row] if isinstance(self.other, str) else [self.row, self.other]


#: Steps before the touch, less a half: the touch is in the middle of a step on every rung, so that the part
#: of the first step in contact, an error of first order by itself, is the same on all of them.
RUNGS = {"quick": (121, 40, 13, 4), "standard": (364, 121, 40, 13, 4), "full": (364, 121, 40, 13, 4)}


def ladder(tier: kit.Tier, flight: float) -> dict[str, float]:
    """Label -> time step [s] of each rung, finest first, for impacts that all begin at `flight` [s]."""
    return {f"dt_{flight / (m + 0.5):.3g}": flight / (m + 0.5) for m in RUNGS[tier]}


def exact(results: kit.Results, scene: Scene, meeting: Meeting) -> Impact:
    """The oracle's solution, computed once per physics: the time step does not enter it."""
    physics = scene.replace(time={"step": 1.0, "duration": 1.0}, output={}, allow=["time_step"]).hash
    return results.once(("impact", meeting, physics), lambda: impact(scene, meeting.row, meeting.other))


def overlap(run: Run, meeting: Meeting) -> np.ndarray:
    """Overlap [m] at every step of the trace, with the nearest image; of a plane also after its removal."""
    position, radius = run.trace["position"], run.scene.state.radius
    if isinstance(meeting.other, str):
        plane = next(p for p in run.scene.planes if p.name == meeting.other)
        return radius[meeting.row] - plane.gap(position[:, meeting.row])
    apart = nearest_image(position[:, meeting.row] - position[:, meeting.other], period(run.scene))
    return radius[meeting.row] + radius[meeting.other] - np.linalg.norm(apart, axis=-1)


def relative_velocity(run: Run, meeting: Meeting) -> np.ndarray:
    """Velocity [m/s] of the meeting's first particle against its partner, (t, 3)."""
    velocity = run.trace["velocity"]
    return velocity[:, meeting.row] - (0.0 if isinstance(meeting.other, str) else velocity[:, meeting.other])


def errors(results: kit.Results, run: Run, meeting: Meeting) -> dict[str, float]:
    """Largest differences from the ODE over all steps: position / peak overlap, velocity and R x spin /
    impact speed. Worked out once for each run: a check of each quantity and the figures ask for them.
    """

    def compute() -> dict[str, float]:
        truth, rows = exact(results, run.scene, meeting), meeting.rows
        at, speed = truth.at(run.trace["time"]), float(np.hypot(truth.speed, truth.slip))
        spin = speed / run.scene.state.radius[rows]
        scales = {"position": truth.contact.peak_overlap, "velocity": speed, "angular_velocity": spin}
        return {
            k: measure.largest_difference(run.trace[k][:, rows], at[k], scale) for k, scale in scales.items()
        }

    key = ("errors", run.code, run.directory, run.scene.hash, meeting)  # runs in memory have no directory
    return results.once(key, compute)
