"""Balls of two sizes are poured into a box: the same balls in every code, and the bed that they make."""

from __future__ import annotations

import numpy as np

from comparisons import kit
from comparisons.cases import over_seeds
from comparisons.cases.insertion import scenes
from comparisons.harness import codes
from comparisons.metrics import statistics
from comparisons.report import plots
from gpudem.output.run import Run

#: Labels of the run that is compared ball by ball, and of the pourings.
EARLY, SEED = "early", "seed"
DIAMETER = 2 * scenes.LARGE


def variants(tier: kit.Tier) -> list[kit.Variant]:
    rows = {"trace_every": scenes.ROW, "history_every": scenes.ROW}
    frames = {"frames_every": 0.02, "history_every": scenes.ROW}
    return [
        kit.Variant(EARLY, scenes.scene("quick", 1, scenes.EARLY, **rows)),
        *(
            kit.Variant(f"{SEED}_{seed}", scenes.scene(tier, seed, scenes.DURATION[tier], **frames))
            for seed in range(1, scenes.SEEDS[tier] + 1)
        ),
    ]


def arrived(run: Run) -> np.ndarray:
    """The row of the trace in which each ball is there first, (n,)."""
    assert run.trace is not None
    return np.isfinite(run.trace["position"][:, :, 0]).argmax(axis=0)


def positions(run: Run) -> np.ndarray:
    """Of every row; 0 before a ball comes, which `places` holds both codes to."""
    assert run.trace is not None
    return np.nan_to_num(run.trace["position"])


def places(results: kit.Results, code: str) -> dict[str, float]:
    """Largest distance of a ball from where the scene states it, in the row of its step / diameter."""
    run = results[EARLY, code]
    assert run.trace is not None
    rows, scene = arrived(run), run.scene
    if len(set(rows.tolist())) < 2 or (run.trace["step"][rows] != scene.arrival_steps).any():
        return {EARLY: float("nan")}
    found = run.trace["position"][rows, np.arange(len(rows))]
    return {EARLY: float(np.linalg.norm(found - scene.state.position, axis=1).max()) / DIAMETER}


def few_contacts(run: Run) -> str:
    """Why a run would not show what it should."""
    assert run.history is not None
    most = float(run.history["contacts"].to_numpy().max())
    return "hardly any contacts" if most < len(run.scene.state) / 4 else ""


def at_rest(results: kit.Results, code: str) -> dict[str, float]:
    """Kinetic energy of a ball at the end / that of a fall through a tenth of a small radius, of each run."""
    found = {}
    for label in results.labels(code, prefix=SEED):
        run = results[label, code]
        assert run.history is not None
        fall = float(run.scene.masses.sum()) * scenes.GRAVITY * 0.1 * scenes.SMALL
        energy = run.history["kinetic_energy"].to_numpy()
        found[label] = float(energy[-1]) / fall if energy.max() > 100 * fall else float("nan")
    return found


def compared(results: kit.Results, code: str, other: str) -> dict[str, statistics.Comparison]:
    """Metric -> comparison of two codes over the seeds."""

    def samples(who: str) -> dict[str, np.ndarray]:
        found = [scenes.metrics(results[label, who]) for label in results.labels(code, other, prefix=SEED)]
        return {name: np.array([one[name] for one in found]) for name in found[0]}

    return results.once(("compared", code, other), lambda: statistics.compare(samples(code), samples(other)))


def mean_of(name: str):
    """A measure: mean over the seeds of a metric of a code."""

    def measure(results: kit.Results, code: str) -> kit.Measured:
        found = [scenes.metrics(results[label, code])[name] for label in results.labels(code, prefix=SEED)]
        return kit.Measured(
            float(np.mean(found)), note=f"{len(found)} seeds, standard deviation {np.std(found):.2g}"
        )

    return measure


def _bed(results: kit.Results) -> plots.Figure:
    from matplotlib.collections import EllipseCollection

    label = f"{SEED}_1"
    ran, width = results.codes(label), 1e3 * scenes.WIDTH[results.tier]
    shown = [(ran[0], 0.0), (ran[0], 0.06), *((code, scenes.DURATION[results.tier]) for code in ran)]
    figure, axes = plots.figure(1, len(shown), width=plots.WHOLE, height=4.2, squeeze=False)
    for ax, (code, time) in zip(axes[0], shown, strict=True):
        run = results[label, code]
        frame = run.frames.at(time or 0.02)
        x, radius = 1e3 * frame["position"], 1e3 * frame["radius"]
        order = np.argsort(-x[:, 1])
        colors = np.where(radius > 2.7, plots.SERIES[0], plots.SERIES[1])[order]
        ax.add_collection(EllipseCollection(
            2 * radius[order], 2 * radius[order], 0 * radius, units="x", offsets=x[order][:, [0, 2]],
            transOffset=ax.transData, facecolors=list(colors), edgecolors="white", linewidths=0.3,
        ))  # fmt: skip
        height = 1e3 * scenes.HEIGHT[results.tier]
        ax.plot([0, 0, width, width], [height, 0, 0, height], color=plots.INK, lw=1)
        ax.set(aspect="equal", title=f"{plots.name(code)}, {time or 0.02:g} s", xlabel="x [mm]")
    axes[0, 0].set_ylabel("z [mm]")
    return figure


