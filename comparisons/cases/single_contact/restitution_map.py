"""Restitution over a grid of restitution put in and speed, for three normal laws, with and without
`limit_force`, and under adhesion.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np

from comparisons import kit
from comparisons.cases.side_by_side import every_pair, floor, traced
from comparisons.cases.single_contact import adhesive_map
from comparisons.cases.single_contact.checks import step_by_step
from comparisons.cases.single_contact.meetings import Meeting, overlap, relative_velocity
from comparisons.metrics import trace as measure
from comparisons.oracles import closed_forms, normal_impact
from comparisons.oracles.bodies import Bodies, star
from comparisons.report import plots
from gpudem.scene import Contact, Explicit, Material, Pair, Scene

LAWS = ("hertz", "hertz/stiffness", "hooke")
#: Restitution put in; LIGGGHTS requires more than 0.05.
RESTITUTIONS = (0.06, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
#: For `hertz/stiffness`: v* at 1 m/s; it grows as v^(1/10).
V_STARS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 1.0, 1.5, 2.0)
#: v* above which a viscoelastic contact that may pull is overdamped: it never separates, and is not compared.
OVERDAMPED = 1.8
SPEEDS = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0)
#: v* of every sphere under `hertz/stiffness`, (columns, speeds).
V_STAR = np.outer(V_STARS, np.array(SPEEDS) ** 0.1)
#: Polystyrene of the dam break.
BALL = Material(young=3.25e9, poisson=0.34, density=1768.0)
RADIUS, SPACING = 0.003, 0.01
MASS = 4 / 3 * math.pi * RADIUS**3 * BALL.density
YOUNG_STAR, SHEAR_STAR = star(BALL, BALL)
KN = 4 / 3 * YOUNG_STAR
ROWS = [(e, v) for e in range(len(RESTITUTIONS)) for v in SPEEDS]
MEETINGS = [Meeting(f"column {e}, {v:g} m/s", k, "floor") for k, (e, v) in enumerate(ROWS)]
#: Steps of the flight, and a half: a tenth of the shortest contact.
RUNGS = {"quick": (50, 25, 12), "standard": (150, 50, 16), "full": (400, 150, 50)}


def bodies(restitution: float) -> Bodies:
    """Sphere and plane of one material."""
    return Bodies((MASS, math.inf), (RADIUS, math.inf), YOUNG_STAR, SHEAR_STAR, restitution, 0.0)


#: Flight before the touch: a tenth of the shortest contact. The longest contact takes some 8 times that.
FLIGHT = 0.1 * closed_forms.elastic_contact_time(bodies(1.0), max(SPEEDS))
DURATION = FLIGHT + 1.4 * closed_forms.contact_time(bodies(RESTITUTIONS[0]), min(SPEEDS), limit_force=True)


def prefix(law: str, limit_force: bool) -> str:
    """Beginning of a variant's label."""
    return f"{law.replace('/', '_')}_{'limited' if limit_force else 'plain'}_"


