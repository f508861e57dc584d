"""Initial positions: jittered lattice, explicit arrays. NumPy only."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from gpudem.scene import distributions

if TYPE_CHECKING:
    from gpudem.scene.sections import Explicit, Lattice
    from gpudem.scene.types import Vector


#: Relative rounding of a side and of a position in float32: as far beyond a side may a run write a position.
FLOAT32 = 2.0**-22


@dataclasses.dataclass(frozen=True)
class InitialState:
    """Particles at t = 0, id = row + 1."""

    position: np.ndarray
    """Centres [m], shape (n, 3)."""
    velocity: np.ndarray
    """Velocities [m/s], shape (n, 3)."""
    angular_velocity: np.ndarray
    """Angular velocities [rad/s], shape (n, 3)."""
    radius: np.ndarray
    """Radii [m], shape (n,)."""
    material: np.ndarray
    """Index into the scene's materials, shape (n,), int32."""

    def __len__(self) -> int:
        return len(self.radius)

    @staticmethod
    def none() -> InitialState:
        """No particles."""
        return InitialState.build(np.empty((0, 3)), np.empty(0), np.empty(0, np.int32))

    def rows(self, count: int) -> InitialState:
        """The first so many of them."""
        columns = {field.name: getattr(self, field.name)[:count] for field in dataclasses.fields(self)}
        return self if count == len(self) else InitialState(**columns)

    def at_rest(self) -> InitialState:
        """The same without velocities."""
        none = np.zeros((len(self), 3))
        none.setflags(write=False)
        return dataclasses.replace(self, velocity=none, angular_velocity=none)

    def within(self, lo: Vector, hi: Vector, periodic: tuple[bool, bool, bool]) -> InitialState:
        """The same with positions on, or rounded by float32 beyond, a side lo..hi [m] brought onto it.

        Periodic sides: into lo <= x < hi, the upper face being the lower one. Others: onto the nearer side.
        Positions farther out stay, as does every number that lies within.
        """
        position = self.position
        for k in range(3):
            a, b, x = lo[k], hi[k], position[:, k]
            slack = FLOAT32 * max(abs(a), abs(b))
            below = (x < a) & (x >= a - slack)
            above = ((x >= b) if periodic[k] else (x > b)) & (x <= b + slack)
            if not (below.any() or above.any()) or a >= b:
                continue
            position = np.array(position)
            if periodic[k]:
                position[above, k] = np.maximum(a, x[above] - (b - a))
                moved = x[below] + (b - a)
                position[below, k] = np.where(moved < b, moved, a)  # a tiny step below is none at all
            else:
                position[below, k], position[above, k] = a, b
        if position is self.position:
            return self
        position.setflags(write=False)
        return dataclasses.replace(self, position=position)

    @staticmethod
    def build(
        position: npt.ArrayLike,
        radius: npt.ArrayLike,
        material: npt.ArrayLike,
        velocity: npt.ArrayLike | None = None,
        angular_velocity: npt.ArrayLike | None = None,
    ) -> InitialState:
        """Columns in SI units, read-only; scalars hold for all, velocities default to zero.

        Raises:
            ValueError: naming the column, where lengths or shapes differ.
        """
        n = len(np.asarray(position))

        def column(name: str, value: npt.ArrayLike, width: tuple[int, ...], dtype: type) -> np.ndarray:
            array = np.asarray(value, dtype)
            array = np.broadcast_to(array, (n, *width)) if array.ndim == 0 else array
            if len(array) != n:
                raise ValueError(f"{name} has {len(array)} rows; must have one for each of the {n} particles")
            if array.shape[1:] != width:
                raise ValueError(f"{name} has shape {array.shape}; must be {(n, *width)}")
            array = np.array(array, order="C")
            array.setflags(write=False)
            return array

        return InitialState(
            position=column("position", position, (3,), np.float64),
            velocity=column("velocity", 0.0 if velocity is None else velocity, (3,), np.float64),
            angular_velocity=column(
                "angular_velocity", 0.0 if angular_velocity is None else angular_velocity, (3,), np.float64
            ),
            radius=column("radius", radius, (), np.float64),
            material=column("material", material, (), np.int32),
        )

    @staticmethod
    def from_explicit(p: Explicit, index: dict[str, int]) -> InitialState:
        """Particles listed in the scene."""
        material = index[p.material] if isinstance(p.material, str) else [index[m] for m in p.material]
        return InitialState.build(p.position, p.radius, material, p.velocity, p.angular_velocity)


def lattice(p: Lattice, index: dict[str, int]) -> InitialState:
    """A cubic lattice of `spacing` largest diameters filling lo..hi layer by layer in z, with random shifts.

    Radii of a distribution are drawn first, and the largest drawn counts.

    The lattice is centred in x and y; a shift below the free gap leaves no overlap. Raises ValueError
    where `count` does not fit.
    """
    rng = np.random.default_rng(p.seed)
    if isinstance(p.radius, tuple):
        shares = np.array([r.share for r in p.radius])
        radius = rng.choice([r.radius for r in p.radius], size=p.count, p=shares / shares.sum())
        largest = max(r.radius for r in p.radius)
    else:
        radius = distributions.draw(p.radius, rng, p.count)
        largest = float(radius.max())  # mutate: largest_of_lattice
    pitch = 2 * largest * p.spacing
    lo, hi = np.array(p.lo), np.array(p.hi)
    cells = [max(0, math.floor((b - a) / pitch + 1e-9)) for a, b in zip(lo, hi, strict=True)]
    if math.prod(cells) < p.count:
        raise ValueError(
            f"count = {p.count} does not fit: lo..hi holds {math.prod(cells)} places"
            f" ({cells[0]} x {cells[1]} x {cells[2]}) at a pitch of {pitch:g} m, {p.spacing:g} diameters of"
            f" the largest particle, radius {largest:g} m"
        )
    k, (nx, ny) = np.arange(p.count), [min(c, p.count) for c in cells[:2]]
    grid = np.stack([k % nx, k // nx % ny, k // (nx * ny)], axis=1)
    spare = np.array([(hi - lo)[0] - cells[0] * pitch, (hi - lo)[1] - cells[1] * pitch, 0.0])
    gap = (p.spacing - 1) * largest  # half of the free gap: two neighbors may both use it
    shift = rng.uniform(-1, 1, (p.count, 3)) * gap * p.jitter
    position = lo + spare / 2 + (grid + 0.5) * pitch + shift
    velocity = rng.normal(0, p.velocity_rms, (p.count, 3)) if p.velocity_rms else None
    return InitialState.build(position, radius, index[p.material], velocity)
