"""Guards against results that are wrong without looking so: what they hold to, and what they say.

Speed and overlap are checked on the device whenever the neighbor list is rebuilt, which fast particles
bring about by themselves; they end the run. The energy is looked at in the history, and warned about.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from gpudem.scene.groups import FREE
from gpudem.scene.insertion import statement_of
from gpudem.scene.overlaps import find_overlaps, start_elastic_energy
from gpudem.scene.placed import walls_at

if TYPE_CHECKING:
    import pandas

    from gpudem.output.run import Run
    from gpudem.scene import Scene
    from gpudem.scene.walls import Wall

#: Largest overlap, as a share of the smaller radius: beyond it no contact law holds.
MAX_OVERLAP = 0.5
#: Largest displacement in a step, as a share of the smallest radius: beyond it spheres pass through others.
MAX_MOVE = 1.0
#: States of a run's output at which overlaps are looked for.
STATES = 20
#: Growth of kinetic and potential energy, as a share of what the scene had to lose.
MAX_GROWTH = 0.05

OVERLAP_ADVICE = (
    "the material is too soft or the time step too long for this speed; waive with allow = ['large_overlap']"
)
SPEED_ADVICE = "it would pass through others: a shorter time step; waive with allow = ['speed']"


def pair_advice(scene: Scene, i: int, j: int, step: int) -> str:
    """What to do about two particles, rows of the scene, deep in one another in a step."""
    late = max(i, j)
    if not scene.insert or scene.arrival_steps[late] != step:
        return OVERLAP_ADVICE
    return (
        f"insert[{statement_of(scene, late)}] inserts particle {late + 1} in this step where particle"
        f" {min(i, j) + 1} is: an insertion avoids particles of the start in the first step only, and"
        " inserted ones in free flight; choose a region or a time without others, or waive with"
        " allow = ['large_overlap']"
    )


def wall_advice(scene: Scene, wall: Wall) -> str:
    """What to do about a particle deep in a wall."""
    times = [f"{step * scene.time.step:g}" for step in scene.comings(wall)]
    if not times:
        return OVERLAP_ADVICE
    comes = f"the wall came where the particle was (it is there from t = {', '.join(times)} s on), or"
    return f"{comes} {OVERLAP_ADVICE}"


def overlap_limit(scene: Scene) -> float:
    """Largest overlap as a share of the smaller radius; infinite for a scene that waives it."""
    return float("inf") if {"overlap", "large_overlap"} & set(scene.allow) else MAX_OVERLAP


def speed_limit(scene: Scene) -> float:
    """Largest speed [m/s]: smallest radius by time step, less that of the fastest wall.

    Infinite for a scene that waives it.
    """
    if "speed" in scene.allow:
        return float("inf")
    fastest = max(scene.wall_speeds, default=0.0)
    # mutate: speed_limit
    return max(0.0, MAX_MOVE * float(scene.state.radius.min()) / scene.time.step - fastest)


def inserted_energy(scene: Scene, steps: np.ndarray) -> np.ndarray:
    """Kinetic and potential energy [J] of the particles that have come up to each of these steps."""
    if not scene.insert:
        return np.zeros(len(steps))
    state, mass, first = scene.state, scene.masses, scene.start_count
    kinetic = mass * (state.velocity**2).sum(axis=1)
    kinetic += 0.4 * mass * state.radius**2 * (state.angular_velocity**2).sum(axis=1)
    gravity = scene.gravity_at(scene.arrival_steps)
    brought = 0.5 * kinetic - mass * np.sum(state.position * gravity, axis=1)
    total = np.concatenate([[0.0], np.cumsum(brought[first:])])
    return total[np.searchsorted(scene.arrival_steps[first:], steps, side="right")]


def energy_warnings(
    scene: Scene, history: pandas.DataFrame | None, left: np.ndarray | float | None = None
) -> list[str]:
    """Whether kinetic + potential energy grew above its start, which nothing dissipative and closed can do.

    What inserted particles bring is taken off, and what has left by each row of the history [J] is added;
    where that is not known, and beside periodic sides, scenes with open sides are left out. Scale: the
    kinetic energy at the start and the energy of a
    fall by one diameter. Particles that overlap at the start release elastic energy: a growth within that has
    its own cause, and another sentence. Scenes with walls that move or that come in the run, with phases or
    groups that move, which do work, and those that waive the check of start overlaps, or with cohesion or
    adhesion, whose energy is not in the history, are left out.
    """
    driven = scene.needs.vibration or any(scene.comings(wall) for wall in scene.wall_elements)
    driven = driven or scene.phases or any(group.motion for group in scene.groups)
    attracted = scene.needs.cohesion or scene.contact_range > 0
    unknown = bool(scene.exits) and (left is None or scene.needs.periodic)
    closed = scene.needs.damping and not (driven or attracted or unknown) and "overlap" not in scene.allow
    if history is None or not closed or len(history) < 2:
        return []
    energy = history[["kinetic_energy", "rotational_energy", "potential_energy"]].to_numpy().sum(axis=1)
    if scene.insert:
        energy = energy - inserted_energy(scene, history.step.to_numpy())  # mutate: inserted_energy
    energy = energy + (0.0 if left is None else left)
    fall = float(scene.masses @ (2 * scene.state.radius)) * float(np.linalg.norm(scene.gravity))
    kinetic = float(history.kinetic_energy.iloc[0] + history.rotational_energy.iloc[0])
    growth = (energy - energy[0]) / max(kinetic + fall, 1e-300)
    if not growth.max() > MAX_GROWTH:
        return []
    k = int(np.argmax(growth > MAX_GROWTH))
    cause = "the time step is too long for this scene"
    if scene.start_overlap > 0:
        released = start_elastic_energy(scene) / max(kinetic + fall, 1e-300)
        if growth.max() <= MAX_GROWTH + released:
            cause = f"overlaps at the start, up to {100 * scene.start_overlap:.3g} % of a radius, release it"
    return [
        f"energy grew: at t = {history.time.iloc[k]:.6g} s kinetic and potential energy exceed those at the"
        f" start by {100 * growth[k]:.3g} % of the kinetic energy at the start and a fall by one diameter"
        f" (at most {100 * growth.max():.3g} % later): {cause}"
    ]


def overlap_warnings(run: Run) -> list[str]:
    """The deepest overlap in the output of a run, where it is one that ends a run of gpudem.

    For codes that do not look for it. Looked at are some states of the trace, or of the frames, the one with
    the largest force among them; walls with a servo, whose place the scene does not tell, are left out.
    """
    scene, limit = run.scene, overlap_limit(run.scene)
    if np.isinf(limit):
        return []
    share, words, advice = limit, "", ""
    for time, rows, position in _states(run):
        found, what, why = _deepest(scene, time, rows, position, share)
        if found > share:
            share, words, advice = found, f"{what} at t = {time:.6g} s", why
    if not words:
        return []
    return [
        f"overlap of {share:.3g} of the radius: {words}; beyond {limit:g} no contact law holds, and gpudem"
        f" ends a run: {advice}"
    ]


def _states(run: Run) -> Iterator[tuple[float, np.ndarray, np.ndarray]]:
    """(time [s], rows and positions [m] of the particles that are there) of some states of a run's output."""
    if run.trace is not None:
        trace = run.trace
        rows = np.linspace(0, len(trace["time"]) - 1, STATES).astype(int)
        if "force" in trace:
            largest = np.linalg.norm(np.nan_to_num(trace["force"]), axis=2).max(axis=1, initial=0.0)
            rows = np.append(rows, np.argmax(largest))
        for k in np.unique(rows):
            there = np.flatnonzero(np.isfinite(trace["position"][k]).all(axis=1))
            yield float(trace["time"][k]), there, trace["position"][k][there]
        return
    frames = run.frames
    for k in np.unique(np.linspace(0, len(frames) - 1, STATES).astype(int)):
        frame = frames[k]
        yield float(frames.times[k]), np.asarray(frame["id"]) - 1, frame["position"]


