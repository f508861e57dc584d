"""Validated field types of a scene: numbers with their unit and range, vectors, arrays, names.

    young: Annotated[float, positive("Pa")]

NumPy scalars and arrays without dimensions count as the numbers, whole numbers and booleans they hold; text
and booleans are never taken for numbers.
"""

from __future__ import annotations

import dataclasses
import math
import numbers
import re
from collections.abc import Callable
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    StrictBool,
    TypeAdapter,
    ValidationError,
)
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from gpudem.contact import registry
from gpudem.errors import SceneError
from gpudem.scene.files import nearest, problems

#: Names travel into file names and LIGGGHTS decks (which can run shell commands): letters, digits, _ only.
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,31}")

#: Largest magnitude of a number, and smallest of one that must be above zero, in SI units: products of a few
#: of them, and the number of steps of a run, are still within the range of floating-point numbers.
LARGEST, SMALLEST = 1e18, 1e-18

#: With the limit and the unit.
_TOO_LARGE = "too large for the arithmetic; allowed: <= {:g} [{}]"
_TOO_SMALL = "too small for the arithmetic; allowed: >= {:g} [{}]"

Vector = tuple[float, float, float]

#: Sides of a box across x, y and z, at its lower and at its upper end.
Side = Literal["xlo", "xhi", "ylo", "yhi", "zlo", "zhi"]


class Model(BaseModel):
    """Base of the scene classes: frozen, no unknown keys, values validated.

    Raises:
        SceneError: listing every problem.
    """

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        arbitrary_types_allowed=True,
        protected_namespaces=(),
        use_attribute_docstrings=True,
    )

    def __init__(self, /, **data: Any):
        try:
            super().__init__(**data)
        except ValidationError as error:
            raise SceneError(type(self).__name__, problems(error, type(self))) from None

    def __eq__(self, other: object) -> bool:
        """Of the same class with equal fields, arrays by their elements; what is derived does not count."""
        if type(other) is not type(self):
            return NotImplemented
        return all(_same(getattr(self, name), getattr(other, name)) for name in type(self).model_fields)

    def model_copy(self, **options: Any) -> Self:
        """Pydantic's copy, not validated; without what has been derived from the original."""
        copied = super().model_copy(**options)
        for name in set(vars(copied)) - set(type(self).model_fields):
            vars(copied).pop(name)
        return copied

    # Tells pydantic to build nested sections without this __init__, so that one error lists all problems.
    setattr(__init__, "__pydantic_base_init__", True)  # noqa: B010


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return isinstance(a, np.ndarray) and isinstance(b, np.ndarray) and np.array_equal(a, b)
    if isinstance(a, list | tuple) and isinstance(b, list | tuple):
        return len(a) == len(b) and all(map(_same, a, b))
    return a == b


class _Plain:
    """A field type that is one function, written in lower case since it reads as one in an annotation."""

    def check(self, value: Any) -> Any:
        """What the user wrote as the field's value. Raises ValueError saying what is allowed."""
        raise NotImplementedError

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(
            self.check,
            serialization=core_schema.plain_serializer_function_ser_schema(_as_list, when_used="json"),
        )


def _as_list(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray) else value


def as_python(value: Any) -> Any:
    """A NumPy scalar, or an array without dimensions, as the Python object it holds; all else as it is."""
    scalar = isinstance(value, np.generic) or (isinstance(value, np.ndarray) and value.ndim == 0)
    return value.item() if scalar else value


def _as_list_of_python(value: Any) -> Any:
    """A list, tuple or array with its NumPy scalars as Python objects."""
    value = value.tolist() if isinstance(value, np.ndarray) else value
    return type(value)(map(as_python, value)) if type(value) in (list, tuple) else value


#: A boolean; 0 and 1 are not.
Flag = Annotated[StrictBool, BeforeValidator(as_python)]

#: One boolean for each of x, y, z.
Flags = Annotated[tuple[StrictBool, StrictBool, StrictBool], BeforeValidator(_as_list_of_python)]


