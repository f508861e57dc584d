"""Balls that roll and slide over a seam, an edge and a rim: energy, spin and flight by the geometry alone."""

from __future__ import annotations

import math

import numpy as np

from comparisons import kit
from comparisons.cases.side_by_side import LIGGGHTS_RULE, OWN_RULE, mesh
from comparisons.cases.walls.scenes import GRAVITY, RADIUS, every_column, no_contact, on_floor, scene
from comparisons.oracles.mesh_contacts import nearest_features
from comparisons.oracles.mesh_shapes import rectangle
from comparisons.report import plots
from gpudem.output.run import Run
from gpudem.scene import Scene

#: Speeds across the ridge and the rim, and along the edge [m/s]. The first is below sqrt(g R cos), so that
#: the ball turns about the edge and does not fly off; the second so small that the start of this turn shakes
#: it little.
OVER_RIDGE, OVER_RIM, ALONG = 0.1, 0.05, 0.04
#: By how much the surface falls beyond the ridge [rad]; friction of the rim where a ball rolls.
RIDGE, ROUGH = math.radians(15), 10.0
DURATION, SIDE = 0.08, 0.03
RULES = {OWN_RULE: ("gpudem",), LIGGGHTS_RULE: None}
#: Rows of the balls of the smooth scene, and of the rough one.
ON_RIDGE, ON_RIM, ON_SEAM, ROLLS_OFF = slice(0, 2), slice(2, 4), slice(0, 2), 2


def folded(angle: float, begin: float) -> np.ndarray:
    """A floor that ends at x = 0 in a face turned down by an angle [rad]; from y = begin on."""
    low, beyond = (-SIDE, begin, 0), (SIDE * math.cos(angle), 0, -SIDE * math.sin(angle))
    width = (0, SIDE, 0)
    return np.concatenate(
        [rectangle(low, (SIDE, 0, 0), width, (3, 2)), rectangle((0, begin, 0), beyond, width, (1, 2))]
    )


def smooth(rule: str) -> Scene:
    """Without friction and damping: two balls over a ridge, two off a rim, straight and at an angle."""
    walls = [mesh("ridge", folded(RIDGE, -0.033)), mesh("table", folded(math.pi / 2, 0.003))]
    high = RADIUS - on_floor()[0]
    position = [[-0.0025, y, high] for y in (-0.028, -0.02)] + [[-0.0015, y, high] for y in (0.012, 0.022)]
    velocity = [[OVER_RIDGE, 0, 0], [OVER_RIDGE, ALONG, 0], [OVER_RIM, 0, 0], [OVER_RIM, ALONG, 0]]
    spin = [20.0, -30.0, 5.0]
    return scene(
        "smooth", walls, position, velocity, spin, duration=DURATION, rule=rule, friction=0.0, restitution=1.0
    )


def rough(rule: str) -> Scene:
    """With friction: two balls roll over the seam of two meshes without common nodes; one rolls off a rim."""
    walls = [
        mesh("near", rectangle((-SIDE, -0.033, 0), (SIDE, 0, 0), (0, SIDE, 0), (3, 2))),
        mesh("far", rectangle((0, -0.033, 0), (SIDE, 0, 0), (0, SIDE, 0), (2, 3))),
        mesh("table", folded(math.pi / 2, 0.003)),
    ]
    deep = on_floor()[0]
    position = [[-0.004, y, RADIUS - deep] for y in (-0.0271, -0.0193)] + [[-0.0015, 0.0123, RADIUS - deep]]
    velocity = np.array([[OVER_RIDGE, 0, 0], [OVER_RIDGE, ALONG, 0], [OVER_RIM, 0, 0]])
    spin = np.cross([0, 0, 1], velocity) / (RADIUS - deep / 2)
    return scene("rough", walls, position, velocity, spin, duration=DURATION, rule=rule, friction=ROUGH)


def variants(tier: kit.Tier) -> list[kit.Variant]:
    """Both scenes by both rules, gpudem's own through gpudem alone."""
    return [
        kit.Variant(f"{rule}_{make.__name__}", make(rule), codes)
        for rule, codes in RULES.items()
        for make in (smooth, rough)
    ]


# -- closed forms --------------------------------------------------------------------------------------------


def off_rim(rolls: bool) -> float:
    """Velocity along x [m/s] with which a ball leaves the rim.

    It turns about the rim by an angle a with v^2 = v0^2 + 2 s g R (1 - cos a), s = 1 where it slides without
    friction, 5/7 where it rolls (7/10 m v^2 in place of 1/2), until v^2 = g R cos a, where the force ends.
    There N = m g cos a - m v^2/R falls as N' = (1 + 2 s) m g sin a v/R. A soft contact ends later by the time
    tau in which the overlap can follow: k (N' tau^3/m)^1.5 = N' tau, 6e-4 s.
    """
    share, reach = 5 / 7 if rolls else 1.0, GRAVITY * RADIUS
    cosine = (OVER_RIM**2 / reach + 2 * share) / (1 + 2 * share)
    return math.sqrt(reach * cosine) * cosine


