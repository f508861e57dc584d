"""What the runs of a scene show: horizon, agreement, where codes separate, distributions, conservation."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from comparisons.harness import codes
from comparisons.harness.case import Results
from comparisons.metrics import bulk, contacts, growth, parting, statistics
from comparisons.scene_case import plan as plans
from comparisons.scene_case.plan import Plan
from gpudem.output.run import Run
from gpudem.scene import Scene
from gpudem.scene.groups import FREE, FROZEN, moving
from gpudem.scene.placed import Surface, walls_at
from gpudem.scene.removal import search_box
from gpudem.scene.time_step import position_spacing
from gpudem.scene.walls import Wall
from gpudem.solver.guards import inserted_energy

#: What another code may differ by, over what perturbed runs of gpudem differ by: these are few of the ways in
#: which rounding may develop, and on another one a grazing collision may multiply it.
FACTOR = 30.0
#: The horizon: there the allowed difference has grown to this share of the smallest diameter.
LIMIT = 1e-3
#: The horizon must lie behind so many times of the trace for an agreement to mean something.
LEAST_TIMES = 3
#: Change of positions / diameter by half the step up to which the error of the step is measured.
RESOLVED = 0.01
#: Level of the test over distributions.
ALPHA = 0.01
#: Times at which contacts are searched for the sanity of a run.
LOOKS = 60


@dataclasses.dataclass(frozen=True)
class Envelope:
    """What rounding explains in this scene, from perturbed runs of gpudem."""

    time: np.ndarray
    measured: dict[str, np.ndarray]
    """Largest differences so far of perturbed runs: position [m], speed [m/s], force [N], torque [N m]."""
    horizon: float
    """[s]; infinite: the whole run can be compared."""
    growth: growth.Growth

    @property
    def allowed(self) -> dict[str, np.ndarray]:
        """What two codes may differ by."""
        return {name: FACTOR * values for name, values in self.measured.items()}

    def at(self, time: np.ndarray) -> dict[str, np.ndarray]:
        """`allowed` at other times [s]."""
        return {name: np.interp(time, self.time, values) for name, values in self.allowed.items()}


@dataclasses.dataclass(frozen=True)
class Agreement:
    """Two codes compared particle by particle."""

    time: np.ndarray
    difference: np.ndarray
    """Largest difference of positions at each time / smallest diameter."""
    excess: float
    """Largest difference of positions or speeds until the horizon over what is allowed."""
    largest: float
    """Largest difference of positions until the horizon / smallest diameter."""
    parting: parting.Parting | None
    times: int
    """Times of the trace until the horizon."""

    @property
    def vacuous(self) -> bool:
        """Too few times until the horizon for an agreement to mean anything."""
        return self.times < LEAST_TIMES


def diameter(scene: Scene) -> float:
    """Smallest diameter [m], the scale of differences."""
    return 2 * float(scene.state.radius.min())


def trace(run: Run) -> dict[str, np.ndarray]:
    """The trace of a run. Raises ValueError where a code gives none."""
    if run.trace is None:
        raise ValueError(f"{run.code} gives no trace of this scene")
    return run.trace


def has(results: Results, label: str, *codes: str) -> bool:
    """Whether a variant ran through all of these codes."""
    return all((label, code) in results.runs for code in codes)


def envelope(results: Results, plan: Plan) -> Envelope:
    """Growth of rounding in the scene, from the runs of gpudem with perturbed starts."""

    def compute() -> Envelope:
        scene, own = plan.scene, trace(results[plans.SCENE, "gpudem"])
        found = [
            parting.differences(scene, own, trace(results[f"{plans.ROUNDING}_{k}", "gpudem"]))
            for k in range(1, plans.ROUNDING_RUNS + 1)
        ]
        floor = floors(scene, own)
        measured = {
            name: growth.running_envelope([f[name].max(axis=1) for f in found], floor[name])
            for name in found[0]
        }
        relative = measured["position"] / diameter(scene)
        rate = growth.growth(own["time"], relative, LIMIT / FACTOR)
        end = growth.horizon(own["time"], FACTOR * relative, LIMIT)
        return Envelope(own["time"], measured, end, rate)

    return results.once("envelope", compute)


def floors(scene: Scene, own: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Rounding of a motion without contacts: a random walk of one unit in the last place a step, each (t,).

    Perturbed starts do not show it: in free flight their difference does not grow.
    """
    steps, time = own["step"], own["time"]
    unit = float(np.finfo(np.float64 if scene.solver.precision == "float64" else np.float32).eps)
    fastest = np.maximum.accumulate(_norm(own["velocity"]).max(axis=1))
    spin = _norm(own["angular_velocity"]).max(axis=1) * float(scene.state.radius.max())
    walk = np.sqrt(1.0 + steps)
    speed = unit * np.maximum(fastest, np.maximum.accumulate(spin)) * walk
    none = np.full(len(steps), np.finfo(float).tiny)
    position = position_spacing(scene)[0] * walk + speed * time
    return {"position": position, "speed": speed + none, "force": none, "torque": none}


