"""The drum: two codes over seeds, energy and angular momentum, forces and dissipation step by step."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import cumulative_trapezoid, trapezoid

from comparisons import kit
from comparisons.cases import over_seeds
from comparisons.cases.machines import drum_scenes as drums
from comparisons.metrics import statistics
from comparisons.oracles import drum as oracle
from gpudem.output.run import Run
from gpudem.scene import Explicit

#: Prefixes of labels: LIGGGHTS' rule of mesh contacts, which both codes run, and gpudem's own.
SAME, OWN = "seed", "unique"
#: The bed of gpudem's first seed, step by step with a third of the time step.
WINDOW = "window"
STEPS_PER_CONTACT = 60.0
#: Length of the window [s].
LENGTH: dict[kit.Tier, float] = {"quick": 0.03, "standard": 0.1, "full": 0.2}
WEIGHT = drums.COUNT * drums.MASS * drums.GRAVITY


def measures(results: kit.Results, label: str, code: str) -> dict[str, float]:
    """Every metric of one run by name with its unit: means over the steady state, and the mixing."""

    def compute() -> dict[str, float]:
        run = results[label, code]
        slopes = [drums.surface_angle(frame) for _, frame in drums.frames(run, drums.STEADY)]
        rows = drums.history(run, drums.STEADY)
        angle, index = drums.center_angle(rows), drums.mixed(run)[1]
        if index[-1] < index[0] + 0.1:
            raise ValueError(f"{label}: the halves have not mixed")
        return {
            "angle of the surface [deg]": float(np.mean(slopes)),
            "angle of the center of mass [deg]": float(angle.mean()),
            "its standard deviation in time [deg]": float(angle.std()),
            "distance of the center of mass from the axis [mm]": 1e3
            * float(np.hypot(rows["centre_x"], rows["centre_z"]).mean()),
            "power from the moment of weight [mW]": 1e3 * power(rows),
            "mean torque of the bed on the drum [mN m]": 1e3 * float(rows["torque_drum_y"].mean()),
            "kinetic energy [mJ]": 1e3 * float(rows["kinetic_energy"].mean()),
            "energy of rotation [mJ]": 1e3 * float(rows["rotational_energy"].mean()),
            "Lacey index at the end [1]": float(index[-1]),
        }

    return results.once(("measures", label, code), compute)


def power(rows: dict[str, np.ndarray]) -> float:
    """Mean power of the drum [W], angular velocity x moment of weight about the axis."""
    time = rows["time"]
    return -WEIGHT * drums.SPIN * float(trapezoid(rows["centre_x"], time)) / float(np.ptp(time))


def samples(results: kit.Results, prefix: str, code: str) -> dict[str, np.ndarray]:
    """Metric -> its values over the seeds."""
    rows = [measures(results, label, code) for label in results.labels(code, prefix=prefix)]
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def compared(results: kit.Results, prefix: str, code: str, other: str) -> dict[str, statistics.Comparison]:
    """Metric -> comparison of a code, with one rule, and the other code."""
    return results.once(
        ("compared", prefix, code, other),
        lambda: statistics.compare(samples(results, prefix, code), samples(results, SAME, other)),
    )


def angular_momentum(frame: Any) -> float:
    """About the axis of the drum [kg m2/s]."""
    x, v, w = frame["position"], frame["velocity"], frame["angular_velocity"]
    inertia = 0.4 * drums.MASS * drums.RADIUS**2
    orbit = drums.MASS * (x[:, 2] * v[:, 0] - x[:, 0] * v[:, 2]).sum()
    return float(orbit + inertia * w[:, 1].sum())


def moment(results: kit.Results, code: str) -> dict[str, tuple[float, float]]:
    """Of each run: (mean torque of the drum on the balls, moment of weight and change of angular momentum)
    about the axis [N m], over the steady state. The torque is the work by the angle turned.
    """
    found = {}
    for label, run in results.of(code):
        if label == WINDOW:
            continue
        rows = drums.history(run, drums.STEADY)
        time, work = rows["time"], rows["work_drum"]
        span = time[-1] - time[0]
        ends = [angular_momentum(run.frames.at(t)) for t in (time[0], time[-1])]
        got = (work[-1] - work[0]) / (drums.SPIN * span)
        found[label] = got, power(rows) / drums.SPIN + (ends[1] - ends[0]) / span
    return found


def steady(results: kit.Results, code: str) -> dict[str, float]:
    """Change of the mechanical energy over the steady state, mean of the seeds, by the work of the drum."""
    found = {}
    for prefix in (SAME, OWN):
        change, work = [], []
        for label in results.labels(code, prefix=prefix):
            rows = drums.history(results[label, code], drums.STEADY)
            change.append(mechanical(rows)[-1] - mechanical(rows)[0])
            work.append(power(rows) * float(np.ptp(rows["time"])))
        if work:
            found[prefix] = abs(float(np.mean(change) / np.mean(work)))
    return found


def mechanical(rows: dict[str, np.ndarray]) -> np.ndarray:
    """Kinetic, rotational and potential energy [J] in time."""
    return rows["kinetic_energy"] + rows["rotational_energy"] + rows["potential_energy"]


def window(results: kit.Results) -> list[kit.Variant]:
    """The bed of gpudem's first seed goes on, with a trace of every step; its springs begin anew."""
    label = f"{OWN}_1"
    if label not in results.labels("gpudem"):
        return []
    run = results[label, "gpudem"]
    frame = run.frames[-1]
    particles = Explicit(
        position=frame["position"], velocity=frame["velocity"], radius=drums.RADIUS, material="glass",
        angular_velocity=frame["angular_velocity"],
    )  # fmt: skip
    made = drums.Drum(LENGTH[results.tier], steps_per_contact=STEPS_PER_CONTACT)
    step = drums.CONTACT_TIME / STEPS_PER_CONTACT
    scene = made.of(particles, turned(run), trace_every=step, history_every=step)
    return [kit.Variant(WINDOW, scene, ("gpudem",))]


