"""Long runs: a bed at rest for a minute, a column of a thousand balls, ten million collisions."""

from __future__ import annotations

import functools
import math

import numpy as np

from comparisons import kit
from comparisons.cases.limits import endurance_scenes as scenes
from comparisons.kit import number
from comparisons.report import plots

CONFIGURATIONS = kit.Configurations(*kit.precisions())
DOUBLE, MIXED, SINGLE = CONFIGURATIONS.own
#: Kinetic energy of a smooth bed at the end / that of its fall by a diameter; largest displacement / radius.
STILL: dict[kit.Tier, float] = {"quick": 1e-4, "standard": 1e-7, "full": 1e-13}
CREEP: dict[kit.Tier, float] = {"quick": 0.3, "standard": 1e-2, "full": 1e-6}
#: Energy of the gas: each collision errs by about 1e-4 of itself, as the first contact falls somewhere within
#: a step, and the sum is a random walk.
DRIFT: dict[kit.Tier, float] = {"quick": 2e-3, "standard": 5e-3, "full": 3e-2}


def variants(tier: kit.Tier) -> list[kit.Variant]:
    time = scenes.REST_TIME[tier]
    named = {"bed_smooth": scenes.bed(0.0, time), "column": scenes.column(scenes.COLUMN[tier]),
             "gas": scenes.gas_of(scenes.COLLISIONS[tier]), "fine_gas": scenes.fine_gas()}  # fmt: skip
    if tier == "full":
        named["bed_rough"] = scenes.bed(0.3, time)
    return [v for label, scene in named.items() for v in CONFIGURATIONS.variants(label, scene)]


def still(results: kit.Results, one: kit.Configuration) -> kit.Measured:
    """Largest kinetic energy in the last tenth of the run; NaN where the bed never fell by a diameter."""
    run = one.run(results, "bed_smooth")
    (time, energy), fell = scenes.kinetic(run), scenes.fall(run)
    value = float(energy[time > 0.9 * time[-1]].max()) if fell > 1.0 else math.nan
    return kit.Measured(value, note=f"{time[-1]:g} s; at its start it fell by {fell:.2g} diameters")


def creep(results: kit.Results, one: kit.Configuration) -> float:
    return scenes.creep(one.run(results, "bed_smooth"))


def column(results: kit.Results, one: kit.Configuration, which: int) -> float:
    """Largest displacement in the column at rest (0) / that of the wave; error of the wave (1) / the same."""
    run = one.run(results, "column")
    return results.once(("column", one.title), lambda: scenes.column_errors(run))[which]


def gas(results: kit.Results, one: kit.Configuration) -> tuple[np.ndarray, np.ndarray, float]:
    """(time [s], energy / that at the start - 1, collisions) of the long gas."""
    run = one.run(results, "gas")
    return results.once(("gas", one.title), lambda: (*scenes.gas_energy(run), scenes.collisions(run)))


def drift(results: kit.Results, one: kit.Configuration) -> kit.Measured:
    """Largest change of the energy; NaN where there were fewer collisions than the tier promises."""
    _, energy, many = gas(results, one)
    enough = many >= scenes.COLLISIONS[results.tier]
    note = f"{many:.3g} collisions; {energy[-10:].mean():.1e} at the end"
    return kit.Measured(float(np.abs(energy).max()) if enough else math.nan, note=note)


def fine(results: kit.Results, one: kit.Configuration) -> kit.Measured:
    """Largest change of the energy; NaN where too few rows have contacts, or none."""
    run = one.run(results, "fine_gas")
    energy, rows = scenes.fine_energy(run), len(run.history["time"])
    tenth = len(energy) // 10
    note = f"last tenth less first: {energy[-tenth:].mean() - energy[:tenth].mean():.1e}; {rows} rows"
    enough = rows / 4 < len(energy) < rows - 100
    return kit.Measured(float(np.abs(energy).max()) if enough else math.nan, note=note)


def _draw(results: kit.Results) -> plots.Figure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.6)
    looks = {"bed_smooth": {"lw": 1.1}, "bed_rough": {"lw": 0.7, "alpha": 0.6, "label": None}}
    for one in CONFIGURATIONS.among(results.codes()):
        for bed, look in looks.items():
            if one.key(bed) in results.runs:
                time, energy = scenes.kinetic(one.run(results, bed))
                left.semilogy(time[1:], np.maximum(energy[1:], 1e-40), **one.line(**look))
        time, energy, many = gas(results, one)
        right.plot(time / time[-1] * many, energy, **one.line(lw=1.1))
    left.set(xlabel="time [s]", ylabel="kinetic energy / fall of the bed by a diameter")
    right.set(xlabel="collisions", ylabel="energy / start - 1")
    plots.legend(left, right)
    return figure


def _energy_left(results: kit.Results, one: kit.Configuration, bed: str = "bed_smooth") -> float:
    return float(scenes.kinetic(one.run(results, bed))[1][-1])


def _table(results: kit.Results) -> kit.Rows:
    rows = []
    for one in CONFIGURATIONS.among(results.codes()):
        found = {}
        for bed, words in (("bed_smooth", "bed"), ("bed_rough", "with friction")):
            if one.key(bed) in results.runs:
                found[f"{words}: kinetic energy at the end"] = _energy_left(results, one, bed)
                found[f"{words}: displacement / radius"] = scenes.creep(one.run(results, bed))
        _, energy, many = gas(results, one)
        found |= {
            "column at rest: displacement / that of the wave": column(results, one, 0),
            "column: error of the wave": column(results, one, 1),
            "gas: energy, largest change": float(np.abs(energy).max()),
            "gas: gain in a collision / energy of the two":
                float(energy[-10:].mean()) * len(one.run(results, "gas").scene.state) / (2 * many),
        }  # fmt: skip
        rows.append({"code": one.title} | {name: number(value, 2) for name, value in found.items()})
    return rows


