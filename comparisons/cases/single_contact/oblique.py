"""Oblique impacts with friction and spin, on a wall and between spheres, from sticking to gross sliding."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from comparisons.cases.side_by_side import floor
from comparisons.cases.single_contact import figures, sliding
from comparisons.cases.single_contact.checks import against_ode, step_by_step
from comparisons.cases.single_contact.meetings import Meeting, ladder
from comparisons.harness.case import Case, Tier, Variant
from gpudem.scene import Contact, Domain, Explicit, Material, Output, Pair, Scene, Time

FRICTION, SPEED, SPACING = 0.3, 1.0, 0.03
#: Time of the touch and of the run [s]; a contact takes some 60e-6 s.
FLIGHT, DURATION = 6.5e-6, 85e-6
RADIUS, PARTNER_RADIUS = 0.003, 0.004
BALL = Material(young=3.25e9, poisson=0.34, density=1768.0)
WALL = Material(young=3.2e9, poisson=0.37, density=1185.0)


@dataclasses.dataclass(frozen=True)
class Throw:
    """One impact at 1 m/s along the normal; surface speeds in m/s, spins about normal x tangent."""

    what: str
    restitution: float
    tangential: float
    """Speed of the first particle along the tangent; the partner carries a fifth of it backwards."""
    spin: float = 0.0
    """R w of the first particle: positive spin takes from the slip."""
    partner_spin: float | None = None
    """R w of the second particle; None: the wall."""


#: A contact sticks below a slip of 0.05 m/s and slides throughout above 3.5 mu (1 + e) v_n, some 2 m/s.
THROWS = (
    Throw("wall, elastic, sticks", 1.0, 0.06),
    Throw("wall, elastic, slips, sticks, slips", 1.0, 0.5),
    Throw("wall, elastic, slides", 1.0, 2.5),
    Throw("wall, elastic, slides by spin only", 1.0, 0.0, spin=-2.6),
    Throw("wall, e = 0.6, sticks", 0.6, 0.05),
    Throw("wall, e = 0.6, slips and sticks", 0.6, 0.5),
    Throw("wall, e = 0.6, slips and sticks twice", 0.6, 1.0),
    Throw("wall, e = 0.6, slides", 0.6, 3.0),
    Throw("wall, e = 0.6, back spin", 0.6, 0.8, spin=1.4),
    Throw("pair, elastic, slips, sticks, slips", 1.0, 0.5, 0.1, -0.2),
    Throw("pair, elastic, slides", 1.0, 2.5, -0.3, 0.2),
    Throw("pair, e = 0.6, sticks", 0.6, 0.1, 0.0, 0.0),
    Throw("pair, e = 0.6, slips and sticks", 0.6, 0.7, 0.1, 0.2),
    Throw("pair, e = 0.6, slides", 0.6, 3.0, 0.0, 0.5),
    Throw("pair, e = 0.6, spins only", 0.6, 0.0, 0.5, 0.4),
)
N_WALL = sum(t.partner_spin is None for t in THROWS)
MEETINGS = [
    Meeting(t.what, k, "floor") if k < N_WALL else Meeting(t.what, 2 * k - N_WALL, 2 * k - N_WALL + 1)
    for k, t in enumerate(THROWS)
]
SLIDING = [MEETINGS[k] for k, t in enumerate(THROWS[:N_WALL]) if "slides" in t.what]


def _particles() -> Explicit:
    """Every throw `FLIGHT` before its touch, each with its own direction in space."""
    rows: list[tuple[np.ndarray, np.ndarray, np.ndarray, float, str]] = []
    for k, throw in enumerate(THROWS):
        pair, turn, tilt = throw.partner_spin is not None, 0.7 * k, 0.4 + 0.5 * k
        normal, tangent = np.array([0.0, 0.0, 1.0]), np.array([math.cos(turn), math.sin(turn), 0.0])
        if pair:  # normal and tangent are tilted together: no component is along an axis
            normal, tangent = (
                math.cos(tilt) * normal + math.sin(tilt) * tangent,
                math.cos(tilt) * tangent - math.sin(tilt) * normal,
            )
        place, axis = np.array([SPACING * k, 0.0, SPACING if pair else RADIUS]), np.cross(normal, tangent)
        velocity, share = -SPEED * normal + throw.tangential * tangent, 0.8 if pair else 1.0
        name = f"{'hit' if pair else 'ball'}_{throw.restitution:g}".replace(".", "p")
        spin = throw.spin / RADIUS * axis
        rows.append((place - share * FLIGHT * velocity, share * velocity, spin, RADIUS, name))
        if throw.partner_spin is not None:
            partner, away = place - (RADIUS + PARTNER_RADIUS) * normal, (share - 1.0) * velocity
            spin = throw.partner_spin / PARTNER_RADIUS * axis
            rows.append((partner - FLIGHT * away, away, spin, PARTNER_RADIUS, name))
    position, velocity, spin, radius, material = zip(*rows, strict=True)
    return Explicit(
        position=position, velocity=velocity, angular_velocity=spin, radius=radius, material=list(material)
    )


def scene(contact: Contact, dt: float) -> Scene:
    """All throws, `FLIGHT` before their touch."""
    names = {"ball_1": 1.0, "ball_0p6": 0.6, "hit_1": 1.0, "hit_0p6": 0.6}
    tables = [(n, "wall") for n in names] + [(a, b) for k, a in enumerate(names) for b in list(names)[k:]]
    return Scene(
        name="oblique", title=f"oblique impacts, step {dt:.3g} s",
        materials=dict.fromkeys(names, BALL) | {"wall": WALL}, contact=contact,
        pairs=[Pair(materials=pair, restitution=names[pair[0]], friction=FRICTION) for pair in tables],
        particles=_particles(), walls=[floor("wall")],
        domain=Domain(lo=(-0.05, -0.05, -0.001), hi=(SPACING * len(THROWS) + 0.05, 0.05, 0.1)),
        time=Time(step=dt, duration=DURATION), output=Output(trace_every=dt),
    )  # fmt: skip


#: LIGGGHTS' default law, and the options under which its friction obeys Coulomb's law as an impulse.
OPTIONS = {
    "default": Contact(),
    "coulomb": Contact(limit_force=True, tangential_damping=False),
}


def variants(tier: Tier) -> list[Variant]:
    steps = ladder(tier, FLIGHT).items()
    return [
        Variant(f"{name}_{label}", scene(c, dt), timed=name == "default")
        for name, c in OPTIONS.items()
        for label, dt in steps
    ]


WALL_MEETINGS = MEETINGS[:N_WALL]
ELASTIC = [MEETINGS[k] for k, t in enumerate(THROWS) if t.restitution == 1 and not t.what.endswith("sticks")]
DAMPED = [MEETINGS[k] for k, t in enumerate(THROWS) if t.restitution < 1]
SHOWN = [MEETINGS[k] for k in (1, 2, 5, 6, 8, 12)]
FIRST_ORDER = (
    "the dashpots see half-step velocities, and sticking and slip begin at whole steps: first order, about"
    " 1/steps; scattered if the normal force changes sign during slip, by where in a step it does"
)
SECOND_ORDER = "no dashpot, and slip from the first touch: second order, about 1.5/steps^2"

CASE = Case(
    name="oblique",
    title="Oblique impacts with friction and spin",
    purpose=(
        "The tangential force has a history, and most errors of DEM codes are there: the order in which the"
        " spring is stretched, rotated and limited, the dashpot, the lever arm, the sign of a spin. Fifteen"
        " impacts, on a wall and between unequal spheres, in as many directions, stick, slide, or change"
        " between both up to five times within one contact. For a sphere that slides throughout, the loss is"
        " known exactly: mu (1 + e) v_n. LIGGGHTS' default law takes up to a sixth more in a damped impact,"
        " because the friction limit is mu |F_n| also while the contact pulls, and its dashpot is added after"
        " the limit; with limit_force on and tangential_damping off it takes mu (1 + e) v_n."
    ),
    source="The law of LIGGGHTS' manual (hertz, tangential history) by DOP853; Coulomb's line.",
    variants=variants,
    checks=(
        *step_by_step(MEETINGS, spin=True),
        *against_ode("default, damped", DAMPED, 2e-3, (0.75, 1.5), "default", FIRST_ORDER),
        *against_ode("coulomb, damped", DAMPED, 1e-3, (0.85, 1.15), "coulomb", FIRST_ORDER),
        *against_ode("elastic, slips at once", ELASTIC, 3e-6, (1.85, 2.15), "default", SECOND_ORDER),
        *sliding.sliding_checks(
            "elastic", SLIDING[:2], "default", False, 1e-8,
            "friction is mu F_n at every step, so that the impulse is exact; the overlap leaves 1e-9",
        ),
        *sliding.sliding_checks(
            "e = 0.6, coulomb options", SLIDING[2:], "coulomb", True, 5e-3,
            "the normal dashpot makes the first touch stick until the spring is loaded, so that the exact"
            " law itself is some 0.3 % off Coulomb's limit, at any step",
        ),
    ),
    figures=(
        sliding.rebound_map(WALL_MEETINGS, {"default": (False, True), "coulomb": (True, False)}),
        figures.overlay(SHOWN, "default", 1),
        figures.convergence(SHOWN, "default"),
        figures.work_precision(MEETINGS, "default"),
    ),
    tables=(sliding.rebound_table(WALL_MEETINGS, ("default", "coulomb")),),
    features=(
        "normal hertz", "damping", "limit_force", "tangential history", "tangential damping", "rotation",
        "several radii", "several materials", "wall plane", "sphere-sphere",
    ),
    order=30,
)  # fmt: skip
