"""Restitution under `jkr` over speed, damping, adhesion, radius and modulus: a part of `restitution_map`.

Without damping sqrt(1 - (v_s/v)^2), v_s the sticking speed; with damping by an ODE.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from comparisons import kit
from comparisons.cases.side_by_side import Spheres, every_pair, floor, traced
from comparisons.oracles.adhesion import Adhesion
from comparisons.oracles.bodies import bodies
from comparisons.report import plots
from gpudem.scene import Contact, Material, Pair, Scene

LABEL = "jkr"
#: Speed of an impact by the sticking speed of its column.
SHARES = (0.5, 0.9, 0.97, 1.03, 1.1, 1.3, 1.7, 2.5, 4.0, 8.0)
SPACING, HEIGHT = 0.008, 1e-7
TICKS = (0.5, 1, 2, 4, 8)


@dataclasses.dataclass(frozen=True)
class Column:
    """What its spheres have in common."""

    restitution: float = 1.0
    work: float = 0.2
    """[J/m2]"""
    radius: float = 1e-3
    """[m]"""
    young: float = 1e7
    """[Pa]"""

    def __str__(self) -> str:
        if self.restitution < 1:
            return f"e = {self.restitution:g}"
        return f"w = {self.work:g} J/m\u00b2, R = {1e3 * self.radius:g} mm, E = {1e-6 * self.young:g} MPa"

    @property
    def material(self) -> Material:
        """Of its spheres."""
        return Material(young=self.young, poisson=0.3, density=2500.0)


COLUMNS = (
    Column(), Column(work=0.05), Column(radius=2e-3), Column(young=4e7),
    Column(0.9), Column(0.7), Column(0.5),
)  # fmt: skip
#: Time step and length of the run [s].
STEP, DURATION = {"quick": 4e-7, "standard": 1e-7, "full": 5e-8}, 4e-3


def adhesion(scene: Scene, k: int) -> Adhesion:
    """The oracle of a column."""
    return Adhesion(bodies(scene, k * len(SHARES), "floor"), COLUMNS[k].work)


def scene(step: float) -> Scene:
    """A row of drops for each column, no gravity."""

    def built(speeds: list[float]) -> Scene:
        rows = Spheres()
        for k, (column, speed) in enumerate(zip(COLUMNS, speeds, strict=True)):
            for j, share in enumerate(SHARES):
                place = (SPACING * j, SPACING * k, column.radius + HEIGHT)
                rows.add(place, (0, 0, -share * speed), radius=column.radius, material=f"ball_{k}")
        names = [f"ball_{k}" for k in range(len(COLUMNS))]
        pairs = [
            Pair(materials=(n, "floor"), restitution=c.restitution, **{"work_of_adhesion": c.work})
            for n, c in zip(names, COLUMNS, strict=True)
        ]
        return traced(
            "adhesive_map", rows.explicit(angular_velocity=None),
            materials={n: c.material for n, c in zip([*names, "floor"], [*COLUMNS, Column()], strict=True)},
            pairs=every_pair([*names, "floor"], pairs), walls=[floor()],
            contact=Contact(normal="jkr", tangential="off"), lo=(-0.01,) * 3, hi=(0.1,) * 3,
            step=step, duration=DURATION, every=DURATION / 20,
        )  # fmt: skip

    first = built([0.01] * len(COLUMNS))
    return built([adhesion(first, k).sticking_speed for k in range(len(COLUMNS))])


def variants(tier: kit.Tier) -> list[kit.Variant]:
    return [kit.Variant(LABEL, scene(STEP[tier]), codes=("gpudem",))]


def speeds_out(results: kit.Results, k: int) -> list[float]:
    """Restitution that comes out of each drop of a column; 0 of those that stay."""
    run, found = results[LABEL, "gpudem"], []
    one = adhesion(run.scene, k)
    for j, share in enumerate(SHARES):
        row = k * len(SHARES) + j
        gap = float(run.trace["position"][-1, row, 2]) - COLUMNS[k].radius
        left = float(run.trace["velocity"][-1, row, 2]) if gap > one.gap else 0.0
        found.append(left / (share * one.sticking_speed))
    return found


def expected(results: kit.Results, k: int) -> list[float]:
    """The closed form, or the ODE of a damped column."""
    run, e = results[LABEL, "gpudem"], COLUMNS[k].restitution

    def compute() -> list[float]:
        one = adhesion(run.scene, k)
        if e == 1:
            return [math.sqrt(max(0.0, 1 - 1 / share**2)) for share in SHARES]
        constant = 2 * math.sqrt(5 / 6) * one.bodies.damping_ratio * math.sqrt(2 * one.bodies.young_star)
        return [one.restitution(s * one.sticking_speed, DURATION, constant) for s in SHARES]

    return results.once(("adhesive", k), compute)


def energy(results: kit.Results, damped: bool) -> dict[str, kit.Measured]:
    """Error of the energy of each rebound, by the energy that adhesion costs."""
    found = {}
    for k, column in enumerate(COLUMNS):
        if (column.restitution < 1) == damped:
            both = zip(speeds_out(results, k), expected(results, k), SHARES, strict=True)
            for got, want, share in both:
                off = abs(got**2 - want**2) * share**2
                found[f"{column}, {share:g} of the sticking speed"] = kit.Measured(off, got, want)
    return found


def _figure(results: kit.Results) -> plots.Figure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.8, sharey=True)
    line = np.geomspace(SHARES[0], SHARES[-1], 300)
    left.plot(line, np.sqrt(np.maximum(0, 1 - 1 / line**2)), **plots.style("oracle"))
    elastic = [k for k, column in enumerate(COLUMNS) if column.restitution == 1]
    for k in elastic:
        size = 4 + 2 * k
        look = plots.marks("gpudem", color=plots.SERIES[k], marker="o", markersize=size)
        left.plot(SHARES, speeds_out(results, k), **look, label=str(COLUMNS[k]))
    for k, column in enumerate(COLUMNS):
        if column.restitution < 1:
            color = plots.SERIES[k % len(plots.SERIES)]
            right.plot(SHARES, expected(results, k), color=color, lw=0.9, label=f"{column}, ODE")
            right.plot(SHARES, speeds_out(results, k), **plots.marks("gpudem", color=color))
    for axes in (left, right):
        axes.set(xlabel="impact speed / sticking speed without damping", xscale="log")
        axes.set_xticks(TICKS, labels=[f"{at:g}" for at in TICKS])
        axes.minorticks_off()
    left.set_ylabel("resulting restitution")
    plots.legend(left)
    plots.legend(right, points=["gpudem"])
    return figure


#: Error of the energy by that of adhesion: in proportion to the step.
TOLERANCE: dict[kit.Tier, float] = {"quick": 0.06, "standard": 0.015, "full": 0.0075}
CHECKS = (
    *kit.checks(
        "jkr without damping: largest error in energy / energy that adhesion costs",
        lambda results: energy(results, False),
        TOLERANCE, against="closed form sqrt(1 - (sticking speed / speed)^2)", needs=("gpudem",),
        reason="the forces jump where a contact begins and breaks, and a step there is not whole: at most"
        " (4/3 + 5/6) pi w R v dt, 6 % of the energy for the fastest drop in the quick tier",
        catches="a sticking speed that is not (w^5 R^4/E^2)^(1/6), a contact that breaks at touch",
    ),
    *kit.checks(
        "jkr with damping: largest error in energy / energy that adhesion costs",
        lambda results: energy(results, True),
        TOLERANCE, against="ODE", needs=("gpudem",),
        reason="the jumps, as without damping; the dashpot of first order is small beside them",
        catches="a dashpot that does not act across a gap, or not with the contact radius",
    ),
)  # fmt: skip
FIGURES = (
    kit.Figure(
        "Adhesive impacts",
        "Left, without damping: all works of adhesion, radii and moduli are on one curve, and nothing slower"
        " than the sticking speed leaves. Right: the same with damping against the ODE (lines between its"
        " points).", _figure,
    ),
)  # fmt: skip
