"""Balls behind a gate in an acrylic box; the gate goes, they collapse (Park, Jun, Sohn and Lee 2014).

Standard tier, on two cores at some 7e6 (LIGGGHTS, 2 ranks) and 5e6 (gpudem) particle-steps a second: three
gates at R = 3 mm, 5 724 balls x 60 000 steps = 3.4e8 each, 3 x (50 + 69) s; eight seeds at R = 7.5 mm,
916 x 24 000 = 2.2e7 each, 8 x (5 + 5) s; four more frictions at R = 7.5 mm, 4 x (4 + 3) s: 8 minutes.
Quick tier: five seeds at R = 10 mm, 515 x 15 600 = 8e6 each, some 3 s a run.
"""

from __future__ import annotations

from typing import Any

from comparisons.cases.dam_break import checks as dam_checks
from comparisons.cases.dam_break import figures as dam_figures
from comparisons.cases.dam_break import scenes as dam
from comparisons.cases.dam_break.scenes import Dam
from comparisons.harness.case import Case, Check, Figure, Measured, Results, Table, Tier, Variant

BOTH = ("gpudem", "liggghts")
COARSE: dict[Tier, float] = {"quick": 0.010, "standard": 0.0075, "full": 0.006}
SEEDS = {"quick": 5, "standard": 8, "full": 8}
SWEEP = (0.1, 0.2, 0.4, 0.5)
BENCH: tuple[Tier, ...] = ("standard", "full")
GATE_LABELS = {gate: f"gate_{1e3 * gate:.0f}" for gate in dam.GATES}


def variants(tier: Tier) -> list[Variant]:
    radius = COARSE[tier]
    opens = 0.3 if tier == "quick" else 0.5
    out = [
        Variant(f"seed_{k}", Dam(radius=radius, seed=k, opens=opens).scene())
        for k in range(1, SEEDS[tier] + 1)
    ]
    if tier == "quick":
        return out
    out += [Variant(label, Dam(gate=gate).scene()) for gate, label in GATE_LABELS.items()]
    out += [Variant(f"mu_{mu:g}", Dam(radius=radius, friction=mu, flows=0.7).scene()) for mu in SWEEP]
    if tier == "full":  # 120 000 balls, whole box, true modulus, 1.5 million steps each: a GPU's work
        out += [
            Variant(f"whole_{label}", Dam(gate=gate, slice=False, young=None).scene(), codes=("gpudem",))
            for gate, label in GATE_LABELS.items()
        ]
    return out


def _arrival_off(results: Results, code: str) -> Measured:
    """How far the time to the far wall lies outside measured .. simulated [s]."""
    time = dam.arrival(results[GATE_LABELS[0.2], code])
    off = max(dam.MEASURED_ARRIVAL - time, time - dam.PAPER_ARRIVAL, 0.0)
    return Measured(off, time, dam.MEASURED_ARRIVAL, note=f"friction {dam.BALL_FRICTION:g}, not fitted")


def _between() -> list[Check]:
    """Codes against each other: distributions over seeds, and the single runs of the three gates."""
    common: dict[str, Any] = {"against": "LIGGGHTS", "mark": "X", "needs": BOTH}
    test = (
        "exact permutation of the largest standardised gap over all metrics (Westfall and Young), level"
        " 0.01: a flow of grains is chaotic, so only distributions can agree; it corrects for the number"
        " of metrics and assumes no distribution, since heights come in layers"
    )
    checks = [
        Check(
            name="smallest corrected p over all metrics: difference between codes against spread within",
            measure=dam_checks.smallest_p, lo=dam_checks.ALPHA, tolerance=1.0, unit="1", reason=test,
            catches="any bias of friction, damping, walls or gate beyond the scatter of seeds", **common,
        ),
        Check(
            name="profile at rest: permutation p of L1 distances between codes against within",
            measure=dam_checks.profile_p, lo=dam_checks.ALPHA, tolerance=1.0, unit="1",
            reason="all 12 870 ways to split sixteen runs",
            catches="a pile of another shape whose heights agree on average", tiers=BENCH, **common,
        ),
    ]  # fmt: skip
    for tier, radius in COARSE.items():
        checks.append(
            Check(
                name="heights: largest difference of means that the seeds leave possible (95 %)",
                measure=lambda results: dam_checks.largest_bound(results, "height"),
                tolerance=2e3 * radius, unit="mm", tiers=(tier,),
                reason="one diameter, as in the paper between experiment and simulation",
                catches="seeds too few or too scattered for the test above to mean anything", **common,
            )
        )  # fmt: skip
    checks += [
        Check(
            name="time to the far wall: largest difference of means that the seeds leave possible (95 %)",
            measure=lambda results: dam_checks.largest_bound(results, "far wall"), tolerance=50, unit="ms",
            reason="the 50 ms between the paper's simulation and its experiment",
            catches="seeds too few or too scattered for the test above to mean anything", **common,
        ),
        Check(
            name="centre of mass while the lattice falls and settles, largest distance in 0.07 s / diameter",
            measure=dam_checks.early, tolerance=1e-10, unit="1",
            reason="a thousand contacts, but rounding has hardly grown: 0.01 to 0.03 s a decade",
            catches="a contact missed or made twice, a spring lost at a rebuild, before chaos hides it",
            **common,
        ),
    ]  # fmt: skip
    for gate, label in GATE_LABELS.items():
        checks.append(
            Check(
                name=f"gate at {1e3 * gate:g} mm: largest height difference, read every 100 mm",
                measure=lambda results, label=label: dam_checks.gate_heights(results, label),
                tolerance=1e3 * dam.PAPER_HEIGHT_ERROR, unit="mm", tiers=BENCH,
                reason="the paper's own largest difference, experiment against simulation: 1.3 diameters",
                catches="a gate, wall or friction that acts differently at another aspect ratio", **common,
            )
        )  # fmt: skip
    return checks