def _float(value: Any, unit: str) -> float:
    """A real number as a float. Raises ValueError: not a real number, or beyond any float."""
    value = as_python(value)
    if not isinstance(value, numbers.Real) or isinstance(value, bool):
        raise ValueError(f"must be a number [{unit}]")
    try:
        return float(value)
    except OverflowError:  # an integer of hundreds of digits
        return math.inf if value > 0 else -math.inf  # type: ignore[operator]


@dataclasses.dataclass(frozen=True)
class number(_Plain):
    """A float with its unit and allowed range lo..hi (`open_lo`: lo itself is not allowed)."""

    unit: str
    lo: float = -math.inf
    hi: float = math.inf
    open_lo: bool = False

    def check(self, value: Any) -> float:  # noqa: D102
        result = _float(value, self.unit)
        if (
            not math.isfinite(result)
            or not self.lo <= result <= self.hi
            or (self.open_lo and result == self.lo)
        ):
            raise ValueError(f"out of range; allowed: {self.span} [{self.unit}]")
        if abs(result) > LARGEST:
            raise ValueError(_TOO_LARGE.format(LARGEST, self.unit))
        if self.open_lo and result < SMALLEST:
            raise ValueError(_TOO_SMALL.format(SMALLEST, self.unit))
        return result

    @property
    def span(self) -> str:
        """The allowed range in words: `0 < value <= 1`."""
        left = f"{self.lo:g} {'<' if self.open_lo else '<='} " if math.isfinite(self.lo) else ""
        right = f" <= {self.hi:g}" if math.isfinite(self.hi) else ""
        return f"{left}value{right}" if left or right else "finite numbers"


def positive(unit: str, hi: float = math.inf) -> number:
    """A float above zero, at most `hi`."""
    return number(unit, 0, hi, open_lo=True)


@dataclasses.dataclass(frozen=True)
class vector(_Plain):
    """Three floats with a unit; `nonzero`: not all of them zero."""

    unit: str
    nonzero: bool = False

    def check(self, value: Any) -> Vector:  # noqa: D102
        values = value.tolist() if isinstance(value, np.ndarray) else value
        if not isinstance(values, list | tuple) or len(values) != 3:
            raise ValueError(f"must be three numbers [{self.unit}]")
        try:
            x, y, z = (_float(v, self.unit) for v in values)
        except ValueError:
            raise ValueError(f"must be three numbers [{self.unit}]") from None
        if not all(map(math.isfinite, (x, y, z))):
            raise ValueError(f"must be three finite numbers [{self.unit}]")
        size = max(abs(x), abs(y), abs(z))
        if size > LARGEST:
            raise ValueError(_TOO_LARGE.format(LARGEST, self.unit))
        if self.nonzero and size < SMALLEST:
            raise ValueError(f"has no direction; allowed: any length >= {SMALLEST:g}")
        return x, y, z


@dataclasses.dataclass(frozen=True)
class span(_Plain):
    """[from] or [from, until], two numbers that rise from at least 0."""

    unit: str

    def check(self, value: Any) -> tuple[float, ...]:  # noqa: D102
        values = value.tolist() if isinstance(value, np.ndarray) else value
        if not isinstance(values, list | tuple) or len(values) not in (1, 2):
            raise ValueError(f"must be [from] or [from, until] [{self.unit}]")
        found = tuple(number(self.unit, 0).check(v) for v in values)
        if len(found) == 2 and not found[0] < found[1]:
            raise ValueError(f"must rise: from < until [{self.unit}]")
        return found


@dataclasses.dataclass(frozen=True)
class array(_Plain):
    """A read-only float64 array, shape (n, columns), or (n,) for columns = 0."""

    columns: int
    unit: str

    def check(self, value: Any) -> np.ndarray:  # noqa: D102
        shape = f"(n, {self.columns})" if self.columns else "(n,)"
        try:
            raw = np.asarray(value)
        except ValueError:
            raise ValueError(f"has rows of different length; must be {shape} [{self.unit}]") from None
        if (raw.size and raw.dtype.kind not in "iuf") or np.ma.is_masked(value):
            raise ValueError(f"must be numbers, shape {shape} [{self.unit}]")
        with np.errstate(over="ignore"):  # of long doubles: to infinity, found below
            result = np.array(raw, dtype=np.float64, order="C")
        if self.columns and result.shape == (0,):
            result = result.reshape(0, self.columns)
        if result.ndim != (2 if self.columns else 1) or (self.columns and result.shape[1] != self.columns):
            raise ValueError(f"has shape {result.shape}; must be {shape} [{self.unit}]")
        within = np.abs(result) <= LARGEST  # false for NaN
        if not within.all():
            row = int(np.argwhere(~within)[0][0])
            if not np.isfinite(result[row]).all():
                raise ValueError(f"row {row + 1} is not a finite number [{self.unit}]")
            raise ValueError(f"row {row + 1} is {_TOO_LARGE.format(LARGEST, self.unit)}")
        result.setflags(write=False)
        return result


