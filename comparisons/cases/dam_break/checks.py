"""Is the pile of two codes the same? Distributions over seeds, single runs early, the published numbers."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from comparisons import kit
from comparisons.cases import over_seeds
from comparisons.cases.dam_break import scenes as dam
from comparisons.metrics import pile, statistics


def samples(results: kit.Results, code: str) -> dict[str, np.ndarray]:
    """Metric -> its values over the seeds of one code."""
    rows = [dam.measures(results, label, code) for label in results.labels(code, prefix="seed")]
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def compared(results: kit.Results, code: str, other: str) -> dict[str, statistics.Comparison]:
    """Metric -> comparison of two codes over the seeds."""
    return results.once(
        ("compared", code, other),
        lambda: statistics.compare(samples(results, code), samples(results, other)),
    )


def smallest_p(results: kit.Results, code: str, other: str) -> kit.Measured:
    """Smallest corrected p over the metrics: below ALPHA, the codes differ significantly."""
    return over_seeds.smallest_p(compared(results, code, other), len(results.labels(code, prefix="seed")))


def bound(name: str, part: str, **fields: Any) -> kit.PerPair:
    """Largest difference of means within its 95 % confidence interval, over metrics whose name has `part`."""
    return kit.per_pair(
        f"{name}: largest difference of means that the seeds leave possible (95 %)",
        lambda results, code, other: over_seeds.bounds(compared(results, code, other), part), **fields,
        catches="too few seeds, or too scattered ones, for the test above to mean anything",
    )  # fmt: skip


def profile_p(results: kit.Results, code: str, other: str) -> kit.Measured:
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
    return kit.Measured(float(p), note=note)


def height_difference(a: np.ndarray, b: np.ndarray) -> kit.Measured:
    """Largest difference of two readings at dam.READ_AT [m], in mm."""
    k = int(np.argmax(np.abs(a - b)))
    note = f"at {1e3 * dam.READ_AT[k]:.0f} mm: {1e3 * a[k]:.1f} and {1e3 * b[k]:.1f} mm"
    return kit.Measured(1e3 * float(abs(a[k] - b[k])), note=note)


def gate_heights(results: kit.Results, label: str, code: str, other: str) -> kit.Measured:
    """Largest height difference between the codes [mm], read every 100 mm, at rest; single runs of each.

    A reading is the mean of the profile within 25 mm of its place: a slice three balls deep is 20 times
    thinner than the pile of the experiment, and single columns scatter by a ball.
    """

    def read(c: str) -> np.ndarray:
        profile = dam.heights(results, label, c, dam.PROFILE_AT)
        return np.array([profile[np.abs(dam.PROFILE_AT - x) < 0.0251].mean() for x in dam.READ_AT])

    return height_difference(read(code), read(other))


def distances(
    results: kit.Results, code: str, other: str, prefix: str = "", axes: str = "xz"
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


def early(
    name: str, prefix: str = "", axes: str = "xz", until: float = dam.EARLY, **fields: Any
) -> kit.PerPair:
    """Largest distance of the centers of mass up to a time [s] / diameter; NaN where nothing touches."""

    def measure(results: kit.Results, code: str, other: str) -> kit.Measured:
        found, touched = {}, []
        for label, time, distance in distances(results, code, other, prefix, axes):
            run, soon = results[label, code], time <= until
            touched.append(int(run.history["contacts"].to_numpy()[soon].max()))
            found[label] = float(distance[soon].max() / (2 * run.scene.state.radius.max()))
        note = f"at least {min(touched)} contacts at once"
        return kit.largest(found, note) if min(touched) > 0 else kit.Measured(float("nan"), note=note)

    return kit.per_pair(name, measure, tolerance=1e-10, half_step=True, **fields)


#: Damping and friction have brought the bed of every run to rest when the gate is removed.
AT_REST = kit.per_code(
    "kinetic energy when the gate is removed / fall of the flow",
    lambda results, code: {label: dam.unrest(run) for label, run in results.of(code)},
    tolerance={"quick": 2.5e-3, "standard": 5e-4, "full": 5e-4}, against="rest",
    reason="a correct bed has 0.0014 left after 0.3 s (quick tier) and 0.0001 after 0.5 s, where the smallest"
    " defect leaves 0.001",
    catches="contacts that add energy: damping of the wrong sign (it leaves 0.002 to 0.07), a spring that is"
    " a tenth stiffer during unloading (0.001 to 0.004)",
)  # fmt: skip


def arrival(label: str, **fields: Any) -> kit.PerCode:
    """How far the time to the far wall of one variant is outside experiment .. simulation of the paper."""

    def measure(results: kit.Results, code: str) -> kit.Measured:
        time = dam.arrival(results[label, code])
        off = max(dam.MEASURED_ARRIVAL - time, time - dam.PAPER_ARRIVAL, 0.0)
        return kit.Measured(off, time, dam.MEASURED_ARRIVAL, f"friction {dam.BALL_FRICTION:g}, not fitted")

    return kit.per_code(
        "time to the far wall: distance from 0.49 s (experiment) .. 0.54 s (paper)", measure, unit="s",
        against="Park et al. 2014", mark="P",
        catches="a gate that drags, a wall without friction, gravity or density off by 10 %", **fields,
    )  # fmt: skip


def arrivals(results: kit.Results, code: str) -> list[tuple[float, float]]:
    """(ball friction, time to the far wall [s]) of the sweep, with the mean of the seeds in its place."""
    found: dict[float, list[float]] = {}
    for label in (*results.labels(code, prefix="seed"), *results.labels(code, prefix="mu_")):
        run = results[label, code]
        mu = next(p.friction for p in run.scene.pairs if set(p.materials) == {"polystyrene"})
        found.setdefault(mu, []).append(dam.arrival(run))
    return sorted((mu, float(np.mean(times))) for mu, times in found.items())


def friction_at(results: kit.Results, code: str) -> kit.Measured:
    """Ball friction at which the first ball reaches the far wall as measured: line through the sweep."""
    rows = arrivals(results, code)
    mu, times = np.array(rows).T
    slope, offset = np.polyfit(mu, times, 1)
    note = ", ".join(f"{mu:g}: {t:.3f} s" for mu, t in rows)
    return kit.Measured((dam.MEASURED_ARRIVAL - offset) / slope, note=note)


def column(results: kit.Results, code: str) -> dict[str, kit.Measured]:
    """Relative error of the settled column's height against the printed one, for each gate."""
    runs = [results[label, code] for label in results.labels(code, prefix="gate_")]
    return {
        f"gate at {1e3 * dam.gate(run):g} mm": kit.relative(dam.bed(run)["height"], dam.GATES[dam.gate(run)])
        for run in runs
    }
