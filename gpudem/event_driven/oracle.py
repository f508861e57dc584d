"""The slow way, for tests: all pairs at every collision, one clock, no cells, no tree. O(N^2) an event.

Shares no code with the event loop but the statement: predictions are the textbook roots over whole arrays.
"""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np

from gpudem.event_driven.statement import Statement, Walls


@dataclasses.dataclass
class Slow:
    """Hard spheres at `time`; `log` holds (time, i, partner) of every collision, a wall as -2 - its side."""

    statement: Statement

    def __post_init__(self) -> None:
        s = self.statement
        self.x, self.v, self.time = s.position.copy(), s.velocity.copy(), 0.0
        self.last = np.full(len(s.radius), -np.inf)
        self.log: list[tuple[float, int, int]] = []
        self.work = self.dissipated = 0.0
        self.guarded = 0
        self._i, self._j = np.triu_indices(len(s.radius), 1)
        axes = [(-1.0, 0.0, 1.0) if p else (0.0,) for p in s.periodic]
        self._images = np.array(list(itertools.product(*axes))) * (s.hi - s.lo)

    def advance(self, t: float, collisions: int | None = None) -> None:
        """Go on to time t [s], or until the log has so many collisions."""
        for begin, end, walls in self.statement.segments:
            while begin <= self.time < min(end, t):
                after, i, j = self._next(walls)
                stop = min(end, t)
                if self.time + after > stop:
                    self._fly(stop - self.time)
                    self.time = stop
                    break
                self._fly(after)
                self.time += after
                self._hit_pair(i, j) if j >= 0 else self._hit_wall(i, -2 - j, walls)
                if collisions is not None and len(self.log) >= collisions:
                    return

    def closest(self) -> float:
        """Largest overlap of any pair now, in sums of radii; negative where none touches."""
        r = np.linalg.norm(self._separation()[:, None, :] + self._images, axis=2).min(axis=1)
        d = self.statement.radius[self._i] + self.statement.radius[self._j]
        return float(((d - r) / d).max())

    def energy(self) -> float:
        """Kinetic and potential energy [J]."""
        m = self.statement.mass
        return float(0.5 * m @ (self.v * self.v).sum(axis=1) - m @ (self.x @ self.statement.gravity))

    def _fly(self, dt: float) -> None:
        g = self.statement.gravity
        self.x += self.v * dt + g * (dt * dt / 2)
        self.v += g * dt

    def _separation(self) -> np.ndarray:
        r = self.x[self._i] - self.x[self._j]
        box = np.where(self.statement.periodic, self.statement.hi - self.statement.lo, 1.0)
        return np.where(self.statement.periodic, r - box * np.round(r / box), r)

    def _next(self, walls: Walls) -> tuple[float, int, int]:
        """(time to the next collision, particle, partner)."""
        s = self.statement
        best, who, partner = np.inf, -1, -1
        r = self._separation()
        u = self.v[self._i] - self.v[self._j]
        d = s.radius[self._i] + s.radius[self._j]
        uu = (u * u).sum(axis=1)
        for image in self._images:
            at = r + image
            b, c = (at * u).sum(axis=1), (at * at).sum(axis=1) - d * d
            q = b * b - uu * c
            with np.errstate(divide="ignore", invalid="ignore"):
                t = np.where((b < 0) & (q > 0), np.maximum(c, 0) / (np.sqrt(np.maximum(q, 0)) - b), np.inf)
            k = int(np.argmin(t)) if len(t) else -1
            if k >= 0 and t[k] < best:
                best, who, partner = float(t[k]), int(self._i[k]), int(self._j[k])
        for side in np.flatnonzero(walls.present).tolist():
            moves = walls.stroke[side] > 0
            t = self._saw_times(side, walls, best) if moves else self._wall_times(side, walls)
            k = int(np.argmin(t))
            if t[k] < best:
                best, who, partner = float(t[k]), k, -2 - side
        return best, who, partner

    def _wall_times(self, side: int, walls: Walls) -> np.ndarray:
        """The smallest root of h + w t + a t^2/2 = 0 at which the particle comes down, by np.roots."""
        s, sign = self.statement, 1 - 2 * (side % 2)
        h = (self.x[:, side // 2] - walls.at[side]) * sign - s.radius
        w, a = self.v[:, side // 2] * sign, s.gravity[side // 2] * sign
        times = np.full(len(h), np.inf)
        for i in range(len(h)):
            if h[i] <= 1e-15 and w[i] < 0:
                times[i] = 0.0
                continue
            if a == 0:
                times[i] = h[i] / -w[i] if w[i] < 0 else np.inf
                continue
            q = w[i] * w[i] - 2 * a * h[i]
            if q < 0:
                continue
            roots = [(-w[i] + z * np.sqrt(q)) / a for z in (-1, 1)]
            down = [t for t in roots if t >= 0 and w[i] + a * t < 0]
            times[i] = min(down, default=np.inf)
        return times

    def _saw_times(self, side: int, walls: Walls, until: float) -> np.ndarray:
        """Roots of h + w t + a t^2/2 = U (t - k T) within tooth k: tooth after tooth, to the first hit."""
        s, sign = self.statement, 1 - 2 * (side % 2)
        h = (self.x[:, side // 2] - walls.at[side]) * sign - s.radius
        w, a = self.v[:, side // 2] * sign, s.gravity[side // 2] * sign
        speed, period = float(walls.speed[side]), float(walls.stroke[side] / walls.speed[side])
        k, times = np.floor(self.time / period), np.full(len(h), np.inf)
        until = min(until, s.segments[-1][1] - self.time)
        while k * period - self.time <= until and not np.isfinite(times).any():
            begin, end = max(k * period - self.time, 0.0), (k + 1) * period - self.time
            gap = h + w * begin + a * begin**2 / 2 - speed * (self.time + begin - k * period)
            slow, length = w + a * begin - speed, end - begin
            q = slow * slow - 2 * a * gap
            with np.errstate(divide="ignore", invalid="ignore"):
                roots = [(-slow + z * np.sqrt(q)) / a for z in (-1, 1)] if a else [-gap / slow] * 2
                down = [np.where((t >= 0) & (slow + a * t < 0), t, np.inf) for t in roots]
            first = np.where((gap <= 1e-15) & (slow < 0), 0.0, np.minimum(*down))
            times = np.where((first <= length) & (length > 0), begin + first, np.inf)
            k += 1
        return times

    def _restitution(self, e: float, *partners: int) -> float:
        if min(self.time - self.last[p] for p in partners) < self.statement.guard:
            self.guarded += e != 1
            return 1.0
        return e

    def _hit_wall(self, i: int, side: int, walls: Walls) -> None:
        s, axis, sign = self.statement, side // 2, 1 - 2 * (side % 2)
        e = self._restitution(float(walls.restitution[side, s.material[i]]), i)
        speed, w = float(walls.speed[side]), float(self.v[i, axis] * sign)
        after = (1 + e) * speed - e * w
        self.v[i, axis] = sign * after
        work = s.mass[i] * (after - w) * speed
        self.work += work
        self.dissipated += work - 0.5 * s.mass[i] * (after * after - w * w)
        self.last[i] = self.time
        self.log.append((self.time, i, -2 - side))

    def _hit_pair(self, i: int, j: int) -> None:
        s = self.statement
        e = self._restitution(float(s.restitution[s.material[i], s.material[j]]), i, j)
        k = int(np.flatnonzero((self._i == i) & (self._j == j))[0])
        r = self._separation()[k]
        n = r / np.linalg.norm(r)
        m = s.mass[i] * s.mass[j] / (s.mass[i] + s.mass[j])
        w = float(n @ (self.v[i] - self.v[j]))
        impulse = -(1 + e) * m * w
        before = s.mass[i] * self.v[i] @ self.v[i] + s.mass[j] * self.v[j] @ self.v[j]
        self.v[i] += impulse / s.mass[i] * n
        self.v[j] -= impulse / s.mass[j] * n
        self.dissipated += 0.5 * float(
            before - s.mass[i] * self.v[i] @ self.v[i] - s.mass[j] * self.v[j] @ self.v[j]
        )
        self.last[i] = self.last[j] = self.time
        self.log.append((self.time, i, j))
