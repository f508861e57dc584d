"""Two rough walls touched at once, a gate that is removed in contact, a box with a side left out."""

from __future__ import annotations

import numpy as np

from comparisons import kit
from comparisons.cases.encounters import figures, throws
from comparisons.cases.encounters.checks import against_ode, differences, happens, present, step_by_step
from comparisons.cases.encounters.throws import FLIGHT, PARTNER_RADIUS, RADIUS, SPACING, Encounter, Throw
from comparisons.cases.side_by_side import floor, plane, turned
from comparisons.cases.single_contact.meetings import overlap
from comparisons.oracles.planes import on_planes
from gpudem.output.run import Run
from gpudem.scene import Box, Pair, Scene, Side, Solver

#: The throw of most balls here; its material is of restitution 0.6.
SLIPS = Throw("slips and sticks", 0.6, 0.5)
FLOOR = floor("wall")
#: Balls in the edge of side and floor; the rows of two that are mirror images, as side and floor are.
CORNER = [
    Encounter("slides in opposite directions", ((0, "side"), (0, "floor"))),
    Encounter("slips and sticks", ((1, "side"), (1, "floor"))),
    Encounter("its mirror image", ((2, "side"), (2, "floor"))),
]
MIRRORED = (1, 2)
#: When the gate is removed [s]: all of the impacts below are half over; and where it stands [m].
REMOVED, GATE_AT = 175 * throws.STEP, 0.05
AT_THE_GATE = [
    Encounter("on the gate", ((0, "gate"),)),
    Encounter("on the floor", ((1, "floor"),)),
    Encounter("two balls", ((2, 3),)),
]
LEANS = Encounter("leans on gate and floor", ((4, "gate"), (4, "floor")))
#: Half a side of the box [m]; the side that is left out; the row of the ball that passes there.
HALF, OPEN, PASSES = 0.05, "yhi", 5
SIDES: tuple[Side, ...] = ("xlo", "xhi", "ylo", "zlo", "zhi")
IN_THE_BOX = [Encounter(side, ((k, f"box_{side}"),)) for k, side in enumerate(SIDES)]
SOLVED = {"gate": AT_THE_GATE, "open_box": IN_THE_BOX}
ALL = {"corner": CORNER, "gate": [*AT_THE_GATE, LEANS], "open_box": IN_THE_BOX}


def corner() -> Scene:
    """Balls that fly into the edge between a floor and a side, and touch both at once."""
    rows, spin = throws.Spheres(), 2.6 / RADIUS
    thrown = [
        ("ball_1", (-1.0, 0.0, -0.7), (-spin, 0.0, -spin)),
        ("ball_0p6", (-1.0, 0.5, -0.6), (50.0, 120.0, 200.0)),
        ("ball_0p6", (-0.6, 0.5, -1.0), (-200.0, -120.0, -50.0)),
    ]
    for k, (material, velocity, turning) in enumerate(thrown):
        place = np.array([RADIUS, SPACING * k, RADIUS]) - FLIGHT * np.array(velocity)
        rows.add(place, velocity, turning, material=material)
    walls = [plane("side", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)), FLOOR]
    return throws.scene("corner", rows, [SLIPS, Throw("", 1.0, 0.0)], "wall", walls=walls, steps=450)


