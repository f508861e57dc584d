"""The place and velocity of a moving wall at every step, composed of its motions.

Several motions act together in the order given, as in LIGGGHTS: a translation carries along the points of the
turns that stand after it; a turn whose point no translation carries turns the wall, already moved, about a
point at rest in space. At every time the velocity of a point of the wall at q is the sum of theirs,
V + w x (q - p) with p the point of a turn where it then is.

No Warp here: poses are computed on the host in float64, block by block.
"""

from __future__ import annotations

import bisect
import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from gpudem.scene.motion import Servo, Swing, Translation, Turn, rotations

#: Steps whose poses are computed at once.
BLOCK = 256
#: Blocks that are kept.
KEPT = 4


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
        return Poses(
            self.rotation[begin:end], self.shift[begin:end],
            self.velocity[begin:end], self.spin[begin:end], self.center[begin:end],
        )  # fmt: skip

    def place_of(self, point: np.ndarray) -> np.ndarray:
        """Where the wall's point that is at `point` [m] at the start is in each step [m], shape (k, 3)."""
        return self.rotation @ point + self.shift

    def velocity_at(self, q: np.ndarray) -> np.ndarray:
        """Velocity [m/s] of the wall's points at q [m] in space, shape (k, 3)."""
        return self.velocity + np.cross(self.spin, q - self.center)


def joined(found: Sequence[Poses]) -> Poses:
    """Poses one after the other."""
    return Poses(*(np.concatenate([getattr(p, f.name) for p in found]) for f in dataclasses.fields(Poses)))


@dataclasses.dataclass
class _End:
    """What a block hands to the next: what its last step has summed up."""

    sums: list[np.ndarray]
    """Displacement [m] or angle [rad] of each motion."""
    pose: np.ndarray
    """Of motions composed step by step, (4, 4): rotation and shift."""


