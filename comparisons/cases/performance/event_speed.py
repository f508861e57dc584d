"""What an event costs in the event-driven engine: against N, against slower searches, against plain C."""

from __future__ import annotations

import statistics

import numpy as np
import pandas

from comparisons import kit
from comparisons.cases.performance import c_reference as event_speed
from comparisons.cases.performance.c_reference import SEARCHES, Search, Timed
from comparisons.report import plots

#: Number of disks -> (time to run to [s], repeats).
C_PLAN: dict[kit.Tier, dict[int, tuple[float, int]]] = {
    "quick": {300: (30.0, 3), 10_000: (1.0, 3)},
    "standard": {300: (60.0, 7), 10_000: (3.0, 5), 100_000: (0.3, 3)},
    "full": {300: (100.0, 15), 10_000: (10.0, 11), 100_000: (1.0, 7)},
}
ALL = (30, 100, 300, 1000, 3000, 10_000, 30_000, 100_000)
#: Search -> (numbers of disks, work of a run: events, or pairs looked at), repeats.
LADDER: dict[kit.Tier, tuple[dict[Search, tuple[tuple[int, ...], float]], int]] = {
    "quick": ({"tree": (ALL[:6], 1e5), "scan": (ALL[:6], 2e4), "pairs": (ALL[:4], 5e7)}, 3),
    "standard": ({"tree": (ALL, 3e5), "scan": (ALL[:6], 1e5), "pairs": (ALL[:5], 1e8)}, 3),
    "full": ({"tree": (ALL, 1e6), "scan": (ALL[:7], 5e5), "pairs": (ALL[:5], 5e8)}, 7),
}
TITLES: dict[Search, str] = {
    "tree": "tree, O(log N)", "scan": "cells only, O(N)", "pairs": "all pairs, O(N^2)"
}  # fmt: skip
WORDS: dict[Search, str] = {
    "tree": "O(log N): a match in the tree takes little time compared with a collision, up to 10 000 disks;"
    " more disks exceed the caches, and events wait for memory.",
    "scan": "O(N): 1, less where the collision itself is still a share, more beyond a cache.",
    "pairs": "O(N^2): 2, less where the collision itself is still a share.",
}
#: So many disks (some 3 MB) stay in the caches of a usual machine; beyond, an event waits for memory.
CACHED = 10_000
#: From so many disks on the slower searches are what their event costs; below, the collision itself is.
LATE: dict[Search, int] = {"scan": 1000, "pairs": 300}


def rungs(results: kit.Results) -> dict[Search, dict[int, float]]:
    return results.once("rungs", lambda: event_speed.rungs(*LADDER[results.tier]))


def beside_c(results: kit.Results) -> tuple[str, dict[int, list[tuple[Timed, Timed]]]]:
    return results.once("C", lambda: event_speed.beside_c(C_PLAN[results.tier]))


def ratios(results: kit.Results, n: int) -> list[float]:
    """Time of the engine over that of C, each repeat."""
    return [own.seconds / c.seconds for own, c in beside_c(results)[1][n]]


def same_work(results: kit.Results) -> kit.Measured:
    """Events that one program has more than the other, all sizes and repeats."""
    rows = [row for repeats in beside_c(results)[1].values() for row in repeats]
    gap = max(abs(own.height - c.height) for own, c in rows)
    off = sum(abs(own.events - c.events) + abs(own.collisions - c.collisions) for own, c in rows)
    events = sum(own.events for own, _ in rows)
    return kit.Measured(off, note=f"{events} events; mean heights at the end differ by {gap:.1g} m at most")


def same_sequence(results: kit.Results) -> kit.Measured:
    """Collisions of the first 200 that are not the same by all three searches."""
    found = results.once("sequences", event_speed.same_sequence)
    rows = list(zip(*(found[s][:200] for s in SEARCHES), strict=True))
    return kit.Measured(sum(len(set(row)) > 1 for row in rows), note=f"{len(rows)} collisions of 30 disks")


def exponent(times: dict[int, float], least: int = 0) -> float:
    """Slope of log(time per event) against log N."""
    n = np.array([k for k in times if k >= least], float)
    return float(np.polyfit(np.log(n), np.log([times[int(k)] for k in n]), 1)[0])


def logarithm(times: dict[int, float]) -> tuple[float, float]:
    """(a, b) of time per event = a + b log2 N [s]."""
    b, a = np.polyfit(np.log2(list(times)), list(times.values()), 1)
    return float(a), float(b)


def growth(results: kit.Results, search: Search) -> kit.Measured:
    times, note = rungs(results)[search], ""
    if max(times) > CACHED:
        near, far = exponent({k: v for k, v in times.items() if k <= CACHED}), exponent(times, CACHED)
        note = f"; {near:.2f} up to {CACHED}, {far:.2f} beyond, where memory is waited for"
    least = max(LATE.get(search, 0), min(times))
    return kit.Measured(exponent(times, least), note=f"N = {least} to {max(times)}{note}")


