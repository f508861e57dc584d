"""Checks of the encounters: step by step between codes, against the exact motion, and that what a scene is
made for does happen in it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from comparisons import kit
from comparisons.cases.encounters.throws import Encounter, Encounters
from comparisons.cases.single_contact.checks import ODE, STEP_BY_STEP, columns_agree
from comparisons.cases.single_contact.meetings import Meeting, overlap
from comparisons.metrics.contacts import nearest_image
from comparisons.metrics.parting import Trace, period
from comparisons.metrics.trace import largest_difference
from comparisons.oracles.motion import Motion, motion
from gpudem.output.run import Run
from gpudem.scene import Scene

# -- measures ------------------------------------------------------------------------------------------------


def unwrapped(run: Run) -> np.ndarray:
    """Positions [m] of the trace without the jumps at periodic sides, (t, n, 3)."""
    position = run.trace["position"]
    steps = nearest_image(np.diff(position, axis=0), period(run.scene))
    return np.concatenate([position[:1], position[:1] + np.cumsum(steps, axis=0)])


def present(run: Run, meeting: Meeting) -> np.ndarray:
    """Steps of the trace at which the two are in contact, (t,)."""
    plane = next((p for p in run.scene.planes if p.name == meeting.other), None)
    there = np.ones(len(run.trace["step"]), bool)
    if plane is not None and plane.removed_at is not None:
        there = run.trace["step"] <= run.scene.steps(plane.removed_at)
    return there & (overlap(run, meeting) > 0)


def differences(a: Trace, b: Trace, radius: np.ndarray) -> dict[str, float]:
    """Largest difference of velocity and of R x spin over all steps [m/s]."""
    scales = {"velocity": np.ones(len(radius)), "angular_velocity": 1 / radius}
    return {column: largest_difference(a[column], b[column], scale) for column, scale in scales.items()}


def exact(results: kit.Results, scene: Scene, encounter: Encounter) -> Motion:
    """The oracle's motion, computed once."""
    images = {row: np.array(shift) for row, shift in encounter.images}
    key = ("motion", scene.hash, encounter)
    return results.once(key, lambda: motion(scene, encounter.meetings, images))


def errors(results: kit.Results, run: Run, encounter: Encounter) -> kit.Measured:
    """Largest error of velocity and R x spin over all steps and bodies, by the speed of the first impact."""
    truth, found = exact(results, run.scene, encounter), {}
    speed = float(np.hypot(truth.impacts[0][1].speed, truth.impacts[0][1].slip))
    for row in truth.pieces:
        at, radius = truth.at(row, run.trace["time"]), run.scene.state.radius[row]
        for column, scale in (("velocity", speed), ("angular_velocity", speed / radius)):
            gap = np.linalg.norm(run.trace[column][:, row] - at[column], axis=-1).max()
            found[f"{column.replace('angular_velocity', 'spin')} of particle {row + 1}"] = float(gap / scale)
    return kit.largest(found)


def is_smooth(results: kit.Results, scene: Scene, encounter: Encounter) -> bool:
    """Whether no impact of it is damped, and each slips from the first touch: second order in the step."""
    parts = [part for _, part in exact(results, scene, encounter).impacts]
    return all(part.bodies.restitution == 1 and part.contact.phases[0].mode == "slip" for part in parts)


def of_code(results: kit.Results, code: str, labels: Sequence[str]) -> list[str]:
    """Those of the variants that a code ran. Raises what `results` raises, with the reason, if none."""
    ran = [label for label in labels if label in results.labels(code)]
    if not ran:
        results[labels[0], code]
    return ran


# -- checks --------------------------------------------------------------------------------------------------


def step_by_step(of: Encounters, catches: str) -> tuple[kit.PerPair, ...]:
    """Two codes at every step of every variant, to rounding; fails if a meeting has no contact."""

    def scale(run: Run, column: str) -> np.ndarray | float:
        radius = run.scene.state.radius
        force = np.linalg.norm(run.trace["force"], axis=-1).max()
        scales = {"position": 2 * radius, "velocity": 1.0, "angular_velocity": 1 / radius, "force": force}
        return scales[column]

    def no_contact(run: Run) -> str:
        meetings = [m for e in of.get(run.scene.name, ()) for m in e.contacts]
        apart = (m for m in meetings if not present(run, m).any())
        return next((f"{m.label}: no contact of {m.row + 1} and {m.other}" for m in apart), "")

    units = ("diameter", "(1 m/s)", "(1 m/s / radius)", "largest force of the scene")
    columns = {column: (unit, catches) for column, unit in zip(STEP_BY_STEP, units, strict=True)}
    return columns_agree(columns, scale, {"position": unwrapped}, defect=no_contact)


def against_ode(
    of: Encounters, catches: str, damped: float | None = 1e-2, elastic: float | None = 1e-4
) -> tuple[kit.PerCode, ...]:
    """Per code, largest error of velocity and R x spin: of damped encounters, and of elastic ones that slip
    from the first touch. None: there are none.
    """

    def error(results: kit.Results, code: str, wanted: bool) -> dict[str, kit.Measured]:
        return {
            f"{label}, {e.what}": errors(results, results[label, code], e)
            for label in of_code(results, code, list(of))
            for e in of[label]
            if is_smooth(results, results[label, code].scene, e) == wanted
        }

    kinds = [
        (False, damped, "damped or sticking", "the dashpots use half-step velocities, slip and stick begin at"
         " whole steps: first order in the step, up to 5e-3; times two"),
        (True, elastic, "elastic, slip from the first touch", "second order in the step without dashpots: up"
         " to 5e-5; times two"),
    ]  # fmt: skip
    return tuple(
        kit.per_code(
            f"{name}: velocity and R x spin, largest error / impact speed",
            lambda results, code, wanted=wanted: error(results, code, wanted),
            tolerance=tolerance, against=ODE, reason=f"about 300 steps per contact; {reason}",
            catches=catches,
        )
        for wanted, tolerance, name, reason in kinds
        if tolerance is not None
    )  # fmt: skip


def happens(
    name: str, least: float, unit: str, count: Callable[[Run], Mapping[str, float]], labels: Sequence[str],
    catches: str,
) -> kit.PerCode:  # fmt: skip
    """Per code: how much the smallest of some numbers of the runs falls below what it must be at least, so
    that the scene shows what it is made for.
    """

    def measure(results: kit.Results, code: str) -> kit.Measured:
        found = {}
        for label in of_code(results, code, labels):
            found |= {f"{label}, {what}": value for what, value in count(results[label, code]).items()}
        where = min(found, key=lambda what: found[what])
        note = f"smallest of {len(found)}: {where}"
        return kit.Measured(max(least - found[where], 0.0), found[where], least, note)

    return kit.per_code(
        f"{name}: shortfall below {least:g}", measure, tolerance=0.0, unit=unit,
        against="condition of the scene",
        reason="a condition that must hold exactly: without it the other checks of this scene test less than"
            " they state",
        catches=catches,
    )  # fmt: skip
