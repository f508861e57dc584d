"""Oblique impacts with friction and spin, on a wall and between spheres, from sticking to gross sliding."""

from __future__ import annotations

import dataclasses

import numpy as np

from comparisons import kit
from comparisons.cases.side_by_side import Spheres, floor, traced, turned
from comparisons.cases.single_contact import figures
from comparisons.cases.single_contact.checks import against_ode, step_by_step
from comparisons.cases.single_contact.meetings import Meeting, exact, ladder, relative_velocity
from comparisons.oracles import closed_forms, contact_ode
from comparisons.oracles.impact import Impact
from comparisons.report import plots
from gpudem.output.run import Run
from gpudem.scene import Contact, Material, Pair, Scene

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
WALL_MEETINGS = MEETINGS[:N_WALL]
SLIDING = [m for m in WALL_MEETINGS if "slides" in m.label]
ELASTIC = [m for m in MEETINGS if "elastic" in m.label and not m.label.endswith("sticks")]
DAMPED = [m for m in MEETINGS if "elastic" not in m.label]
SHOWN = [MEETINGS[k] for k in (1, 2, 5, 6, 8, 12)]
#: LIGGGHTS' default law, and the options under which its friction obeys Coulomb's law as an impulse.
OPTIONS = {"default": Contact(), "coulomb": Contact(limit_force=True, tangential_damping=False)}


def scene(contact: Contact, dt: float) -> Scene:
    """Every throw `FLIGHT` before its touch, each with its own direction in space."""
    rows = Spheres()
    for k, throw in enumerate(THROWS):
        pair = throw.partner_spin is not None
        # normal and tangent of pairs are tilted together: no component is along an axis
        normal, tangent = turned(0.7 * k, 0.4 + 0.5 * k if pair else 0.0)
        place, axis = np.array([SPACING * k, 0.0, SPACING if pair else RADIUS]), np.cross(normal, tangent)
        velocity, share = -SPEED * normal + throw.tangential * tangent, 0.8 if pair else 1.0
        name = f"{'hit' if pair else 'ball'}_{throw.restitution:g}".replace(".", "p")
        at = place - share * FLIGHT * velocity
        rows.add(at, share * velocity, throw.spin / RADIUS * axis, RADIUS, name)
        if throw.partner_spin is not None:
            away, spin = (share - 1.0) * velocity, throw.partner_spin / PARTNER_RADIUS * axis
            at = place - (RADIUS + PARTNER_RADIUS) * normal - FLIGHT * away
            rows.add(at, away, spin, PARTNER_RADIUS, name)
    names = {"ball_1": 1.0, "ball_0p6": 0.6, "hit_1": 1.0, "hit_0p6": 0.6}
    tables = [(n, "wall") for n in names] + [(a, b) for k, a in enumerate(names) for b in list(names)[k:]]
    return traced(
        "oblique", rows.explicit(), title=f"oblique impacts, step {dt:.3g} s", contact=contact,
        materials=dict.fromkeys(names, BALL) | {"wall": WALL}, walls=[floor("wall")],
        pairs=[Pair(materials=pair, restitution=names[pair[0]], friction=FRICTION) for pair in tables],
        step=dt, duration=DURATION, lo=(-0.05, -0.05, -0.001), hi=(SPACING * len(THROWS) + 0.05, 0.05, 0.1),
    )  # fmt: skip


# -- loss by friction: Coulomb's limit mu (1 + e) v_n, and a map of the slip ---------------------------------


def changes(results: kit.Results, run: Run, m: Meeting) -> tuple[float, float]:
    """Change of (tangential velocity [m/s], spin [rad/s]) of a sphere on a wall, along the oracle's axes."""
    frame = exact(results, run.scene, m).frame
    velocity, spin = relative_velocity(run, m), run.trace["angular_velocity"][:, m.row]
    return float((velocity[-1] - velocity[0]) @ frame[1]), float((spin[-1] - spin[0]) @ frame[2])


def sliding_checks(
    what: str, meetings: list[Meeting], prefix: str, tolerance: float, reason: str
) -> tuple[kit.PerCode, ...]:
    """Per code: velocity and spin after gross sliding, largest relative error of their changes, by the closed
    form with the lever arm R - overlap/2.
    """
    names = ("tangential velocity lost", "spin gained")

    def observe(results: kit.Results, code: str) -> dict[str, dict[str, tuple[float, float]]]:
        run, found = results[results.finest(prefix), code], {name: {} for name in names}
        for m in meetings:
            t, limit = exact(results, run.scene, m), run.scene.contact.limit_force
            push, turn = closed_forms.sliding_rebound(t.bodies, t.speed, t.slip, limit)
            # the oracle's e3 = normal x slip: spin that adds to the slip is negative
            for name, *pair in zip(names, changes(results, run, m), (push, -turn), strict=True):
                found[name][m.label] = tuple(pair)
        return found

    catches = "friction not limited to mu F_n, a dashpot added after the limit, a wrong moment of inertia"
    return kit.per_quantity(
        observe, dict.fromkeys(names, catches), f"{what}: {{}} in gross sliding, relative error",
        tolerance=tolerance, against="closed form", reason=reason,
    )  # fmt: skip


SLIPS = np.geomspace(0.02, 3.2, 25)


def _lost(truth: Impact, contact: Contact) -> np.ndarray:
    """Tangential velocity lost [m/s] for each slip speed, by the ODE."""
    law, lost = contact_ode.Law(True, contact.limit_force, contact.tangential_damping), []
    for slip in SLIPS:
        start = np.zeros(11)
        start[2], start[3] = -truth.speed, slip
        lost.append(slip - contact_ode.solve(truth.bodies, law, start, rtol=1e-10).final[3])
    return np.array(lost)