def _published(code: str) -> list[Check]:
    """One code against the paper, and against the energy balance."""
    common: dict[str, Any] = {"needs": (code,)}
    paper: dict[str, Any] = {"against": "Park et al. 2014", "mark": "P", "tiers": BENCH, **common}
    gates = list(GATE_LABELS.values())
    return [
        *dam_checks.at_rest(code),
        Check(
            name=f"time to the far wall: distance from 0.49 s (experiment) .. 0.54 s (paper) ({code})",
            measure=lambda results: _arrival_off(results, code), tolerance=0.03, unit="s",
            reason="friction is not printed, the slice has no side walls: half the paper's 0.05 s",
            catches="a gate that drags, a wall without friction, gravity or density off by 10 %", **paper,
        ),
        Check(
            name=f"ball friction at which the far wall is reached at the measured 0.49 s ({code})",
            measure=lambda results: dam_checks.friction_for(results, code, dam.MEASURED_ARRIVAL),
            lo=0.1, tolerance=0.5, unit="1",
            reason="the range of smooth plastic balls; coarse grains, R = 7.5 mm (full tier: 6 mm)",
            catches="friction that does not act, or acts twice", **paper,
        ),
        Check(
            name=f"settled column: height, largest relative error over the gates ({code})",
            measure=lambda results: dam_checks.column(results, code, gates), tolerance=0.12, unit="1",
            reason="a slice three balls deep has no side walls, packs in order, sinks in by 1 %",
            catches="a wrong number of balls per depth, a wrong radius", **paper,
        ),
    ]  # fmt: skip


CASE = Case(
    name="dam_break",
    title="Dam break of 120 000 balls",
    purpose=(
        "The flow that everything leads to: balls of polystyrene behind a gate, 200, 300 or 400 mm from"
        " the end of an acrylic box, collapse when it goes, run to the far wall and come to rest. It was"
        " done as an experiment and on a GPU in 2014. No two codes give the same flow grain by grain, so"
        " they are held against each other over seeds: do they differ by more than each differs from"
        " itself? Then against the paper: heights every 100 mm within its own 8 mm, first ball at the far"
        " wall between its measured 0.49 s and its simulated 0.54 s. Friction is not printed there; the"
        " sweep shows what it decides. The standard tier is a periodic slice three balls deep with Young's"
        " modulus softened from 3.25 GPa to 5 MPa; the full tier is the whole box as it was."
    ),
    source="Park, Jun, Sohn and Lee, Trans. KSME, 2014 (in Korean).",
    variants=variants,
    checks=(*_between(), *_published("gpudem"), *_published("liggghts")),
    figures=(
        Figure(
            "Piles at rest, over seeds", "Mean and range over the seeds of each code.",
            dam_figures.seed_profiles,
        ),
        Figure(
            "The three gates", "R = 3 mm; below, the difference, with the paper's 8 mm.",
            dam_figures.gate_profiles, tiers=BENCH,
        ),
        Figure("Energy and front in time", "Every seed of both codes.", dam_figures.flow),
        Figure(
            "How rounding grows",
            "The codes start equal and part by a factor of ten every 0.02 to 0.04 s: past the dotted line"
            " single runs soon say nothing, and only distributions can be compared.",
            dam_figures.rounding,
            needs=BOTH,
        ),
        Figure(
            "What friction decides", "Time to the far wall; bars: two standard deviations over the seeds.",
            dam_figures.sweep, tiers=BENCH,
        ),
    ),
    tables=(
        Table(
            "Codes against each other",
            "Mean and standard deviation over seeds; p of Welch's test, and corrected for all metrics by"
            " permutation.",
            dam_figures.metrics_table, needs=BOTH,
        ),
        Table(
            "Before the gate goes", "The settled column, and when the first ball reaches the far wall.",
            dam_figures.bed_table,
        ),
    ),
    features=(
        "normal hertz", "damping", "tangential history", "rotation", "gravity", "several materials",
        "wall plane", "gate", "periodic sides", "lattice packing", "bulk flow",
    ),
    order=50,
)  # fmt: skip