def _advice(results: kit.Results) -> kit.Rows:
    double, mixed, single = (number(_energy_left(results, one), 1) for one in CONFIGURATIONS.own)
    moved = max(float(np.abs(gas(results, one)[1]).max()) for one in (DOUBLE, MIXED))
    text = (
        f"A bed without friction comes to rest and stays at rest: after {scenes.REST_TIME[results.tier]:g} s"
        f" its kinetic energy is {double} (float64), {mixed} (mixed) and {single} (float32) of a fall by one"
        f" diameter; in float32 its balls move by {number(creep(results, SINGLE), 1)} of a radius in the last"
        f" half. Over {number(gas(results, DOUBLE)[2], 1)} elastic collisions of {scenes.STEPS} steps each"
        f" the energy changes by {number(moved, 1)} at most, in mixed as in float64."
    )
    return [{"choose": "duration", "by": text}]


#: A check of each configuration but float32.
each = functools.partial(kit.per_configuration, CONFIGURATIONS, without=(SINGLE,))
CASE = kit.Case(
    name="endurance",
    title="At rest for a minute, a thousand balls high, ten million collisions",
    purpose=(
        "Errors that accumulate slowly: does a bed at rest creep, does a gas gain or lose energy, does"
        " rounding under the load of a thousand balls exceed the weight of one? The full tier lets a bed of"
        " 200 balls rest for 60 s, sends a wave through a column of 1000 and runs a gas through ten million"
        " collisions; the other tiers are shorter. A bed with friction never comes fully to rest, in any"
        " code: this law has no torque about the normal of a contact and none against rolling. float32 cannot"
        " represent the overlaps at the top of the column, and its bed has velocities but does not move."
    ),
    source="Hertz (1882): overlaps under the weight; ODE of the elastic chain (DOP853, rtol 1e-10).",
    variants=variants,
    checks=(
        each(
            "bed at rest without friction: kinetic energy at the end / fall by a diameter", still,
            tolerance=STILL,
            reason="its slowest oscillation decays exponentially, 1e-7 in 3 s, down to the rounding of the"
            " forces (mixed: 6e-8 of each)",
            catches="a dashpot or spring that adds energy, a neighbor list that disturbs a bed at rest",
            against="rest",
        ),
        each(
            "bed at rest without friction: largest way of a ball in the last half / radius", creep,
            tolerance=CREEP, reason="what remains of the slowest oscillation", against="rest",
            catches="creep: positions that rounding moves one way",
        ),
        each(
            "column at rest: largest way of a ball / that of the wave beside it",
            lambda results, one: column(results, one, 0), tolerance=1e-4,
            reason="float64: 1e-16 of 6 m by 5e-8 m, oscillating; mixed: 6e-8 of the overlaps of all contacts"
            " below, added up",
            catches="a column that sinks, an overlap that is off by the rounding of a height",
            against="closed form", changes={MIXED.title: {"tolerance": 0.05}},
        ),
        each(
            "column: wave from the top, largest error of the way / largest way",
            lambda results, one: column(results, one, 1), tolerance=0.004,
            reason="second order in the step: (w h)^2/24 of the fastest modes of a push; mixed: as at rest",
            catches="a load passed on to the wrong neighbor, a spring constant off by a thousandth",
            against="ODE (DOP853, rtol 1e-10)", changes={MIXED.title: {"tolerance": 0.05}},
        ),
        each(
            "gas: energy, largest change over all collisions", drift, tolerance=DRIFT,
            reason="each collision has an error that depends on the phase of its beginning within a step; the"
            " sum is a random walk",
            catches="collisions that gain or lose energy on average, a pair missing in the neighbor list",
            against="conservation",
        ),
        each(
            "fine gas: energy, largest change in 1e5 steps", fine, tolerance=1e-6,
            reason="third order in the step for the smooth start of Hertz' force,"
            f" {scenes.FINE} steps per contact",
            catches="a scheme that is not symplectic where there is no damping", against="conservation",
        ),
    ),
    findings=(
        kit.Finding(
            "column: error of the wave (gpudem float32)",
            lambda results: column(results, SINGLE, 1), "1",
            "Largest error / largest displacement: float32 rounds heights by more than the overlaps change.",
        ),
    ),
    figures=(
        kit.Figure(
            "A bed that comes to rest, and the energy of a gas",
            "Left: kinetic energy of a bed without friction and (thin, full tier) with friction. Right:"
            " kinetic and elastic energy of an elastic gas. A collision errs by about 1e-4 of its energy in"
            " either direction; a mean gain of second order, the same in every code and precision, shows"
            " after ten million collisions.",
            _draw, section="limits", recorded=True,
        ),
    ),
    tables=(
        kit.Table(
            "How long: what becomes of a run in time", "Numbers of this run.", _advice, section="advice",
            recorded=True,
        ),
        kit.Table(
            "Rest, waves and a gas",
            "Kinetic energy / that of a fall of the whole bed by one diameter; displacements in the last half"
            " of a run; times of this machine.",
            _table, section="limits", recorded=True,
        ),
    ),
    features=("normal hertz", "normal hooke", "damping", "gravity", "periodic sides", "mixed", "float32"),
    order=83,
)  # fmt: skip
