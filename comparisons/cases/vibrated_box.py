"""Hard disks over a fast vibrating floor: event-driven and by time steps."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from comparisons import plots, soft_disks, soft_disks_checks, time_stepping
from comparisons.case import Case, Check, Figure, Measured, Results, Table, Tier, Variant
from gpudem.event_driven.statement import Statement
from gpudem.run import Run
from gpudem.scene import (
    Box,
    Contact,
    Domain,
    Explicit,
    Material,
    Output,
    Pair,
    Plane,
    Scene,
    Time,
    Vibration,
)  # fmt: skip

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure as MatplotlibFigure

COUNT, RADIUS, WIDTH, FLOOR_SPEED, RESTITUTION, GRAVITY = 300, 0.02, 2.0, 0.149, 0.95, 1.0
HEIGHT, KINETIC = 0.2882, 0.1168
START, SETTLED, EVERY = 20.0, soft_disks.HARD_SETTLED, 0.1
STEADY, CODE = soft_disks.STEADY, soft_disks.CODE
#: Tier -> length of the steady run [s], seeds of the start, time steps [s].
SIZES: dict[Tier, tuple[float, int, tuple[float, ...]]] = {
    "quick": (640.0, 4, (1e-2, 2e-3)),
    "standard": (1040.0, 10, (1e-2, 4e-3, 2e-3)),
    "full": (4040.0, 20, (1e-2, 4e-3, 2e-3, 1e-3, 4e-4)),
}

#: Tier -> contact time of soft disks [s]: length of their run [s].
SOFT: dict[Tier, dict[float, float]] = {
    "quick": {3e-2: 55.0, 1e-2: 55.0},
    "standard": {3e-2: 165.0, 1e-2: 115.0, 5e-3: 75.0, 2e-3: 45.0},
    "full": {3e-2: 2000.0, 1e-2: 2000.0, 5e-3: 1500.0, 2e-3: 900.0, 1e-3: 100.0},
}


def start(seed: int, top: float = 0.5, deviation: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Disks at random below a height, velocities normal; as in the source: half a metre, variance 1."""
    rng, made = np.random.default_rng(seed), np.empty((0, 3))
    while len(made) < COUNT:
        place = np.array(
            [rng.uniform(-WIDTH / 2 + RADIUS, WIDTH / 2 - RADIUS), 0.0, rng.uniform(RADIUS, top - RADIUS)]
        )
        if (np.linalg.norm(made - place, axis=1) > 2 * RADIUS).all():
            made = np.vstack([made, place])
    return made, rng.normal(scale=deviation, size=(COUNT, 3)) * (1, 0, 1)


def scene(seed: int, duration: float) -> Scene:
    """One kilogram a disk; stiffness is not used by hard disks."""
    position, velocity = start(seed)
    return Scene(
        name="vibrated_box",
        materials={
            "disk": Material(young=1e7, poisson=0.3, density=3 / (4 * math.pi * RADIUS**3)),
            "wall": Material(young=1e7, poisson=0.3, density=1000.0),
        },
        pairs=[
            Pair(materials=("disk", "disk"), restitution=RESTITUTION),
            Pair(materials=("disk", "wall"), restitution=1.0),
        ],
        contact=Contact(tangential="off"),
        particles=Explicit(position=position, velocity=velocity, radius=RADIUS, material="disk"),
        gravity=(0.0, 0.0, -GRAVITY),
        walls=[
            Box(kind="box", name="box", material="wall", sides=("xlo", "xhi")),
            Plane(name="floor", material="wall", point=(0, 0, 0), normal=(0, 0, 1),
                  vibration=Vibration(speed=FLOOR_SPEED)),
        ],
        domain=Domain(lo=(-WIDTH / 2, -0.1, 0.0), hi=(WIDTH / 2, 0.1, 20.0)),
        time=Time(step=1e-3, duration=duration), output=Output(history_every=EVERY),
        allow=("time_step", "unusual_units"),
    )  # fmt: skip


def soft_scene(contact_time: float, duration: float) -> Scene:
    """Soft disks, from a start near the steady state of hard ones; e is met without `limit_force`."""
    position, velocity = start(1, 2 * HEIGHT, math.sqrt(KINETIC))
    hard = scene(1, duration).replace(particles={"position": position, "velocity": velocity})
    return soft_disks.soften(hard, contact_time, duration, mass=1.0)


def variants(tier: Tier) -> list[Variant]:
    duration, seeds, _ = SIZES[tier]
    soft = [
        Variant(soft_disks.label(t), soft_scene(t, length), ("gpudem",)) for t, length in SOFT[tier].items()
    ]
    starts = [Variant(f"seed_{s}", scene(s, START), (CODE,)) for s in range(1, seeds + 1)]
    return [Variant(STEADY, scene(1, duration), (CODE,)), *starts, *soft]


