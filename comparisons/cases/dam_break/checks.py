"""Is the pile of two codes the same? Distributions over seeds, single runs before rounding has grown, and the
published numbers.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from comparisons.cases.dam_break import scenes as dam
from comparisons.harness.case import Measured, PerCode, PerPair, Results, Tier, largest, relative
from comparisons.harness.check_builders import per_code, per_pair
from comparisons.metrics import pile, statistics

#: Significance level of the tests: runs are deterministic, so that a false alarm would stay.
ALPHA = 0.01
#: Kinetic energy that may be left in a bed after 0.3 s (quick tier) or 0.5 s: tiers, tolerance, its reason.
UNREST: tuple[tuple[tuple[Tier, ...], float, str], ...] = (
    (("quick",), 2.5e-3, "a correct bed has 0.0014 left after 0.3 s"),
    (("standard", "full"), 5e-4, "a correct bed has 0.0001 left after 0.5 s, the smallest defect 0.001"),
)


def samples(results: Results, code: str) -> dict[str, np.ndarray]:
    """Metric -> its values over the seeds of one code."""
    rows = [dam.measures(results, label, code) for label in results.labels(code, prefix="seed")]
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def compared(results: Results, code: str, other: str) -> dict[str, tuple[statistics.Comparison, float]]:
    """Metric -> (means of two codes by Welch, p corrected for all metrics by the largest gap)."""

    def compute() -> dict[str, tuple[statistics.Comparison, float]]:
        a, b = samples(results, code), samples(results, other)
        p = statistics.largest_gap(*(np.array(list(s.values())).T for s in (a, b)))
        return {n: (statistics.welch(a[n], b[n]), float(q)) for n, q in zip(a, p, strict=True)}

    return results.once(("compared", code, other), compute)


def smallest_p(results: Results, code: str, other: str) -> Measured:
    """Smallest corrected p over the metrics: below ALPHA, the codes differ significantly."""
    found = compared(results, code, other)
    name = min(found, key=lambda n: found[n][1])
    c, p = found[name]
    seeds = len(results.labels(code, prefix="seed"))
    note = f"{len(found)} metrics, {seeds} seeds per code; smallest at {name}:"
    spread = f"standard deviations {c.spread[0]:.2g} and {c.spread[1]:.2g}"
    return Measured(p, note=f"{note} {c.mean[0]:.4g} and {c.mean[1]:.4g}, {spread}")


def bound(name: str, part: str, tolerance: float, reason: str, **fields: Any) -> PerPair:
    """Largest difference of means within its 95 % confidence interval, over metrics whose name has `part`."""

    def measure(results: Results, code: str, other: str) -> Measured:
        found = {n: c for n, (c, _) in compared(results, code, other).items() if part in n}
        interval = {n: f"difference {c.difference:.3g} +- {c.half_width:.3g}" for n, c in found.items()}
        return largest({n: Measured(c.bound, note=interval[n]) for n, c in found.items()})

    return per_pair(
        name, measure, tolerance=tolerance, reason=reason,
        catches="too few seeds, or too scattered ones, for the test above to mean anything", **fields,
    )  # fmt: skip


def profile_p(results: Results, code: str, other: str) -> Measured:
    """Permutation p of the profiles: is a code's profile nearer to its own than to the other's?

    Statistic: mean L1 distance between codes less mean L1 distance within. Labels are exchanged in all ways
    that split the runs in two equal halves (252 for 5 + 5), so that p can fall to 0.008.
    """
    runs = [(label, c) for c in (code, other) for label in results.labels(code, other, prefix="seed")]
    profiles = [dam.heights(results, *key, dam.PROFILE_AT) for key in runs]
    n, half = len(runs), len(runs) // 2
    distance = np.array([[pile.profile_distance(dam.PROFILE_AT, a, b) for b in profiles] for a in profiles])

    def excess(first: Sequence[int]) -> float:
        mine = np.isin(np.arange(n), first)
        within = distance[np.ix_(mine, mine)].sum() + distance[np.ix_(~mine, ~mine)].sum()
        return float(distance[np.ix_(mine, ~mine)].mean() - within / (2 * half * (half - 1)))

    here = excess(range(half))
    p = np.mean([excess(c) >= here - 1e-15 for c in itertools.combinations(range(n), half)])
    across = 1e3 * distance[:half, half:].mean()
    note = f"mean distance between codes {across:.2g} mm, excess over within {1e3 * here:.2g} mm"
    return Measured(float(p), note=note)


def height_difference(a: np.ndarray, b: np.ndarray) -> Measured:
    """Largest difference of two readings at dam.READ_AT [m], in mm."""
    k = int(np.argmax(np.abs(a - b)))
    note = f"at {1e3 * dam.READ_AT[k]:.0f} mm: {1e3 * a[k]:.1f} and {1e3 * b[k]:.1f} mm"
    return Measured(1e3 * float(abs(a[k] - b[k])), note=note)


def gate_heights(results: Results, label: str, code: str, other: str) -> Measured:
    """Largest height difference between the codes [mm], read every 100 mm, at rest; single runs of each.

    A reading is the mean of the profile within 25 mm of its place: a slice three balls deep is 20 times
    thinner than the pile of the experiment, and single columns scatter by a ball.
    """

    def read(c: str) -> np.ndarray:
        profile = dam.heights(results, label, c, dam.PROFILE_AT)
        return np.array([profile[np.abs(dam.PROFILE_AT - x) < 0.0251].mean() for x in dam.READ_AT])

    return height_difference(read(code), read(other))


def distances(
    results: Results, code: str, other: str, prefix: str = "", axes: str = "xz"
) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """(label, times [s], distance of the centers of mass of two codes [m]) of the variants that both ran.

    In x and z: along a periodic side a center of mass depends on the images that are counted.
    """
    columns = [f"centre_{axis}" for axis in axes]
    for label in results.labels(code, other, prefix=prefix):
        a, b = results[label, code].history, results[label, other].history
        if not np.array_equal(a["step"], b["step"]):
            raise ValueError(f"{label}: histories of different steps")
        distance = np.linalg.norm(a[columns].to_numpy() - b[columns].to_numpy(), axis=1)
        yield label, a["time"].to_numpy(), distance


def early(name: str, prefix: str = "", axes: str = "xz", until: float = dam.EARLY, **fields: Any) -> PerPair:
    """Largest distance of the centers of mass up to a time [s] / diameter; NaN where nothing touches."""

    def measure(results: Results, code: str, other: str) -> Measured:
        found, touched = {}, []
        for label, time, distance in distances(results, code, other, prefix, axes):
            run, soon = results[label, code], time <= until
            touched.append(int(run.history["contacts"].to_numpy()[soon].max()))
            found[label] = float(distance[soon].max() / (2 * run.scene.state.radius.max()))
        note = f"at least {min(touched)} contacts at once"
        return largest(found, note) if min(touched) > 0 else Measured(float("nan"), note=note)

    return per_pair(name, measure, tolerance=1e-10, half_step=True, **fields)


def at_rest() -> tuple[PerCode, ...]:
    """Damping and friction have brought the bed of every run to rest when the gate is removed."""
    return tuple(
        per_code(
            "kinetic energy when the gate is removed / fall of the flow",
            lambda results, code: largest({label: dam.unrest(run) for label, run in results.of(code)}),
            tolerance=tolerance, against="rest", tiers=tiers, reason=reason,
            catches="contacts that add energy: damping of the wrong sign (it leaves 0.002 to 0.07), a spring"
            " a tenth stiffer on its way out (0.001 to 0.004)",
        )
        for tiers, tolerance, reason in UNREST
    )  # fmt: skip


def arrival(label: str, **fields: Any) -> PerCode:
    """How far the time to the far wall of one variant is outside experiment .. simulation of the paper."""

    def measure(results: Results, code: str) -> Measured:
        time = dam.arrival(results[label, code])
        off = max(dam.MEASURED_ARRIVAL - time, time - dam.PAPER_ARRIVAL, 0.0)
        return Measured(off, time, dam.MEASURED_ARRIVAL, note=f"friction {dam.BALL_FRICTION:g}, not fitted")

    return per_code(
        "time to the far wall: distance from 0.49 s (experiment) .. 0.54 s (paper)", measure, unit="s",
        against="Park et al. 2014", mark="P",
        catches="a gate that drags, a wall without friction, gravity or density off by 10 %", **fields,
    )  # fmt: skip


def arrivals(results: Results, code: str) -> list[tuple[float, float]]:
    """(ball friction, time to the far wall [s]) of the sweep, with the mean of the seeds in its place."""
    found: dict[float, list[float]] = {}
    for label in (*results.labels(code, prefix="seed"), *results.labels(code, prefix="mu_")):
        run = results[label, code]
        mu = next(p.friction for p in run.scene.pairs if set(p.materials) == {"polystyrene"})
        found.setdefault(mu, []).append(dam.arrival(run))
    return sorted((mu, float(np.mean(times))) for mu, times in found.items())


def friction_at(results: Results, code: str) -> Measured:
    """Ball friction at which the first ball reaches the far wall as measured: line through the sweep."""
    rows = arrivals(results, code)
    mu, times = np.array(rows).T
    slope, offset = np.polyfit(mu, times, 1)
    note = ", ".join(f"{mu:g}: {t:.3f} s" for mu, t in rows)
    return Measured((dam.MEASURED_ARRIVAL - offset) / slope, note=note)


def column(results: Results, code: str) -> Measured:
    """Largest relative error of the settled column's height against the printed one, over the gates."""
    found = {}
    for label in results.labels(code, prefix="gate_"):
        run = results[label, code]
        place, height = dam.gate(run), dam.bed(run)["height"]
        found[f"gate at {1e3 * place:g} mm"] = relative(height, dam.GATES[place])
    return largest(found)
