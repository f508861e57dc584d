"""Balls behind a gate in an acrylic box; the gate is removed, they collapse (Park, Jun, Sohn and Lee 2014).

Particle-steps: three gates at R = 3 mm, 5 724 balls x 60 000 steps = 3.4e8 each (standard tier); seeds at
R = 7.5 mm, 916 x 24 000 = 2.2e7 each (standard), at 10 mm, 515 x 15 600 = 8e6 (quick).
"""

from __future__ import annotations

from comparisons import kit
from comparisons.cases import over_seeds
from comparisons.cases.dam_break import checks, figures
from comparisons.cases.dam_break import scenes as dam
from comparisons.cases.dam_break.scenes import Dam
from comparisons.kit import LONG

COARSE: dict[kit.Tier, float] = {"quick": 0.010, "standard": 0.0075, "full": 0.006}
SEEDS = {"quick": 5, "standard": 8, "full": 8}
SWEEP = (0.1, 0.2, 0.4, 0.5)
GATE_LABELS = {gate: f"gate_{1e3 * gate:.0f}" for gate in dam.GATES}


def variants(tier: kit.Tier) -> list[kit.Variant]:
    radius, opens = COARSE[tier], 0.3 if tier == "quick" else 0.5
    seeds = range(1, SEEDS[tier] + 1)
    made = [kit.Variant(f"seed_{k}", Dam(radius=radius, seed=k, opens=opens).scene()) for k in seeds]
    if tier == "quick":
        return made
    made += [kit.Variant(label, Dam(gate=gate).scene()) for gate, label in GATE_LABELS.items()]
    made += [kit.Variant(f"mu_{mu:g}", Dam(radius=radius, friction=mu, flows=0.7).scene()) for mu in SWEEP]
    if tier == "full":  # 120 000 balls, whole box, true modulus, 1.5 million steps each: needs a GPU
        for gate, label in GATE_LABELS.items():
            whole = Dam(gate=gate, slice=False, young=None).scene()
            made.append(kit.Variant(f"whole_{label}", whole, codes=("gpudem",)))
    return made


TEST = (
    "exact permutation test of the largest standardized difference over all metrics (Westfall and Young), no"
    " significant difference at 0.01: a granular flow is chaotic, so that only distributions can agree; it"
    " corrects for the number of metrics and assumes no distribution, since heights come in layers"
)
#: Codes against each other: distributions over seeds, and the single runs of the three gates.
BETWEEN = (
    kit.per_pair(
        "smallest corrected p over all metrics: difference between codes against spread within",
        checks.smallest_p, lo=over_seeds.ALPHA, tolerance=1.0, reason=TEST,
        catches="any bias of friction, damping, walls or gate beyond the scatter of seeds",
    ),
    kit.per_pair(
        "profile at rest: permutation p of L1 distances between codes against within",
        checks.profile_p, lo=over_seeds.ALPHA, tolerance=1.0, tiers=LONG,
        reason="all 12 870 ways to split 16 runs",
        catches="a pile of another shape whose heights agree on average",
    ),
    checks.bound(
        "heights", "height", tolerance={tier: 2e3 * radius for tier, radius in COARSE.items()}, unit="mm",
        reason="one diameter, as in the paper between experiment and simulation",
    ),
    checks.bound(
        "time to the far wall", "far wall", tolerance=50, unit="ms",
        reason="the 50 ms between the paper's simulation and its experiment",
    ),
    checks.early(
        "center of mass while the lattice falls and settles, largest distance in 0.07 s / diameter",
        reason="a thousand contacts, but rounding has hardly grown: tenfold in 0.01 to 0.03 s",
        catches="a contact missed or counted twice, a spring lost at a rebuild, before chaos hides it",
    ),
    *(
        kit.per_pair(
            f"gate at {1e3 * gate:g} mm: largest height difference, read every 100 mm",
            lambda results, a, b, label=label: checks.gate_heights(results, label, a, b),
            tolerance=1e3 * dam.PAPER_HEIGHT_ERROR, unit="mm", tiers=LONG,
            reason="the paper's own largest difference, experiment against simulation: 1.3 diameters",
            catches="a gate, wall or friction that acts differently at another aspect ratio",
        )
        for gate, label in GATE_LABELS.items()
    ),
)  # fmt: skip
#: Each code against the paper, and the bed at rest.
PUBLISHED = (
    checks.AT_REST,
    checks.arrival(
        GATE_LABELS[0.2], tolerance=0.03, tiers=LONG,
        reason="the paper does not state the friction, and the slice has no side walls: half the paper's 0.05"
            " s",
    ),
    kit.per_code(
        "ball friction at which the far wall is reached at the measured 0.49 s", checks.friction_at, lo=0.1,
        tolerance=0.5, against="Park et al. 2014", mark="P", tiers=LONG,
        reason="the range of smooth plastic balls; coarse grains, R = 7.5 mm (full tier: 6 mm)",
        catches="friction that does not act, or acts twice",
    ),
    kit.per_code(
        "settled column: height, largest relative error over the gates", checks.column, tolerance=0.12,
        against="Park et al. 2014", mark="P", tiers=LONG,
        reason="a slice three balls deep has no side walls, packs in order, overlaps by 1 %",
        catches="a wrong number of balls per depth, a wrong radius",
    ),
)  # fmt: skip

