"""Particles from .csv, .npz and .vtu files."""

from __future__ import annotations

import csv
import zipfile
from pathlib import Path

import numpy as np

from gpudem.output.vtu import FrameError, read_vtu
from gpudem.scene.packing import InitialState

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
    try:
        return _known(read_vtu(path), path)
    except FrameError as error:
        raise ValueError(f"path = {error}") from None


_READERS = {".csv": _csv, ".npz": _npz, ".vtu": _vtu}
