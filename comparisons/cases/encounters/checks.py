"""Checks of the encounters: step by step between codes, against the exact motion, and that what a scene is
made for does happen in it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from comparisons.cases.encounters.scenes import Encounter
from comparisons.cases.single_contact.checks import ODE, STEP_BY_STEP
from comparisons.cases.single_contact.meetings import Meeting
from comparisons.harness import check_builders as build
from comparisons.harness.case import Measured, PerCode, PerPair, Results, largest
from comparisons.metrics.contacts import nearest_image
from comparisons.oracles.motion import Motion, motion
from gpudem.output.run import Run
from gpudem.scene import Scene

#: Label of a variant -> what meets in it.
Encounters = Mapping[str, Sequence[Encounter]]


# -- measures ------------------------------------------------------------------------------------------------


def period(scene: Scene) -> np.ndarray:
    """Length [m] of the domain along periodic axes, 0 along others."""
    return np.where(scene.domain.periodic, np.subtract(scene.domain.hi, scene.domain.lo), 0.0)


def unwrapped(run: Run) -> np.ndarray:
    """Positions [m] of the trace without the jumps at periodic sides, (t, n, 3)."""
    position = run.trace["position"]
    steps = nearest_image(np.diff(position, axis=0), period(run.scene))
    return np.concatenate([position[:1], position[:1] + np.cumsum(steps, axis=0)])


def overlap(run: Run, meeting: Meeting) -> np.ndarray:
    """Overlap [m] at every step of the trace, with the nearest image; of a plane also after its removal."""
    position, radius = run.trace["position"], run.scene.state.radius
    if isinstance(meeting.other, str):
        plane = next(p for p in run.scene.planes if p.name == meeting.other)
        return radius[meeting.row] - plane.gap(position[:, meeting.row])
    apart = nearest_image(position[:, meeting.row] - position[:, meeting.other], period(run.scene))
    return radius[meeting.row] + radius[meeting.other] - np.linalg.norm(apart, axis=-1)


def present(run: Run, meeting: Meeting) -> np.ndarray:
    """Steps of the trace at which the two are in contact, (t,)."""
    plane = next((p for p in run.scene.planes if p.name == meeting.other), None)
    there = np.ones(len(run.trace["step"]), bool)
    if plane is not None and plane.removed_at is not None:
        there = run.trace["step"] <= run.scene.steps(plane.removed_at)
    return there & (overlap(run, meeting) > 0)


def begins(run: Run, meeting: Meeting) -> int:
    """How many contacts of the two begin within the run."""
    return int(np.count_nonzero(np.diff(present(run, meeting).astype(int)) > 0))


def exact(results: Results, scene: Scene, encounter: Encounter) -> Motion:
    """The oracle's motion, computed once."""
    images = {row: np.array(shift) for row, shift in encounter.images}
    key = ("motion", scene.hash, encounter)
    return results.once(key, lambda: motion(scene, encounter.meetings, images))


def errors(results: Results, run: Run, encounter: Encounter) -> Measured:
    """Largest error of velocity and R x spin over all steps and bodies, by the speed of the first impact."""
    truth, found = exact(results, run.scene, encounter), {}
    speed = float(np.hypot(truth.impacts[0][1].speed, truth.impacts[0][1].slip))
    for row in truth.pieces:
        at, radius = truth.at(row, run.trace["time"]), run.scene.state.radius[row]
        for column, scale, what in (
            ("velocity", speed, "velocity"),
            ("angular_velocity", speed / radius, "spin"),
        ):
            difference = run.trace[column][:, row] - at[column]
            found[f"{what} of particle {row + 1}"] = float(np.linalg.norm(difference, axis=-1).max() / scale)
    return largest(found)


def is_smooth(results: Results, scene: Scene, encounter: Encounter) -> bool:
    """Whether no impact of it is damped, and each slips from the first touch: second order in the step."""
    parts = [part for _, part in exact(results, scene, encounter).impacts]
    return all(part.bodies.restitution == 1 and part.contact.phases[0].mode == "slip" for part in parts)


