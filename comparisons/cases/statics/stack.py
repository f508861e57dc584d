"""Columns of spheres under their weight: load on the floor, every overlap, energy of an elastic one."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from comparisons.cases.single_contact.checks import CODES
from comparisons.harness.case import Case, Check, Figure, Measured, Results, Table, Variant
from comparisons.metrics.trace import largest_difference
from comparisons.oracles.bodies import Bodies, bodies
from comparisons.report import plots
from gpudem.output.run import Run
from gpudem.scene import Domain, Explicit, Material, Output, Pair, Plane, Scene, Time

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure as MatplotlibFigure

GRAVITY = 9.81
#: Each column from below: radius [m] and material of each sphere.
COLUMNS = (
    ((0.003, "light"),) * 8,
    (
        (0.003, "light"),
        (0.005, "heavy"),
        (0.002, "light"),
        (0.004, "heavy"),
        (0.003, "heavy"),
        (0.002, "heavy"),
    ),
    ((0.006, "heavy"),),
)
MATERIALS = {
    "light": Material(young=5e6, poisson=0.34, density=1768.0),
    "heavy": Material(young=2e7, poisson=0.25, density=4000.0),
    "wall": Material(young=1e8, poisson=0.37, density=1185.0),
}
SPACING, STEP = 0.02, 1e-5
#: Settled from just touching: restitution 0.1, 1.2 s. Elastic: released from touching, two steps.
SETTLED, ELASTIC = "settled", {"elastic_4e-6": 4e-6, "elastic_2e-6": 2e-6, "elastic_1e-6": 1e-6}
SETTLE_TIME, ELASTIC_TIME = 1.2, 0.02


def scene(restitution: float, step: float, duration: float, every: float) -> Scene:
    """All columns side by side, each sphere just touching the next."""
    position, radius, material = [], [], []
    for k, column in enumerate(COLUMNS):
        height = 0.0
        for r, name in column:
            position.append((SPACING * k, 0.0, height + r))
            radius.append(r)
            material.append(name)
            height += 2 * r
    names = list(MATERIALS)
    pairs = [Pair(materials=(a, b), restitution=restitution) for i, a in enumerate(names) for b in names[i:]]
    return Scene(
        name="stack", materials=MATERIALS, pairs=pairs,
        particles=Explicit(position=position, radius=np.array(radius), material=material),
        gravity=(0.0, 0.0, -GRAVITY),
        walls=[Plane(name="floor", material="wall", point=(0, 0, 0), normal=(0, 0, 1))],
        domain=Domain(lo=(-0.02, -0.02, -0.001), hi=(SPACING * len(COLUMNS), 0.02, 0.08)),
        time=Time(step=step, duration=duration), output=Output(trace_every=every),
    )  # fmt: skip


def variants() -> list[Variant]:
    settled = Variant(SETTLED, scene(0.1, STEP, SETTLE_TIME, 4e-3))
    return [settled, *(Variant(k, scene(1.0, dt, ELASTIC_TIME, 2e-5)) for k, dt in ELASTIC.items())]


def contacts(stated: Scene) -> list[tuple[int, int | str, Bodies, float]]:
    """(row above, row below or "floor", bodies, weight carried [N]) of every contact, column by column."""
    found, first = [], 0
    for column in COLUMNS:
        rows = list(range(first, first + len(column)))
        mass = [bodies(stated, row, "floor").mass[0] for row in rows]
        for k, row in enumerate(rows):
            below = "floor" if k == 0 else rows[k - 1]
            found.append((row, below, bodies(stated, row, below), sum(mass[k:]) * GRAVITY))
        first += len(column)
    return found


def overlap(run: Run, above: int, below: int | str) -> np.ndarray:
    """Overlap [m] in time, negative apart."""
    z, radius = run.trace["position"][:, :, 2], run.scene.state.radius
    if isinstance(below, str):
        return radius[above] - z[:, above]
    return radius[above] + radius[below] - (z[:, above] - z[:, below])


def overlaps(results: Results, code: str) -> Measured:
    """Largest relative error of a settled overlap against (weight above / k)^(2/3)."""
    run, rows = results[SETTLED, code], []
    for above, below, c, weight in contacts(run.scene):
        want = (weight / c.normal_constant) ** (2 / 3)
        got = float(overlap(run, above, below)[-1])
        rows.append((abs(got / want - 1), got, want, f"sphere {above + 1} on {below}"))
    value, got, want, where = max(rows, key=lambda row: row[0])
    return Measured(value, got, want, f"{len(rows)} contacts; largest at {where}")


def base_load(results: Results, code: str) -> Measured:
    """Largest relative difference of the force on the floor, k overlap^1.5, and the weight of the column."""
    run, rows = results[SETTLED, code], []
    for above, below, c, weight in contacts(run.scene):
        if below == "floor":
            deep = float(overlap(run, above, below)[-1])
            rows.append(
                (abs(c.normal_constant * deep**1.5 / weight - 1), c.normal_constant * deep**1.5, weight)
            )
    value, got, want = max(rows)
    return Measured(value, got, want, f"{len(rows)} columns")


def energy(run: Run) -> np.ndarray:
    """Kinetic + m g z + 2/5 k overlap^2.5 of all contacts, less its start [J], over time."""
    found = contacts(run.scene)
    total = np.zeros(len(run.trace["time"]))
    for above, below, c, _ in found:
        total += 0.4 * c.normal_constant * np.maximum(overlap(run, above, below), 0.0) ** 2.5
    mass = np.array([c.mass[0] for _, _, c, _ in found])
    total += 0.5 * (run.trace["velocity"] ** 2).sum(axis=2) @ mass
    total += GRAVITY * (run.trace["position"][:, :, 2] @ mass)
    return total - total[0]


def turned(run: Run) -> float:
    """Largest kinetic energy [J]: what is turned over in the swing."""
    mass = np.array([c.mass[0] for _, _, c, _ in contacts(run.scene)])
    return float((0.5 * (run.trace["velocity"] ** 2).sum(axis=2) @ mass).max())


def energy_error(results: Results, code: str) -> Measured:
    """Largest change of the total energy at the finest step, by the largest kinetic energy."""
    run = results[list(ELASTIC)[-1], code]
    return Measured(float(np.abs(energy(run)).max()) / turned(run), note=f"{run.scene.n_steps} steps")


def energy_order(results: Results, code: str) -> float:
    """Slope of log(largest change) against log(step)."""
    steps = list(ELASTIC.values())
    off = [float(np.abs(energy(results[name, code])).max()) for name in ELASTIC]
    return float(np.polyfit(np.log(steps), np.log(off), 1)[0])


def between(results: Results, column: str) -> Measured:
    """Largest difference between the codes over all traces; by radius, or sqrt(g R) of the smallest."""
    found = {}
    for name in results.labels():
        a, b = (results[name, code] for code in CODES)
        small = float(a.scene.state.radius.min())
        scale = small if column == "position" else math.sqrt(GRAVITY * small)
        found[name] = largest_difference(a.trace[column], b.trace[column], scale)
    worst = max(found, key=lambda name: np.nan_to_num(found[name], nan=np.inf))
    return Measured(found[worst], note=f"{len(found)} runs; largest in {worst}")


def _figure(results: Results) -> MatplotlibFigure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.8)
    for k in range(len(COLUMNS)):
        offset = sum(len(c) for c in COLUMNS[:k])
        for code in results.codes(SETTLED):
            run = results[SETTLED, code]
            rows = contacts(run.scene)[offset : offset + len(COLUMNS[k])]
            level = np.arange(1, len(rows) + 1)
            if code == CODES[0]:
                want = [1e6 * (w / c.normal_constant) ** (2 / 3) for _, _, c, w in rows]
                left.plot(want, level, "-", color=plots.SERIES[k], lw=0.9, label=f"column {k + 1}")
            got = [1e6 * overlap(run, above, below)[-1] for above, below, _, _ in rows]
            left.plot(got, level, "x" if code == CODES[0] else "o", color=plots.SERIES[k], mfc="none")
    left.set(xlabel="overlap at rest [um]", ylabel="contact, counted from the floor")
    plots.legend(left)
    for k, name in enumerate(ELASTIC):
        for code in results.codes(name):
            run = results[name, code]
            off = np.abs(energy(run)) / turned(run)
            thin = slice(1, None) if code == CODES[0] else slice(1, None, 40)
            text = f"step {ELASTIC[name]:g} s" if code == CODES[0] else None
            line = "-" if code == CODES[0] else "o"
            style = {"color": plots.SERIES[k], "ms": 4, "mfc": "none", "lw": 0.8, "label": text}
            right.semilogy(run.trace["time"][thin], np.maximum(off[thin], 1e-14), line, **style)
    right.set(xlabel="time [s]", ylabel="|change of energy| / largest kinetic energy")
    plots.legend(right)
    return figure


def _table(results: Results) -> pandas.DataFrame:
    import pandas

    rows = []
    for above, below, c, weight in contacts(results[SETTLED, results.codes()[0]].scene):
        row: dict[str, object] = {"sphere": above + 1, "on": below if below == "floor" else int(below) + 1}
        row |= {"weight carried [N]": weight, "closed form [m]": (weight / c.normal_constant) ** (2 / 3)}
        row |= {f"{code} [m]": overlap(results[SETTLED, code], above, below)[-1] for code in results.codes()}
        rows.append(row)
    return pandas.DataFrame(rows)


CASE = Case(
    name="stack",
    title="Columns under their own weight",
    purpose=(
        "Columns of spheres, equal ones, mixed ones, and a single one, settle on a floor. At rest each"
        " contact carries exactly what lies above it, so that every overlap is (weight/k)^(2/3) and the load"
        " on the floor is the weight: nothing of the load may leak into a numerical crutch. Without damping"
        " the same columns swing for ever, and kinetic, elastic and potential energy together must stay."
    ),
    source="Statics with Hertz (1882); energy: as in LAMMPS' unittest/granular, stack_energy.",
    variants=lambda tier: variants(),
    checks=(
        *(
            Check(
                name=f"{name}, largest difference over the traces",
                measure=lambda results, column=column: between(results, column),
                tolerance=1e-9, unit="1", against="LIGGGHTS", mark="X", needs=CODES,
                reason="same law, same scheme: rounding, over 120 000 steps in contact",
                catches="an effective mass or radius mixed up between unlike spheres",
            )
            for name, column in (("position / smallest radius", "position"),
                                 ("velocity / sqrt(g R)", "velocity"))
        ),
        *(
            Check(
                name=f"{name} ({code})",
                measure=lambda results, code=code, measure=measure: measure(results, code),
                tolerance=1e-6, unit="1", against="closed form", mark="A", needs=(code,),
                reason="settled: what is left of the swing; the step does not enter at rest",
                catches=catches,
            )
            for code in CODES
            for name, measure, catches in (
                ("overlaps at rest against (weight above / k)^(2/3), largest relative error", overlaps,
                 "a wrong E*, R* of a pair of unlike spheres or of the wall"),
                ("load on the floor against the weight, relative error", base_load,
                 "a force that is not opposite on both sides of a contact"),
            )
        ),
        *(
            Check(
                name=f"elastic: change of the total energy / largest kinetic energy ({code})",
                measure=lambda results, code=code: energy_error(results, code),
                tolerance=1e-4, unit="1", against="conservation", mark="A", needs=(code,),
                reason="velocity Verlet: bounded and of second order in the step",
                catches="an integrator of first order, which feeds or drains the swing",
            )
            for code in CODES
        ),
        *(
            Check(
                name=f"elastic: observed order of that change in the time step ({code})",
                measure=lambda results, code=code: energy_order(results, code),
                lo=1.8, tolerance=2.2, unit="1", against="conservation", mark="A", needs=(code,),
                reason="velocity Verlet", catches="a force that lags by a step: order 1",
            )
            for code in CODES
        ),
    ),
    figures=(
        Figure(
            "Overlaps at rest, and energy of the elastic columns",
            "Left: closed form (lines), gpudem (crosses), LIGGGHTS (circles); in the mixed column the"
            " overlaps jump with radius and modulus. Right: a quarter of the change for half the step, and"
            " no drift.",
            _figure,
        ),
    ),
    tables=(Table("Overlaps at rest", "Each contact and what it carries.", _table),),
    features=(
        "normal hertz", "damping", "gravity", "wall plane", "several radii", "several materials",
        "sphere-sphere",
    ),
    order=46,
)  # fmt: skip
