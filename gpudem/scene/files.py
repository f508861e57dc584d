"""Scene files in, scene errors out: TOML and JSON readers, pydantic's findings in a user's words."""

from __future__ import annotations

import dataclasses
import difflib
import json
import tomllib
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, TypeVar

import numpy as np
from pydantic import BaseModel, TypeAdapter, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import to_json

from gpudem.errors import SceneError

AnyModel = TypeVar("AnyModel", bound=BaseModel)


@dataclasses.dataclass(frozen=True)
class OneOf:
    """Metadata of a field that takes one of several sections, found when asked for: name -> class."""

    sections: Callable[[], Mapping[str, type[BaseModel]]]


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of a scene file, paths counted from its folder. Raises SceneError."""
    try:
        data = tomllib.loads(_text(path))
    except (ValueError, RecursionError) as error:  # TOMLDecodeError, an integer of thousands of digits
        raise SceneError(str(path), [f"not TOML: {error}"]) from None
    count_paths_from(data, path.parent)
    return data


def read_json(path: Path) -> dict[str, Any]:
    """The object of a scene.json, paths counted from its folder. Raises SceneError."""
    data = parse_json(_text(path), str(path))
    count_paths_from(data, path.parent)
    return data


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise SceneError(str(path), ["no such file"]) from None
    except UnicodeDecodeError as error:
        raise SceneError(str(path), [f"not a text file: byte {error.start} is not UTF-8"]) from None
    except OSError as error:
        raise SceneError(str(path), [f"cannot be read: {error.strerror}"]) from None


def count_paths_from(data: dict[str, Any], folder: Path) -> None:
    """Let the relative paths of files that a statement names count from a folder."""
    places = [(data.get("particles"), "path")]
    for sections, key in (("walls", "file"), ("insert", "path")):
        stated = data.get(sections)
        places += [(section, key) for section in (stated if isinstance(stated, list) else [])]
    grouped = data.get("groups")
    within = [section for section, key in places if key == "path"] + (
        grouped if isinstance(grouped, list) else []
    )
    within = [section for section in within if isinstance(section, dict)]
    places += [(region, "file") for section in within for region in _regions(section.get("region"))]
    for section, key in places:
        if isinstance(section, dict) and isinstance(section.get(key), str):
            section[key] = str(folder / section[key])


def _regions(stated: Any) -> Iterator[dict[str, Any]]:
    """The tables of a region and of those that it is made of."""
    for one in stated if isinstance(stated, list) else [stated]:
        if isinstance(one, dict):
            yield one
            for key in ("parts", "part", "without"):
                yield from _regions(one.get(key))


def parse_json(text: str, source: str) -> dict[str, Any]:
    """The object in a JSON text. Raises SceneError."""
    try:
        data = json.loads(text)
    except (ValueError, RecursionError) as error:  # also an integer of thousands of digits
        raise SceneError(source, [f"not JSON: {error}"]) from None
    if not isinstance(data, dict):
        raise SceneError(source, [f"a scene is a JSON object, not {type(data).__name__}"])
    return data


def json_text(data: dict[str, Any]) -> str:
    """A scene as JSON, indented, with arrays one row a line: a tenth of the time of one number a line.

    Floats are written so that they are read back to the last bit.
    """
    parts: list[str] = []
    for key, value in data.items():
        compact = {}
        if key == "particles" and value:
            compact = {k: v for k, v in value.items() if isinstance(v, np.ndarray) or k == "material"}
            value = value | {k: f"@{k}" for k in compact}  # no name and no absolute path begins with @
        elif key in ("walls", "insert", "groups"):
            items = [(f"{i}.{k}", v) for i, wall in enumerate(value) for k, v in wall.items()]
            compact = {name: v for name, v in items if isinstance(v, np.ndarray)}
            marks = [{k: f"@{i}.{k}" for k in w if f"{i}.{k}" in compact} for i, w in enumerate(value)]
            value = [wall | own for wall, own in zip(value, marks, strict=True)]
        text = json.dumps(value, indent=1, default=np.ndarray.tolist).replace("\n", "\n ")
        parts.append(f",\n {json.dumps(key)}: " if parts else f"{{\n {json.dumps(key)}: ")
        for name, values in compact.items():  # in the order of the text
            before, text = text.split(f'"@{name}"')
            values = values.tolist() if isinstance(values, np.ndarray) else values
            parts += [before, to_json(values).replace(b"],[", b"],\n   [").decode()]
        parts.append(text)
    return "".join([*parts, "\n}"])


def take_auto_step(data: dict[str, Any]) -> tuple[bool, dict[str, Any]]:
    """(whether time.step is "auto", the data with the duration in its place until it is resolved)."""
    time = data.get("time")
    step = time.get("step") if isinstance(time, dict) else None
    if not isinstance(time, dict) or not isinstance(step, str) or step != "auto":
        return False, data
    return True, {**data, "time": {**time, "step": time.get("duration", 1.0)}}


def problems(error: ValidationError, model: type[BaseModel]) -> list[str]:
    """One line for each finding: key, value, problem, what is allowed."""
    found = error.errors(include_url=False)
    # a list whose only entry is bad is not also too short
    inner = {item["loc"][:k] for item in found for k in range(len(item["loc"]))}
    found = [item for item in found if item["type"] != "too_short" or item["loc"] not in inner]
    return list(dict.fromkeys(_line(item, model) for item in found))


def partial(model: type[AnyModel], data: dict[str, Any]) -> tuple[AnyModel, set[str]]:
    """The sections of an invalid statement that are valid by themselves, and the names of those that are not.

    Lets checks across sections run on what is left, so that a user sees all problems at once.
    """
    valid, invalid = {}, set()
    for key, field in model.model_fields.items():
        try:
            if key in data or field.is_required():
                section: Any = Annotated[field.annotation, field]  # pyright: ignore[reportInvalidTypeForm]
                valid[key] = TypeAdapter(section).validate_python(data[key])
        except (KeyError, ValidationError):
            invalid.add(key)
    return model.model_construct(**valid), invalid


#: Kinds of pydantic errors about the type of a value -> message.
_KINDS = {
    "dict_type": "must be a table",
    "list_type": "must be a list",
    "tuple_type": "must be a list",
    "string_type": "must be text in quotes",
    "bool_type": "must be true or false",
    "int_type": "must be a whole number",
}


def _line(item: Any, model: type[BaseModel]) -> str:
    loc, context = tuple(p for p in item["loc"] if not str(p).startswith("<")), item.get("ctx", {})
    key, value = _location(loc), _short(item["input"])
    match item["type"]:
        case "extra_forbidden":
            known = [name for name in _fields(loc[:-1], model) if name != loc[-1]]  # another kind may have it
            return f"{key}: unknown key{nearest(loc[-1], known)}"
        case "missing":
            field = _fields(loc[:-1], model).get(loc[-1])
            unit = next((m.unit for m in field.metadata if hasattr(m, "unit")), "") if field else ""
            return f"{key}: missing{f' [{unit}]' if unit else ''}"
        case "union_tag_not_found":
            known = _tags(loc, model)
            return f"{key}.{context['discriminator'].strip(chr(39))}: missing; one of: {', '.join(known)}"
        case "union_tag_invalid":
            tag = context["discriminator"].strip("'")
            return f"{key}.{tag} = {context['tag']!r}: unknown{nearest(context['tag'], _tags(loc, model))}"
        case "literal_error":
            return f"{key} = {value}: unknown{nearest(item['input'], _words(context['expected']))}"
        case "model_type" | "model_attributes_type":
            needed = ", ".join(name for name, field in _fields(loc, model).items() if field.is_required())
            return f"{key} = {value}: must be a table{f' with {needed}' if needed else ''}"
        case "value_error" if isinstance(item["input"], dict | BaseModel):  # of a section as a whole
            message = item["msg"].removeprefix("Value error, ")
            return f"{key}.{message}" if loc else message
        case kind:
            message = _KINDS.get(
                kind, item["msg"].removeprefix("Value error, ").replace("Input should", "must")
            )
            return f"{key} = {value}: {message}"


def _words(expected: str) -> list[str]:
    """'a', 'b' or 'c' -> a, b, c."""
    return expected.replace(" or ", ", ").replace("'", "").split(", ")


def _location(loc: tuple[Any, ...]) -> str:
    """particles.radius, walls[2].name, ... without what pydantic adds: the tag of a union's member, [key]."""
    text = ""
    for i, part in enumerate(loc):
        tag = (i == 1 and loc[0] == "particles") or (i > 1 and loc[i - 2] == "motion")
        if isinstance(part, int):
            text += f"[{part}]"
        elif not tag and part != "[key]":
            text += f".{part}" if text else part
    return text or "scene"


