"""Two balls in contact, with friction, while the list is rebuilt and while they cross a periodic side."""

from __future__ import annotations

import numpy as np

from comparisons.cases.encounters import figures
from comparisons.cases.encounters.checks import (
    against_ode,
    happens,
    period,
    present,
    step_by_step,
    unwrapped,
)
from comparisons.cases.encounters.scenes import ACROSS, MOVING, across, moving
from comparisons.harness.case import Case, Tier, Variant
from gpudem.output.run import Run

ALL = {"moving": MOVING, "across": ACROSS}


def variants(tier: Tier) -> list[Variant]:
    """Pairs that fly past one another; pairs across periodic sides."""
    return [Variant("moving", moving()), Variant("across", across())]


def moved(run: Run) -> dict[str, float]:
    """How far the first of each pair moves in contact, by half the skin: so often a list is rebuilt."""
    found = {}
    for encounter in MOVING:
        (meeting,) = encounter.contacts
        path = run.trace["position"][present(run, meeting), meeting.row]
        found[encounter.what] = float(np.linalg.norm(path[-1] - path[0]) / (0.5 * run.scene.skin))
    return found


def crossings(run: Run) -> dict[str, float]:
    """How many balls of each pair across a side cross it while in contact."""
    found, size = {}, period(run.scene)
    axes = size > 0
    for encounter in (e for e in ACROSS if np.any(e.images[0][1])):
        (meeting,) = encounter.contacts
        inside = present(run, meeting)
        paths = unwrapped(run)[inside][:, meeting.rows][:, :, axes] - np.array(run.scene.domain.lo)[axes]
        boxes = np.floor(paths / size[axes])
        found[encounter.what] = float((boxes[0] != boxes[-1]).any(axis=1).sum())
    return found


CATCHES = (
    "springs that are lost, turned round or given to another pair when the list is rebuilt; the velocity of"
    " the frame in a force"
)
ACROSS_CATCHES = (
    "a contact point, a normal or a spring without the nearest image; a spring that is lost when one of the"
    " two is moved to the other side"
)
CASE = Case(
    name="moving_pairs",
    title="In contact while the list is rebuilt, and across a periodic side",
    purpose=(
        "A contact force must not depend on what the solver does with its list. Pairs meet obliquely, with"
        " friction, as in the case of oblique impacts, but fly at 50 m/s past one another and past balls at"
        " rest: during each contact the list of neighbors has to be rebuilt several times, rows are sorted"
        " anew, partners change their places and new ones come in between. And pairs meet across periodic"
        " sides, one ball on each, and cross the side while they touch. The exact motion has neither list"
        " nor sides."
    ),
    source="Galilean and translational invariance; the law of LIGGGHTS' manual by DOP853.",
    variants=variants,
    checks=(
        happens(
            "moving: distance moved in contact / half the skin, smallest", 4, "1", moved, ("moving",),
            "a contact that is over before the list has to be rebuilt",
        ),
        happens(
            "across: balls of a pair that cross the side in contact, smallest", 1, "balls", crossings,
            ("across",), "a contact that does not cross the side",
        ),
        *step_by_step(ALL, f"{CATCHES}; {ACROSS_CATCHES}"),
        *against_ode(ALL, f"{CATCHES}; {ACROSS_CATCHES}"),
    ),
    figures=(
        figures.through("moving", [MOVING[k] for k in (0, 2, 3)], "Three pairs that fly at 50 m/s"),
        figures.through("across", [ACROSS[k] for k in (0, 2, 3)], "Three pairs across periodic sides"),
    ),
    tables=(figures.table(ALL),),
    features=(
        "normal hertz", "damping", "tangential history", "periodic sides", "sphere-sphere", "several radii",
        "rotation",
    ),
    order=37,
)  # fmt: skip
