"""Checks that the cases of few particles share: between the codes, against the ODE and closed forms."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from comparisons.cases.single_contact.meetings import (
    Meeting,
    errors,
    exact,
    observables,
    overlap,
    relative_velocity,
)
from comparisons.harness.case import Check, Measured, Results
from comparisons.metrics import trace as measure
from comparisons.oracles import closed_forms
from gpudem.output.run import Run

CODES = ("gpudem", "liggghts")
ODE = "ODE (DOP853, rtol 1e-13)"
#: Column -> (name of the check, what it would catch).
STEP_BY_STEP = {
    "position": (
        "position, largest difference over all steps / diameter",
        "another order of the Verlet step",
    ),
    "velocity": (
        "velocity, largest difference over all steps / impact speed",
        "full-step velocities in the dashpot",
    ),
    "angular_velocity": (
        "angular velocity, largest difference over all steps / (impact speed / radius)",
        "a lever arm of R instead of R - overlap/2; a spring that does not turn with the normal",
    ),
    "force": ("force, largest difference over all steps / largest force", "a force of the wrong half step"),
}


def finest(results: Results, prefix: str = "") -> str:
    """Label of the variant with the smallest time step among those starting with `prefix`."""
    return min(ladder(results, prefix), key=lambda label: step_of(results, label))


def ladder(results: Results, prefix: str = "") -> list[str]:
    """Labels starting with `prefix`."""
    return [label for label in results.labels() if label.startswith(prefix)]


def step_of(results: Results, label: str) -> float:
    """Time step [s] of a variant."""
    return next(run for (lab, _), run in results.runs.items() if lab == label).scene.time.step


def step_by_step(meetings: list[Meeting], spin: bool, prefix: str = "", **options: Any) -> tuple[Check, ...]:
    """Both codes at every step of every variant of a prefix, to rounding; NaN (a failure) if any meeting
    fails to touch. `options` go to the checks.

    Scales: position by the diameter of each particle, velocity by the lowest approach speed in the scene,
    spin by that speed over the radius, force by the largest force on the particle.
    """

    def scale(run: Run, column: str) -> np.ndarray:
        radius = run.scene.state.radius
        speed = min(np.linalg.norm(relative_velocity(run, m)[0]) for m in meetings)
        if column == "force":
            return np.linalg.norm(run.trace["force"], axis=-1).max(axis=0)
        return {"position": 2 * radius, "velocity": np.full(len(radius), speed)}.get(column, speed / radius)

    def compare(column: str) -> Callable[[Results], Measured]:
        def value(results: Results) -> Measured:
            found = {}
            for label in ladder(results, prefix):
                ours, theirs = results[label, "gpudem"], results[label, "liggghts"]
                untouched = [
                    m.label for m in meetings for run in (ours, theirs) if overlap(run, m).max() <= 0
                ]
                if untouched:
                    return Measured(float("nan"), note=f"{label}: {untouched[0]} never touched")
                a, b = ours.trace[column], theirs.trace[column]
                found[label] = measure.largest_difference(a, b, scale(theirs, column))
            worst = max(found, key=lambda label: np.nan_to_num(found[label], nan=np.inf))
            return Measured(
                found[worst], note=f"{len(meetings)} impacts, {len(found)} variants; largest in {worst}"
            )

        return value

    reason = (
        "same law, same scheme, same start: only the order of additions differs, so rounding is all that is"
        " left; 1e-9 is asked, a hundredth of it held"
    )
    return tuple(
        Check(
            name=f"{prefix.rstrip('_')}: {name}" if prefix else name,
            measure=compare(column),
            tolerance=1e-9 if column == "force" else 1e-11,
            unit="1",
            against="LIGGGHTS",
            mark="X",
            reason=reason,
            catches=catches,
            needs=CODES,
            **options,
        )
        for column, (name, catches) in STEP_BY_STEP.items()
        if spin or column != "angular_velocity"
    )


def against_ode(
    what: str,
    meetings: list[Meeting],
    tolerance: float,
    order: tuple[float, float],
    prefix: str = "",
    why: str = "",
) -> tuple[Check, ...]:
    """For each code: largest velocity error of the finest run, and the observed order over the ladder."""

    def worst(results: Results, label: str, code: str) -> float:
        columns = ("velocity", "angular_velocity")
        return max(errors(results, results[label, code], m)[k] for m in meetings for k in columns)

    def order_of(results: Results, code: str) -> Measured:
        labels = ladder(results, prefix)
        steps = [step_of(results, label) for label in labels]
        slope = measure.observed_order(steps, [worst(results, label, code) for label in labels])
        return Measured(slope, note=f"{len(labels)} steps from {min(steps):.3g} to {max(steps):.3g} s")

    checks = []
    for code in CODES:
        checks += [
            Check(
                name=f"{what}: velocity and R x spin, largest error / impact speed ({code})",
                measure=lambda results, code=code: worst(results, finest(results, prefix), code),
                tolerance=tolerance, unit="1", against=ODE, mark="A", needs=(code,),
                reason=f"the scheme's own error at the finest step, with a factor of two in hand; {why}",
                catches="a wrong modulus, mass, damping constant or friction law, in both codes alike",
            ),
            Check(
                name=f"{what}: observed order in the time step ({code})",
                measure=lambda results, code=code: order_of(results, code),
                lo=order[0], tolerance=order[1], unit="1", against=ODE, mark="A", needs=(code,), reason=why,
                catches="a law that tends to another limit (order 0), a lagging force (order 1 instead of 2)",
            ),
        ]  # fmt: skip
    return tuple(checks)


def against_closed_forms(
    what: str,
    meetings: list[Meeting],
    tolerances: dict[str, float],
    limit_force: bool = False,
    prefix: str = "",
    why: str = "",
) -> tuple[Check, ...]:
    """Per code, largest relative error of each in `tolerances`: peak_overlap, contact_time, rebound."""
    catches = {
        "peak_overlap": "a wrong E*, R* or effective mass: 1 % of any shifts it by 0.2 to 0.4 %",
        "contact_time": "a contact cut early, or held; the folklore constant 2.94, which is 2.6 % off",
        "rebound": "a damping constant that is wrong or depends on speed; limit_force mixed up",
    }

    def expected(results: Results, run: Run, m: Meeting, quantity: str) -> float:
        truth = exact(results, run.scene, m)
        if quantity == "rebound":
            return closed_forms.restitution(truth.bodies, limit_force)
        if quantity == "contact_time":
            return closed_forms.contact_time(truth.bodies, truth.speed, limit_force)
        return closed_forms.peak_overlap(truth.bodies, truth.speed)

    def value(results: Results, code: str, quantity: str) -> Measured:
        run = results[finest(results, prefix), code]
        rows = [
            (observables(results, run, m)[quantity], expected(results, run, m, quantity), m.label)
            for m in meetings
        ]
        got, want, label = max(rows, key=lambda row: abs(row[0] / row[1] - 1))
        return Measured(abs(got / want - 1), got, want, note=f"largest at {label}")

    return tuple(
        Check(
            name=f"{what}: {quantity.replace('_', ' ')}, relative error ({code})",
            measure=lambda results, code=code, quantity=quantity: value(results, code, quantity),
            tolerance=tolerance,
            unit="1",
            against="closed form",
            mark="A",
            needs=(code,),
            reason=why,
            catches=catches[quantity],
        )
        for code in CODES
        for quantity, tolerance in tolerances.items()
    )
