"""The dam break in its whole box, front and back walls included, with a reduced modulus."""

from __future__ import annotations

import itertools

import numpy as np

from comparisons import kit
from comparisons.cases import over_seeds
from comparisons.cases.dam_break import checks, figures
from comparisons.cases.dam_break import scenes as dam
from comparisons.metrics import statistics
from comparisons.report import plots, render
from gpudem.scene import Domain

LABEL = "gate_200"
RADIUS: dict[kit.Tier, float] = {"standard": 0.011, "full": dam.RADIUS}
#: Times after the opening [s] of the pictures of the paper, which are of 0.7 s and 0.9 s from the start.
PICTURES = (0.2, 0.4)
#: Height of the part of the box that pictures show [m].
SEEN = 0.32
FULL: tuple[kit.Tier, ...] = ("full",)


def variants(tier: kit.Tier) -> list[kit.Variant]:
    return [kit.Variant(LABEL, dam.Dam(radius=RADIUS[tier], slice=False).scene())]


def strips(results: kit.Results, code: str) -> np.ndarray:
    """(strips, places) heights [m] at rest, every 100 mm, of each strip."""

    def compute() -> np.ndarray:
        frame = results[LABEL, code].frames[-1]
        return dam.strip_heights(frame["position"], frame["radius"])

    return results.once(("strips", code), compute)


def smallest_p(results: kit.Results, code: str, other: str) -> kit.Measured:
    """Smallest corrected p over the places: strips of one code against strips of the other."""
    a, b = strips(results, code), strips(results, other)
    p = statistics.largest_gap(a, b)
    k = int(p.argmin())
    x, gap = 1e3 * dam.READ_AT[k], 1e3 * (a.mean(axis=0) - b.mean(axis=0))[k]
    return kit.Measured(float(p[k]), note=f"at {x:.0f} mm: difference of means {gap:.2g} mm")


def heights(results: kit.Results, code: str, other: str) -> kit.Measured:
    """Largest difference of the heights at rest [mm], read every 100 mm over the whole depth."""
    return checks.height_difference(*(dam.heights(results, LABEL, c, dam.READ_AT) for c in (code, other)))


def arrivals(results: kit.Results, code: str, other: str) -> kit.Measured:
    """Difference of the codes' times to the far wall [s]."""
    a, b = dam.arrival(results[LABEL, code]), dam.arrival(results[LABEL, other])
    return kit.Measured(abs(a - b), note=f"{a:.3f} and {b:.3f} s")


def _profiles(results: kit.Results) -> plots.Figure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.4)
    for code in results.codes():
        plots.band(left, 1e3 * dam.READ_AT, 1e3 * strips(results, code), code)
    figures.fronts(right, results, LABEL, lambda code: plots.style(code, markevery=0.05))
    left.set(xlabel="x [mm]", ylabel="height at rest [mm]")
    plots.legend(left, right)
    return figure


def _pictures(results: kit.Results) -> plots.Figure:
    views = {}
    for time, code in itertools.product((*PICTURES, None), results.codes()):
        run = results[LABEL, code]
        frame = run.frames[-1] if time is None else run.frames.at(dam.opening(run) + time)
        when = "at rest" if time is None else f"{dam.opening(run) + time:.1f} s"
        lo, (length, depth, _) = run.scene.domain.lo, run.scene.domain.hi
        box = Domain(lo=lo, hi=(length, depth, SEEN))  # the scene's is as high as its loose lattice
        views[f"{plots.name(code)}, {when}"] = (run.scene.model_copy(update={"domain": box}), frame)
    return render.side_by_side(views, time=1.0)


def _table(results: kit.Results) -> kit.Rows:
    rows = []
    for (_, code), run in results.runs.items():
        row = {
            "code": plots.name(code), "balls": len(run.scene.state), "steps": run.timing.steps,
            "column before [mm]": 1e3 * dam.bed(run)["height"], "time to the far wall [s]": dam.arrival(run),
        }  # fmt: skip
        for x, h in zip(dam.READ_AT, 1e3 * strips(results, code).T, strict=True):
            row[f"height at {1e3 * x:.0f} mm [mm]"] = f"{h.mean():.1f} ± {h.std(ddof=1):.1f}"
        rows.append(row)
    return rows


CASE = kit.Case(
    name="dam_box",
    title="Dam break in the whole box",
    purpose=(
        "The box of the experiment with its front and back walls, gate at 200 mm, modulus reduced to 5 MPa."
        " The full tier has the paper's 120 000 balls of 3 mm, shorter tiers take larger balls. A run of that"
        " size cannot be repeated over seeds here: the box is divided along its depth into eight strips, each"
        " as deep as eight balls or more (full tier), whose scatter is the scale for the difference of the"
        " codes. The case stiffness shows how the modulus changes the time to the far wall."
    ),
    source="Park, Jun, Sohn and Lee, Trans. KSME, 2014 (in Korean).",
    variants=variants,
    checks=(
        kit.per_pair(
            "heights at rest, strips of one code against the other's: smallest corrected p", smallest_p,
            lo=over_seeds.ALPHA, tolerance=1.0, tiers=FULL,
            reason="exact permutation of the largest standardized gap over ten places, no significant"
            " difference at 0.01",
            catches="a wall, friction or gate that acts otherwise than in the reference in three dimensions",
        ),
        kit.per_pair(
            "heights at rest, read every 100 mm: largest difference [mm]", heights,
            tolerance=1e3 * dam.PAPER_HEIGHT_ERROR, unit="mm", tiers=FULL,
            reason="the paper's own largest difference, experiment against simulation",
            catches="a pile of another shape",
        ),
        checks.early(
            "center of mass while the lattice falls and settles, largest distance in 0.07 s / diameter",
            axes="xyz", reason="same law, same scheme, thousands of contacts, before rounding has grown",
            catches="a contact missed or counted twice across ranks, blocks or cells",
        ),
        kit.per_pair(
            "time to the far wall, difference of the codes", arrivals, tolerance=0.05, unit="s",
            reason="the 50 ms between the paper's simulation and its experiment",
            catches="a front that friction or the side walls retard in one code only",
        ),
        checks.arrival(
            LABEL, tolerance=0.05, tiers=FULL,
            reason="friction is not printed, the modulus is reduced: the paper's own 0.05 s",
        ),
        checks.AT_REST,
    ),
    figures=(
        kit.Figure(
            "Pile at rest, and the front in time", "Left: mean and range over the strips of each code.",
            _profiles, recorded=True,
        ),
        kit.Figure(
            "From the side, as in the paper", "0.2 s and 0.4 s after the gate is removed, and at rest.",
            _pictures, recorded=True,
        ),
    ),
    tables=(
        kit.Table(
            "The whole box", "Heights: mean and standard deviation over eight strips along the depth.",
            _table, recorded=True,
        ),
    ),
    features=(
        "normal hertz", "damping", "tangential history", "rotation", "gravity", "several materials",
        "wall plane", "gate", "lattice packing", "bulk flow",
    ),
    order=51,
    tiers=("standard", "full"),
)  # fmt: skip
