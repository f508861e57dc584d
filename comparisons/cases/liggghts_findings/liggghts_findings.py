"""What LIGGGHTS 3.8.0 does that its user may not expect: each behavior with deck and size.

Standard tier: five flows of 5000 balls x 8000 steps, some 10 s each; the rest takes seconds.
"""

from __future__ import annotations

from comparisons import kit
from comparisons.cases.liggghts_findings import figures
from comparisons.cases.liggghts_findings import scenes as findings
from comparisons.cases.liggghts_findings.checks import BOTH, CHECKS, FINDINGS
from comparisons.cases.single_contact import head_on
from comparisons.cases.single_contact.meetings import ladder
from gpudem.scene import Scene


def _deviating(label: str, scene: Scene, deviation: str) -> kit.Variant:
    return kit.Variant(label, scene, ("liggghts",), {"liggghts": {"deviation": deviation}})


def _path(label: str, scene: Scene) -> kit.Variant:
    return kit.Variant(label, scene, ("gpudem",), {"gpudem": {"integrator": "path"}})


def variants(tier: kit.Tier) -> list[kit.Variant]:
    steps = {label: head_on.scene(dt) for label, dt in ladder(tier, head_on.FLIGHT).items()}
    out = [
        kit.Variant("hop", findings.hop()),
        _deviating("hop_default_factor", findings.hop(), "default_contact_distance_factor"),
        *(kit.Variant(law, findings.slide(law)) for law in findings.LAWS),
        kit.Variant("smooth_floor", findings.smooth_floor(dashpot=False)),
        kit.Variant("smooth_floor_dashpot", findings.smooth_floor(dashpot=True), ("gpudem",)),
        *(kit.Variant(label, scene) for label, scene in steps.items()),
        *(_path(f"path_{label}", scene) for label, scene in steps.items()),
        kit.Variant("collide", findings.collide()),
        kit.Variant("collide_quiet", findings.collide(every=800), ("gpudem",)),
        _deviating("collide_two_runs", findings.collide(), "two_runs"),
        _deviating("leave", findings.leave(), "unguarded"),
        _deviating("coincide", findings.coincide(), "unguarded"),
        _deviating("burst", findings.burst(), "unguarded"),
        kit.Variant("still", findings.still()),
        _deviating("still_raw", findings.still(), "raw_frames"),
    ]
    if tier == "quick":
        return out
    return [
        *out,
        kit.Variant("flow", findings.flow()),
        _deviating("flow_default_factor", findings.flow(), "default_contact_distance_factor"),
        _path("flow_path", findings.flow()),
        kit.Variant("flow_coulomb", findings.flow("coulomb"), ("gpudem",)),
    ]


CASE = kit.Case(
    name="liggghts_findings",
    title="Properties of LIGGGHTS that affect a comparison",
    purpose=(
        "Properties of LIGGGHTS that a user who compares or calibrates with it should know, with their size."
        " Each is reproduced by a deck that is printed below; the table names the line of our decks, or the"
        " option or law of gpudem, that avoids it. By default gpudem follows LIGGGHTS' law, since that is"
        " what is compared (friction, half-step damping), and offers the alternative as an option. None of"
        " them makes LIGGGHTS unfit for use: each changes a flow as rounding does, only earlier; whether"
        " means are shifted is tested over the seeds of the dam break."
    ),
    source="LIGGGHTS 3.8.0 as Debian has it, run here; its manual.",
    variants=variants,
    checks=CHECKS,
    findings=FINDINGS,
    figures=(
        kit.Figure(
            "A ball bounces on a ball",
            "The first impact is the same; in the second, the default deck starts with the spring that the"
            " first left.",
            figures.hop, needs=("liggghts",),
        ),
        kit.Figure(
            "Friction above Coulomb's limit",
            "Impacts that slide throughout. Lines: gpudem, rings: LIGGGHTS, equal for each option. The"
            " restitution is the measured one. With both options friction takes up to 1.5 % less, since the"
            " first contact sticks.",
            figures.sliding, needs=BOTH,
        ),
        kit.Figure(
            "Damping at half steps",
            "Head-on pairs, e = 0.3 to 0.9, largest error against the exact solution.",
            figures.half_step, needs=BOTH,
        ),
        kit.Figure(
            "In a flow",
            "5000 balls after the removal of the gate, each property against the same flow without it. The"
            " curve of rounding shows the growth by chaos: after 0.15 s all runs differ by about one per"
            " cent, as any two runs do.",
            figures.flow, tiers=kit.LONG, needs=BOTH,
        ),
    ),
    tables=(
        kit.Table(
            "Properties of LIGGGHTS that affect a comparison",
            "Size in one contact and in a flow of 5000 balls, and what avoids each of them.",
            figures.summary, needs=BOTH, section="limits",
        ),
    ),
    features=(
        "tangential history", "tangential damping", "damping", "limit_force", "integrator path",
        "lost particles and NaN", "frames",
    ),
    order=70,
)  # fmt: skip
