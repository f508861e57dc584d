"""Particles that come within a run, as LIGGGHTS' `fix insert/pack`, one for each.

`insert/pack` draws the place of a ball from a region. With one seed it draws the same fractions of a block's
sides in every run, whatever the block: a block is put where that place is the particle's own. `create_atoms`
between two runs would make a set-up, which is another trajectory.
"""

from __future__ import annotations

import dataclasses

from gpudem.scene import Scene

#: Seeds of template, distribution and insertion: primes above 10000, all different, as LIGGGHTS wants them.
SEEDS = (15485863, 32452843, 49979687)
#: What the last of them draws: the place of a ball in its block along x, y, z, in lengths of the block.
DRAWN = (0.24418078094915524, 0.94638541245199059, 0.89962708060612295)
#: Side of a block in radii of its particle.
SIDE = 0.5
#: Most particles that one deck inserts; each is a fix, which every step visits.
MOST = 20_000


@dataclasses.dataclass(frozen=True)
class Kind:
    """Particles of one radius and material: one template."""

    name: str
    type: int
    density: float
    radius: float


@dataclasses.dataclass(frozen=True)
class Ball:
    """One particle and its block."""

    kind: str
    step: int
    sides: tuple[float, float, float, float, float, float]
    velocity: tuple[float, float, float]
    angular_velocity: tuple[float, float, float]


def kinds(scene: Scene) -> list[Kind]:
    """The templates of what is inserted, in the order of their first particles."""
    return list(_kinds(scene).values())


def balls(scene: Scene) -> list[Ball]:
    """What is inserted, in the order of the ids."""
    state, first, found = scene.state, scene.start_count, []
    known = _kinds(scene)
    for i in range(first, len(state)):
        radius, x = float(state.radius[i]), state.position[i].tolist()
        side = SIDE * radius
        lows = [x[k] - DRAWN[k] * side for k in range(3)]  # mutate: place_in_block
        sides = tuple(v for low in lows for v in (low, low + side))
        velocity, spin = state.velocity[i].tolist(), state.angular_velocity[i].tolist()
        kind = known[int(state.material[i]), radius].name
        found.append(Ball(kind, int(scene.arrival_steps[i]), sides, tuple(velocity), tuple(spin)))
    return found


def _kinds(scene: Scene) -> dict[tuple[int, float], Kind]:
    state, found = scene.state, {}
    density = [material.density for material in scene.materials.values()]
    for i in range(scene.start_count, len(state)):
        key = int(state.material[i]), float(state.radius[i])
        if key not in found:
            found[key] = Kind(f"kind_{len(found)}", key[0] + 1, density[key[0]], key[1])
    return found