@dataclasses.dataclass(frozen=True)
class indices(_Plain):
    """A read-only int64 array of row numbers from 0, shape (n, columns); whole numbers only."""

    columns: int

    def check(self, value: Any) -> np.ndarray:  # noqa: D102
        rule = f"must be whole numbers from 0, shape (n, {self.columns})"
        raw = array(self.columns, "1").check(value)
        bad = ((raw < 0) | (raw != np.floor(raw)) | (raw >= 2**53)).any(axis=1)
        if bad.any():
            row = int(np.argmax(bad))
            raise ValueError(f"row {row + 1} is {raw[row].tolist()}; {rule}")
        result = raw.astype(np.int64)
        result.setflags(write=False)
        return result


@dataclasses.dataclass(frozen=True)
class each(_Plain):
    """One number for all, or an array (n,) with one for each; both within the range of `of`."""

    of: number

    @property
    def unit(self) -> str:
        """Unit of the numbers."""
        return self.of.unit

    def check(self, value: Any) -> float | np.ndarray:  # noqa: D102
        if not isinstance(value, list | tuple | np.ndarray) or (
            isinstance(value, np.ndarray) and value.ndim == 0
        ):
            return self.of.check(value)
        result = array(0, self.unit).check(value)
        least = max(self.of.lo, SMALLEST) if self.of.open_lo else self.of.lo
        bad = (result < least) | (result > self.of.hi)
        if bad.any():
            row = int(np.argmax(bad))
            try:
                self.of.check(result[row])
            except ValueError as error:
                raise ValueError(f"row {row + 1} = {result[row]:g} {error}") from None
        return result


def _name(value: str) -> str:
    if not NAME.fullmatch(value):
        raise ValueError("not a name; allowed: a letter, then up to 31 letters, digits or underscores")
    return value


Name = Annotated[str, AfterValidator(_name)]


class names(_Plain):
    """One name for all, or a list with one for each."""

    def check(self, value: Any) -> str | tuple[str, ...]:  # noqa: D102
        value = value.tolist() if isinstance(value, np.ndarray) else value
        if isinstance(value, str):
            return str(_name(value))
        if not isinstance(value, list | tuple) or not all(isinstance(v, str) for v in value):
            raise ValueError("must be a name, or a list of names")
        known = {name: str(_name(name)) for name in set(value)}
        return tuple(known[name] for name in value)


class law_name(_Plain):
    """The name of a contact law of one slot."""

    def __init__(self, slot: str):
        self.slot = slot

    def check(self, value: Any) -> str:  # noqa: D102
        if not isinstance(value, str):
            raise ValueError("must be text in quotes")
        if value != registry.OFF or self.slot == "normal":
            if registry.find(self.slot, value) is None:
                raise ValueError(f"unknown{nearest(value, registry.names(self.slot))}")
        return value


def of_kind(find: Callable[[str], type[Model] | None], base: type[Model]) -> Callable[[Any], Model]:
    """A validator: a section stated as a table becomes one of the class that its key `kind` names."""

    def check(value: Any) -> Model:
        if isinstance(value, base):
            return value
        if not isinstance(value, dict):
            raise ValueError("must be a table")
        if "kind" not in value:
            raise PydanticCustomError("union_tag_not_found", "no kind", {"discriminator": "'kind'"})
        section = find(str(value["kind"]))
        if section is None:
            raise PydanticCustomError(
                "union_tag_invalid", "unknown kind", {"discriminator": "'kind'", "tag": str(value["kind"])}
            )
        return TypeAdapter(section).validate_python(value)

    return check
