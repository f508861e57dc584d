"""The same two meet twice: a ball and a wall, and two balls, both rough."""

from __future__ import annotations

from comparisons.cases.encounters import figures
from comparisons.cases.encounters.checks import against_ode, begins, happens, step_by_step
from comparisons.cases.encounters.scenes import PAIR_TWICE, WALL_TWICE, pair_twice, wall_twice
from comparisons.harness.case import Case, Tier, Variant
from gpudem.output.run import Run

ALL = {"wall_twice": WALL_TWICE, "pair_twice": PAIR_TWICE}


def variants(tier: Tier) -> list[Variant]:
    """Bounces between floor and ceiling; two balls that floor and ceiling send back."""
    return [Variant("wall_twice", wall_twice()), Variant("pair_twice", pair_twice())]


def contacts(run: Run) -> dict[str, float]:
    """How often the two of the first meeting of each encounter come into contact."""
    return {e.what: begins(run, e.contacts[0]) for e in ALL[run.scene.name]}


CATCHES = (
    "a tangential spring that is kept after the separation, and acts at the next contact of the same two:"
    " of a ball and a wall, or of two balls"
)
CASE = Case(
    name="meet_again",
    title="The same two meet again",
    purpose=(
        "A tangential spring begins at zero with each contact. A code that keeps it in the list of"
        " neighbors, where the entry outlives the contact, starts the next one with the spring that the last"
        " one left. Balls bounce from a floor to a ceiling 12 um above them and back to the floor; two balls"
        " part, and the walls send them back to one another, before any list is rebuilt. Impacts with"
        " restitution below 1 and back spin end in stick and leave the spring stretched against the slip of"
        " the next one. (LIGGGHTS keeps the spring of two balls with its default contact_distance_factor;"
        " its decks here set 1.01.)"
    ),
    source="The law of LIGGGHTS' manual (hertz, tangential history) by DOP853, impact after impact.",
    variants=variants,
    checks=(
        happens(
            "contacts of the same two, smallest number", 2, "contacts", contacts, tuple(ALL),
            "a scene in which the two do not meet again",
        ),
        *step_by_step(ALL, CATCHES),
        *against_ode(ALL, CATCHES),
    ),
    figures=(
        figures.through("wall_twice", WALL_TWICE, "Floor, ceiling, floor"),
        figures.through("pair_twice", PAIR_TWICE, "Two balls part and meet again"),
    ),
    tables=(figures.table(ALL),),
    features=("normal hertz", "damping", "tangential history", "wall plane", "sphere-sphere", "rotation"),
    order=34,
)  # fmt: skip
