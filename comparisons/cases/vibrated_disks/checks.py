"""Checks, figure and table of the vibrated disks as soft spheres against hard ones."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from comparisons.cases.vibrated_disks.scenes import CODE, STEADY, approach, label, late, steady
from comparisons.harness.case import Check, Figure, Measured, Results, Table, Tier, largest, relative
from comparisons.report import plots

NEEDS = (CODE, "gpudem")
#: Contact times [s] up to which a disk is in contact a tenth of the time at most.
SHORT = 1e-2
#: Length of run that costs are stated for [s].
LENGTH = 200.0
LONG: tuple[Tier, ...] = ("standard", "full")
FULL: tuple[Tier, ...] = ("full",)
QUANTITIES = {"kinetic": "kinetic energy", "height": "mean height"}


def floor_power(results: Results) -> float:
    """N m g U [W] of the scene."""
    scene = results[label(1e-2), "gpudem"].scene
    return float(scene.masses.sum()) * -scene.gravity[2] * max(plane.speed for plane in scene.planes)


def largest_power(results: Results, dissipated: bool) -> Measured:
    """Largest error of the floor's mean power, or of its part that is dissipated, over the soft runs."""
    runs, want = steady(results)[1], floor_power(results)
    got = {f"{s.contact_time:g} s": s.power - (s.growth if dissipated else 0.0) for s in runs}
    note = ", ".join(f"{time}: {power:.3f} W" for time, power in got.items())
    return largest({time: relative(power, want) for time, power in got.items()}, note)


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
    """Distance of the Richardson value from that of hard disks, relative or in standard errors."""
    got, error = approach(results, name).limit()
    return Measured(abs(got) / error if scaled else abs(got), note=f"{got:+.5f}, standard error {error:.2g}")


def collisions(results: Results) -> float:
    """Collisions of hard disks per disk and second, with disks and floor, each counted once."""
    run = results[STEADY, CODE]
    rows = late(run, 0.0)
    return float(rows["collisions"][-1] / rows["time"][-1]) / run.timing.particles


def contacts(results: Results) -> Measured:
    """Contacts per disk of the hardest soft run against collisions of hard disks in a contact time."""
    hardest = steady(results)[1][0]
    return relative(hardest.contacts, collisions(results) * hardest.contact_time)


def _approach(results: Results) -> plots.Figure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.8)
    hard, soft = steady(results)
    times, cost = np.array([s.contact_time for s in soft]), LENGTH * np.array([s.seconds for s in soft])
    for (name, text), color in zip(QUANTITIES.items(), ("#0072b2", "#cc79a7"), strict=True):
        found = approach(results, name)
        size, error = abs(found.excess), np.hypot(found.errors, found.hard_error)
        bars = (np.minimum(error, 0.9 * size), error)  # a bar down to zero has no place on a logarithmic axis
        look: dict[str, Any] = {"yerr": bars, "color": color, "ms": 5, "capsize": 2}
        left.errorbar(times, size, fmt="o", label=text, **look)
        left.plot(times, size[-1] * times / times[-1], color=color, lw=0.9, ls="--")
        right.errorbar(cost, size, fmt="o-", lw=0.9, label=f"soft, {text}", **look)
        scatter = found.hard_error * math.sqrt(hard.duration / LENGTH)
        right.plot(hard.seconds * LENGTH, scatter, "s", color=color, mfc="none",
                   label=f"event-driven, {text}: scatter only")  # fmt: skip
    for ax, what in ((left, "contact time at 0.5 m/s [s]"), (right, f"run time of {LENGTH:g} s [s]")):
        ax.set(xscale="log", yscale="log", xlabel=what, ylabel="|soft / event-driven - 1|")
        plots.legend(ax)
    left.set_xticks(times, [f"{t:g}" for t in times], minor=False)
    left.set_xticks([], minor=True)
    return figure


def _table(results: Results) -> list[dict[str, Any]]:
    hard, soft = steady(results)
    found = [approach(results, name) for name in QUANTITIES]
    rate, want, rows = collisions(results), floor_power(results), []
    for k, s in enumerate([hard, *soft]):
        scene = results[label(s.contact_time), "gpudem"].scene if k else None
        errors = [100 * float(one.errors[k - 1] if k else one.hard_error) for one in found]
        rows.append({
            "contact time [s]": s.contact_time,
            "Young's modulus [Pa]": scene.materials["disk"].young if scene else math.nan,
            "averaged over [s]": s.duration,
            "kinetic energy per disk [J]": s.kinetic,
            "standard error [%]": errors[0],
            "mean height [m]": s.height,
            "standard error of it [%]": errors[1],
            "contacts / (collisions x contact time)": s.contacts / (rate * s.contact_time) if k else math.nan,
            "power of the floor / (N m g U)": s.power / want,
            f"run time of {LENGTH:g} s [s]": s.seconds * LENGTH,
        })  # fmt: skip
    return rows


