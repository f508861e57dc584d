"""Head-on impacts of two spheres of unequal radius, density and material, restitution 0.3 to 1."""

from __future__ import annotations

import numpy as np

from comparisons import kit
from comparisons.cases.side_by_side import Spheres, every_pair, traced
from comparisons.cases.single_contact import checks, figures
from comparisons.cases.single_contact.meetings import Meeting, ladder
from gpudem.scene import Material, Pair, Scene

#: Restitution, approach speed [m/s] and direction of each pair; they differ to detect a wrong axis, or a
#: damping that depends on speed.
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


def scene(dt: float) -> Scene:
    """All pairs, `FLIGHT` before their touch."""
    rows, partners, pairs = Spheres(), [f"partner_{k}" for k in range(len(PAIRS))], []
    for k, (restitution, speed, direction) in enumerate(PAIRS):
        n, start = np.array(direction) / np.linalg.norm(direction), np.array([SPACING * k, 0.0, 0.0])
        apart = (sum(RADII) + speed * FLIGHT) * n
        rows.add(start, 0.75 * speed * n, radius=RADII[0])
        rows.add(start + apart, -0.25 * speed * n, radius=RADII[1], material=partners[k])
        pairs.append(Pair(materials=("ball", partners[k]), restitution=restitution))
    return traced(
        "head_on", rows.explicit(angular_velocity=None), title=f"head-on pairs, step {dt:.3g} s",
        materials={"ball": BALL} | dict.fromkeys(partners, PARTNER),
        pairs=every_pair(["ball", *partners], pairs), step=dt, duration=DURATION,
        lo=(-0.05, -0.05, -0.05), hi=(SPACING * len(PAIRS), 0.05, 0.05),
    )  # fmt: skip


CASE = kit.Case(
    name="head_on",
    title="Two spheres, head-on",
    purpose=(
        "The smallest scene with a contact: it shows an error in the normal force, its damping, the effective"
        " mass or the order of a step without any other influence. Four pairs of spheres of unequal radius,"
        " density and modulus collide in four directions with restitution 0.3, 0.6, 0.9 and 1. The codes must"
        " agree to rounding at every step. Each must converge to the exact solution of the continuous law, at"
        " first order with damping (the dashpot uses half-step velocities), at second order without."
    ),
    source="Closed forms: Hertz (1882), Antypov and Elliott (2011); ODE: DOP853, rtol 1e-13; LIGGGHTS.",
    variants=lambda tier: [
        kit.Variant(label, scene(dt), timed=True) for label, dt in ladder(tier, FLIGHT).items()
    ],
    checks=(
        *checks.step_by_step(MEETINGS, spin=False),
        *checks.against_ode("damped", DAMPED, 1e-3, (0.85, 1.15), "", checks.FIRST_ORDER),
        *checks.against_ode("elastic", ELASTIC, 2e-6, (1.85, 2.15), "", checks.SECOND_ORDER),
        *checks.against_closed_forms("damped", DAMPED, 1e-3, "", checks.FIRST_ORDER),
        *checks.against_closed_forms("elastic", ELASTIC, 2e-6, "", checks.SECOND_ORDER),
    ),
    figures=(figures.overlay(MEETINGS), *figures.of_steps(MEETINGS, MEETINGS)),
    tables=(figures.observables_table(MEETINGS),),
    features=("normal hertz", "damping", "several materials", "several radii", "sphere-sphere"),
    order=10,
)
