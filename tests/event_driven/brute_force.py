"""Brute-force reference of the event loop: all pairs at every collision, no cells, no tree, O(N^2) an event.

Shares only `HardSphereProblem` with the event loop: predictions are the textbook roots over whole arrays.
"""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np

from gpudem.event_driven.problem import HardSphereProblem, SideWalls


@dataclasses.dataclass
class BruteForceHardSpheres:
    """Hard spheres at `time` [s]. `log`: (time, particle, partner) of each collision, a wall as -2 - side."""

    problem: HardSphereProblem

    def __post_init__(self) -> None:
        s = self.problem
        self.x, self.v, self.time = s.position.copy(), s.velocity.copy(), 0.0
        self.angular_velocity, self.inertia = s.angular_velocity.copy(), 2 / 5 * s.mass * s.radius**2
        self.last = np.full(len(s.radius), -np.inf)
        self.log: list[tuple[float, int, int]] = []
        self.work = self.dissipated = 0.0
        self.guarded = 0
        self._i, self._j = np.triu_indices(len(s.radius), 1)
        axes = [(-1.0, 0.0, 1.0) if p else (0.0,) for p in s.periodic]
        self._images = np.array(list(itertools.product(*axes))) * (s.hi - s.lo)

    def advance(self, t: float, collisions: int | None = None) -> None:
        """Simulate up to time t [s], or until the log has so many collisions."""
        for begin, end, walls in self.problem.segments:
            while begin <= self.time < min(end, t):
                after, i, j = self._next(walls)
                stop = min(end, t)
                if self.time + after > stop:
                    self._advance_all(stop - self.time)
                    self.time = stop
                    break
                self._advance_all(after)
                self.time += after
                self._hit_pair(i, j) if j >= 0 else self._hit_wall(i, -2 - j, walls)
                if collisions is not None and len(self.log) >= collisions:
                    return

    def closest(self) -> float:
        """Largest overlap of any pair now, in sums of radii; negative where none touches."""
        r = np.linalg.norm(self._separation()[:, None, :] + self._images, axis=2).min(axis=1)
        d = self.problem.radius[self._i] + self.problem.radius[self._j]
        return float(((d - r) / d).max())

    def energy(self) -> float:
        """Kinetic and potential energy [J]."""
        m, w = self.problem.mass, self.angular_velocity
        kinetic = 0.5 * m @ (self.v**2).sum(axis=1) + 0.5 * self.inertia @ (w**2).sum(axis=1)
        return float(kinetic - m @ (self.x @ self.problem.gravity))

    def _advance_all(self, dt: float) -> None:
        g = self.problem.gravity
        self.x += self.v * dt + g * (dt * dt / 2)
        self.v += g * dt

    def _separation(self) -> np.ndarray:
        r = self.x[self._i] - self.x[self._j]
        box = np.where(self.problem.periodic, self.problem.hi - self.problem.lo, 1.0)
        return np.where(self.problem.periodic, r - box * np.round(r / box), r)

    def _next(self, walls: SideWalls) -> tuple[float, int, int]:
        """(time to the next collision, particle, partner)."""
        s = self.problem
        best, particle, partner = np.inf, -1, -1
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
                best, particle, partner = float(t[k]), int(self._i[k]), int(self._j[k])
        for side in np.flatnonzero(walls.present).tolist():
            moves = walls.amplitude[side] > 0
            t = self._sawtooth_times(side, walls, best) if moves else self._wall_times(side, walls)
            k = int(np.argmin(t))
            if t[k] < best:
                best, particle, partner = float(t[k]), k, -2 - side
        return best, particle, partner

    def _wall_times(self, side: int, walls: SideWalls) -> np.ndarray:
        """The smallest root of h + w t + a t^2/2 = 0 at which the particle comes down."""
        s, sign = self.problem, 1 - 2 * (side % 2)
        h = (self.x[:, side // 2] - walls.position[side]) * sign - s.radius
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

    def _sawtooth_times(self, side: int, walls: SideWalls, until: float) -> np.ndarray:
        """Roots of h + w t + a t^2/2 = U (t - k T) within period k, period by period, up to the first hit."""
        s, sign = self.problem, 1 - 2 * (side % 2)
        h = (self.x[:, side // 2] - walls.position[side]) * sign - s.radius
        w, a = self.v[:, side // 2] * sign, s.gravity[side // 2] * sign
        speed, period = float(walls.speed[side]), float(walls.amplitude[side] / walls.speed[side])
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

    def _elastic(self, *partners: int) -> bool:
        return min(self.time - self.last[p] for p in partners) < self.problem.guard

    def _hit_wall(self, i: int, side: int, walls: SideWalls) -> None:
        s, normal = self.problem, np.zeros(3)
        normal[side // 2] = 1 - 2 * (side % 2)
        e, mu = float(walls.restitution[side, s.material[i]]), float(walls.friction[side, s.material[i]])
        motion = float(walls.speed[side]) * normal
        before = self._kinetic_energy(i)
        impulse = self._impulse(e, mu, normal, motion, i)
        self.work += float(impulse @ motion)
        self.dissipated += float(impulse @ motion) - (self._kinetic_energy(i) - before)
        self.log.append((self.time, i, -2 - side))

    def _hit_pair(self, i: int, j: int) -> None:
        s = self.problem
        e, mu = (float(a[s.material[i], s.material[j]]) for a in (s.restitution, s.friction))
        k = int(np.flatnonzero((self._i == i) & (self._j == j))[0])
        r = self._separation()[k]
        before = self._kinetic_energy(i, j)
        self._impulse(e, mu, r / np.linalg.norm(r), np.zeros(3), i, j)
        self.dissipated += before - self._kinetic_energy(i, j)
        self.log.append((self.time, i, j))

    def _kinetic_energy(self, *particles: int) -> float:
        """Kinetic and rotational energy [J] of some particles."""
        m, k = self.problem.mass, list(particles)
        return float(
            0.5 * m[k] @ (self.v[k] ** 2).sum(axis=1)
            + 0.5 * self.inertia[k] @ (self.angular_velocity[k] ** 2).sum(axis=1)
        )

    def _impulse(
        self, e: float, mu: float, normal: np.ndarray, motion: np.ndarray, i: int, j: int | None = None
    ) -> np.ndarray:
        """Impulse [N s] on i: what makes the velocity of the point of contact what the rule says.

        The change by an impulse is a matrix at that point: 1/m + (R n) x ( . ) x (R n) / I of each partner.
        """
        s, partners = self.problem, [i] if j is None else [i, j]
        elastic = self._elastic(*partners)
        self.guarded += elastic and (e != 1 or s.rough)
        velocity, response = -motion.astype(float), np.zeros((3, 3))
        for p, sign in zip(partners, (1.0, -1.0), strict=False):
            arm = -sign * s.radius[p] * normal
            velocity += sign * (self.v[p] + np.cross(self.angular_velocity[p], arm))
            across = arm @ arm * np.eye(3) - np.outer(arm, arm)
            response += np.eye(3) / s.mass[p] + across / self.inertia[p]
        along = velocity @ normal * normal
        push = np.linalg.solve(response, -(1 + (1.0 if elastic else e)) * along)
        total = push
        if s.rough and not elastic:
            tangential = np.linalg.solve(response, -(1 + s.tangential_restitution) * (velocity - along))
            size = float(np.linalg.norm(tangential))
            limit = mu * float(np.linalg.norm(push))
            total = push + (tangential if size <= limit else tangential * limit / size)
        for p, sign in zip(partners, (1.0, -1.0), strict=False):
            arm = -sign * s.radius[p] * normal
            self.v[p] += sign * total / s.mass[p]
            self.angular_velocity[p] += np.cross(arm, sign * total) / self.inertia[p]
            self.last[p] = self.time
        return total
