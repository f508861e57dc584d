"""Chung and Ooi (2011), tests 1 to 3: two spheres, sphere on a rigid plane, restitution."""

from __future__ import annotations

from comparisons.cases.chung_ooi import figures
from comparisons.cases.chung_ooi.checks import against_ode
from comparisons.cases.chung_ooi.normal_checks import force_curves, momentum
from comparisons.cases.chung_ooi.scenes import T1, T2, T3
from comparisons.cases.single_contact.checks import SECOND_ORDER, against_closed_forms, step_by_step
from comparisons.cases.single_contact.meetings import ladder
from comparisons.harness.case import Case, Tier, Variant

TESTS = (T1, T2, T3)
FIRST_ORDER = "the dashpot sees half-step velocities: first order, larger for smaller e"
READING = (
    "points read from print to 0.3 us and 0.04 kN: Hertz' exact curve differs from them as much; Kratos"
    " states 0.2 to 0.3 %"
)


def variants(tier: Tier) -> list[Variant]:
    return [
        Variant(f"T{test.number}_{label}", test.scene(dt))
        for test in TESTS
        for label, dt in ladder(tier, test.flight).items()
    ]


CASE = Case(
    name="chung_ooi_normal",
    title="Chung and Ooi, tests 1 to 3: normal impacts",
    purpose=(
        "The usual benchmark of DEM codes, normal impacts: two spheres of glass or limestone at 20 m/s; a"
        " sphere of 100 mm on a rigid plane at 0.2 m/s; restitution 0.2 to 1 for alumina and cast iron at"
        " 3.9 m/s. Force against time and overlap must be Hertz', and the restitution that comes out the one"
        " put in, for every material. The plane is rigid in the paper: sphere and plane of twice the modulus"
        " have exactly the contact of the sphere on a rigid plane."
    ),
    source=(
        "Chung and Ooi, Granular Matter 13 (2011) 643; curves digitized by the Kratos project; Hertz (1882);"
        " Antypov and Elliott (2011)."
    ),
    variants=variants,
    checks=(
        *(c for t in TESTS for c in step_by_step(t.meetings(), spin=False, prefix=f"T{t.number}_")),
        *against_closed_forms("T1", T1.meetings(), 2e-5, prefix="T1_", why=SECOND_ORDER),
        *against_closed_forms("T2", T2.meetings(), 2e-5, prefix="T2_", why=SECOND_ORDER),
        *against_ode(T3, "T3_", {"quick": 1e-3, "standard": 3e-4}, (0.85, 1.15), FIRST_ORDER),
        *against_closed_forms(
            "T3", T3.meetings(), 1e-3, prefix="T3_", why=FIRST_ORDER, quantities=("rebound",)
        ),
        *force_curves(T1, "T1_", "glass", (1.5e-2, 7e-3), READING),
        *force_curves(T2, "T2_", "Al", (4e-3, 1.7e-2), READING),
        momentum(T1, "T1_"),
    ),
    figures=(
        figures.force(T1, "T1_", "glass"),
        figures.force(T2, "T2_", "Al"),
        figures.restitution(T3, "T3_"),
    ),
    features=("normal hertz", "damping", "sphere-sphere", "wall plane", "several materials"),
    order=22,
)  # fmt: skip