def scene(law: str, limit_force: bool, steps: int) -> Scene:
    """The whole grid; the touch is `steps` and a half after the start."""
    names, width, step = [f"ball_{k}" for k in range(len(RESTITUTIONS))], len(SPEEDS), FLIGHT / (steps + 0.5)
    constants: list[dict[str, float]] = [{} for _ in V_STARS]
    if law == "hertz/stiffness":
        gammas = [normal_impact.gamma_for(v, KN, RADIUS, MASS) for v in V_STARS]
        constants = [{"kn": KN, "kt": KN, "gamma_n": gamma, "gamma_t": 0.0} for gamma in gammas]
    pairs = [
        Pair(materials=(n, "wall"), restitution=e, **more)
        for n, e, more in zip(names, RESTITUTIONS, constants, strict=True)
    ]
    position = [
        (SPACING * (k // width), SPACING * (k % width), RADIUS + v * FLIGHT) for k, (_, v) in enumerate(ROWS)
    ]
    return traced(
        "restitution_map",
        Explicit(
            position=position, velocity=[(0, 0, -v) for _, v in ROWS], radius=RADIUS,
            material=[names[e] for e, _ in ROWS],
        ),
        title=f"{law}, limit_force {'on' if limit_force else 'off'}, step {step:.3g} s",
        materials=dict.fromkeys([*names, "wall"], BALL), pairs=every_pair(names, pairs, **constants[0]),
        contact=Contact(
            normal=law, limit_force=limit_force, characteristic_velocity=1.0 if law == "hooke" else None
        ),
        walls=[floor("wall")], step=step, duration=DURATION, every=round(FLIGHT / step) * step,
        lo=(-0.01, -0.01, -0.001), hi=(SPACING * len(names), SPACING * width, 0.02),
    )  # fmt: skip


# -- measures: arrays are (columns, speeds) ------------------------------------------------------------------


def rebounds(results: kit.Results, label: str, code: str) -> np.ndarray:
    """Restitution that comes out; NaN where a sphere has not left the plane."""
    run, up = results[label, code], np.array([0.0, 0.0, 1.0])
    found = [
        measure.rebound(relative_velocity(run, m), up) if overlap(run, m)[-1] < 0 else math.nan
        for m in MEETINGS
    ]
    return np.array(found).reshape(V_STAR.shape)


def expected(results: kit.Results, law: str, limit: bool) -> np.ndarray:
    """Restitution expected: e, its closed form under `limit_force`, or the ODE of the viscoelastic law (NaN
    for an overdamped contact).
    """

    def compute() -> np.ndarray:
        if law != "hertz/stiffness":
            out = [closed_forms.restitution(bodies(e), limit) for e in RESTITUTIONS]
            return np.repeat(out, len(SPEEDS)).reshape(V_STAR.shape)
        flat = [
            normal_impact.restitution(1.5, 0.5, v**2, limit) if limit or v <= OVERDAMPED else math.nan
            for v in V_STAR.ravel()
        ]
        return np.array(flat).reshape(V_STAR.shape)

    return results.once(("expected", law, limit), compute)


def off(results: kit.Results, label: str, code: str, law: str, limit: bool) -> np.ndarray:
    """|e out - expected|; 0 where nothing is expected."""
    want = expected(results, law, limit)
    return np.where(np.isnan(want), 0.0, np.abs(rebounds(results, label, code) - want))


def largest(results: kit.Results, code: str, law: str, limit: bool) -> kit.Measured:
    label, want = results.finest(prefix(law, limit)), expected(results, law, limit)
    found, got = off(results, label, code, law, limit), rebounds(results, label, code)
    k, j = np.unravel_index(np.argmax(found), found.shape)
    where = f"v* = {V_STAR[k, j]:.2g}" if law == "hertz/stiffness" else f"e = {RESTITUTIONS[k]:g}"
    note = f"{np.isfinite(want).sum()} impacts; largest at {where}, {SPEEDS[j]:g} m/s"
    return kit.Measured(float(found.max()), float(got[k, j]), float(want[k, j]), note)


def mean(results: kit.Results, label: str, code: str, law: str, limit: bool) -> float:
    damped = expected(results, law, limit) < 1 - 1e-9  # not NaN either
    return float(off(results, label, code, law, limit)[damped].mean())


def against_pade(results: kit.Results, code: str) -> kit.Measured:
    got, near = rebounds(results, results.finest(prefix("hertz/stiffness", True)), code), V_STAR <= 0.4
    found = np.abs(got - np.vectorize(normal_impact.pade)(V_STAR))[near]
    return kit.Measured(float(found.max()), note=f"{near.sum()} impacts with v* <= 0.4")


def exponent(results: kit.Results, code: str) -> kit.Measured:
    got = rebounds(results, results.finest(prefix("hertz/stiffness", True)), code)[0]
    slope = np.polyfit(np.log(SPEEDS), np.log(1 - got), 1)[0]
    return kit.Measured(float(slope), note=f"1 - e from {1 - got[0]:.3g} to {1 - got[-1]:.3g}")


# -- checks and figures --------------------------------------------------------------------------------------


def _checks(law: str, limit: bool) -> Iterator[kit.PerCode | kit.PerPair]:
    against = "ODE (DOP853, rtol 1e-12)" if law == "hertz/stiffness" else "closed form"
    name = f"{law}, limit_force {'on' if limit else 'off'}"
    quick = {"quick": 2e-3} if law == "hertz" else {}
    tiers = kit.TIERS if law == "hertz" else kit.LONG
    yield from step_by_step(MEETINGS, spin=False, prefix=prefix(law, limit), tiers=tiers)
    yield kit.per_code(
        f"{name}: restitution, largest |out - expected|",
        lambda results, code: largest(results, code, law, limit),
        tolerance=quick | dict.fromkeys(kit.LONG, 1e-3), against=against,
        reason="the dashpot uses half-step velocities: first order, largest at the smallest e; Chrono and"
        " Kratos allow 1e-3",
        catches="a restitution that depends on speed where it must not, or not where it must",
    )  # fmt: skip
    yield kit.observed_order(
        f"{name}: observed order of the mean error",
        lambda results, label, code: mean(results, label, code, law, limit),
        (0.85, 1.3), prefix=prefix(law, limit), against=against, tiers=tiers,
        reason="first order: the dashpot uses half-step velocities",
        catches="a law that tends to another restitution than the one stated",
    )  # fmt: skip


VISCOELASTIC = (
    kit.per_code(
        "hertz/stiffness, limit_force on: largest |out - Pade (Mueller and Poeschel)|", against_pade,
        tolerance=1e-3, against="Mueller and Poeschel 2011", mark="P", tiers=kit.LONG,
        reason="the Pade form is good to 2e-4 up to v* = 0.4; the rest is the time step",
        catches="a damping that is not that of the viscoelastic sphere",
    ),
    kit.per_code(
        "hertz/stiffness, limit_force on: slope of log(1 - e) in log(speed)", exponent,
        lo=0.197, tolerance=0.201, against="closed form", tiers=kit.LONG,
        reason="1/5 - 0.14 v*^2 with v* = 0.05: 0.1997, and the time step",
        catches="damping as overlap^(1/4) (slope 0) or constant (slope -1/5)",
    ),
)  # fmt: skip


def _constant(results: kit.Results) -> plots.Figure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.8)
    fine = np.linspace(0.051, 1, 200)
    for limit, color in ((False, plots.SERIES[0]), (True, plots.SERIES[2])):
        exact = [closed_forms.restitution(bodies(e), limit) for e in fine]
        left.plot(fine, exact, color=color, lw=0.9, label="limit_force" if limit else "default")
        for law, size in {"hertz": 5, "hooke": 9}.items():
            if results.labels(prefix=prefix(law, limit)):
                label = results.finest(prefix(law, limit))
                for code in results.codes(label):
                    look = plots.marks(code, color=color, markersize=size)
                    left.plot(RESTITUTIONS, rebounds(results, label, code)[:, [0, -1]], **look)
                    worst = np.maximum(off(results, label, code, law, limit).max(axis=1), 1e-16)
                    right.semilogy(RESTITUTIONS, worst, **{**look, "linestyle": "-"}, lw=0.7)
    right.axhline(1e-3, **plots.TOLERANCE)
    left.set(xlabel="stated restitution", ylabel="resulting restitution, at 0.01 and 10 m/s")
    right.set(xlabel="stated restitution", ylabel="largest |difference| over all speeds")
    plots.legend(left, points=results.codes())
    return figure


def _speed(results: kit.Results) -> plots.Figure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.8)
    label = results.finest(prefix("hertz/stiffness", True))
    exact, rank = expected(results, "hertz/stiffness", True), np.argsort(V_STAR, None)
    line = np.linspace(0.02, 2.6, 200)
    pade = [normal_impact.pade(x) for x in line]
    left.plot(line, pade, "--", color="#777777", lw=1, label="Pade, Mueller and Poeschel")
    left.plot(V_STAR.ravel()[rank], exact.ravel()[rank], **plots.style("oracle"))
    shown = range(0, len(V_STARS), 2)
    for code in results.codes(label):
        got, look = rebounds(results, label, code), plots.marks(code, color=plots.color(code))
        left.plot(V_STAR.ravel(), got.ravel(), **look, label=plots.name(code))
        right.loglog(SPEEDS, 1 - got[shown].T, **look)
    right.loglog(SPEEDS, 1 - exact[shown].T, **plots.style("oracle"))
    for k in shown:
        right.annotate(f"v* = {V_STARS[k]:g}", (10, 1 - exact[k, -1]), fontsize=7.5, va="bottom", ha="right")
    left.set(xlabel="v*", ylabel="resulting restitution")
    right.set(xlabel="speed [m/s]", ylabel="1 - e")
    plots.legend(left)
    return figure


