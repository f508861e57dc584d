"""Restitution over a grid of restitution put in and speed, for three normal laws, with and without
`limit_force`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from comparisons.cases.single_contact import restitution_scenes as grid
from comparisons.cases.single_contact.checks import step_by_step
from comparisons.harness import check_builders as build
from comparisons.harness.case import TIERS, Case, Figure, PerCode, PerPair, Results, Tier, Variant
from comparisons.oracles import closed_forms, normal_impact
from comparisons.report import plots

if TYPE_CHECKING:
    from matplotlib.figure import Figure as MatplotlibFigure

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


def _constant(results: Results) -> MatplotlibFigure:
    figure, axes = plots.figure(1, 2, width=plots.WHOLE, height=3.8)
    fine = np.linspace(0.051, 1, 200)
    for limit, color in ((False, plots.SERIES[0]), (True, plots.SERIES[2])):
        exact = [closed_forms.restitution(grid.bodies(e), limit) for e in fine]
        text = "limit_force" if limit else "default"
        axes[0].plot(fine, exact, color=plots.INK, lw=0.9)
        for law, mark in (("hertz", "x"), ("hooke", "+")):
            prefix = grid.label(law, limit)
            if not results.labels(prefix=prefix):
                continue
            name = results.finest(prefix)
            for code in results.codes(name):
                got = grid.rebounds(results[name, code])
                style = {"marker": "o", "mfc": "none", "ms": 8} if code != "gpudem" else {"marker": mark}
                who = plots.name(code)
                for j in (0, -1):
                    axes[0].plot(
                        grid.RESTITUTIONS, got[:, j], color=color, ls="none", label=f"{who} {law}, {text}",
                        **style,
                    )  # fmt: skip
                off = np.abs(got - grid.expected(results, law, limit)).max(axis=1)
                axes[1].semilogy(
                    grid.RESTITUTIONS, np.maximum(off, 1e-16), color=color, ls="-", lw=0.7, **style
                )
    axes[1].axhline(1e-3, **plots.TOLERANCE)
    axes[0].set(xlabel="restitution in", ylabel="restitution out, at 0.01 and 10 m/s")
    axes[1].set(xlabel="restitution in", ylabel="largest |difference| over all speeds")
    plots.legend(axes[0], fontsize=7.5)
    return figure


def _speed(results: Results) -> MatplotlibFigure:
    figure, axes = plots.figure(1, 2, width=plots.WHOLE, height=3.8)
    name = results.finest(grid.label("hertz/stiffness", True))
    exact, v = grid.expected(results, "hertz/stiffness", True), grid.v_stars()
    line = np.linspace(0.02, 2.6, 200)
    axes[0].plot(
        line,
        [normal_impact.pade(x) for x in line],
        "--",
        color="#777777",
        lw=1,
        label="Pade, Mueller and Poeschel",
    )
    rank = np.argsort(v.ravel())
    axes[0].plot(v.ravel()[rank], exact.ravel()[rank], **plots.style("oracle"))
    for code in results.codes(name):
        got = grid.rebounds(results[name, code])
        mark = {"marker": "x", "linestyle": "none", "markersize": 4} if code == "gpudem" else {}
        axes[0].plot(v.ravel(), got.ravel(), **plots.style(code, **mark))
        for k in range(0, len(grid.V_STARS), 2):
            axes[1].loglog(grid.SPEEDS, 1 - got[k], **plots.style(code, **mark))
    for k in range(0, len(grid.V_STARS), 2):
        axes[1].loglog(grid.SPEEDS, 1 - exact[k], **plots.style("oracle"))
        axes[1].annotate(
            f"v* = {grid.V_STARS[k]:g}", (10, 1 - exact[k, -1]), fontsize=7.5, va="bottom", ha="right"
        )
    axes[0].set(xlabel="v*", ylabel="restitution out")
    axes[1].set(xlabel="speed [m/s]", ylabel="1 - e")
    plots.legend(axes[0])
    return figure


CASE = Case(
    name="restitution_map",
    title="Restitution over speed and damping",
    purpose=(
        "77 spheres fly at a plane: restitution 0.06 to 1, speed 0.01 to 10 m/s, under each normal law, with"
        " and without limit_force. The damping of hertz and hooke must give back exactly the restitution that"
        " is put in, at every speed; cut by limit_force it gives a larger one, the same function for both"
        " laws, down to exp(-2) at most. The damping of hertz/stiffness is that of viscoelastic spheres, for"
        " which restitution falls with speed: 1 - e grows as v^(1/5), and all speeds and dampings fall on one"
        " curve in v*. Where that contact may pull (limit_force off) and v* exceeds about 2, it creeps back"
        " without end and the sphere sticks to the plane."
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
            "Left: default on the diagonal, limit_force on its closed form, slowest and fastest sphere."
            " Right: what is off, over all speeds; it shrinks with the time step.",
            _constant,
        ),
        Figure(
            "The viscoelastic law",
            "hertz/stiffness with limit_force. Left: all dampings and speeds on one curve. Right: the slope"
            " is 1/5 where little is lost.",
            _speed, tiers=BENCH,
        ),
    ),
    features=(
        "normal hertz", "normal hertz/stiffness", "normal hooke", "damping", "limit_force",
        "several materials", "wall plane",
    ),
    order=24,
)  # fmt: skip
