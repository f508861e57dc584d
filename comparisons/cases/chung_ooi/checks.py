"""Checks of the Chung and Ooi tests: final motion against the ODE, refinement, Coulomb's line, the paper's
curves.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from comparisons.cases.chung_ooi.scenes import Ball, Test, published
from comparisons.cases.single_contact.checks import CODES
from comparisons.cases.single_contact.meetings import exact, overlap
from comparisons.harness.case import Check, Measured, Results, Tier
from comparisons.metrics import trace as measure
from comparisons.oracles import closed_forms
from gpudem.output.run import Run

ODE = "ODE (DOP853, rtol 1e-13)"
PAPER = "Chung and Ooi 2011"


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
            n, t, axis = test.axes(k)
            at = truth.at(np.array([truth.end]))
            velocity, spin = at["velocity"][0, 0], at["angular_velocity"][0, 0]
            found.append((velocity @ n, velocity @ t, spin @ axis))
        return np.array(found)

    physics = run.scene.replace(time={"step": 1.0, "duration": 1.0}, output={}, allow=["time_step"]).hash
    return results.once(("outcome", physics), compute)


def final_errors(results: Results, run: Run, test: Test) -> np.ndarray:
    """Per impact: largest of |v_n'|, |v_t'| and R |w'| off the ODE, by the impact speed of the surfaces."""
    scale = np.array([1.0, 1.0, test.radius])
    speed = np.array([np.hypot(b.normal, b.tangential + test.radius * b.spin) for b in test.balls])
    off = np.abs(outcome(run, test) - exact_outcome(results, run, test)) * scale
    return off.max(axis=1) / speed


def against_ode(
    test: Test, prefix: str, tolerance: dict[Tier, float], order: tuple[float, float], why: str
) -> tuple[Check, ...]:
    """Per code: largest final error at the finest step, one check a tier, and what refinement makes of it."""

    def worst(results: Results, code: str) -> Measured:
        found = final_errors(results, results[results.finest(prefix), code], test)
        k = int(np.argmax(found))
        return Measured(
            float(found[k]), note=f"{len(found)} impacts; largest at {test.balls[k].what},"
            f" median {np.median(found):.2g}",
        )  # fmt: skip

    def slope(results: Results, code: str) -> Measured:
        labels = results.labels(prefix=prefix)
        steps = [results[label, code].scene.time.step for label in labels]
        errors = [float(np.mean(final_errors(results, results[label, code], test))) for label in labels]
        return Measured(
            measure.observed_order(steps, errors),
            note=f"mean error {min(errors):.2g} at {min(steps):.3g} s,"
            f" {max(errors):.2g} at {max(steps):.3g} s",
        )

    checks = []
    for code in CODES:
        common: dict[str, Any] = {"unit": "1", "against": ODE, "mark": "A", "needs": (code,)}
        checks += [
            Check(
                name=f"{prefix.rstrip('_')}: velocities and R x spin after impact, largest error / impact"
                f" speed ({code})",
                measure=lambda results, code=code: worst(results, code),
                tolerance=bound, tiers=(tier,) if tier == "quick" else ("standard", "full"),
                reason=f"the scheme's own error at the finest step of this tier; {why}",
                catches="a wrong modulus, inertia, lever arm, dashpot or friction, in both codes alike",
                **common,
            )
            for tier, bound in tolerance.items()
        ]  # fmt: skip
        checks.append(
            Check(
                name=f"{prefix.rstrip('_')}: observed order of the mean error after impact ({code})",
                measure=lambda results, code=code: slope(results, code),
                lo=order[0], tolerance=order[1], reason=why,
                catches="a law that tends to another limit than the one stated (order 0)", **common,
            )
        )  # fmt: skip
    return tuple(checks)


def curve(test: Test, got: np.ndarray, material: str, quantity: str) -> tuple[np.ndarray, np.ndarray]:
    """(abscissa, ordinate) of one of the paper's figures for one material, by rising abscissa.

    got: rows (v_n', v_t', w') of all impacts.

        T4: theta [deg] -> "et" v_t'/v_t, "omega" w' [rad/s], "angle" atan((v_t' + R w')/v_n') [deg]
        T5: v_s/(mu v_n) -> "rebound" v_s'/(mu v_n'), "spin" R w'/(mu v_n')
        T6: 7/2 mu (1 + e) v_n/v_s -> "beta" -v_s'/v_s;  v_s/v_n -> "tan" v_s'/v_n'   (v_s = v_t + R w)
    """
    rows = []
    for b, (vn, vt, w) in zip(test.balls, got, strict=True):
        if b.material == material:
            rows.append(_point(test, b, vn, vt, test.radius * w, quantity))
    x, y = np.array(sorted(rows)).T
    return x, y