def nearest(word: Any, known: Iterable[str]) -> str:
    """The end of a message about an unknown word: the known one nearest to it, or all that are known."""
    known = list(known)
    close = difflib.get_close_matches(str(word), known, n=1, cutoff=0.5)
    return f"; did you mean {close[0]!r}?" if close else f"; known: {', '.join(known)}"


def _fields(loc: tuple[Any, ...], model: type[BaseModel]) -> dict[Any, FieldInfo]:
    """The fields of the section that a location points to; of a union's members, those of the tag named."""
    return {key: field for m in _sections(loc, model) for key, field in m.model_fields.items()}


def _sections(loc: tuple[Any, ...], model: type[BaseModel]) -> list[type[BaseModel]]:
    """The sections that a location may point to; of a union's members, that of the tag named."""
    models = [model]
    for part in loc:
        if isinstance(part, int):  # of a list of sections, or of one section beside it, such as a mixture
            models = [m for m in models if m.model_fields and not _tag(m)] or models
            continue
        tagged = [m for m in models if part in (_own_tag(m) or _tag(m))]
        fields = [x.model_fields[part] for x in models if part in x.model_fields]
        inner = [m for field in fields for item in (field.annotation, *field.metadata) for m in _models(item)]
        models = tagged or inner or models
    return models


def _tags(loc: tuple[Any, ...], model: type[BaseModel]) -> list[str]:
    return list(dict.fromkeys(tag for m in _sections(loc, model) for tag in _tag(m)))


def _tag(model: type[BaseModel]) -> tuple[str, ...]:
    """What a section of a union states as its source, kind or type."""
    field = next(
        (model.model_fields[key] for key in ("source", "kind", "type") if key in model.model_fields), None
    )
    return typing.get_args(field.annotation) if field else ()


def _own_tag(model: type[BaseModel]) -> tuple[str, ...]:
    """The tag by which pydantic tells it from another section of the same type."""
    tag = getattr(model, "tag", None)
    return (tag,) if isinstance(tag, str) else ()


def _models(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    if isinstance(annotation, OneOf):
        return list(annotation.sections().values())
    return [m for a in typing.get_args(annotation) for m in _models(a)]


def _short(value: Any) -> str:
    try:
        text = " ".join(repr(value.item() if isinstance(value, np.generic) else value).split())
    except ValueError:  # an integer of thousands of digits
        return "..."
    return text if len(text) <= 60 else text[:57] + "..."