def settled(run: Run) -> dict[str, np.ndarray]:
    """Columns of the history in the steady state."""
    return soft_disks.late(run, SETTLED)


def height(results: Results) -> Measured:
    got = float(settled(results[STEADY, CODE])["centre_z"].mean())
    return Measured(abs(got - HEIGHT), got, HEIGHT)


def kinetic(results: Results) -> Measured:
    got = float(settled(results[STEADY, CODE])["kinetic_energy"].mean()) / COUNT
    return Measured(abs(got - KINETIC), got, KINETIC)


def power(results: Results, column: str) -> Measured:
    """Mean power of the floor, or mean loss, by N m g U."""
    rows = settled(results[STEADY, CODE])
    rise = rows[column][-1] - rows[column][0]
    got = float(rise / (rows["time"][-1] - rows["time"][0]))
    want = COUNT * GRAVITY * FLOOR_SPEED
    return Measured(abs(got / want - 1), got, want)


def balance(results: Results) -> Measured:
    """Largest error of E(t) - E(0) = work - loss, by the work of the whole run."""
    table = results[STEADY, CODE].history
    energy = (table["kinetic_energy"] + table["potential_energy"]).to_numpy()
    books = (table["work"] - table["dissipated"]).to_numpy()
    error = np.abs(energy - energy[0] - books).max() / table["work"].to_numpy()[-1]
    return Measured(float(error), note=f"{int(table['collisions'].to_numpy()[-1])} collisions")


def overlap(results: Results) -> Measured:
    return Measured(max(float(run.notes["largest_overlap"]) for _, run in results.of(CODE)))


def window(times: np.ndarray, heights: np.ndarray) -> float:
    """Mean height over 10 s < t <= 20 s."""
    return float(heights[times > START / 2 + 1e-9].mean())


def seeds(results: Results) -> list[Run]:
    return [run for label, run in results.of(CODE) if label != STEADY]


def exact(results: Results) -> tuple[float, float]:
    """Event-driven: mean of the window over the seeds, and the standard deviation of one seed."""
    got = [
        window(run.history["time"].to_numpy(), run.history["centre_z"].to_numpy()) for run in seeds(results)
    ]
    return float(np.mean(got)), float(np.std(got, ddof=1))


def stepped(results: Results) -> dict[float, tuple[np.ndarray, np.ndarray]]:
    """Step [s] -> (times, mean heights) by time steps, from the start of seed 1."""

    def compute() -> dict[float, tuple[np.ndarray, np.ndarray]]:
        statement = Statement.of(results["seed_1", CODE].scene)
        return {
            step: time_stepping.mean_heights(statement, step, START, EVERY) for step in SIZES[results.tier][2]
        }

    return results.once("time stepping", compute)


def time_steps(results: Results) -> Measured:
    """Distance of time stepping at its smallest step from the event-driven height."""
    want, spread = exact(results)
    heights = [window(*curve) for _, curve in sorted(stepped(results).items())]
    got = heights[0]
    note = f"heights {', '.join(f'{h:.4f}' for h in heights)} m; one seed scatters by {spread:.4f} m"
    return Measured(abs(got - want), got, want, note)


def _heights(results: Results) -> MatplotlibFigure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=4.0)
    runs = seeds(results)
    time = runs[0].history["time"].to_numpy()
    plots.band(left, time, np.array([run.history["centre_z"].to_numpy() for run in runs]), CODE)
    want, spread = exact(results)
    right.axhline(
        want, color="#009e73", linestyle="--", linewidth=1.5, label="event-driven, mean of the seeds"
    )
    right.axhspan(
        want - spread, want + spread, color="#009e73", alpha=0.15, label="standard deviation of one"
    )
    curves = stepped(results)
    for (step, (times, heights)), color in zip(curves.items(), plots.SERIES[3:] * 2, strict=False):
        left.plot(times, heights, color=color, lw=1.0, label=f"time steps of {step:g} s")
        right.plot([step], [window(times, heights)], "o", color=color, label=f"time steps of {step:g} s")
    left.set(xlabel="time [s]", ylabel="mean height [m]", xlim=(0, START))
    right.set(xlabel="time step [s]", ylabel="mean height, 10 s to 20 s [m]", xscale="log", ylim=(0.26, 0.34))
    plots.legend(left)
    plots.legend(right)
    return figure


