"""Initial positions: jittered lattice, explicit arrays, from file. NumPy only."""

from __future__ import annotations

import csv
import dataclasses
import math
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from gpudem.sections import Explicit, Lattice


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

    The lattice is centred in x and y; a shift below the free gap leaves no overlap. Raises ValueError
    where `count` does not fit.
    """
    rng = np.random.default_rng(p.seed)
    if isinstance(p.radius, tuple):
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
    k, (nx, ny) = np.arange(p.count), [min(c, p.count) for c in cells[:2]]
    grid = np.stack([k % nx, k // nx % ny, k // (nx * ny)], axis=1)
    spare = np.array([(hi - lo)[0] - cells[0] * pitch, (hi - lo)[1] - cells[1] * pitch, 0.0])
    gap = (p.spacing - 1) * largest  # half of the free gap: two neighbours may use it both
    shift = rng.uniform(-1, 1, (p.count, 3)) * gap * p.jitter
    position = lo + spare / 2 + (grid + 0.5) * pitch + shift
    velocity = rng.normal(0, p.velocity_rms, (p.count, 3)) if p.velocity_rms else None
    return InitialState.build(position, radius, index[p.material], velocity)


Columns = dict[str, np.ndarray]


def read_particles(path: Path, radius: float | None, material: int) -> InitialState:
    """Particles from a file; `radius` [m] where the file has none.

    .csv has columns x, y, z [m] and may have vx, vy, vz [m/s], wx, wy, wz [rad/s], radius [m];
    .npz and .vtu (a frame of an earlier run) have arrays position, velocity, angular_velocity, radius.

    Raises:
        ValueError: naming file, column and row.
    """
    if not path.is_file():
        raise ValueError(f"path = {str(path)!r}: no such file")
    if path.suffix not in _READERS:
        raise ValueError(f"path = {str(path)!r}: unknown suffix; known: {', '.join(_READERS)}")
    columns = _READERS[path.suffix](path)
    if "radius" not in columns:
        if radius is None:
            raise ValueError(f"radius: missing [m]; {path} has no column radius")
        columns["radius"] = np.full(len(columns["position"]), radius)
    for name, column in columns.items():
        bad = ~np.isfinite(column)
        if name == "radius":
            bad |= column <= 0
        if bad.any():
            row = int(np.argwhere(bad)[0][0])
            raise ValueError(
                f"path = {str(path)!r}: {name} in row {row + 1} is {column[row]}; must be finite"
                f"{' and positive [m]' if name == 'radius' else ''}"
            )
    return InitialState.build(material=material, **columns)


def _csv(path: Path) -> Columns:
    with path.open(newline="", encoding="utf-8", errors="replace") as file:
        header, *rows = [row for row in csv.reader(file) if row] or [[]]
    header = [name.strip() for name in header]
    groups = {"position": "x y z", "velocity": "vx vy vz", "angular_velocity": "wx wy wz", "radius": "radius"}
    if not {"x", "y", "z"} <= set(header):
        raise ValueError(
            f"path = {str(path)!r}: columns x, y, z needed; found: {', '.join(header) or 'none'}"
        )
    known = " ".join(groups.values()).split()
    strange = [name for name in header if name not in known or header.count(name) > 1]
    if strange:
        raise ValueError(
            f"path = {str(path)!r}: unknown or repeated column {strange[0]!r}; known: {', '.join(known)}"
        )
    for i, row in enumerate(rows):
        if len(row) != len(header):
            raise ValueError(
                f"path = {str(path)!r}: row {i + 1} has {len(row)} columns; must be {len(header)}"
            )
    table = {name: _numbers([row[k] for row in rows], name, path) for k, name in enumerate(header)}
    columns = {
        name: np.stack([table[key] for key in keys.split()], axis=1)
        for name, keys in groups.items()
        if set(keys.split()) <= set(table)
    }
    if "radius" in columns:
        columns["radius"] = columns["radius"][:, 0]
    return columns


def _numbers(texts: list[str], name: str, path: Path) -> np.ndarray:
    values = np.zeros(len(texts))
    for i, text in enumerate(texts):
        try:
            values[i] = float(text)
        except ValueError:
            raise ValueError(
                f"path = {str(path)!r}: {name} in row {i + 1} is {text!r}; must be a number"
            ) from None
    return values


def _known(arrays: Columns, path: Path) -> Columns:
    if "position" not in arrays:
        raise ValueError(f"path = {str(path)!r}: array position needed; found: {', '.join(arrays) or 'none'}")
    known = ("position", "velocity", "angular_velocity", "radius")
    return {name: np.asarray(arrays[name], np.float64) for name in known if name in arrays}


def _npz(path: Path) -> Columns:
    try:
        with path.open("rb") as file:
            arrays = dict(np.load(file))
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, AttributeError) as error:
        raise ValueError(f"path = {str(path)!r}: not an .npz file: {error}") from None
    return _known(arrays, path)


def _vtu(path: Path) -> Columns:
    from gpudem.frames import FrameError, read_vtu

    try:
        return _known(read_vtu(path), path)
    except FrameError as error:
        raise ValueError(f"path = {error}") from None


_READERS = {".csv": _csv, ".npz": _npz, ".vtu": _vtu}
