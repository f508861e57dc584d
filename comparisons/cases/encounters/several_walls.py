"""Two rough walls touched at once, a gate that is removed in contact, a box with a side left out."""

from __future__ import annotations

import numpy as np

from comparisons.cases.encounters import figures
from comparisons.cases.encounters import scenes as of
from comparisons.cases.encounters.checks import against_ode, happens, overlap, present, step_by_step
from comparisons.harness import check_builders as build
from comparisons.harness.case import Case, Measured, Results, Tier, Variant, largest
from comparisons.metrics import trace
from comparisons.oracles.planes import on_planes
from gpudem.output.run import Run

SOLVED = {"gate": of.AT_THE_GATE, "open_box": of.IN_THE_BOX}
LEANS = of.Encounter("leans on gate and floor", ((of.LEANS, "gate"), (of.LEANS, "floor")))
ALL = {"corner": of.CORNER, "gate": [*of.AT_THE_GATE, LEANS], "open_box": of.IN_THE_BOX}


def variants(tier: Tier) -> list[Variant]:
    """An edge of two walls; a gate; a box of five sides."""
    return [
        Variant("corner", of.corner()),
        Variant("gate", of.gate()),
        Variant("open_box", of.open_box()),
    ]


def share_of_both(run: Run) -> dict[str, float]:
    """Steps in contact with both walls by those in contact with one, of each ball in the corner."""
    touched = {e.what: [present(run, m) for m in e.contacts] for e in of.CORNER}
    return {what: float((a & b).sum() / (a | b).sum()) for what, (a, b) in touched.items()}


def against_small_steps(results: Results, code: str) -> Measured:
    """Velocity and R x spin of the balls in the corner against the law in steps of a fifth."""
    run, found = results["corner", code], {}
    rows, walls = [e.meetings[0][0] for e in of.CORNER], [name for _, name in of.CORNER[0].meetings]
    time, radius = run.trace["time"], run.scene.state.radius[rows]
    truth = results.once(
        ("planes", run.scene.hash), lambda: on_planes(run.scene, rows, [str(w) for w in walls], time)
    )
    for column, scale in (("velocity", np.ones(len(rows))), ("angular_velocity", 1 / radius)):
        found[column] = trace.largest_difference(run.trace[column][:, rows], truth[column], scale)
    return largest(found)


def mirrored(results: Results, code: str) -> Measured:
    """Velocity and R x spin of the mirrored ball against the mirror image of the other."""
    run = results["corner", code]
    first, second = of.MIRRORED
    swap, radius = [2, 1, 0], run.scene.state.radius[first]
    velocity, spin = run.trace["velocity"], run.trace["angular_velocity"]
    return largest(
        {
            "velocity": float(
                np.linalg.norm(velocity[:, first][:, swap] - velocity[:, second], axis=1).max()
            ),
            "spin": float(radius * np.linalg.norm(spin[:, first][:, swap] + spin[:, second], axis=1).max()),
        }
    )


def at_removal(run: Run) -> dict[str, float]:
    """Overlap at the step of the removal by the largest of the run, of each contact."""
    step = run.scene.steps(of.REMOVED)
    found = {}
    for meeting in (m for e in ALL["gate"] for m in e.contacts):
        deep = overlap(run, meeting)
        before = deep[run.trace["step"] <= step]
        found[f"{meeting.label}: {meeting.other}"] = float(before[-1] / before.max())
    return found


def after_the_gate(results: Results, code: str) -> Measured:
    """Largest force on the ball that was on the gate, while it would still touch it, by m (1 m/s) / step."""
    run = results["gate", code]
    meeting = of.AT_THE_GATE[0].contacts[0]
    still = (overlap(run, meeting) > 0) & (run.trace["step"] > run.scene.steps(of.REMOVED))
    force = np.linalg.norm(run.trace["force"][still, meeting.row], axis=-1).max()
    unit = run.scene.masses[meeting.row] / run.scene.time.step
    return Measured(float(force / unit), note=f"{int(still.sum())} steps")


def passes(results: Results, code: str) -> Measured:
    """Largest distance of the passing ball from its straight path / radius."""
    run = results["open_box", code]
    state, row = run.scene.state, of.PASSES
    path = state.position[row] + run.trace["time"][:, None] * state.velocity[row]
    off = np.linalg.norm(run.trace["position"][:, row] - path, axis=1).max()
    return Measured(float(off / state.radius[row]))


def passed(run: Run) -> dict[str, float]:
    """How far the ball gets beyond the side that is left out, by its radius."""
    return {
        of.OPEN: float(
            (run.trace["position"][-1, of.PASSES, 1] - of.HALF) / run.scene.state.radius[of.PASSES]
        )
    }


CATCHES = "one spring for all walls; a force of one wall that replaces that of another"
CASE = Case(
    name="several_walls",
    title="Two walls at once, a gate, a box with an open side",
    purpose=(
        "Mistakes that need more than one wall to show. Balls fly into the edge of two rough walls and"
        " touch both at once: one slides in opposite directions on them; two are mirror images of one"
        " another, as the walls are, and must stay so to rounding, which a spring that two walls share does"
        " not allow. A gate is removed in the middle of five contacts: the ball on the gate flies on at the"
        " speed that it has, while the springs of the ball on the floor and of two balls stay as they are. A"
        " box has five sides; a ball leaves where the sixth would be, and feels no force."
    ),
    source="Mirror symmetry; the law of LIGGGHTS' manual by DOP853, and in small steps.",
    variants=variants,
    checks=(
        happens(
            "corner: steps in contact with both walls / with one, smallest", 0.6, "1", share_of_both,
            ("corner",), "a scene in which no ball touches two walls at once",
        ),
        build.per_code(
            "corner: velocity and R x spin, largest difference over all steps / (1 m/s)", against_small_steps,
            tolerance=1e-2, against="the law in steps of a fifth (symplectic Euler)",
            reason="as against the ODE: dashpots at half-step velocities, slip and stick at whole steps, up"
            " to 5e-3; times two",
            catches=CATCHES,
        ),
        build.per_code(
            "corner: a ball and its mirror image, largest difference of velocity and R x spin / (1 m/s)",
            mirrored, tolerance=1e-11, against="mirror symmetry",
            reason="the walls are mirror images too; x and z differ by rounding only", catches=CATCHES,
        ),
        happens(
            "gate: overlap at its removal / largest until then, smallest of all contacts", 0.5, "1",
            at_removal, ("gate",), "a gate that is removed with no ball in contact",
        ),
        build.per_code(
            "gate: force on the ball where the gate was / (mass x 1 m/s / step)", after_the_gate,
            tolerance=0.0, against="no wall, no force", reason="an exact statement",
            catches="a gate that stays, or is removed late; a contact that outlives its wall",
        ),
        build.per_code(
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
        figures.through("corner", of.CORNER, "In the edge of two walls", exactly=False),
        figures.through("gate", of.AT_THE_GATE, "A gate is removed at 35 us"),
    ),
    tables=(figures.table(SOLVED),),
    features=("normal hertz", "damping", "tangential history", "wall plane", "gate", "box", "rotation"),
    order=36,
)  # fmt: skip
