"""The dam break in its whole box, front and back walls included: softened, by both codes."""

from __future__ import annotations

import itertools
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from comparisons.cases.dam_break import checks as dam_checks
from comparisons.cases.dam_break import scenes as dam
from comparisons.harness.case import Case, Check, Figure, Measured, Results, Table, Tier, Variant
from comparisons.metrics import pile, statistics
from comparisons.report import plots, render
from gpudem.scene import Domain

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure as MatplotlibFigure

BOTH = ("gpudem", "liggghts")
LABEL = "gate_200"
RADIUS: dict[Tier, float] = {"standard": 0.011, "full": dam.RADIUS}
#: Strips along the depth: each is a pile of its own, their scatter the yardstick of a single run.
STRIPS = 8
#: Times after the gate goes [s] of the pictures of the paper, which are of 0.7 s and 0.9 s from the start.
PICTURES = (0.2, 0.4)
#: Height of the part of the box that pictures show [m].
SEEN = 0.32
#: As in the dam break over seeds.
ALPHA = 0.01


def variants(tier: Tier) -> list[Variant]:
    """One gate; both codes on two cores."""
    scene = dam.Dam(radius=RADIUS[tier], slice=False).scene()
    return [Variant(LABEL, scene, options={"liggghts": {"ranks": 2}}, timed=True)]


def strips(results: Results, code: str) -> np.ndarray:
    """(strips, places) heights [m] at rest, every 100 mm, each strip for itself."""
    run = results[LABEL, code]

    def compute() -> np.ndarray:
        frame = run.frames[-1]
        x, radius = frame["position"], frame["radius"]
        edges = np.linspace(0.0, dam.DEPTH, STRIPS + 1)
        rows = []
        for lo, hi in itertools.pairwise(edges):
            inside = (x[:, 1] >= lo) & (x[:, 1] < hi)
            rows.append(pile.height(x[inside], radius[inside], dam.READ_AT, (lo, hi)))
        return np.array(rows)

    return results.once(("strips", code), compute)


def smallest_p(results: Results) -> Measured:
    """Smallest corrected p over the places: strips of one code against strips of the other."""
    a, b = (strips(results, code) for code in BOTH)
    p = statistics.largest_gap(a, b)
    k = int(p.argmin())
    gap = 1e3 * (a.mean(axis=0) - b.mean(axis=0))
    return Measured(float(p[k]), note=f"at {1e3 * dam.READ_AT[k]:.0f} mm: means apart by {gap[k]:.2g} mm")


def heights(results: Results) -> Measured:
    """Largest difference of the heights at rest [mm], read every 100 mm over the whole depth."""
    a, b = (1e3 * dam.heights(results, LABEL, code, dam.READ_AT) for code in BOTH)
    k = int(np.abs(a - b).argmax())
    return Measured(
        float(abs(a - b)[k]), note=f"at {1e3 * dam.READ_AT[k]:.0f} mm: {a[k]:.1f} and {b[k]:.1f} mm"
    )


def early(results: Results) -> Measured:
    """Largest distance of the centres of mass while the lattice falls and settles / diameter."""
    ours, theirs = (results[LABEL, code].history for code in BOTH)
    soon = ours["time"].to_numpy() <= dam.EARLY
    columns = ["centre_x", "centre_y", "centre_z"]
    apart = np.linalg.norm(ours[columns].to_numpy() - theirs[columns].to_numpy(), axis=1)[soon].max()
    touched = int(ours["contacts"].to_numpy()[soon].max())
    size = 2 * float(results[LABEL, "gpudem"].scene.state.radius.max())
    return Measured(
        float(apart) / size if touched > 100 else float("nan"), note=f"{touched} contacts at once"
    )


def arrival(results: Results, code: str) -> Measured:
    """How far the time to the far wall lies outside measured .. simulated [s]."""
    time = dam.arrival(results[LABEL, code])
    off = max(dam.MEASURED_ARRIVAL - time, time - dam.PAPER_ARRIVAL, 0.0)
    return Measured(off, time, dam.MEASURED_ARRIVAL, note=f"friction {dam.BALL_FRICTION:g}, not fitted")


def arrivals(results: Results) -> Measured:
    """Difference of the codes' times to the far wall [s]."""
    a, b = (dam.arrival(results[LABEL, code]) for code in BOTH)
    return Measured(abs(a - b), note=f"{a:.3f} and {b:.3f} s")


def _profiles(results: Results) -> MatplotlibFigure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.4)
    for code in results.codes():
        rows = 1e3 * strips(results, code)
        plots.band(left, 1e3 * dam.READ_AT, rows, code)
        run = results[LABEL, code]
        time = run.history["time"] - dam.opening(run)
        right.plot(time, 1e3 * run.history["front_x"], **plots.style(code, markevery=0.05))
    right.axvline(dam.MEASURED_ARRIVAL, color="0.4", lw=0.9, ls=":", label="far wall: experiment")
    right.axvline(dam.PAPER_ARRIVAL, color="0.4", lw=0.9, ls="-.", label="far wall: paper's simulation")
    left.set(xlabel="x [mm]", ylabel="height at rest [mm]")
    right.set(
        xlabel="time since the gate went [s]", ylabel="centre of the first ball [mm]", xlim=(-0.05, None)
    )
    plots.legend(left)
    plots.legend(right)
    return figure


