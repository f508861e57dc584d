"""Which variants of a scene are run: the scene itself, perturbed starts, half the step, seeds, steps."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from comparisons.harness.case import Variant
from gpudem.scene import Scene
from gpudem.scene.groups import FREE
from gpudem.scene.time_step import position_spacing

#: Labels of the variants.
SCENE, AGAIN, HALF = "scene", "again", "half_step"
ROUNDING, SEED, RUNG, DENSE = "rounding", "seed", "step", "dense"

#: Memory [bytes] of the traces of one scene in the runs that are compared particle by particle.
TRACE_MEMORY = 300e6
#: ... and in all runs over seeds.
SEED_MEMORY = 300e6
#: Bytes of one particle at one time of a trace: five vectors, float64.
ENTRY = 5 * 3 * 8
#: Times of a trace at most.
MOST_TIMES = 40_000
#: Times of the traces over seeds at most: distributions need no more.
SEED_TIMES = 80
#: Rows of the histories.
HISTORY_ROWS = 200

#: Runs of gpudem with a start perturbed by rounding, from which the growth of rounding is measured.
ROUNDING_RUNS = 3
#: Size of that perturbation in distances of neighboring floating-point numbers at the corner of the domain.
#: Codes round in another order at each step; several units in the last place make each rounding another one.
ROUNDING_UNITS = 8.0
#: Size of the perturbation in `mixed` precision, in diameters: float32 rounding of an overlap of 1 %.
MIXED_PERTURBATION = 1e-9
#: Perturbation of the starts of a scene without a random part, in diameters.
SEED_PERTURBATION = 1e-9

#: Steps of `--work-precision` as multiples of the scene's; the last one is the reference.
LADDER = (2.0, 1.0, 0.5, 0.25, 0.0625)
PRECISIONS = ("float64", "mixed", "float32")


@dataclasses.dataclass(frozen=True)
class Plan:
    """What is done with one scene."""

    scene: Scene
    """As it is compared: trace and history at the chosen intervals, no frames."""
    seeds: int
    work_precision: bool
    times: int
    """Times of the trace."""

    @property
    def stride(self) -> int:
        """Steps between times of the trace."""
        return self.scene.stride(self.scene.output.trace_every) or 1

    @property
    def starts(self) -> str:
        """What the runs over seeds differ in, in words."""
        return "seeds" if self.random else "perturbed starts"

    @property
    def random(self) -> bool:
        """Whether the scene has a random part of its own."""
        return self.scene.particles is not None and self.scene.particles.source == "lattice"


def make(scene: Scene, seeds: int, work_precision: bool, precision: str | None = None) -> Plan:
    """The plan of a scene. `precision`: that of the comparison; None: float64, whatever the scene states."""
    limit = TRACE_MEMORY / (ROUNDING_RUNS + 4) / (ENTRY * len(scene.state))
    made = sampled(scene, int(min(MOST_TIMES, limit)), scene.n_steps)
    made = made.replace(solver={"precision": precision or "float64"})
    return Plan(made, seeds, work_precision, made.n_steps // (made.stride(made.output.trace_every) or 1) + 1)


def sampled(scene: Scene, times: int, n_steps: int) -> Scene:
    """A scene of so many steps with a trace of at most so many times, a history, and no frames."""
    step = scene.time.step
    stride = max(1, math.ceil(n_steps / max(1, times - 1)))
    rows = max(1, n_steps // HISTORY_ROWS)
    moving = [wall.name for wall in scene.wall_elements if wall.name in scene.moving_walls]
    groups = [group.name for group in scene.groups if group.motion]
    if moving or groups or scene.exits:  # their work, and what has left, are read at times of the trace
        rows = stride * math.ceil(rows / stride)
    output = {
        "frames_every": None, "restart_every": None, "history": None,
        "trace_every": stride * step, "history_every": rows * step,
        "wall_forces": tuple(dict.fromkeys([*scene.output.wall_forces, *moving])), "wall_stress": (),
        "group_forces": tuple(dict.fromkeys([*scene.output.group_forces, *groups])),
    }  # fmt: skip
    return scene.replace(output=output, time={"duration": n_steps * step})


def first_variants(plan: Plan) -> list[Variant]:
    """Those that need no result: the scene in every code, and what shows its growth of rounding."""
    scene, own = plan.scene, ("gpudem",)
    half = scene.replace(time={"step": scene.time.step / 2, "duration": scene.time.duration})
    return [
        Variant(SCENE, scene, open=True),
        *(
            Variant(f"{ROUNDING}_{k}", perturbed(scene, rounding(scene), k), own)
            for k in range(1, ROUNDING_RUNS + 1)
        ),
        Variant(AGAIN, scene, own),
        Variant(HALF, half, own),
    ]


def rounding(scene: Scene) -> float:
    """Size [m] of a perturbation of positions that stands for rounding in the scene's precision."""
    if scene.solver.precision == "mixed":
        return MIXED_PERTURBATION * 2 * float(scene.state.radius.min())
    return ROUNDING_UNITS * position_spacing(scene)[0]


