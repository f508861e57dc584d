"""Spheres on a plane over a grid of restitution and speed, for three laws, and the restitution expected."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from comparisons.cases.side_by_side import every_pair, floor
from comparisons.cases.single_contact.meetings import Meeting, overlap, relative_velocity
from comparisons.harness.case import Measured, Results
from comparisons.metrics import trace as measure
from comparisons.oracles import closed_forms, normal_impact
from comparisons.oracles.bodies import Bodies, star
from gpudem.scene import Contact, Domain, Explicit, Material, Output, Pair, Scene, Time

Law = Literal["hertz", "hertz/stiffness", "hooke"]
LAWS: tuple[Law, ...] = ("hertz", "hertz/stiffness", "hooke")
#: Restitution put in; LIGGGHTS requires more than 0.05.
RESTITUTIONS = (0.06, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
#: For `hertz/stiffness`: v* at 1 m/s; it grows as v^(1/10).
V_STARS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 1.0, 1.5, 2.0)
#: v* above which a viscoelastic contact that may pull is overdamped: it never separates, and is not compared.
OVERDAMPED = 1.8
SPEEDS = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0)
#: Polystyrene of the dam break.
BALL = Material(young=3.25e9, poisson=0.34, density=1768.0)
RADIUS, SPACING = 0.003, 0.01
MASS = 4 / 3 * math.pi * RADIUS**3 * BALL.density
YOUNG_STAR, SHEAR_STAR = star(BALL, BALL)
KN = 4 / 3 * YOUNG_STAR
ROWS = [(e, v) for e in range(len(RESTITUTIONS)) for v in SPEEDS]
MEETINGS = [Meeting(f"column {e}, {v:g} m/s", k, "floor") for k, (e, v) in enumerate(ROWS)]


def bodies(restitution: float) -> Bodies:
    """Sphere and plane of one material."""
    return Bodies((MASS, math.inf), (RADIUS, math.inf), YOUNG_STAR, SHEAR_STAR, restitution, 0.0)


#: Flight before the touch: a tenth of the shortest contact. The longest contact takes some 8 times that.
FLIGHT = 0.1 * closed_forms.elastic_contact_time(bodies(1.0), max(SPEEDS))
DURATION = FLIGHT + 1.4 * closed_forms.contact_time(bodies(RESTITUTIONS[0]), min(SPEEDS), limit_force=True)


def label(law: str, limit_force: bool) -> str:
    """Beginning of a variant's label."""
    return f"{law.replace('/', '_')}_{'limited' if limit_force else 'plain'}_"


