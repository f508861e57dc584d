"""A gas of hard spheres falls on an elastic floor: equilibrium in closed form, and three engines."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from comparisons.cases.gas import scenes as gases
from comparisons.cases.single_contact.checks import CODES
from comparisons.harness.case import Case, Check, Figure, Measured, Results, Table, Tier, Variant
from comparisons.metrics import engines
from comparisons.oracles import column
from comparisons.report import plots
from gpudem.output.run import Run
from gpudem.scene import Contact, Domain, Lattice, Material, Output, Pair, Plane, Scene, Time

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure as MatplotlibFigure

HARD = "event_driven"
ALL = (*CODES, HARD)
DIAMETER, GRAVITY, COUNT, CELLS, SPEED, STEPS = 2 * gases.RADIUS, 9.81, 392, 7, 1.0, 30
#: Spheres on the floor area of a square diameter; starts as a lattice eight layers high.
COVER = 2.0
EDGE = math.sqrt(COUNT / COVER) * DIAMETER
RMS, LOSSY = 0.25, 0.95
DURATION, EVERY, EARLY_TIME = 0.12, 2e-3, 0.01
#: From here on the column rests, some thirty times sqrt(T)/g [s].
SETTLED, EQUILIBRIUM = 1.0, "equilibrium"
#: Seeds of the hard spheres, which are cheap.
HARD_SEEDS = 16
#: Tier -> length of the run in equilibrium [s], seeds of all engines with loss and without, contact time [s].
SIZES: dict[Tier, tuple[float, int, int, float]] = {
    "quick": (12.0, 3, 0, 2e-4), "standard": (40.0, 5, 4, 1e-4), "full": (200.0, 10, 10, 5e-5),
}  # fmt: skip
#: Quantity -> most that softness changes it, relative, by omega t_c (see SOFT_REASON).
QUANTITIES = {"energy left": 1.0, "kinetic energy": 1.0, "mean height": -1.0}
KINDS = {"lossy": LOSSY, "elastic": 1.0}


def scene(seed: int, restitution: float, contact_time: float, duration: float, output: Output) -> Scene:
    """Spheres with a linear spring over a floor, periodic sides; every contact lasts equally long."""
    material = Material(
        young=gases.spring_young(contact_time, SPEED), poisson=gases.POISSON, density=gases.DENSITY
    )
    pitch = EDGE / CELLS
    top = COUNT / CELLS**2 * pitch * (1 + 1e-9)
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
            hi=(EDGE, EDGE, top), spacing=pitch / DIAMETER * (1 - 1e-9), velocity_rms=RMS, seed=seed,
        ),
        gravity=(0.0, 0.0, -GRAVITY),
        walls=[Plane(name="floor", material="floor", point=(0, 0, 0), normal=(0, 0, 1))],
        domain=Domain(lo=(0, 0, 0), hi=(EDGE, EDGE, 0.6), periodic=(True, True, False)),
        time=Time(step=contact_time / STEPS, duration=duration), output=output,
    )  # fmt: skip


def variants(tier: Tier) -> list[Variant]:
    long, lossy, elastic, contact_time = SIZES[tier]
    step, rows = contact_time / STEPS, Output(history_every=EVERY)
    early = scene(1, LOSSY, contact_time, EARLY_TIME, Output(trace_every=50 * step))
    rest = scene(1, 1.0, contact_time, long, Output(history_every=0.01, trace_every=max(0.02, long / 1000)))
    made = [Variant(gases.EARLY, early), Variant(EQUILIBRIUM, rest, (HARD,))]
    for kind, count in (("lossy", lossy), ("elastic", elastic)):
        made += [
            Variant(
                f"{kind}_{s}",
                scene(s, KINDS[kind], contact_time, DURATION, rows),
                ALL if s <= count else (HARD,),
            )
            for s in range(1, HARD_SEEDS + 1 if count else 1)
        ]
    return made


def kinds(results: Results) -> list[str]:
    """Kinds of seeds that the tier has."""
    return [kind for kind in KINDS if f"{kind}_1" in results.labels()]


# -- equilibrium ---------------------------------------------------------------------------------------------


def drift_speed(run: Run) -> np.ndarray:
    """Velocity [m/s] that the spheres have together along the floor, for ever."""
    return run.scene.state.velocity.mean(axis=0) * (1, 1, 0)


def theory(results: Results) -> column.Column:
    """The column of the energy that the start has, less that of the common motion along the floor."""

    def compute() -> column.Column:
        run = results[EQUILIBRIUM, HARD]
        total = (run.history["kinetic_energy"] + run.history["potential_energy"]).to_numpy()
        energy = float(total[0]) / (COUNT * gases.MASS) - GRAVITY * gases.RADIUS
        common = drift_speed(run)
        free = energy - 0.5 * float(common @ common)
        return column.of_energy(free, 3 - 2 / COUNT, GRAVITY, DIAMETER, COVER / DIAMETER**2)

    return results.once("column", compute)


def settled(results: Results) -> tuple[np.ndarray, np.ndarray]:
    """(heights above touching [m] (rows, n), velocities [m/s] (rows, n, 3)) in equilibrium."""
    run = results[EQUILIBRIUM, HARD]
    late = run.trace["time"] > SETTLED
    return run.trace["position"][late, :, 2] - gases.RADIUS, run.trace["velocity"][late] - drift_speed(run)


def measured_temperature(results: Results) -> float:
    """T [m2/s2] from the kinetic energy of the history."""
    run = results[EQUILIBRIUM, HARD]
    late = run.history["time"].to_numpy() > SETTLED
    kinetic = float(run.history["kinetic_energy"].to_numpy()[late].mean()) / (COUNT * gases.MASS)
    common = drift_speed(run)
    return (2 * kinetic - float(common @ common)) / (3 - 2 / COUNT)


def temperature(results: Results) -> Measured:
    got, want = measured_temperature(results), theory(results).temperature
    return Measured(abs(got / want - 1), got, want)


def centre(results: Results) -> Measured:
    run = results[EQUILIBRIUM, HARD]
    late = run.history["time"].to_numpy() > SETTLED
    got, want = float(run.history["centre_z"].to_numpy()[late].mean()) - gases.RADIUS, theory(results).centre
    return Measured(abs(got / want - 1), got, want)


def hits(results: Results) -> Measured:
    """Hits on the floor per second against N g/sqrt(2 pi T), T as measured."""
    history = results[EQUILIBRIUM, HARD].history
    late = history["time"].to_numpy() > SETTLED
    done, time = history["wall_collisions"].to_numpy()[late], history["time"].to_numpy()[late]
    got = float((done[-1] - done[0]) / (time[-1] - time[0]))
    want = column.floor_rate(COUNT, GRAVITY, measured_temperature(results))
    return Measured(abs(got / want - 1), got, want)


def profile(results: Results) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(edges [m], share of the spheres in each bin, the same by theory), the first bin a diameter high."""
    found = theory(results)
    edges = np.concatenate([np.arange(13) * DIAMETER, [np.inf]])
    share = np.histogram(settled(results)[0], np.concatenate([[-np.inf], edges[1:]]))[0]
    share = share / share.sum()
    law = (1 - found.layer) * np.diff(found.share_below(np.minimum(edges, found.height[-1])))
    law[0] += found.layer
    return edges, share, law