def energy(run: Run, every: int = 40) -> np.ndarray:
    """Of each ball over time [J]: 1/2 m v^2 + m g z + 2/5 k overlap^2.5, shape (t, n)."""
    corners = np.concatenate([np.array(wall.corners) for wall in run.scene.meshes])
    x, v = (run.trace[c][::every] for c in ("position", "velocity"))
    gap = np.array([[nearest_features(place, corners)[2].min() for place in row] for row in x])
    k, mass = on_floor()[1].normal_constant, run.scene.masses
    return (
        mass * ((v**2).sum(axis=-1) / 2 + GRAVITY * x[..., 2]) + 0.4 * k * np.maximum(RADIUS - gap, 0) ** 2.5
    )


# -- measures ------------------------------------------------------------------------------------------------


def not_across(run: Run) -> str:
    """Why a run shows nothing: a ball that felt no contact, or did not get across the edge."""
    x = run.trace["position"][..., 0]
    return no_contact(run) or (
        "" if (x[0] < 0).all() and (x[-1] > 0).all() else "a ball that did not cross the edge"
    )


def by_rule(results: kit.Results, code: str, what: str, error) -> dict[str, float | tuple[float, float]]:
    """error(run) of a scene by each rule that a code ran."""
    found = {}
    for rule in RULES:
        if (f"{rule}_{what}", code) in results.runs:
            run = results[f"{rule}_{what}", code]
            why = not_across(run)
            found[f"rule {rule} {why}".strip()] = math.nan if why else error(run)
    return found


def energy_error(run: Run) -> float:
    """Largest change of the energy of a ball, by its largest kinetic energy."""
    found, speed = energy(run), np.linalg.norm(run.trace["velocity"], axis=-1).max(axis=0)
    return float((np.abs(found - found[0]) / (run.scene.masses * speed**2 / 2)).max())


def off_rim_error(results: kit.Results) -> dict[str, float | kit.Measured]:
    """Of the velocity along x with which balls fly on."""
    runs = {what: results[f"unique_{what}", "gpudem"] for what in ("smooth", "rough")}
    found: dict[str, float | kit.Measured] = {
        why: math.nan for run in runs.values() if (why := not_across(run))
    }
    for what, row in (("smooth", 2), ("smooth", 3), ("rough", ROLLS_OFF)):
        got = float(runs[what].trace["velocity"][-1, row, 0])
        found[f"{what}, row {row}"] = kit.relative(got, off_rim(what == "rough"))
    return found


def spin_error(results: kit.Results) -> float:
    """Largest error of the spin of the ball that turns about the rim, by what it should be at that angle."""
    trace = results["unique_rough", "gpudem"].trace
    x, spin = (trace[c][:, ROLLS_OFF] for c in ("position", "angular_velocity"))
    cosine = np.cos(np.arctan2(x[:, 0], x[:, 2]))
    squared = OVER_RIM**2 + 10 / 7 * GRAVITY * RADIUS * (1 - cosine)
    pressed = (x[:, 0] > 0) & (x[:, 2] > 0) & (cosine - squared / (GRAVITY * RADIUS) > 0.2)
    if np.count_nonzero(pressed) < 1000:
        return math.nan  # it did not turn about the rim
    return float(np.abs(spin[pressed, 1] * RADIUS / np.sqrt(squared[pressed]) - 1).max())


def kept_error(run: Run) -> float:
    """Largest change of spin and of velocity along the edge, by those at the start and OVER_RIDGE."""
    spin, along = run.trace["angular_velocity"], run.trace["velocity"][..., 1]
    return max(
        float(np.abs(spin - spin[0]).max() / np.linalg.norm(spin[0, 0])),
        float(np.abs(along - along[0]).max() / OVER_RIDGE),
    )


def kick(run: Run) -> float:
    """Largest change of velocity and spin of the balls over the seam, by those at the start."""
    return max(
        float(np.linalg.norm(moved - moved[0], axis=-1).max() / np.linalg.norm(moved[0, 0]))
        for moved in (run.trace[c][:, ON_SEAM] for c in ("velocity", "angular_velocity"))
    )


def draw(results: kit.Results) -> plots.Figure:
    """Ways over ridge and rim from the side; velocity over the seam."""
    figure, axes = plots.figure(1, 3, width=plots.WHOLE, height=2.9)
    for axis, what, row, angle in ((axes[0], "smooth", 0, RIDGE), (axes[1], "smooth", 2, math.pi / 2)):
        fall = np.array([[-5.0, 0.0], [0.0, 0.0], [8 * math.cos(angle), -8 * math.sin(angle)]])
        axis.plot(*fall.T, color=plots.INK)
        for code in results.codes(f"liggghts_{what}"):
            x = 1e3 * results[f"liggghts_{what}", code].trace["position"]
            axis.plot(x[:, row, 0], x[:, row, 2], **plots.style(code, markevery=400))
        axis.set(xlabel="x [mm]", ylabel="z of the center [mm]", aspect="equal")
    axes[0].set(title="ridge of 15 degrees, smooth")
    axes[1].set(title="rim, smooth")
    for rule in RULES:
        for code in results.codes(f"{rule}_rough"):
            trace = results[f"{rule}_rough", code].trace
            look = plots.style(code, markevery=25, label=f"{plots.name(code)}, '{rule}'")
            look |= {"color": plots.SERIES[2], "zorder": 6} if rule == "unique" else {}
            axes[2].plot(1e3 * trace["position"][:, 0, 0], trace["velocity"][:, 0, 2], **look)
    axes[2].set(
        title="seam of two meshes, rolling", xlabel="x [mm]", ylabel="velocity along z [m/s]", xlim=(-1, 2)
    )
    plots.legend(axes[0])
    plots.legend(axes[2])
    return figure


