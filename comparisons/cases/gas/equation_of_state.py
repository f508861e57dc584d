"""Hard disks and spheres in equilibrium: pressure and collision rate against their equations of state."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from comparisons import kit
from comparisons.cases.gas import scenes as gases
from comparisons.cases.gas.checks import HARD, conserved, hard, no_overlap
from comparisons.oracles import gas
from comparisons.report import plots
from gpudem.scene import Contact, Domain, Explicit, Output, Pair, Scene, Time

#: Area fractions of the disks and rho d^3 of the spheres by tier.
FRACTIONS: dict[kit.Tier, tuple[tuple[float, ...], tuple[float, ...]]] = {
    "quick": ((0.2, 0.4, 0.6), (0.2,)),
    "standard": ((0.1, 0.2, 0.3, 0.4, 0.5, 0.6), (0.2, 0.5, 0.9)),
    "full": ((0.1, 0.2, 0.3, 0.4, 0.5, 0.55, 0.6, 0.65), (0.1, 0.2, 0.3, 0.5, 0.7, 0.9)),
}
#: Up to this rho d^3 ten virial coefficients give Z to 1e-4.
VIRIAL_TO = 0.5
#: Tier -> collisions before counting and counted, each per particle; particles of a side: disks, spheres.
SIZES: dict[kit.Tier, tuple[int, int, int, int]] = {
    "quick": (30, 400, 50, 12), "standard": (40, 700, 50, 16), "full": (100, 1500, 80, 20),
}  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Kind:
    """Disks, which are spheres in one layer, or spheres."""

    axes: int
    name: str
    against: str

    def fraction(self, value: float) -> float:
        """Area or volume fraction [1] of what a label says."""
        return value if self.axes == 2 else math.pi / 6 * value

    def theory(self, value: float) -> float:
        """Z [1]."""
        if self.axes == 2:
            return gas.disk_compressibility(value, gas.disk_contact_value(value))
        return gas.compressibility(self.fraction(value))


DISKS = Kind(2, "disks", "Luding (2001)")
SPHERES = Kind(3, "spheres", "Carnahan and Starling (1969)")
KINDS = (DISKS, SPHERES)


def disks(side: int, eta: float, **sections: Any) -> Scene:
    """A layer of side^2 disks on a jittered square lattice, T = 1 m2/s2 an axis, periodic in x and z."""
    rng = np.random.default_rng(1)
    pitch = gases.DIAMETER * math.sqrt(math.pi / 4 / eta)
    edge, count = side * pitch, side * side
    k = np.arange(count)
    shift = rng.uniform(-1, 1, (count, 2)) * 0.45 * (pitch - gases.DIAMETER)
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


def scene(kind: Kind, value: float, tier: kit.Tier) -> Scene:
    settle, count, *sides = SIZES[tier]
    side = sides[kind.axes - 2]
    step = 1 / gas.rate_of_pressure(kind.theory(value), gases.DIAMETER, 1.0, kind.axes)
    sections: dict[str, Any] = {
        "materials": {"ball": gases.material(1e9)},
        "pairs": [Pair(materials=("ball", "ball"))],
        "contact": Contact(tangential="off"),
        "time": Time(step=step, duration=(settle + count) * step),
        "output": Output(history_every=5 * step),
        "allow": ("time_step",),
    }
    if kind is DISKS:
        return disks(side, value, **sections)
    return gases.gas_box("equation_of_state", side**3, kind.fraction(value), 1, **sections)


def variants(tier: kit.Tier) -> list[kit.Variant]:
    return [
        kit.Variant(f"{kind.name}_{value:g}", scene(kind, value, tier), (HARD,))
        for kind, values in zip(KINDS, FRACTIONS[tier], strict=True)
        for value in values
    ]


def observed(results: kit.Results, kind: Kind) -> dict[float, dict[str, tuple[float, float]]]:
    """What the label says (area fraction, rho d^3) -> (observed, by theory) of
    Z = 1 + sum of J d/(axes N m T t), of the collisions of one per second, and of the mean impulse.
    """
    found = {}
    for label in results.labels(HARD, prefix=kind.name):
        run, value = results[label, HARD], float(label.partition("_")[2])
        v, settled = run.scene.state.velocity, SIZES[results.tier][0] * run.scene.time.step
        t = float(((v - v.mean(axis=0)) ** 2).sum() / (kind.axes * (len(v) - 1)))
        virial, hits = (gases.growth(run, column, settled) for column in ("virial", "collisions"))
        found[value] = {
            "Z": (1 + virial / (kind.axes * len(v) * gases.MASS * t), kind.theory(value)),
            "collision rate": (
                2 * hits / len(v),
                gas.rate_of_pressure(kind.theory(value), gases.DIAMETER, t, kind.axes),
            ),
            "impulse": (virial / hits / gases.DIAMETER, gases.MASS * math.sqrt(math.pi * t)),
        }
    return found


def against_theory(results: kit.Results, quantity: str, *of: Kind) -> kit.Measured:
    """Largest relative error over the densities of Z, the collision rate or the impulse."""
    found = {
        f"{kind.name} {value:g}": kit.relative(*row[quantity])
        for kind in of
        for value, row in observed(results, kind).items()
    }
    return kit.largest(found, ", ".join(f"{one.value:.2%}" for one in found.values()))


def virial(results: kit.Results) -> dict[str, tuple[float, float]]:
    """Z of spheres up to VIRIAL_TO, and by the virial series."""
    return {
        f"{value:g}": (row["Z"][0], gas.virial_series(SPHERES.fraction(value)))
        for value, row in observed(results, SPHERES).items()
        if value <= VIRIAL_TO
    }


def below_henderson(results: kit.Results) -> kit.Measured:
    """How far the Z of the densest disks is below Henderson's, relative."""
    eta, row = list(observed(results, DISKS).items())[-1]
    got, want = row["Z"][0], gas.disk_compressibility(eta, gas.henderson(eta))
    return kit.Measured(1 - got / want, got, want, f"eta = {eta:g}")


