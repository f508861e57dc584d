"""Particles from .csv, .npz and .vtu files: every column is used, ignored by name, or refused by name.

A .csv file is UTF-8 text, separated by commas, with a header; .npz and .vtu files hold arrays.

    .csv                  .npz, .vtu                 what
    x, y, z               position (n, 3)            centres [m]
    vx, vy, vz            velocity (n, 3)            [m/s]; 0 where missing
    wx, wy, wz            angular_velocity (n, 3)    [rad/s]; 0 where missing
    radius                radius (n,)                [m]; `particles.radius` where missing
    material              material (n,)              name, or index into the scene's materials in order of
                                                     statement, from 0; `particles.material` where missing
    id                    id (n,)                    1 to n, each once: the order of the particles
    time                  time (n,)                  when each comes [s]; files of insertions only
                          force, torque (n, 3)       ignored: they follow from the state

The frames of a run have all of these. The points of a .vtu file are its positions; where an array `position`
differs (a filter has moved the points), the points are used, with a warning of the scene.
"""

from __future__ import annotations

import csv
import dataclasses
import io
import re
from pathlib import Path
from typing import Any

import numpy as np

from gpudem.output.archive import ArchiveError, read_npz
from gpudem.output.vtu import FrameError, read_vtu_and_cells
from gpudem.scene.packing import FLOAT32, InitialState
from gpudem.scene.sections import ANGULAR_VELOCITY, POSITION, RADIUS, VELOCITY
from gpudem.scene.types import each, number

Columns = dict[str, np.ndarray]

#: Column -> what checks its shape and range: the same as of particles listed in a scene.
_NUMBERS = {
    "position": POSITION,
    "velocity": VELOCITY,
    "angular_velocity": ANGULAR_VELOCITY,
    "radius": each(RADIUS),
}
#: The same of a file of insertions.
_TIMED = {**_NUMBERS, "time": each(number("s", 0))}
#: Columns of our own frames that follow from the state.
_IGNORED = ("force", "torque")
#: Columns of a .csv file of each array.
_CSV_COLUMNS = {
    "position": ("x", "y", "z"),
    "velocity": ("vx", "vy", "vz"),
    "angular_velocity": ("wx", "wy", "wz"),
    "radius": ("radius",),
    "material": ("material",),
    "id": ("id",),
    "time": ("time",),
}


@dataclasses.dataclass(frozen=True)
class ParticleFile:
    """What a file of particles holds."""

    state: InitialState
    warnings: tuple[str, ...] = ()
    """What a user may not expect of it, one sentence each."""
    time: np.ndarray | None = None
    """When each comes [s], shape (n,); of a file of insertions."""


