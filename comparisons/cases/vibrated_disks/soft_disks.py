"""The vibrated disks as soft spheres of several contact times, and their approach to hard ones.

A mean over a run scatters; its standard error is that of the long event-driven run, whose blocks of 20 s are
longer than the correlation time of its energy, scaled by the length: most soft runs are too short for blocks.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from comparisons import kit
from comparisons.metrics.limit import Approach, block_mean
from comparisons.report import plots
from gpudem.output.run import Run
from gpudem.scene import Scene

#: The engine of hard disks, its long run, and the time from which that is steady [s].
CODE, STEADY, HARD_SETTLED = "event_driven", "steady", 40.0
#: Speed at which a contact lasts the stated time [m/s]; steps in it; settling and blocks [s].
MEETING, STEPS, SETTLED, BLOCK = 0.5, 25, 15.0, 20.0
POISSON = 0.3
#: Top of the domain [m], 14 mean heights: small cells; a disk that reaches it ends the run with an error.
TOP = 4.0


def young(contact_time: float, mass: float, radius: float) -> float:
    """Young's modulus [Pa] of two equal spheres whose elastic Hertz contact lasts so long at MEETING.

    t_c = 2.868266 (m*^2 / (R* E*^2 v))^(1/5), Hertz; the damping of e = 0.95 lengthens it by 0.01 %.
    """
    modulus = math.sqrt(2.868266**5 * (mass / 2) ** 2 / (radius / 2 * MEETING * contact_time**5))
    return 2 * (1 - POISSON**2) * modulus


def soften(scene: Scene, contact_time: float, duration: float, mass: float) -> Scene:
    """The scene with moduli for a contact time; both materials are equally soft, as in two disks."""
    modulus = young(contact_time, mass, float(scene.state.radius[0]))
    return scene.replace(
        materials={name: {**m.model_dump(), "young": modulus} for name, m in scene.materials.items()},
        time={"step": contact_time / STEPS, "duration": duration},
        solver={"skin": float(scene.state.radius[0])},
        domain={"hi": (scene.domain.hi[0], scene.domain.hi[1], TOP)},
        allow=(*scene.allow, "large_overlap"),
    )


@dataclasses.dataclass(frozen=True)
class Steady:
    """Means over `duration` [s] of a run in the steady state; hard disks have contact time 0 [s].

    Per disk: kinetic energy [J] and contacts, with disks and floor. Mean height [m], power of the floor [W],
    growth of kinetic and potential energy per second [W], run time [s] per simulated second.
    """

    contact_time: float
    duration: float
    kinetic: float
    height: float
    contacts: float
    power: float
    growth: float
    seconds: float

    @classmethod
    def of(cls, run: Run, settled: float, contact_time: float = 0.0) -> Steady:
        """Means of a history from `settled` [s] on."""
        rows, n = late(run, settled), run.timing.particles
        length, energy = float(np.ptp(rows["time"])), rows["kinetic_energy"] + rows["potential_energy"]
        return cls(
            contact_time=contact_time, duration=length,
            kinetic=float(rows["kinetic_energy"].mean()) / n, height=float(rows["centre_z"].mean()),
            contacts=float(rows["contacts"].mean()) / n,
            power=float(rows["work"][-1] - rows["work"][0]) / length,
            growth=float(energy[-1] - energy[0]) / length,
            seconds=run.timing.stepping_s / float(rows["time"][-1]),
        )  # fmt: skip


def late(run: Run, settled: float) -> dict[str, np.ndarray]:
    """Columns of the history from `settled` [s] on."""
    table = run.history
    assert table is not None, "the scene asks for a history"
    rows = table["time"].to_numpy() >= settled - 1e-9
    return {str(name): table[name].to_numpy()[rows] for name in table}


def label(contact_time: float) -> str:
    """The variant of a contact time."""
    return f"soft_{contact_time:g}"


def steady(results: kit.Results) -> tuple[Steady, list[Steady]]:
    """(hard, soft from the hardest on)."""
    hard = Steady.of(results[STEADY, CODE], HARD_SETTLED)
    soft = [Steady.of(run, SETTLED, float(name.removeprefix("soft_"))) for name, run in results.of("gpudem")]
    return hard, sorted(soft, key=lambda s: s.contact_time)


def approach(results: kit.Results, name: str) -> Approach:
    """How `kinetic` or `height` of the soft runs differs from that of hard disks.

    A soft mean has the standard error of the long run, scaled by the length.
    """
    hard, soft = steady(results)
    rows = late(results[STEADY, CODE], HARD_SETTLED)
    values = rows[{"kinetic": "kinetic_energy", "height": "centre_z"}[name]]
    size = round(BLOCK / float(rows["time"][1] - rows["time"][0]))
    (mean, error), length = block_mean(values, size), len(values) // size * BLOCK
    ratios = np.array([getattr(s, name) / getattr(hard, name) for s in soft])
    errors = np.array([error / mean * math.sqrt(length / s.duration) for s in soft]) * ratios
    return Approach(np.array([s.contact_time for s in soft]), ratios - 1, errors, error / mean)


# -- checks, figure, table -----------------------------------------------------------------------------------

NEEDS = (CODE, "gpudem")
#: Contact times [s] up to which a disk is in contact a tenth of the time at most.
SHORT = 1e-2
#: Length of run that costs are stated for [s].
LENGTH = 200.0
QUANTITIES = {"kinetic": "kinetic energy", "height": "mean height"}


def floor_power(results: kit.Results) -> float:
    """N m g U [W] of the scene."""
    scene = results[label(1e-2), "gpudem"].scene
    return float(scene.masses.sum()) * -scene.gravity[2] * max(plane.speed for plane in scene.planes)


def powers(results: kit.Results, dissipated: bool) -> kit.Measured:
    """Largest error of the floor's mean power, or of its part that is dissipated, over the soft runs."""
    runs, want = steady(results)[1], floor_power(results)
    got = {f"{s.contact_time:g} s": s.power - (s.growth if dissipated else 0.0) for s in runs}
    note = ", ".join(f"{time}: {power:.3f} W" for time, power in got.items())
    return kit.largest({time: kit.relative(power, want) for time, power in got.items()}, note)


