"""Exact motion of particles through several impacts, one after the other, with free flight between them."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from comparisons.oracles.impact import COLUMNS, Impact, impact
from gpudem.scene import Scene

#: Times [s] -> the columns, each (times, 3).
Piece = Callable[[np.ndarray], dict[str, np.ndarray]]


@dataclasses.dataclass(frozen=True)
class Motion:
    """The motion of the rows that take part."""

    pieces: dict[int, list[tuple[float, Piece]]]
    """Row -> (begin [s], motion from then on), in order."""
    impacts: list[tuple[float, Impact]]
    """(time [s] that is 0 to it, impact), in order."""

    def at(self, row: int, times: np.ndarray) -> dict[str, np.ndarray]:
        """Position [m], velocity [m/s] and angular_velocity [rad/s] of a row, each (times, 3)."""
        pieces = self.pieces[row]
        place = np.searchsorted([begin for begin, _ in pieces], times, side="right") - 1
        found = {column: np.empty((len(times), 3)) for column in COLUMNS}
        for k, (_, piece) in enumerate(pieces):
            for column, values in piece(times[place == k]).items():
                found[column][place == k] = values
        return found


def motion(
    scene: Scene, meetings: Sequence[tuple[int, int | str]], images: Mapping[int, np.ndarray] | None = None
) -> Motion:
    """Solve the impacts (row, other row or name of a plane) in the order in which they happen.

    A contact with a plane ends where that is removed; nothing else may happen to a particle during a contact.
    `images`: row -> shift [m] of its position, to the image that meets the other across a periodic side.
    Raises ValueError where an impact is not one that `impact` can solve, or begins during another.
    """
    state, images = scene.state, images or {}
    rows = {row for i, other in meetings for row in (i, other) if isinstance(row, int)}
    pieces: dict[int, list[tuple[float, Piece]]] = {}
    for row in sorted(rows):
        start = {column: getattr(state, column)[row] for column in COLUMNS}
        start["position"] = start["position"] + images.get(row, np.zeros(3))
        pieces[row] = [(0.0, _flight(0.0, start))]
    found = Motion(pieces, [])
    for i, other in meetings:
        both = (i,) if isinstance(other, str) else (i, other)
        since = max(pieces[row][-1][0] for row in both)
        now = [found.at(row, np.array([since])) for row in both]
        solved = impact(scene, i, other, start={c: np.concatenate([of[c] for of in now]) for c in COLUMNS})
        removed = _removed(scene, other)
        if since + solved.touch >= removed:
            raise ValueError(f"{other} is removed before particle {i + 1} touches it")
        end = min(since + solved.end, removed)
        found.impacts.append((since, solved))
        for k, row in enumerate(both):
            pieces[row].append((since + solved.touch, _part(solved, since, k)))
            last = {column: values[0] for column, values in _part(solved, since, k)(np.array([end])).items()}
            pieces[row].append((end, _flight(end, last)))
    return found


def _removed(scene: Scene, other: int | str) -> float:
    """When [s] a plane is removed, in whole steps."""
    plane = next((p for p in scene.planes if p.name == other), None)
    if plane is None or plane.removed_at is None:
        return float("inf")
    return scene.steps(plane.removed_at) * scene.time.step


def _flight(since: float, state: dict[str, np.ndarray]) -> Piece:
    def at(times: np.ndarray) -> dict[str, np.ndarray]:
        moved = state["position"] + (times - since)[:, None] * state["velocity"]
        kept = {c: np.broadcast_to(state[c], (len(times), 3)) for c in ("velocity", "angular_velocity")}
        return {"position": moved, **kept}

    return at


def _part(solved: Impact, since: float, k: int) -> Piece:
    """The motion of the k-th body of an impact."""

    def at(times: np.ndarray) -> dict[str, np.ndarray]:
        if not len(times):
            return {column: np.empty((0, 3)) for column in COLUMNS}
        return {column: values[:, k] for column, values in solved.at(times - since).items()}

    return at