def _norm(vectors: np.ndarray) -> np.ndarray:
    """Magnitudes; 0 of particles that are not there."""
    return np.linalg.norm(np.nan_to_num(vectors), axis=2)


def agreement(results: Results, plan: Plan, code: str, other: str) -> Agreement:
    """Two codes particle by particle, from the scene's runs, and from a denser trace where there is one."""
    label = plans.DENSE if has(results, plans.DENSE, code, other) else plans.SCENE

    def compute() -> Agreement:
        limits = envelope(results, plan)
        whole = _pair(results, plans.SCENE, code, other)
        found = parting.differences(plan.scene, *whole)
        inside = limits.time <= limits.horizon
        ratios = [found[k].max(axis=1) / limits.allowed[k] for k in ("position", "speed")]
        relative = found["position"].max(axis=1) / diameter(plan.scene)
        names = codes.title(code), codes.title(other)
        first = _pair(results, label, code, other)
        where = parting.find(
            results[label, code].scene, names, *first, limits.at(first[0]["time"]),
            limits.horizon,
        )  # fmt: skip
        return Agreement(
            limits.time, relative, float(np.max(ratios, axis=0)[inside].max()), float(relative[inside].max()),
            where, int(inside.sum()),
        )  # fmt: skip

    return results.once(("agreement", label, code, other), compute)


def _pair(results: Results, label: str, code: str, other: str):
    return trace(results[label, code]), trace(results[label, other])


def halving(results: Results, plan: Plan) -> tuple[np.ndarray, np.ndarray]:
    """(time [s], largest difference of positions of the step and half the step / smallest diameter)."""
    own, half = trace(results[plans.SCENE, "gpudem"]), trace(results[plans.HALF, "gpudem"])
    count = min(len(own["time"]), len(half["time"]))
    shift = contacts.nearest_image(
        own["position"][:count] - half["position"][:count], parting.period(plan.scene)
    )
    return own["time"][:count], _norm(shift).max(axis=1) / diameter(plan.scene)


def resolved(results: Results, plan: Plan) -> float:
    """Time [s] until which errors of the step can be measured: half the step changes positions little."""
    time, relative = halving(results, plan)
    return min(envelope(results, plan).horizon, growth.horizon(time, relative, RESOLVED))


# -- distributions -------------------------------------------------------------------------------------------


def seed_labels(plan: Plan) -> list[str]:
    """Labels of the variants over seeds."""
    return [f"{plans.SEED}_{k}" for k in range(1, plan.seeds + 1)]


def has_seeds(results: Results, plan: Plan, *codes: str) -> bool:
    """Whether all runs over seeds exist of all of these codes."""
    return all(has(results, label, *codes) for label in seed_labels(plan))


def no_last_state(plan: Plan) -> str:
    """Why there is no state of all in the last part of the run, over which metrics are means; else ""."""
    if plan.scene.exits:
        return "particles leave"
    late = int(plan.scene.arrival_steps[-1]) > (1 - bulk.LAST) * plan.scene.n_steps
    return "particles are inserted until the end of the run" if late else ""


def samples(results: Results, plan: Plan, code: str) -> dict[str, np.ndarray]:
    """Metric -> its values over the seeds of one code."""

    def compute() -> dict[str, np.ndarray]:
        up, flow = bulk.axes(plan.scene, trace(results[plans.SCENE, "gpudem"]))
        rows = [
            bulk.metrics(results[lab, code].scene, trace(results[lab, code]), up, flow)
            for lab in seed_labels(plan)
        ]
        return {name: np.array([row[name] for row in rows]) for name in rows[0]}

    return results.once(("samples", code), compute)