def _figure(results: kit.Results) -> plots.Figure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.8)
    grid = np.linspace(0.02, 0.66, 200)
    corrected = np.array([DISKS.theory(e) for e in grid])
    henderson = np.array([gas.disk_compressibility(e, gas.henderson(e)) for e in grid])
    spheres = [gas.compressibility(e) for e in grid]
    left.plot(grid, corrected, "k", lw=0.9, label="disks: Luding")
    left.plot(grid, spheres, "k--", lw=0.9, label="spheres: Carnahan, Starling")
    right.axhline(0, color="k", lw=0.9, label="Luding; Carnahan, Starling")
    right.plot(grid, 100 * (henderson / corrected - 1), color="#d55e00", lw=1.2, label="disks: Henderson")
    right.axhspan(-0.5, 0.5, color="0.93")
    for kind, mark in ((DISKS, "o"), (SPHERES, "s")):
        found = observed(results, kind)
        x, z = [kind.fraction(value) for value in found], np.array([row["Z"] for row in found.values()])
        look = plots.style(HARD, linestyle="none", marker=mark, label=f"{kind.name}, event-driven")
        left.plot(x, z[:, 0], **look)
        right.plot(x, 100 * (z[:, 0] / z[:, 1] - 1), **look)
    left.set(xlabel="area or volume fraction", ylabel="Z = p V/(N m T)", yscale="log", ylim=(1, 20))
    right.set(xlabel="area or volume fraction", ylabel="Z / theory - 1 [%]", ylim=(-1, 2.5))
    plots.legend(left, right)
    return figure


def _table(results: kit.Results) -> kit.Rows:
    return [
        {"system": kind.name, "fraction [1]": kind.fraction(value), "Z [1]": row["Z"][0],
         "theory: Z [1]": row["Z"][1],
         "Henderson: Z [1]":
             gas.disk_compressibility(value, gas.henderson(value)) if kind is DISKS else math.nan,
         "collision rate [1/s]": row["collision rate"][0],
         "theory: collision rate [1/s]": row["collision rate"][1]}
        for kind in KINDS
        for value, row in observed(results, kind).items()
    ]  # fmt: skip


CASE = kit.Case(
    name="equation_of_state", title="Pressure and collision rate of hard disks and spheres",
    purpose="The event-driven engine is a reference of the soft codes; here it is compared with what is"
    " known of hard disks and spheres. The momentum of the collisions gives the pressure, their number the"
    " rate: two counts of one run. The equations of state are accurate to 0.1 %, so that one collision"
    " missed in two hundred is detected, and so is the 1 % by which Henderson's plain equation for disks is"
    " off. elastic_gas does the same for the soft codes, to a few per cent.",
    source="Henderson (1975); Luding, Phys. Rev. E 63 (2001) 042201; Carnahan and Starling (1969);"
    " Clisby and McCoy (2006).",
    variants=variants,
    checks=(
        *(
            hard(
                f"{what} of {kind.name}, largest relative error over the densities",
                lambda results, kind=kind, what=what: against_theory(results, what, kind),
                0.005, kind.against, "the equation itself (0.1 %; spheres at rho d^3 = 0.5: 0.2 % low),"
                " scatter of the collisions counted (0.1 %)", catches, mark="P",
            )
            for kind in KINDS
            for what, catches in (
                ("Z", "momentum or collisions missed by half a per cent: a cell, an image, a diameter"),
                ("collision rate", "collisions counted otherwise than they act"),
            )
        ),
        hard(
            "Z of spheres up to rho d^3 = 0.5, largest relative error", virial, 0.003,
            "virial series (Clisby and McCoy 2006)", "scatter of the collisions counted (0.1 %)",
            "a third of a per cent of the momentum missed, which Carnahan and Starling may hide", mark="P",
        ),
        hard(
            "mean impulse of a collision against m sqrt(pi T), largest relative error",
            lambda results: against_theory(results, "impulse", *KINDS), 0.003,
            "Maxwell's distribution, exact",
            "scatter of one impulse, 52 %, over all collisions counted: 0.1 % or less",
            "fast or slow collisions missed; velocities that are not Maxwell's",
        ),
        hard(
            "Z of the densest disks, how far below Henderson's plain equation, relative", below_henderson,
            0.03, "Henderson (1975)", "Luding's correction is 1.2 % at eta = 0.6 and 2 % at 0.65",
            "a resolution that cannot distinguish the two equations", mark="P", lo=0.007,
        ),
        conserved("energy, largest change"), no_overlap("largest overlap at a collision / diameter"),
    ),
    figures=(kit.Figure(
        "Equation of state",
        "Right: divided by theory; grey: 0.5 %. Dense disks deviate from Henderson's equation.",
        _figure, needs=(HARD,),
    ),),
    tables=(kit.Table(
        "Pressure and collision rate", "Fractions are of area or volume.", _table, needs=(HARD,)
    ),),
    features=("periodic sides", "sphere-sphere"), order=74,
)  # fmt: skip