def gate() -> Scene:
    """Impacts on a gate, on the floor, of two balls and of a ball on both walls; then the gate is removed."""
    rows = throws.Spheres()
    rows.throw(SLIPS, (GATE_AT - RADIUS, 0.0, SPACING), np.array([[-1.0, 0.0, 0.0], [0.0, 0.8, 0.6]]))
    rows.throw(SLIPS, (0.0, 0.0, RADIUS), turned(0.7))
    rows.throw(SLIPS, (0.0, SPACING, SPACING), turned(1.4, 0.9), radii=(RADIUS, PARTNER_RADIUS))
    velocity = np.array([0.6, 0.5, -0.8])
    place = np.array([GATE_AT - RADIUS, -SPACING, RADIUS]) - FLIGHT * velocity
    ball = SLIPS.material
    rows.add(place, velocity, (100.0, 50.0, -80.0), material=ball)
    pairs = [Pair(materials=(ball, ball), restitution=0.6, friction=throws.FRICTION)]
    walls = [plane("gate", (GATE_AT, 0.0, 0.0), (-1.0, 0.0, 0.0), removed_at=REMOVED), FLOOR]
    return throws.scene("gate", rows, [SLIPS], "wall", pairs=pairs, walls=walls, steps=425)


def open_box() -> Scene:
    """An oblique impact on each side of a box, and a ball that leaves where a side is left out."""
    rows = throws.Spheres()
    for k, side in enumerate(SIDES):
        axis, sign = "xyz".index(side[0]), 1.0 if side.endswith("lo") else -1.0
        normal, tangent = sign * np.eye(3)[axis], np.roll([0.0, 0.8, -0.6], axis)
        throw = Throw(side, 0.6, 0.4 + 0.1 * k, (0.1 * k, 0.0))
        rows.throw(throw, (RADIUS - HALF) * normal, np.array([normal, tangent]))
    small = RADIUS / 2
    rows.add((0.0, HALF - 1.1 * small, 0.02), (0.0, 45.0, 0.0), (0.0, 0.0, 300.0), small, SLIPS.material)
    lo, hi = (-HALF, -HALF, -HALF), (HALF, HALF, HALF)
    box = Box(kind="box", name="box", material="wall", sides=SIDES, lo=lo, hi=hi)
    skin = Solver(skin=0.008)  # no rebuild as the ball passes: those are for the moving pairs
    return throws.scene("open_box", rows, [SLIPS], "wall", walls=[box], steps=425, size=2 * HALF, solver=skin)


def share_of_both(run: Run) -> dict[str, float]:
    touched = {e.what: [present(run, m) for m in e.contacts] for e in CORNER}
    return {what: float((a & b).sum() / (a | b).sum()) for what, (a, b) in touched.items()}


def against_small_steps(results: kit.Results, code: str) -> dict[str, float]:
    run, rows = results["corner", code], [0, 1, 2]
    planes = ["side", "floor"]
    truth = results.once(
        ("planes", run.scene.hash), lambda: on_planes(run.scene, rows, planes, run.trace["time"])
    )
    return differences({c: run.trace[c][:, rows] for c in truth}, truth, run.scene.state.radius[rows])


def mirrored(results: kit.Results, code: str) -> dict[str, float]:
    """In the mirror x and z change places, and a spin its sign."""
    run, (first, second), swap = results["corner", code], MIRRORED, [2, 1, 0]
    velocity, spin = run.trace["velocity"], run.trace["angular_velocity"]
    gap = np.linalg.norm(velocity[:, first][:, swap] - velocity[:, second], axis=1).max()
    turning = np.linalg.norm(spin[:, first][:, swap] + spin[:, second], axis=1).max()
    return {"velocity": float(gap), "spin": float(run.scene.state.radius[first] * turning)}


def at_removal(run: Run) -> dict[str, float]:
    found = {}
    for meeting in (m for e in ALL["gate"] for m in e.contacts):
        before = overlap(run, meeting)[run.trace["step"] <= run.scene.steps(REMOVED)]
        found[f"{meeting.label}: {meeting.other}"] = float(before[-1] / before.max())
    return found


def after_the_gate(results: kit.Results, code: str) -> kit.Measured:
    run, meeting = results["gate", code], AT_THE_GATE[0].contacts[0]
    still = (overlap(run, meeting) > 0) & (run.trace["step"] > run.scene.steps(REMOVED))
    force = np.linalg.norm(run.trace["force"][still, meeting.row], axis=-1).max()
    unit = run.scene.masses[meeting.row] / run.scene.time.step
    return kit.Measured(float(force / unit), note=f"{int(still.sum())} steps")