CASE = kit.Case(
    name="ball_over_edge",
    title="Balls over a seam, an edge and a rim",
    purpose=(
        "A ball that rolls over the seam of two meshes in one plane goes on as before by rule 'unique'; by"
        " LIGGGHTS' rule the rims of both push it up. Over a ridge, and off the rim of a table, a ball"
        " without friction keeps its energy and spin; off the rim it flies with the velocity, and where it"
        " rolls with the spin, that the geometry gives."
    ),
    source="Energy, and the balance of forces where the ball leaves the rim, derived in the case.",
    variants=variants,
    checks=(
        kit.check(
            "energy over ridge and rim without friction, largest change / largest kinetic energy (gpudem,"
            " rule 'unique')",
            lambda results: by_rule(results, "gpudem", "smooth", energy_error)["rule unique"], tolerance=1e-7,
            against="conservation", needs=("gpudem",),
            reason="the Verlet step keeps the energy but for dt^2 g/(6 R), 5.5e-8, where the force turns"
            " with the ball, and (w dt)^2/8, 1.5e-4, of the vibration that starts at the edge, 1e-4 of the"
            " kinetic energy",
            catches="two contacts at an edge, or none for a step: a kick of force times way",
        ),
        kit.per_code(
            "spin, and velocity along the edge, without friction, largest change, relative",
            lambda results, code: by_rule(results, code, "smooth", kept_error), tolerance=1e-12,
            against="conservation", reason="no force along the edge and no torque: rounding",
            catches="a normal that does not lead from the edge to the center; friction where there is none",
        ),
        kit.check(
            "velocity off the rim, smooth and rolling, relative error (gpudem, rule 'unique')", off_rim_error,
            tolerance=5e-3, against="closed form", needs=("gpudem",),
            reason="the start of the turn takes 0.06 of the weight off at once, and the ball vibrates with"
            " up to 2.3e-4 m/s: 1.7e-3; the soft contact ends later by tau, with m N' tau^2/2: 1.2e-3;"
            " overlap over R, 4e-4; where it rolls, friction is less than 2/7 m g sin a at the end: 1e-3",
            catches="a rim that holds the ball too long, or not at all; a spring lost at the rim",
        ),
        kit.check(
            "spin of a ball that rolls over the rim, largest error over its turn, relative (gpudem, rule"
            " 'unique')",
            spin_error, tolerance=1.2e-3, against="closed form", needs=("gpudem",),
            reason="the spring yields as the overlap falls, by 4e-4 of the velocity where a fifth of the"
            " weight is left; overlap over R, 4e-4; the step at the start of the turn, 4e-4",
            catches="a spring lost where the contact goes from face to rim; an arm of another length",
        ),
        kit.check(
            "velocity and spin of a ball that rolls over a seam, largest change, relative (gpudem, rule"
            " 'unique')",
            lambda results: by_rule(results, "gpudem", "rough", kick)["rule unique"], tolerance=1e-12,
            against="rolling on a plane", reason="no force but the weight's: rounding", needs=("gpudem",),
            catches="the rim of a mesh that counts beside the face of the next; a spring not handed on",
        ),
        *every_column(
            {
                "position": "a face that counts beyond its edge",
                "velocity": "an edge of the wrong triangle",
                "angular_velocity": "a spring that goes from face to edge, or does not",
                "force": "an edge or a rim that counts a step earlier or later",
            },
            "liggghts_", defect=not_across, tolerance=1e-9,
            reason="same law, scheme and rule: rounding, which nothing here makes grow",
        ),
    ),
    findings=(
        kit.Finding(
            "energy over ridge and rim by rule 'liggghts', largest change / largest kinetic energy",
            lambda results: energy_error(results["liggghts_smooth", "gpudem"]), "1",
            "By LIGGGHTS' rule an edge counts beside the face that a ball leaves, so that the force is"
            " doubled over the last sqrt(2 R overlap) before the edge, and halved there.",
        ),
        kit.Finding(
            "kick of the seam of two meshes in one plane by rule 'liggghts', change / velocity or spin",
            lambda results: kick(results["liggghts_rough", "gpudem"]), "1",
            "The rims of two meshes that meet count beside their faces: join meshes of one plane in one"
            " file, with common nodes, or use rule 'unique'.",
        ),
    ),
    figures=(
        kit.Figure(
            "Over a ridge, off a rim, over a seam",
            "Ways of the centers from the side, and the velocity up over a seam, which is none by rule"
            " 'unique'.",
            draw,
        ),
    ),
    features=("wall mesh", "tangential history", "rotation"),
    order=35,
)  # fmt: skip