def turned(run: Run) -> float:
    """Angle of the drum at the end of a run [rad]."""
    return drums.SPIN * run.scene.n_steps * run.scene.time.step


@dataclasses.dataclass(frozen=True)
class Followed:
    """The window: what the oracle finds from its positions and velocities, and what the code says."""

    run: Run
    ledger: oracle.Ledger
    work: np.ndarray
    """Of the drum on the balls, by the code [J], (t,)."""

    @property
    def balance(self) -> np.ndarray:
        """Work less change of energy, mechanical and in springs, less dissipated energy [J], (t,)."""
        energy = mechanical(drums.history(self.run)) + self.ledger.stored
        return self.work - (energy - energy[0]) - self.ledger.dissipated


def followed(results: kit.Results) -> Followed:
    """The window step by step."""

    def compute() -> Followed:
        run = results[WINDOW, "gpudem"]
        assert run.trace is not None
        begin = turned(results[f"{OWN}_1", "gpudem"])
        dt = run.scene.time.step
        ledger = oracle.follow(drums.theory(begin), dt, run.trace)
        power = -drums.SPIN * run.history["torque_drum_y"].to_numpy()
        work = run.history["work_drum"].to_numpy() - dt / 2 * (power - power[0])
        return Followed(run, ledger, work)

    return results.once("followed", compute)


def forces(results: kit.Results) -> kit.Measured:
    """Largest difference of the force on a ball at any step from the oracle's, by the largest force."""
    one = followed(results)
    assert one.run.trace is not None
    contact = one.run.trace["force"] - drums.MASS * np.array(one.run.scene.gravity)
    scale = np.linalg.norm(contact, axis=2).max()
    wall, pairs = one.ledger.contacts.mean(axis=0)
    note = f"{wall:.0f} contacts with the drum and {pairs:.0f} of balls on average"
    return kit.Measured(float(np.linalg.norm(contact - one.ledger.force, axis=2).max() / scale), note=note)


def torque(results: kit.Results) -> float:
    """Largest difference of the torque of the balls on the drum from the oracle's, by the largest."""
    one = followed(results)
    got = one.run.history["torque_drum_y"].to_numpy()
    return float(np.abs(got - one.ledger.torque).max() / np.abs(one.ledger.torque).max())


