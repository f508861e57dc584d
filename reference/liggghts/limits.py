"""What LIGGGHTS 3.8.0 refuses or has no words for, said before the deck is written, in the scene's terms."""

from __future__ import annotations

from gpudem.scene import Pair, Plane, Scene
from reference.liggghts.errors import LiggghtsCannotState

#: LIGGGHTS: `ERROR: 0.05 < coefficientRestitution <= 1 required` (fix property/global, SI units).
MIN_RESTITUTION = 0.05
#: LIGGGHTS: `ERROR: characteristicVelocity >= 1e-2 required for SI units` [m/s].
MIN_CHARACTERISTIC_VELOCITY = 0.01


def warnings(scene: Scene) -> list[str]:
    """What LIGGGHTS does otherwise than the scene says, one sentence each.

    Its tangential law `history` applies the dashpot at each set-up without regard to friction, and one deck
    cannot give some pairs of particles another tangential law (pair_style hybrid of two `gran` crashes).
    """
    contact = scene.contact
    at_setup = scene.needs.history and contact.tangential_damping and not contact.frictionless_dashpot
    without = [p for p in scene.contact_pairs if p.friction == 0] if at_setup else []
    if not without or not (scene.needs.gate or scene.start_overlap > 0):
        return []
    names = ", ".join(" / ".join(pair.materials) for pair in without)
    return [
        f"pairs {names}: friction = 0 beside pairs with friction: LIGGGHTS applies its tangential dashpot"
        " to their contacts at each set-up; contact.frictionless_dashpot = true does so in gpudem"
    ]


def check(scene: Scene) -> None:
    """Raises LiggghtsCannotState listing every item of the scene that LIGGGHTS cannot state."""
    found = [_restitution(p) for p in scene.contact_pairs if _too_inelastic(scene, p)]
    found += [
        f"contact.{law.slot} = {law.name!r}: LIGGGHTS has no such law"
        for law in scene.laws
        if law.liggghts is None
    ]
    found += [
        f"walls.{wall.name}.kind = {wall.kind!r}: LIGGGHTS gets planes only"
        for wall in scene.wall_elements
        if wall.kind != "plane"
    ]
    found += [_tilted(p) for p in scene.planes if sum(c != 0 for c in p.normal) != 1]
    found += [
        f"walls.{p.name}.vibration: LIGGGHTS has no saw-tooth motion of a plane"
        for p in scene.planes
        if p.vibration
    ]
    speed = scene.contact.characteristic_velocity
    if (
        "characteristic_velocity" in scene.normal_law.reads
        and speed is not None
        and speed < MIN_CHARACTERISTIC_VELOCITY
    ):
        found.append(
            f"contact.characteristic_velocity = {speed:g} m/s: LIGGGHTS wants at least"
            f" {MIN_CHARACTERISTIC_VELOCITY:g} m/s"
        )
    if found:
        raise LiggghtsCannotState(
            "\n".join(["LIGGGHTS cannot state this scene:", *(f"  - {f}" for f in found)])
        )


def _too_inelastic(scene: Scene, pair: Pair) -> bool:
    return "restitution" in scene.normal_law.reads and pair.restitution <= MIN_RESTITUTION


def _restitution(pair: Pair) -> str:
    names = " / ".join(pair.materials)
    return (
        f"pairs {names}: restitution = {pair.restitution:g}:"
        f" LIGGGHTS wants {MIN_RESTITUTION:g} < restitution <= 1"
    )


def _tilted(plane: Plane) -> str:
    return (
        f"walls.{plane.name}: normal {plane.normal}: LIGGGHTS has planes across x, y or z only"
        " (a tilted wall would need a mesh); tilt gravity instead"
    )
