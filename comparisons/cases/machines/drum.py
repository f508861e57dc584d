"""A half-filled drum of facets turns: angle of the surface, mixing, torque, energy; the rules of contacts."""

from __future__ import annotations

import numpy as np

from comparisons import kit
from comparisons.cases import over_seeds
from comparisons.cases.machines import drum_checks as checks
from comparisons.cases.machines import drum_scenes as drums
from comparisons.harness import codes
from comparisons.report import plots

SEEDS: dict[kit.Tier, int] = {"quick": 5, "standard": 6, "full": 10}
DURATION: dict[kit.Tier, float] = {"quick": 0.96, "standard": 1.2, "full": 2.04}
#: Facets of the drums that show the difference of the rules, and seeds of each.
COARSE = (12, 24, 48)
RULES = (drums.OWN_RULE, drums.SAME_RULE)
COARSE_SEEDS: dict[kit.Tier, int] = {"full": 10}


def variants(tier: kit.Tier) -> list[kit.Variant]:
    made, duration = [], DURATION[tier]
    for seed in range(1, SEEDS[tier] + 1):
        same = drums.Drum(duration, seed, rule=drums.SAME_RULE).scene()
        own = drums.Drum(duration, seed).scene()
        made += [
            kit.Variant(f"{checks.SAME}_{seed}", same),
            kit.Variant(f"{checks.OWN}_{seed}", own, ("gpudem",)),
        ]
    for seed in range(1, COARSE_SEEDS.get(tier, 0) + 1):
        for facets in COARSE:
            if facets != drums.FACETS:
                for rule in RULES:
                    scene = drums.Drum(duration, seed, facets, rule).scene()
                    made.append(kit.Variant(coarse(facets, rule, seed), scene, ("gpudem",)))
    return made


def coarse(facets: int, rule: str, seed: int) -> str:
    """Label of a drum of so many facets."""
    if facets == drums.FACETS:
        return f"{checks.OWN if rule == drums.OWN_RULE else checks.SAME}_{seed}"
    return f"of_{facets}_{rule}_{seed}"


def _flow(results: kit.Results) -> plots.Figure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.6)
    for code in results.codes(f"{checks.SAME}_1"):
        runs = [results[label, code] for label in results.labels(code, prefix=checks.SAME)]
        rows = [drums.history(run) for run in runs]
        plots.band(left, rows[0]["time"], np.array([drums.center_angle(r) for r in rows]), code)
        index = [drums.mixed(run) for run in runs]
        plots.band(right, index[0][0], np.array([m for _, m in index]), code)
    left.set(xlabel="time [s]", ylabel="angle of the center of mass [deg]")
    right.set(xlabel="time [s]", ylabel="Lacey index [1]", ylim=(0, 1.05))
    plots.legend(left, right)
    return figure


def _bed(results: kit.Results) -> plots.Figure:
    from matplotlib.collections import EllipseCollection

    label = f"{checks.SAME}_1"
    ran = results.codes(label)
    figure, axes = plots.figure(1, 1 + len(ran), width=plots.WHOLE, height=3.6, squeeze=False)
    shown = [(ran[0], drums.LABELED, f"{drums.LABELED:g} s")]
    shown += [
        (code, DURATION[results.tier], f"{plots.name(code)}, {DURATION[results.tier]:g} s") for code in ran
    ]
    for ax, (code, time, title) in zip(axes[0], shown, strict=True):
        run = results[label, code]
        x, labels = 1e3 * run.frames.at(time)["position"], drums.halves(run)
        order = np.argsort(x[:, 1])
        size = np.full(len(x), 2e3 * drums.RADIUS)
        colors = np.where(labels, plots.SERIES[0], plots.SERIES[1])[order]
        ax.add_collection(EllipseCollection(
            size, size, 0 * size, units="x", offsets=x[order][:, [0, 2]], transOffset=ax.transData,
            facecolors=list(colors), edgecolors="white", linewidths=0.4,
        ))  # fmt: skip
        angle = drums.SPIN * time
        corner = np.linspace(0, 2 * np.pi, drums.FACETS + 1) - angle
        outer = 1e3 * drums.DRUM_RADIUS / np.cos(np.pi / drums.FACETS)
        ax.plot(outer * np.cos(corner), outer * np.sin(corner), color=plots.INK, lw=1)
        ax.set(aspect="equal", title=title, xlabel="x [mm]", ylabel="z [mm]")
    return figure


