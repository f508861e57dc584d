"""Checks of tests 1 to 3 of Chung and Ooi: force in time and against overlap, momentum."""

from __future__ import annotations

import numpy as np

from comparisons.cases.chung_ooi.checks import PAPER, distance
from comparisons.cases.chung_ooi.scenes import Test, published
from comparisons.cases.single_contact.meetings import exact, overlap
from comparisons.harness import check_builders as build
from comparisons.harness.case import Measured, PerCode, Results
from gpudem.output.run import Run


def force_history(
    results: Results, run: Run, test: Test, k: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(time since the touch [s], overlap [m], normal force [N]) of impact k."""
    m = test.meetings()[k]
    time = run.trace["time"] - exact(results, run.scene, m).touch
    return time, overlap(run, m), run.trace["force"][:, m.row] @ test.axes(k)[0]


def force_curves(
    test: Test, prefix: str, table: str, published_within: tuple[float, float], reading: str
) -> tuple[PerCode, ...]:
    """Per code: F against Hertz' at its own overlap; F(t), F(overlap) against the paper's points."""

    def hertz(results: Results, code: str) -> dict[str, Measured]:
        run, found = results[results.finest(prefix), code], {}
        for k, b in enumerate(test.balls):
            _, deep, force = force_history(results, run, test, k)
            want = test.bodies(b).normal_constant * np.maximum(deep, 0.0) ** 1.5
            found[b.what] = Measured(float(np.abs(force - want).max() / want.max()))
        return found

    def paper(results: Results, code: str, against: str) -> Measured:
        time, deep, force = force_history(results, results[results.finest(prefix), code], test, 0)
        points = np.array(published()[f"T{test.number}_{table}_force_{against}"]["data"])
        x = 1e6 * (time if against == "time" else deep)
        inside = (deep > 0) & ((against == "time") | (np.arange(len(x)) <= np.argmax(deep)))
        off, count = distance(x[inside], 1e-3 * force[inside], points)
        note = f"{count} points of {len(points)}, {test.balls[0].what}"
        if against != "time":
            k = test.bodies(test.balls[0]).normal_constant
            exact_off = np.abs(1e-3 * k * (1e-6 * points[:, 0]) ** 1.5 - points[:, 1])
            note += f"; Hertz' curve itself: {exact_off.sum() / points[:, 1].sum():.2g}"
        return Measured(off, note=note)

    return (
        build.per_code(
            f"T{test.number}: force against 4/3 E* sqrt(R*) overlap^1.5, largest difference / largest force",
            hertz, tolerance=1e-10, against="closed form",
            reason="no damping: the force is a function of the overlap, known here to 1e-12",
            catches="another modulus or radius, loading and unloading that differ",
        ),
        *(
            build.per_code(
                f"T{test.number}: force against {against}, sum |difference| / sum |published|",
                lambda results, code, against=against: paper(results, code, against),
                tolerance=bound, against=PAPER, mark="P", reason=reading,
                catches="a misread parameter of the benchmark",
            )
            for against, bound in zip(("time", "displacement"), published_within, strict=True)
        ),
    )  # fmt: skip


def momentum(test: Test, prefix: str) -> PerCode:
    """Per code: momentum of each pair, largest at any step, by that of one sphere."""

    def measure(results: Results, code: str) -> dict[str, Measured]:
        velocity, found = results[results.finest(prefix), code].trace["velocity"], {}
        for m, b in zip(test.meetings(), test.balls, strict=True):  # equal masses
            total = np.linalg.norm(velocity[:, m.rows].sum(axis=1), axis=1)
            found[b.what] = Measured(float(total.max() / b.normal))
        return found

    return build.per_code(
        f"T{test.number}: momentum of a pair, largest / that of one sphere", measure,
        tolerance=1e-12, against="invariance",
        reason="action and reaction: equal and opposite to rounding, over 4000 steps",
        catches="a force that acts on one of the two, or twice",
    )  # fmt: skip