def scene(law: Law, limit_force: bool, steps: int) -> Scene:
    """The whole grid; the touch is `steps` and a half after the start."""
    names, width = [f"ball_{k}" for k in range(len(RESTITUTIONS))], len(SPEEDS)
    constants: list[dict[str, float]] = [{} for _ in V_STARS]
    if law == "hertz/stiffness":
        gammas = [normal_impact.gamma_for(v, KN, RADIUS, MASS) for v in V_STARS]
        constants = [{"kn": KN, "kt": KN, "gamma_n": gamma, "gamma_t": 0.0} for gamma in gammas]
    pairs = [
        Pair(materials=(n, "wall"), restitution=e, **more)
        for n, e, more in zip(names, RESTITUTIONS, constants, strict=True)
    ]
    step = FLIGHT / (steps + 0.5)
    return Scene(
        name="restitution_map",
        title=f"{law}, limit_force {'on' if limit_force else 'off'}, step {step:.3g} s",
        materials=dict.fromkeys([*names, "wall"], BALL), pairs=every_pair(names, pairs, **constants[0]),
        contact=Contact(
            normal=law, limit_force=limit_force, characteristic_velocity=1.0 if law == "hooke" else None
        ),
        particles=Explicit(
            position=[
                (SPACING * (k // width), SPACING * (k % width), RADIUS + v * FLIGHT)
                for k, (_, v) in enumerate(ROWS)
            ],
            velocity=[(0, 0, -v) for _, v in ROWS], radius=RADIUS, material=[names[e] for e, _ in ROWS],
        ),
        walls=[floor("wall")],
        domain=Domain(lo=(-0.01, -0.01, -0.001), hi=(SPACING * len(names), SPACING * width, 0.02)),
        time=Time(step=step, duration=DURATION), output=Output(trace_every=round(FLIGHT / step) * step),
    )  # fmt: skip


def rebounds(results: Results, variant: str, code: str) -> np.ndarray:
    """Restitution that comes out, (columns, speeds); NaN where a sphere has not left the plane."""
    run, up = results[variant, code], np.array([0.0, 0.0, 1.0])
    found = [
        measure.rebound(relative_velocity(run, m), up) if overlap(run, m)[-1] < 0 else math.nan
        for m in MEETINGS
    ]
    return np.array(found).reshape(len(RESTITUTIONS), len(SPEEDS))


def v_stars() -> np.ndarray:
    """v* of every sphere under `hertz/stiffness`, (columns, speeds)."""
    return np.outer(V_STARS, np.array(SPEEDS) ** 0.1)


def expected(results: Results, law: str, limit_force: bool) -> np.ndarray:
    """Restitution expected: e, its closed form under `limit_force`, or the ODE of the viscoelastic law (NaN
    for an overdamped contact).
    """

    def compute() -> np.ndarray:
        if law != "hertz/stiffness":
            out = [closed_forms.restitution(bodies(e), limit_force) for e in RESTITUTIONS]
            return np.repeat(out, len(SPEEDS)).reshape(-1, len(SPEEDS))
        reach = math.inf if limit_force else OVERDAMPED
        flat = [
            normal_impact.restitution(1.5, 0.5, v**2, limit_force) if v <= reach else math.nan
            for v in v_stars().ravel()
        ]
        return np.array(flat).reshape(-1, len(SPEEDS))

    return results.once(("expected", law, limit_force), compute)


def error(results: Results, code: str, law: str, limit_force: bool) -> Measured:
    """Largest |e out - expected| of the finest run."""
    got = rebounds(results, results.finest(label(law, limit_force)), code)
    want = expected(results, law, limit_force)
    off = np.where(np.isnan(want), 0.0, np.abs(got - want))
    k, j = np.unravel_index(np.argmax(off), got.shape)
    where = f"v* = {v_stars()[k, j]:.2g}" if law == "hertz/stiffness" else f"e = {RESTITUTIONS[k]:g}"
    note = f"{np.isfinite(want).sum()} impacts; largest at {where}, {SPEEDS[j]:g} m/s"
    return Measured(float(off.max()), float(got[k, j]), float(want[k, j]), note)


def mean_error(results: Results, variant: str, code: str, law: str, limit_force: bool) -> float:
    """Mean |e out - expected| of the damped impacts of a variant."""
    want = expected(results, law, limit_force)
    damped = want < 1 - 1e-9  # not NaN either
    return float(np.abs(rebounds(results, variant, code) - want)[damped].mean())


def against_pade(results: Results, code: str, reach: float) -> Measured:
    """Largest |e out - Pade| up to v* = reach."""
    got = rebounds(results, results.finest(label("hertz/stiffness", True)), code)
    v = v_stars()
    want = np.vectorize(normal_impact.pade)(v)
    off = np.where(v <= reach, np.abs(got - want), 0.0)
    return Measured(float(off.max()), note=f"{int((v <= reach).sum())} impacts with v* <= {reach:g}")


def exponent(results: Results, code: str) -> Measured:
    """Slope of log(1 - e) against log(speed) at the smallest v*: 1/5 less 0.14 v*^2."""
    got = rebounds(results, results.finest(label("hertz/stiffness", True)), code)[0]
    slope = np.polyfit(np.log(SPEEDS), np.log(1 - got), 1)[0]
    return Measured(float(slope), note=f"1 - e from {1 - got[0]:.3g} to {1 - got[-1]:.3g}")
