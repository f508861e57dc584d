"""A lid that follows a force presses a small bed in a box: the force is reached, and walls carry it."""

from __future__ import annotations

from typing import Any

import numpy as np

from comparisons import kit
from comparisons.cases import over_seeds
from comparisons.cases.dam_break import checks as bulk
from comparisons.cases.machines import hopper_scenes as beds
from comparisons.cases.machines.hopper_scenes import DIAMETER, FRICTION
from comparisons.harness import codes
from comparisons.metrics import pile, statistics
from comparisons.report import plots
from gpudem.output.run import Run
from gpudem.scene import Domain, Output, Scene, Time

#: Balls, seeds, and width of the box [d]: five or six balls of the lattice.
BALLS: dict[kit.Tier, int] = {"quick": 150, "standard": 300, "full": 500}
SEEDS: dict[kit.Tier, int] = {"quick": 5, "standard": 7, "full": 10}
WIDTH: dict[kit.Tier, float] = {"quick": 5.65, "standard": 5.65, "full": 6.7}
#: Young's modulus [Pa], and force on the lid [N]: 12 kPa, fifty times the bed's weight.
YOUNG, TARGET = 5e6, 14.0
#: The lid approaches with GAIN times its limit [m/s], 0.25 m/s, and meets the bed when that has settled.
LIMIT, GAIN = 0.5, 0.5
#: Steps of a run: until the lid, which starts above the loose lattice, has met the bed and all is at rest;
#: between rows of its history, and between its frames.
STEPS: dict[kit.Tier, int] = {"quick": 4080, "standard": 8160, "full": 16320}
ROW, FRAME = 10, 1360
#: Share of the run over whose end the metrics are means.
END = 0.1
#: Until then [s] the codes must agree ball by ball: they fall, and have just met floor and sides.
EARLY = 0.02
SIDES = ("box_xlo", "box_xhi", "box_ylo", "box_yhi")


def scene(count: int, width: float, seed: int, steps: int) -> Scene:
    """Balls on a loose lattice in an open box, and the lid above them."""
    half = width / 2 * DIAMETER

    def room(points: np.ndarray) -> np.ndarray:
        return np.minimum(half - np.abs(points[:, :2]).max(axis=1), points[:, 2])

    particles = beds.loose(count, seed, half, room)
    top, out = float(particles["position"][:, 2].max()) + 0.6 * DIAMETER, 1.05 * half
    servo = {"type": "servo", "axis": (0, 0, -1), "target": TARGET, "velocity_limit": LIMIT, "kp": GAIN}
    lid = {
        "kind": "mesh", "name": "lid", "material": "grain", "triangles": [(0, 1, 2), (0, 2, 3)],
        "vertices": [(-out, -out, top), (out, -out, top), (out, out, top), (-out, out, top)],
        "reference": (0.0, 0.0, top), "motion": [servo],
    }  # fmt: skip
    box = {
        "kind": "box", "name": "box", "material": "grain", "sides": ["xlo", "xhi", "ylo", "yhi", "zlo"],
        "lo": (-half, -half, 0.0), "hi": (half, half, top),
    }  # fmt: skip
    step = beds.step(YOUNG)
    return Scene(
        **beds.statement("uniaxial", f"{count} balls, seed {seed}", YOUNG, particles),
        walls=[box, lid],
        domain=Domain(lo=(-1.1 * half, -1.1 * half, -DIAMETER), hi=(1.1 * half, 1.1 * half, top + DIAMETER)),
        time=Time(step=step, duration=steps * step),
        output=Output(
            frames_every=FRAME * step, history_every=ROW * step, wall_forces=("lid", "box_zlo", *SIDES)
        ),
    )  # fmt: skip


def variants(tier: kit.Tier) -> list[kit.Variant]:
    return [
        kit.Variant(f"seed_{seed}", scene(BALLS[tier], WIDTH[tier], seed, STEPS[tier]))
        for seed in range(1, SEEDS[tier] + 1)
    ]


def rows(run: Run) -> Any:
    """The history of a run."""
    assert run.history is not None
    return run.history


def at_end(run: Run) -> Any:
    """Means over the end of a run."""
    history = rows(run)
    return history[history.time >= (1 - END) * history.time.iloc[-1]].mean()


def side_pressure(one: Any) -> float:
    """Sum of the normal forces on the four sides [N]."""
    return sum(abs(one[f"force_{side}_{side[4]}"]) for side in SIDES)


def side_friction(one: Any) -> Any:
    """Vertical force on the four sides, downwards [N]."""
    return -sum(one[f"force_{side}_z"] for side in SIDES)


