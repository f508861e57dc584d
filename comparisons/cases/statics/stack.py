"""Columns of spheres under their weight: load on the floor, every overlap, energy of an elastic one."""

from __future__ import annotations

import math

import numpy as np

from comparisons import kit
from comparisons.cases.side_by_side import every_pair, floor, traced
from comparisons.oracles.bodies import Bodies, bodies
from comparisons.report import plots
from gpudem.output.run import Run
from gpudem.scene import Explicit, Material, Scene

GRAVITY = 9.81
#: Each column from below: radius [m] and material of each sphere.
COLUMNS = (
    ((0.003, "light"),) * 8,
    (
        *((0.003, "light"), (0.005, "heavy"), (0.002, "light")),
        *((0.004, "heavy"), (0.003, "heavy"), (0.002, "heavy")),
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
    position = [
        (SPACING * k, 0.0, sum(2 * r for r, _ in column[:n]) + column[n][0])
        for k, column in enumerate(COLUMNS)
        for n in range(len(column))
    ]
    spheres = [sphere for column in COLUMNS for sphere in column]
    radius, material = ([sphere[k] for sphere in spheres] for k in (0, 1))
    return traced(
        "stack", Explicit(position=position, radius=radius, material=material), materials=MATERIALS,
        pairs=every_pair(list(MATERIALS), [], restitution=restitution), gravity=(0.0, 0.0, -GRAVITY),
        walls=[floor("wall")], step=step, duration=duration, every=every,
        lo=(-0.02, -0.02, -0.001), hi=(SPACING * len(COLUMNS), 0.02, 0.08),
    )  # fmt: skip


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


def overlaps(results: kit.Results, code: str) -> dict[str, tuple[float, float]]:
    run, found = results[SETTLED, code], {}
    for above, below, c, weight in contacts(run.scene):
        lower = below if isinstance(below, str) else f"sphere {below + 1}"
        got = float(overlap(run, above, below)[-1])
        found[f"sphere {above + 1} on {lower}"] = got, (weight / c.normal_constant) ** (2 / 3)
    return found


def base_load(results: kit.Results, code: str) -> dict[str, tuple[float, float]]:
    run = results[SETTLED, code]
    return {
        f"sphere {above + 1}": (c.normal_constant * overlap(run, above, below)[-1] ** 1.5, weight)
        for above, below, c, weight in contacts(run.scene)
        if below == "floor"
    }


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


def drift(run: Run) -> np.ndarray:
    mass = np.array([c.mass[0] for _, _, c, _ in contacts(run.scene)])
    return np.abs(energy(run)) / float((0.5 * (run.trace["velocity"] ** 2).sum(axis=2) @ mass).max())


def _figure(results: kit.Results) -> plots.Figure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.8)
    ran, first = results.codes(), 0
    rest = {code: 1e6 * np.array(list(overlaps(results, code).values())) for code in ran}
    for k, column in enumerate(COLUMNS):
        own, levels = slice(first, first + len(column)), np.arange(len(column)) + 1
        found = {code: (pairs[own, 0], levels) for code, pairs in rest.items()}
        exact = rest[ran[0]][own, 1], levels
        plots.exact_and_marks(left, None, exact, found, plots.SERIES[k], f"column {k + 1}")
        first += len(column)
    for k, (name, step) in enumerate(ELASTIC.items()):
        for code in ran:
            run, text = results[name, code], f"step {step:g} s" if code == ran[0] else None
            look = plots.line_or_marks(code, len(run.trace["time"]), color=plots.SERIES[k], lw=0.8)
            right.semilogy(run.trace["time"][1:], np.maximum(drift(run)[1:], 1e-14), **look, label=text)
    left.set(xlabel="overlap at rest [um]", ylabel="contact, counted from the floor")
    plots.legend(left, points=ran)
    right.set(xlabel="time [s]", ylabel="|change of energy| / largest kinetic energy")
    plots.legend(right, lines=ran)
    return figure


CASE = kit.Case(
    name="stack",
    title="Columns under their own weight",
    purpose=(
        "Columns of equal spheres, of unequal ones, and a single sphere settle on a floor. At rest each"
        " contact carries exactly the weight above it: every overlap is (weight/k)^(2/3), the load on the"
        " floor is the weight, and no numerical force may carry a part of it. Without damping the same"
        " columns oscillate forever, and the sum of kinetic, elastic and potential energy is conserved."
    ),
    source="Statics with Hertz (1882); energy: as in LAMMPS' unittest/granular, stack_energy.",
    variants=lambda tier: [
        kit.Variant(SETTLED, scene(0.1, STEP, SETTLE_TIME, 4e-3)),
        *(kit.Variant(k, scene(1.0, dt, ELASTIC_TIME, 2e-5)) for k, dt in ELASTIC.items()),
    ],
    checks=(
        *(
            kit.step_by_step(
                f"{column} / {unit}, largest difference over the traces", column, scale,
                tolerance=1e-9, reason="same law, same scheme: rounding, over 120 000 steps in contact",
                catches="an effective mass or radius mixed up between unlike spheres",
            )
            for column, unit, scale in (
                ("position", "smallest radius", lambda run: run.scene.state.radius.min()),
                ("velocity", "sqrt(g R)", lambda run: math.sqrt(GRAVITY * run.scene.state.radius.min())),
            )
        ),
        *(
            kit.per_code(
                name, measure, tolerance=1e-6, against="closed form", catches=catches,
                reason="what remains of the oscillation after settling; at rest the step has no influence",
            )
            for name, measure, catches in (
                ("overlaps at rest against (weight above / k)^(2/3), largest relative error", overlaps,
                 "a wrong E*, R* of a pair of unlike spheres or of the wall"),
                ("load on the floor against the weight, relative error", base_load,
                 "a force that is not opposite on both sides of a contact"),
            )
        ),
        kit.per_code(
            "elastic: change of the total energy / largest kinetic energy",
            lambda results, code: float(drift(results[results.finest("elastic"), code]).max()),
            tolerance=1e-4, against="conservation",
            reason="velocity Verlet: bounded and of second order in the step",
            catches="an integrator of first order, which adds or removes energy",
        ),
        kit.observed_order(
            "elastic: observed order of that change in the time step",
            lambda results, label, code: float(np.abs(energy(results[label, code])).max()),
            (1.8, 2.2), prefix="elastic", against="conservation", reason="velocity Verlet",
            catches="a force that lags by a step: order 1",
        ),
    ),
    figures=(
        kit.Figure(
            "Overlaps at rest, and energy of the elastic columns",
            "Left: closed form (lines); in the mixed column the overlaps change with radius and modulus."
            " Right: a quarter of the change for half the step, and no drift.",
            _figure,
        ),
    ),
    tables=(
        kit.table("Overlaps at rest", "Each contact.", {"overlap [m]": overlaps}, rows="contact"),
    ),
    features=(
        "normal hertz", "damping", "gravity", "wall plane", "several radii", "several materials",
        "sphere-sphere",
    ),
    order=46,
)  # fmt: skip
