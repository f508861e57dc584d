"""What a scene takes of the memory of its device: bytes of every array, and bytes a particle by purpose."""

from __future__ import annotations

from typing import Any

import warp as wp

#: Purpose -> how the names of its arrays begin; what is in none of them is "other".
PURPOSES = {
    "bodies, before and after a step": ("now.", "next."),
    "positions at the last rebuild": ("particles.x_at_rebuild",),
    "list, old and new": ("particles.neighbor", "list.neighbor"),
    "histories of contacts, old and new": tuple(
        f"{owner}.{name}" for owner in ("particles", "list") for name in ("spring", "rolling_torque", "rise")
    ),
    "first entries and lengths of the lists": tuple(
        f"{owner}.{name}"
        for owner in ("particles", "list")
        for name in ("start", "count", "width", "wall_start")
    ),
    "sort and count": ("list.key", "list.order", "list.cache"),
    "cells": ("list.cell_start",),
    "id, radius, material, ..., old and new": tuple(
        f"{owner}.{name}"
        for owner in ("particles", "list")
        for name in ("id", "radius", "mass", "material", "held", "origin", "image")
    ),
    "sums of half lists": ("particles.partial_force", "particles.partial_torque"),
    "output of a step": ("output.",),
}


def array_bytes(state: Any, neighbors: Any) -> dict[str, int]:
    """Bytes of every device array of a `State` and its `NeighborList`, by name; of structs, by field."""
    own = {name: value for name, value in vars(neighbors).items() if isinstance(value, wp.array)}
    own |= {name: getattr(neighbors.scratch, name) for name in neighbors.permuted_arrays}
    arrays = state.arrays() | {f"list.{name}": array for name, array in own.items()}
    # a slice is memory of the array that it is a part of
    whole = {name: array for name, array in arrays.items() if not isinstance(array._ref, wp.array)}
    found = {}
    for name, array in whole.items():
        fields = getattr(array.dtype, "vars", {})
        for field, var in fields.items():
            found[f"{name}.{field}"] = array.size * wp.types.type_size_in_bytes(var.type)
        if not fields:
            found[name] = array.size * wp.types.type_size_in_bytes(array.dtype)
    return found


def bytes_by_purpose(sizes: dict[str, int], particles: int) -> dict[str, float]:
    """What `array_bytes` gave, as bytes a particle by purpose; what a scene does not need is left out."""
    found = dict.fromkeys((*PURPOSES, "other"), 0.0)
    for name, size in sizes.items():
        purpose = next((p for p, begins in PURPOSES.items() if name.startswith(begins)), "other")
        found[purpose] += size / particles
    return {purpose: size for purpose, size in found.items() if size}
