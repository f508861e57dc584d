"""Validated field types of a scene: numbers that know their unit and range, vectors, arrays, names."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, PlainSerializer

#: Names travel into file names and LIGGGHTS decks (which can run shell commands): letters, digits, _ only.
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,31}")


class Model(BaseModel):
    """Base of the scene classes: frozen, no unknown keys, values validated."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", arbitrary_types_allowed=True, protected_namespaces=(), allow_inf_nan=False
    )


def number(unit: str, lo: float = -math.inf, hi: float = math.inf, *, open_lo: bool = False, hint: str = "") -> Any:
    """A float with its unit [..] and allowed range lo..hi (`open_lo`: lo itself is not allowed)."""
    left = f"{lo:g} <" if open_lo else f"{lo:g} <="
    span = f"{left} value" if math.isfinite(lo) else "value"
    span += f" <= {hi:g}" if math.isfinite(hi) else ""

    def check(value: float) -> float:
        if value < lo or value > hi or (open_lo and value == lo) or not math.isfinite(value):
            raise ValueError(f"out of range; allowed: {span} [{unit}]{'; ' + hint if hint else ''}")
        return value

    return Annotated[float, AfterValidator(check)]


def _name(value: str) -> str:
    if not NAME.fullmatch(value):
        raise ValueError("not a name; allowed: a letter, then up to 31 letters, digits or underscores")
    return value


Name = Annotated[str, AfterValidator(_name)]


def _array(columns: int, unit: str) -> Callable[[Any], np.ndarray]:
    def convert(value: Any) -> np.ndarray:
        try:
            array = np.array(value, dtype=np.float64, order="C")
        except (TypeError, ValueError):
            raise ValueError(f"must be numbers [{unit}]") from None
        if columns and array.shape == (0,):
            array = array.reshape(0, columns)
        if array.ndim != (2 if columns else 1) or (columns and array.shape[1] != columns):
            shape = f"(n, {columns})" if columns else "(n,)"
            raise ValueError(f"has shape {array.shape}; must be {shape} [{unit}]")
        if not np.isfinite(array).all():
            raise ValueError(f"row {int(np.argwhere(~np.isfinite(array))[0][0])} is not a finite number [{unit}]")
        array.setflags(write=False)
        return array

    return convert


def array(columns: int, unit: str) -> Any:
    """A read-only float64 array, shape (n, columns), or (n,) for columns = 0."""
    return Annotated[np.ndarray, BeforeValidator(_array(columns, unit)), PlainSerializer(lambda a: a.tolist())]


def vector(unit: str) -> Any:
    """Three floats with a unit."""

    def check(value: tuple[float, float, float]) -> tuple[float, float, float]:
        if not all(map(math.isfinite, value)):
            raise ValueError(f"must be three finite numbers [{unit}]")
        return value

    return Annotated[tuple[float, float, float], AfterValidator(check)]
