"""A gas of hard spheres falls on an elastic floor: equilibrium in closed form, and three engines."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from comparisons.cases.gas import scenes as gases
from comparisons.cases.gas.checks import EARLY, HARD, collisions, conserved, early_checks, no_overlap
from comparisons.harness import codes
from comparisons.harness.case import (
    TIERS,
    Case,
    Check,
    Figure,
    Measured,
    PerCode,
    PerPair,
    Results,
    Table,
    Tier,
    Variant,
    largest,
)
from comparisons.metrics import engines
from comparisons.oracles import column
from comparisons.report import plots
from gpudem.output.run import Run
from gpudem.scene import Contact, Domain, Lattice, Output, Pair, Plane, Scene, Time

DIAMETER, GRAVITY, COUNT, CELLS, SPEED, STEPS = 2 * gases.RADIUS, 9.81, 392, 7, 1.0, 30
#: Spheres per floor area of a square diameter; starts as a lattice eight layers high.
COVER = 2.0
EDGE = math.sqrt(COUNT / COVER) * DIAMETER
DURATION, EVERY, EARLY_TIME, RMS = 0.12, 2e-3, 0.01, 0.25
#: From here on the column rests, some thirty times sqrt(T)/g [s].
SETTLED, EQUILIBRIUM = 1.0, "equilibrium"
#: Seeds of the hard spheres, which cost little.
HARD_SEEDS = 16
#: Tier -> length of the run in equilibrium [s], seeds of all engines with loss and without, contact time [s].
SIZES: dict[Tier, tuple[float, int, int, float]] = {
    "quick": (12.0, 3, 0, 2e-4), "standard": (40.0, 5, 4, 1e-4), "full": (200.0, 10, 10, 5e-5),
}  # fmt: skip
#: Quantity -> the most that softness changes it, relative, by omega t_c (see SOFT_REASON).
QUANTITIES = {"energy left": 1.0, "kinetic energy": 1.0, "mean height": -1.0}
KINDS = {"lossy": 0.95, "elastic": 1.0}


def scene(seed: int, restitution: float, contact_time: float, duration: float, output: Output) -> Scene:
    """Spheres with a linear spring over a floor, periodic sides; every contact lasts equally long."""
    material, pitch = gases.material(gases.spring_young(contact_time, SPEED)), EDGE / CELLS
    return Scene(
        name="bouncing_gas",
        materials={"ball": material, "floor": material},
        pairs=[
            Pair(materials=("ball", "ball"), restitution=restitution),
            Pair(materials=("ball", "floor"), restitution=1.0),
        ],
        contact=Contact(normal="hooke", tangential="off", characteristic_velocity=SPEED),
        particles=Lattice(
            source="lattice", material="ball", count=COUNT, radius=gases.RADIUS, lo=(0, 0, 0),
            hi=(EDGE, EDGE, COUNT / CELLS**2 * pitch * (1 + 1e-9)), spacing=pitch / DIAMETER * (1 - 1e-9),
            velocity_rms=RMS, seed=seed,
        ),
        gravity=(0.0, 0.0, -GRAVITY),
        walls=[Plane(name="floor", material="floor", point=(0, 0, 0), normal=(0, 0, 1))],
        domain=Domain(lo=(0, 0, 0), hi=(EDGE, EDGE, 0.6), periodic=(True, True, False)),
        time=Time(step=contact_time / STEPS, duration=duration), output=output,
    )  # fmt: skip


def variants(tier: Tier) -> list[Variant]:
    long, lossy, elastic, t_c = SIZES[tier]
    early, rows = Output(trace_every=50 * (t_c / STEPS)), Output(history_every=EVERY)
    rest = Output(history_every=0.01, trace_every=max(0.02, long / 1000))
    made = [Variant(EARLY, scene(1, KINDS["lossy"], t_c, EARLY_TIME, early))]
    made.append(Variant(EQUILIBRIUM, scene(1, 1.0, t_c, long, rest), (HARD,)))
    for kind, count in (("lossy", lossy), ("elastic", elastic)):
        for s in range(1, HARD_SEEDS + 1 if count else 1):
            one = scene(s, KINDS[kind], t_c, DURATION, rows)
            made.append(Variant(f"{kind}_{s}", one, codes.built_in() if s <= count else (HARD,)))
    return made


# -- equilibrium ---------------------------------------------------------------------------------------------


def rest(results: Results) -> tuple[Run, dict[str, np.ndarray]]:
    """(the run in equilibrium, columns of its history once it has settled)."""
    run = results[EQUILIBRIUM, HARD]
    table = run.history
    assert table is not None, "the scene asks for a history"
    late = table["time"].to_numpy() > SETTLED
    return run, {str(name): table[name].to_numpy()[late] for name in table}


def drift_speed(run: Run) -> np.ndarray:
    """Velocity [m/s] that the spheres have together along the floor, constant."""
    return run.scene.state.velocity.mean(axis=0) * (1, 1, 0)


def theory(results: Results) -> column.Column:
    """The column of the energy of the start, without that of the common motion along the floor."""

    def compute() -> column.Column:
        run, common = results[EQUILIBRIUM, HARD], drift_speed(results[EQUILIBRIUM, HARD])
        total = float((run.history["kinetic_energy"] + run.history["potential_energy"]).iloc[0])
        free = total / (COUNT * gases.MASS) - GRAVITY * gases.RADIUS - 0.5 * float(common @ common)
        return column.of_energy(free, 3 - 2 / COUNT, GRAVITY, DIAMETER, COVER / DIAMETER**2)

    return results.once("column", compute)


def settled(results: Results) -> tuple[np.ndarray, np.ndarray]:
    """(heights above touching [m] (rows, n), velocities [m/s] (rows, n, 3)) in equilibrium."""
    run = results[EQUILIBRIUM, HARD]
    late = run.trace["time"] > SETTLED
    return run.trace["position"][late, :, 2] - gases.RADIUS, run.trace["velocity"][late] - drift_speed(run)


def temperature(results: Results) -> tuple[float, float]:
    """T [m2/s2] (from the kinetic energy of the history, by theory)."""
    run, rows = rest(results)
    common = drift_speed(run)
    kinetic = float(rows["kinetic_energy"].mean()) / (COUNT * gases.MASS)
    return (2 * kinetic - float(common @ common)) / (3 - 2 / COUNT), theory(results).temperature


def centre(results: Results) -> tuple[float, float]:
    """Mean height above touching [m]."""
    return float(rest(results)[1]["centre_z"].mean()) - gases.RADIUS, theory(results).centre


def hits(results: Results) -> tuple[float, float]:
    """Impacts on the floor per second; N g/sqrt(2 pi T), T as measured."""
    rows = rest(results)[1]
    got = float(np.ptp(rows["wall_collisions"]) / np.ptp(rows["time"]))
    return got, column.floor_rate(COUNT, GRAVITY, temperature(results)[0])


def barometric(results: Results) -> float:
    """Sum of |share of the spheres - theory| over bins a diameter high."""
    found = theory(results)
    edges = np.concatenate([np.arange(13) * DIAMETER, [np.inf]])
    share = np.histogram(settled(results)[0], np.concatenate([[-np.inf], edges[1:]]))[0]
    law = (1 - found.layer) * np.diff(found.share_below(np.minimum(edges, found.height[-1])))
    law[0] += found.layer
    return float(np.abs(share / share.sum() - law).sum())


def isothermal(results: Results) -> Measured:
    """Largest deviation from the mean of <v^2>: of each axis, and of the lower and the upper half."""
    height, v = settled(results)
    low = height < np.median(height)
    parts = {axis: v[..., k] for k, axis in enumerate("xyz")} | {"lower half": v[low], "upper half": v[~low]}
    mean = float((v**2).mean())
    return largest({name: abs(float((part**2).mean()) / mean - 1) for name, part in parts.items()})


# -- three engines -------------------------------------------------------------------------------------------


def kinds(results: Results) -> list[str]:
    """Kinds of seeds that the tier has."""
    return [kind for kind in KINDS if f"{kind}_1" in results.labels()]


def quantity(run: Run, name: str) -> float:
    """Mean over the second half, by the energy of the start, in which seeds differ."""
    kinetic = run.history["kinetic_energy"].to_numpy() / (COUNT * gases.MASS)
    height = run.history["centre_z"].to_numpy() - gases.RADIUS
    total = kinetic + GRAVITY * height
    found = {"energy left": total, "kinetic energy": kinetic, "mean height": height}[name]
    return float(found[len(total) // 2 :].mean() / total[0])


def samples(results: Results, kind: str, name: str) -> dict[str, np.ndarray]:
    """Engine -> (seeds,) of a quantity."""
    return {
        code: np.array(
            [quantity(results[label, code], name) for label in results.labels(code, prefix=f"{kind}_")]
        )
        for code in results.codes(f"{kind}_1")
    }


def gap(results: Results, kind: str, a: str, b: str) -> Measured:
    """The quantity in which two engines differ most by what is allowed."""
    omega = float(2 * collisions(results, "lossy_1")[-1] / COUNT / DURATION)
    soft = omega * SIZES[results.tier][3] if b == HARD else 0.0
    names = [name for name in QUANTITIES if (kind, name) != ("elastic", "energy left")]  # that is conserved
    return largest(
        {name: engines.gap(samples(results, kind, name), a, b, soft * QUANTITIES[name]) for name in names}
    )


SOFT_REASON = (
    "softness: contacts that take t_c make spheres smaller by up to d omega t_c/2 (see haff_box), so that"
    " they collide and lose less and stand lower; no quantity here changes by more than omega t_c"
)


def engine_checks(a: str, b: str) -> tuple[Check, ...]:
    """A code against hard spheres, or against another code, with loss and without."""
    hard = b == HARD
    return tuple(
        Check(
            name=f"{kind}: energy and height late in the run,"
            f" difference {'from hard spheres' if hard else 'of the soft codes'} / allowed ({a})",
            measure=lambda results, kind=kind: gap(results, kind, a, b), tolerance=1.0, unit="1",
            against=codes.title(b), mark="X", needs=tuple(dict.fromkeys((a, b, HARD))),
            tiers=TIERS if kind == "lossy" else ("standard", "full"),
            reason=f"{engines.SIGMAS:g} standard errors over the seeds"
            + (f", and one way {SOFT_REASON}" if hard else "; same law, same softness"),
            catches="a restitution off by 0.01; collisions or impacts on the floor missed",
        )
        for kind in KINDS
    )  # fmt: skip


def _equilibrium(results: Results) -> plots.Figure:
    figure, axes = plots.figure()
    height, edges, found = settled(results)[0] / DIAMETER, np.linspace(0, 14, 57), theory(results)
    share = np.histogram(height, edges)[0] / height.size / np.diff(edges)
    axes.stairs(share, edges, color=plots.color(HARD), lw=1.5, label="event-driven")
    law = (1 - found.layer) * found.phi / np.trapezoid(found.phi, found.height / DIAMETER)
    axes.plot(found.height / DIAMETER, law, "k", lw=0.9, label="local equilibrium at one T")
    axes.set(xlabel="height above touching / diameter", ylabel="fraction of the spheres per diameter")
    axes.set(yscale="log", xlim=(0, 14), ylim=(3e-3, 0.4))
    plots.legend(axes)
    return figure


def _curves(results: Results) -> plots.Figure:
    rows = len(kinds(results))
    figure, axes = plots.figure(rows, 2, width=plots.WHOLE, height=3.0 * rows, squeeze=False)
    for (left, right), kind in zip(axes, kinds(results), strict=True):
        for code in results.codes(f"{kind}_1"):
            tables = [results[label, code].history for label in results.labels(code, prefix=f"{kind}_")]
            for ax, name, scale in (
                (left, "centre_z", 1e3),
                (right, "kinetic_energy", 1 / (COUNT * gases.MASS)),
            ):
                values = np.array([scale * table[name].to_numpy() for table in tables])
                plots.band(ax, tables[0]["time"].to_numpy(), values, code)
        left.set(xlabel="time [s]", ylabel="mean height [mm]", title=f"e = {KINDS[kind]:g}")
        right.set(xlabel="time [s]", ylabel="kinetic energy per mass [m2/s2]")
        plots.legend(left)
    return figure


def _table(results: Results) -> list[dict[str, Any]]:
    return [
        {"e [1]": KINDS[kind], "quantity / energy at the start": name, "code": plots.name(code),
         "seeds": len(values), "mean": float(values.mean()), "of a seed": float(values.std(ddof=1)),
         "against hard": float(values.mean() / samples(results, kind, name)[HARD].mean() - 1)}
        for kind in kinds(results)
        for name in QUANTITIES
        for code, values in samples(results, kind, name).items()
    ]  # fmt: skip


def equilibrium_check(
    name: str, measure: Any, tolerance: float, against: str, reason: str, catches: str
) -> Check:
    """Of hard spheres in equilibrium; `measure` returns an error, or (measured, expected)."""

    def error(results: Results) -> Measured | float:
        found = measure(results)
        return Measured(abs(found[0] / found[1] - 1), *found) if isinstance(found, tuple) else found

    return Check(
        name=f"{name} (event-driven)", measure=error, tolerance=tolerance, unit="1", against=against,
        mark="A", needs=(HARD,), reason=reason, catches=catches,
    )  # fmt: skip


CASE = Case(
    name="bouncing_gas",
    title="A gas bounces on a floor: three engines",
    purpose=(
        "Spheres fall on an elastic floor. Without loss they come to rest as a column of one temperature,"
        " whose height, profile and impacts on the floor follow from the energy of the start: a test of the"
        " event-driven engine. With loss, e = 0.95, the column sinks while omega t_c grows. From the same"
        " starts all codes must sink alike, up to the scatter of the seeds and the time a soft contact takes."
    ),
    source="Carnahan and Starling (1969); contact theorem and second virial coefficient at a hard wall.",
    variants=variants,
    checks=(
        *early_checks(),
        equilibrium_check(
            "temperature from the energy of the start, relative error", temperature, 0.01,
            "local equilibrium and layer at the floor",
            "no third virial coefficient at the floor (0.3 %), means over some thousand free falls (0.3 %)",
            "a floor or collision that makes one axis hotter, side walls that are not periodic",
        ),
        equilibrium_check(
            "mean height above touching, relative error", centre, 0.01,
            "local equilibrium and layer at the floor",
            "as for the temperature; without the layer at the floor it would be 1.4 % off",
            "spheres that touch the floor elsewhere than at their radius; gravity off by 1 %",
        ),
        equilibrium_check(
            "hits on the floor per second, relative error", hits, 0.01,
            "exact: they carry the weight, N g/sqrt(2 pi T)", "scatter of some ten thousand impacts",
            "an impact on the floor counted twice, or not at all",
        ),
        equilibrium_check(
            "profile, sum of |share of the spheres - theory| over heights of a diameter", barometric, 0.03,
            "barometric, with Carnahan and Starling",
            "slow waves of the column; the layer at the floor exceeds its bin",
            "a wrong profile with the right mean height",
        ),
        equilibrium_check(
            "<v^2> of each axis, of the lower and upper half against the mean", isothermal, 0.02,
            "equipartition", "waves along the height, with few degrees of freedom, scatter by some 0.5 %",
            "a floor or gravity that heats, a temperature that changes with height",
        ),
        conserved(
            "kinetic and potential energy, largest change (event-driven)",
            ("kinetic_energy", "potential_energy"), EQUILIBRIUM,
        ),
        no_overlap(), PerCode(lambda code: engine_checks(code, HARD)), PerPair(engine_checks),
    ),
    figures=(
        Figure(
            "The column in equilibrium",
            "Spheres by height. The lowest diameter holds more of them than in local equilibrium, for want of"
            " neighbors below; that layer is part of the theory too.",
            _equilibrium, needs=(HARD,),
        ),
        Figure(
            "Three engines from the same starts",
            "Mean and range over the seeds: the lattice falls, bounces and sinks.",
            _curves, needs=(HARD,),
        ),
    ),
    tables=(
        Table("Three engines, late in the run", "Means over the second half of it.", _table, needs=(HARD,)),
    ),
    features=("normal hooke", "damping", "gravity", "wall plane", "periodic sides", "sphere-sphere"),
    order=73,
)  # fmt: skip
