"""The vibrated disks as soft spheres of several contact times, and their approach to hard ones.

A mean over a run scatters; its standard error is that of the long event-driven run, whose blocks of 20 s are
longer than the correlation time of its energy, scaled by the length: most soft runs are too short for blocks.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from comparisons.harness.case import Results
from gpudem.output.run import Run
from gpudem.scene import Scene

#: The engine of hard disks, its long run, and the time from which that is steady [s].
CODE, STEADY, HARD_SETTLED = "event_driven", "steady", 40.0
#: Speed at which a contact lasts the stated time [m/s]; steps in it; settling and blocks [s].
MEETING, STEPS, SETTLED, BLOCK = 0.5, 25, 15.0, 20.0
POISSON = 0.3
#: Top of the domain [m], 14 mean heights: small cells; a disk that reaches it ends the run with an error.
TOP = 4.0


def young(contact_time: float, mass: float, radius: float) -> float:
    """Young's modulus [Pa] of two equal spheres whose elastic Hertz contact lasts so long at MEETING.

    t_c = 2.868266 (m*^2 / (R* E*^2 v))^(1/5), Hertz; the damping of e = 0.95 lengthens it by 0.01 %.
    """
    modulus = math.sqrt(2.868266**5 * (mass / 2) ** 2 / (radius / 2 * MEETING * contact_time**5))
    return 2 * (1 - POISSON**2) * modulus


def soften(scene: Scene, contact_time: float, duration: float, mass: float) -> Scene:
    """The scene with moduli for a contact time; both materials are equally soft, as in two disks."""
    modulus = young(contact_time, mass, float(scene.state.radius[0]))
    return scene.replace(
        materials={name: {**m.model_dump(), "young": modulus} for name, m in scene.materials.items()},
        time={"step": contact_time / STEPS, "duration": duration},
        solver={"skin": float(scene.state.radius[0])},
        domain={"hi": (scene.domain.hi[0], scene.domain.hi[1], TOP)},
        allow=(*scene.allow, "large_overlap"),
    )


@dataclasses.dataclass(frozen=True)
class Steady:
    """Means of a run in the steady state; hard disks have contact time 0."""

    contact_time: float
    duration: float
    """Length of the averages [s]."""
    kinetic: float
    """Kinetic energy per disk [J]."""
    height: float
    """Mean height [m]."""
    contacts: float
    """Contacts with disks and floor, per disk."""
    power: float
    """Power of the floor [W]."""
    growth: float
    """Growth of kinetic and potential energy per second [W]."""
    seconds: float
    """Run time per simulated second."""

    @classmethod
    def of(cls, run: Run, settled: float, contact_time: float = 0.0) -> Steady:
        """Means of a history from `settled` [s] on."""
        rows, n = late(run, settled), run.timing.particles
        length, energy = float(np.ptp(rows["time"])), rows["kinetic_energy"] + rows["potential_energy"]
        return cls(
            contact_time=contact_time, duration=length,
            kinetic=float(rows["kinetic_energy"].mean()) / n, height=float(rows["centre_z"].mean()),
            contacts=float(rows["contacts"].mean()) / n,
            power=float(rows["work"][-1] - rows["work"][0]) / length,
            growth=float(energy[-1] - energy[0]) / length,
            seconds=run.timing.stepping_s / float(rows["time"][-1]),
        )  # fmt: skip


def late(run: Run, settled: float) -> dict[str, np.ndarray]:
    """Columns of the history from `settled` [s] on."""
    table = run.history
    assert table is not None, "the scene asks for a history"
    rows = table["time"].to_numpy() >= settled - 1e-9
    return {str(name): table[name].to_numpy()[rows] for name in table}


def standard_error(run: Run, column: str) -> tuple[float, float]:
    """(of the mean over the run, by that mean; length of the mean [s]), from blocks of BLOCK."""
    rows = late(run, HARD_SETTLED)
    rows_a_block = round(BLOCK / float(rows["time"][1] - rows["time"][0]))
    blocks = len(rows["time"]) // rows_a_block
    values = rows[column][: blocks * rows_a_block].reshape(blocks, -1).mean(axis=1)
    return float(values.std(ddof=1) / math.sqrt(blocks) / values.mean()), blocks * BLOCK


@dataclasses.dataclass(frozen=True)
class Approach:
    """One quantity of the soft runs by that of hard disks, less one, with standard errors."""

    contact_times: np.ndarray
    excess: np.ndarray
    errors: np.ndarray
    """Of the soft means only."""
    hard_error: float
    """Of the hard mean: shared by all."""

    def up_to(self, longest: float) -> Approach:
        """The runs whose contacts last no longer than this [s]."""
        short = self.contact_times <= longest
        return Approach(self.contact_times[short], self.excess[short], self.errors[short], self.hard_error)

    def slope(self) -> tuple[float, float]:
        """(p, its standard error) of |excess| = C t_c^p, weighted least squares."""
        from scipy import optimize

        total = np.hypot(self.errors, self.hard_error)
        scaled = self.contact_times / self.contact_times.max()
        size = float(self.excess[np.argmax(self.contact_times)])
        fit = optimize.curve_fit(
            lambda t, c, p: c * t**p, scaled, self.excess / size, (1.0, 1.0), total / abs(size),
            absolute_sigma=True,
        )  # fmt: skip
        return float(fit[0][1]), float(np.sqrt(fit[1][1, 1]))

    def limit(self) -> tuple[float, float]:
        """(excess at t_c = 0, its standard error): Richardson by a weighted fit of the second degree."""
        t = self.contact_times / self.contact_times.max()
        weighted = np.vander(t, min(3, len(t)), increasing=True) / self.errors[:, None]
        inverse = np.linalg.inv(weighted.T @ weighted)
        found = float((inverse @ weighted.T @ (self.excess / self.errors))[0])
        return found, math.hypot(math.sqrt(inverse[0, 0]), self.hard_error)


def label(contact_time: float) -> str:
    """The variant of a contact time."""
    return f"soft_{contact_time:g}"


def steady(results: Results) -> tuple[Steady, list[Steady]]:
    """(hard, soft from the hardest on)."""
    hard = Steady.of(results[STEADY, CODE], HARD_SETTLED)
    soft = [Steady.of(run, SETTLED, float(name.removeprefix("soft_"))) for name, run in results.of("gpudem")]
    return hard, sorted(soft, key=lambda s: s.contact_time)


def approach(results: Results, name: str) -> Approach:
    """How `kinetic` or `height` of the soft runs differs from that of hard disks."""
    hard, soft = steady(results)
    column = {"kinetic": "kinetic_energy", "height": "centre_z"}[name]
    error, length = standard_error(results[STEADY, CODE], column)
    want = getattr(hard, name)
    ratios = np.array([getattr(s, name) / want for s in soft])
    errors = np.array([error * math.sqrt(length / s.duration) for s in soft]) * ratios
    return Approach(np.array([s.contact_time for s in soft]), ratios - 1, errors, error)
