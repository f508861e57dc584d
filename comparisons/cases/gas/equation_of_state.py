"""Hard disks and spheres in equilibrium: pressure and collision rate against their equations of state."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from comparisons.cases.gas import scenes as gases
from comparisons.harness.case import Case, Check, Figure, Measured, Results, Table, Tier, Variant
from comparisons.oracles import gas
from comparisons.report import plots
from gpudem.output.run import Run
from gpudem.scene import Contact, Domain, Explicit, Material, Output, Pair, Scene, Time

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure as MatplotlibFigure

HARD = "event_driven"
DIAMETER = 2 * gases.RADIUS
#: Area shares of the disks and rho d^3 of the spheres by tier.
SHARES: dict[Tier, tuple[tuple[float, ...], tuple[float, ...]]] = {
    "quick": ((0.2, 0.4, 0.6), (0.2,)),
    "standard": ((0.1, 0.2, 0.3, 0.4, 0.5, 0.6), (0.2, 0.5, 0.9)),
    "full": ((0.1, 0.2, 0.3, 0.4, 0.5, 0.55, 0.6, 0.65), (0.1, 0.2, 0.3, 0.5, 0.7, 0.9)),
}
#: Up to this rho d^3 ten virial coefficients give Z to 1e-4.
VIRIAL_TO = 0.5
#: Tier -> collisions before counting and counted, each per particle; particles of a side: disks, spheres.
SIZES: dict[Tier, tuple[int, int, int, int]] = {
    "quick": (30, 400, 50, 12), "standard": (40, 700, 50, 16), "full": (100, 1500, 80, 20),
}  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Kind:
    """Disks, which are spheres in one layer, or spheres."""

    axes: int
    name: str
    against: str

    def share(self, value: float) -> float:
        """Area or volume share [1] of what a label says."""
        return value if self.axes == 2 else math.pi / 6 * value

    def theory(self, value: float) -> float:
        """Z [1]."""
        if self.axes == 2:
            return gas.disk_compressibility(value, gas.disk_contact_value(value))
        return gas.compressibility(self.share(value))


DISKS = Kind(2, "disks", "Luding (2001)")
SPHERES = Kind(3, "spheres", "Carnahan and Starling (1969)")
KINDS = {"disks": DISKS, "spheres": SPHERES}


def disks(side: int, eta: float, **sections: Any) -> Scene:
    """A layer of side^2 disks on a jittered square lattice, T = 1 m2/s2 an axis, periodic in x and z."""
    rng = np.random.default_rng(1)
    pitch = DIAMETER * math.sqrt(math.pi / 4 / eta)
    edge, count = side * pitch, side * side
    k = np.arange(count)
    shift = rng.uniform(-1, 1, (count, 2)) * 0.45 * (pitch - DIAMETER)
    place = (np.stack([k % side, k // side], axis=1) + 0.5) * pitch + shift
    position = np.stack([place[:, 0], np.zeros(count), place[:, 1]], axis=1)
    return Scene(
        name="equation_of_state",
        particles=Explicit(
            position=position, velocity=rng.normal(size=(count, 3)) * (1, 0, 1), radius=gases.RADIUS,
            material="ball",
        ),
        domain=Domain(lo=(0, -0.01, 0), hi=(edge, 0.01, edge), periodic=(True, False, True)), **sections,
    )  # fmt: skip


def scene(kind: Kind, value: float, tier: Tier) -> Scene:
    settle, count, *sides = SIZES[tier]
    side = sides[kind.axes - 2]
    rate = gas.rate_of_pressure(kind.theory(value), DIAMETER, 1.0, kind.axes)
    step = 1 / rate
    sections: dict[str, Any] = {
        "materials": {"ball": Material(young=1e9, poisson=gases.POISSON, density=gases.DENSITY)},
        "pairs": [Pair(materials=("ball", "ball"))],
        "contact": Contact(tangential="off"),
        "time": Time(step=step, duration=(settle + count) * step),
        "output": Output(history_every=5 * step),
        "allow": ("time_step",),
    }
    if kind.axes == 2:
        return disks(side, value, **sections)
    return gases.gas_box("equation_of_state", side**3, kind.share(value), 1, **sections)


def variants(tier: Tier) -> list[Variant]:
    return [
        Variant(f"{kind.name}_{value:g}", scene(kind, value, tier), (HARD,))
        for kind, values in zip(KINDS.values(), SHARES[tier], strict=True)
        for value in values
    ]


def points(results: Results, kind: Kind) -> list[tuple[float, Run]]:
    """(what the label says, run), ascending."""
    return [
        (float(label.split("_")[1]), run) for label, run in results.of(HARD) if label.startswith(kind.name)
    ]


def temperature(run: Run, kind: Kind) -> float:
    """T [m2/s2] of the velocities less their mean, which is conserved."""
    v = run.scene.state.velocity
    return float(((v - v.mean(axis=0)) ** 2).sum() / (kind.axes * (len(v) - 1)))


def counted(run: Run, tier: Tier, column: str) -> float:
    """Growth of a column per second after the gas has settled."""
    return gases.growth(run, column, SIZES[tier][0] * run.scene.time.step)


def pressure(run: Run, kind: Kind, tier: Tier) -> float:
    """Z = 1 + sum of J d/(axes N m T t)."""
    scale = kind.axes * len(run.scene.state) * gases.MASS * temperature(run, kind)
    return 1 + counted(run, tier, "virial") / scale


def rate(run: Run, kind: Kind, tier: Tier) -> float:
    """Collisions of one per second [1/s]."""
    return 2 * counted(run, tier, "collisions") / len(run.scene.state)


def rows(results: Results, kind: Kind) -> list[tuple[float, float, float, float, float]]:
    """(label, Z, Z of theory, collision rate, the rate that goes with the theory)."""
    found = []
    for value, run in points(results, kind):
        want = gas.rate_of_pressure(kind.theory(value), DIAMETER, temperature(run, kind), kind.axes)
        tier = results.tier
        found.append((value, pressure(run, kind, tier), kind.theory(value), rate(run, kind, tier), want))
    return found


def worst(results: Results, kind: Kind, first: int) -> Measured:
    """Largest relative error over the densities of Z (first = 1) or of the rate (3)."""
    errors = [(abs(row[first] / row[first + 1] - 1), row) for row in rows(results, kind)]
    value, row = max(errors)
    note = f"largest at {row[0]:g}; {', '.join(f'{e:.2%}' for e, _ in errors)}"
    return Measured(value, row[first], row[first + 1], note)


def virial(results: Results) -> Measured:
    """Z of spheres up to VIRIAL_TO against the virial series, largest relative error."""
    found = []
    for value, got, *_ in rows(results, SPHERES):
        want = gas.virial_series(SPHERES.share(value))
        if value <= VIRIAL_TO:
            found.append((abs(got / want - 1), got, want, f"at {value:g}"))
    value, got, want, where = max(found)
    return Measured(value, got, want, f"largest {where}")


def impulse(results: Results) -> Measured:
    """Mean impulse of a collision against m sqrt(pi T), largest relative error."""
    found = []
    for kind in KINDS.values():
        for value, run in points(results, kind):
            mean = counted(run, results.tier, "virial") / counted(run, results.tier, "collisions") / DIAMETER
            want = gases.MASS * math.sqrt(math.pi * temperature(run, kind))
            found.append((abs(mean / want - 1), mean, want, f"{kind.name} {value:g}"))
    value, got, want, where = max(found)
    return Measured(value, got, want, f"largest for {where}")


def plain(results: Results) -> Measured:
    """How far the densest disks lie below Henderson's Z, relative."""
    value, got, *_ = rows(results, DISKS)[-1]
    want = gas.disk_compressibility(value, gas.henderson(value))
    return Measured(1 - got / want, got, want, f"eta = {value:g}")


