"""Groups of particles in the words of a deck."""

from __future__ import annotations

import dataclasses

import numpy as np

from gpudem.scene import Scene

#: Most groups of a deck: LIGGGHTS has 32, `all` and three of ours among them.
MOST = 28


@dataclasses.dataclass(frozen=True)
class GroupWords:
    """One group; its name in the deck is group_NAME."""

    name: str
    members: tuple[str, ...]
    """The ends of its `group` commands."""


def groups(scene: Scene) -> list[GroupWords]:
    """Every group in order of statement."""
    return [GroupWords(group.name, _members(group.rows(scene) + 1)) for group in scene.groups]


def _members(ids: np.ndarray) -> tuple[str, ...]:
    """Ascending ids as spans of consecutive ones."""
    spans = np.split(ids, np.flatnonzero(np.diff(ids) != 1) + 1)  # mutate: spans_of_ids
    return tuple(f"id <> {span[0]} {span[-1]}" for span in spans)
