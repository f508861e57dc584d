"""Checks of the Chung and Ooi tests: final motion against the ODE, refinement, Coulomb's limit, the paper's
curves.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from comparisons import kit
from comparisons.cases.chung_ooi.scenes import Test, published
from comparisons.cases.single_contact.checks import ODE
from comparisons.oracles import closed_forms

PAPER = "Chung and Ooi 2011"
FIRST_ORDER = (
    "dashpots use half-step velocities, and sticking and slip begin at whole steps: about first order,"
    " scattered with their phase within a step"
)


def final_errors(results: kit.Results, label: str, code: str, test: Test) -> dict[str, kit.Measured]:
    """Impact -> largest error of v_n', v_t' and R w' against the ODE, by the impact speed of the surfaces."""
    run = results[label, code]
    off = np.abs(test.outcome(run) - test.exact_outcome(results, run)) * [1.0, 1.0, test.radius]
    speeds = [float(np.hypot(b.normal, b.tangential + test.radius * b.spin)) for b in test.balls]
    rows = zip(test.balls, off, speeds, strict=True)
    return {b.what: kit.Measured(float(o.max()) / speed) for b, o, speed in rows}


def against_ode(
    test: Test, prefix: str, tolerance: Mapping[kit.Tier, float], order: tuple[float, float], why: str
) -> tuple[kit.PerCode, kit.PerCode]:
    """Per code: largest final error at the finest step, in the tiers of `tolerance`, and its order in the
    step.
    """
    name = prefix.rstrip("_")

    def mean(results: kit.Results, label: str, code: str) -> float:
        return float(np.mean([m.value for m in final_errors(results, label, code, test).values()]))

    return (
        kit.per_code(
            f"{name}: velocities and R x spin after impact, largest error / impact speed",
            lambda results, code: final_errors(results, results.finest(prefix), code, test),
            tolerance=tolerance, against=ODE,
            reason=f"the scheme's own error at the finest step of this tier; {why}",
            catches="a wrong modulus, inertia, arm, dashpot or friction, even where the codes agree",
        ),
        kit.observed_order(
            f"{name}: observed order of the mean error after impact", mean, order, prefix=prefix,
            against=ODE, tiers=tuple(tolerance), reason=why,
            catches="a law that tends to another limit than the one stated (order 0)",
        ),
    )  # fmt: skip


def curve(test: Test, got: np.ndarray, material: str, quantity: str) -> tuple[np.ndarray, np.ndarray]:
    """(abscissa, ordinate) of one of the paper's figures for one material, by rising abscissa.

    got: rows (v_n', v_t', w') of all impacts; the slip is v_s = v_t + R w.
    """
    own = [b.material == material for b in test.balls]
    before = [(b.normal, b.tangential, b.spin, 1 + b.stated) for b in test.balls]
    (vn, vt, w, factor), (vn_after, vt_after, w_after) = np.array(before)[own].T, got[own].T
    mu, angle = test.friction, np.degrees(np.arctan2(vt, vn))
    slip, slip_after = vt + test.radius * w, vt_after + test.radius * w_after
    with np.errstate(divide="ignore", invalid="ignore"):  # in tests 6 and 7 v_t = 0
        x, y = {
            "et": (angle, vt_after / vt),
            "omega": (angle, w_after),
            "angle": (angle, np.degrees(np.arctan2(slip_after, vn_after))),
            "rebound": (slip / (mu * vn), slip_after / (mu * vn_after)),
            "spin": (slip / (mu * vn), test.radius * w_after / (mu * vn_after)),
            "beta": (3.5 * mu * factor * vn / slip, -slip_after / slip),
            "tan": (slip / vn, slip_after / vn_after),
        }[quantity]
    order = np.argsort(x)
    return x[order], y[order]


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
) -> kit.PerCode:  # fmt: skip
    """Per code: largest distance of the materials' curves from their published columns (material -> column),
    over the abscissae `within`.
    """

    def measure(results: kit.Results, code: str) -> dict[str, kit.Measured]:
        got, found = test.outcome(results[results.finest(prefix), code]), {}
        for material, column in columns.items():
            points = np.array(published()[table][column])
            points = points[(points[:, 0] >= within[0]) & (points[:, 0] <= within[1])]
            off, count = distance(*curve(test, got, material, quantity), points)
            found[material] = kit.Measured(off, note=f"{count} points")
        return found

    return kit.per_code(
        f"{prefix.rstrip('_')}: {quantity}, sum |difference| / sum |published|", measure,
        tolerance=tolerance, against=against, mark="P", reason=reason,
        catches="a law that is consistent in itself but differs from the experiment or the literature",
        **fields,
    )  # fmt: skip


def coulomb(
    test: Test, prefix: str, ratio: tuple[float, float], reason: str,
    catches: str = "friction not limited to mu F_n", **fields: Any,
) -> kit.PerCode:  # fmt: skip
    """Per code: velocity lost in gross sliding over mu (1 + e) v_n, the one farthest from 1, of the impacts
    whose slip is at least twice the limit of the rigid sphere, 7/2 mu (1 + e) v_n.

    e is the restitution that comes out: with `limit_force` it is larger than the one put in.
    """

    def measure(results: kit.Results, code: str) -> kit.Measured:
        run, found = results[results.finest(prefix), code], []
        for b, row in zip(test.balls, test.outcome(run), strict=True):
            e = closed_forms.restitution(test.bodies(b), run.scene.contact.limit_force)
            limit = test.friction * (1 + e) * b.normal
            if b.tangential + test.radius * b.spin >= 2 * 3.5 * limit:
                found.append((b.tangential - row[1], limit, b.what))
        lost, limit, what = max(found, key=lambda row: abs(row[0] / row[1] - 1))
        return kit.Measured(
            lost / limit, lost, limit, f"{len(found)} impacts slide; largest deviation at {what}"
        )

    return kit.per_code(
        f"{prefix.rstrip('_')}: velocity lost in gross sliding / mu (1 + e) v_n", measure,
        lo=ratio[0], tolerance=ratio[1], against="closed form", reason=reason, catches=catches, **fields,
    )  # fmt: skip