def _course(results: kit.Results) -> plots.Figure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.4)
    for code in results.codes(f"{SEED}_1"):
        runs = [results[label, code].history for label in results.labels(code, prefix=SEED)]
        histories = [h for h in runs if h is not None]
        time = histories[0]["time"].to_numpy()
        energy = np.array([1e3 * h["kinetic_energy"].to_numpy() for h in histories])
        plots.band(left, time, energy, code)
        plots.band(right, time, np.array([h["contacts"].to_numpy() for h in histories]), code)
    left.set(xlabel="time [s]", ylabel="kinetic energy [mJ]")
    right.set(xlabel="time [s]", ylabel="contacts of balls and with walls")
    plots.legend(left, right)
    return figure


def _table(results: kit.Results) -> kit.Rows:
    return [
        row
        for a, b in codes.pairs(results.codes())
        for row in over_seeds.rows(compared(results, a, b), plots.name(a), plots.name(b))
    ]


CHECKS = (
    kit.per_code(
        "place of each ball in the step of its insertion, largest distance from the stated one / diameter",
        places, tolerance=1e-14, against="the list of the scene",
        reason="a place in a block of half a radius is rounded once more, 1e-17 m of 30 mm",
        catches="an insertion of another step, balls in another order, a place drawn again by a code",
    ),
    kit.step_by_step(
        "position while the balls fall and first collide, largest difference / diameter", "position",
        lambda run: DIAMETER, prefix=EARLY, defect=few_contacts, read=positions, tolerance=1e-7, unit="1",
        reason="same law, scheme and balls: rounding of 1e-13 when the first balls reach the floor grows by"
        " 1e4 in the 0.02 s of collisions; 100 times as much is left for another order of sums",
        catches="other velocities of inserted balls, springs lost or a kick doubled when others come",
    ),
    kit.per_code(
        "kinetic energy of a ball at the end / that of a fall through a tenth of a small radius, largest",
        at_rest, tolerance=1.0, against="rest",
        reason="what still moves lifts or sinks the bed by less than a hundredth of its height",
        catches="measures of a bed that still falls, balls that never fell",
    ),
    kit.per_code(
        "packing fraction of the bed, mean of the seeds", mean_of("packing fraction [1]"), lo=0.5,
        tolerance=0.66, against="poured beds",
        reason="random loose to random close packing of equal spheres is 0.555 to 0.64; side walls five"
        " diameters apart take up to 0.05 off, two sizes add up to 0.02",
        catches="a bed that is compressed by overlaps, or loose for lack of gravity",
    ),
    kit.per_code(
        "coordination with walls, mean of the seeds", mean_of("coordination, with walls [1]"), lo=3.5,
        tolerance=6.0, against="isostatic packings",
        reason="4 for rough, 6 for smooth spheres at rest; a few balls of the surface have 3",
        catches="contacts that do not carry, balls held by large overlaps",
    ),
    kit.per_pair(
        "smallest corrected p over all metrics: difference between codes against spread within",
        lambda results, a, b: over_seeds.smallest_p(compared(results, a, b), scenes.SEEDS[results.tier]),
        lo=over_seeds.ALPHA, tolerance=1.0,
        reason="exact permutation test of the largest standardized difference over all metrics (Westfall and"
        " Young), no significant difference at 0.01; pourings are chaotic after the first collisions",
        catches="any bias of friction, damping or insertion beyond the scatter of seeds",
    ),
    kit.per_pair(
        "packing fraction: largest difference of means that the seeds leave possible (95 %)",
        lambda results, a, b: over_seeds.bounds(compared(results, a, b), "packing fraction"),
        tolerance=0.02, unit="1",
        reason="beds of some 200 balls scatter by 0.005: 0.008 for the interval of five seeds, and as much"
        " by chance for the difference",
        catches="too few seeds for the test above to mean anything",
    ),
)  # fmt: skip

CASE = kit.Case(
    name="filling",
    title="Two sizes poured into a box",
    purpose=(
        "Balls of 6 mm and balls of about 4 mm, half of the mass each, are inserted at random places of the"
        " upper part of a box, in a few fillings, and fall. The list of insertions is drawn before the run"
        " and is the same in every code, so that the codes are compared ball by ball until rounding has"
        " grown, and by the bed over seeds afterwards: packing fraction, coordination, contacts between the"
        " sizes, segregation by height."
    ),
    source="Random packings: Scott and Kilgour (1969), Onoda and Liniger (1990), Silbert et al. (2002)",
    variants=variants,
    checks=CHECKS,
    figures=(
        kit.Figure(
            "The pouring", "First seed: after the first filling, after the second, and the bed of each code.",
            _bed, recorded=True,
        ),
        kit.Figure(
            "Course", "Mean and range of the seeds; the second filling adds energy at 0.05 s.", _course,
            recorded=True,
        ),
    ),
    tables=(
        kit.Table(
            "Codes against each other", "Over seeds; p corrected for all metrics by permutation.", _table,
            recorded=True,
        ),
    ),
    features=(
        "normal hertz", "damping", "tangential history", "rotation", "gravity", "several radii", "wall plane",
        "insertion",
    ),
    order=56,
)  # fmt: skip
