"""Impacts of every kind of partner in one scene, each touching at several moments within a step.

Between particles of one material and of two, of one radius and of two, and at walls of two materials, one
along an axis and one tilted; for measuring the order of convergence against `tests.reference.exact_impact`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from comparisons.metrics.trace import observed_order
from gpudem.driver import simulate
from gpudem.scene import Scene
from tests.reference.exact_impact import Exact, exact_impact

#: About the longest contact of these scenes [s]; the ladder of steps divides it.
PERIOD = 1.1e-3
#: Snapshots in a PERIOD at which a run is held against the exact motion; every rung is a multiple of it.
SNAPSHOTS = 10
LADDER = (40, 80, 160, 320)
#: Impacts of each kind; they touch at moments spread over a step.
PHASES = 6

MATERIALS = {
    "soft": {"young": 5e6, "poisson": 0.34, "density": 1768.0},
    "heavy": {"young": 8e6, "poisson": 0.2, "density": 4000.0},
    "floor": {"young": 2e7, "poisson": 0.3, "density": 1000.0},
    "slope": {"young": 6e6, "poisson": 0.25, "density": 1000.0},
}
#: (materials, restitution, friction, kn, kt, gamma_n, gamma_t); the last four for hertz/stiffness;
#: times ROOT, and the damping twelve times that, for hooke/stiffness.
PAIRS = (
    (("soft", "soft"), 0.5, 0.1, 4e6, 3e6, 3e5, 2e5),
    (("soft", "heavy"), 0.7, 0.15, 5e6, 4e6, 2e5, 3e5),
    (("soft", "floor"), 0.6, 0.12, 6e6, 4e6, 2e5, 2e5),
    (("heavy", "floor"), 0.4, 0.08, 7e6, 6e6, 3e5, 1e5),
    (("heavy", "slope"), 0.5, 0.1, 6e6, 5e6, 2e5, 2e5),
    (("soft", "slope"), 0.8, 0.1, 5e6, 4e6, 1e5, 2e5),
    (("heavy", "heavy"), 0.8, 0.1, 8e6, 6e6, 1e5, 1e5),
)
#: sqrt(R* overlap) of these impacts, about [m].
ROOT = 5e-4
#: Kind of impact -> (material, radius) of the first, of the second or the name of a plane.
KINDS: dict[str, tuple[tuple[str, float], tuple[str, float] | str]] = {
    "equal spheres": (("soft", 0.003), ("soft", 0.003)),
    "radii differ": (("soft", 0.003), ("soft", 0.002)),
    "all differs": (("soft", 0.0025), ("heavy", 0.003)),
    "floor": (("soft", 0.003), "floor"),
    "floor, another material": (("heavy", 0.002), "floor"),
    "slope": (("heavy", 0.003), "slope"),
}
SLOPE_NORMAL = np.array([-0.6, 0.0, 0.8])
SLOPE_POINT = np.array([0.2, 0.0, 0.0])
SPEED = 1.0
CELL = 0.02


def impacts(steps: int, slide: float, contact: dict[str, Any], **more: Any) -> Scene:
    """PHASES impacts of each kind at normal speed 1 m/s and tangential speed `slide` [m/s].

    `friction` and the mapping `constants` stand for those of every pair; the rest changes the scene.
    """
    friction, given = more.pop("friction", None), more.pop("constants", {})
    if friction is not None:
        given = given | {"friction": friction}
    pairs = []
    for names, e, mu, *values in PAIRS:
        pair = {"materials": names, "restitution": e, "friction": mu}
        if "stiffness" in contact.get("normal", ""):
            scale = np.ones(4) if contact["normal"] == "hertz/stiffness" else ROOT * np.array([1, 1, 12, 12])
            pair |= dict(zip(("kn", "kt", "gamma_n", "gamma_t"), (scale * values).tolist(), strict=True))
        pairs.append(pair | given)
    rows: list[tuple[str, float, np.ndarray, np.ndarray]] = []
    for k, kind in enumerate(KINDS):
        (material, radius), other = KINDS[kind]
        for phase in range(PHASES):
            flight = (1.05 + 0.9 * phase / PHASES) * PERIOD / SNAPSHOTS
            across = np.array([0.0, 1.0, 0.0])
            if isinstance(other, str):
                normal = SLOPE_NORMAL if other == "slope" else np.array([0.0, 0.0, 1.0])
                column = np.array([0.0, 0.01 + CELL * phase, 0.0])
                at = column + np.array([0.01 + CELL * k, 0.0, 0.0])
                if other == "slope":
                    at = column + SLOPE_POINT + CELL * (k - 3) * np.array([0.8, 0.0, 0.6])
                velocity = slide * across - SPEED * normal
                rows.append((material, radius, at + radius * normal - flight * velocity, velocity))
            else:
                centre = np.array([0.01 + CELL * k, 0.01 + CELL * phase, 0.1])
                normal = np.array([0.8, 0.0, 0.6])
                half = 0.5 * (slide * across - SPEED * normal)
                rows.append((material, radius, centre + radius * normal - flight * half, half))
                rows.append((other[0], other[1], centre - other[1] * normal + flight * half, -half))
    names, radii, position, velocity = zip(*rows, strict=True)
    return Scene(**{
        "name": "impacts", "materials": MATERIALS, "pairs": pairs, "contact": contact,
        "particles": {"source": "explicit", "material": names, "radius": np.array(radii),
                      "position": np.array(position), "velocity": np.array(velocity)},
        "walls": [
            {"kind": "plane", "name": "floor", "material": "floor", "point": (0, 0, 0), "normal": (0, 0, 1)},
            {"kind": "plane", "name": "slope", "material": "slope", "point": SLOPE_POINT.tolist(),
             "normal": SLOPE_NORMAL.tolist()},
        ],
        "domain": {"lo": (-0.05, -0.05, -0.05), "hi": (0.4, 0.3, 0.3)},
        "time": {"step": PERIOD / steps, "duration": 1.7 * PERIOD},
        "output": {"trace_every": PERIOD / SNAPSHOTS},
        "solver": {"integrator": "path"}, "allow": ["time_step"],
        **more,
    })  # fmt: skip


def firsts() -> dict[str, tuple[np.ndarray, np.ndarray | str]]:
    """Rows of the first particles of each kind's impacts, and of the second or the name of the plane."""
    found, row = {}, 0
    for kind in KINDS:
        other = KINDS[kind][1]
        width = 1 if isinstance(other, str) else 2
        rows = row + width * np.arange(PHASES)
        found[kind] = (rows, other if isinstance(other, str) else rows + 1)
        row += width * PHASES
    return found