def conserved(results: Results) -> Measured:
    """Largest |energy/start - 1| of all runs."""
    found = []
    for label, run in results.of(HARD):
        energy = run.history["kinetic_energy"].to_numpy()
        hits = int(run.history["collisions"].to_numpy()[-1])
        found.append((float(np.abs(energy / energy[0] - 1).max()), f"{label}, {hits} collisions"))
    return Measured(max(found)[0], note=f"largest for {max(found)[1]}")


def overlap(results: Results) -> Measured:
    return Measured(max(float(run.notes["largest_overlap"]) for _, run in results.of(HARD)))


def _figure(results: Results) -> MatplotlibFigure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.8)
    grid = np.linspace(0.02, 0.66, 200)
    corrected = np.array([DISKS.theory(e) for e in grid])
    henderson = np.array([gas.disk_compressibility(e, gas.henderson(e)) for e in grid])
    left.plot(grid, corrected, "k", lw=0.9, label="disks: Luding")
    left.plot(
        grid, [gas.compressibility(e) for e in grid], "k--", lw=0.9, label="spheres: Carnahan, Starling"
    )
    right.axhline(0, color="k", lw=0.9, label="Luding; Carnahan, Starling")
    right.plot(grid, 100 * (henderson / corrected - 1), color="#d55e00", lw=1.2, label="disks: Henderson")
    right.axhspan(-0.5, 0.5, color="0.93")
    for kind, mark in ((DISKS, "o"), (SPHERES, "s")):
        found = np.array(rows(results, kind))
        x = [kind.share(value) for value in found[:, 0]]
        look = plots.style(HARD, linestyle="none", marker=mark, label=f"{kind.name}, event-driven")
        left.plot(x, found[:, 1], **look)
        right.plot(x, 100 * (found[:, 1] / found[:, 2] - 1), **look)
    left.set(xlabel="area or volume share", ylabel="Z = p V/(N m T)", yscale="log", ylim=(1, 20))
    right.set(xlabel="area or volume share", ylabel="Z / theory - 1 [%]", ylim=(-1, 2.5))
    plots.legend(left)
    plots.legend(right)
    return figure


