"""The contact law of a scene in LIGGGHTS' words: model, switches, and the properties they read."""

from __future__ import annotations

from collections.abc import Callable

from gpudem.contact import registry
from gpudem.contact.law import Law, LiggghtsWords
from gpudem.contact.names import LawNames
from gpudem.scene import Pair, Scene
from gpudem.scene.laws import stated_laws
from gpudem.scene.walls import Wall


def words_of(law: Law) -> LiggghtsWords:
    """A law's words; `limits.check` has refused a scene whose law has none."""
    assert law.liggghts is not None
    return law.liggghts


def model(scene: Scene, wall: Wall | None = None) -> str:
    """The words between `model` and the switches, of `pair_style gran` (None) or of a wall.

    Without friction: `no_history` with mu = 0, which is zero tangential force, bit for bit the same as no
    tangential model, but compiled in (a quarter faster). `history` with mu = 0 would not do: at each set-up
    LIGGGHTS applies its tangential dashpot without regard to mu. A slot that is not named is off: so it is
    where the pairs do have friction and the law of their contacts is "off".
    """
    names = laws_of(scene, wall)
    words, tangential = [words_of(names.normal_law).word], names.tangential
    if tangential == registry.OFF and not (scene.needs.tangential and _friction(scene, wall)):
        tangential = "no_history"
    if tangential != registry.OFF:
        words += ["tangential", words_of(registry.law("tangential", tangential)).word]
    if names.cohesion != registry.OFF:  # LIGGGHTS wants it before the rolling friction
        words += ["cohesion", words_of(registry.law("cohesion", names.cohesion)).word]
    if names.rolling != registry.OFF:
        words += ["rolling_friction", words_of(registry.law("rolling", names.rolling)).word]
    return " ".join(words)


def laws_of(scene: Scene, wall: Wall | None) -> LawNames:
    """The laws that act between particles, or at a wall."""
    return scene.acting_laws if wall is None else scene.wall_laws.get(wall.name, scene.acting_laws)


def _friction(scene: Scene, wall: Wall | None) -> bool:
    """Whether a pair has friction whose contacts have the laws of particles, or those of a wall."""
    return any(pair.pair.friction > 0 for pair in scene.contact_groups[stated_laws(scene, wall)])


def switches(scene: Scene, wall: Wall | None = None) -> str:
    """Settings of the contact model; on a wall they must come after the `primitive` words."""
    words = ["limitForce on"] if scene.contact.limit_force else []
    if laws_of(scene, wall).tangential != registry.OFF and not scene.contact.tangential_damping:
        words.append("tangential_damping off")
    if laws_of(scene, wall).cohesion != registry.OFF and scene.contact.tangential_reduce:
        words.append("tangential_reduce on")
    if laws_of(scene, wall).rolling != registry.OFF and scene.contact.torsion:
        words.append("torsionTorque on")
    return " ".join(words)


def properties(scene: Scene, phase: Scene | None = None) -> list[tuple[str, str]]:
    """(name, values) of every `fix property/global` that the contact model reads, at the start or in a phase.

    One value for each of `atom_types`.
    """
    phase = phase or scene.phase_scenes[0]
    types = atom_types(scene, phase)
    found: list[tuple[str, str]] = []

    def per_type(name: str, value: Callable[..., float]) -> None:
        found.append((name, f"peratomtype {' '.join(repr(value(scene.materials[m])) for m in types)}"))

    def per_pair(name: str, value: Callable[[Pair], float], filler: float) -> None:
        rows = [_pair_value(scene, phase, a, b, value, filler) for a in types for b in types]
        found.append((name, f"peratomtypepair {len(types)} {' '.join(repr(v) for v in rows)}"))

    def of_law(law: Law) -> None:
        words = words_of(law)
        for kind, name, value, filler in words.properties:
            if kind == "per_material":
                per_type(name, value)
            elif kind == "per_pair":
                per_pair(name, value, filler)
            elif kind == "common":
                stated = [value(pair) for pair in pairs_of(scene, law)]
                found.append((name, f"scalar {max(stated)!r}"))
            else:
                found.append((name, f"scalar {value(scene.contact)!r}"))

    groups = (scene.acting_laws, *scene.wall_laws.values())
    for names in groups:
        of_law(names.normal_law)
    per_pair("coefficientFriction", lambda p: p.friction if scene.needs.tangential else 0.0, 0.0)
    for slot in ("cohesion", "rolling"):
        for name in {getattr(names, slot): None for names in groups}:
            if name != registry.OFF:
                of_law(registry.law(slot, name))
    return list(dict(found).items())  # several laws read the same ones


def atom_types(scene: Scene, phase: Scene | None = None) -> list[str]:
    """The material of each atom type, at the start or in a phase.

    One for each material of the scene, in order of statement, walls' materials included; then one for each
    wall whose material changes: its type stays, so that it keeps its springs, and has the properties of
    another material.
    """
    walls = (phase or scene.phase_scenes[0]).wall_elements
    return [*scene.materials, *(walls[w].material for w in _walls_of_own_type(scene))]


def atom_type(scene: Scene, wall: Wall) -> int:
    """The atom type of a wall, from 1."""
    own = [scene.wall_elements[w].name for w in _walls_of_own_type(scene)]
    if wall.name in own:
        return len(scene.materials) + own.index(wall.name) + 1  # mutate: own_atom_type
    return scene.material_index[wall.material] + 1


def _walls_of_own_type(scene: Scene) -> list[int]:
    """The elementary walls whose material changes."""
    count = range(len(scene.wall_elements))
    return [w for w in count if len({at.wall_elements[w].material for at in scene.phase_scenes}) > 1]


def pairs_of(scene: Scene, law: Law) -> list[Pair]:
    """The pairs in whose contacts a law acts."""
    groups = scene.contact_groups.items()
    return [p.pair for names, inputs in groups if law in names.laws for p in inputs if law.acts(p)]


def _pair_value(
    scene: Scene, phase: Scene, a: str, b: str, value: Callable[[Pair], float], filler: float
) -> float:  # fmt: skip
    """LIGGGHTS wants a complete symmetric matrix; pairs that cannot meet (wall with wall) get the `filler`.

    The filler is the value without effect: restitution 1 (no damping; 0 is refused), friction and stiffness
    0.
    """
    pair = phase.pair(a, b)
    return value(pair) if pair is not None and scene.can_touch(a, b) else filler