def metrics(run: Run) -> dict[str, float]:
    """What is compared over the seeds."""
    one, last = at_end(run), run.frames[-1]
    width = 2 * max(abs(plane.point[0]) for plane in run.scene.planes)
    height = float(one.position_lid_z)
    solid = 4 / 3 * np.pi * float((run.scene.state.radius**3).sum())
    pressure = side_pressure(one)
    return {
        "height [mm]": 1e3 * height,
        "packing fraction [1]": solid / (width**2 * height),
        "force on the floor / target [1]": -float(one.force_box_zlo_z) / TARGET,
        "stress on the sides / on the lid [1]": pressure / (4 * width * height) / (TARGET / width**2),
        "friction mobilized at the sides [1]": float(side_friction(one)) / pressure,
        "contacts of a ball with others [1]": pile.coordination(last["position"], last["radius"]),
        "work of the lid [mJ]": 1e3 * float(one.work_lid),
    }


def compared(results: kit.Results, code: str, other: str) -> dict[str, statistics.Comparison]:
    """Metric -> comparison over the seeds."""

    def samples(who: str) -> dict[str, np.ndarray]:
        found = [metrics(run) for _, run in results.of(who)]
        return {name: np.array([one[name] for one in found]) for name in found[0]}

    return results.once(("compared", code, other), lambda: statistics.compare(samples(code), samples(other)))


def height_bound(results: kit.Results, code: str, other: str) -> kit.Measured:
    """Largest relative difference of heights within the 95 % interval."""
    c = compared(results, code, other)["height [mm]"]
    return kit.Measured(c.bound / c.mean[1], note=f"difference {c.difference / c.mean[1]:.2%}")


def target_missed(results: kit.Results, code: str) -> dict[str, tuple[float, float]]:
    """Force on the lid and its target."""
    return {label: (float(at_end(run).force_lid_z), TARGET) for label, run in results.of(code)}


def unbalanced(results: kit.Results, code: str) -> dict[str, kit.Measured]:
    """Vertical force on floor and sides against lid, weight and mass times acceleration, at the end."""
    found = {}
    for label, run in results.of(code):
        last = rows(run).iloc[-1]
        carried = float(side_friction(last) - last.force_box_zlo_z)
        weight = float(run.scene.masses.sum()) * beds.GRAVITY
        load = float(last.force_lid_z) + weight + float(run.frames[-1]["force"][:, 2].sum())
        found[label] = kit.Measured(abs(carried - load) / TARGET, carried, load)
    return found


def own_way(results: kit.Results, code: str) -> dict[str, tuple[float, float]]:
    """Way of the lid in the rows before a ball touches it [m], and that of e = 1: GAIN LIMIT (t - dt)."""
    found = {}
    for label, run in results.of(code):
        history = rows(run)
        k = int(np.argmax((history.force_lid_z.iloc[1:] != 0).to_numpy()))  # the last row before the touch
        way = float(history.position_lid_z.iloc[0] - history.position_lid_z.iloc[k])
        found[label] = way, GAIN * LIMIT * (float(history.time.iloc[k]) - run.scene.time.step)
    return found


def work_error(results: kit.Results, code: str) -> dict[str, tuple[float, float]]:
    """Work of the lid, and the integral of its force over its way between rows [J].

    A step counts the force at its end: beside the trapezoid it has half a step's change of the force.
    """
    found = {}
    for label, run in results.of(code):
        history = rows(run).iloc[1:]
        force, way = history.force_lid_z.to_numpy(), -np.diff(history.position_lid_z)
        integral = np.sum(((force[1:] + force[:-1]) / 2 + np.diff(force) / 2 / ROW) * way)
        found[label] = float(history.work_lid.iloc[-1]), float(integral)
    return found


def mobilized(results: kit.Results, code: str) -> dict[str, float]:
    """Friction mobilized at the sides by friction coefficient, of each run."""
    name = "friction mobilized at the sides [1]"
    return {label: metrics(run)[name] / FRICTION for label, run in results.of(code)}


def _course(results: kit.Results) -> plots.Figure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.6)
    for code in results.codes():
        history = rows(results["seed_1", code])
        course = {
            "lid": history.force_lid_z, "floor": -history.force_box_zlo_z,
            "sides, friction": side_friction(history),
        }  # fmt: skip
        for color, (name, force) in zip(plots.SERIES, course.items(), strict=False):
            label = name if code == results.codes()[0] else None
            look = plots.line_or_marks(code, len(history), color=color, lw=1.0)
            left.plot(history.time, force, **look, label=label)
        look = plots.line_or_marks(code, len(history), color=plots.SERIES[0], lw=1.0)
        right.plot(history.time, 1e3 * history.position_lid_z, **look)
    left.axhline(TARGET, color="0.4", lw=0.9, ls=":")
    left.set(xlabel="time [s]", ylabel="vertical force [N]")
    right.set(xlabel="time [s]", ylabel="height of the lid [mm]")
    plots.legend(left, lines=results.codes())
    return figure


