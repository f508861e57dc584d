"""Initial positions: jittered lattice, explicit arrays, from file. NumPy only."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from gpudem.scene import Explicit, Lattice


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
    def build(position, radius, material, velocity=None, angular_velocity=None) -> InitialState:
        """Broadcast scalars, default velocities to zero. Raises ValueError where lengths differ."""
        n = len(position)
        zeros = np.zeros((n, 3))
        columns = {
            "position": np.asarray(position, float),
            "velocity": zeros if velocity is None else np.asarray(velocity, float),
            "angular_velocity": zeros if angular_velocity is None else np.asarray(angular_velocity, float),
            "radius": np.broadcast_to(np.asarray(radius, float), (n,)) if np.ndim(radius) == 0 else np.asarray(radius),
            "material": np.full(n, material, np.int32) if np.ndim(material) == 0 else np.asarray(material, np.int32),
        }
        for name, column in columns.items():
            if len(column) != n:
                raise ValueError(f"{name} has {len(column)} rows for {n} particles")
        return InitialState(**{k: np.ascontiguousarray(v) for k, v in columns.items()})

    @staticmethod
    def from_explicit(p: Explicit, index: dict[str, int]) -> InitialState:
        """Particles listed in the scene."""
        material = index[p.material] if isinstance(p.material, str) else [index[m] for m in p.material]
        return InitialState.build(p.position, p.radius, material, p.velocity, p.angular_velocity)


def lattice(p: Lattice, index: dict[str, int]) -> InitialState:
    """A cubic lattice of `spacing` largest diameters filling lo..hi layer by layer in z, with random shifts.

    The lattice is centred in x and y; a shift below the free gap leaves no overlap. Raises ValueError
    where `count` does not fit.
    """
    rng = np.random.default_rng(p.seed)
    if isinstance(p.radius, list):
        shares = np.array([r.share for r in p.radius])
        radius = rng.choice([r.radius for r in p.radius], size=p.count, p=shares / shares.sum())
        largest = max(r.radius for r in p.radius)
    else:
        radius, largest = np.full(p.count, p.radius), p.radius
    pitch = 2 * largest * p.spacing
    lo, hi = np.array(p.lo), np.array(p.hi)
    cells = [max(0, math.floor((b - a) / pitch + 1e-9)) for a, b in zip(lo, hi, strict=True)]
    if math.prod(cells) < p.count:
        raise ValueError(
            f"count = {p.count} does not fit: lo..hi holds {math.prod(cells)} places"
            f" ({cells[0]} x {cells[1]} x {cells[2]}) at a pitch of {pitch:g} m"
        )
    k = np.arange(p.count)
    grid = np.stack([k % cells[0], k // cells[0] % cells[1], k // (cells[0] * cells[1])], axis=1)
    spare = np.array([(hi - lo)[0] - cells[0] * pitch, (hi - lo)[1] - cells[1] * pitch, 0.0])
    gap = (p.spacing - 1) * largest  # half of the free gap: two neighbours may use it both
    shift = rng.uniform(-1, 1, (p.count, 3)) * gap * p.jitter
    position = lo + spare / 2 + (grid + 0.5) * pitch + shift
    velocity = rng.normal(0, p.velocity_rms, (p.count, 3)) if p.velocity_rms else None
    return InitialState.build(position, radius, index[p.material], velocity)


def read_particles(path: Path, radius: float | None, material: int) -> InitialState:
    """Particles from .csv (columns x,y,z[,vx,vy,vz][,wx,wy,wz][,radius]), .npz or .vtu (position, velocity,
    angular_velocity, radius). Raises ValueError naming file and column.
    """
    if not path.is_file():
        raise ValueError(f"path = {str(path)!r}: no such file")
    columns = _READERS.get(path.suffix, _unknown)(path)
    if columns.get("radius") is None:
        if radius is None:
            raise ValueError(f"{path}: no radius column, and no `radius` in the scene")
        columns["radius"] = np.full(len(columns["position"]), radius)
    for name, column in columns.items():
        if column is not None and not np.isfinite(column).all():
            raise ValueError(f"{path}: column {name}, row {int(np.argwhere(~np.isfinite(column))[0][0])} is not finite")
    return InitialState.build(material=material, **columns)


def _unknown(path: Path) -> dict[str, np.ndarray | None]:
    raise ValueError(f"{path}: unknown suffix {path.suffix!r}; known: {', '.join(sorted(_READERS))}")


def _csv(path: Path) -> dict[str, np.ndarray | None]:
    try:
        table = np.genfromtxt(path, delimiter=",", names=True, ndmin=1)
    except ValueError as error:
        raise ValueError(f"{path}: not a table: {str(error).strip().splitlines()[-1].strip()}") from None
    names = table.dtype.names or ()

    def columns(keys: str) -> np.ndarray | None:
        wanted = keys.split()
        return np.stack([table[k] for k in wanted], axis=1) if set(wanted) <= set(names) else None

    position = columns("x y z")
    if position is None:
        raise ValueError(f"{path}: columns x, y, z needed; found: {', '.join(names) or 'none'}")
    return {
        "position": position,
        "velocity": columns("vx vy vz"),
        "angular_velocity": columns("wx wy wz"),
        "radius": table["radius"] if "radius" in names else None,
    }


_COLUMNS = ("position", "velocity", "angular_velocity", "radius")


def _npz(path: Path) -> dict[str, np.ndarray | None]:
    with np.load(path) as data:
        if "position" not in data:
            raise ValueError(f"{path}: array `position` needed; found: {', '.join(data) or 'none'}")
        return {k: data[k] if k in data else None for k in _COLUMNS}


def _vtu(path: Path) -> dict[str, np.ndarray | None]:
    from gpudem.frames import read_vtu

    frame = read_vtu(path)
    return {k: frame.get(k) for k in _COLUMNS}


_READERS = {".csv": _csv, ".npz": _npz, ".vtu": _vtu}
