"""How long and how far: a bed at rest for a minute, a column of a thousand balls, ten million collisions."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from comparisons.cases.limits import endurance_scenes as endurance
from comparisons.harness.case import Case, Check, Figure, Measured, Results, Table, Tier, Variant
from comparisons.harness.numbers import number
from comparisons.report import plots
from gpudem.output.run import Run

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure as MatplotlibFigure

CODES = ("gpudem", "liggghts")
#: Who -> (label suffix, code, arguments, drawing).
WHO = {
    "gpudem float64": ("float64", "gpudem", {"precision": "float64"}, {"color": plots.SERIES[0]}),
    "gpudem mixed": ("mixed", "gpudem", {"precision": "mixed"}, {"color": plots.SERIES[2]}),
    "gpudem float32": ("float32", "gpudem", {"precision": "float32"}, {"color": plots.SERIES[3]}),
    "LIGGGHTS": ("liggghts", "liggghts", {"use_recorded": False}, {"color": plots.SERIES[1], "ls": "--"}),
}
EXACT = ("gpudem float64", "gpudem mixed", "LIGGGHTS")
#: Kinetic energy that a smooth bed may have at the end, by its fall through a diameter.
STILL: dict[Tier, float] = {"quick": 1e-4, "standard": 1e-7, "full": 1e-13}
CREEP: dict[Tier, float] = {"quick": 0.3, "standard": 1e-2, "full": 1e-6}
#: Energy of the gas: an overlap's onset falls somewhere within a step, each collision errs by some 1e-4 of
#: itself, and the sum walks at random.
DRIFT: dict[Tier, float] = {"quick": 2e-3, "standard": 5e-3, "full": 3e-2}


#: What a step of these costs stands in the table.
TIMED = ("bed_smooth", "column", "gas")


def variants(tier: Tier) -> list[Variant]:
    size = endurance.SIZES[tier]
    scenes = {f"bed_{name}": endurance.bed(mu, size.bed) for name, mu in endurance.BEDS.items()}
    if tier != "full":
        del scenes["bed_rough"]
    scenes |= {"column": endurance.column(size.count), "gas": endurance.gas_of(size.collisions)}
    scenes["fine_gas"] = endurance.fine_gas()
    return [
        Variant(f"{name}-{suffix}", scene, (code,), {code: arguments}, timed=name in TIMED)
        for name, scene in scenes.items()
        for suffix, code, arguments, _ in WHO.values()
    ]


def run_of(results: Results, name: str, who: str) -> Run:
    suffix, code, *_ = WHO[who]
    return results[f"{name}-{suffix}", code]


def still(results: Results, who: str) -> Measured:
    """Largest kinetic energy in the last tenth of the run; NaN where the bed never fell by a diameter."""
    time, energy = endurance.kinetic(run_of(results, "bed_smooth", who))
    late = time > 0.9 * time[-1]
    fell = endurance.fall(run_of(results, "bed_smooth", who))
    return Measured(
        float(energy[late].max()) if fell > 1.0 else math.nan,
        note=f"{time[-1]:g} s; at its start it fell by {fell:.2g} diameters",
    )


def creep(results: Results, who: str) -> Measured:
    return Measured(endurance.creep(run_of(results, "bed_smooth", who)))


def _column(results: Results, who: str) -> tuple[float, float]:
    run = run_of(results, "column", who)
    return results.once(("column", who), lambda: endurance.column_errors(run))


def _gas(results: Results, who: str) -> tuple[np.ndarray, np.ndarray]:
    run = run_of(results, "gas", who)
    return results.once(("gas", who), lambda: endurance.gas_energy(run))


def drift(results: Results, who: str) -> Measured:
    """Largest change of the energy; NaN where the collisions fell short of what the tier promises."""
    _, energy = _gas(results, who)
    many = endurance.collisions(run_of(results, "gas", who))
    enough = many >= endurance.SIZES[results.tier].collisions
    return Measured(
        float(np.abs(energy).max()) if enough else math.nan,
        note=f"{many:.3g} collisions; {energy[-10:].mean():.1e} at the end",
    )


def fine(results: Results, who: str) -> Measured:
    """Largest change of the energy; NaN where too few rows have contacts, or none."""
    run = run_of(results, "fine_gas", who)
    energy, rows = endurance.fine_energy(run), len(run.history["time"])
    tenth = len(energy) // 10
    note = f"last tenth less first: {energy[-tenth:].mean() - energy[:tenth].mean():.1e}; {rows} rows"
    return Measured(
        float(np.abs(energy).max()) if rows / 4 < len(energy) < rows - 100 else math.nan, note=note
    )  # fmt: skip


def float32(results: Results) -> Measured:
    return Measured(_column(results, "gpudem float32")[1])


def _draw(results: Results) -> MatplotlibFigure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.6)
    for who, (suffix, code, _, look) in WHO.items():
        if (f"bed_smooth-{suffix}", code) not in results.runs:
            continue
        time, energy = endurance.kinetic(run_of(results, "bed_smooth", who))
        left.semilogy(time[1:], np.maximum(energy[1:], 1e-40), lw=1.1, label=who, **look)
        if "bed_rough-" + suffix in results.labels():
            time, energy = endurance.kinetic(run_of(results, "bed_rough", who))
            left.semilogy(time[1:], np.maximum(energy[1:], 1e-40), lw=0.7, alpha=0.6, **look)
        run = run_of(results, "gas", who)
        time, energy = _gas(results, who)
        right.plot(time / time[-1] * endurance.collisions(run), energy, lw=1.1, label=who, **look)
    left.set(xlabel="time [s]", ylabel="kinetic energy / fall of the bed by a diameter")
    right.set(xlabel="collisions", ylabel="energy / start - 1")
    plots.legend(left)
    plots.legend(right)
    return figure


def _table(results: Results) -> pandas.DataFrame:
    import pandas

    rows = []
    for who, (suffix, code, *_) in WHO.items():
        if (f"gas-{suffix}", code) not in results.runs:
            continue
        bed, column, gas = (run_of(results, n, who) for n in ("bed_smooth", "column", "gas"))
        row: dict[str, object] = {"by": who}
        row["bed: kinetic energy at the end"] = number(float(endurance.kinetic(bed)[1][-1]), 2)
        row["bed: way in the last half / radius"] = number(endurance.creep(bed), 2)
        if f"bed_rough-{suffix}" in results.labels():
            rough = run_of(results, "bed_rough", who)
            row["with friction: kinetic energy"] = number(float(endurance.kinetic(rough)[1][-1]), 2)
            row["with friction: way / radius"] = number(endurance.creep(rough), 2)
        at_rest, wave = _column(results, who)
        row["column at rest: way / wave's"] = number(at_rest, 2)
        row["column: error of the wave"] = number(wave, 2)
        energy = _gas(results, who)[1]
        row["gas: energy, largest change"] = number(float(np.abs(energy).max()), 2)
        pairs = 2 * endurance.collisions(gas) / len(gas.scene.state)
        row["gas: gain a collision / energy of the two"] = number(float(energy[-10:].mean()) / pairs, 1)
        micro = [1e6 * r.timing.stepping_s / r.timing.steps / r.timing.particles for r in (bed, column, gas)]
        row["bed, column, gas: us a ball and step"] = ", ".join(f"{m:.2f}" for m in micro)
        rows.append(row)
    return pandas.DataFrame(rows)


def _advice(results: Results) -> pandas.DataFrame:
    import pandas

    def left(who: str) -> str:
        return number(float(endurance.kinetic(run_of(results, "bed_smooth", who))[1][-1]), 1)

    many = number(endurance.collisions(run_of(results, "gas", "gpudem float64")), 1)
    moved = max(float(np.abs(_gas(results, f"gpudem {p}")[1]).max()) for p in ("float64", "mixed"))
    double, mixed, single = (left(f"gpudem {p}") for p in ("float64", "mixed", "float32"))
    still_by = number(endurance.creep(run_of(results, "bed_smooth", "gpudem float32")), 1)
    text = (
        f"Without friction a bed comes to rest and stays: after {endurance.SIZES[results.tier].bed:g} s its"
        f" kinetic energy is {double} (float64) and {mixed} (mixed) of a fall by one diameter; float32 is"
        f" left with {single} while its balls move by {still_by} of a radius"
        f" in the last half. Over {many} elastic collisions of"
        f" {endurance.STEPS} steps each the energy changes by {number(moved, 1)} at most, in mixed as in"
        " float64."
    )
    return pandas.DataFrame([("duration", text)], columns=["choose", "by"])


def _per_who(name: str, measure, tolerance, reason: str, catches: str, who=EXACT, **more) -> list[Check]:
    """A check for each of `who`; a tolerance for each tier, or one for each of who."""
    made = []
    for one in who:
        tiers = tolerance if isinstance(tolerance, dict) and set(tolerance) <= set(STILL) else None
        for tier, allowed in (
            tiers or {None: tolerance[one] if isinstance(tolerance, dict) else tolerance}
        ).items():
            limits = {} if tier is None else {"tiers": (tier,)}
            made.append(
                Check(
                    name=f"{name} ({one})", measure=lambda results, one=one: measure(results, one),
                    tolerance=allowed, unit="1", mark="A", reason=reason, catches=catches,
                    needs=(WHO[one][1],), **{"against": "closed form", **limits, **more},
                )
            )  # fmt: skip
    return made


CASE = Case(
    name="endurance",
    title="At rest for a minute, a thousand balls high, ten million collisions",
    purpose=(
        "What goes wrong slowly: does a bed at rest creep, does energy leak into or out of a gas, does a"
        " load of a thousand balls drown the weight of one? The full tier lets a bed of 200 balls rest for"
        " 60 s, sends a wave through a column of 1000 and runs a gas through ten million collisions; the"
        " standard tier is shorter. A bed with friction never comes fully to rest: a ball that spins about"
        " the normal of its contacts, or rolls free in its hole, meets no torque in this law; that is the"
        " law's, and LIGGGHTS shows it as well. float32 loses the top of the column in the rounding of its"
        " height, and its bed stands still while its velocities say it moves."
    ),
    source="Hertz (1882): overlaps under the weight; ODE of the elastic chain (DOP853, rtol 1e-10).",
    variants=variants,
    checks=(
        *_per_who(
            "bed at rest without friction: kinetic energy at the end / fall by a diameter", still, STILL,
            "its slowest swing decays exponentially, 1e-7 in 3 s, down to the rounding of the forces"
            " (mixed: 6e-8 of each)",
            "a dashpot or a spring that feeds energy in, a neighbour list that jitters a bed at rest",
            against="rest",
        ),
        *_per_who(
            "bed at rest without friction: largest way of a ball in the last half / radius", creep, CREEP,
            "what is left of the slowest swing", "creep: positions that rounding moves one way",
            against="rest",
        ),
        *_per_who(
            "column at rest: largest way of a ball / that of the wave beside it",
            lambda results, who: Measured(_column(results, who)[0]),
            {"gpudem float64": 1e-4, "LIGGGHTS": 1e-4, "gpudem mixed": 0.05},
            "float64: 1e-16 of 6 m by 5e-8 m, swinging; mixed: 6e-8 of the overlaps of all contacts below,"
            " added up",
            "a column that sinks, an overlap that is off by the rounding of a height",
        ),
        *_per_who(
            "column: wave from the top, largest error of the way / largest way",
            lambda results, who: Measured(_column(results, who)[1]),
            {"gpudem float64": 0.004, "LIGGGHTS": 0.004, "gpudem mixed": 0.05},
            "second order in the step: (w h)^2/24 of the fastest modes of a push; mixed: as at rest",
            "a load passed on to the wrong neighbour, a spring constant off by a thousandth",
            against="ODE (DOP853, rtol 1e-10)",
        ),
        Check(
            name="column: error of the wave (gpudem float32)", measure=float32, tolerance=math.inf, lo=0.5,
            unit="1", against="ODE (DOP853, rtol 1e-10)", mark="A",
            reason="shown failing where it fails", catches="a float32 mode that is not float32",
        ),
        *_per_who(
            "gas: energy, largest change over all collisions", drift, DRIFT,
            "each collision errs by its onset within a step; the sum walks at random, on balance upwards",
            "collisions that gain or lose energy on average, a pair missed by a neighbour list",
            against="conservation",
        ),
        *_per_who(
            "fine gas: energy, largest change in 1e5 steps", fine, 1e-6,
            f"third order in the step for Hertz' smooth onset, {endurance.FINE} steps a contact",
            "a scheme that is not symplectic where nothing damps", against="conservation",
        ),
    ),
    figures=(
        Figure(
            "A bed that comes to rest, and the energy of a gas",
            "Left: kinetic energy of a bed without friction and (thin, full tier) with; it falls to rounding."
            " Right: kinetic and elastic energy of an elastic gas. A collision errs by some 1e-4 of itself"
            " either way; of second order there is a mean gain, in every code and precision (last but one"
            " column of the table), which ten million collisions show.",
            _draw, section="limits", recorded=True,
        ),
    ),
    tables=(
        Table(
            "How long: what becomes of a run in time", "Numbers of this run.", _advice, section="advice",
            recorded=True,
        ),
        Table(
            "Rest, waves and a gas",
            "Kinetic energy by the fall of the whole bed through one diameter; times of this machine.",
            _table, section="limits", recorded=True,
        ),
    ),
    features=("normal hertz", "normal hooke", "damping", "gravity", "periodic sides", "mixed", "float32"),
    order=83,
)  # fmt: skip
