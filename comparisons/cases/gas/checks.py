"""Checks that the cases of gases share: codes against each other, hard spheres, means over seeds."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from comparisons import kit
from comparisons.cases.gas import scenes as gases
from comparisons.metrics.trace import largest_difference

#: The engine of hard spheres: no contact time, no time step.
HARD = "event_driven"
#: Variant that the codes run from one start, compared step by step before rounding has grown.
EARLY = "early"


def early_checks() -> tuple[kit.PerPair, ...]:
    """Positions and velocities of two codes over the first steps; NaN where fewer than 20 spheres touched."""

    def measure(results: kit.Results, column: str, code: str, other: str) -> kit.Measured:
        ours, theirs = results[EARLY, code], results[EARLY, other]
        a, b = ours.trace[column], theirs.trace[column]
        weight = gases.MASS * np.array(ours.scene.gravity)
        pushed = np.linalg.norm(ours.trace["force"] - weight, axis=2) > 1e-9 * np.linalg.norm(weight)
        touched = int(pushed.any(axis=0).sum())
        if touched < 20:
            return kit.Measured(float("nan"), note=f"only {touched} spheres had a contact")
        scale = 1.0
        if column == "position":  # wrapped or not
            edge, scale = ours.scene.domain.hi[0], gases.DIAMETER
            b = b + edge * np.round((a - b) / edge)
        return kit.Measured(largest_difference(a, b, scale), note=f"{touched} spheres had a contact")

    return tuple(
        kit.per_pair(
            f"{name}, largest difference over the first milliseconds",
            lambda results, code, other, column=column: measure(results, column, code, other),
            tolerance=1e-9, half_step=True,
            reason="same law, same scheme: rounding, multiplied by (free path / radius) in each of the few"
            " collisions",
            catches="a pair missing in the neighbor list, a wrong image across a periodic side",
        )
        for name, column in (("position / diameter", "position"), ("velocity / rms velocity", "velocity"))
    )  # fmt: skip


def hard(
    name: str, measure: Callable[[kit.Results], kit.Found], tolerance: float, against: str, reason: str,
    catches: str, **fields: Any,
) -> kit.Check:  # fmt: skip
    """A check of the event-driven engine, by `build.check`."""
    fields = {"needs": (HARD,), "tolerance": tolerance, "against": against, "reason": reason} | fields
    return kit.check(name, measure, catches=catches, **fields)


def conserved(name: str, columns: tuple[str, ...] = ("kinetic_energy",), prefix: str = "") -> kit.Check:
    """Largest |energy/start - 1| of hard spheres over the variants of a prefix; energy: sum of columns."""

    def measure(results: kit.Results) -> dict[str, kit.Measured]:
        found = {}
        for label in results.labels(HARD, prefix=prefix):
            history = results[label, HARD].history
            energy = history[list(columns)].to_numpy().sum(axis=1)
            note = f"{history['collisions'].to_numpy()[-1]:.0f} collisions"
            found[label] = kit.Measured(float(np.abs(energy / energy[0] - 1).max()), note=note)
        return found

    return hard(
        name, measure, 1e-11, "conservation", "rounding",
        "a flight, collision or impact on a wall that adds or removes energy",
    )  # fmt: skip


def no_overlap(name: str = "largest overlap at a collision / diameter (event-driven)") -> kit.Check:
    """Hard particles collide at the distance of their radii."""
    return hard(
        name, lambda results: {label: float(run.notes["largest_overlap"]) for label, run in results.of(HARD)},
        1e-9, "hard particles", "rounding of positions after a flight",
        "a collision found late: cells, event tree or lazy invalidation",
    )  # fmt: skip


def collisions(results: kit.Results, label: str) -> np.ndarray:
    """Collisions of hard spheres with spheres since the start, at every row of the history."""
    table = results[label, HARD].history
    return (table["collisions"] - table["wall_collisions"]).to_numpy()