def barometric(results: Results) -> Measured:
    """Sum of |share - theory| over the bins."""
    _, share, law = profile(results)
    return Measured(float(np.abs(share - law).sum()))


def isothermal(results: Results) -> Measured:
    """Largest deviation from the mean of <v^2>: of each axis, and of the lower and the upper half."""
    height, v = settled(results)
    mean = float((v**2).mean())
    low = height < np.median(height)
    parts = {axis: float((v[..., k] ** 2).mean()) for k, axis in enumerate("xyz")}
    parts |= {"lower half": float((v[low] ** 2).mean()), "upper half": float((v[~low] ** 2).mean())}
    value, where = max((abs(part / mean - 1), name) for name, part in parts.items())
    return Measured(value, note=f"largest for {where}")


def conserved(results: Results) -> Measured:
    history = results[EQUILIBRIUM, HARD].history
    energy = (history["kinetic_energy"] + history["potential_energy"]).to_numpy()
    return Measured(
        float(np.abs(energy / energy[0] - 1).max()), note=f"{history['collisions'].iloc[-1]:.0f} collisions"
    )


def overlap(results: Results) -> Measured:
    return Measured(max(float(run.notes["largest_overlap"]) for _, run in results.of(HARD)))


# -- three engines -------------------------------------------------------------------------------------------


def seeds(results: Results, kind: str, code: str) -> list[str]:
    return [label for label in results.labels(code) if label.startswith(f"{kind}_")]