def _deepest(
    scene: Scene, time: float, rows: np.ndarray, position: np.ndarray, limit: float
) -> tuple[float, str, str]:
    """(overlap / smaller radius, whose, advice) of the deepest overlap above a share; 0 if there is none."""
    share, words, advice = 0.0, "", OVERLAP_ADVICE
    radius, free = scene.state.radius[rows], scene.held[rows] == FREE
    for wall in walls_at(scene, time):
        depth = np.where(free, wall.overlap(position, radius) / radius, 0.0)
        if len(rows) and depth.max() > max(limit, share):
            share = float(depth.max())
            words = f"particle {rows[np.argmax(depth)] + 1} in wall {wall.name}"
    if len(rows) < 2:
        return share, words, advice
    lo, hi = np.array(scene.domain.lo), np.array(scene.domain.hi)
    period = np.where(scene.domain.periodic, hi - lo, 0.0)
    inside = np.where(period > 0, np.mod(position - lo, hi - lo), position - lo)
    found = find_overlaps(inside, radius, period, max(limit, share), free)
    if found is None:
        return share, words, advice
    i, j = found.worst
    words = f"particles {rows[i] + 1} and {rows[j] + 1}"
    advice = pair_advice(scene, int(rows[i]), int(rows[j]), scene.steps(time))
    return found.overlap / float(radius[[i, j]].min()), words, advice