def _power(results: kit.Results) -> plots.Figure:
    one = checks.followed(results)
    rows, ledger = drums.history(one.run), one.ledger
    figure, axes = plots.figure(width=plots.WHOLE, height=3.4)
    energy = checks.mechanical(rows) + ledger.stored
    for values, name in (
        (one.work, "work of the drum"), (energy - energy[0], "change of mechanical energy and in springs"),
        (ledger.dissipated, "dissipated, summed over contacts in NumPy"),
    ):  # fmt: skip
        axes.plot(rows["time"], 1e3 * values, lw=1.3, label=name)
    axes.set(xlabel="time [s]", ylabel="energy [mJ]")
    plots.legend(axes)
    return figure


def _metrics(results: kit.Results) -> kit.Rows:
    return [
        {"rule in gpudem": rule} | row
        for a, b in codes.pairs(results.codes())
        for prefix, rule in zip((checks.OWN, checks.SAME), RULES, strict=True)
        for row in over_seeds.rows(checks.compared(results, prefix, a, b), plots.name(a), plots.name(b))
    ]


def by_rule(results: kit.Results, facets: int, rule: str) -> list[dict[str, float]]:
    """Metrics of gpudem's runs of a drum of so many facets, one a seed, as far as both rules were run."""
    seeds = range(1, COARSE_SEEDS[results.tier] + 1)
    return [checks.measures(results, coarse(facets, rule, seed), "gpudem") for seed in seeds]


def _rules(results: kit.Results) -> kit.Rows:
    rows = []
    for facets in COARSE:
        found = {rule: by_rule(results, facets, rule) for rule in RULES}
        for name in found[drums.OWN_RULE][0]:
            values = {rule: np.array([one[name] for one in found[rule]]) for rule in RULES}
            gap = values[drums.SAME_RULE] - values[drums.OWN_RULE]
            row = {"facets": facets, "metric": name}
            row |= {f'rule "{r}": mean ± standard deviation': f"{v.mean():.3g} ± {v.std(ddof=1):.2g}"
                    for r, v in values.items()}  # fmt: skip
            error = np.sqrt(sum(v.var(ddof=1) for v in values.values()) / len(gap))
            rows.append(row | {'"liggghts" less "unique"': f"{gap.mean():+.2g} ± {error:.1g}"})
    return rows


