"""A column of equal spheres on a floor: at rest under its weight, and elastic waves that run through it."""

from __future__ import annotations

import dataclasses

import numpy as np

from comparisons.oracles.bodies import Bodies


@dataclasses.dataclass(frozen=True)
class Chain:
    """Spheres 0 .. count - 1 from the floor up, no damping; F = k overlap^1.5 (Hertz 1882)."""

    count: int
    floor: Bodies
    pair: Bodies
    gravity: float

    @property
    def load(self) -> np.ndarray:
        """(count,) load [N] of the contact below each sphere: the weight of it and of all above."""
        return self.floor.mass[0] * self.gravity * np.arange(self.count, 0, -1)

    @property
    def constant(self) -> np.ndarray:
        """(count,) k [N/m^1.5] of the contact below each sphere."""
        return np.where(np.arange(self.count) == 0, self.floor.normal_constant, self.pair.normal_constant)

    @property
    def overlap(self) -> np.ndarray:
        """(count,) overlap [m] at rest of the contact below each sphere: (load/k)^(2/3)."""
        return (self.load / self.constant) ** (2 / 3)

    @property
    def height(self) -> np.ndarray:
        """(count,) heights [m] of the centres at rest."""
        radius = self.floor.radius[0]
        return np.cumsum(np.where(np.arange(self.count) == 0, radius, 2 * radius) - self.overlap)

    def motion(self, velocity: np.ndarray, time: float) -> tuple[np.ndarray, np.ndarray]:
        """(displacement from rest [m], velocity [m/s]), each (count,), after a time [s] from rest with given
        velocities [m/s]: DOP853, rtol 1e-10.

        Displacements are the unknowns: the heights of a tall column would round them away.
        """
        from scipy.integrate import solve_ivp

        overlap, constant, load = self.overlap, self.constant, self.load
        mass, n = self.floor.mass[0], self.count

        def slope(_: float, y: np.ndarray) -> np.ndarray:
            u = y[:n]
            closer = np.diff(u, prepend=0.0)
            excess = constant * np.maximum(overlap - closer, 0.0) ** 1.5 - load
            return np.concatenate([y[n:], (excess - np.append(excess[1:], 0.0)) / mass])

        start = np.concatenate([np.zeros(n), velocity])
        scale = float(np.abs(velocity).max())
        atol = np.concatenate([np.full(n, 1e-12 * scale * time), np.full(n, 1e-12 * scale)])
        end = solve_ivp(slope, (0.0, time), start, method="DOP853", rtol=1e-10, atol=atol).y[:, -1]
        return end[:n], end[n:]