def check(name: str, measure: Any, *arguments: Any, **fields: Any) -> Check:
    """One check of measure(results, *arguments); unit "1", against the event-driven engine, X by default."""
    fields = {"unit": "1", "against": "event-driven", "mark": "X", "needs": NEEDS} | fields
    return Check(name=f"soft disks{name}", measure=lambda results: measure(results, *arguments), **fields)


def power_check(name: str, dissipated: bool, catches: str) -> Check:
    return check(
        f": {name} / (N m g U), largest error", largest_power, dissipated, tolerance=0.004, mark="A",
        against="momentum balance: the floor carries the weight", catches=catches,
        reason="the speed of the center of mass scatters by 0.02 m/s: 0.0009 of the weight in 30 s",
    )  # fmt: skip


def slope_check(name: str, tiers: tuple[Tier, ...], reason: str, longest: float = SHORT) -> Check:
    where = " up to 0.01 s" if longest == SHORT else ""
    return check(
        f": {QUANTITIES[name]}, |slope of the error over contact time{where} - 1|", slope_error, name,
        longest, tolerance=0.15, mark="A", tiers=tiers,
        against="first order in contact time: error ~ E^(-2/5)",
        reason=reason, catches="an error that is no power of the stiffness: a floor or law of another limit",
    )  # fmt: skip


CHECKS = (
    power_check("power of the floor", False, "a floor whose force and work do not agree; contacts it loses"),
    power_check("power less growth of energy", True, "energy from rebuilds, springs or a jump of the floor"),
    check(
        " of 0.01 s: kinetic energy / event-driven - 1", excess, lo=0.07, tolerance=0.11,
        against="another soft solver, in C, not part of this project: 0.089",
        reason="two runs of 40 s and more scatter by 0.007 each",
        catches="soft disks that are as hard ones: a run that is not soft; restitution off by 0.005",
    ),
    check(
        ": contacts a disk / (collisions of hard disks x contact time), error", contacts, tolerance=0.1,
        tiers=LONG,
        reason="contacts last as speed^(-1/5), 2^(2/5) longer on the floor; a disk in contact has fewer"
        " others",
        catches="contacts counted twice; a stiffness other than stated",
    ),
    slope_check("kinetic", LONG, "next order: 0.1 at a contact time of 0.03 s", longest=1.0),
    slope_check(
        "kinetic", FULL,
        "five standard errors; beyond it a disk is in contact a third of the time: no small error",
    ),
    slope_check(
        "height", FULL,
        "one and a half standard errors: an error of 1 % of the height against its scatter of 0.05 %",
    ),
    *(
        check(
            f": {text} at contact time 0 from event-driven, in standard errors", limit_error, name, True,
            tolerance=3.0, tiers=LONG, reason="significance: 1 in 370",
            catches="soft and hard disks that do not state the same scene",
        )
        for name, text in QUANTITIES.items()
    ),
    *(
        check(
            f": {text} at contact time 0 / event-driven - 1", limit_error, name, False, tolerance=0.003,
            tiers=FULL, reason="two standard errors of the fit or more",
            catches="the same, relative: soft and hard disks that do not state the same scene",
        )
        for name, text in QUANTITIES.items()
    ),
)  # fmt: skip
FIGURES = (
    Figure(
        "Soft disks tend to hard ones",
        "Left: the error of soft disks over their contact time, with standard errors, and lines of slope 1."
        " Right: the same error over the run time of 200 s of the scene; squares: event-driven, whose only"
        " error is the scatter of a run of 200 s.",
        _approach, needs=NEEDS, recorded=True,
    ),
)  # fmt: skip
TABLES = (
    Table(
        "Soft and hard disks in the steady state",
        "Contact time 0: event-driven. The number of contacts scatters least: it shows how far from hard a"
        " run is. The height, whose error is seven times smaller than that of the energy, shows it last.",
        _table, needs=NEEDS, recorded=True,
    ),
)  # fmt: skip
