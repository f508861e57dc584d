"""Are two codes the same pile? Seeds against seeds, gate by gate, and against the published numbers."""

from __future__ import annotations

import itertools

import numpy as np

from comparisons.cases.dam_break import scenes as dam
from comparisons.harness.case import Check, Measured, Results, Tier
from comparisons.metrics import pile, statistics

#: Level of the tests: runs are deterministic, so that a false alarm would stay.
ALPHA = 0.01


def seeds(results: Results, prefix: str = "seed") -> list[str]:
    """Labels of the runs that differ in their seed alone."""
    return [label for label in results.labels() if label.startswith(prefix)]


def samples(results: Results, code: str) -> dict[str, np.ndarray]:
    """Metric -> its values over the seeds of one code."""
    rows = [dam.measures(results, label, code) for label in seeds(results)]
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def apart(results: Results, label: str) -> tuple[np.ndarray, np.ndarray]:
    """(time [s], distance of the codes' centres of mass [m]) of one variant.

    In x and z: along a periodic side a centre of mass depends on the images one counts.
    """
    columns = ["centre_x", "centre_z"]
    ours, theirs = (results[label, code].history for code in ("gpudem", "liggghts"))
    if not np.array_equal(ours["step"], theirs["step"]):
        raise ValueError(f"{label}: histories of different steps")
    distance = np.linalg.norm(ours[columns].to_numpy() - theirs[columns].to_numpy(), axis=1)
    return ours["time"].to_numpy(), distance


def early(results: Results) -> Measured:
    """Largest distance of the centres of mass up to `dam.EARLY`, by a diameter; NaN if nothing touched by
    then.
    """
    found, touched = {}, []
    for label in results.labels("liggghts"):
        time, distance = apart(results, label)
        soon = time <= dam.EARLY
        touched.append(results[label, "gpudem"].history["contacts"][soon].max())
        found[label] = distance[soon].max() / (2 * results[label, "gpudem"].scene.state.radius.max())
    worst = max(found, key=lambda label: found[label])
    note = f"{len(found)} variants, at least {min(touched):g} contacts at once; largest in {worst}"
    return Measured(found[worst] if min(touched) > 0 else float("nan"), note=note)


#: What may be left of the fall in a bed after 0.3 s (quick tier) or 0.5 s: tiers, tolerance, its reason.
UNREST: tuple[tuple[tuple[Tier, ...], float, str], ...] = (
    (("quick",), 2.5e-3, "a sound bed has 0.0014 left after 0.3 s"),
    (("standard", "full"), 5e-4, "a sound bed has 0.0001 left after 0.5 s, the weakest error 0.001"),
)


def at_rest(code: str) -> list[Check]:
    """Damping and friction have brought the bed of every run to rest when the gate goes."""

    def measure(results: Results) -> Measured:
        left = {label: dam.unrest(run) for label, run in results.of(code)}
        worst = max(left, key=left.__getitem__)
        return Measured(left[worst], note=f"{len(left)} runs, most in {worst}")

    return [
        Check(
            name=f"kinetic energy when the gate goes / fall of the flow ({code})",
            measure=measure, tolerance=tolerance, unit="1", against="rest", mark="A", needs=(code,),
            tiers=tiers, reason=reason,
            catches=(
                "contacts that feed energy in: damping of the wrong sign (it leaves 0.002 to 0.07), a spring"
                " a tenth stiffer on its way out (0.001 to 0.004)"
            ),
        )
        for tiers, tolerance, reason in UNREST
    ]  # fmt: skip


def compared(results: Results) -> dict[str, tuple[statistics.Comparison, float]]:
    """Metric -> (means of gpudem and LIGGGHTS by Welch, p corrected for all metrics by the largest gap)."""

    def compute() -> dict[str, tuple[statistics.Comparison, float]]:
        ours, theirs = samples(results, "gpudem"), samples(results, "liggghts")
        p = statistics.largest_gap(*(np.array(list(s.values())).T for s in (ours, theirs)))
        return {n: (statistics.welch(ours[n], theirs[n]), float(q)) for n, q in zip(ours, p, strict=True)}

    return results.once("compared", compute)


def smallest_p(results: Results) -> Measured:
    """Smallest corrected p over the metrics: below ALPHA, the codes differ by more than their spread."""
    found = compared(results)
    name = min(found, key=lambda n: found[n][1])
    c, p = found[name]
    note = f"{len(found)} metrics, {len(seeds(results))} seeds a code; smallest at {name}:"
    spread = f"spread {c.spread[0]:.2g} and {c.spread[1]:.2g}"
    return Measured(p, note=f"{note} {c.mean[0]:.4g} and {c.mean[1]:.4g}, {spread}")


