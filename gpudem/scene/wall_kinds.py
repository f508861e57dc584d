"""The kinds of walls by name: how the section of one is found, and the field type of `[[walls]]`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from pydantic import PlainValidator, SerializeAsAny

from gpudem.scene.files import OneOf
from gpudem.scene.mesh import Mesh
from gpudem.scene.round_walls import Cone, Cylinder
from gpudem.scene.types import Model, of_kind
from gpudem.scene.walls import Box, Plane, Wall
from gpudem.walls import registry

#: The section class of each kind that comes with gpudem.
BUILT_IN: dict[str, type[Wall]] = {
    section.model_fields["kind"].default: section for section in (Plane, Box, Cylinder, Cone, Mesh)
}


def wall_sections() -> dict[str, type[Wall]]:
    """The section class of every kind of wall, those of other packages last."""
    return BUILT_IN | registry.sections()


def _find(kind: str) -> type[Wall] | None:
    """The section class of a kind; other packages are loaded only for kinds of theirs."""
    return BUILT_IN.get(kind) or wall_sections().get(kind)


if TYPE_CHECKING:
    WallSection = Wall
else:
    WallSection = Annotated[SerializeAsAny[Model], PlainValidator(of_kind(_find, Wall)), OneOf(wall_sections)]