def _table(results: Results) -> pandas.DataFrame:
    import pandas

    found = []
    for kind in KINDS.values():
        for value, z, want, per_second, expected in rows(results, kind):
            other = gas.disk_compressibility(value, gas.henderson(value)) if kind is DISKS else float("nan")
            found.append((kind.name, kind.share(value), z, want, other, per_second, expected))
    columns = [
        "of",
        "share [1]",
        "Z [1]",
        "theory [1]",
        "Henderson [1]",
        "collision rate [1/s]",
        "theory [1/s]",
    ]
    return pandas.DataFrame(found, columns=columns)


NEEDS = (HARD,)

CASE = Case(
    name="equation_of_state",
    title="Pressure and collision rate of hard disks and spheres",
    purpose=(
        "The event-driven engine is what the soft codes are held to; here it is held to what is known of"
        " hard disks and spheres themselves. Momentum carried in collisions gives the pressure, their number"
        " the rate: two counts of one run. The equations of state are good to 0.1 %, so that one collision"
        " missed in two hundred is seen; Henderson's plain equation for disks is 1 % off, and that is seen"
        " too. elastic_gas does the same for the soft codes, to a few per cent."
    ),
    source="Henderson (1975); Luding, Phys. Rev. E 63 (2001) 042201; Carnahan and Starling (1969);"
    " Clisby and McCoy (2006).",
    variants=variants,
    checks=(
        *(
            Check(
                name=f"{what} of {kind.name}, largest relative error over the densities",
                measure=lambda results, kind=kind, first=first: worst(results, kind, first),
                tolerance=0.005, unit="1", against=kind.against, mark="P", needs=NEEDS,
                reason="the equation itself (0.1 %; spheres at rho d^3 = 0.5: 0.2 % low), scatter of the"
                " collisions counted (0.1 %)",
                catches=catches,
            )
            for kind in KINDS.values()
            for what, first, catches in (
                ("Z", 1, "momentum or collisions missed by half a per cent: a cell, an image, a diameter"),
                ("collision rate", 3, "collisions counted otherwise than they act"),
            )
        ),
        Check(
            name="Z of spheres up to rho d^3 = 0.5, largest relative error", measure=virial, tolerance=0.003,
            unit="1", against="virial series (Clisby and McCoy 2006)", mark="P", needs=NEEDS,
            reason="scatter of the collisions counted (0.1 %)",
            catches="a third of a per cent of the momentum missed, which Carnahan and Starling may hide",
        ),
        Check(
            name="mean impulse of a collision against m sqrt(pi T), largest relative error",
            measure=impulse, tolerance=0.003, unit="1", against="Maxwell's distribution, exact", mark="A",
            needs=NEEDS, reason="scatter of one impulse, 52 %, over all collisions counted: 0.1 % or less",
            catches="fast or slow collisions missed; velocities that are not Maxwell's",
        ),
        Check(
            name="Z of the densest disks, how far below Henderson's plain equation, relative",
            measure=plain, lo=0.007, tolerance=0.03, unit="1", against="Henderson (1975)", mark="P",
            needs=NEEDS, reason="Luding's correction is 1.2 % at eta = 0.6 and 2 % at 0.65",
            catches="a resolution that could not tell the two equations apart",
        ),
        Check(
            name="energy, largest change", measure=conserved, tolerance=1e-11, unit="1",
            against="conservation", mark="A", needs=NEEDS, reason="rounding",
            catches="any collision that gives or takes energy",
        ),
        Check(
            name="largest overlap at a collision / diameter", measure=overlap, tolerance=1e-9, unit="1",
            against="hard spheres", mark="A", needs=NEEDS,
            reason="rounding of positions after a flight", catches="a collision found late",
        ),
    ),
    figures=(
        Figure(
            "Equation of state",
            "Right: the same by its theory; grey: 0.5 %. Disks leave Henderson's equation where they get"
            " dense.",
            _figure, needs=NEEDS,
        ),
    ),
    tables=(Table("Pressure and collision rate", "Shares are of area or volume.", _table, needs=NEEDS),),
    features=("periodic sides", "sphere-sphere"),
    order=74,
)  # fmt: skip