def distributions(results: Results, plan: Plan, code: str, other: str) -> dict[str, statistics.Comparison]:
    """Metric -> comparison of two codes over seeds; metrics that are constant and equal in both are left
    out.
    """

    def compute() -> dict[str, statistics.Comparison]:
        one, two = samples(results, plan, code), samples(results, plan, other)
        names = [n for n in one if np.ptp([one[n], two[n]]) > 1e-9 * abs(one[n].mean())]
        return statistics.compare({n: one[n] for n in names}, two) if names else {}

    return results.once(("distributions", code, other), compute)


def detectable(found: dict[str, statistics.Comparison]) -> float:
    """Largest half width of the 95 % intervals of the differences over the standard deviation of a seed."""
    widths = [
        c.half_width / math.sqrt((c.spread[0] ** 2 + c.spread[1] ** 2) / 2)
        for c in found.values() if max(c.spread) > 0
    ]  # fmt: skip
    return max(widths, default=math.nan)


# -- conservation and sanity ---------------------------------------------------------------------------------


@dataclasses.dataclass(frozen=True)
class Sanity:
    """One run of one code by itself."""

    time: np.ndarray
    energy: np.ndarray
    """Kinetic, potential and elastic energy of normal contacts [J] at these times, and what particles that
    have left took along, less what inserted particles have brought and the work of walls; NaN where that is
    not known.
    """
    brought: np.ndarray
    """Energy [J] that inserted particles have brought by these times."""
    left: np.ndarray
    """Energy [J] that particles have taken along by these times, as of the time of the trace before."""
    leavers: int
    """How many have left by the last time."""
    work: np.ndarray
    """Work of walls that move on the particles since the start [J] at these times; 0 where none moves."""
    unknown: str
    """Why the work of walls is not known, or nothing."""
    scale: float
    """Largest kinetic energy [J]."""
    contacts: np.ndarray
    """Contacts at these times."""
    overlap: float
    """Largest overlap / smaller radius at these times."""
    outside: int
    """Particles that are not finite, or outside the domain, at any time of the trace."""
    momentum: float
    """Largest change of momentum, that of gravity taken off / sum of m |v| and of that of gravity."""


def sanity(results: Results, plan: Plan, code: str) -> Sanity:
    """Conservation and sanity of a code's run of the scene."""

    def compute() -> Sanity:
        scene, whole = plan.scene, trace(results[plans.SCENE, code])
        known = _told(results[plans.SCENE, code], whole["step"])
        looks = known[np.unique(np.linspace(0, len(known) - 1, LOOKS).astype(int))]
        busy = _busiest(scene, whole)
        looks = np.unique([*looks, *busy])
        part = {k: v[looks] for k, v in whole.items()}
        energy, (work, ways, unknown) = (
            bulk.energies(scene, part, free=True),
            walls_work(results[plans.SCENE, code], part),
        )
        walls = [
            walls_at(scene, float(t), {n: w[k] for n, w in ways.items() if np.isfinite(w[k]).all()})
            for k, t in enumerate(part["time"])
        ]
        states = [parting.state_of(scene, x, here) for x, here in zip(part["position"], walls, strict=True)]
        elastic = np.array(
            [elastic_energy(scene, *one) for one in zip(states, walls, part["step"].tolist(), strict=True)]
        )
        kinetic, brought = bulk.energies(scene, whole)["kinetic"], inserted_energy(scene, part["step"])
        left, leavers = bulk.energy_that_left(scene, whole)
        left = left[looks]
        return Sanity(
            part["time"],
            energy["kinetic"] + energy.get("potential", 0.0) + elastic + left - brought - work,
            brought, left, leavers, work, unknown,
            float(kinetic.max()),
            np.array([len(s) for s in states]),
            max(s.largest_overlap(scene.state.radius) for s in states), _outside(scene, whole),
            _momentum(scene, whole),
        )  # fmt: skip

    return results.once(("sanity", code), compute)


def walls_work(run: Run, part: dict[str, np.ndarray]) -> tuple[np.ndarray, dict[str, np.ndarray], str]:
    """What a run tells of its walls and groups that move, at the steps of a trace, (t,).

    Returns:
        Their work on the particles since the start [J], NaN where the history has no row or no column of it;
        how far servos have moved their walls beyond the motions of the scene [m], (t, 3), by name; which
        column is missing, or nothing.
    """
    walls = [wall for wall in run.scene.wall_elements if wall.name in run.scene.moving_walls]
    groups = moving(run.scene)
    steps = part["step"]
    work, ways = np.zeros(len(steps)), {}
    if not walls and not groups:
        return work, ways, ""
    table = run.history.set_index("step").reindex(steps) if run.history is not None else None
    for mover in (*walls, *groups):
        column, place = f"work_{mover.name}", [f"position_{mover.name}_{axis}" for axis in "xyz"]
        if table is None or column not in table:
            what = "wall" if mover in walls else "group"
            missing = f"{codes.title(run.code)} does not tell the work of {what} {mover.name!r}"
            return np.full(len(steps), np.nan), ways, missing
        work = work + table[column].to_numpy()
        if isinstance(mover, Wall) and mover.name in run.scene.servos:
            ways[mover.name] = table[place].to_numpy() - _stated_places(run.scene, mover, steps)
    return work, ways, ""