def _pictures(results: Results) -> MatplotlibFigure:
    views: dict[str, tuple[Any, Any]] = {}
    for time in (*PICTURES, None):
        for code in results.codes():
            run = results[LABEL, code]
            frame = run.frames[-1] if time is None else run.frames.at(dam.opening(run) + time)
            when = "at rest" if time is None else f"{dam.opening(run) + time:.1f} s"
            lo, (length, depth, _) = run.scene.domain.lo, run.scene.domain.hi
            box = Domain(lo=lo, hi=(length, depth, SEEN))  # the scene's is as high as its loose lattice
            views[f"{plots.name(code)}, {when}"] = (
                SimpleNamespace(domain=box, planes=run.scene.planes),
                frame,
            )
    return render.side_by_side(views, time=1.0)


def _table(results: Results) -> pandas.DataFrame:
    import pandas

    rows = []
    for code in results.codes():
        run, bed = results[LABEL, code], dam.bed(results[LABEL, code])
        row: dict[str, object] = {"by": plots.name(code), "balls": len(run.scene.state)}
        row |= {"steps": run.timing.steps, "stepping [s]": run.timing.stepping_s, "cores": run.timing.cores}
        row |= {"column before [mm]": 1e3 * bed["height"], "time to the far wall [s]": dam.arrival(run)}
        rows_of = 1e3 * strips(results, code)
        for x, mean, spread in zip(
            dam.READ_AT, rows_of.mean(axis=0), rows_of.std(axis=0, ddof=1), strict=True
        ):
            row[f"height at {1e3 * x:.0f} mm [mm]"] = f"{mean:.1f} ± {spread:.1f}"
        rows.append(row)
    return pandas.DataFrame(rows)


PAPER: tuple[Tier, ...] = ("full",)

CASE = Case(
    name="dam_box",
    title="The dam break in its whole box",
    purpose=(
        "The box of the experiment with its front and back walls, gate at 200 mm, softened to 5 MPa. The full"
        " tier has the paper's 120 000 balls of 3 mm, by both codes on two cores; shorter tiers take larger"
        " balls. A run of that size cannot be repeated over seeds here: the box is cut along its depth"
        " into eight strips, each as deep as eight balls or more (full tier), and the codes are held apart by"
        " the scatter of the strips. What softening changes in the time to the far wall: see the case"
        " stiffness."
    ),
    source="Park, Jun, Sohn and Lee, Trans. KSME, 2014 (in Korean).",
    variants=variants,
    checks=(
        Check(
            name="heights at rest, strips of one code against the other's: smallest corrected p",
            measure=smallest_p, lo=ALPHA, tolerance=1.0, unit="1", against="LIGGGHTS", mark="X", needs=BOTH,
            tiers=PAPER,
            reason="exact permutation of the largest standardised gap over ten places, level 0.01",
            catches="a wall, friction or gate that acts otherwise than LIGGGHTS' in three dimensions",
        ),
        Check(
            name="heights at rest, read every 100 mm: largest difference [mm]",
            measure=heights, tolerance=1e3 * dam.PAPER_HEIGHT_ERROR, unit="mm", against="LIGGGHTS", mark="X",
            needs=BOTH, tiers=PAPER,
            reason="the paper's own largest difference, experiment against simulation",
            catches="a pile of another shape",
        ),
        Check(
            name="centre of mass while the lattice falls and settles, largest distance in 0.07 s / diameter",
            measure=early, tolerance=1e-10, unit="1", against="LIGGGHTS", mark="X", needs=BOTH,
            reason="same law, same scheme, thousands of contacts, before rounding has grown",
            catches="a contact missed or made twice across ranks, blocks or cells",
        ),
        Check(
            name="time to the far wall, difference of the codes", measure=arrivals, tolerance=0.05, unit="s",
            against="LIGGGHTS", mark="X", needs=BOTH,
            reason="the 50 ms between the paper's simulation and its experiment",
            catches="a front that friction or the side walls hold back in one code alone",
        ),
        *(
            Check(
                name=f"time to the far wall: distance from 0.49 s (experiment) .. 0.54 s (paper) ({code})",
                measure=lambda results, code=code: arrival(results, code), tolerance=0.05, unit="s",
                against="Park et al. 2014", mark="P", needs=(code,), tiers=PAPER,
                reason="friction is not printed, the modulus is softened: the paper's own 0.05 s",
                catches="a gate that drags, a wall without friction, gravity or density off by 10 %",
            )
            for code in BOTH
        ),
        *(check for code in BOTH for check in dam_checks.at_rest(code)),
    ),
    figures=(
        Figure(
            "Pile at rest, and the front in time", "Left: mean and range over the strips of each code.",
            _profiles, needs=BOTH, recorded=True,
        ),
        Figure(
            "From the side, as in the paper", "0.2 s and 0.4 s after the gate went, and at rest.", _pictures,
            needs=BOTH, recorded=True,
        ),
    ),
    tables=(
        Table(
            "The whole box", "Heights: mean and standard deviation over eight strips along the depth.",
            _table, needs=BOTH, recorded=True,
        ),
    ),
    features=(
        "normal hertz", "damping", "tangential history", "rotation", "gravity", "several materials",
        "wall plane", "gate", "lattice packing", "bulk flow",
    ),
    order=51,
    tiers=("standard", "full"),
)  # fmt: skip
