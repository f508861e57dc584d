"""Many impacts in one scene, far apart: statement and evaluation that all cases of few particles share."""

from __future__ import annotations

import dataclasses

import numpy as np

from comparisons.harness.case import Results, Tier
from comparisons.metrics import trace as measure
from comparisons.oracles import closed_forms
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


def ladder(tier: Tier, flight: float) -> dict[str, float]:
    """Label -> time step [s] of each rung, finest first, for impacts that all begin at `flight` [s]."""
    return {f"dt_{flight / (m + 0.5):.3g}": flight / (m + 0.5) for m in RUNGS[tier]}


def exact(results: Results, scene: Scene, meeting: Meeting) -> Impact:
    """The oracle's solution, computed once per physics: the time step does not enter it."""
    physics = scene.replace(time={"step": 1.0, "duration": 1.0}, output={}, allow=["time_step"]).hash
    return results.once(("impact", meeting, physics), lambda: impact(scene, meeting.row, meeting.other))


def overlap(run: Run, meeting: Meeting) -> np.ndarray:
    """Overlap [m] of a meeting at every step of the trace."""
    position, radius = run.trace["position"], run.scene.state.radius
    if isinstance(meeting.other, str):
        plane = next(p for p in run.scene.planes if p.name == meeting.other)
        return measure.overlap_with_plane(position, meeting.row, plane.point, plane.normal, radius)
    return measure.overlap_with_sphere(position, meeting.row, meeting.other, radius)


def relative_velocity(run: Run, meeting: Meeting) -> np.ndarray:
    """Velocity [m/s] of the meeting's first particle against its partner, (t, 3)."""
    velocity = run.trace["velocity"]
    return velocity[:, meeting.row] - (0.0 if isinstance(meeting.other, str) else velocity[:, meeting.other])


def observables(results: Results, run: Run, meeting: Meeting) -> dict[str, float]:
    """Peak overlap [m], contact time [s] and rebound [1] as the run has them."""
    time, deep = run.trace["time"], overlap(run, meeting)
    begin, end = measure.contact_interval(time, deep)
    normal = exact(results, run.scene, meeting).frame[0]
    return {
        "peak_overlap": measure.peak(time, deep)[1],
        "contact_time": end - begin,
        "rebound": measure.rebound(relative_velocity(run, meeting), normal),
    }


def expected(truth: Impact, limit_force: bool) -> dict[str, float]:
    """The same by closed forms, of an impact along the normal."""
    return {
        "peak_overlap": closed_forms.peak_overlap(truth.bodies, truth.speed),
        "contact_time": closed_forms.contact_time(truth.bodies, truth.speed, limit_force),
        "rebound": closed_forms.restitution(truth.bodies, limit_force),
    }


def errors(results: Results, run: Run, meeting: Meeting) -> dict[str, float]:
    """Largest differences from the ODE over all steps: position / peak overlap, velocity and R x spin /
    impact speed. Worked out once for each run: a check of each quantity and the figures ask for them.
    """
    key = ("errors", run.code, run.directory, run.scene.hash, meeting)  # runs in memory have no directory
    return results.once(key, lambda: _errors(results, run, meeting))


def _errors(results: Results, run: Run, meeting: Meeting) -> dict[str, float]:
    truth, trace = exact(results, run.scene, meeting), run.trace
    at = truth.at(trace["time"])
    radius = run.scene.state.radius[meeting.rows]
    speed = float(np.hypot(truth.speed, truth.slip))
    scale = {"position": truth.contact.peak_overlap, "velocity": speed, "angular_velocity": speed / radius}
    return {k: measure.largest_difference(trace[k][:, meeting.rows], at[k], s) for k, s in scale.items()}
