"""The same two meet twice: a ball and a wall, and two balls, both rough."""

from __future__ import annotations

import numpy as np

from comparisons import kit
from comparisons.cases.encounters import figures, throws
from comparisons.cases.encounters.checks import against_ode, happens, present, step_by_step
from comparisons.cases.encounters.throws import FRICTION, RADIUS, SPACING, WALL, Encounter, Throw
from comparisons.cases.side_by_side import floor, plane, turned
from gpudem.output.run import Run
from gpudem.scene import Pair, Plane, Scene

#: With restitution below 1 and back spin, an impact ends in stick and leaves the spring stretched against the
#: slip of the next one.
ON_A_WALL = (
    Throw("elastic", 1.0, 0.3, speed=0.6),
    Throw("e = 0.7, back spin", 0.7, 0.6, (-0.8, 0.0)),
    Throw("e = 0.8, back spin", 0.8, 0.6, (-0.8, 0.0)),
)
OF_PAIRS = (
    Throw("elastic", 1.0, 0.4, speed=0.8),
    Throw("e = 0.7, back spin", 0.7, 0.3, (-1.0, -1.0)),
    Throw("e = 0.7, some back spin", 0.7, 0.6, (-0.5, -0.5)),
)
#: Room for a ball beyond its diameter [m].
PLAY = 1.2e-5
WALL_TWICE = [
    Encounter(throw.what, ((k, "floor"), (k, "ceiling"), (k, "floor"))) for k, throw in enumerate(ON_A_WALL)
]
PAIR_TWICE = [
    Encounter(throw.what, ((2 * k, 2 * k + 1), (2 * k, "ceiling"), (2 * k + 1, "floor"), (2 * k, 2 * k + 1)))
    for k, throw in enumerate(OF_PAIRS)
]
ALL = {"wall_twice": WALL_TWICE, "pair_twice": PAIR_TWICE}


def _between(height: float) -> list[Plane]:
    return [floor("wall"), plane("ceiling", (0.0, 0.0, height), (0.0, 0.0, -1.0))]


def wall_twice() -> Scene:
    """Balls that bounce from a floor to a ceiling close above them and back to the floor."""
    rows = throws.Spheres()
    for k, throw in enumerate(ON_A_WALL):
        rows.throw(throw, (SPACING * k, 0.0, RADIUS), turned(0.7 * k))
    walls = _between(2 * RADIUS + PLAY)
    return throws.scene("wall_twice", rows, ON_A_WALL, "wall", walls=walls, steps=1270)


def pair_twice() -> Scene:
    """Two balls, one above the other, that a ceiling and a floor send back to one another."""
    rows = throws.Spheres()
    for k, throw in enumerate(OF_PAIRS):
        place = (SPACING * k, 0.0, 3 * RADIUS + 1.5 * PLAY)
        rows.throw(throw, place, turned(0.7 * k), radii=(RADIUS,) * 2, share=0.5)
    pairs = [
        Pair(materials=(name, "wall"), restitution=1.0, friction=FRICTION)
        for name in sorted({throw.material for throw in OF_PAIRS})
    ]
    walls = _between(4 * RADIUS + 3 * PLAY)
    return throws.scene(
        "pair_twice", rows, OF_PAIRS, materials={"wall": WALL}, pairs=pairs, walls=walls, steps=1530
    )


def contacts(run: Run) -> dict[str, float]:
    """How many contacts of the two of the first meeting of each encounter begin within the run."""
    begun = {e.what: np.diff(present(run, e.contacts[0]).astype(int)) > 0 for e in ALL[run.scene.name]}
    return {what: int(np.count_nonzero(steps)) for what, steps in begun.items()}


CATCHES = (
    "a tangential spring that is kept after the separation, and acts at the next contact of the same pair: a"
    " ball and a wall, or two balls"
)
CASE = kit.Case(
    name="meet_again",
    title="Repeated contacts of the same pair",
    purpose=(
        "The tangential spring of each contact begins at zero. A code that stores it in the neighbor list,"
        " whose entry lasts longer than the contact, may begin the next contact of the same pair with the"
        " spring of the last one. Balls bounce from a floor to a ceiling 12 um above them and back to the"
        " floor; two balls separate, bounce from walls and collide again, before the list is rebuilt. Impacts"
        " with restitution below 1 and backspin end in stick, with a spring that would act against the slip"
        " of the next impact. (LIGGGHTS keeps the spring of two balls with its default"
        " contact_distance_factor; its decks here set 1.01.)"
    ),
    source="The law of LIGGGHTS' manual (hertz, tangential history) by DOP853, impact after impact.",
    variants=lambda tier: [
        kit.Variant("wall_twice", wall_twice()), kit.Variant("pair_twice", pair_twice())
    ],
    checks=(
        happens(
            "contacts of the same two, smallest number", 2, "contacts", contacts, tuple(ALL),
            "a scene in which the pair does not come into contact again",
        ),
        *step_by_step(ALL, CATCHES),
        *against_ode(ALL, CATCHES),
    ),
    figures=(
        figures.through("wall_twice", WALL_TWICE, "Floor, ceiling, floor"),
        figures.through("pair_twice", PAIR_TWICE, "Two balls separate and collide again"),
    ),
    tables=(figures.table(ALL),),
    features=("normal hertz", "damping", "tangential history", "wall plane", "sphere-sphere", "rotation"),
    order=34,
)  # fmt: skip
