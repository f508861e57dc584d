"""The place and velocity of a moving wall at every step, composed of its motions.

Several motions act together in the order given, as in LIGGGHTS: a translation carries along the points of the
turns that stand after it; a turn whose point no translation carries turns the wall, already moved, about a
point at rest in space.

No Warp here: poses are computed on the host in float64, block by block.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from gpudem.scene.motion import Translation, Turn, rotations

#: Steps whose poses are computed at once.
BLOCK = 256


@dataclasses.dataclass(frozen=True)
class Poses:
    """A wall in k consecutive steps: what is at X at the start is at rotation X + shift.

    Its velocity at q is velocity + spin x (q - center).
    """

    rotation: np.ndarray
    """(k, 3, 3)."""
    shift: np.ndarray
    """[m], (k, 3)."""
    velocity: np.ndarray
    """[m/s], (k, 3)."""
    spin: np.ndarray
    """[rad/s], (k, 3)."""
    center: np.ndarray
    """[m], (k, 3)."""

    def part(self, begin: int, end: int) -> Poses:
        """Some of the steps."""
        return Poses(*(getattr(self, field.name)[begin:end] for field in dataclasses.fields(self)))


class WallPath:
    """Poses of one wall at steps of dt [s].

    sums: positions are right-hand sums x_n = x_(n-1) + v_n dt of the velocities, as LIGGGHTS computes those
    of all motions but `linear` and `rotate`; else closed forms. A turn before a translation has no closed
    form: each step's exact increments are then composed.
    """

    def __init__(self, motions: Sequence[Translation | Turn], dt: float, sums: bool = False):
        self.motions, self.dt, self.sums = motions, dt, sums
        self._blocks: dict[int, Poses] = {}
        self._ends: dict[int, tuple[np.ndarray, np.ndarray, list[np.ndarray]]] = {}
        turns = [k for k, motion in enumerate(motions) if motion.turns]
        self.closed = not sums and (not turns or turns == [len(motions) - 1])

    def at(self, first: int, count: int) -> Poses:
        """Poses in the steps first .. first + count - 1; step 0 is the start."""
        blocks = range(first // BLOCK, (first + count - 1) // BLOCK + 1)
        found = [self._block(b) for b in blocks]
        begin = first - blocks[0] * BLOCK
        if len(found) == 1:
            return found[0].part(begin, begin + count)
        joined = (np.concatenate([getattr(p, f.name) for p in found]) for f in dataclasses.fields(Poses))
        return Poses(*joined).part(begin, begin + count)

    def _block(self, b: int) -> Poses:
        if b not in self._blocks:
            poses = self._closed_block(b) if self.closed else self._summed_block(b)
            for old in sorted(self._blocks)[: len(self._blocks) - 3]:
                del self._blocks[old]
            self._blocks[b] = poses
        return self._blocks[b]

    def _closed_block(self, b: int) -> Poses:
        time = np.arange(b * BLOCK, (b + 1) * BLOCK) * self.dt
        shift, velocity = np.zeros((BLOCK, 3)), np.zeros((BLOCK, 3))
        rotation = np.broadcast_to(np.eye(3), (BLOCK, 3, 3))
        spin, center = np.zeros((BLOCK, 3)), np.zeros((BLOCK, 3))
        for motion in self.motions:
            if isinstance(motion, Translation):
                shift, velocity = shift + motion.way(time), velocity + motion.rate(time)
            else:
                rotation = rotations(motion.unit_axis, motion.way(time))
                spin = motion.rate(time)[:, None] * motion.unit_axis
                point = np.array(motion.point)
                center = point + shift
                shift = center - rotation @ point
        return Poses(rotation, shift, velocity, spin, center)

    def _summed_block(self, b: int) -> Poses:
        """Poses composed step by step, from the end of the block before."""
        start = self._end_of(b)
        rotation, shift, points = start[0].copy(), start[1].copy(), [p.copy() for p in start[2]]
        steps = np.arange(b * BLOCK, (b + 1) * BLOCK)
        rates = [motion.rate(steps * self.dt) for motion in self.motions]
        ways = [self._increments(motion, steps) for motion in self.motions]
        rows = []
        for k, step in enumerate(steps):
            centers: dict[int, np.ndarray] = {}
            for m, motion in enumerate(self.motions if step else ()):
                if isinstance(motion, Translation):
                    shift = shift + ways[m][k]
                    points[m + 1 :] = [p + ways[m][k] for p in points[m + 1 :]]
                    centers = {j: c + ways[m][k] for j, c in centers.items()}
                else:
                    turn = rotations(motion.unit_axis, ways[m][k : k + 1])[0]
                    rotation, shift = turn @ rotation, points[m] + turn @ (shift - points[m])
                    centers[m] = points[m]
            rows.append((rotation, shift, *self._velocity(rates, k, centers, points)))
        self._ends[b + 1] = (rotation, shift, points)
        return Poses(*(np.array(column) for column in zip(*rows, strict=True)))

    def _increments(self, motion: Translation | Turn, steps: np.ndarray) -> np.ndarray:
        """The way of each step since the step before."""
        if self.sums:
            return motion.rate(steps * self.dt) * self.dt
        return motion.way(steps * self.dt) - motion.way((steps - 1) * self.dt)

    def _velocity(
        self, rates: list[np.ndarray], k: int, centers: dict[int, np.ndarray], points: list[np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(velocity, spin, center) of step k of a block: every turn about its own point."""
        velocity, spin, center = np.zeros(3), np.zeros(3), None
        for m, motion in enumerate(self.motions):
            if isinstance(motion, Translation):
                velocity = velocity + rates[m][k]
                continue
            own, at = rates[m][k] * motion.unit_axis, centers.get(m, points[m])
            center = at if center is None else center
            velocity, spin = velocity + np.cross(own, center - at), spin + own
        return velocity, spin, np.zeros(3) if center is None else center

    def _end_of(self, b: int) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
        """(rotation, shift, points of the turns) after the last step before block b."""
        if b == 0:
            points = [np.array(getattr(motion, "point", (0.0, 0.0, 0.0))) for motion in self.motions]
            return np.eye(3), np.zeros(3), points
        known = max((k for k in self._ends if k <= b), default=0)
        for earlier in range(known, b):
            self._summed_block(earlier)
        return self._ends[b]