CASE = kit.Case(
    name="drum",
    title="A rotating drum",
    purpose=(
        f"{drums.COUNT} glass balls half fill a drum of {drums.FACETS} facets that turns between smooth"
        " ends that stand still. The surface settles at its dynamic angle, the two halves of the bed"
        " mix, and the drum does as much work as the balls dissipate. The flow is chaotic: two codes are"
        " compared over seeds, gpudem with its own rule of mesh contacts, unique, and with LIGGGHTS'. The"
        " torque must carry the moment of the weight about the axis. Over a window each force, the torque"
        " and the dissipated energy are summed again over contacts in NumPy."
    ),
    source="Balance of energy and of angular momentum; Lacey (1954) for the index of mixing.",
    variants=variants,
    follow_up=checks.window,
    checks=(
        checks.between(checks.OWN, drums.OWN_RULE),
        checks.between(checks.SAME, drums.SAME_RULE),
        checks.widest(
            "angle of the surface", "angle of the surface", tolerance=4.0, unit="deg",
            reason="a slice of 15 balls across has an angle per frame to about 4 degrees, a ball on the"
            " slope",
        ),
        checks.widest(
            "Lacey", "Lacey index", tolerance=0.15,
            reason="a standard deviation of 0.05 to 0.1 between seeds of some 300 balls, divided by root 5/2",
        ),
        kit.per_pair(
            "center of mass while the bed falls into the turning drum, rule \"liggghts\": largest distance in"
            f" {drums.EARLY:g} s / diameter", checks.early, tolerance=1e-9, half_step=True,
            reason="same law and rule: rounding, 1e-16 of the place, grown tenfold in each 0.02 s or so",
            catches="a facet missed or counted twice, a spring lost where the drum turns, a wrong wall"
            " velocity",
        ),
        kit.per_pair(
            f"torque of the bed on the drum, rule {drums.SAME_RULE}: largest difference in {drums.EARLY:g} s"
            " / largest torque", checks.early_torque, tolerance=1e-9, half_step=True,
            reason="places differ by 1e-12 diameters: times stiffness and radius of the drum that is"
            " 1e-11 of the torque for each of some 40 contacts",
            catches="a torque about another point, of the other sign, or without some facets",
        ),
        kit.per_code(
            "change of mechanical energy / work of the drum in the steady state, mean of the seeds, {tier}",
            checks.steady, tolerance={"quick": 0.06, "standard": 0.05, "full": 0.02}, against="steady state",
            reason="the bed hangs at 37 degrees and moves by 3 degrees, and as much in and out: the change"
            " between two moments scatters by 4 % of the work of half a turn, the mean of 5 seeds by 2 %;"
            " three standard deviations. To this torque x angular velocity is the dissipated power",
            catches="a bed that is still rising, or that slides down for lack of friction",
        ),
        kit.per_code(
            "mean torque of the drum, relative error", checks.moment, tolerance=2e-3,
            against="moment of weight + change of angular momentum",
            reason="the torque on a ball has the lever R - overlap/2 and the wall's is R - overlap:"
            " overlap/(2 drum radii), 1e-3 at 1 % of a diameter",
            catches="a contact left out of the torque or the work of a wall, a point of reference that turns",
        ),
        checks.held(
            "force on each ball at every step of the window, largest difference / largest force",
            checks.forces, tolerance=1e-9,
            reason="same states: rounding of a force, summed in the springs over a thousand steps",
            catches="a facet that counts twice or not at all, a spring lost from facet to facet",
        ),
        checks.held(
            "torque on the drum at every step of the window, largest difference / largest torque",
            checks.torque, tolerance=1e-9, reason="as for the forces",
            catches="a sign, a lever from the ball's center instead of the point of contact",
        ),
        checks.held(
            "work of the drum in the window, largest difference from the integral of torque x angular"
            " velocity / work", checks.work, tolerance=1e-9, reason="both are sums over the steps: rounding",
            catches="work with the velocity of the ball, or of another wall", against="-torque x angular"
            " velocity",
        ),
        checks.held(
            "balance of energy in the window: work - change of energy - dissipated, largest / work",
            checks.balance, tolerance=1e-3, against="energy dissipated in the dashpots and by sliding",
            reason=f"steps in which contacts begin and end err by (pi/{checks.STEPS_PER_CONTACT:.0f})^2/6 ="
            " 5e-4 of the energy of an impact",
            catches="friction that acts without dissipating, a drum that works with the wrong velocity",
        ),
    ),
    figures=(
        kit.Figure(
            "Flow over seeds",
            "Mean and range over the seeds. Left: angle at which the bed hangs. Right: mixing of the halves"
            f" from {drums.LABELED:g} s on, 1 for a random mixture.",
            _flow,
        ),
        kit.Figure(
            "The bed", "Both halves where they are told apart, and at the end.", _bed,
        ),
        kit.Figure(
            "Energy in the window",
            "The drum's work goes into the mechanical energy of the bed and into what its contacts"
            " dissipate.",
            _power,
        ),
    ),
    tables=(
        kit.Table(
            "Codes against each other",
            "Mean and standard deviation over seeds; 95 % confidence interval of the difference; p of Welch's"
            " test, and corrected for all metrics by permutation.",
            _metrics,
        ),
        kit.Table(
            "What the rule of mesh contacts changes",
            "gpudem with either rule, from the same starts; the difference with its standard error over"
            " seeds. By LIGGGHTS' rule a ball has a contact with each facet that it reaches; by rule unique"
            " it has so in the corners of 12 facets (30 degrees), and only one on finer facets, whose normals"
            " differ by less than the merge angle (21 degrees).",
            _rules, tiers=("full",), recorded=True,
        ),
    ),
    features=(
        "normal hooke", "damping", "tangential history", "rotation", "gravity", "mesh", "rotating wall",
        "wall forces", "bulk flow",
    ),
    order=52,
)  # fmt: skip
