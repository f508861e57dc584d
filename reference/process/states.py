"""What a command has written -> states at the requested steps, checked row by row, and from them a run."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import ValidationError

from gpudem.errors import GpudemError
from gpudem.output.recorder import Recorder
from gpudem.output.vtu import FrameError, read_pvd, read_vtu
from gpudem.scene import Scene
from reference.process import contract, statement

if TYPE_CHECKING:
    import pandas

#: Column of a frame -> columns of the table.
COLUMNS = {
    "position": ("x", "y", "z"),
    "velocity": ("vx", "vy", "vz"),
    "angular_velocity": ("wx", "wy", "wz"),
    "force": ("fx", "fy", "fz"),
    "torque": ("tx", "ty", "tz"),
}
OPTIONAL = ("force", "torque")
#: Columns of a history that states do not show.
NOT_OF_STATES = ("contacts", "work")
#: Significant digits from which rounding is all that a table loses; fewer are reported.
FULL_DIGITS = 14
#: Values of a column that are looked at for their digits, and digits that are tried.
SAMPLE, MOST_DIGITS = 2000, 17
#: Different values from which a column is judged.
FEWEST = 100
#: Digits of float32, which no count of decimal digits shows.
FLOAT32_DIGITS = 7


class OutputError(GpudemError):
    """What a command wrote is missing, broken or incomplete; names file, row and column."""


@dataclasses.dataclass(frozen=True)
class States:
    """The states at the requested steps, in order of id."""

    steps: np.ndarray
    columns: dict[str, np.ndarray]
    """Of COLUMNS, those that were written, each (steps, n, 3), as they stand in the file."""
    digits: int
    """Significant digits of positions and velocities, the fewer; 17: all."""
    warnings: list[str]

    @property
    def not_written(self) -> list[str]:
        """Columns of a trace or history that there are not: not written, or not shown by states."""
        return [*(name for name in COLUMNS if name not in self.columns), *NOT_OF_STATES]


def about(folder: Path) -> tuple[contract.RunFacts, list[str]]:
    """run.json, and what there is to say of it. Raises OutputError: not JSON, an unknown key, a bad value."""
    path = folder / contract.RUN
    if not path.exists():
        text = "no run.json: name, version, scheme and stepping time of the code are not known"
        return contract.RunFacts(), [text]
    try:
        return contract.RunFacts(**json.loads(path.read_text(encoding="utf-8"))), []
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise OutputError(f"{path}: {where} = {first['input']!r}: {first['msg']}") from None
    except (OSError, ValueError, TypeError) as error:
        raise OutputError(f"{path}: cannot be read as a JSON object: {error}") from None


def read(scene: Scene, folder: Path, steps: np.ndarray) -> States:
    """The states at these steps from states.csv or from run.pvd and its frames.

    Raises OutputError: neither is present, a column or row is missing or twice, a value is not a number.
    """
    table, pvd = folder / contract.TABLE, folder / contract.PVD
    if table.is_file():
        path, rows = table, _rows_of_table(table)
    elif pvd.is_file():
        path, rows = pvd, _rows_of_frames(pvd)
    else:
        found = ", ".join(sorted(p.name for p in folder.iterdir())) or "nothing"
        raise OutputError(f"{folder}: neither {table.name} nor {pvd.name}; found: {found}")
    row, ignored = _placed(path, rows, scene, steps)
    n = len(scene.state)
    columns = {
        name: np.stack([rows[part].to_numpy()[row] for part in parts], axis=-1).reshape(len(steps), n, 3)
        for name, parts in COLUMNS.items()
        if parts[0] in rows
    }
    digits = min(significant_digits(columns[name]) for name in ("position", "velocity"))
    warnings = (
        [f"{path.name}: {ignored} rows at times that were not requested are ignored"] if ignored else []
    )
    if digits < FULL_DIGITS:
        warnings.append(
            f"{path.name}: numbers with {digits} significant digits; what is smaller cannot be compared"
            " (write 17, as %.17g or repr do)"
        )
    _require_start(path, scene, columns["position"][0], digits)
    return States(steps, columns, digits, warnings)


# -- rows ----------------------------------------------------------------------------------------------------


def _rows_of_table(path: Path) -> pandas.DataFrame:
    """states.csv with all numbers read to the last bit."""
    import pandas

    try:
        with path.open(encoding="utf-8") as file:
            names = [name.strip() for name in file.readline().split(",")]
        _require_columns(path, names)
        options: dict[str, Any] = {"skipinitialspace": True, "skip_blank_lines": False, "index_col": False}
        options |= {"dtype": str, "keep_default_na": False}  # as text: not every pandas reads numbers exactly
        text = pandas.read_csv(path, names=names, header=0, **options)
    except (OSError, pandas.errors.ParserError, pandas.errors.EmptyDataError, UnicodeDecodeError) as error:
        raise OutputError(f"{path}: cannot be read as a table: {error}") from None
    rows = _numbers(path, text)
    for name in rows:
        bad = ~np.isfinite(rows[name].to_numpy())
        if bad.any():
            line = int(np.argmax(bad))
            raise OutputError(
                f"{path}: line {line + 2}, column {name}: {rows[name][line]}, not a finite number"
            )
    return rows


def _numbers(path: Path, text: pandas.DataFrame) -> pandas.DataFrame:
    """Text as numbers. Raises OutputError naming the first cell that is none."""
    try:
        return text.astype(np.float64)
    except (TypeError, ValueError):
        pass
    for name in text:
        for line, cell in enumerate(text[name], 2):
            try:
                float(cell)
            except (TypeError, ValueError):
                raise OutputError(f"{path}: line {line}, column {name}: {cell!r} is not a number") from None
    raise OutputError(f"{path}: cannot be read as numbers")


def _rows_of_frames(path: Path) -> pandas.DataFrame:
    """The frames of a .pvd as one table, with the time of each."""
    import pandas

    parts = []
    try:
        for time, part, name in read_pvd(path):
            if part:
                continue
            frame = read_vtu(path.parent / name)
            frame.setdefault("position", frame["points"])
            missing = [k for k in ("id", *COLUMNS) if k not in frame and k not in OPTIONAL]
            if missing:
                raise OutputError(
                    f"{path.parent / name}: no array {', '.join(missing)}; found: {', '.join(frame)}"
                )
            table: dict[str, Any] = {"time": time, "id": frame["id"].reshape(-1)}
            for column, names in COLUMNS.items():
                if column in frame:
                    values = np.asarray(frame[column])
                    if not np.isfinite(values).all():
                        row = int(np.argmax(~np.isfinite(values).all(axis=-1)))
                        raise OutputError(f"{path.parent / name}: row {row}, {column}: not a finite number")
                    table |= dict(zip(names, values.astype(np.float64).T, strict=True))
            parts.append(pandas.DataFrame(table))
    except FrameError as error:
        raise OutputError(str(error)) from None
    except ValueError as error:
        raise OutputError(f"{path}: arrays of a frame do not have three components each: {error}") from None
    if not parts:
        raise OutputError(f"{path}: lists no frame")
    return pandas.concat(parts, ignore_index=True)


def _require_columns(path: Path, names: list[str]) -> None:
    """The columns that a table must have, and those that it may have, whole."""
    known = [part for parts in COLUMNS.values() for part in parts]
    needed = ["id", *(part for name, parts in COLUMNS.items() if name not in OPTIONAL for part in parts)]
    for name in OPTIONAL:
        if any(part in names for part in COLUMNS[name]):
            needed += COLUMNS[name]
    missing = [name for name in needed if name not in names]
    if "step" not in names and "time" not in names:
        missing.insert(0, "step (or time)")
    if missing:
        raise OutputError(f"{path}: line 1: no column {', '.join(missing)}; found: {', '.join(names)}")
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise OutputError(f"{path}: line 1: column {twice[0]} is given twice")
    unknown = [name for name in names if name not in (*known, "step", "time", "id")]
    if unknown:
        raise OutputError(f"{path}: line 1: unknown column {', '.join(unknown)}")


def _placed(path: Path, rows: pandas.DataFrame, scene: Scene, steps: np.ndarray) -> tuple[np.ndarray, int]:
    """(row of each step and id, steps * n; rows that were not requested)."""
    n, dt = len(scene.state), scene.time.step
    stated = rows["step"].to_numpy() if "step" in rows else rows["time"].to_numpy() / dt
    step = np.rint(stated).astype(np.int64)
    at = np.minimum(np.searchsorted(steps, step), len(steps) - 1)
    requested = (steps[at] == step) & (np.abs(stated - step) <= contract.TIME_TOLERANCE)
    ids = rows["id"].to_numpy()
    known = (ids >= 1) & (ids <= n) & (ids == np.rint(ids))
    if not known.all():
        row = int(np.argmax(~known))
        raise OutputError(f"{path}: {_where(path, row)}: id = {ids[row]:g}; ids are 1 to {n}")
    key = at * n + ids.astype(np.int64) - 1
    place = np.full(len(steps) * n, -1)
    chosen = np.flatnonzero(requested)
    place[key[chosen]] = chosen
    twice = chosen[place[key[chosen]] != chosen]
    if len(twice):
        row = int(twice[0])
        what = f"particle {int(ids[row])} at step {step[row]}"
        raise OutputError(f"{path}: {_where(path, int(place[key[row]]))}: {what} is given twice")
    missing = np.flatnonzero(place < 0)
    if len(missing):
        k, particle = divmod(int(missing[0]), n)
        what = f"no row for particle {particle + 1} at step {steps[k]} (t = {steps[k] * dt:.9g} s)"
        near = stated[int(np.argmin(np.abs(stated - steps[k])))] if len(stated) else np.nan
        raise OutputError(
            f"{path}: {what}; {len(missing)} of {len(place)} rows are missing; the nearest time is"
            f" {near * dt:.9g} s, step {near:.9g}"
        )
    return place, int((~requested).sum())


def _where(path: Path, row: int) -> str:
    return f"line {row + 2}" if path.suffix == ".csv" else f"row {row} of all frames"


def significant_digits(values: np.ndarray) -> int:
    """Decimal digits that the numbers of a column were written with; 17 for all that a float64 has.

    Numbers of an initial state may have few digits by themselves: only many different ones are judged.
    """
    flat = np.unique(values[values != 0])
    if len(flat) < FEWEST:
        return MOST_DIGITS
    flat = flat[:: max(1, len(flat) // SAMPLE)]
    with np.errstate(over="ignore"):
        if np.array_equal(flat.astype(np.float32).astype(np.float64), flat):
            return FLOAT32_DIGITS
    least = 1
    for value in flat.tolist():
        while least < MOST_DIGITS and float(f"{value:.{least}g}") != value:
            least += 1
    return least


def _require_start(path: Path, scene: Scene, position: np.ndarray, digits: int) -> None:
    """The first state is that of the scene, to the digits written."""
    off = np.abs(wrapped(scene, position) - scene.state.position)
    size = np.array(scene.domain.hi) - np.array(scene.domain.lo)
    off = np.where(scene.domain.periodic, np.minimum(off, np.abs(size - off)), off)
    allowed = 1e-9 * scene.state.radius[:, None] + 10.0 ** (1 - digits) * np.abs(scene.state.position)
    if (off > allowed).any():
        row = int(np.argmax((off > allowed).any(axis=1)))
        raise OutputError(
            f"{path}: step 0: particle {row + 1} is {off[row].max():.3g} m from where scene.json has it;"
            " the state at t = 0 is the initial one (wrong id, or the first step was done already)"
        )


def wrapped(scene: Scene, position: np.ndarray) -> np.ndarray:
    """Positions in lo <= x < hi along periodic sides; those inside as they are, to the last bit."""
    position = np.array(position)
    for k in np.flatnonzero(scene.domain.periodic):
        lo, hi = scene.domain.lo[k], scene.domain.hi[k]
        x = position[..., k]
        outside = (x < lo) | (x >= hi)
        x[outside] -= np.floor((x[outside] - lo) / (hi - lo)) * (hi - lo)
        x[x >= hi] = lo  # rounded up to the face
    return position


def unwrapped(scene: Scene, position: np.ndarray) -> np.ndarray:
    """Positions (steps, n, 3) that follow particles through periodic sides, by the nearest image."""
    position = np.array(position)
    for k in np.flatnonzero(scene.domain.periodic):
        size = scene.domain.hi[k] - scene.domain.lo[k]
        jumps = np.rint(np.diff(position[..., k], axis=0) / size)
        position[1:, :, k] -= np.cumsum(jumps, axis=0) * size
    return position


# -- the run -------------------------------------------------------------------------------------------------


def record(
    scene: Scene, directory: Path, found: States, run: contract.RunFacts
) -> tuple[dict[str, np.ndarray] | None, pandas.DataFrame | None]:
    """Write the frames; (trace without what was not written, history where its states were requested)."""
    columns = dict(found.columns)
    written = columns["position"]
    followed = unwrapped(scene, written) if run.wrapped else written
    columns["position"] = wrapped(scene, written)
    shape = written.shape[1:]
    recorder = Recorder(scene, directory)
    recorder.history_stride = statement.history_stride(scene)
    with recorder:
        for k, step in enumerate(found.steps.tolist()):
            frame = {
                "id": np.arange(1, shape[0] + 1, dtype=np.int64),
                "material": scene.state.material.astype(np.int32),
                "radius": scene.state.radius,
                **{name: columns[name][k] if name in columns else np.full(shape, np.nan) for name in COLUMNS},
            }
            recorder.add(step, frame, unwrapped=followed[k])
    trace, history = recorder.trace, recorder.history
    if trace is not None:
        trace = {name: values for name, values in trace.items() if name not in found.not_written}
    if history is not None:
        history = history.drop(columns=[name for name in NOT_OF_STATES if name in history])
    return trace, history