def _stated_places(scene: Scene, wall: Wall, steps: np.ndarray) -> np.ndarray:
    """Where the stated motions of a wall, without its servos, take its torque point [m], (t, 3)."""
    path, point = scene.wall_paths[wall.name], np.array(wall.torque_point)
    return np.concatenate([path.at(step, 1).place_of(point) for step in steps.tolist()])


def _told(run: Run, steps: np.ndarray) -> np.ndarray:
    """The indices of these steps at which the work of walls is known: all where none moves."""
    if run.history is None or not (run.scene.moving_walls or moving(run.scene)):
        return np.arange(len(steps))
    return np.flatnonzero(np.isin(steps, run.history["step"]))


def _busiest(scene: Scene, whole: dict[str, np.ndarray]) -> list[int]:
    """Index of the largest contact force: where the overlap is largest."""
    if "force" not in whole:
        return []
    weight = scene.masses[:, None] * scene.gravity_at(whole["step"])[:, None]
    pull = np.where((scene.held == FREE)[:, None], whole["force"] - weight, 0.0)
    return [int(np.argmax(_norm(pull).max(axis=1)))]


def elastic_energy(scene: Scene, state: contacts.Contacts, walls: Sequence[Surface], step: int) -> float:
    """Elastic energy [J] of the normal contacts by the scene's law: m* v^2/2 of each overlap."""
    names, law, at = list(scene.materials), scene.normal_law, scene.phase_after(step - 1)
    mass, radius = scene.masses.tolist(), scene.state.radius.tolist()
    material, energy = scene.state.material, 0.0
    for (i, j), overlap in zip(state.pairs.tolist(), state.overlap.tolist(), strict=True):
        r, m = radius[i] * radius[j] / (radius[i] + radius[j]), mass[i] * mass[j] / (mass[i] + mass[j])
        if FROZEN in (scene.held[i], scene.held[j]):
            m = mass[j] if scene.held[i] == FROZEN else mass[i]
        inputs = at.inputs(names[material[i]], names[material[j]])
        energy += 0.5 * m * law.release_speed(inputs, r, m, max(overlap, 0.0)) ** 2
    for (i, k), overlap in zip(state.wall_pairs.tolist(), state.wall_overlap.tolist(), strict=True):
        inputs = at.inputs(names[material[i]], walls[k].material)
        energy += 0.5 * mass[i] * law.release_speed(inputs, radius[i], mass[i], overlap) ** 2
    return float(energy)


def _outside(scene: Scene, whole: dict[str, np.ndarray]) -> int:
    position = whole["position"]
    slack, (lo, hi) = 1e-6 * float(scene.state.radius.max()), search_box(scene)
    bad = ~np.isfinite(position) | (position < lo - slack) | (position > hi + slack)
    there = np.less_equal(scene.arrival_steps, whole["step"][:, None])
    if scene.exits:  # those that have left are in no later row
        missing = np.isnan(position[..., 0])
        there = there & ~np.logical_and.accumulate(missing[::-1])[::-1]
    bad &= there[..., None]
    return int(bad.any(axis=(0, 2)).sum())


def _momentum(scene: Scene, whole: dict[str, np.ndarray]) -> float:
    mass = scene.masses
    total = np.einsum("i,tij->tj", mass, whole["velocity"])
    pull = scene.gravity_at(whole["step"])[1:] * np.diff(whole["time"])[:, None]
    fall = mass.sum() * np.cumsum(np.concatenate([np.zeros((1, 3)), pull]), axis=0)
    moved = np.linalg.norm(total - total[0] - fall, axis=1)
    scale = (np.linalg.norm(whole["velocity"], axis=2) @ mass).max() + np.linalg.norm(fall, axis=1).max()
    return float(moved.max() / scale) if scale > 0 else 0.0
