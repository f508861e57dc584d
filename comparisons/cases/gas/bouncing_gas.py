"""A gas of hard spheres falls on an elastic floor: equilibrium in closed form, and three engines."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from comparisons import kit
from comparisons.cases.gas import scenes as gases
from comparisons.cases.gas.checks import EARLY, HARD, collisions, conserved, early_checks, hard, no_overlap
from comparisons.cases.side_by_side import floor
from comparisons.harness import codes
from comparisons.metrics import engines
from comparisons.oracles import column
from comparisons.report import plots
from gpudem.output.run import Run
from gpudem.scene import Domain, Lattice, Output, Scene, Time

DIAMETER, GRAVITY, COUNT, CELLS, STEPS = gases.DIAMETER, 9.81, 392, 7, 30
#: Spheres per floor area of a square diameter; starts as a lattice eight layers high.
COVER = 2.0
EDGE = math.sqrt(COUNT / COVER) * DIAMETER
DURATION, EARLY_TIME, RMS = 0.12, 0.01, 0.25
#: From here on the column rests, some thirty times sqrt(T)/g [s].
SETTLED, EQUILIBRIUM = 1.0, "equilibrium"
#: Seeds of the hard spheres, which cost little.
HARD_SEEDS = 16
#: Tier -> length of the run in equilibrium [s], seeds of all engines with loss and without, contact time [s].
SIZES: dict[kit.Tier, tuple[float, int, int, float]] = {
    "quick": (12.0, 3, 0, 2e-4), "standard": (40.0, 5, 4, 1e-4), "full": (200.0, 10, 10, 5e-5),
}  # fmt: skip
#: Quantity -> the most that softness changes it, relative, by omega t_c (see SOFT_REASON).
QUANTITIES = {"energy left": 1.0, "kinetic energy": 1.0, "mean height": -1.0}
KINDS = {"lossy": 0.95, "elastic": 1.0}


def scene(seed: int, restitution: float, contact_time: float, duration: float, **output: Any) -> Scene:
    """Spheres over a floor, periodic sides."""
    pitch = EDGE / CELLS
    return Scene(
        name="bouncing_gas",
        **gases.springs(contact_time, restitution, "floor", tangential="off"),
        particles=Lattice(
            source="lattice", material="ball", count=COUNT, radius=gases.RADIUS, lo=(0, 0, 0),
            hi=(EDGE, EDGE, COUNT / CELLS**2 * pitch * (1 + 1e-9)), spacing=pitch / DIAMETER * (1 - 1e-9),
            velocity_rms=RMS, seed=seed,
        ),
        gravity=(0.0, 0.0, -GRAVITY),
        walls=[floor()],
        domain=Domain(lo=(0, 0, 0), hi=(EDGE, EDGE, 0.6), periodic=(True, True, False)),
        time=Time(step=contact_time / STEPS, duration=duration), output=Output(**output),
    )  # fmt: skip


def variants(tier: kit.Tier) -> list[kit.Variant]:
    long, lossy, elastic, t_c = SIZES[tier]
    early = scene(1, KINDS["lossy"], t_c, EARLY_TIME, trace_every=50 * (t_c / STEPS))
    rest = scene(1, 1.0, t_c, long, history_every=0.01, trace_every=max(0.02, long / 1000))
    made = [kit.Variant(EARLY, early), kit.Variant(EQUILIBRIUM, rest, (HARD,))]
    for kind, count in (("lossy", lossy), ("elastic", elastic)):
        for s in range(1, HARD_SEEDS + 1 if count else 1):
            one = scene(s, KINDS[kind], t_c, DURATION, history_every=2e-3)
            made.append(kit.Variant(f"{kind}_{s}", one, codes.built_in() if s <= count else (HARD,)))
    return made


# -- equilibrium ---------------------------------------------------------------------------------------------


def theory(results: kit.Results) -> tuple[column.Column, np.ndarray]:
    """(the column of the energy of the start, without that of the common motion along the floor; the velocity
    of that [m/s], which is constant).
    """

    def compute() -> tuple[column.Column, np.ndarray]:
        run = results[EQUILIBRIUM, HARD]
        common = run.scene.state.velocity.mean(axis=0) * (1, 1, 0)
        total = float((run.history["kinetic_energy"] + run.history["potential_energy"]).iloc[0])
        free = total / (COUNT * gases.MASS) - GRAVITY * gases.RADIUS - 0.5 * float(common @ common)
        return column.of_energy(free, 3 - 2 / COUNT, GRAVITY, DIAMETER, COVER / DIAMETER**2), common

    return results.once("column", compute)


def settled(results: kit.Results) -> tuple[np.ndarray, np.ndarray]:
    """(heights above touching [m] (rows, n), velocities [m/s] (rows, n, 3)) in equilibrium."""
    trace = results[EQUILIBRIUM, HARD].trace
    late = trace["time"] > SETTLED
    return trace["position"][late, :, 2] - gases.RADIUS, trace["velocity"][late] - theory(results)[1]


def means(results: kit.Results) -> dict[str, tuple[float, float]]:
    """(observed, by theory) in equilibrium: T [m2/s2] from the kinetic energy; mean height above touching
    [m]; impacts on the floor per second, N g/sqrt(2 pi T) with T as observed.
    """
    table, (found, common) = results[EQUILIBRIUM, HARD].history, theory(results)
    columns = (table[name].to_numpy() for name in ("time", "kinetic_energy", "centre_z", "wall_collisions"))
    time, kinetic, height, hits = np.array([x[table["time"].to_numpy() > SETTLED] for x in columns])
    each = float(kinetic.mean()) / (COUNT * gases.MASS)
    t = (2 * each - float(common @ common)) / (3 - 2 / COUNT)
    return {
        "temperature": (t, found.temperature),
        "height": (float(height.mean()) - gases.RADIUS, found.centre),
        "hits": (float(np.ptp(hits) / np.ptp(time)), column.floor_rate(COUNT, GRAVITY, t)),
    }


def barometric(results: kit.Results) -> float:
    """Sum of |share of the spheres - theory| over bins a diameter high."""
    found, edges = theory(results)[0], np.concatenate([np.arange(13) * DIAMETER, [np.inf]])
    share = np.histogram(settled(results)[0], np.concatenate([[-np.inf], edges[1:]]))[0]
    law = (1 - found.layer) * np.diff(found.share_below(np.minimum(edges, found.height[-1])))
    law[0] += found.layer
    return float(np.abs(share / share.sum() - law).sum())


def isothermal(results: kit.Results) -> dict[str, float]:
    """Deviation from the mean of <v^2>: of each axis, and of the lower and the upper half."""
    height, v = settled(results)
    low = height < np.median(height)
    parts = {axis: v[..., k] for k, axis in enumerate("xyz")} | {"lower half": v[low], "upper half": v[~low]}
    mean = float((v**2).mean())
    return {name: abs(float((part**2).mean()) / mean - 1) for name, part in parts.items()}


# -- three engines -------------------------------------------------------------------------------------------


def kinds(results: kit.Results) -> list[str]:
    """Kinds of seeds that the tier has."""
    return [kind for kind in KINDS if f"{kind}_1" in results.labels()]


def quantities(run: Run) -> tuple[float, ...]:
    """QUANTITIES: means over the second half, by the energy of the start, in which seeds differ."""
    kinetic = run.history["kinetic_energy"].to_numpy() / (COUNT * gases.MASS)
    height = run.history["centre_z"].to_numpy() - gases.RADIUS
    total = kinetic + GRAVITY * height
    return tuple(float(x[len(total) // 2 :].mean() / total[0]) for x in (total, kinetic, height))


def samples(results: kit.Results, kind: str) -> dict[str, dict[str, np.ndarray]]:
    """Quantity -> engine -> (seeds,)."""
    found = {}
    for code in results.codes(f"{kind}_1"):
        labels = results.labels(code, prefix=f"{kind}_")
        found[code] = np.array([quantities(results[label, code]) for label in labels])
    return {name: {code: x[:, k] for code, x in found.items()} for k, name in enumerate(QUANTITIES)}


def gaps(results: kit.Results, kind: str, a: str, b: str) -> dict[str, kit.Measured]:
    """Quantity -> by how much two engines differ, by what is allowed."""
    omega = float(2 * collisions(results, "lossy_1")[-1] / COUNT / DURATION)
    soft = omega * SIZES[results.tier][3] if b == HARD else 0.0
    return {
        name: engines.gap(values, a, b, soft * QUANTITIES[name])
        for name, values in samples(results, kind).items()
        if (kind, name) != ("elastic", "energy left")  # that is conserved
    }


SOFT_REASON = (
    "softness: contacts that take t_c make spheres smaller by up to d omega t_c/2 (see haff_box), so that"
    " they collide less often, lose less energy and stand lower; no quantity here changes by more than omega"
    " t_c"
)


def engine_checks(a: str, b: str) -> tuple[kit.Check, ...]:
    """A code against hard spheres, or against another code, with loss and without."""
    hard = b == HARD
    return tuple(
        kit.check(
            f"{kind}: energy and height late in the run,"
            f" difference {'from hard spheres' if hard else 'of the soft codes'} / allowed ({a})",
            lambda results, kind=kind: gaps(results, kind, a, b), tolerance=1.0,
            against=codes.title(b), mark="X", needs=tuple(dict.fromkeys((a, b, HARD))),
            tiers=kit.TIERS if kind == "lossy" else ("standard", "full"),
            reason=f"{engines.SIGMAS:g} standard errors over the seeds"
            + (f", and one way {SOFT_REASON}" if hard else "; same law, same softness"),
            catches="a restitution off by 0.01; collisions or impacts on the floor missed",
        )
        for kind in KINDS
    )  # fmt: skip


def _equilibrium(results: kit.Results) -> plots.Figure:
    figure, axes = plots.figure()
    height, edges, found = settled(results)[0] / DIAMETER, np.linspace(0, 14, 57), theory(results)[0]
    share = np.histogram(height, edges)[0] / height.size / np.diff(edges)
    axes.stairs(share, edges, color=plots.color(HARD), lw=1.5, label="event-driven")
    law = (1 - found.layer) * found.phi / np.trapezoid(found.phi, found.height / DIAMETER)
    axes.plot(found.height / DIAMETER, law, "k", lw=0.9, label="local equilibrium at one T")
    axes.set(
        xlabel="height of the center above its lowest / diameter",
        ylabel="fraction of the spheres per diameter",
    )
    axes.set(yscale="log", xlim=(0, 14), ylim=(3e-3, 0.4))
    plots.legend(axes)
    return figure


def _curves(results: kit.Results) -> plots.Figure:
    rows = len(kinds(results))
    figure, axes = plots.figure(rows, 2, width=plots.WHOLE, height=3.0 * rows, squeeze=False)
    columns = (("centre_z", 1e3, "mean height [mm]"),
               ("kinetic_energy", 1 / (COUNT * gases.MASS), "kinetic energy per mass [m2/s2]"))  # fmt: skip
    for row, kind in zip(axes, kinds(results), strict=True):
        for ax, (name, scale, title) in zip(row, columns, strict=True):
            for code in results.codes(f"{kind}_1"):
                tables = [results[label, code].history for label in results.labels(code, prefix=f"{kind}_")]
                values = np.array([scale * table[name].to_numpy() for table in tables])
                plots.band(ax, tables[0]["time"].to_numpy(), values, code)
            ax.set(xlabel="time [s]", ylabel=title)
        row[0].set_title(f"e = {KINDS[kind]:g}")
        plots.legend(row[0])
    return figure


def _table(results: kit.Results) -> kit.Rows:
    return [
        {"e [1]": KINDS[kind], "quantity / energy at the start": name, "code": plots.name(code),
         "seeds": len(values), "mean": float(values.mean()),
         "standard deviation of a seed": float(values.std(ddof=1)),
         "relative difference from event-driven": float(values.mean() / found[HARD].mean() - 1)}
        for kind in kinds(results)
        for name, found in samples(results, kind).items()
        for code, values in found.items()
    ]  # fmt: skip


#: Of hard spheres in equilibrium: name, measure, tolerance, what it is held against, reason, what it detects.
EQUILIBRIUM_CHECKS: tuple[tuple[str, Callable[[kit.Results], kit.Found], float, str, str, str], ...] = (
    ("temperature from the energy of the start, relative error", lambda r: means(r)["temperature"], 0.01,
     "local equilibrium and layer at the floor",
     "no third virial coefficient at the floor (0.3 %), means over some thousand free falls (0.3 %)",
     "a floor or collision that makes one axis hotter, side walls that are not periodic"),
    ("mean height above touching, relative error", lambda r: means(r)["height"], 0.01,
     "local equilibrium and layer at the floor",
     "as for the temperature; without the layer at the floor it would be 1.4 % off",
     "spheres that touch the floor elsewhere than at their radius; gravity off by 1 %"),
    ("hits on the floor per second, relative error", lambda r: means(r)["hits"], 0.01,
     "exact: they carry the weight, N g/sqrt(2 pi T)", "scatter of some ten thousand impacts",
     "an impact on the floor counted twice, or not at all"),
    ("profile, sum of |share of the spheres - theory| over heights of a diameter", barometric, 0.03,
     "barometric, with Carnahan and Starling",
     "slow waves of the column; the layer at the floor exceeds its bin",
     "a wrong profile with the right mean height"),
    ("<v^2> of each axis, of the lower and upper half against the mean", isothermal, 0.02, "equipartition",
     "waves along the height, which have few degrees of freedom, scatter by about 0.5 %",
     "a floor or gravity that heats, a temperature that changes with height"),
)  # fmt: skip

CASE = kit.Case(
    name="bouncing_gas", title="A gas bounces on a floor: three engines",
    purpose="Spheres fall on an elastic floor. Without loss they come to rest as a column of one temperature,"
    " whose height, profile and impacts on the floor follow from the energy of the start: a test of the"
    " event-driven engine. With loss, e = 0.95, the column sinks while omega t_c grows. From the same initial"
    " states the columns of all codes must sink equally, up to the scatter of the seeds and the effect of the"
    " finite contact time.",
    source="Carnahan and Starling (1969); contact theorem and second virial coefficient at a hard wall.",
    variants=variants,
    checks=(
        *early_checks(),
        *(
            hard(f"{name} (event-driven)", measure, tolerance, against, reason, catches)
            for name, measure, tolerance, against, reason, catches in EQUILIBRIUM_CHECKS
        ),
        conserved(
            "kinetic and potential energy, largest change (event-driven)",
            ("kinetic_energy", "potential_energy"), EQUILIBRIUM,
        ),
        no_overlap(), kit.PerCode(lambda code: engine_checks(code, HARD)), kit.PerPair(engine_checks),
    ),
    figures=(
        kit.Figure(
            "The column in equilibrium",
            "Spheres by height. The lowest diameter holds more of them than in local equilibrium, for want of"
            " neighbors below; that layer is part of the theory too.",
            _equilibrium, needs=(HARD,),
        ),
        kit.Figure(
            "Three engines from the same starts",
            "Mean and range over the seeds: the lattice falls, bounces and sinks.",
            _curves, needs=(HARD,),
        ),
    ),
    tables=(kit.Table(
        "Three engines, late in the run", "Means over the second half of it.", _table, needs=(HARD,)
    ),),
    features=("normal hooke", "damping", "gravity", "wall plane", "periodic sides", "sphere-sphere"),
    order=73,
)  # fmt: skip