def quantity(run: Run, name: str) -> float:
    """Mean over the second half, by the energy of the start, in which seeds differ."""
    mass, table = COUNT * gases.MASS, run.history
    kinetic, height = table["kinetic_energy"].to_numpy() / mass, table["centre_z"].to_numpy() - gases.RADIUS
    total = kinetic + GRAVITY * height
    half = len(total) // 2
    found = {"energy left": total[half:], "kinetic energy": kinetic[half:], "mean height": height[half:]}
    return float(found[name].mean() / total[0])


def samples(results: Results, kind: str, name: str) -> dict[str, np.ndarray]:
    """Engine -> (seeds,) of a quantity."""
    return {
        code: np.array([quantity(results[label, code], name) for label in seeds(results, kind, code)])
        for code in results.codes(f"{kind}_1")
    }


def rate(results: Results) -> float:
    """Collisions of a sphere with spheres per second [1/s] in the first run with loss."""
    table = results["lossy_1", HARD].history
    return float(2 * (table["collisions"] - table["wall_collisions"]).iloc[-1] / COUNT / DURATION)


def worst(results: Results, kind: str, a: str, b: str) -> Measured:
    """The quantity in which two engines differ most by what is allowed."""
    time_apart = rate(results) * SIZES[results.tier][3]
    found = []
    for name, factor in QUANTITIES.items():
        if kind == "elastic" and name == "energy left":
            continue  # conserved: checked for itself
        soft = factor * time_apart if b == HARD else 0.0
        one = engines.gap(samples(results, kind, name), a, b, soft)
        found.append(Measured(one.value, one.measured, one.expected, f"{name}: {one.note}"))
    if not all(one.value >= 0 for one in found):
        return Measured(float("nan"), note="not a number")
    return max(found, key=lambda one: one.value)


# -- shown ---------------------------------------------------------------------------------------------------


def _equilibrium(results: Results) -> MatplotlibFigure:
    figure, axes = plots.figure()
    height = settled(results)[0] / DIAMETER
    found, edges = theory(results), np.linspace(0, 14, 57)
    share = np.histogram(height, edges)[0] / height.size / np.diff(edges)
    axes.stairs(share, edges, color="#009e73", lw=1.5, label="event-driven")
    law = (1 - found.layer) * found.phi / np.trapezoid(found.phi, found.height / DIAMETER)
    axes.plot(found.height / DIAMETER, law, "k", lw=0.9, label="local equilibrium at one T")
    axes.set(
        xlabel="height above touching / diameter", ylabel="share of the spheres a diameter",
        yscale="log", xlim=(0, 14), ylim=(3e-3, 0.4),
    )  # fmt: skip
    plots.legend(axes)
    return figure


def _curves(results: Results) -> MatplotlibFigure:
    kinds_here = kinds(results)
    figure, axes = plots.figure(
        len(kinds_here), 2, width=plots.WHOLE, height=3.0 * len(kinds_here), squeeze=False
    )
    for (left, right), kind in zip(axes, kinds_here, strict=True):
        for code in results.codes(f"{kind}_1"):
            tables = [results[label, code].history for label in seeds(results, kind, code)]
            time = tables[0]["time"].to_numpy()
            plots.band(left, time, np.array([1e3 * t["centre_z"].to_numpy() for t in tables]), code)
            mass = COUNT * gases.MASS
            plots.band(right, time, np.array([t["kinetic_energy"].to_numpy() / mass for t in tables]), code)
        left.set(xlabel="time [s]", ylabel="mean height [mm]", title=f"e = {KINDS[kind]:g}")
        right.set(xlabel="time [s]", ylabel="kinetic energy a mass [m2/s2]")
        plots.legend(left)
    return figure


def _table(results: Results) -> pandas.DataFrame:
    import pandas

    rows = []
    for kind in kinds(results):
        for name in QUANTITIES:
            found = samples(results, kind, name)
            for code, values in found.items():
                against = float(values.mean() / found[HARD].mean() - 1)
                mean, spread = float(values.mean()), float(values.std(ddof=1))
                rows.append((KINDS[kind], name, plots.name(code), len(values), mean, spread, against))
    columns = ["e [1]", "quantity / energy at the start", "by", "seeds", "mean", "of a seed", "against hard"]
    return pandas.DataFrame(rows, columns=columns)