CASE = kit.Case(
    name="restitution_map",
    title="Restitution over speed and damping",
    purpose=(
        "77 spheres hit a plane: restitution 0.06 to 1, speed 0.01 to 10 m/s, under each normal law, with and"
        " without limit_force. hertz and hooke must return exactly the stated restitution, at every speed;"
        " with limit_force a larger one, the same function for both laws, never below exp(-2). The damping of"
        " hertz/stiffness is that of viscoelastic spheres, for which restitution decreases with speed: 1 - e"
        " grows as v^(1/5), and all speeds and dampings are on one curve in v*. If the force may become"
        " tensile (limit_force off) and v* exceeds about 2, the contact is overdamped and the sphere sticks"
        " to the plane. Under jkr (gpudem only) restitution is sqrt(1 - (v_s/v)^2) without damping, and"
        " nothing slower than the sticking speed v_s, 3.77 (w^5 R^4/E*^2)^(1/6)/m^(1/2), leaves."
    ),
    source=(
        "Antypov and Elliott (2011); Schwager and Poeschel (2007); Mueller and Poeschel (2011) for the"
        " viscoelastic law; ODE: DOP853; jkr: Thornton and Ning, Powder Technol. 99 (1998) 154."
    ),
    variants=lambda tier: [
        kit.Variant(f"{prefix(law, limit)}{n}", scene(law, limit, n))
        for law in (LAWS[:1] if tier == "quick" else LAWS)
        for limit in (False, True)
        for n in RUNGS[tier]
    ]
    + adhesive_map.variants(tier),
    checks=(
        *(check for law, limit in itertools.product(LAWS, (False, True)) for check in _checks(law, limit)),
        *VISCOELASTIC,
        *adhesive_map.CHECKS,
    ),
    figures=(
        kit.Figure(
            "Resulting restitution against stated restitution",
            "Left: the slowest and the fastest sphere on the closed forms (lines); small marks hertz, large"
            " marks hooke. Right: largest difference over all speeds; it decreases with the time step.",
            _constant,
        ),
        kit.Figure(
            "The viscoelastic law",
            "hertz/stiffness with limit_force. Left: all dampings and speeds on one curve. Right: the slope"
            " is 1/5 where the loss is small.",
            _speed, tiers=kit.LONG,
        ),
        *adhesive_map.FIGURES,
    ),
    features=(
        "normal hertz", "normal hertz/stiffness", "normal hooke", "normal jkr", "damping", "limit_force",
        "several materials", "wall plane",
    ),
    order=24,
)  # fmt: skip