CASE = kit.Case(
    name="dam_break",
    title="Dam break of 120 000 balls",
    purpose=(
        "A bulk flow: polystyrene balls behind a gate, 200, 300 or 400 mm from the end of an acrylic box,"
        " collapse when it is removed, run to the far wall and come to rest. It was done as an experiment and"
        " on a GPU in 2014. The flows of two codes do not agree ball by ball, so they are compared over"
        " seeds: is their difference larger than the scatter within each code? They are then compared with"
        " the paper: heights every 100 mm within its 8 mm, first ball at the far wall between its measured"
        " 0.49 s and its simulated 0.54 s. The paper does not state the friction; a series of runs shows its"
        " influence. The standard tier is a periodic slice three balls deep with Young's modulus reduced from"
        " 3.25 GPa to 5 MPa; the full tier is the whole box with the true modulus."
    ),
    source="Park, Jun, Sohn and Lee, Trans. KSME, 2014 (in Korean).",
    variants=variants,
    checks=(*BETWEEN, *PUBLISHED),
    figures=(
        kit.Figure(
            "Piles at rest, over seeds", "Mean and range over the seeds of each code.", figures.seed_profiles
        ),
        kit.Figure(
            "The three gates", "R = 3 mm; below, the difference, with the paper's 8 mm.",
            figures.gate_profiles, tiers=LONG,
        ),
        kit.Figure("Energy and front in time", "Every seed of each code.", figures.flow),
        kit.Figure(
            "How rounding grows",
            "The codes start equal and separate by a factor of ten every 0.02 to 0.04 s: soon after the"
            " dotted line single runs cannot be compared any more, only distributions.",
            figures.rounding,
        ),
        kit.Figure(
            "Influence of friction", "Time to the far wall; bars: two standard deviations over the seeds.",
            figures.sweep, tiers=LONG,
        ),
    ),
    tables=(
        kit.Table(
            "Codes against each other",
            "Mean and standard deviation over seeds; 95 % confidence interval of the difference; p of Welch's"
            " test, and corrected for all metrics by permutation.",
            figures.metrics_table,
        ),
        kit.Table(
            "Before the gate is removed", "The settled column, and when the first ball reaches the far wall.",
            figures.bed_table,
        ),
    ),
    features=(
        "normal hertz", "damping", "tangential history", "rotation", "gravity", "several materials",
        "wall plane", "gate", "periodic sides", "lattice packing", "bulk flow",
    ),
    order=50,
)  # fmt: skip