def excess(results: kit.Results) -> kit.Measured:
    """By how much the kinetic energy exceeds that of hard disks, at a contact time of 0.01 s."""
    found = approach(results, "kinetic")
    k = int(np.argmin(abs(found.parameters - 1e-2)))
    return kit.Measured(float(found.excess[k]), note=f"standard error {found.errors[k]:.2g}")


def slope_error(results: kit.Results, name: str, longest: float) -> kit.Measured:
    """Exponent of the error over contact time, up to one."""
    got, error = approach(results, name).up_to(longest).slope()
    return kit.Measured(abs(got - 1), got, 1.0, f"standard error {error:.2g}")


def limit_error(results: kit.Results, name: str, scaled: bool) -> kit.Measured:
    """Distance of the Richardson value from that of hard disks, relative or in standard errors."""
    got, error = approach(results, name).limit()
    return kit.Measured(
        abs(got) / error if scaled else abs(got), note=f"{got:+.5f}, standard error {error:.2g}"
    )


def collisions(results: kit.Results) -> float:
    """Collisions of hard disks per disk and second, with disks and floor, each counted once."""
    run = results[STEADY, CODE]
    rows = late(run, 0.0)
    return float(rows["collisions"][-1] / rows["time"][-1]) / run.timing.particles


def contacts(results: kit.Results) -> tuple[float, float]:
    """Contacts per disk of the hardest soft run, and collisions of hard disks in a contact time."""
    hardest = steady(results)[1][0]
    return hardest.contacts, collisions(results) * hardest.contact_time


def _approach(results: kit.Results) -> plots.Figure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.8)
    hard, soft = steady(results)
    times, cost = np.array([s.contact_time for s in soft]), LENGTH * np.array([s.seconds for s in soft])
    for (name, text), color in zip(QUANTITIES.items(), ("#0072b2", "#cc79a7"), strict=True):
        found = approach(results, name)
        size, error = abs(found.excess), np.hypot(found.errors, found.limit_error)
        bars = (np.minimum(error, 0.9 * size), error)  # a bar down to zero has no place on a logarithmic axis
        look: dict[str, Any] = {"yerr": bars, "color": color, "ms": 5, "capsize": 2}
        left.errorbar(times, size, fmt="o", label=text, **look)
        left.plot(times, size[-1] * times / times[-1], color=color, lw=0.9, ls="--")
        right.errorbar(cost, size, fmt="o-", lw=0.9, label=f"soft, {text}", **look)
        scatter = found.limit_error * math.sqrt(hard.duration / LENGTH)
        right.plot(hard.seconds * LENGTH, scatter, "s", color=color, mfc="none",
                   label=f"event-driven, {text}: scatter only")  # fmt: skip
    for ax, what in ((left, "contact time at 0.5 m/s [s]"), (right, f"run time of {LENGTH:g} s [s]")):
        ax.set(xscale="log", yscale="log", xlabel=what, ylabel="|soft / event-driven - 1|")
        plots.legend(ax)
    left.set_xticks(times, [f"{t:g}" for t in times], minor=False)
    left.set_xticks([], minor=True)
    return figure


