"""Scenes of a few impacts with friction that a code may get wrong although single impacts at rest come out
right.

In each, the impacts happen side by side, far from one another; steps of 0.2 us, some 300 to a contact.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from comparisons.cases.single_contact.meetings import Meeting
from gpudem.scene import Box, Domain, Explicit, Material, Output, Pair, Plane, Scene, Side, Solver, Time

RADIUS, PARTNER_RADIUS, SPACING = 0.003, 0.004, 0.03
#: Time step [s], and time of the first touch: within a step, and within half a step, not at its end.
STEP, FLIGHT = 2e-7, 6.46e-6
FRICTION = 0.3
BALL = Material(young=3.25e9, poisson=0.34, density=1768.0)
WALL = Material(young=3.2e9, poisson=0.37, density=1185.0)


@dataclasses.dataclass(frozen=True)
class Throw:
    """An impact: speeds [m/s] of the first body against the second; spins about normal x tangent."""

    what: str
    restitution: float
    slip: float
    """Speed along the tangent."""
    spin: tuple[float, float] = (0.0, 0.0)
    """R w [m/s] of the first body and of the second."""
    speed: float = 1.0
    """Speed of approach along the normal."""


@dataclasses.dataclass(frozen=True)
class Encounter:
    """Impacts, in order, of particles that touch nothing else."""

    what: str
    meetings: tuple[tuple[int, int | str], ...]
    images: tuple[tuple[int, tuple[float, float, float]], ...] = ()
    """(row, shift [m]) of a particle whose periodic image meets the other."""

    @property
    def contacts(self) -> list[Meeting]:
        """As meetings, for the measures of single impacts."""
        return [Meeting(self.what, row, other) for row, other in self.meetings]


class Rows:
    """Particles of a scene, collected one by one."""

    def __init__(self):
        self._rows: list[tuple[np.ndarray, np.ndarray, np.ndarray, float, str]] = []

    def add(self, position, velocity, spin=(0.0, 0.0, 0.0), radius: float = RADIUS, material: str = "ball"):
        """Add one; returns its row."""
        at, moves, turns = (np.array(vector, float) for vector in (position, velocity, spin))
        self._rows.append((at, moves, turns, radius, material))
        return len(self._rows) - 1

    def add_throw(
        self, throw: Throw, place: np.ndarray, axes: np.ndarray, frame: np.ndarray | None = None,
        radii: tuple[float, ...] = (RADIUS,), materials: tuple[str, ...] = ("ball",), share: float = 0.7,
        image: tuple[float, ...] = (0.0, 0.0, 0.0),
    ) -> list[int]:  # fmt: skip
        """Add the bodies of a throw as they are FLIGHT before the touch, at which the first is at `place`.

        axes: unit vectors normal (from the second body to the first) and tangent, by rows; frame: velocity
        [m/s] of both; share: of the relative velocity that the first has; image: shift [m] from the
        second to its image that the first meets. One radius: it meets a wall. Returns the rows.
        """
        normal, tangent = axes
        away = throw.slip * tangent - throw.speed * normal
        share = 1.0 if len(radii) == 1 else share
        drift = np.zeros(3) if frame is None else frame
        rows = []
        for k, (radius, material) in enumerate(zip(radii, materials, strict=True)):
            velocity = drift + (share - k) * away
            at = place - k * (sum(radii) * normal + np.array(image)) - FLIGHT * velocity
            spin = throw.spin[k] / radius * np.cross(normal, tangent)
            rows.append(self.add(at, velocity, spin, radius, material))
        return rows

    def explicit(self) -> Explicit:
        """The particles of a scene."""
        position, velocity, spin, radius, material = zip(*self._rows, strict=True)
        return Explicit(
            position=position, velocity=velocity, angular_velocity=spin, radius=radius,
            material=list(material),
        )  # fmt: skip


def turned(angle: float, tilt: float) -> np.ndarray:
    """Unit vectors normal and tangent, by rows: no component is zero."""
    tangent = np.array([math.cos(angle), math.sin(angle), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    return np.array([
        math.cos(tilt) * up + math.sin(tilt) * tangent, math.cos(tilt) * tangent - math.sin(tilt) * up,
    ])  # fmt: skip


def assemble(
    name: str, rows: Rows, pairs: Sequence[Pair], *, steps: int, materials: dict[str, Material] | None = None,
    walls: Sequence[Plane | Box] = (), size: float = 0.3, **more,
) -> Scene:  # fmt: skip
    """A scene without gravity, with a trace of each step; every pair of materials that is not stated exists
    but never meets.
    """
    materials = {"ball": BALL} if materials is None else materials
    stated = {frozenset(pair.materials) for pair in pairs}
    names = list(materials)
    others = [Pair(materials=(a, b)) for k, a in enumerate(names) for b in names[k:]]
    domain = more.pop("domain", Domain(lo=(-size, -size, -size), hi=(size, size, size)))
    return Scene(
        name=name, materials=materials, walls=tuple(walls),
        pairs=[*pairs, *(pair for pair in others if frozenset(pair.materials) not in stated)],
        particles=rows.explicit(), domain=domain,
        time=Time(step=STEP, duration=steps * STEP), output=Output(trace_every=STEP), **more,
    )  # fmt: skip


def by_restitution(throws: Sequence[Throw], partner: str | None) -> tuple[dict[str, Material], list[Pair]]:
    """A material for each restitution, `ball_0p6`, and its pair with `partner`; None: with itself."""
    values = sorted({throw.restitution for throw in throws})
    materials = {material_of(e): BALL for e in values} | ({partner: WALL} if partner else {})
    pairs = [
        Pair(materials=(material_of(e), partner or material_of(e)), restitution=e, friction=FRICTION)
        for e in values
    ]
    return materials, pairs


def material_of(restitution: float) -> str:
    """Name of the material of that restitution."""
    return f"ball_{restitution:g}".replace(".", "p")


# -- a tilted plane ------------------------------------------------------------------------------------------

WALL_THROWS = (
    Throw("elastic, slips, grips, slips", 1.0, 0.5),
    Throw("elastic, slides", 1.0, 2.5),
    Throw("e = 0.6, sticks", 0.6, 0.05),
    Throw("e = 0.6, slips and grips", 0.6, 0.5, speed=0.8),
    Throw("e = 0.6, slides", 0.6, 3.0),
    Throw("e = 0.6, back spin", 0.6, 0.8, (1.4, 0.0)),
)
#: Turns z into a direction whose components are 0.42, -0.37 and 0.83.
TURN_AXIS, TURN_ANGLE = np.array([0.37, 0.42, 0.2]), 0.63
ON_THE_PLANE = [Encounter(throw.what, ((k, "floor"),)) for k, throw in enumerate(WALL_THROWS)]


def turn() -> np.ndarray:
    """The rotation of the tilted scene."""
    x, y, z = TURN_AXIS / np.linalg.norm(TURN_AXIS)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(TURN_ANGLE) * cross + (1 - math.cos(TURN_ANGLE)) * cross @ cross


def on_the_plane(name: str, rotation: np.ndarray, length: float) -> Scene:
    """Six impacts on a floor through the origin; all turned by a rotation, the normal of that length."""
    rows = Rows()
    for k, throw in enumerate(WALL_THROWS):
        axes = turned(0.7 + 0.9 * k, 0.0) @ rotation.T
        place = rotation @ np.array([SPACING * (k - 2.5), 0.0, RADIUS])
        rows.add_throw(throw, place, axes, materials=(material_of(throw.restitution),))
    materials, pairs = by_restitution(WALL_THROWS, "wall")
    normal = length * rotation[:, 2]
    floor = Plane(name="floor", material="wall", point=(0.0, 0.0, 0.0), normal=tuple(normal.tolist()))
    return assemble(name, rows, pairs, materials=materials, walls=[floor], steps=425)


# -- the same two meet twice ---------------------------------------------------------------------------------

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


def _between(height: float) -> list[Plane]:
    return [
        Plane(name="floor", material="wall", point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0)),
        Plane(name="ceiling", material="wall", point=(0.0, 0.0, height), normal=(0.0, 0.0, -1.0)),
    ]


def wall_twice() -> Scene:
    """Balls that bounce from a floor to a ceiling close above them and back to the floor."""
    rows = Rows()
    for k, throw in enumerate(ON_A_WALL):
        place = np.array([SPACING * k, 0.0, RADIUS])
        rows.add_throw(throw, place, turned(0.7 * k, 0.0), materials=(material_of(throw.restitution),))
    materials, pairs = by_restitution(ON_A_WALL, "wall")
    walls = _between(2 * RADIUS + PLAY)
    return assemble("wall_twice", rows, pairs, materials=materials, walls=walls, steps=1270)


def pair_twice() -> Scene:
    """Two balls, one above the other, that a ceiling and a floor send back to one another."""
    rows = Rows()
    for k, throw in enumerate(OF_PAIRS):
        place = np.array([SPACING * k, 0.0, 3 * RADIUS + 1.5 * PLAY])
        rows.add_throw(
            throw, place, turned(0.7 * k, 0.0), radii=(RADIUS,) * 2,
            materials=(material_of(throw.restitution),) * 2, share=0.5,
        )  # fmt: skip
    materials, pairs = by_restitution(OF_PAIRS, None)
    names = list(materials)
    pairs += [Pair(materials=(name, "wall"), restitution=1.0, friction=FRICTION) for name in names]
    materials |= {"wall": WALL}
    walls = _between(4 * RADIUS + 3 * PLAY)
    return assemble("pair_twice", rows, pairs, materials=materials, walls=walls, steps=1530)


# -- several walls -------------------------------------------------------------------------------------------

FLOOR = Plane(name="floor", material="wall", point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0))
SIDE = Plane(name="side", material="wall", point=(0.0, 0.0, 0.0), normal=(1.0, 0.0, 0.0))
#: Rows of two balls that are mirror images, as side and floor are.
MIRRORED = (1, 2)
CORNER = [
    Encounter("slides in opposite directions", ((0, "side"), (0, "floor"))),
    Encounter("slips and grips", ((1, "side"), (1, "floor"))),
    Encounter("its mirror image", ((2, "side"), (2, "floor"))),
]


def corner() -> Scene:
    """Balls that fly into the edge between a floor and a side, and touch both at once."""
    rows = Rows()
    spin = 2.6 / RADIUS
    thrown = [
        ("ball_1", (-1.0, 0.0, -0.7), (-spin, 0.0, -spin)),
        ("ball_0p6", (-1.0, 0.5, -0.6), (50.0, 120.0, 200.0)),
        ("ball_0p6", (-0.6, 0.5, -1.0), (-200.0, -120.0, -50.0)),
    ]
    for k, (material, velocity, turning) in enumerate(thrown):
        place = np.array([RADIUS, SPACING * k, RADIUS]) - FLIGHT * np.array(velocity)
        rows.add(place, velocity, turning, material=material)
    materials, pairs = by_restitution([Throw("", 1.0, 0.0), Throw("", 0.6, 0.0)], "wall")
    return assemble("corner", rows, pairs, materials=materials, walls=[SIDE, FLOOR], steps=450)


#: When the gate is removed [s]: all of the impacts below are half over; and where it stands [m].
REMOVED, GATE_AT = 175 * STEP, 0.05
AT_THE_GATE = [
    Encounter("on the gate", ((0, "gate"),)),
    Encounter("on the floor", ((1, "floor"),)),
    Encounter("two balls", ((2, 3),)),
]
#: The row of a ball that touches gate and floor.
LEANS = 4


def gate() -> Scene:
    """Impacts on a gate, on the floor, of two balls and of a ball on both walls; then the gate is removed."""
    rows = Rows()
    slips = Throw("slips and grips", 0.6, 0.5)
    towards = np.array([[-1.0, 0.0, 0.0], [0.0, 0.8, 0.6]])
    rows.add_throw(slips, np.array([GATE_AT - RADIUS, 0.0, SPACING]), towards, materials=("ball_0p6",))
    rows.add_throw(slips, np.array([0.0, 0.0, RADIUS]), turned(0.7, 0.0), materials=("ball_0p6",))
    pair = {"radii": (RADIUS, PARTNER_RADIUS), "materials": ("ball_0p6", "ball_0p6")}
    rows.add_throw(slips, np.array([0.0, SPACING, SPACING]), turned(1.4, 0.9), **pair)
    velocity = np.array([0.6, 0.5, -0.8])
    place = np.array([GATE_AT - RADIUS, -SPACING, RADIUS]) - FLIGHT * velocity
    rows.add(place, velocity, (100.0, 50.0, -80.0), material="ball_0p6")
    materials, pairs = by_restitution([slips], "wall")
    pairs.append(Pair(materials=("ball_0p6", "ball_0p6"), restitution=0.6, friction=FRICTION))
    stands = Plane(
        name="gate", material="wall", point=(GATE_AT, 0.0, 0.0), normal=(-1.0, 0.0, 0.0), removed_at=REMOVED
    )  # fmt: skip
    return assemble("gate", rows, pairs, materials=materials, walls=[stands, FLOOR], steps=425)


#: Half a side of the box [m]; the side that is left out; the row of the ball that passes there.
HALF, OPEN, PASSES = 0.05, "yhi", 5
SIDES: tuple[Side, ...] = ("xlo", "xhi", "ylo", "zlo", "zhi")
IN_THE_BOX = [Encounter(side, ((k, f"box_{side}"),)) for k, side in enumerate(SIDES)]


def open_box() -> Scene:
    """An oblique impact on each side of a box, and a ball that leaves where a side is left out."""
    rows = Rows()
    for k, side in enumerate(SIDES):
        axis, sign = "xyz".index(side[0]), 1.0 if side.endswith("lo") else -1.0
        normal, tangent = sign * np.eye(3)[axis], np.roll([0.0, 0.8, -0.6], axis)
        throw = Throw(side, 0.6, 0.4 + 0.1 * k, (0.1 * k, 0.0))
        place = (RADIUS - HALF) * normal
        rows.add_throw(throw, place, np.array([normal, tangent]), materials=("ball_0p6",))
    small = RADIUS / 2
    rows.add((0.0, HALF - 1.1 * small, 0.02), (0.0, 45.0, 0.0), (0.0, 0.0, 300.0), small, "ball_0p6")
    materials, pairs = by_restitution([Throw("", 0.6, 0.0)], "wall")
    box = Box(
        kind="box", name="box", material="wall", sides=SIDES, lo=(-HALF, -HALF, -HALF), hi=(HALF, HALF, HALF)
    )
    skin = Solver(skin=0.008)  # no rebuild as the ball passes: those are for the moving pairs
    return assemble(
        "open_box", rows, pairs, materials=materials, walls=[box], steps=425, size=2 * HALF, solver=skin
    )  # fmt: skip


# -- moving pairs --------------------------------------------------------------------------------------------

PAIR_THROWS = (
    Throw("elastic, slips, grips, slips", 1.0, 0.5, (0.1, -0.2)),
    Throw("elastic, slides", 1.0, 2.5, (-0.3, 0.2)),
    Throw("e = 0.6, sticks", 0.6, 0.1),
    Throw("e = 0.6, slips and grips", 0.6, 0.7, (0.1, 0.2)),
    Throw("e = 0.6, slides", 0.6, 3.0, (0.0, 0.5)),
)
#: Speed [m/s] of the centre of each pair, in turn to the right and to the left.
SPEED = 50.0
MOVING = [Encounter(throw.what, ((2 * k, 2 * k + 1),)) for k, throw in enumerate(PAIR_THROWS)]


def moving() -> Scene:
    """Oblique impacts of pairs that fly past one another and past balls at rest: the list is rebuilt during
    each contact, rows and partners change their places in it.
    """
    rows = Rows()
    for k, throw in enumerate(PAIR_THROWS):
        sign = 1 - 2 * (k % 2)
        frame = np.array([sign * SPEED, 0.1 * SPEED, -0.05 * SPEED])
        place = np.array([-sign * 0.002, 0.017 * k, 0.0])
        rows.add_throw(
            throw, place, turned(0.9 * k, 0.5 + 0.4 * k), frame, (RADIUS, PARTNER_RADIUS),
            (material_of(throw.restitution),) * 2,
        )  # fmt: skip
    for k in range(len(PAIR_THROWS)):  # balls at rest beside the paths
        rows.add((0.004, 0.017 * k + 0.001, 0.0135), (0.0, 0.0, 0.0), material="ball_1")
        rows.add((-0.004, 0.017 * k + 0.001, -0.0145), (0.0, 0.0, 0.0), material="ball_1")
    materials, pairs = by_restitution(PAIR_THROWS, None)
    return assemble("moving", rows, pairs, materials=materials, steps=425)


#: The periodic box [m].
LO, HI = -0.05, 0.05
#: Image of the partner of each pair: across x, across y, across both, and back across x; none for the last.
SHIFTS = ((1, 0, 0), (0, 1, 0), (1, 1, 0), (-1, 0, 0), (0, 0, 0))
SIZE = HI - LO
ACROSS = [
    Encounter(throw.what, ((2 * k, 2 * k + 1),), ((2 * k + 1, (SIZE * x, SIZE * y, SIZE * z)),))
    for k, (throw, (x, y, z)) in enumerate(zip(PAIR_THROWS, SHIFTS, strict=True))
]


def across() -> Scene:
    """Oblique impacts of pairs that stand on both sides of a periodic side, and cross it in contact."""
    rows = Rows()
    for k, (throw, shift) in enumerate(zip(PAIR_THROWS, SHIFTS, strict=True)):
        out = np.array(shift, float)
        axes = turned(0.9 * k, 0.5 + 0.4 * k)
        if out.any():  # the first inside the upper side, its partner beyond it
            normal = -(out + np.array([0.1, -0.2, 0.3])) / np.linalg.norm(out + np.array([0.1, -0.2, 0.3]))
            tangent = np.cross(normal, [0.3, 0.5, 0.8])
            axes = np.array([normal, tangent / np.linalg.norm(tangent)])
        face = np.where(out > 0, HI - 0.0005, np.where(out < 0, LO + 0.0005, 0.0))
        place = face + np.array([0.0, 0.0, 0.02 * (k - 2)])
        place[:2] += np.where(out[:2] == 0, 0.012 * (k - 2), 0.0)
        rows.add_throw(
            throw, place, axes, 15.0 * out, (RADIUS, PARTNER_RADIUS), (material_of(throw.restitution),) * 2,
            image=tuple(SIZE * out),
        )  # fmt: skip
    materials, pairs = by_restitution(PAIR_THROWS, None)
    domain = Domain(lo=(LO, LO, -0.1), hi=(HI, HI, 0.1), periodic=(True, True, False))
    return assemble("across", rows, pairs, materials=materials, domain=domain, steps=425)


# -- two materials -------------------------------------------------------------------------------------------

UNLIKE = {
    "ball": BALL,
    "stiff": Material(young=8e9, poisson=0.1, density=2500.0),
    "rubbery": Material(young=2e9, poisson=0.49, density=1100.0),
}
#: Each pair of materials: restitution, friction, radii [m].
UNLIKE_PAIRS = {
    ("ball", "stiff"): (0.8, 0.2, (0.003, 0.005)),
    ("rubbery", "ball"): (0.6, 0.45, (0.004, 0.003)),
    ("stiff", "rubbery"): (1.0, 0.3, (0.0025, 0.004)),
}
#: Slip speed by friction times approach speed, of two impacts of each.
SLIPS = (0.6, 2.0)
OF_TWO = [
    Encounter(f"{a} on {b}, slip {slip:g} mu", ((6 * n + 2 * k, 6 * n + 2 * k + 1),))
    for n, slip in enumerate(SLIPS)
    for k, (a, b) in enumerate(UNLIKE_PAIRS)
]


def of_two_materials() -> Scene:
    """Oblique impacts of unlike balls: unequal moduli, Poisson ratios, densities and radii."""
    rows = Rows()
    for n, slip in enumerate(SLIPS):
        for k, (materials, (e, friction, radii)) in enumerate(UNLIKE_PAIRS.items()):
            throw = Throw("", e, slip * friction, (0.1, -0.05))
            place = np.array([SPACING * k, SPACING * n, 0.0])
            rows.add_throw(throw, place, turned(0.8 * k + n, 0.4 + k), radii=radii, materials=materials)
    pairs = [
        Pair(materials=materials, restitution=e, friction=friction)
        for materials, (e, friction, _) in UNLIKE_PAIRS.items()
    ]
    return assemble("two_materials", rows, pairs, materials=UNLIKE, steps=500)