def _figure(results: kit.Results) -> plots.Figure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.8)
    for (search, times), color, mark in zip(rungs(results).items(), plots.SERIES, "os^", strict=False):
        label = f"{TITLES[search]}: N^{exponent(times, LATE.get(search, 0)):.2f}"
        micro = 1e6 * np.array(list(times.values()))
        left.plot(list(times), micro, color=color, marker=mark, ms=4, lw=1.2, label=label)
    times = rungs(results)["tree"]
    n = np.array(list(times), float)
    right.plot(n, 1e6 * np.array(list(times.values())), "o", color=plots.SERIES[0], label="tree")
    for most, style in ((CACHED, "-"), (max(times), ":")):
        a, b = logarithm({k: v for k, v in times.items() if k <= most})
        fit = f"N up to {most}: {1e6 * a:.2f} {1e6 * b:+.3f} log2 N"
        right.plot(n, 1e6 * (a + b * np.log2(n)), color="0.4", lw=1.0, ls=style, label=fit)
    left.set(xscale="log", yscale="log", xlabel="particles N", ylabel="time per event [microseconds]")
    right.set(xscale="log", xlabel="particles N", ylabel="time per event [microseconds]")
    right.set_ylim(bottom=0)
    plots.legend(left, right)
    return figure


def c_table(results: kit.Results) -> pandas.DataFrame:
    (compiler, found), rows = beside_c(results), []
    for n, repeats in found.items():
        own, c = (statistics.median(row[k].seconds for row in repeats) for k in (0, 1))
        first, quotients = repeats[0][0], ratios(results, n)
        rows.append({
            "N": n, "events": first.events,
            "gpudem, collisions per second [1e6]": first.collisions / own / 1e6,
            "C, collisions per second [1e6]": first.collisions / c / 1e6,
            "gpudem, events per second [1e6]": first.events / own / 1e6,
            "time / C": statistics.median(quotients), "smallest": min(quotients), "largest": max(quotients),
            "compiler": compiler,
        })  # fmt: skip
    return pandas.DataFrame(rows).round(3)


def ladder_table(results: kit.Results) -> pandas.DataFrame:
    micro = {f"{TITLES[s]} [microseconds per event]": times for s, times in rungs(results).items()}
    return (1e6 * pandas.DataFrame(micro).sort_index()).round(3).rename_axis("N").reset_index()


CASE = kit.Case(
    name="event_speed",
    title="Cost of an event",
    purpose=(
        "The source finds the next collision in three ways: among all pairs, by cells and a loop over all"
        " particles, and by cells and a tournament tree. Here all three are Warp kernels with the same rules"
        " and compiler, on one core, and find the same events; the cost of an event grows differently with N."
        " The engine, which is the third, is also timed beside a C program of the same algorithm, our own, in"
        " three dimensions as the engine is: a program for disks only would have less to do."
    ),
    source="Qiita article on fast simulation of rigid spheres (2019); comparisons/data/hard_spheres.c.",
    variants=lambda tier: [],
    checks=(
        kit.Check(
            name="first 200 collisions that differ between the three searches", measure=same_sequence,
            tolerance=0, unit="collisions", against="all pairs", mark="A", needs=(),
            reason="exact, before chaos multiplies rounding",
            catches="a search that is faster because it misses events",
        ),
        kit.Check(
            name="events and collisions of the engine and of C, difference", measure=same_work, tolerance=0,
            unit="events", against="plain C", mark="X", needs=(),
            reason="the same arithmetic in the same order, to the last bit",
            catches="a timing of two programs that do not do the same work; an error of rule, cell or tree"
            " that is in only one of them",
        ),
    ),
    findings=(
        *(
            kit.Finding(
                f"{TITLES[search]}: exponent of the time per event against N{', late' * (search in LATE)}",
                lambda r, search=search: growth(r, search), "1", WORDS[search], (),
            )
            for search in SEARCHES
        ),
        *(
            kit.Finding(
                f"time of the engine / time of C, N = {n}", lambda r, n=n: kit.median(ratios(r, n)), "1",
                "Median of repeats in turn, the same algorithm in plain C with -O2; the target is 1.5.", (),
            )
            for n in (300, 10_000)
        ),
    ),
    figures=(
        kit.Figure(
            "Time per event against N",
            "Left: the three searches, least of the repeats; an event of all pairs is a collision, those of"
            " the others are also crossings of cells and outdated predictions. Right: the tree only, on a"
            " linear axis, and a + b log2 N, fitted to the disks that stay in the caches (full; some 300"
            " bytes each) and to all (dotted). Beyond the caches an event waits for memory, whatever the"
            " search.",
            _figure, needs=(),
        ),
    ),
    tables=(
        kit.Table(
            "Engine and plain C", "One core each, one right after the other; medians.", c_table, needs=()
        ),
        kit.Table("Time per event", "One core; the same rules, the same compiler.", ladder_table, needs=()),
    ),
    features=("event-driven", "speed"),
    order=91,
    timed=True,
)  # fmt: skip
