"""Checks of the Chung and Ooi tests: final motion against the ODE, refinement, Coulomb's limit, the paper's
curves.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from comparisons.cases.chung_ooi.scenes import Ball, Test, published
from comparisons.cases.single_contact.meetings import exact, overlap
from comparisons.harness import check_builders as build
from comparisons.harness.case import TIERS, Measured, PerCode, Results, Tier
from comparisons.oracles import closed_forms
from gpudem.output.run import Run

ODE = "ODE (DOP853, rtol 1e-13)"
PAPER = "Chung and Ooi 2011"
BENCH: tuple[Tier, ...] = ("standard", "full")


def outcome(run: Run, test: Test) -> np.ndarray:
    """Per impact (v_n', v_t' [m/s], w' [rad/s]) of the (first) sphere, spin counted so that it adds R w to
    the slip.

    Raises ValueError where a contact has not ended within the run.
    """
    found = []
    for k, m in enumerate(test.meetings()):
        if overlap(run, m)[-1] > 0:
            raise ValueError(f"{m.label}: still in contact at the end of the run")
        n, t, axis = test.axes(k)
        velocity = run.trace["velocity"][-1, m.row]
        found.append((velocity @ n, velocity @ t, run.trace["angular_velocity"][-1, m.row] @ axis))
    return np.array(found)


def exact_outcome(results: Results, run: Run, test: Test) -> np.ndarray:
    """The same by the ODE."""

    def compute() -> np.ndarray:
        found = []
        for k, m in enumerate(test.meetings()):
            truth = exact(results, run.scene, m)
            at = {name: values[0, 0] for name, values in truth.at(np.array([truth.end])).items()}
            n, t, axis = test.axes(k)
            found.append((at["velocity"] @ n, at["velocity"] @ t, at["angular_velocity"] @ axis))
        return np.array(found)

    physics = run.scene.replace(time={"step": 1.0, "duration": 1.0}, output={}, allow=["time_step"]).hash
    return results.once(("outcome", physics), compute)


def final_errors(results: Results, label: str, code: str, test: Test) -> dict[str, Measured]:
    """Impact -> largest error of v_n', v_t' and R w' against the ODE, by the impact speed of the surfaces."""
    run = results[label, code]
    off = np.abs(outcome(run, test) - exact_outcome(results, run, test)) * [1.0, 1.0, test.radius]
    speeds = [float(np.hypot(b.normal, b.tangential + test.radius * b.spin)) for b in test.balls]
    rows = zip(test.balls, off, speeds, strict=True)
    return {b.what: Measured(float(o.max()) / speed) for b, o, speed in rows}


def against_ode(
    test: Test,
    prefix: str,
    tolerance: dict[Tier, float],
    order: tuple[float, float],
    why: str,
    tiers: tuple[Tier, ...] = TIERS,
) -> tuple[PerCode, ...]:
    """Per code: largest final error at the finest step, one check a tier, and its order in the step."""
    name = prefix.rstrip("_")

    def mean(results: Results, label: str, code: str) -> float:
        return float(np.mean([m.value for m in final_errors(results, label, code, test).values()]))

    return (
        *(
            build.per_code(
                f"{name}: velocities and R x spin after impact, largest error / impact speed",
                lambda results, code: final_errors(results, results.finest(prefix), code, test),
                tolerance=bound, against=ODE, tiers=(tier,) if tier == "quick" else BENCH,
                reason=f"the scheme's own error at the finest step of this tier; {why}",
                catches="a wrong modulus, inertia, arm, dashpot or friction, even where the codes agree",
            )
            for tier, bound in tolerance.items()
        ),
        build.observed_order(
            f"{name}: observed order of the mean error after impact", mean, order, prefix=prefix,
            against=ODE, tiers=tiers, reason=why,
            catches="a law that tends to another limit than the one stated (order 0)",
        ),
    )  # fmt: skip


def curve(test: Test, got: np.ndarray, material: str, quantity: str) -> tuple[np.ndarray, np.ndarray]:
    """(abscissa, ordinate) of one of the paper's figures for one material, by rising abscissa.

    got: rows (v_n', v_t', w') of all impacts.

        T4: theta [deg] -> "et" v_t'/v_t, "omega" w' [rad/s], "angle" atan((v_t' + R w')/v_n') [deg]
        T5: v_s/(mu v_n) -> "rebound" v_s'/(mu v_n'), "spin" R w'/(mu v_n')
        T6: 7/2 mu (1 + e) v_n/v_s -> "beta" -v_s'/v_s;  v_s/v_n -> "tan" v_s'/v_n'   (v_s = v_t + R w)
    """
    rows = [
        _point(test, b, row, quantity)
        for b, row in zip(test.balls, got, strict=True)
        if b.material == material
    ]
    x, y = np.array(sorted(rows)).T
    return x, y


def _point(test: Test, b: Ball, row: np.ndarray, quantity: str) -> tuple[float, float]:
    """One impact in one of those figures."""
    vn, vt, w = map(float, row)
    mu, angle = test.friction, math.degrees(math.atan2(b.tangential, b.normal))
    slip, left = b.tangential + test.radius * b.spin, vt + test.radius * w
    match quantity:
        case "et":
            return angle, vt / b.tangential
        case "omega":
            return angle, w
        case "angle":
            return angle, math.degrees(math.atan2(left, vn))
        case "rebound":
            return slip / (mu * b.normal), left / (mu * vn)
        case "spin":
            return slip / (mu * b.normal), test.radius * w / (mu * vn)
        case "beta":
            return 3.5 * mu * (1 + b.stated) * b.normal / slip, -left / slip
        case "tan":
            return slip / b.normal, left / vn
    raise ValueError(f"no quantity {quantity!r}")


def distance(x: np.ndarray, y: np.ndarray, points: np.ndarray) -> tuple[float, int]:
    """(sum |y - points| / sum |points| over the points within the curve's reach, how many): the measure
    of Kratos' tests.
    """
    inside = points[(points[:, 0] >= x[0]) & (points[:, 0] <= x[-1])]
    off = np.abs(PchipInterpolator(x, y)(inside[:, 0]) - inside[:, 1])
    return float(off.sum() / np.abs(inside[:, 1]).sum()), len(inside)


def against_published(
    test: Test, prefix: str, quantity: str, table: str, columns: dict[str, str], tolerance: float,
    reason: str, against: str = PAPER, within: tuple[float, float] = (-np.inf, np.inf), **fields: Any,
) -> PerCode:  # fmt: skip
    """Per code: largest distance of the materials' curves from their published columns (material -> column),
    over the abscissae `within`.
    """

    def measure(results: Results, code: str) -> dict[str, Measured]:
        got, found = outcome(results[results.finest(prefix), code], test), {}
        for material, column in columns.items():
            points = np.array(published()[table][column])
            points = points[(points[:, 0] >= within[0]) & (points[:, 0] <= within[1])]
            off, count = distance(*curve(test, got, material, quantity), points)
            found[material] = Measured(off, note=f"{count} points")
        return found

    return build.per_code(
        f"{prefix.rstrip('_')}: {quantity}, sum |difference| / sum |published|", measure,
        tolerance=tolerance, against=against, mark="P", reason=reason,
        catches="a law that is consistent in itself but differs from the experiment or the literature",
        **fields,
    )  # fmt: skip


def coulomb(
    test: Test, prefix: str, ratio: tuple[float, float], reason: str, catches: str, **fields: Any
) -> PerCode:
    """Per code: velocity lost in gross sliding over mu (1 + e) v_n, the one farthest from 1, of the impacts
    whose slip is at least twice the limit of the rigid sphere, 7/2 mu (1 + e) v_n.

    e is the restitution that comes out: with `limit_force` it is larger than the one put in.
    """

    def measure(results: Results, code: str) -> Measured:
        run = results[results.finest(prefix), code]
        found = []
        for b, row in zip(test.balls, outcome(run, test), strict=True):
            e = closed_forms.restitution(test.bodies(b), run.scene.contact.limit_force)
            limit = test.friction * (1 + e) * b.normal
            if b.tangential + test.radius * b.spin >= 2 * 3.5 * limit:
                found.append((b.tangential - row[1], limit, b.what))
        lost, limit, what = max(found, key=lambda row: abs(row[0] / row[1] - 1))
        return Measured(lost / limit, lost, limit, f"{len(found)} impacts slide; farthest at {what}")

    return build.per_code(
        f"{prefix.rstrip('_')}: velocity lost in gross sliding / mu (1 + e) v_n", measure,
        lo=ratio[0], tolerance=ratio[1], against="closed form", reason=reason, catches=catches, **fields,
    )  # fmt: skip
