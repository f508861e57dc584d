"""Two spheres meet head-on: unequal radii, densities and materials, restitution 0.3, 0.6, 0.9 and 1 in one
scene.
"""

from __future__ import annotations

import numpy as np

from comparisons.cases.single_contact import figures as impact_figures
from comparisons.cases.single_contact.checks import against_closed_forms, against_ode, step_by_step
from comparisons.cases.single_contact.meetings import Meeting, ladder
from comparisons.harness.case import Case, Tier, Variant
from gpudem.scene import Domain, Explicit, Material, Output, Pair, Scene, Time

#: Restitution, approach speed [m/s] and direction of each pair; speeds and directions differ so that an
#: axis mixed up, or a damping that depends on speed, shows.
PAIRS = (
    (0.3, 1.0, (1.0, 0.0, 0.0)),
    (0.6, 0.8, (0.0, 0.0, 1.0)),
    (0.9, 1.2, (1.0, 2.0, 2.0)),
    (1.0, 1.0, (3.0, -4.0, 12.0)),
)
RADII = (0.003, 0.005)
#: Polystyrene of the dam break; the partner is denser, stiffer and larger.
BALL = Material(young=3.25e9, poisson=0.34, density=1768.0)
PARTNER = Material(young=8e9, poisson=0.25, density=2500.0)
SPACING = 0.05
#: Time of the touch and of the run [s]; a contact takes some 55e-6 s.
FLIGHT, DURATION = 6e-6, 85e-6

MEETINGS = [Meeting(f"e = {e:g}", 2 * k, 2 * k + 1) for k, (e, _, _) in enumerate(PAIRS)]
DAMPED, ELASTIC = MEETINGS[:3], MEETINGS[3:]
QUANTITIES = ("peak_overlap", "contact_time", "rebound")
FIRST_ORDER = "the dashpot sees half-step velocities, so the error is first order: about 0.5/steps at e = 0.3"
SECOND_ORDER = "velocity Verlet without damping is second order: about 1/steps^2"


def scene(dt: float) -> Scene:
    """All pairs, `FLIGHT` before their touch."""
    position, velocity, radius, material = [], [], [], []
    for k, (_, speed, direction) in enumerate(PAIRS):
        n = np.array(direction) / np.linalg.norm(direction)
        centre = np.array([SPACING * k, 0.0, 0.0])
        gap = speed * FLIGHT
        position += [centre, centre + (sum(RADII) + gap) * n]
        velocity += [0.75 * speed * n, -0.25 * speed * n]
        radius += RADII
        material += ["ball", f"partner_{k}"]
    partners = [f"partner_{k}" for k in range(len(PAIRS))]
    pairs = [Pair(materials=("ball", p), restitution=e) for p, (e, _, _) in zip(partners, PAIRS, strict=True)]
    pairs += [Pair(materials=("ball", "ball"))]  # never meet: stated because both codes want the whole table
    pairs += [Pair(materials=(a, b)) for k, a in enumerate(partners) for b in partners[k:]]
    materials = {"ball": BALL} | dict.fromkeys(partners, PARTNER)
    return Scene(
        name="head_on", title=f"head-on pairs, step {dt:.3g} s", materials=materials, pairs=pairs,
        particles=Explicit(position=position, velocity=velocity, radius=radius, material=material),
        domain=Domain(lo=(-0.05, -0.05, -0.05), hi=(SPACING * len(PAIRS), 0.05, 0.05)),
        time=Time(step=dt, duration=DURATION), output=Output(trace_every=dt),
    )  # fmt: skip


def variants(tier: Tier) -> list[Variant]:
    return [Variant(label, scene(dt)) for label, dt in ladder(tier, FLIGHT).items()]


CASE = Case(
    name="head_on",
    title="Two spheres, head-on",
    purpose=(
        "The smallest scene with a contact: if the normal force, its damping, the effective mass or the"
        " order of a step is wrong, it shows here with nothing else to blame. Four pairs of spheres of"
        " unequal radius, density and modulus meet in four directions with restitution 0.3, 0.6, 0.9 and"
        " 1. The two codes must agree to rounding at every step; both must tend to the exact solution of"
        " the continuous law as the step shrinks, at first order where there is damping (its force sees"
        " half-step velocities) and at second order where there is none."
    ),
    source="Closed forms: Hertz (1882), Antypov and Elliott (2011); ODE: DOP853, rtol 1e-13; LIGGGHTS.",
    variants=variants,
    checks=(
        *step_by_step(MEETINGS, spin=False),
        *against_ode("damped", DAMPED, 1e-3, (0.85, 1.15), why=FIRST_ORDER),
        *against_ode("elastic", ELASTIC, 2e-6, (1.85, 2.15), why=SECOND_ORDER),
        *against_closed_forms("damped", DAMPED, dict.fromkeys(QUANTITIES, 1e-3), why=FIRST_ORDER),
        *against_closed_forms("elastic", ELASTIC, dict.fromkeys(QUANTITIES, 2e-6), why=SECOND_ORDER),
    ),
    figures=(
        impact_figures.overlay(MEETINGS),
        impact_figures.convergence(MEETINGS),
        impact_figures.work_precision(MEETINGS),
    ),
    tables=(impact_figures.observables_table(MEETINGS),),
    features=("normal hertz", "damping", "several materials", "several radii", "sphere-sphere"),
    order=10,
)
