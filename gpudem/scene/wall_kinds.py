"""The kinds of walls by name: how the section of one is found, and the field type of `[[walls]]`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from pydantic import PlainValidator, SerializeAsAny, TypeAdapter
from pydantic_core import PydanticCustomError

from gpudem.scene.files import OneOf
from gpudem.scene.mesh import Mesh
from gpudem.scene.round_walls import Cone, Cylinder
from gpudem.scene.types import Model
from gpudem.scene.walls import Box, Plane, Wall
from gpudem.walls import registry

#: The section class of each kind that comes with gpudem.
BUILT_IN: dict[str, type[Wall]] = {
    section.model_fields["kind"].default: section for section in (Plane, Box, Cylinder, Cone, Mesh)
}


def wall_sections() -> dict[str, type[Wall]]:
    """The section class of every kind of wall, those of other packages last."""
    return BUILT_IN | registry.sections()


def _wall_section(value: Any) -> Any:
    """A wall as the section of its kind, which validates it."""
    if isinstance(value, Wall):
        return value
    if not isinstance(value, dict):
        raise ValueError("must be a table")
    if "kind" not in value:
        raise PydanticCustomError("union_tag_not_found", "no kind", {"discriminator": "'kind'"})
    kind = value["kind"]
    section = BUILT_IN.get(kind) if isinstance(kind, str) else None
    section = section or wall_sections().get(str(kind))
    if section is None:
        raise PydanticCustomError(
            "union_tag_invalid", "unknown kind", {"discriminator": "'kind'", "tag": str(kind)}
        )
    return TypeAdapter(section).validate_python(value)


if TYPE_CHECKING:
    WallSection = Wall
else:
    WallSection = Annotated[SerializeAsAny[Model], PlainValidator(_wall_section), OneOf(wall_sections)]