NEEDS = (HARD,)
SOFT_REASON = (
    "softness: contacts that take t_c make spheres smaller by up to d omega t_c/2 (see haff_box), so that"
    " they collide and lose less and stand lower; no quantity here changes by more than omega t_c"
)
EXACT = (
    ("temperature from the energy of the start", temperature, "local equilibrium and layer at the floor",
     "a third virial coefficient at the floor left out (0.3 %), means over some thousand free falls (0.3 %)",
     "a floor or collision that makes one axis hotter, side walls that are not periodic"),
    ("mean height above touching", centre, "local equilibrium and layer at the floor",
     "as for the temperature; without the layer at the floor it would be 1.4 % off",
     "spheres that touch the floor elsewhere than at their radius; gravity off by 1 %"),
    ("hits on the floor per second", hits, "exact: they carry the weight, N g/sqrt(2 pi T)",
     "scatter of some ten thousand hits", "a floor hit twice, or hits not counted"),
)  # fmt: skip

CASE = Case(
    name="bouncing_gas",
    title="A gas bounces on a floor: three engines",
    purpose=(
        "Spheres fall on an elastic floor. Without loss they come to rest as a column of one temperature,"
        " whose height, profile and hits on the floor follow from the energy they start with: hard spheres"
        " are held to that. With loss, e = 0.95, the column sinks while omega t_c grows. From the same"
        " starts gpudem, LIGGGHTS and hard spheres have to sink alike, up to the scatter of the seeds and"
        " the time a soft contact takes."
    ),
    source="Carnahan and Starling (1969); contact theorem and second virial coefficient at a hard wall.",
    variants=variants,
    checks=(
        *gases.early_checks(),
        *(
            Check(
                name=f"{name}, relative error (event-driven)", measure=measure, tolerance=0.01, unit="1",
                against=against, mark="A", needs=NEEDS, reason=reason, catches=catches,
            )
            for name, measure, against, reason, catches in EXACT
        ),
        Check(
            name="profile, sum of |share of the spheres - theory| over heights of a diameter (event-driven)",
            measure=barometric, tolerance=0.03, unit="1", against="barometric, with Carnahan and Starling",
            mark="A", needs=NEEDS, reason="slow waves of the column; the layer at the floor spills over",
            catches="a wrong profile with the right mean height",
        ),
        Check(
            name="<v^2> of each axis, of the lower and upper half against the mean (event-driven)",
            measure=isothermal, tolerance=0.02, unit="1", against="equipartition", mark="A", needs=NEEDS,
            reason="waves along the height, with few degrees of freedom, scatter by some 0.5 %",
            catches="a floor or gravity that heats, a temperature that changes with height",
        ),
        Check(
            name="kinetic and potential energy, largest change (event-driven)", measure=conserved,
            tolerance=1e-11, unit="1", against="conservation", mark="A", needs=NEEDS, reason="rounding",
            catches="any flight, collision or hit on the floor that gives or takes energy",
        ),
        Check(
            name="largest overlap at a collision / diameter (event-driven)", measure=overlap, tolerance=1e-9,
            unit="1", against="hard spheres", mark="A", needs=NEEDS,
            reason="rounding of positions after a flight", catches="a collision found late",
        ),
        *(
            Check(
                name=f"{kind}: energy and height late in the run, {name} / allowed ({a})",
                measure=lambda results, kind=kind, a=a, b=b: worst(results, kind, a, b),
                tolerance=1.0, unit="1", against=plots.name(b), mark="X", needs=ALL,
                tiers=("quick", "standard", "full") if kind == "lossy" else ("standard", "full"),
                reason=f"{engines.SIGMAS:g} standard errors over the seeds"
                + (f", and one way {SOFT_REASON}" if b == HARD else "; same law, same softness"),
                catches="a restitution off by 0.01; collisions or hits on the floor missed",
            )
            for kind in KINDS
            for a, b, name in (
                (CODES[0], HARD, "difference from hard spheres"),
                (CODES[1], HARD, "difference from hard spheres"),
                (*CODES, "difference of the soft codes"),
            )
        ),
    ),
    figures=(
        Figure(
            "The column in equilibrium",
            "Spheres by height. In the lowest diameter there are more than the local equilibrium has, for"
            " want of neighbours below; that layer is part of the theory too.",
            _equilibrium, needs=NEEDS,
        ),
        Figure(
            "Three engines from the same starts",
            "Mean and range over the seeds: the lattice falls, bounces and sinks.",
            _curves, needs=NEEDS,
        ),
    ),
    tables=(
        Table("Three engines, late in the run", "Means over the second half of it.", _table, needs=NEEDS),
    ),
    features=("normal hooke", "damping", "gravity", "wall plane", "periodic sides", "sphere-sphere"),
    order=73,
)  # fmt: skip
