"""Which contact laws act where in a scene: between particles, and at walls that state a law of their own."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

from gpudem.contact import registry
from gpudem.contact.law import PairInputs
from gpudem.contact.names import LawNames

if TYPE_CHECKING:
    from gpudem.scene.model import Scene
    from gpudem.scene.walls import Wall


def stated_laws(scene: Scene, wall: Wall | None = None) -> LawNames:
    """The laws that a scene states between particles (None) or at a wall."""
    own = getattr(wall, "contact", None)
    return LawNames(
        *((own and getattr(own, slot)) or getattr(scene.contact, slot) for slot in registry.SLOTS)
    )


def contact_groups(scene: Scene) -> dict[LawNames, list[PairInputs]]:
    """Laws as stated -> the kinds of contacts that have them; the first are those of `[contact]`."""
    usual, ours = stated_laws(scene), set(scene.particle_materials)
    plain, own = set(ours), {}
    for wall in (wall for at in scene.phase_scenes for wall in at.walls):
        names = stated_laws(scene, wall)
        if names == usual:
            plain.add(wall.material)
        else:
            own.setdefault(names, set()).add(wall.material)
    found = {usual: _meetings(scene, ours, plain)}
    return found | {names: _meetings(scene, ours, partners) for names, partners in own.items()}


def _meetings(scene: Scene, ours: Collection[str], partners: Collection[str]) -> list[PairInputs]:
    """Inputs, in every phase, of the stated pairs of a material of particles and a partner."""
    pairs = (pair for pair in scene.contact_pairs if _meet(pair.materials, ours, partners))
    return [at.inputs(*pair.materials) for pair in pairs for at in scene.phase_scenes]


def _meet(materials: tuple[str, str], ours: Collection[str], partners: Collection[str]) -> bool:
    a, b = materials
    return (a in ours and b in partners) or (b in ours and a in partners)


def acting(names: LawNames, inputs: Collection[PairInputs]) -> LawNames:
    """Of stated laws those that act in a contact: a slot that acts in none of its pairs is empty."""
    shear, roll = registry.find("tangential", names.tangential), registry.find("rolling", names.rolling)
    pull = registry.find("cohesion", names.cohesion)
    # mutate: needs_tangential
    tangential = shear is not None and any(shear.acts(pair) for pair in inputs)
    # mutate: needs_rolling
    rolling = roll is not None and any(roll.acts(pair) for pair in inputs)
    # mutate: needs_cohesion
    cohesion = pull is not None and any(pull.acts(pair) for pair in inputs)
    return LawNames(
        names.normal,
        names.tangential if tangential else registry.OFF,
        names.rolling if rolling else registry.OFF,
        names.cohesion if cohesion else registry.OFF,
    )
