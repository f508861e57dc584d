"""Scene files in, scene errors out: TOML and JSON readers, pydantic's findings in a user's words."""

from __future__ import annotations

import difflib
import json
import tomllib
import types
import typing
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from gpudem.errors import SceneError


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of a scene file, particle paths made absolute. Raises SceneError."""
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise SceneError(str(path), ["no such file"]) from None
    except (OSError, UnicodeDecodeError) as error:
        raise SceneError(str(path), [f"cannot be read: {error}"]) from None
    except tomllib.TOMLDecodeError as error:
        raise SceneError(str(path), [f"not TOML: {error}"]) from None
    particles = data.get("particles")
    if isinstance(particles, dict) and isinstance(particles.get("path"), str):
        particles["path"] = str(path.parent / particles["path"])
    return data


def parse_json(text: str, source: str) -> dict[str, Any]:
    """The object in a JSON text. Raises SceneError."""
    try:
        data = json.loads(text)
    except json.JSONDecodeError as error:
        raise SceneError(source, [f"not JSON: {error}"]) from None
    if not isinstance(data, dict):
        raise SceneError(source, [f"a scene is a JSON object, not {type(data).__name__}"])
    return data


def problems(error: ValidationError, model: type[BaseModel]) -> list[str]:
    """One line for each finding: key, value, what is wrong, what is allowed."""
    lines = []
    for item in error.errors(include_url=False, include_context=True):
        location = _location(item["loc"])
        if item["type"] == "extra_forbidden":
            lines.append(f"{location}: unknown key{_nearest(item['loc'], model)}")
        elif item["type"] == "missing":
            lines.append(f"{location}: missing")
        else:
            message = item["msg"].removeprefix("Value error, ")
            lines.append(f"{location} = {_short(item['input'])}: {message}")
    return list(dict.fromkeys(lines))


#: Tags that pydantic puts into a location for a member of a union; the user wrote none of them.
_TAGS = {"explicit", "file", "lattice", "plane", "box", "[key]"}


def _location(parts: tuple[Any, ...]) -> str:
    text = ""
    for part in parts:
        if isinstance(part, int):
            text += f"[{part}]"
        elif part not in _TAGS and not any(mark in part for mark in ("function-", "constrained-", "list[", "float")):
            text += f".{part}" if text else part
    return text or "scene"


def _nearest(loc: tuple[Any, ...], model: type[BaseModel]) -> str:
    """`, did you mean ...` from the keys of the model that the unknown key stands in."""
    known = _known_keys(loc[:-1], model)
    close = difflib.get_close_matches(str(loc[-1]), known, n=1, cutoff=0.5)
    return f"; did you mean {close[0]!r}?" if close else f"; known: {', '.join(known)}"


def _known_keys(path: tuple[Any, ...], model: type[BaseModel]) -> list[str]:
    models = [model]
    for part in path:
        if isinstance(part, str) and part in _TAGS:
            tagged = [m for m in models if _tag(m) == part]
            models = tagged or models
        elif isinstance(part, str):
            inner = [m for x in models if part in x.model_fields for m in _models(x.model_fields[part].annotation)]
            models = inner or models
    return [key for m in models for key in m.model_fields]


def _tag(model: type[BaseModel]) -> str | None:
    for name in ("source", "kind"):
        if name in model.model_fields:
            return typing.get_args(model.model_fields[name].annotation)[0]
    return None


def _models(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and not isinstance(annotation, types.GenericAlias):
        return [annotation] if issubclass(annotation, BaseModel) else []
    return [m for a in typing.get_args(annotation) for m in _models(a)]


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