def passes(results: kit.Results, code: str) -> float:
    run = results["open_box", code]
    state = run.scene.state
    path = state.position[PASSES] + run.trace["time"][:, None] * state.velocity[PASSES]
    off = np.linalg.norm(run.trace["position"][:, PASSES] - path, axis=1).max()
    return float(off / state.radius[PASSES])


def passed(run: Run) -> dict[str, float]:
    beyond = run.trace["position"][-1, PASSES, 1] - HALF
    return {OPEN: float(beyond / run.scene.state.radius[PASSES])}


CATCHES = "one spring for all walls; a force of one wall that replaces that of another"
CASE = kit.Case(
    name="several_walls",
    title="Two walls at once, a gate, a box with an open side",
    purpose=(
        "Defects that appear only with more than one wall. Balls hit the edge between two rough walls and"
        " touch both at once. One of them slides in opposite directions on the two walls; two others are"
        " mirror images of each other, as the walls are, and must remain so to rounding, which a spring"
        " shared by two walls would not allow. A gate is removed during five contacts: the ball on the gate"
        " continues at the speed that it has, while the springs on the floor and between two balls do not"
        " change. A box has five sides: a ball that leaves through the missing sixth is subject to no force."
    ),
    source="Mirror symmetry; the law of LIGGGHTS' manual by DOP853, and with small time steps.",
    variants=lambda tier: [
        kit.Variant("corner", corner()), kit.Variant("gate", gate()), kit.Variant("open_box", open_box())
    ],
    checks=(
        happens(
            "corner: steps in contact with both walls / with one, smallest", 0.6, "1", share_of_both,
            ("corner",), "a scene in which no ball touches two walls at once",
        ),
        kit.per_code(
            "corner: velocity and R x spin, largest difference over all steps / (1 m/s)", against_small_steps,
            tolerance=1e-2, against="the law in steps of a fifth (symplectic Euler)",
            reason="as against the ODE: dashpots at half-step velocities, slip and stick at whole steps, up"
            " to 5e-3; times two",
            catches=CATCHES,
        ),
        kit.per_code(
            "corner: a ball and its mirror image, largest difference of velocity and R x spin / (1 m/s)",
            mirrored, tolerance=1e-11, against="mirror symmetry",
            reason="the walls are mirror images too; x and z differ by rounding only", catches=CATCHES,
        ),
        happens(
            "gate: overlap at its removal / largest until then, smallest of all contacts", 0.5, "1",
            at_removal, ("gate",), "a gate that is removed with no ball in contact",
        ),
        kit.per_code(
            "gate: force on the ball where the gate was / (mass x 1 m/s / step)", after_the_gate,
            tolerance=0.0, against="no wall, no force", reason="an exact statement",
            catches="a gate that stays, or is removed late; a contact that remains after its wall is removed",
        ),
        kit.per_code(
            "open_box: distance of the passing ball from a straight line / radius", passes, tolerance=1e-11,
            against="free flight", reason="rounding: 425 steps added up",
            catches="a box that is closed where a side is left out",
        ),
        happens(
            "open_box: distance of the passing ball beyond the open side / radius", 1.0, "1", passed,
            ("open_box",), "a ball that does not reach the open side",
        ),
        *step_by_step(ALL, CATCHES),
        *against_ode(
            SOLVED, "springs lost at the removal of a gate; a side of a box in the wrong place", elastic=None
        ),
    ),
    figures=(
        figures.through("corner", CORNER, "At the edge between two walls", exactly=False),
        figures.through("gate", AT_THE_GATE, "A gate is removed at 35 us"),
    ),
    tables=(figures.table(SOLVED),),
    features=("normal hertz", "damping", "tangential history", "wall plane", "gate", "box", "rotation"),
    order=36,
)  # fmt: skip
