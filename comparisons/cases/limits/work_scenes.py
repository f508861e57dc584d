"""Error against run time of many simultaneous contacts: the scenes, the error of a run, the cost of an error.

Pairs of equal spheres meet at the same angle and at other phases of a step; each pair moves as
the oracle's one pair, shifted in time. With thousands of contacts in a run, stepping time is arithmetic.
"""

from __future__ import annotations

import math

import numpy as np

from comparisons.kit import Results
from comparisons.oracles.bodies import of_material
from comparisons.oracles.closed_forms import elastic_contact_time
from comparisons.oracles.impact import Impact, impact
from gpudem.output.run import Run
from gpudem.scene import Material, Scene

RADIUS, SPEED, SLIDE = 0.003, 1.0, 0.6
#: Restitution of the groups; every pair belongs to one.
GROUPS = (0.3, 0.5, 0.9, 1.0)
BALL = Material(young=5e6, poisson=0.34, density=1768.0)
#: Elastic Hertz contact time of the pairs [s].
PERIOD = elastic_contact_time(of_material(BALL, RADIUS, wall=False), SPEED)
#: Snapshots in a contact at which runs are compared with the oracle; every time step divides this interval.
SNAPSHOTS = 10
#: Length of a run in elastic contact times: the longest damped contact (e = 0.3) takes 1.2 of them.
LENGTH = 1.5
#: Kinds of contact: speed along the surface [m/s], friction, contact law.
KINDS: dict[str, tuple[float, float, dict[str, bool]]] = {
    "normal": (0.0, 0.0, {}),
    "oblique": (SLIDE, 0.1, {"limit_force": True, "tangential_damping": False}),  # Coulomb's limit is kept
    "oblique_default": (SLIDE, 0.1, {}),  # LIGGGHTS' default law
}


def scene(kind: str, steps: int, pairs: int, seed: int = 1) -> Scene:
    """`pairs` pairs in each group, `steps` time steps in an elastic contact."""
    slide, friction, contact = KINDS[kind]
    names = [f"ball_{k}" for k in range(len(GROUPS))]
    table = [
        {"materials": (a, b), "restitution": GROUPS[i + k], "friction": friction}
        for i, a in enumerate(names) for k, b in enumerate(names[i:])
    ]  # fmt: skip
    count = pairs * len(GROUPS)
    side = math.ceil(count ** (1 / 3))
    cell = 8 * RADIUS
    index = np.arange(count)
    centre = cell * (0.5 + np.stack([index % side, index // side % side, index // side**2], axis=1))
    approach = np.array([0.5 * SPEED, 0.5 * slide, 0.0])
    # after the first step of the coarsest rung: its set-up half step is another scheme's
    flight = np.random.default_rng(seed).uniform(1.02, 1.98, count)[:, None] * PERIOD / SNAPSHOTS
    touch = np.array([RADIUS, 0.0, 0.0])
    position = np.stack([centre - touch - flight * approach, centre + touch + flight * approach], axis=1)
    velocity = np.broadcast_to(np.stack([approach, -approach]), (count, 2, 3))
    return Scene(
        name=f"{kind}_{steps}",
        materials=dict.fromkeys(names, BALL),
        pairs=table,
        contact=contact,
        particles={
            "source": "explicit", "radius": RADIUS,
            "material": [names[i % len(GROUPS)] for i in index for _ in "ij"],
            "position": position.reshape(-1, 3), "velocity": velocity.reshape(-1, 3),
        },
        domain={"lo": (0, 0, 0), "hi": (cell * side,) * 3},
        time={"step": PERIOD / steps, "duration": LENGTH * PERIOD},
        output={"trace_every": PERIOD / SNAPSHOTS},
        allow=["time_step"],
    )  # fmt: skip


def truths(results: Results, stated: Scene, kind: str) -> list[Impact]:
    """The exact impact of the first pair of each group."""
    return results.once(
        ("truth", kind), lambda: [impact(stated, 2 * g, 2 * g + 1) for g in range(len(GROUPS))]
    )


def errors(results: Results, run: Run, kind: str) -> np.ndarray:
    """Largest error of the distance vector over the snapshots and the pairs of a group / peak overlap; shape
    (groups,).
    """
    trace, stated = run.trace, run.scene
    apart = trace["position"][:, ::2] - trace["position"][:, 1::2]
    start = stated.state.position[::2] - stated.state.position[1::2]
    approach = stated.state.velocity[0, 0] - stated.state.velocity[1, 0]
    flight = (-start[:, 0] - 2 * RADIUS) / approach
    worst = np.empty(len(GROUPS))
    for g, truth in enumerate(truths(results, stated, kind)):
        rows = np.arange(g, apart.shape[1], len(GROUPS))
        since = trace["time"][:, None] - flight[rows]
        at = truth.at(truth.touch + since.ravel())["position"]
        exact = (at[:, 0] - at[:, 1]).reshape(*since.shape, 3)
        difference = np.linalg.norm(apart[:, rows] - exact, axis=2)
        worst[g] = difference.max() / truth.contact.peak_overlap
    return worst


def cost_of(target: float, error: np.ndarray, cost: np.ndarray) -> float:
    """Cost (time or steps) at which the error falls to `target`, interpolated linearly in log-log.

    Points in order of rising cost. NaN where none reaches the target; the first cost (an upper bound) where
    the first error is already below it.
    """
    above = np.flatnonzero(error > target)
    if not len(above):
        return float(cost[0])
    k = int(above[-1])
    if k + 1 == len(error):
        return math.nan
    share = math.log(error[k] / target) / math.log(error[k] / error[k + 1])
    return float(cost[k] * (cost[k + 1] / cost[k]) ** share)