def work(results: kit.Results) -> float:
    """Largest difference of the work from the integral of -torque x angular velocity, by the work."""
    one = followed(results)
    power = -drums.SPIN * one.run.history["torque_drum_y"].to_numpy()
    integral = cumulative_trapezoid(power, dx=one.run.scene.time.step, initial=0.0)
    return float(np.abs(one.work - integral).max() / np.abs(integral).max())


def balance(results: kit.Results) -> kit.Measured:
    """Largest error of the balance of energy in the window, by the work of the drum over it."""
    one = followed(results)
    note = f"work {1e3 * one.work[-1]:.3g} mJ, dissipated {1e3 * one.ledger.dissipated[-1]:.3g} mJ"
    return kit.Measured(float(np.abs(one.balance).max() / one.work[-1]), note=note)


def held(name: str, measure: Callable[[kit.Results], Any], **fields: Any) -> kit.Check:
    """A check of the window."""
    return kit.check(name, measure, **{"against": "sums over contacts in NumPy", **fields})


EQUAL = (
    "exact permutation test of the largest standardized difference over all metrics (Westfall and Young), no"
    " significant difference at 0.01: the flow is chaotic, so that only distributions can agree"
)


def between(prefix: str, rule: str) -> kit.PerPair:
    """The codes' metrics over the seeds with a rule of mesh contacts in gpudem."""

    def measure(results: kit.Results, code: str, other: str) -> kit.Measured:
        seeds = len(results.labels(code, prefix=prefix))
        return over_seeds.smallest_p(compared(results, prefix, code, other), seeds)

    return kit.per_pair(
        f'smallest corrected p over all metrics, rule "{rule}" against {{other}}', measure,
        lo=over_seeds.ALPHA, tolerance=1.0, reason=EQUAL,
        catches="any bias of friction, damping or of the turning wall beyond the scatter of seeds",
    )  # fmt: skip


def early(results: kit.Results, code: str, other: str) -> dict[str, float]:
    """Largest distance of the centers of mass in x and z up to EARLY / diameter; NaN where few touch."""
    found = {}
    for label in results.labels(code, other, prefix=SAME):
        a, b = results[label, code].history, results[label, other].history
        soon = a["time"].to_numpy() < drums.EARLY + 1e-9
        d = np.hypot(*(a[k].to_numpy()[soon] - b[k].to_numpy()[soon] for k in ("centre_x", "centre_z")))
        touched = a["contacts"].to_numpy()[soon].max() > drums.COUNT
        found[label] = float(d.max()) / (2 * drums.RADIUS) if touched else float("nan")
    return found


def early_torque(results: kit.Results, code: str, other: str) -> dict[str, float]:
    """Largest difference of the torques about the axis up to EARLY / the largest; NaN without a torque."""
    found = {}
    for label in results.labels(code, other, prefix=SAME):
        a, b = (drums.history(results[label, c]) for c in (code, other))
        soon = (a["time"] > 0) & (a["time"] < drums.EARLY + 1e-9)  # a set-up may have no torque
        ours, theirs = a["torque_drum_y"][soon], b["torque_drum_y"][soon]
        largest = float(np.abs(theirs).max())
        found[label] = float(np.abs(ours - theirs).max()) / largest if largest > 0 else float("nan")
    return found


def widest(part: str, name: str, **fields: Any) -> kit.PerPair:
    """Largest difference of means within its 95 % confidence interval, of both rules."""

    def measure(results: kit.Results, code: str, other: str) -> dict[str, kit.Measured]:
        return {
            f"{prefix}: {metric}": c
            for prefix in (SAME, OWN)
            for metric, c in over_seeds.bounds(compared(results, prefix, code, other), part).items()
        }

    return kit.per_pair(
        f"{name}: largest difference of means that the seeds leave possible (95 %)", measure,
        catches="too few seeds, or too scattered ones, for the test above to mean anything", **fields,
    )  # fmt: skip