def exact(scene: Scene) -> dict[str, Exact]:
    """The exact motion of each kind's first impact; the others are the same, shifted in time."""
    return {
        kind: exact_impact(scene, int(rows[0]), others if isinstance(others, str) else int(others[0]))
        for kind, (rows, others) in firsts().items()
    }


def errors(scene: Scene, trace: dict[str, np.ndarray], truth: dict[str, Exact]) -> dict[str, float]:
    """Largest error of the relative position over snapshots and phases / peak overlap, by kind."""
    found = {}
    for kind, (rows, others) in firsts().items():
        worst, first = 0.0, truth[kind].touch
        base = trace["position"][0]
        for k, row in enumerate(rows):
            origin = 0.0 if isinstance(others, str) else trace["position"][:, others[k]]
            apart = trace["position"][:, row] - origin
            shift = first + 0.9 * k / PHASES * PERIOD / SNAPSHOTS  # of the touch of this phase
            wanted = truth[kind].motion(trace["time"] - shift)
            if isinstance(others, str):  # counted from the place of the first touch
                wanted = wanted - wanted[0] + base[row]
            worst = max(worst, float(np.linalg.norm(apart - wanted, axis=1).max()))
        found[kind] = worst / truth[kind].peak_overlap
    return found


def spin_errors(scene: Scene, trace: dict[str, np.ndarray], truth: dict[str, Exact]) -> dict[str, float]:
    """Largest error of a spin after the impact over phases and partners / SPEED / radius, by kind."""
    found = {}
    for kind, (rows, others) in firsts().items():
        partners = [rows] if isinstance(others, str) else [rows, others]
        found[kind] = max(
            float(
                np.abs(trace["angular_velocity"][-1, who] - spin).max() / SPEED * scene.state.radius[who[0]]
            )
            for who, spin in zip(partners, truth[kind].spins, strict=False)
        )
    return found


def orders(
    slide: float,
    contact: dict[str, Any],
    *,
    ladder: tuple[int, ...] = LADDER,
    integrator: str = "path",
    measure: Callable[..., dict[str, float]] = errors,
    **more: Any,
) -> dict[str, tuple[float, float]]:
    """Kind -> (observed order of the worst error over the ladder, the error at its finest rung)."""
    truth = exact(impacts(ladder[0], slide, contact, **more))
    found = []
    for steps in ladder:
        scene = impacts(steps, slide, contact, **more)
        trace = simulate(scene, integrator=integrator).trace
        assert trace is not None
        found.append(measure(scene, trace, truth))
    return {
        kind: (observed_order([1 / s for s in ladder], [f[kind] for f in found]), found[-1][kind])
        for kind in KINDS
    }