def _table(results: kit.Results) -> kit.Rows:
    hard, soft = steady(results)
    rate, want = collisions(results), floor_power(results)
    found = (approach(results, name) for name in QUANTITIES)
    errors = ([100 * float(e) for e in (one.limit_error, *one.errors)] for one in found)
    moduli = {name: run.scene.materials["disk"].young for name, run in results.of("gpudem")}
    return [
        {"contact time [s]": (t := s.contact_time),
         "Young's modulus [Pa]": moduli.get(label(t), math.nan),
         "averaged over [s]": s.duration,
         "kinetic energy per disk [J]": s.kinetic, "standard error [%]": kinetic,
         "mean height [m]": s.height, "standard error of it [%]": height,
         "contacts / (collisions x contact time)": s.contacts / (rate * t) if t else math.nan,
         "power of the floor / (N m g U)": s.power / want,
         f"run time of {LENGTH:g} s [s]": s.seconds * LENGTH}
        for s, kinetic, height in zip([hard, *soft], *errors, strict=True)
    ]  # fmt: skip


def check(name: str, measure: Callable[..., kit.Found], *arguments: Any, **fields: Any) -> kit.Check:
    """One check of measure(results, *arguments), against the event-driven engine by default."""
    fields = {"against": "event-driven", "mark": "X", "needs": NEEDS} | fields
    return kit.check(f"soft disks{name}", lambda results: measure(results, *arguments), **fields)


POWER = {
    "tolerance": 0.004, "mark": "A", "against": "momentum balance: the floor carries the weight",
    "reason": "the speed of the center of mass scatters by 0.02 m/s: 0.0009 of the weight in 30 s",
}  # fmt: skip
SLOPE = {
    "tolerance": 0.15, "mark": "A", "against": "first order in contact time: error ~ E^(-2/5)",
    "catches": "an error that is no power of the stiffness: a floor or law of another limit",
}  # fmt: skip
CHECKS = (
    check(
        ": power of the floor / (N m g U), largest error", powers, False,
        catches="a floor whose force and work do not agree; contacts it loses", **POWER,
    ),
    check(
        ": power less growth of energy / (N m g U), largest error", powers, True,
        catches="energy from rebuilds, springs or a jump of the floor", **POWER,
    ),
    check(
        " of 0.01 s: kinetic energy / event-driven - 1", excess, lo=0.07, tolerance=0.11,
        against="another soft solver, in C, not part of this project: 0.089",
        reason="two runs of 40 s and more scatter by 0.007 each",
        catches="soft disks that are as hard ones: a run that is not soft; restitution off by 0.005",
    ),
    check(
        ": contacts a disk / (collisions of hard disks x contact time), error", contacts, tolerance=0.1,
        tiers=kit.LONG,
        reason="contacts last as speed^(-1/5), 2^(2/5) longer on the floor; a disk in contact has fewer"
        " others",
        catches="contacts counted twice; a stiffness other than stated",
    ),
    check(
        ": kinetic energy, |slope of the error over contact time - 1|", slope_error, "kinetic", 1.0,
        tiers=kit.LONG, reason="next order: 0.1 at a contact time of 0.03 s", **SLOPE,
    ),
    *(
        check(
            f": {QUANTITIES[name]}, |slope of the error over contact time up to 0.01 s - 1|", slope_error,
            name, SHORT, tiers=("full",), reason=reason, **SLOPE,
        )
        for name, reason in (
            ("kinetic",
             "five standard errors; beyond it a disk is in contact a third of the time: no small error"),
            ("height",
             "one and a half standard errors: an error of 1 % of the height against its scatter of 0.05 %"),
        )
    ),
    *(
        check(
            f": {text} at contact time 0 from event-driven, in standard errors", limit_error, name, True,
            tolerance=3.0, tiers=kit.LONG, reason="significance: 1 in 370",
            catches="soft and hard disks that do not state the same scene",
        )
        for name, text in QUANTITIES.items()
    ),
    *(
        check(
            f": {text} at contact time 0 / event-driven - 1", limit_error, name, False, tolerance=0.003,
            tiers=("full",), reason="two standard errors of the fit or more",
            catches="the same, relative: soft and hard disks that do not state the same scene",
        )
        for name, text in QUANTITIES.items()
    ),
)  # fmt: skip
FIGURES = (
    kit.Figure(
        "Soft disks tend to hard ones",
        "Left: the error of soft disks over their contact time, with standard errors, and lines of slope 1."
        " Right: the same error over the run time of 200 s of the scene; squares: event-driven, whose only"
        " error is the scatter of a run of 200 s.",
        _approach, needs=NEEDS, recorded=True,
    ),
)  # fmt: skip
TABLES = (
    kit.Table(
        "Soft and hard disks in the steady state",
        "Contact time 0: event-driven. The number of contacts scatters least: it shows how far from hard a"
        " run is. The height, whose error is seven times smaller than that of the energy, shows it last.",
        _table, needs=NEEDS, recorded=True,
    ),
)  # fmt: skip