def perturbed(scene: Scene, size: float, seed: int) -> Scene:
    """The scene with each coordinate shifted at random by at most `size` [m].

    An axis along which all particles have one coordinate and nothing acts or moves is left out: both codes
    compute such a motion exactly in the plane.
    """
    state, rng = scene.state, np.random.default_rng(seed)
    shift = rng.uniform(-1, 1, state.position.shape) * size
    free = (scene.held == FREE)[:, None]  # the others have no velocity of their own
    shift = np.where(free, shift, 0.0)
    resting = np.ptp(state.position, axis=0) == 0
    resting &= ~state.velocity.any(axis=0) & ~np.any([at.gravity for at in scene.phase_scenes], axis=0)
    if not state.angular_velocity.any():
        shift[:, resting] = 0.0
    position = np.clip(state.position + shift, scene.domain.lo, scene.domain.hi)
    names = list(scene.materials)
    columns: dict[str, Any] = {
        "position": position, "radius": np.array(state.radius),
        "material": tuple(names[m] for m in state.material.tolist()),
        "velocity": np.where(free, state.velocity, 0.0),
        "angular_velocity": np.where(free, state.angular_velocity, 0.0),
    }  # fmt: skip
    first = scene.start_count
    changes: dict[str, Any] = {}
    if first:
        changes["particles"] = {"source": "explicit", **{k: v[:first] for k, v in columns.items()}}
    if scene.insert:
        inserted = {k: v[first:] for k, v in columns.items()}
        changes["insert"] = [{"kind": "list", "time": scene.inserted.time, **inserted}]
    return scene.replace(**changes)


def seed_variants(plan: Plan) -> list[Variant]:
    """The scene from several starts, in every code: other seeds of its packing, or tiny perturbations."""
    scene = plan.scene
    times = int(min(SEED_TIMES, SEED_MEMORY / (2 * plan.seeds) / (ENTRY * len(scene.state))))
    coarse = sampled(scene, max(2, times), scene.n_steps)
    own = getattr(scene.particles, "seed", 0)
    size = SEED_PERTURBATION * 2 * float(scene.state.radius.min())
    starts = [
        coarse.replace(particles={"seed": own + k}) if plan.random else perturbed(coarse, size, 100 + k)
        for k in range(plan.seeds)
    ]
    return [Variant(f"{SEED}_{k}", start, open=True) for k, start in enumerate(starts, 1)]


def dense_variant(plan: Plan, until: float) -> Variant:
    """The scene up to a time [s], with as dense a trace as the memory allows."""
    steps = min(plan.scene.n_steps, plan.scene.steps(until) + 2 * plan.stride)
    return Variant(DENSE, sampled(plan.scene, plan.times, steps), open=True)


def rungs(plan: Plan, until: float) -> list[tuple[str, float, str, Scene]]:
    """(label, step [s], precision, scene) of `--work-precision`, with a trace of few times up to `until`."""
    coarse, found = max(LADDER), []
    base = plan.scene.time.step
    steps = max(1, math.floor(min(until, plan.scene.time.duration) / (base * coarse) + 1e-9))
    stride = max(1, steps // 20)
    for factor in LADDER:
        for precision in PRECISIONS:
            if factor == LADDER[-1] and precision != "float64":
                continue
            times = {"step": base * factor, "duration": stride * (steps // stride) * base * coarse}
            output = {"trace_every": stride * base * coarse, "history_every": None, "frames_every": None}
            allow = tuple({*plan.scene.allow, "time_step"})
            scene = plan.scene.replace(
                time=times, output=output, solver={"precision": precision}, allow=allow
            )
            found.append((f"{RUNG}_{factor:g}_{precision}", base * factor, precision, scene))
    return found


def rung_variants(plan: Plan, until: float) -> list[Variant]:
    """Variants of `--work-precision`: gpudem in each precision, other codes in float64, one core each.

    Twice the step may be too long for a code: that it gives up is a result.
    """
    return [
        Variant(
            label, scene, None if precision == "float64" else ("gpudem",), {"gpudem": {"threads": 1}},
            open=True, may_end=True, timed=True,
        )
        for label, _, precision, scene in rungs(plan, until)
    ]  # fmt: skip
