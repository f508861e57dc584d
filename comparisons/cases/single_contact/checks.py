"""Checks that the cases of few particles share: between the codes, against the ODE and closed forms."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from comparisons import kit
from comparisons.cases.single_contact.meetings import Meeting, errors, exact, overlap, relative_velocity
from comparisons.metrics import trace
from comparisons.oracles import closed_forms
from gpudem.output.run import Run

ODE = "ODE (DOP853, rtol 1e-13)"
FIRST_ORDER = "the dashpot uses half-step velocities, so the error is first order: about 0.5/steps at e = 0.3"
SECOND_ORDER = "velocity Verlet without damping is second order: about 1/steps^2"
QUANTITIES = {
    "peak overlap [m]": "a wrong E*, R* or effective mass: 1 % of any shifts it by 0.2 to 0.4 %",
    "contact time [s]": "a contact that ends early or late; the approximate constant 2.94, 2.6 % too large",
    "rebound [1]": "a damping constant that is wrong or depends on speed; limit_force applied where it is"
    " off, or the reverse",
}
#: Column -> (scale in the name of the check, defect that it detects).
STEP_BY_STEP = {
    "position": ("diameter", "another order of the Verlet step"),
    "velocity": ("impact speed", "full-step velocities in the dashpot"),
    "angular_velocity": (
        "(impact speed / radius)",
        "a lever arm of R instead of R - overlap/2; a spring that is not rotated with the normal",
    ),
    "force": ("largest force", "a force of the wrong half step"),
}


def columns_agree(
    columns: Mapping[str, tuple[str, str]],
    scale: Callable[[Run, str], np.ndarray | float],
    read: Mapping[str, Callable[[Run], np.ndarray]] | None = None,
    where: str = "",
    **fields: Any,
) -> tuple[kit.PerPair, ...]:
    """Two codes at every step of every variant, to rounding; `columns` as `STEP_BY_STEP`, scale(run, column)
    of what its first text names. `fields` go to `kit.step_by_step`.
    """
    return tuple(
        kit.step_by_step(
            f"{where}{column.replace('_', ' ')}, largest difference over all steps / {unit}", column,
            lambda run, column=column: scale(run, column), read=(read or {}).get(column),
            tolerance=1e-9 if column == "force" else 1e-11,
            reason="same law, same scheme, same start: only the order of additions differs, that is rounding;"
            " measured values are a hundredth of the tolerance",
            catches=catches, **fields,
        )
        for column, (unit, catches) in columns.items()
    )  # fmt: skip


def step_by_step(
    meetings: list[Meeting], spin: bool, prefix: str = "", **fields: Any
) -> tuple[kit.PerPair, ...]:
    """Two codes at every step of every variant of a prefix, to rounding; fails if a meeting has no contact.

    Scales: position by the diameter of each particle, velocity by the lowest approach speed in the scene,
    spin by that speed over the radius, force by the largest force on the particle.
    """

    def scale(run: Run, column: str) -> np.ndarray:
        radius = run.scene.state.radius
        if column == "position":
            return 2 * radius
        if column == "force":
            return np.linalg.norm(run.trace["force"], axis=-1).max(axis=0)
        speed = min(np.linalg.norm(relative_velocity(run, m)[0]) for m in meetings)
        return speed / (radius if column == "angular_velocity" else np.ones(len(radius)))

    def no_contact(run: Run) -> str:
        apart = (m.label for m in meetings if overlap(run, m).max() <= 0)
        return next((f"{label} has no contact" for label in apart), "")

    return columns_agree(
        {k: texts for k, texts in STEP_BY_STEP.items() if spin or k != "angular_velocity"}, scale,
        where=f"{prefix.rstrip('_')}: " if prefix else "", prefix=prefix, defect=no_contact,
        note=f"{len(meetings)} impacts", **fields,
    )  # fmt: skip


def against_ode(
    what: str, meetings: list[Meeting], tolerance: float, order: tuple[float, float], prefix: str, why: str
) -> tuple[kit.PerCode, kit.PerCode]:
    """For each code: largest velocity error of the finest run, and the observed order in the time step."""

    def error(results: kit.Results, label: str, code: str) -> float:
        columns = ("velocity", "angular_velocity")
        return max(errors(results, results[label, code], m)[k] for m in meetings for k in columns)

    return (
        kit.per_code(
            f"{what}: velocity and R x spin, largest error / impact speed",
            lambda results, code: error(results, results.finest(prefix), code),
            tolerance=tolerance, against=ODE,
            reason=f"error of the scheme at the finest step, times two; {why}",
            catches="a wrong modulus, mass, damping constant or friction law, even where the codes agree",
        ),
        kit.observed_order(
            f"{what}: observed order in the time step", error, order, prefix=prefix, against=ODE, reason=why,
            catches="a law that tends to another limit (order 0), a force that lags by a step (order 1)",
        ),
    )  # fmt: skip


def normal_impacts(meetings: list[Meeting], prefix: str = "") -> kit.Observe:
    """`QUANTITIES` of impacts along the normal in the finest run, each beside its closed form."""

    def observe(results: kit.Results, code: str) -> dict[str, dict[str, tuple[float, float]]]:
        run, found = results[results.finest(prefix), code], {key: {} for key in QUANTITIES}
        for m in meetings:
            truth, time, deep = exact(results, run.scene, m), run.trace["time"], overlap(run, m)
            begin, end = trace.contact_interval(time, deep)
            rebound = trace.rebound(relative_velocity(run, m), truth.frame[0])
            c, speed, limit = truth.bodies, truth.speed, run.scene.contact.limit_force
            pairs = (
                (trace.peak(time, deep)[1], closed_forms.peak_overlap(c, speed)),
                (end - begin, closed_forms.contact_time(c, speed, limit)),
                (rebound, closed_forms.restitution(c, limit)),
            )
            for key, pair in zip(QUANTITIES, pairs, strict=True):
                found[key][m.label] = pair
        return found

    return observe


def against_closed_forms(
    what: str, meetings: list[Meeting], tolerance: float, prefix: str, why: str,
    catches: Mapping[str, str] = QUANTITIES,
) -> tuple[kit.PerCode, ...]:  # fmt: skip
    """Per code, largest relative error of each of the quantities of `catches`."""
    return kit.per_quantity(
        normal_impacts(meetings, prefix), catches, f"{what}: {{}}, relative error", tolerance=tolerance,
        against="closed form", reason=why,
    )  # fmt: skip