def largest_bound(results: Results, part: str) -> Measured:
    """Largest difference of means that the seeds leave possible (95 %), over the metrics whose name holds
    `part`.
    """
    found = {name: c for name, (c, _) in compared(results).items() if part in name}
    name = max(found, key=lambda n: found[n].bound)
    c = found[name]
    return Measured(c.bound, note=f"{name}: difference {c.difference:.3g} +- {c.half_width:.3g}")


def profile_p(results: Results) -> Measured:
    """Permutation p of the profiles: is a code's profile nearer to its own than to the other's?

    Statistic: mean L1 distance between codes less mean L1 distance within. Labels are exchanged in all ways
    that split the runs in two equal halves (252 for 5 + 5), so that p can fall to 0.008.
    """
    runs = [(label, code) for code in ("gpudem", "liggghts") for label in seeds(results)]
    profiles = [dam.heights(results, *key, dam.PROFILE_AT) for key in runs]
    n, half = len(runs), len(runs) // 2
    distance = np.array([[pile.profile_distance(dam.PROFILE_AT, a, b) for b in profiles] for a in profiles])

    def excess(first: tuple[int, ...]) -> float:
        mine = np.isin(np.arange(n), first)
        within = (distance[np.ix_(mine, mine)].sum() + distance[np.ix_(~mine, ~mine)].sum()) / (
            2 * half * (half - 1)
        )
        return float(distance[np.ix_(mine, ~mine)].mean() - within)

    here = excess(tuple(range(half)))
    p = np.mean([excess(c) >= here - 1e-15 for c in itertools.combinations(range(n), half)])
    across = 1e3 * distance[:half, half:].mean()
    return Measured(
        float(p), note=f"mean distance between codes {across:.2g} mm, excess over within {1e3 * here:.2g} mm"
    )


def gate_heights(results: Results, label: str) -> Measured:
    """Largest height difference between the codes [mm], read every 100 mm, at rest; single runs of each.

    A reading is the mean of the profile within 25 mm of its place, as an eye draws a line through grains: a
    slice three balls deep is 20 times thinner than the pile of the experiment, and single columns scatter
    by a ball.
    """

    def read(code: str) -> np.ndarray:
        profile = dam.heights(results, label, code, dam.PROFILE_AT)
        return np.array([profile[np.abs(dam.PROFILE_AT - x) < 0.0251].mean() for x in dam.READ_AT])

    a, b = (1e3 * read(code) for code in ("gpudem", "liggghts"))
    k = int(np.argmax(np.abs(a - b)))
    return Measured(
        float(abs(a[k] - b[k])), note=f"at {1e3 * dam.READ_AT[k]:.0f} mm: {a[k]:.1f} and {b[k]:.1f} mm"
    )


def arrivals(results: Results, code: str) -> list[tuple[float, float]]:
    """(ball friction, time to the far wall [s]) of the sweep, with the mean of the seeds in its place."""
    found: dict[float, list[float]] = {}
    for label in [*seeds(results), *seeds(results, "mu_")]:
        run = results[label, code]
        mu = next(p.friction for p in run.scene.pairs if set(p.materials) == {"polystyrene"})
        found.setdefault(mu, []).append(dam.arrival(run))
    return sorted((mu, float(np.mean(times))) for mu, times in found.items())


def friction_for(results: Results, code: str, time: float) -> Measured:
    """Ball friction at which the first ball reaches the far wall at `time` [s]: straight line through the
    sweep.
    """
    mu, times = np.array(arrivals(results, code)).T
    slope, offset = np.polyfit(mu, times, 1)
    return Measured(
        (time - offset) / slope, note=", ".join(f"{m:g}: {t:.3f} s" for m, t in zip(mu, times, strict=True))
    )


def column(results: Results, code: str, labels: list[str]) -> Measured:
    """Largest relative error of the settled column's height against the printed one."""
    rows = []
    for label in labels:
        run = results[label, code]
        gate = next(p.point[0] for p in run.scene.planes if p.name == "gate")
        rows.append((dam.bed(run)["height"], dam.GATES[gate], f"gate at {1e3 * gate:g} mm"))
    got, want, where = max(rows, key=lambda row: abs(row[0] / row[1] - 1))
    return Measured(abs(got / want - 1), got, want, note=where)