def _point(test: Test, b: Ball, vn: float, vt: float, surface: float, quantity: str) -> tuple[float, float]:
    """One impact in one of those figures; surface: R w' [m/s]."""
    mu, angle = test.friction, math.degrees(math.atan2(b.tangential, b.normal))
    slip, left = b.tangential + test.radius * b.spin, vt + surface
    match quantity:
        case "et":
            return angle, vt / b.tangential
        case "omega":
            return angle, surface / test.radius
        case "angle":
            return angle, math.degrees(math.atan2(left, vn))
        case "rebound":
            return slip / (mu * b.normal), left / (mu * vn)
        case "spin":
            return slip / (mu * b.normal), surface / (mu * vn)
        case "beta":
            return 3.5 * mu * (1 + b.stated) * b.normal / slip, -left / slip
        case "tan":
            return slip / b.normal, left / vn
    raise ValueError(f"no quantity {quantity!r}")


def distance(x: np.ndarray, y: np.ndarray, points: np.ndarray) -> tuple[float, int]:
    """(sum |y - points| / sum |points| over the points within the curve's reach, how many): the measure
    of Kratos' gates.
    """
    inside = points[(points[:, 0] >= x[0]) & (points[:, 0] <= x[-1])]
    off = np.abs(PchipInterpolator(x, y)(inside[:, 0]) - inside[:, 1])
    return float(off.sum() / np.abs(inside[:, 1]).sum()), len(inside)


def against_published(
    test: Test, prefix: str, quantity: str, table: str, columns: dict[str, str], tolerance: float,
    reason: str, against: str = PAPER, within: tuple[float, float] = (-np.inf, np.inf), **options: Any,
) -> tuple[Check, ...]:  # fmt: skip
    """Per code: largest distance of the materials' curves from their published columns (material -> column),
    over the abscissae `within`.
    """

    def value(results: Results, code: str) -> Measured:
        got = outcome(results[results.finest(prefix), code], test)
        found = {}
        for material, column in columns.items():
            points = np.array(published()[table][column])
            points = points[(points[:, 0] >= within[0]) & (points[:, 0] <= within[1])]
            off, count = distance(*curve(test, got, material, quantity), points)
            found[f"{material}: {off:.2g} at {count} points"] = off
        return Measured(max(found.values()), note="; ".join(found))

    return tuple(
        Check(
            name=f"{prefix.rstrip('_')}: {quantity}, sum |difference| / sum |published| ({code})",
            measure=lambda results, code=code: value(results, code),
            tolerance=tolerance, unit="1", against=against, mark="P", reason=reason, needs=(code,),
            catches="a law that is consistent with itself and wrong against nature or the literature",
            **options,
        )
        for code in CODES
    )  # fmt: skip


def sliding(results: Results, code: str, test: Test, prefix: str) -> dict[str, tuple[float, float]]:
    """Impact -> velocity lost to friction [m/s] by (the code, Coulomb's line mu (1 + e) v_n), of those whose
    contact slides at twice the limit of the rigid sphere, 7/2 mu (1 + e) v_n, or more.

    e is the restitution that comes out: with `limit_force` it is larger than the one put in.
    """
    run = results[results.finest(prefix), code]
    found = {}
    for b, row in zip(test.balls, outcome(run, test), strict=True):
        e = closed_forms.restitution(test.bodies(b), run.scene.contact.limit_force)
        limit = test.friction * (1 + e) * b.normal
        if b.tangential + test.radius * b.spin >= 2 * 3.5 * limit:
            found[b.what] = (b.tangential - row[1], limit)
    return found


def coulomb(
    test: Test, prefix: str, ratio: tuple[float, float], reason: str, catches: str, **options: Any
) -> tuple[Check, ...]:
    """Per code: velocity lost in gross sliding over mu (1 + e) v_n, the one farthest from 1."""

    def value(results: Results, code: str) -> Measured:
        found = sliding(results, code, test, prefix)
        what = max(found, key=lambda w: abs(found[w][0] / found[w][1] - 1))
        got, want = found[what]
        return Measured(got / want, got, want, note=f"{len(found)} impacts slide; farthest at {what}")

    return tuple(
        Check(
            name=f"{prefix.rstrip('_')}: velocity lost in gross sliding / mu (1 + e) v_n ({code})",
            measure=lambda results, code=code: value(results, code),
            lo=ratio[0], tolerance=ratio[1], unit="1", against="closed form", mark="A", needs=(code,),
            reason=reason, catches=catches, **options,
        )
        for code in CODES
    )  # fmt: skip
