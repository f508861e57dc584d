"""The contact law of a scene in LIGGGHTS' words: model, switches, and the properties they read."""

from __future__ import annotations

from collections.abc import Callable

from gpudem.contact import registry
from gpudem.contact.law import Law, LiggghtsWords
from gpudem.scene import Pair, Scene


def words_of(law: Law) -> LiggghtsWords:
    """A law's words; `limits.check` has refused a scene whose law has none."""
    assert law.liggghts is not None
    return law.liggghts


def model(scene: Scene) -> str:
    """The words between `pair_style gran model` and the switches; walls get the same.

    Without friction: `no_history` with mu = 0, which is zero tangential force, bit for bit the same as no
    tangential model, but compiled in (a quarter faster). `history` with mu = 0 would not do: at each set-up
    LIGGGHTS applies its tangential dashpot without regard to mu.
    """
    tangential = scene.contact.tangential if scene.needs.tangential else "no_history"
    words = [words_of(scene.normal_law).word, "tangential"]
    words.append(words_of(registry.law("tangential", tangential)).word)
    if scene.needs.rolling:
        words += ["rolling_friction", words_of(registry.law("rolling", scene.contact.rolling)).word]
    return " ".join(words)


def switches(scene: Scene) -> str:
    """Settings of the contact model; on a wall they must come after the `primitive` words."""
    words = ["limitForce on"] if scene.contact.limit_force else []
    if scene.needs.tangential and not scene.contact.tangential_damping:
        words.append("tangential_damping off")
    return " ".join(words)


def properties(scene: Scene) -> list[tuple[str, str]]:
    """(name, values) of every `fix property/global` that the contact model reads.

    One atom type per material of the scene, in order of statement, walls' materials included.
    """
    kinds = len(scene.materials)
    found: list[tuple[str, str]] = []

    def per_type(name: str, value: Callable[..., float]) -> None:
        found.append((name, f"peratomtype {' '.join(repr(value(m)) for m in scene.materials.values())}"))

    def per_pair(name: str, value: Callable[[Pair], float], filler: float) -> None:
        rows = [_pair_value(scene, a, b, value, filler) for a in scene.materials for b in scene.materials]
        found.append((name, f"peratomtypepair {kinds} {' '.join(repr(v) for v in rows)}"))

    def of_law(law: Law) -> None:
        words = words_of(law)
        for kind, name, value, filler in words.properties:
            if kind == "per_material":
                per_type(name, value)
            elif kind == "per_pair":
                per_pair(name, value, filler)
            else:
                found.append((name, f"scalar {value(scene.contact)!r}"))

    of_law(scene.normal_law)
    per_pair("coefficientFriction", lambda p: p.friction if scene.needs.tangential else 0.0, 0.0)
    if scene.needs.rolling:
        of_law(registry.law("rolling", scene.contact.rolling))
    return found


def _pair_value(scene: Scene, a: str, b: str, value: Callable[[Pair], float], filler: float) -> float:
    """LIGGGHTS wants a complete symmetric matrix; pairs that cannot meet (wall with wall) get the `filler`.

    The filler is the value without effect: restitution 1 (no damping; 0 is refused), friction and stiffness
    0.
    """
    pair = scene.pair(a, b)
    return value(pair) if pair is not None and scene.can_touch(a, b) else filler