def _map(results: kit.Results) -> plots.Figure:
    figure, axes = plots.figure(width=plots.WHOLE, height=4.2)
    colors = iter(plots.SERIES)
    for prefix, contact in OPTIONS.items():
        label = results.finest(prefix)
        ran = results.codes(label)
        solved = {m: exact(results, results[label, ran[0]].scene, m) for m in WALL_MEETINGS}
        for e in (1.0, 0.6):
            group = {m: t for m, t in solved.items() if t.bodies.restitution == e}
            truth = next(iter(group.values()))
            unit = truth.bodies.friction * truth.speed
            lost = results.once(("map", prefix, e), lambda t=truth, law=contact: _lost(t, law))
            exactly = SLIPS / unit, lost / (unit * (1 + e))
            slips, found = [t.slip / unit for t in group.values()], {}
            for code in ran:
                got = np.array([-changes(results, results[label, code], m)[0] for m in group])
                found[code] = slips, got / (unit * (1 + e))
            plots.exact_and_marks(axes, None, exactly, found, next(colors), f"{prefix}, e = {e:g}")
    axes.axhline(1, color="0.6", lw=1, ls=":")
    axes.set(xscale="log", xlabel="slip speed / (mu v_n)", ylabel="velocity lost / (mu (1 + e) v_n)")
    plots.legend(axes, points=results.codes())
    return figure


def _after(results: kit.Results, code: str) -> dict[str, dict[str, tuple[float, float]]]:
    """Changes in each impact on the wall, beside the ODE, with what the contact does in it."""
    velocity, spin = {}, {}
    for prefix in OPTIONS:
        run = results[results.finest(prefix), code]
        for m in WALL_MEETINGS:
            contact, got = exact(results, run.scene, m).contact, changes(results, run, m)
            want = (contact.final - contact.state(0.0))[3:5]
            where = f"{prefix}, {m.label}: {' '.join(phase.mode for phase in contact.phases)}"
            velocity[where], spin[where] = (got[0], float(want[0])), (got[1], float(want[1]))
    return {"velocity change [m/s]": velocity, "spin change [rad/s]": spin}


FIRST_ORDER = (
    "the dashpots use half-step velocities, and sticking and slip begin at whole steps: first order, about"
    " 1/steps; if the normal force changes sign during slip, the error scatters with the phase of that moment"
    " within a step"
)
SECOND_ORDER = "no dashpot, and slip from the first touch: second order, about 1.5/steps^2"

CASE = kit.Case(
    name="oblique",
    title="Oblique impacts with friction and spin",
    purpose=(
        "The tangential force has a history, and most errors of DEM codes are there: the order in which the"
        " spring is stretched, rotated and limited, the dashpot, the lever arm, the sign of a spin. Fifteen"
        " impacts, on a wall and between unequal spheres, in as many directions, stick, slide, or change"
        " between both up to five times within one contact. For a sphere that slides throughout, the loss is"
        " known exactly: mu (1 + e) v_n. With LIGGGHTS' default law a damped impact loses up to a sixth more,"
        " because the friction limit is mu |F_n| also while the normal force is tensile, and the dashpot is"
        " added after the limit; with limit_force on and tangential_damping off the loss is mu (1 + e) v_n."
    ),
    source="The law of LIGGGHTS' manual (hertz, tangential history) by DOP853; Coulomb's limit.",
    variants=lambda tier: [
        kit.Variant(f"{name}_{label}", scene(contact, dt), timed=name == "default")
        for name, contact in OPTIONS.items()
        for label, dt in ladder(tier, FLIGHT).items()
    ],
    checks=(
        *step_by_step(MEETINGS, spin=True),
        *against_ode("default, damped", DAMPED, 2e-3, (0.75, 1.5), "default", FIRST_ORDER),
        *against_ode("coulomb, damped", DAMPED, 1e-3, (0.85, 1.15), "coulomb", FIRST_ORDER),
        *against_ode("elastic, slips at once", ELASTIC, 3e-6, (1.85, 2.15), "default", SECOND_ORDER),
        *sliding_checks(
            "elastic", SLIDING[:2], "default", 1e-8,
            "friction is mu F_n at every step, so that the impulse is exact; the overlap changes it by 1e-9",
        ),
        *sliding_checks(
            "e = 0.6, coulomb options", SLIDING[2:], "coulomb", 5e-3,
            "the normal dashpot makes the contact stick at its beginning until the spring is loaded, so that"
            " the exact solution of the law differs from Coulomb's limit by about 0.3 %, at any step",
        ),
    ),
    figures=(
        kit.Figure(
            "Tangential velocity lost in an oblique impact",
            "Lines: the exact law; dotted: Coulomb's limit. With the default options a damped impact loses"
            " more than Coulomb's law allows: the normal force is tensile late in the rebound, where the"
            " friction limit is mu |F_n| too, and the dashpot is added after the limit. With limit_force on"
            " and tangential_damping off the loss is Coulomb's, for the restitution that limit_force gives.",
            _map,
        ),
        figures.overlay(SHOWN, "default", 1),
        *figures.of_steps(SHOWN, MEETINGS, "default"),
    ),
    tables=(
        kit.table(
            "Oblique impacts on the wall",
            "Finest step. Velocities along the first slip, spins about the axis normal x slip; phases by"
            " the ODE.",
            _after, reference="ODE",
        ),
    ),
    features=(
        "normal hertz", "damping", "limit_force", "tangential history", "tangential damping", "rotation",
        "several radii", "several materials", "wall plane", "sphere-sphere",
    ),
    order=30,
)  # fmt: skip