class WallPath:
    """Poses of one wall at steps of dt [s].

    sums: LIGGGHTS' places. Those of all motions but `linear` and `rotate` are right-hand sums
    x_n = x_(n-1) + v_n dt; in a step the motions act one after the other, whole, and a turn's velocity is
    about its point as moved by the translations that come after it in the step; the point of a `swing` stays
    where it is, whatever translations come before; in the set-up at step 0 the wall has no velocity.
    Else: closed forms, true velocities, at the start too. Only a turn with a motion after it has none: each
    step composes the exact half steps of the motions in their order, then in the reverse order, an error of
    second order in dt.

    Sums and composed steps are computed from the start on, block by block: a restart at step n costs n steps
    of them, microseconds each, and gives the same bits.
    """

    def __init__(self, motions: Sequence[Translation | Turn], dt: float, sums: bool = False):
        self.motions, self.dt, self.sums = motions, dt, sums
        self._blocks: dict[int, Poses] = {}
        turns = [k for k, motion in enumerate(motions) if motion.turns]
        self._stays = [sums and isinstance(motion, Swing) for motion in motions]
        self.closed = not turns or (
            turns == [len(motions) - 1] and not (self._stays[-1] and len(motions) > 1)
        )
        start = [np.zeros(()) if motion.turns else np.zeros(3) for motion in motions]
        self._ends = {0: _End(start, np.eye(4))}
        self._from_sums = [sums and not motion.exact for motion in motions]

    def at(self, first: int, count: int) -> Poses:
        """Poses in the steps first .. first + count - 1; step 0 is the start."""
        blocks = range(first // BLOCK, (first + count - 1) // BLOCK + 1)
        found = [self._block(b) for b in blocks]
        begin = first - blocks[0] * BLOCK
        if len(found) == 1:
            return found[0].part(begin, begin + count)
        return joined(found).part(begin, begin + count)

    def _block(self, b: int) -> Poses:
        if b not in self._blocks:
            before = b if self.closed and not any(self._from_sums) else max(k for k in self._ends if k <= b)
            for earlier in range(before, b):
                self._compute(earlier)
            self._blocks[b] = self._compute(b)
            for old in list(self._blocks)[:-KEPT]:  # those computed first
                del self._blocks[old]
        return self._blocks[b]

    def _compute(self, b: int) -> Poses:
        steps = np.arange(b * BLOCK, (b + 1) * BLOCK)
        rates = [motion.rate(steps * self.dt) for motion in self.motions]
        end = self._ends.get(b)
        ways = [self._way(m, b, steps, rates[m], end) for m in range(len(self.motions))]
        if self.closed:
            poses, last = self._closed_poses(ways, rates), np.eye(4)
        else:
            assert end is not None
            poses, last = self._composed_poses(b, steps, ways, rates, end)
        if end is not None:
            self._ends.pop(b + 1, None)
            self._ends[b + 1] = _End([way[-1] for way in ways], last)
            for old in list(self._ends)[1:-KEPT]:  # the first is the start
                del self._ends[old]
        if b == 0 and self.sums:  # mutate: no_velocity_in_set_up
            poses.velocity[0], poses.spin[0] = 0.0, 0.0
        return poses

    def _way(self, m: int, b: int, steps: np.ndarray, rate: np.ndarray, end: _End | None) -> np.ndarray:
        """Displacement or angle of motion m since the start in a block's steps."""
        if not self._from_sums[m]:
            return self.motions[m].way(steps * self.dt)
        assert end is not None
        increments = rate * self.dt  # mutate: right_hand_sum
        if b == 0:
            increments[0] = 0.0
        return np.cumsum(np.concatenate([end.sums[m][None], increments]), axis=0)[1:]

    def _closed_poses(self, ways: list[np.ndarray], rates: list[np.ndarray]) -> Poses:
        """Translations, then at most one turn."""
        shift, velocity = np.zeros((BLOCK, 3)), np.zeros((BLOCK, 3))
        rotation = np.broadcast_to(np.eye(3), (BLOCK, 3, 3))
        spin, center = np.zeros((BLOCK, 3)), np.zeros((BLOCK, 3))
        for motion, way, rate in zip(self.motions, ways, rates, strict=True):
            if isinstance(motion, Turn):
                rotation = rotations(motion.unit_axis, way)
                spin = rate[:, None] * motion.unit_axis
                point = np.array(motion.point)
                center = point + shift  # mutate: point_carried_along
                shift = center - rotation @ point
            else:
                shift, velocity = shift + way, velocity + rate  # mutate: velocity_of_translation
        return Poses(rotation, shift, velocity, spin, center)

    # -- composed step by step -----------------------------------------------------------------------------

    def _composed_poses(
        self, b: int, steps: np.ndarray, ways: list[np.ndarray], rates: list[np.ndarray], end: _End
    ) -> tuple[Poses, np.ndarray]:
        """(poses, the last one as a matrix): each step's move, applied to the pose of the step before."""
        before = [np.concatenate([e[None], w[:-1]]) for e, w in zip(end.sums, ways, strict=True)]
        if self.sums:
            moves = self._moves(before, ways, ways, range(len(ways)))
        else:
            middle = [motion.way((steps - 0.5) * self.dt) for motion in self.motions]
            first = self._moves(before, middle, middle, range(len(ways)))
            moves = (
                self._moves(middle, ways, middle, reversed(range(len(ways)))) @ first
            )  # mutate: half_moves
        if b == 0:
            moves[0] = np.eye(4)
        step = 1
        while step < BLOCK:  # products of 2, 4, 8 ... moves
            moves[step:] = moves[step:] @ moves[:-step]
            step *= 2
        found = moves @ end.pose
        last = found[-1].copy()  # rounding must not grow into a stretch
        last[:3, :3] = last[:3, :3] @ (3 * np.eye(3) - last[:3, :3].T @ last[:3, :3]) / 2
        found[-1] = last
        velocity, spin, center = self._velocities(before, ways, rates)
        return Poses(found[:, :3, :3].copy(), found[:, :3, 3].copy(), velocity, spin, center), last

    def _moves(
        self, begin: list[np.ndarray], end: list[np.ndarray], carried: list[np.ndarray], order
    ) -> np.ndarray:
        """Matrices (k, 4, 4) that take a wall through the motions' ways from `begin` to `end`, one by one.

        carried: the displacements that have carried the points of turns along.
        """
        moves = np.broadcast_to(np.eye(4), (BLOCK, 4, 4))
        for m in order:
            motion, own = self.motions[m], np.tile(np.eye(4), (BLOCK, 1, 1))
            if isinstance(motion, Turn):
                turn, point = rotations(motion.unit_axis, end[m] - begin[m]), self._point(m, carried)
                own[:, :3, :3] = turn
                own[:, :3, 3] = point - np.einsum("kij,kj->ki", turn, point)
            else:
                own[:, :3, 3] = end[m] - begin[m]
            moves = own @ moves  # mutate: order_of_motions
        return moves

    def _point(self, m: int, ways: list[np.ndarray]) -> np.ndarray:
        """The point of turn m where the translations before it have carried it [m], shape (k, 3)."""
        point = np.tile(np.array(self.motions[m].point), (BLOCK, 1))  # type: ignore[union-attr]
        if self._stays[m]:
            return point  # mutate: point_of_swing_stays
        return point + sum(ways[j] for j in range(m) if not self.motions[j].turns)

    def _velocities(
        self, before: list[np.ndarray], ways: list[np.ndarray], rates: list[np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(velocity, spin, center) of each step: every turn about its own point, all in the frame of one."""
        velocity, spin, center = np.zeros((BLOCK, 3)), np.zeros((BLOCK, 3)), None
        for m, motion in enumerate(self.motions):
            if not isinstance(motion, Turn):
                velocity = velocity + rates[m]
                continue
            own, at = rates[m][:, None] * motion.unit_axis, self._point(m, ways)
            if self.sums:  # LIGGGHTS turns first, and then moves what has turned
                after = [j for j in range(m + 1, len(ways)) if not self.motions[j].turns]
                at = at + sum(ways[j] - before[j] for j in after)  # mutate: center_moved_after_turn
            center = at if center is None else center
            velocity, spin = velocity + np.cross(own, center - at), spin + own
        assert center is not None
        return velocity, spin, center


class PhasedPath:
    """Poses of a wall whose motions change at stated steps: each begins where the one before has brought it.

    A part is a `WallPath` whose step 0 is its first one. What is at X at the start of the run is, in a part
    that begins at the pose (R, s), at rotation (R X + s) + shift, with rotation and shift those of the part.

    Args:
        parts: (first step, motions), steps ascending from 0; no motions: at rest.
        dt: Time step [s].
        sums: As in `WallPath`; the velocity is 0 in the set-up of each part too.
        follow: Parts with a servo are a `ServoPath` each; otherwise the wall rests in them.
    """

    def __init__(
        self,
        parts: Sequence[tuple[int, Sequence[Translation | Turn]]],
        dt: float,
        sums: bool = False,
        follow: bool = False,
    ):
        self.starts = [step for step, _ in parts]
        self.paths: list[WallPath | ServoPath] = [
            ServoPath(motions[0], dt, sums)
            if follow and motions and isinstance(motions[0], Servo)
            else WallPath(motions, dt, sums)
            for _, motions in parts
        ]
        self._begins = [(np.eye(3), np.zeros(3))]

    @staticmethod
    def of(
        parts: Sequence[tuple[int, Sequence[Translation | Turn]]], dt: float, sums: bool = False
    ) -> WallPath | PhasedPath:
        """The path of these parts: of one part that of its motions."""
        return WallPath(parts[0][1], dt, sums) if len(parts) == 1 else PhasedPath(parts, dt, sums)

    def at(self, first: int, count: int) -> Poses:
        """Poses in the steps first .. first + count - 1; in the first of a part those of the one before."""
        ends = [*(step + 1 for step in self.starts[1:]), first + count]
        found, begin = [], first
        for k, end in enumerate(ends):
            if begin < min(end, first + count):
                end = min(end, first + count)
                found.append(self._part(k, begin, end - begin))
                begin = end
        if len(found) == 1:
            return found[0]
        return joined(found)

    def in_set_up(self, step: int) -> Poses:
        """The pose in a set-up at this step; in the first one of a part with the velocity of its start."""
        k = bisect.bisect_right(self.starts, step) - 1
        return self._part(k, step, 1)

    def _part(self, k: int, first: int, count: int) -> Poses:
        """Poses in some steps of part k."""
        path = self.paths[k]
        begin = 0 if isinstance(path, ServoPath) else self.starts[k]  # a servo counts the steps of the run
        poses = path.at(first - begin, count)  # mutate: time_of_part
        if k == 0:
            return poses
        turned, moved = self._begin(k)
        return dataclasses.replace(
            poses,
            rotation=poses.rotation @ turned,
            shift=poses.rotation @ moved + poses.shift,  # mutate: place_where_part_begins
        )

    def _begin(self, k: int) -> tuple[np.ndarray, np.ndarray]:
        """The pose at which part k begins; after a servo it is known once that has ended, and not kept."""
        while len(self._begins) <= k:
            last = len(self._begins) - 1
            if isinstance(self.paths[last], ServoPath):
                return self._end(k - 1)
            self._begins.append(self._end(last))
        return self._begins[k]

    def _end(self, k: int) -> tuple[np.ndarray, np.ndarray]:
        """The pose at which part k ends."""
        pose = self._part(k, self.starts[k + 1], 1)
        return pose.rotation[0].copy(), pose.shift[0].copy()

    @property
    def servos(self) -> list[tuple[int, float, ServoPath]]:
        """The parts that follow a force: the steps at which each begins and ends, and its path."""
        ends = [*self.starts[1:], math.inf]
        parts = zip(self.starts, ends, self.paths, strict=True)
        return [(begin, end, path) for begin, end, path in parts if isinstance(path, ServoPath)]


#: The rotation of a wall that does not turn, shape (1, 3, 3).
_UPRIGHT = np.eye(3)[None]


class ServoPath:
    """Poses of a wall that follows the force on it: known for the last step done and the one to come.

    liggghts: as in LIGGGHTS, a controller with an integral that is at its limit, clip(u) = s with s = 1 or
    -1, resets the integral to (-s - kp e)/ki: the next steps go the other way; and the set-up after a wall
    has come or gone has the velocity of the step to come. Source: runs of 3.8.0.
    """

    def __init__(self, servo: Servo, dt: float, liggghts: bool = False):
        self.servo, self.dt, self.liggghts = servo, dt, liggghts
        self._axis = servo.unit_axis
        #: Of the last step done and of the next one: step, way [m] along the axis, velocity [m/s]; then the
        #: sum of e dt [s] and the last e, at first that without a force.
        self.state = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])  # mutate: first_error_of_servo
        #: Of the step for which the list was made: step, way [m].
        self.listed = np.array([-1.0, 0.0])

    def at(self, first: int, count: int) -> Poses:
        """Poses in the steps first .. first + count - 1, of which only those known are told apart."""
        done, way, speed, next_way, next_speed, *_ = self.state.tolist()
        listed, way_listed = self.listed.tolist()
        known = done - int(self.liggghts)  # mutate: servo_in_set_up
        ways, speeds = np.empty((count, 1)), np.empty((count, 1))
        for k, step in enumerate(range(first, first + count)):  # one, step by step: arrays cost more
            ways[k] = way_listed if step == listed else way if step <= done else next_way
            speeds[k] = speed if step <= known else next_speed
        zero = np.zeros((count, 3))
        return Poses(_UPRIGHT if count == 1 else np.tile(_UPRIGHT, (count, 1, 1)), ways * self._axis,
                     speeds * self._axis, zero, zero)  # fmt: skip

    def list_made(self, step: int) -> None:
        """Keep the place in the step for which a list was made, also when later steps are done."""
        self.listed[:] = step, self.at(step, 1).shift[0] @ self._axis

    def advance(self, step: int, force: np.ndarray) -> None:
        """Step `step` is done, with this force on the wall [N]: the velocity of the next one."""
        servo, (_, _, _, way, speed, total, last) = self.servo, self.state.tolist()
        error = 1 + float(force @ self._axis) / servo.target
        total += error * self.dt
        wanted = servo.kp * error + servo.ki * total + servo.kd * (error - last) / self.dt
        if self.liggghts and servo.ki > 0 and abs(wanted) > 1:
            total = (-math.copysign(1.0, wanted) - servo.kp * error) / servo.ki  # mutate: servo_reset
        next_speed = servo.velocity_limit * min(1.0, max(-1.0, wanted))  # mutate: servo_velocity
        self.state[:] = [step, way, speed, way + next_speed * self.dt, next_speed, total, error]
