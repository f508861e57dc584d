"""Restitution over a grid of restitution put in and speed, for three normal laws, with and without
`limit_force`.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from comparisons.cases.single_contact import restitution_scenes as grid
from comparisons.cases.single_contact.checks import step_by_step
from comparisons.harness import check_builders as build
from comparisons.harness.case import TIERS, Case, Figure, PerCode, PerPair, Results, Tier, Variant
from comparisons.oracles import closed_forms, normal_impact
from comparisons.report import plots

#: Steps of the flight, and a half: a tenth of the shortest contact.
RUNGS: dict[Tier, tuple[int, ...]] = {
    "quick": (50, 25, 12),
    "standard": (150, 50, 16),
    "full": (400, 150, 50),
}
BENCH: tuple[Tier, ...] = ("standard", "full")
QUICK: tuple[Tier, ...] = ("quick",)


def variants(tier: Tier) -> list[Variant]:
    return [
        Variant(f"{grid.label(law, limit)}{n}", grid.scene(law, limit, n))
        for law in (grid.LAWS[:1] if tier == "quick" else grid.LAWS)
        for limit in (False, True)
        for n in RUNGS[tier]
    ]


def _checks(law: grid.Law, limit: bool) -> Iterator[PerCode | PerPair]:
    against = "ODE (DOP853, rtol 1e-12)" if law == "hertz/stiffness" else "closed form"
    name = f"{law}, limit_force {'on' if limit else 'off'}"
    tiers = TIERS if law == "hertz" else BENCH
    yield from step_by_step(grid.MEETINGS, spin=False, prefix=grid.label(law, limit), tiers=tiers)
    for some in (QUICK, BENCH) if law == "hertz" else (BENCH,):
        yield build.per_code(
            f"{name}: restitution, largest |out - expected|",
            lambda results, code: grid.error(results, code, law, limit),
            tolerance=2e-3 if some == QUICK else 1e-3, against=against, tiers=some,
            reason="the dashpot sees half-step velocities: first order, largest at the smallest e;"
            " Chrono and Kratos allow 1e-3",
            catches="a restitution that depends on speed where it must not, or not where it must",
        )  # fmt: skip
    yield build.observed_order(
        f"{name}: observed order of the mean error",
        lambda results, label, code: grid.mean_error(results, label, code, law, limit),
        (0.85, 1.3), prefix=grid.label(law, limit), against=against, tiers=tiers,
        reason="first order: the dashpot sees half-step velocities",
        catches="a law that tends to another restitution than the one stated",
    )  # fmt: skip


VISCOELASTIC = (
    build.per_code(
        "hertz/stiffness, limit_force on: largest |out - Pade (Mueller and Poeschel)|",
        lambda results, code: grid.against_pade(results, code, 0.4),
        tolerance=1e-3, against="Mueller and Poeschel 2011", mark="P", tiers=BENCH,
        reason="the Pade form is good to 2e-4 up to v* = 0.4; the rest is the time step",
        catches="a damping that is not that of the viscoelastic sphere",
    ),
    build.per_code(
        "hertz/stiffness, limit_force on: slope of log(1 - e) in log(speed)", grid.exponent,
        lo=0.197, tolerance=0.201, against="closed form", tiers=BENCH,
        reason="1/5 - 0.14 v*^2 with v* = 0.05: 0.1997, and the time step",
        catches="damping as overlap^(1/4) (slope 0) or constant (slope -1/5)",
    ),
)  # fmt: skip


def _constant(results: Results) -> plots.Figure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.8)
    fine = np.linspace(0.051, 1, 200)
    sizes = {"hertz": 5, "hooke": 9}
    for limit, color in ((False, plots.SERIES[0]), (True, plots.SERIES[2])):
        exact = [closed_forms.restitution(grid.bodies(e), limit) for e in fine]
        left.plot(fine, exact, color=color, lw=0.9, label="limit_force" if limit else "default")
        laws = [law for law in sizes if results.labels(prefix=grid.label(law, limit))]
        for law, variant in [(law, results.finest(grid.label(law, limit))) for law in laws]:
            for code in results.codes(variant):
                got = grid.rebounds(results, variant, code)
                look = plots.marks(code, color=color, markersize=sizes[law])
                left.plot(grid.RESTITUTIONS, got[:, [0, -1]], **look)
                off = np.abs(got - grid.expected(results, law, limit)).max(axis=1)
                right.semilogy(
                    grid.RESTITUTIONS, np.maximum(off, 1e-16), **{**look, "linestyle": "-"}, lw=0.7
                )
    right.axhline(1e-3, **plots.TOLERANCE)
    left.set(xlabel="restitution in", ylabel="restitution out, at 0.01 and 10 m/s")
    right.set(xlabel="restitution in", ylabel="largest |difference| over all speeds")
    plots.legend(left, points=results.codes())
    return figure


def _speed(results: Results) -> plots.Figure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.8)
    variant = results.finest(grid.label("hertz/stiffness", True))
    exact, v = grid.expected(results, "hertz/stiffness", True), grid.v_stars()
    line = np.linspace(0.02, 2.6, 200)
    pade = [normal_impact.pade(x) for x in line]
    left.plot(line, pade, "--", color="#777777", lw=1, label="Pade, Mueller and Poeschel")
    rank = np.argsort(v.ravel())
    left.plot(v.ravel()[rank], exact.ravel()[rank], **plots.style("oracle"))
    shown = range(0, len(grid.V_STARS), 2)
    for code in results.codes(variant):
        got, look = grid.rebounds(results, variant, code), plots.marks(code, color=plots.color(code))
        left.plot(v.ravel(), got.ravel(), **look, label=plots.name(code))
        right.loglog(grid.SPEEDS, 1 - got[shown].T, **look)
    right.loglog(grid.SPEEDS, 1 - exact[shown].T, **plots.style("oracle"))
    for k in shown:
        place = (10, 1 - exact[k, -1])
        right.annotate(f"v* = {grid.V_STARS[k]:g}", place, fontsize=7.5, va="bottom", ha="right")
    left.set(xlabel="v*", ylabel="restitution out")
    right.set(xlabel="speed [m/s]", ylabel="1 - e")
    plots.legend(left)
    return figure


CASE = Case(
    name="restitution_map",
    title="Restitution over speed and damping",
    purpose=(
        "77 spheres hit a plane: restitution 0.06 to 1, speed 0.01 to 10 m/s, under each normal law, with and"
        " without limit_force. hertz and hooke must return exactly the restitution put in, at every speed;"
        " with limit_force a larger one, the same function for both laws, never below exp(-2). The damping of"
        " hertz/stiffness is that of viscoelastic spheres, for which restitution decreases with speed: 1 - e"
        " grows as v^(1/5), and all speeds and dampings are on one curve in v*. If that contact may pull"
        " (limit_force off) and v* exceeds about 2, it is overdamped and the sphere sticks to the plane."
    ),
    source=(
        "Antypov and Elliott (2011); Schwager and Poeschel (2007); Mueller and Poeschel (2011) for the"
        " viscoelastic law; ODE: DOP853."
    ),
    variants=variants,
    checks=(
        *(check for law in grid.LAWS for limit in (False, True) for check in _checks(law, limit)),
        *VISCOELASTIC,
    ),
    figures=(
        Figure(
            "Restitution out against restitution in",
            "Left: the slowest and the fastest sphere on the closed forms (lines); small marks hertz, large"
            " marks hooke. Right: largest difference over all speeds; it decreases with the time step.",
            _constant,
        ),
        Figure(
            "The viscoelastic law",
            "hertz/stiffness with limit_force. Left: all dampings and speeds on one curve. Right: the slope"
            " is 1/5 where the loss is small.",
            _speed, tiers=BENCH,
        ),
    ),
    features=(
        "normal hertz", "normal hertz/stiffness", "normal hooke", "damping", "limit_force",
        "several materials", "wall plane",
    ),
    order=24,
)  # fmt: skip
