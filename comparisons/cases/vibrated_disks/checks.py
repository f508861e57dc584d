"""Checks, figure and table of the vibrated disks as soft spheres against hard ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from comparisons.cases.vibrated_disks.scenes import CODE, STEADY, approach, label, late, steady
from comparisons.harness.case import Check, Figure, Measured, Results, Table, Tier
from comparisons.report import plots

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure as MatplotlibFigure

STEADY_RUN = (STEADY, CODE)
NEEDS = (CODE, "gpudem")
#: Contact times [s] up to which a disk is in contact a tenth of the time at most.
SHORT, ALL = 1e-2, 1.0
#: Length of run that costs are stated for [s].
LENGTH = 200.0


def floor_power(results: Results) -> float:
    """N m g U [W] of the scene."""
    scene = results[label(1e-2), "gpudem"].scene
    speed = max(plane.speed for plane in scene.planes)
    return float(scene.masses.sum()) * -scene.gravity[2] * speed


def largest_power(results: Results, lost: bool) -> Measured:
    """Largest error of the floor's mean power, or of what of it is lost, over the soft runs."""
    want, runs = floor_power(results), steady(results)[1]
    got = [s.power - (s.growth if lost else 0.0) for s in runs]
    worst = max(got, key=lambda p: abs(p / want - 1))
    note = ", ".join(f"{s.contact_time:g} s: {p:.3f} W" for s, p in zip(runs, got, strict=True))
    return Measured(abs(worst / want - 1), worst, want, note)


def excess(results: Results) -> Measured:
    """By how much the kinetic energy exceeds that of hard disks, at a contact time of 0.01 s."""
    found = approach(results, "kinetic")
    k = int(np.argmin(abs(found.contact_times - 1e-2)))
    return Measured(float(found.excess[k]), note=f"standard error {found.errors[k]:.2g}")


def slope_error(results: Results, name: str, longest: float) -> Measured:
    """Exponent of the error over contact time, up to one."""
    got, error = approach(results, name).up_to(longest).slope()
    return Measured(abs(got - 1), got, 1.0, f"standard error {error:.2g}")


def limit_error(results: Results, name: str, scaled: bool) -> Measured:
    """Distance of the Richardson value from that of hard disks, by it or in standard errors."""
    got, error = approach(results, name).limit()
    return Measured(abs(got) / error if scaled else abs(got), note=f"{got:+.5f}, standard error {error:.2g}")


def collisions(results: Results) -> float:
    """Collisions of hard disks by disk and second, with disks and floor, each counted once."""
    run = results[STEADY_RUN]
    rows = late(run, 0.0)
    return float(rows["collisions"][-1] / rows["time"][-1]) / run.timing.particles


def contacts(results: Results) -> Measured:
    """Contacts a disk of the hardest soft run by collisions of hard disks in a contact time."""
    hardest = steady(results)[1][0]
    want = collisions(results) * hardest.contact_time
    return Measured(abs(hardest.contacts / want - 1), hardest.contacts, want)


def _approach(results: Results) -> MatplotlibFigure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.8)
    hard, soft = steady(results)
    for name, text, color in (("kinetic", "kinetic energy", "#0072b2"), ("height", "mean height", "#cc79a7")):
        found = approach(results, name)
        size, error = abs(found.excess), np.hypot(found.errors, found.hard_error)
        below = np.minimum(error, 0.9 * size)  # a bar down to zero has no place on a logarithmic axis
        left.errorbar(found.contact_times, size, yerr=(below, error), fmt="o", color=color, ms=5, capsize=2,
                      label=text)  # fmt: skip
        times = found.contact_times
        left.plot(times, size[-1] * times / times[-1], color=color, lw=0.9, ls="--")
        cost = np.array([s.seconds for s in soft]) * LENGTH
        right.errorbar(cost, size, yerr=(below, error), fmt="o-", color=color, ms=5, lw=0.9, capsize=2,
                       label=f"soft, {text}")  # fmt: skip
        right.plot([hard.seconds * LENGTH], [found.hard_error * np.sqrt(hard.duration / LENGTH)], "s",
                   color=color, mfc="none", label=f"event-driven, {text}: scatter alone")  # fmt: skip
    left.set(xscale="log", yscale="log", xlabel="contact time at 0.5 m/s [s]",
             ylabel="|soft / event-driven - 1|")  # fmt: skip
    left.set_xticks(times, [f"{t:g}" for t in times], minor=False)
    left.set_xticks([], minor=True)
    right.set(xscale="log", yscale="log", xlabel=f"run time of {LENGTH:g} s [s]", ylabel="error")
    plots.legend(left)
    plots.legend(right)
    return figure