def _energies(results: Results) -> MatplotlibFigure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.4)
    table = results[STEADY, CODE].history
    time = table["time"].to_numpy()
    left.plot(time, table["kinetic_energy"] / COUNT, color="#009e73", lw=0.6, label="kinetic energy / N [J]")
    left.plot(time, table["centre_z"], color="#0072b2", lw=0.6, label="mean height [m]")
    left.axhline(KINETIC, color="k", lw=0.9)
    left.axhline(HEIGHT, color="k", lw=0.9, label="known steady values")
    late = time > 1
    for column, color in (("work", "#009e73"), ("dissipated", "#d55e00")):
        right.plot(
            time[late], table[column][late] / time[late], color=color, lw=1.2, label=f"{column} / time"
        )
    right.axhline(COUNT * GRAVITY * FLOOR_SPEED, color="k", lw=0.9, label="N m g U")
    left.set(xlabel="time [s]", ylim=(0, 0.6))
    right.set(xlabel="time [s]", ylabel="mean power since the start [W]", ylim=(30, 80))
    plots.legend(left)
    plots.legend(right)
    return figure


def _table(results: Results) -> pandas.DataFrame:
    import pandas

    want, spread = exact(results)
    rows: list[tuple[str, float, float, float]] = [("event-driven", float("nan"), want, spread)]
    for step, curve in stepped(results).items():
        rows.append(("time steps", step, window(*curve), float("nan")))
    columns = ["by", "step [s]", "mean height, 10 s to 20 s [m]", "standard deviation of a seed [m]"]
    return pandas.DataFrame(rows, columns=columns)


KNOWN = "the source's program over 400 s (0.28829 m), a second one (0.28821 m, 0.11682 J)"
NEEDS = (CODE,)

CASE = Case(
    name="vibrated_box",
    title="Hard disks over a vibrating floor",
    purpose=(
        "300 disks lose energy in every collision and gain it at a floor that vibrates fast, amplitude zero:"
        " v' = (1 + e) U - e v. The event-driven engine goes from collision to collision, without a step."
        " Time stepping that turns back overlapping disks only where they approach tends to the same height:"
        " the source, whose time steps settle at another, has no test of approach. Soft gpudem, with a floor"
        " that moves at U under each disk from touch to parting, tends to the same state, to first order in"
        " the contact time. Not here yet: the source's own rule."
    ),
    source="Qiita article on fast simulation of rigid spheres (2019) and its program; Lubachevsky (1991).",
    variants=variants,
    checks=(
        Check(
            name="steady mean height, error", measure=height, tolerance=0.001, unit="m", against=KNOWN,
            mark="P", reason="a mean over 600 s scatters by 0.0003 m", needs=NEEDS,
            catches="a wrong rule of floor or collision that keeps the balance of energy",
        ),
        Check(
            name="steady kinetic energy a disk, error", measure=kinetic, tolerance=0.0008, unit="J",
            against=KNOWN, mark="P", reason="a mean over 600 s scatters by 0.0002 J", needs=NEEDS,
            catches="a restitution off by 0.001; collisions missed near the floor",
        ),
        *(
            Check(
                name=f"{name} / (N m g U), error", measure=lambda results, c=column: power(results, c),
                tolerance=0.01, unit="1", against="momentum balance: the floor carries the weight", mark="A",
                reason="fluctuation of the centre of mass over the run", needs=NEEDS,
                catches="work or loss counted otherwise than it acts; a floor hit twice",
            )
            for name, column in (("power of the floor", "work"), ("dissipation", "dissipated"))
        ),
        Check(
            name="energy - work + dissipation, largest drift / work", measure=balance, tolerance=1e-10,
            unit="1", against="conservation", mark="A", reason="rounding", needs=NEEDS,
            catches="any one collision or flight that loses energy unseen",
        ),
        Check(
            name="largest overlap at a collision / diameter", measure=overlap, tolerance=1e-9, unit="1",
            against="hard disks", mark="A", reason="rounding of positions after a flight", needs=NEEDS,
            catches="a collision found late: cells, tree or lazy invalidation",
        ),
        *soft_disks_checks.CHECKS,
        Check(
            name="time stepping at the smallest step: distance from the event-driven height",
            measure=time_steps, tolerance=0.0175, unit="m", against="time stepping", mark="X", needs=NEEDS,
            reason="chaos, three standard deviations of a seed, 0.0045 m each; and 2 m/s times the step",
            catches="an event-driven height that is off in the same way as its own books",
        ),
    ),
    figures=(
        *soft_disks_checks.FIGURES,
        Figure(
            "Mean height: event-driven and by time steps",
            "Event-driven: mean and range over the seeds. Time steps, all from the start of seed 1, come"
            " nearer as they get smaller, down to the scatter of a seed.",
            _heights, needs=NEEDS,
        ),
        Figure(
            "Steady state and balance of power",
            "Left: the run settles at the known values. Right: work of the floor and loss in collisions, each"
            " divided by the time, tend to N m g U; the loss starts higher by the energy of the start.",
            _energies, needs=NEEDS,
        ),
    ),
    tables=(
        *soft_disks_checks.TABLES,
        Table("Mean height by engine and step", "From the same start, seed 1.", _table, needs=NEEDS),
    ),
    features=("vibrating floor", "gravity", "wall plane", "sphere-sphere"),
    order=75,
)  # fmt: skip