def read_particles(
    path: Path,
    materials: dict[str, int],
    material: str | None = None,
    radius: float | None = None,
    timed: bool = False,
) -> ParticleFile:
    """Particles from a file; the columns are in the module's docstring.

    Args:
        path: A .csv, .npz or .vtu file.
        materials: Name -> index of the scene's materials.
        material: Material where the file has none.
        radius: Radius [m] where the file has none.
        timed: The file has a column `time`.

    Raises:
        ValueError: naming file, column and row.
    """
    reader = _READERS.get(path.suffix.lower())
    try:
        if not path.is_file():
            raise ValueError("no such file")
        if reader is None:
            raise ValueError(f"unknown suffix; known: {', '.join(_READERS)}")
        return _particles(reader(path), materials, material, radius, timed)
    except (ArchiveError, FrameError) as error:
        raise ValueError(f"path = {error}") from None
    except OSError as error:
        raise ValueError(f"path = {str(path)!r}: cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise ValueError(f"path = {str(path)!r}: {error}") from None


def _particles(
    columns: Columns, materials: dict[str, int], material: str | None, radius: float | None, timed: bool
) -> ParticleFile:
    """The particles of raw columns, in order of id. Raises ValueError naming the column."""
    warnings: list[str] = []
    checks = _TIMED if timed else _NUMBERS
    known = (*checks, "material", "id", *_IGNORED)
    columns = _one_position(columns, warnings)
    if "position" not in columns:
        raise ValueError(f"array position needed; found: {', '.join(columns) or 'none'}")
    unknown = [name for name in columns if name not in known]
    if unknown:
        raise ValueError(f"unknown array {unknown[0]!r}; known: {', '.join(known)}")
    if timed and "time" not in columns:
        raise ValueError("has no column time [s]")
    values: dict[str, Any] = {name: _checked(name, columns[name]) for name in checks if name in columns}
    count = len(values["position"])
    time = _times(values.pop("time"), count) if timed else None
    if "radius" not in values:
        if radius is None:
            raise ValueError("has no column radius; radius: missing [m]")
        values["radius"] = radius
    elif radius is not None and np.any(values["radius"] != radius):
        warnings.append(f"particles.radius = {radius:g} m: no effect, the file has a column radius")
    if "material" not in columns:
        if material is None:
            raise ValueError("has no column material; material: missing")
        values["material"] = materials[material]
    else:
        values["material"] = _material_indices(columns["material"], materials)
        if material is not None and np.any(values["material"] != materials[material]):
            warnings.append(
                f"particles.material = {material!r}: no effect, the file has a column material"
                f" (0 is {next(iter(materials))!r}, the scene's first)"
            )
    state = InitialState.build(**values)
    if "id" in columns:
        order = _order(columns["id"], count)
        state = InitialState(
            **{f.name: _frozen(getattr(state, f.name)[order]) for f in dataclasses.fields(InitialState)}
        )
        time = None if time is None else time[order]
    return ParticleFile(state, tuple(warnings), time)


def _times(time: float | np.ndarray, count: int) -> np.ndarray:
    """One time for each particle [s]. Raises ValueError: not as many as there are particles."""
    if np.ndim(time) and np.shape(time) != (count,):
        raise ValueError(f"time has {np.size(time)} rows; must have one for each of the {count} particles")
    return np.broadcast_to(np.asarray(time, np.float64), (count,))


def _frozen(values: np.ndarray) -> np.ndarray:
    values = np.ascontiguousarray(values)
    values.setflags(write=False)
    return values


def _checked(name: str, values: np.ndarray) -> float | np.ndarray:
    try:
        return _TIMED[name].check(values)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def _one_position(columns: Columns, warnings: list[str]) -> Columns:
    """The columns with `points` and `position` as one: the points, where they differ beyond rounding."""
    if "points" not in columns:
        return columns
    columns = dict(columns)
    points = columns.pop("points")
    if "position" not in columns:
        return {"position": points, **columns}
    stated, shown = _checked("position", columns["position"]), POSITION.check(points)
    assert isinstance(stated, np.ndarray)
    if stated.shape != shown.shape:
        raise ValueError(f"position: has {len(stated)} rows; the file has {len(shown)} points")
    single = points.dtype == np.float32 or columns["position"].dtype == np.float32
    off = float(np.abs(stated - shown).max(initial=0.0))
    if off > (FLOAT32 * float(np.abs(stated).max(initial=0.0)) if single else 0.0):
        warnings.append(
            f"particles.path: the points of the file lie up to {off:.3g} m from its array position"
            " (moved by a filter?); the points are used, velocities as they stand"
        )
        columns["position"] = points
    elif columns["position"].dtype == np.float32:
        columns["position"] = points
    return columns


def _material_indices(values: np.ndarray, materials: dict[str, int]) -> np.ndarray:
    """Indices from names or indices, shape (n,) or (). Raises ValueError naming the row."""
    listed = ", ".join(f"{index} or {name}" for name, index in list(materials.items())[:8])
    rule = f"must be the name or the index of a material of the scene: {listed}"
    if values.ndim > 1:
        raise ValueError(f"material: has shape {values.shape}; must be (n,)")
    rows = np.atleast_1d(values)
    if values.dtype.kind == "U":
        numbers = {text: _index(text, materials) for text in np.unique(rows).tolist()}
        found = np.array([numbers[text] for text in rows.tolist()], np.float64)
    elif values.dtype.kind in "iuf":
        found = rows.astype(np.float64)
    else:
        raise ValueError(f"material: {rule}")
    bad = ~((found >= 0) & (found < len(materials)) & (found == np.floor(found)))
    if bad.any():
        row = int(np.argmax(bad))
        raise ValueError(f"material: row {row + 1} is {rows[row].item()!r}; {rule}")
    found = found.astype(np.int32)
    return found[0] if values.ndim == 0 else found


def _index(text: str, materials: dict[str, int]) -> int:
    """Index of a material from its name or its number; -1 for neither."""
    text = text.strip()
    if text in materials:
        return materials[text]
    try:
        number = float(text)
    except ValueError:
        return -1
    return int(number) if number.is_integer() and abs(number) < 2**31 else -1


def _order(ids: np.ndarray, count: int) -> np.ndarray:
    """The rows in order of id. Raises ValueError where the ids are not 1 to `count`, each once."""
    rule = f"must be 1 to {count}, each once; leave the column out to number the particles by row"
    if ids.shape != (count,) or ids.dtype.kind not in "iuf":
        raise ValueError(f"id: {rule}")
    order = np.argsort(ids, kind="stable")
    bad = ids[order] != np.arange(1, count + 1)
    if bad.any():
        raise ValueError(f"id: found {ids[order][int(np.argmax(bad))]:g}; {rule}")
    return order


# -- the three formats ---------------------------------------------------------------------------------------


def _csv(path: Path) -> Columns:
    header, rows = _table(path)
    if not {"x", "y", "z"} <= set(header):
        whole = header[0] if len(header) == 1 else ""
        other = next((mark for mark in (";", "\t", " ") if mark in whole), None)
        if other:
            raise ValueError(f"columns are separated by {other!r}; must be separated by ','")
        raise ValueError(f"columns x, y, z needed; found: {', '.join(header) or 'none'}")
    known = [name for names in _CSV_COLUMNS.values() for name in names]
    unknown = [name for name in header if name not in known or header.count(name) > 1]
    if unknown:
        raise ValueError(f"unknown or repeated column {unknown[0]!r}; known: {', '.join(known)}")
    for i, row in enumerate(rows):
        if len(row) != len(header):
            raise ValueError(f"row {i + 1} has {len(row)} columns; must be {len(header)}")
    columns: Columns = {}
    for array, names in _CSV_COLUMNS.items():
        missing = [name for name in names if name not in header]
        if len(missing) == len(names):
            continue
        if missing:
            raise ValueError(f"columns {', '.join(names)} belong together; missing: {', '.join(missing)}")
        texts = [[row[header.index(name)] for row in rows] for name in names]
        if array == "material":
            columns[array] = np.array(texts[0], dtype=str)
            continue
        numbers = [_numbers(column, name) for column, name in zip(texts, names, strict=True)]
        columns[array] = np.stack(numbers, axis=1) if len(names) > 1 else numbers[0]
    return columns


def _table(path: Path) -> tuple[list[str], list[list[str]]]:
    """Header and rows of a .csv file, blank lines left out. Raises ValueError: not UTF-8, not a table."""
    try:
        text = path.read_bytes().decode("utf-8-sig")  # with or without a byte order mark
        rows = [row for row in csv.reader(io.StringIO(text, newline="")) if row]
    except UnicodeDecodeError as error:
        raise ValueError(f"not a text file: byte {error.start} is not UTF-8") from None
    except csv.Error as error:
        raise ValueError(f"not a table separated by commas: {error}") from None
    header, *rows = rows or [[]]
    return [name.strip() for name in header], rows


def _numbers(texts: list[str], name: str) -> np.ndarray:
    try:
        values = np.array(texts, dtype=np.float64)
    except ValueError:
        values = None
    if values is not None and not any("_" in text for text in texts):
        return values
    for i, text in enumerate(texts):
        try:
            if "_" in text:  # a digit group of Python's own
                raise ValueError
            float(text)
        except ValueError:
            raise ValueError(f"{name} in row {i + 1} is {text!r}; must be a number") from None
    raise ValueError(f"{name}: must be numbers")


def _vtu(path: Path) -> Columns:
    columns, cell_arrays = read_vtu_and_cells(path)
    if cell_arrays:
        raise ValueError(f"array {next(iter(cell_arrays))!r} belongs to cells; particles are points")
    start, _, _ = path.read_bytes().partition(b"</PointData>")
    names = re.findall(rb'<DataArray[^>]*\bName="([^"]*)"', start.partition(b"<PointData")[2])
    twice = [name.decode(errors="replace") for name in names if names.count(name) > 1]
    if twice:  # the reader would give the last of them
        raise ValueError(f"array {twice[0]!r} given twice")
    return columns


_READERS = {".csv": _csv, ".npz": read_npz, ".vtu": _vtu}
