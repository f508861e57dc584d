"""What both cases of heaps measure: angles, rest, and agreement of the codes at first and over seeds."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from comparisons import kit
from comparisons.cases import over_seeds
from comparisons.cases.dam_break import checks as bulk
from comparisons.cases.heaps.scenes import DIAMETER, cone_angle, profile, speed, surface_angle
from comparisons.harness import codes
from comparisons.metrics import pile, statistics
from comparisons.report import plots

#: Time [s] up to which the codes must agree ball by ball: the balls fall, and meet the tube and the floor.
EARLY = 0.04
#: Group of runs, in words -> beginning of the labels of its runs.
Groups = Mapping[str, str]


def cones(results: kit.Results, code: str, prefix: str) -> np.ndarray:
    """Angle of the cone [deg] of each run of a group."""
    return np.array([cone_angle(results[label, code]) for label in results.labels(code, prefix=prefix)])


def surfaces(results: kit.Results, code: str, prefix: str) -> np.ndarray:
    """Slope of the surface [deg] of each run of a group."""
    return np.array([surface_angle(results[label, code]) for label in results.labels(code, prefix=prefix)])


def compared(results: kit.Results, groups: Groups, code: str, other: str) -> dict[str, statistics.Comparison]:
    """Metric -> comparison of two codes over the seeds."""

    def samples(one: str) -> dict[str, np.ndarray]:
        found = {f"angle of the cone, {text} [deg]": cones(results, one, p) for text, p in groups.items()}
        for text, prefix in groups.items():
            runs = [results[label, one] for label in results.labels(one, prefix=prefix)]
            heights = [float((r.frames[-1]["position"][:, 2]).max()) for r in runs]
            found[f"height of the heap, {text} [d]"] = np.array(heights) / DIAMETER
        return found

    return results.once(("heaps", code, other), lambda: statistics.compare(samples(code), samples(other)))


def between(
    groups: Callable[[kit.Tier], Groups], seeds: Mapping[kit.Tier, int], scatter: float
) -> tuple[kit.PerPair, ...]:
    """Checks between codes: ball by ball at first, as distributions at the end. `scatter`: standard deviation
    of the angle of heaps that differ in their seed [deg].
    """
    return (
        bulk.early(
            "center of mass while the balls fall in the tube, largest distance in 0.04 s / diameter",
            axes="xyz", until=EARLY,
            reason="same law, scheme and rule of mesh contacts, before rounding has grown",
            catches="another rolling or cohesion law, a facet of the tube missed or counted twice",
        ),
        kit.per_pair(
            "smallest corrected p over all metrics: difference between codes against spread within",
            lambda results, a, b: over_seeds.smallest_p(
                compared(results, groups(results.tier), a, b), seeds[results.tier]
            ),
            lo=over_seeds.ALPHA, tolerance=1.0, tiers=kit.LONG,
            reason="exact permutation test of the largest standardized difference over all metrics (Westfall"
            " and Young), no significant difference at 0.01",
            catches="any bias of friction, rolling, cohesion or the tube beyond the scatter of seeds",
        ),
        kit.per_pair(
            "angle of the cone: largest difference of means that the seeds leave possible (95 %)",
            lambda results, a, b: over_seeds.bounds(compared(results, groups(results.tier), a, b), "cone"),
            tolerance=round(2.7 * scatter, 1), unit="deg", tiers=kit.LONG,
            reason=f"heaps differ by {scatter:g} degrees from seed to seed: with five seeds of each code 1.5"
            " times that for the interval, and 1.2 times that by chance for the difference",
            catches="too few seeds for the test above to mean anything",
        ),
    )  # fmt: skip


def moving(results: kit.Results, code: str) -> dict[str, float]:
    """Root mean square speed of the balls at the end of each run [m/s]."""
    return {label: speed(run) for label, run in results.of(code)}


def loose(results: kit.Results, code: str) -> dict[str, float]:
    """Share of the balls that are not part of the heap, of each run."""
    found = {}
    for label, run in results.of(code):
        frame = run.frames[-1]
        found[label] = 1 - float(pile.main_mass(frame["position"], frame["radius"]).mean())
    return found


def profiles(results: kit.Results, groups: Groups) -> plots.Figure:
    """Height over the distance from the axis, of the first run of each group."""
    figure, axes = plots.figure(width=plots.WHOLE, height=3.4)
    for shade, (text, prefix) in zip(plots.SERIES, groups.items(), strict=False):
        label = results.labels(prefix=prefix)[0]
        for code in results.codes(label):
            at, height = profile(results[label, code])
            look = plots.line_or_marks(code, len(at), color=shade)
            line = text if look["linestyle"] == "-" else None
            axes.plot(at / DIAMETER, height / DIAMETER, **look, label=line)
    axes.set(xlabel="distance from the axis / d", ylabel="height / d")
    axes.set_aspect("equal")
    axes.set_ylim(bottom=0)
    plots.legend(axes, lines=results.codes())
    return figure


def rows(results: kit.Results, groups: Groups) -> kit.Rows:
    """Angles of each group and code: means over the seeds, and their standard deviation."""
    return [
        {"heap": text, "code": plots.name(code),
         "angle of the cone [deg]": float(cone.mean()), "slope of the surface [deg]": float(slope.mean()),
         "standard deviation of the cone [deg]": float(cone.std(ddof=1)) if len(cone) > 1 else float("nan")}
        for text, prefix in groups.items() for code in results.codes()
        for cone, slope in [(cones(results, code, prefix), surfaces(results, code, prefix))]
        if len(cone)
    ]  # fmt: skip


def seed_rows(results: kit.Results, groups: Groups) -> kit.Rows:
    """The codes against each other over the seeds."""
    return [
        row
        for a, b in codes.pairs(results.codes())
        for row in over_seeds.rows(compared(results, groups, a, b), plots.name(a), plots.name(b))
    ]
