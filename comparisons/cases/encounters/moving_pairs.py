"""Two balls in contact, with friction, while the list is rebuilt and while they cross a periodic side."""

from __future__ import annotations

import dataclasses

import numpy as np

from comparisons import kit
from comparisons.cases.encounters import figures, throws
from comparisons.cases.encounters.checks import against_ode, happens, present, step_by_step, unwrapped
from comparisons.cases.encounters.throws import PARTNER_RADIUS, RADIUS, Encounter, Throw
from comparisons.cases.side_by_side import turned
from comparisons.metrics.parting import period
from gpudem.output.run import Run
from gpudem.scene import Scene

THROWS = (
    Throw("elastic, slips, sticks, slips", 1.0, 0.5, (0.1, -0.2)),
    Throw("elastic, slides", 1.0, 2.5, (-0.3, 0.2)),
    Throw("e = 0.6, sticks", 0.6, 0.1),
    Throw("e = 0.6, slips and sticks", 0.6, 0.7, (0.1, 0.2)),
    Throw("e = 0.6, slides", 0.6, 3.0, (0.0, 0.5)),
)
RADII = (RADIUS, PARTNER_RADIUS)
#: Speed [m/s] of the center of each moving pair, in turn to the right and to the left.
SPEED = 50.0
MOVING = [Encounter(throw.what, ((2 * k, 2 * k + 1),)) for k, throw in enumerate(THROWS)]
#: The periodic box [m].
LO, HI = -0.05, 0.05
SIZE = HI - LO
#: Image of the partner of each pair: across x, across y, across both, and back across x; none for the last.
SHIFTS = np.array([(1, 0, 0), (0, 1, 0), (1, 1, 0), (-1, 0, 0), (0, 0, 0)], float)
ACROSS = [
    dataclasses.replace(pair, images=((2 * k + 1, tuple(SIZE * shift)),))
    for k, (pair, shift) in enumerate(zip(MOVING, SHIFTS, strict=True))
]
ALL = {"moving": MOVING, "across": ACROSS}


def moving() -> Scene:
    """Oblique impacts of pairs that fly past one another and past balls at rest: the list is rebuilt during
    each contact, rows and partners change their places in it.
    """
    rows = throws.Spheres()
    for k, throw in enumerate(THROWS):
        sign, axes = 1 - 2 * (k % 2), turned(0.9 * k, 0.5 + 0.4 * k)
        frame = (sign * SPEED, 0.1 * SPEED, -0.05 * SPEED)
        rows.throw(throw, (-sign * 0.002, 0.017 * k, 0.0), axes, radii=RADII, frame=frame)
    for k in range(len(THROWS)):  # balls at rest beside the paths
        rows.add((0.004, 0.017 * k + 0.001, 0.0135), (0.0, 0.0, 0.0), material="ball_1")
        rows.add((-0.004, 0.017 * k + 0.001, -0.0145), (0.0, 0.0, 0.0), material="ball_1")
    return throws.scene("moving", rows, THROWS, steps=425)


def across() -> Scene:
    """Oblique impacts of pairs that stand on both sides of a periodic side, and cross it in contact."""
    rows = throws.Spheres()
    for k, (throw, out) in enumerate(zip(THROWS, SHIFTS, strict=True)):
        axes = turned(0.9 * k, 0.5 + 0.4 * k)
        if out.any():  # the first inside the upper side, its partner beyond it
            normal = -(out + np.array([0.1, -0.2, 0.3])) / np.linalg.norm(out + np.array([0.1, -0.2, 0.3]))
            tangent = np.cross(normal, [0.3, 0.5, 0.8])
            axes = np.array([normal, tangent / np.linalg.norm(tangent)])
        face = np.where(out > 0, HI - 0.0005, np.where(out < 0, LO + 0.0005, 0.0))
        place = face + np.array([0.0, 0.0, 0.02 * (k - 2)])
        place[:2] += np.where(out[:2] == 0, 0.012 * (k - 2), 0.0)
        rows.throw(throw, place, axes, radii=RADII, frame=15.0 * out, image=SIZE * out)
    box = {"lo": (LO, LO, -0.1), "hi": (HI, HI, 0.1), "periodic": (True, True, False)}
    return throws.scene("across", rows, THROWS, steps=425, **box)


def moved(run: Run) -> dict[str, float]:
    found = {}
    for encounter in MOVING:
        (meeting,) = encounter.contacts
        path = run.trace["position"][present(run, meeting), meeting.row]
        found[encounter.what] = float(np.linalg.norm(path[-1] - path[0]) / (0.5 * run.scene.skin))
    return found


def crossings(run: Run) -> dict[str, float]:
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
    "springs that are lost, reversed or assigned to another pair when the list is rebuilt; the velocity of"
    " the frame in a force; a contact point, a normal or a spring without the nearest image; a spring that is"
    " lost when one of the two is moved to the other side"
)
CASE = kit.Case(
    name="moving_pairs",
    title="Contacts during a rebuild of the neighbor list, and across a periodic side",
    purpose=(
        "A contact force must not depend on the neighbor list. Pairs collide obliquely, with friction, while"
        " both balls fly at 50 m/s past other pairs and past balls at rest: during each contact the list is"
        " rebuilt several times, particles are sorted anew, partners change their position in the list and"
        " new ones are inserted between them. Other pairs collide across periodic sides, one ball on each"
        " side, and cross the side while in contact. The exact motion has neither a list nor sides."
    ),
    source="Galilean and translational invariance; the law of LIGGGHTS' manual by DOP853.",
    variants=lambda tier: [kit.Variant("moving", moving()), kit.Variant("across", across())],
    checks=(
        happens(
            "moving: distance moved in contact / half the skin, smallest", 4, "1", moved, ("moving",),
            "a contact that is over before the list has to be rebuilt",
        ),
        happens(
            "across: balls of a pair that cross the side in contact, smallest", 1, "balls", crossings,
            ("across",), "a contact that does not cross the side",
        ),
        *step_by_step(ALL, CATCHES),
        *against_ode(ALL, CATCHES),
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