def _table(results: kit.Results) -> kit.Rows:
    pairs = codes.pairs(results.codes())
    return [
        row
        for a, b in pairs
        for row in over_seeds.rows(compared(results, a, b), plots.name(a), plots.name(b))
    ]


CHECKS = (
    bulk.early(
        "center of mass while the balls fall, largest distance in 0.02 s / diameter", axes="xyz", until=EARLY,
        reason="same law and scheme, first contacts with floor and sides, before rounding has grown",
        catches="a lid that touches balls where the other code's does not, another force of a wall",
    ),
    kit.per_code(
        "force on the lid at the end of the run, relative to its target", target_missed, tolerance=0.01,
        against="the target",
        reason="e = v / (limit gain): a lid slower than a hundredth of its approach, 2.5 mm/s, has it",
        catches="a lid that follows another wall's force, has the wrong sign, or moves when it should rest",
    ),
    kit.per_code(
        "way of the lid before it touches a ball, relative to the controller's", own_way, tolerance=1e-11,
        against="gain limit (t - dt)",
        reason="rounding of a place of 50 mm, 1e-17 m a step, in 100 steps of a way of 0.5 mm: 2e-12",
        catches="a lid that moves in the first step, or not with the speed of e = 1",
    ),
    kit.per_code(
        "vertical forces: floor and sides against lid, weight and acceleration, difference / target",
        unbalanced, tolerance=1e-9, against="Newton's second law",
        reason="the same forces in another order: rounding of sums of hundreds",
        catches="a wall's force that lacks friction, has the wrong sign or is another step's",
    ),
    kit.per_code(
        "work of the lid against force over way between rows, relative", work_error, tolerance=1e-3,
        against="trapezoids, and half a step's change of the force",
        reason="rows are 0.32 ms apart: (0.32/20)^2/12 = 2e-5 of a force that rises in 20 ms; balls that hit"
        " the lid, for some 2 ms each, (0.32/2)^2/12 = 2e-3 of their part, a tenth of the force",
        catches="work of the wrong sign, of another wall, or with the force of the step before (2e-3)",
    ),
    kit.per_code(
        "friction mobilized at the sides / friction coefficient", mobilized, lo=0.1, tolerance=1.0,
        against="Coulomb's limit",
        reason="at most 1 by the law, and 0 without springs at the sides; the bed slides down along them as"
        " it is compressed, its upper balls to the limit, those at the floor hardly",
        catches="springs of walls lost, so that the floor carries all, or friction beyond the limit",
    ),
    kit.per_pair(
        "smallest corrected p over all metrics: difference between codes against spread within",
        lambda results, a, b: over_seeds.smallest_p(compared(results, a, b), SEEDS[results.tier]),
        lo=over_seeds.ALPHA, tolerance=1.0,
        reason="exact permutation test of the largest standardized difference over all metrics (Westfall and"
        " Young), no significant difference at 0.01",
        catches="any bias of controller, friction or damping beyond the scatter of seeds",
    ),
    kit.per_pair(
        "height of the bed: largest relative difference that the seeds leave possible (95 %)", height_bound,
        tolerance=0.04, unit="1",
        reason="beds poured at random differ by 1 % in packing: 1.5 % for the interval of five seeds, and as"
        " much by chance for the difference",
        catches="too few seeds for the test above to mean anything",
    ),
)  # fmt: skip

CASE = kit.Case(
    name="uniaxial",
    title="A bed compressed by a lid that follows a force",
    purpose=(
        "Balls of 6 mm fall into a square box; a lid, a servo wall, comes down and presses until it feels"
        " 14 N, fifty times the weight of the bed. Its controller takes the force of the last step, so that"
        " the wall forces of both codes act back on the motion. At rest floor and sides carry what the lid"
        " presses and the bed weighs."
    ),
    source="Newton's second law; controller of LIGGGHTS' mesh module servo, as its manual states it",
    variants=variants,
    checks=CHECKS,
    figures=(
        kit.Figure(
            "Compression", "First seed; dotted: the target. The friction at the sides carries a part.",
            _course, recorded=True,
        ),
    ),
    tables=(
        kit.Table(
            "Codes against each other", "Over seeds; p corrected for all metrics by permutation.", _table,
            recorded=True,
        ),
    ),
    features=(
        "normal hertz", "damping", "tangential history", "rotation", "gravity", "several radii", "wall mesh",
        "wall plane",
    ),
    order=57,
)  # fmt: skip