def _table(results: Results) -> pandas.DataFrame:
    import pandas

    hard, soft = steady(results)
    kinetic, height = approach(results, "kinetic"), approach(results, "height")
    rate, want = collisions(results), floor_power(results)
    rows = []
    for k, s in enumerate([hard, *soft]):
        scene = results[label(s.contact_time), "gpudem"].scene if k else None
        error_k = kinetic.errors[k - 1] if k else kinetic.hard_error
        error_h = height.errors[k - 1] if k else height.hard_error
        rows.append({
            "contact time [s]": s.contact_time,
            "Young's modulus [Pa]": scene.materials["disk"].young if scene else float("nan"),
            "averaged over [s]": s.duration,
            "kinetic energy a disk [J]": s.kinetic,
            "standard error [%]": 100 * error_k,
            "mean height [m]": s.height,
            "standard error of it [%]": 100 * error_h,
            "contacts / (collisions x contact time)":
                s.contacts / (rate * s.contact_time) if k else float("nan"),
            "power of the floor / (N m g U)": s.power / want,
            f"run time of {LENGTH:g} s [s]": s.seconds * LENGTH,
        })  # fmt: skip
    return pandas.DataFrame(rows)


LONG: tuple[Tier, ...] = ("standard", "full")
FULL: tuple[Tier, ...] = ("full",)
CHECKS = (
    *(
        Check(
            name=f"soft disks: {name} / (N m g U), largest error",
            measure=lambda results, lost=lost: largest_power(results, lost),
            tolerance=0.004, unit="1", against="momentum balance: the floor carries the weight", mark="A",
            needs=NEEDS, catches=catches,
            reason="the speed of the centre of mass scatters by 0.02 m/s: 0.0009 of the weight in 30 s",
        )
        for name, lost, catches in (
            ("power of the floor", False, "a floor that pushes otherwise than it counts; contacts it loses"),
            ("power less growth of energy", True, "energy from rebuilds, springs or a floor that snaps back"),
        )
    ),
    Check(
        name="soft disks of 0.01 s: kinetic energy / event-driven - 1", measure=excess, lo=0.07,
        tolerance=0.11, unit="1", against="another soft solver, in C, not kept here: 0.089", mark="X",
        needs=NEEDS,
        reason="two runs of 40 s and more scatter by 0.007 each",
        catches="soft disks that are as hard ones: a run that is not soft; restitution off by 0.005",
    ),
    Check(
        name="soft disks: contacts a disk / (collisions of hard disks x contact time), error",
        measure=contacts, tolerance=0.1, unit="1", against="event-driven", mark="X", needs=NEEDS, tiers=LONG,
        reason="contacts last as speed^(-1/5), 2^(2/5) longer on the floor; who is in one meets fewer",
        catches="contacts counted twice; a stiffness other than stated",
    ),
    *(
        Check(
            name=f"soft disks: {text}, |slope of the error over contact time{where} - 1|",
            measure=lambda results, name=name, longest=longest: slope_error(results, name, longest),
            tolerance=0.15, unit="1", against="first order in contact time: error ~ E^(-2/5)", mark="A",
            needs=NEEDS, tiers=tiers, reason=reason,
            catches="an error that does not go with stiffness: a floor or law not that of the limit",
        )
        for name, text, longest, where, tiers, reason in (
            ("kinetic", "kinetic energy", ALL, "", LONG, "next order: 0.1 at a contact time of 0.03 s"),
            (
                "kinetic", "kinetic energy", SHORT, " up to 0.01 s", FULL,
                "five standard errors; beyond it a disk is in contact a third of the time: no small error",
            ),
            (
                "height", "mean height", SHORT, " up to 0.01 s", FULL,
                "one and a half standard errors: an error of 1 % of the height against its scatter of 0.05 %",
            ),
        )
    ),
    *(
        Check(
            name=f"soft disks: {text} at contact time 0 from event-driven, in standard errors",
            measure=lambda results, name=name: limit_error(results, name, True), tolerance=3.0, unit="1",
            against="event-driven", mark="X", needs=NEEDS, tiers=LONG,
            reason="chance: 1 in 370", catches="soft and hard disks that do not state the same scene",
        )
        for name, text in (("kinetic", "kinetic energy"), ("height", "mean height"))
    ),
    *(
        Check(
            name=f"soft disks: {text} at contact time 0 / event-driven - 1",
            measure=lambda results, name=name: limit_error(results, name, False), tolerance=0.003,
            unit="1", against="event-driven", mark="X", needs=NEEDS, tiers=FULL,
            reason="two standard errors of the fit or more",
            catches="the same, in figures: soft and hard disks that do not state the same scene",
        )
        for name, text in (("kinetic", "kinetic energy"), ("height", "mean height"))
    ),
)  # fmt: skip
FIGURES = (
    Figure(
        "Soft disks tend to hard ones",
        "Left: the error of soft disks over their contact time, with standard errors, and lines of slope 1."
        " Right: the same error over what 200 s of the scene cost; squares: event-driven, whose only error is"
        " the scatter of a run of 200 s.",
        _approach, needs=NEEDS, recorded=True,
    ),
)  # fmt: skip
TABLES = (
    Table(
        "Soft and hard disks in the steady state",
        "Contact time 0: event-driven. The number of contacts scatters least of all: it tells how far from"
        " hard a run is. Energy comes next; the height, whose error is seven times smaller, last.",
        _table, needs=NEEDS, recorded=True,
    ),
)  # fmt: skip
