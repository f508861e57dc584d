"""Chung and Ooi (2011), tests 4 and 5: oblique impacts on a rigid plane."""

from __future__ import annotations

from comparisons import kit
from comparisons.cases.chung_ooi import figures
from comparisons.cases.chung_ooi.checks import FIRST_ORDER, against_ode, against_published, coulomb
from comparisons.cases.chung_ooi.scenes import T4, T5
from comparisons.cases.single_contact.checks import step_by_step

#: Steps of the flight, and a half: a tenth of the shortest contact.
RUNGS = {"quick": (40, 20, 10), "standard": (121, 60, 20), "full": (300, 121, 40)}
BOTH = {"al_oxide": "Al_oxide", "al_alloy": "Al_alloy"}
FEM = {"steel": "FEM_Wu2003", "polyethylene": "FEM_Wu2003"}
KRATOS = "the tolerance of Kratos' own tests against these points; the exact law differs from them by {}"

CASE = kit.Case(
    name="chung_ooi_oblique",
    title="Chung and Ooi, tests 4 and 5: oblique impacts",
    purpose=(
        "Oblique impacts on a rigid plane. Test 4: spheres of 5 mm at 3.9 m/s and angles from nearly normal"
        " to grazing, restitution 0.98, friction 0.092, as in the experiment of Kharaz, Gorham and Salman"
        " (2001). Test 5: spheres of 20 um, elastic, 5 m/s along the normal and 0.1 to 21 m/s along the"
        " plane, against finite elements. At grazing angles the contact slides throughout and Coulomb's law"
        " gives the answer; at steep ones the tangential spring decides."
    ),
    source=(
        "Chung and Ooi, Granular Matter 13 (2011) 643; Kharaz, Gorham and Salman, Powder Technol. 120 (2001)"
        " 281; Wu, Li and Thornton (2003) for FEM; digitized by the Kratos and MFIX projects."
    ),
    variants=lambda tier: [v for t in (T4, T5) for v in t.variants(f"T{t.number}_", RUNGS[tier])],
    checks=(
        *(c for t in (T4, T5) for c in step_by_step(t.meetings(), spin=True, prefix=f"T{t.number}_")),
        *against_ode(T4, "T4_", dict.fromkeys(kit.LONG, 1e-3), (0.7, 1.6), FIRST_ORDER),
        *against_ode(T5, "T5_", dict.fromkeys(kit.LONG, 1e-3), (0.7, 2.2), FIRST_ORDER),
        against_published(T4, "T4_", "et", "T4_et", BOTH, 1.6e-2, KRATOS.format("0.5 %")),
        against_published(T4, "T4_", "omega", "T4_omega", BOTH, 2.2e-2, KRATOS.format("1.0 %")),
        against_published(
            T4, "T4_", "angle", "T4_rebound_angle_contact_point", {"al_oxide": "Al_oxide"}, 2.5e-2,
            KRATOS.format("1.4 %"),
        ),
        against_published(
            T5, "T5_", "rebound", "T5_rebound", FEM, 3e-2, "sliding branch; points read from print",
            against="FEM, Wu et al. 2003", within=(8.0, 14.0),
        ),
        coulomb(
            T4, "T4_", (0.995, 1.005),
            "at e = 0.98 the tensile force adds 0.1 %; the contact sticks briefly at its beginning",
        ),
        coulomb(T5, "T5_", (1 - 1e-6, 1 + 1e-6), "e = 1: no tensile force, no dashpot"),
    ),
    figures=(
        figures.curves(
            T4, "T4_", "Test 4: tangential restitution, spin and rebound angle",
            "From 30 deg on the contact slides throughout and all curves agree. Below 10 deg the experiment"
            " loses more than any of the curves, the published ones included.",
            {
                "et": ("T4_et", "angle [deg]", "v_t'/v_t"),
                "omega": ("T4_omega", "angle [deg]", "spin after impact [rad/s]"),
                "angle": (
                    "T4_rebound_angle_contact_point", "angle [deg]", "rebound angle of the surface [deg]"
                ),
            },
            {
                "al_oxide": {"Al_oxide": "published, Al oxide", "experiment_Kharaz": "experiment"},
                "al_alloy": {"Al_alloy": "published, Al alloy"},
            },
        ),
        figures.curves(
            T5, "T5_", "Test 5: surface velocity and spin after impact",
            "Beyond 7 the contact slides: the line x - 7. Below 1.5 the spring, here without a dashpot,"
            " stores shear energy and releases it, which neither FEM nor the published DEM shows; so only"
            " the sliding branch is checked against the points. The law is nearer to the minimum of the"
            " finite elements than the published DEM curve.",
            {
                "rebound": ("T5_rebound", "v_s/(mu v_n)", "v_s'/(mu v_n')"),
                "spin": ("T5_spin", "v_s/(mu v_n)", "R w'/(mu v_n)"),
            },
            {
                "steel": {"steel_DEM": "published DEM, steel", "FEM_Wu2003": "published FEM"},
                "polyethylene": {"polyethylene_DEM": "published DEM, polyethylene"},
            },
            sliding="rebound",
        ),
    ),
    tables=(figures.finals_table(T4, "T4_"), figures.finals_table(T5, "T5_")),
    features=(
        "normal hertz", "damping", "tangential history", "tangential damping", "rotation", "wall plane",
        "several materials",
    ),
    order=32,
    tiers=kit.LONG,
)  # fmt: skip