def of_code(results: Results, code: str, labels: Sequence[str]) -> list[str]:
    """Those of the variants that a code ran. Raises what `results` raises, with the reason, if none."""
    ran = [label for label in labels if label in results.labels(code)]
    if not ran:
        results[labels[0], code]
    return ran


# -- checks --------------------------------------------------------------------------------------------------


def step_by_step(of: Encounters, catches: str) -> tuple[PerPair, ...]:
    """Two codes at every step of every variant, to rounding; fails if a meeting has no contact."""

    def scale(run: Run, column: str) -> np.ndarray | float:
        radius = run.scene.state.radius
        force = np.linalg.norm(run.trace["force"], axis=-1).max()
        return {"position": 2 * radius, "velocity": 1.0, "angular_velocity": 1 / radius, "force": force}[
            column
        ]

    def no_contact(run: Run) -> str:
        meetings = [m for e in of.get(run.scene.name, ()) for m in e.contacts]
        apart = (m for m in meetings if not present(run, m).any())
        return next((f"{m.label}: no contact of {m.row + 1} and {m.other}" for m in apart), "")

    units = {
        "velocity": "(1 m/s)",
        "angular_velocity": "(1 m/s / radius)",
        "force": "largest force of the scene",
    }
    return tuple(
        build.step_by_step(
            f"{column.replace('_', ' ')}, largest difference over all steps / {units.get(column, unit)}",
            column,
            lambda run, column=column: scale(run, column),
            defect=no_contact,
            read=unwrapped if column == "position" else None,
            tolerance=1e-9 if column == "force" else 1e-11,
            reason="same law, same scheme, same start: rounding is all that is left; measured values are a"
            " hundredth of this",
            catches=catches,
        )
        for column, (unit, _) in STEP_BY_STEP.items()
    )


def against_ode(
    of: Encounters, catches: str, damped: float | None = 1e-2, elastic: float | None = 1e-4
) -> tuple[PerCode, ...]:
    """Per code, largest error of velocity and R x spin: of damped encounters, and of elastic ones that slip
    from the first touch. None: there are none.
    """

    def error(results: Results, code: str, wanted: bool) -> Measured:
        found = {}
        for label in of_code(results, code, list(of)):
            run = results[label, code]
            chosen = [e for e in of[label] if is_smooth(results, run.scene, e) == wanted]
            found |= {f"{label}, {e.what}": errors(results, run, e) for e in chosen}
        return largest(found)

    kinds = [
        (False, damped, "damped or sticking", "some 300 steps to a contact; the dashpots see half-step"
         " velocities, slip and stick begin at whole steps: first order in the step, up to 5e-3; times two"),
        (True, elastic, "elastic, slip from the first touch", "some 300 steps to a contact; second"
         " order in the step without dashpots: up to 5e-5; times two"),
    ]  # fmt: skip
    return tuple(
        build.per_code(
            f"{name}: velocity and R x spin, largest error / impact speed",
            lambda results, code, wanted=wanted: error(results, code, wanted),
            tolerance=tolerance, against=ODE, reason=reason, catches=catches,
        )
        for wanted, tolerance, name, reason in kinds
        if tolerance is not None
    )  # fmt: skip


def happens(
    name: str, least: float, unit: str, count: Callable[[Run], Mapping[str, float]], labels: Sequence[str],
    catches: str,
) -> PerCode:  # fmt: skip
    """Per code: how much the smallest of some numbers of the runs falls below what it must be at least, so
    that the scene shows what it is made for.
    """

    def measure(results: Results, code: str) -> Measured:
        found = {}
        for label in of_code(results, code, labels):
            found |= {f"{label}, {what}": value for what, value in count(results[label, code]).items()}
        where = min(found, key=lambda what: found[what])
        return Measured(
            max(least - found[where], 0.0), found[where], least, note=f"smallest of {len(found)}: {where}"
        )

    return build.per_code(
        f"{name}: shortfall below {least:g}", measure, tolerance=0.0, unit=unit,
        against="what the scene is made for",
        reason="an exact statement; otherwise the other checks of this scene show less than they say",
        catches=catches,
    )  # fmt: skip
