"""A periodic chute whose base is frozen balls: filled, tilted, and laid flat again, in three phases.

Particle-steps of each code: 1.6e6 a chute.
"""

from __future__ import annotations

import math

import numpy as np

from comparisons import kit
from comparisons.report import plots
from gpudem.output.run import Run
from gpudem.scene import Domain, Explicit, Group, Material, Output, Pair, PairChange, Phase, Scene, Time
from gpudem.scene.groups import FREE

#: Diameter of the balls [m], sides of the base [d], layers of free balls, largest departure of their sizes.
DIAMETER, SIDES, LAYERS, SPREAD = 0.006, (6.0, 4.0), 3, 0.1
#: Angles of the chute in each phase, and times at which the second and the third start and the run ends [s].
ANGLES, TIMES = (0.0, math.radians(26.0), math.radians(8.0)), (0.2, 0.28, 0.5)
#: The short scene, tilted before rounding has grown: times of tilt, lower friction and end [s].
SHORT, EARLY = "short", (0.035, 0.045, 0.055)
#: At the end of a phase at rest, forces are means over this time [s], some periods of the bed's vibration.
MEAN = 0.03
#: Time step, intervals of history and trace [s].
STEP, INTERVAL, TRACE = 2e-5, 1e-3, 4e-3
BASE = "base"


def pull(angle: float) -> tuple[float, float, float]:
    """Gravity [m/s2] in a chute that falls along x by this angle [rad]."""
    return 9.81 * math.sin(angle), 0.0, -9.81 * math.cos(angle)


def scene(seed: int = 1) -> Scene:
    """A base of balls at random heights, which overlap, and layers of free balls above it."""
    rng, pitch = np.random.default_rng(seed), 1.05 * DIAMETER
    size = np.array((*SIDES, 12.0)) * pitch
    low, high = np.array((0.0, 0.0, -DIAMETER)), np.array((*size[:2], size[2] - DIAMETER))
    x, y = np.meshgrid(*(np.arange(0.25, n, 0.5) * pitch for n in SIDES))
    base = np.stack([x.ravel(), y.ravel(), rng.uniform(-0.4, 0.0, x.size) * DIAMETER], axis=1)
    x, y, z = np.meshgrid(
        *(np.arange(0.5, n) * pitch for n in SIDES), (1 + np.arange(LAYERS)) * 1.12 * DIAMETER
    )
    free = (
        np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1) + rng.uniform(-0.02, 0.02, (x.size, 3)) * DIAMETER
    )
    radius = DIAMETER / 2 * (1 + rng.uniform(-SPREAD, 0.0, len(free)))
    return Scene(
        name="rough_chute", title=f"{len(free)} balls on {len(base)} frozen ones, seed {seed}",
        materials={"grain": Material(young=5e6, poisson=0.3, density=2500.0)},
        pairs=(Pair(materials=("grain", "grain"), restitution=0.5, friction=0.5),),
        particles=Explicit(
            position=np.concatenate([base, free]), material="grain",
            radius=np.concatenate([np.full(len(base), DIAMETER / 2), radius]),
        ),
        groups=(Group(name=BASE, ids=np.arange(1, len(base) + 1), frozen=True),),
        gravity=pull(ANGLES[0]),
        phases=tuple(Phase(start=t, gravity=pull(a)) for t, a in zip(TIMES, ANGLES[1:], strict=False)),
        domain=Domain(lo=tuple(low.tolist()), hi=tuple(high.tolist()), periodic=(True, True, False)),
        time=Time(step=STEP, duration=TIMES[-1]),
        output=Output(trace_every=TRACE, history_every=INTERVAL, group_forces=(BASE,)),
    )  # fmt: skip


def short() -> Scene:
    """The chute tilted while the balls still fall, then with less friction."""
    smooth = PairChange(materials=("grain", "grain"), friction=0.1, restitution=0.8)
    tilt, change, end = EARLY
    phases = (Phase(start=tilt, gravity=pull(ANGLES[1])), Phase(start=change, pairs=(smooth,)))
    return scene().replace(
        name=SHORT, phases=phases, time={"duration": end}, output={"trace_every": INTERVAL}
    )


def variants(tier: kit.Tier) -> list[kit.Variant]:
    return [kit.Variant("chute", scene()), kit.Variant(SHORT, short())]


def chute(results: kit.Results, code: str) -> Run:
    return results["chute", code]


def forces(run: Run) -> np.ndarray:
    """Force on the base by the history [N], shape (t, 3)."""
    return run.history[[f"force_{BASE}_{axis}" for axis in "xyz"]].to_numpy()


def moved(results: kit.Results, code: str) -> dict[str, float]:
    """Largest displacement of a frozen ball [m], and its largest velocity [m/s]."""
    run = chute(results, code)
    still = run.scene.held != FREE
    way = run.trace["position"][:, still] - run.scene.state.position[still]
    return {
        "displacement": float(np.abs(way).max()),
        "velocity": float(np.abs(run.trace["velocity"][:, still]).max()),
    }


def balance(results: kit.Results, code: str) -> dict[str, kit.Measured]:
    """Force on the base plus that of the contacts on all free balls, by their weight; NaN: no force."""
    run = chute(results, code)
    free, mass, steps = run.scene.held == FREE, run.scene.masses, run.trace["step"]
    weight = mass[free].sum() * run.scene.gravity_at(steps)
    on_free = run.trace["force"][:, free].sum(axis=1) - weight
    on_base, largest = forces(run)[np.isin(run.history["step"], steps)], np.abs(weight).max()
    off = float(np.abs(on_base + on_free).max() / largest)
    pushed = float(np.abs(on_base).max() / largest)
    return {"force": kit.Measured(off if pushed > 1 else math.nan, note=f"up to {pushed:.2g} weights")}


def at_rest(results: kit.Results, code: str) -> dict[str, kit.Compared]:
    """Mean force on the base at the end of the phases at rest, beside the weight, by the weight."""
    run, found = chute(results, code), {}
    time, free = run.history["time"].to_numpy(), run.scene.held == FREE
    for k, end in ((0, TIMES[0]), (2, TIMES[2])):
        rows = (time > end - MEAN) & (time <= end + INTERVAL / 2)
        want, got = run.scene.masses[free].sum() * np.array(pull(ANGLES[k])), forces(run)[rows].mean(axis=0)
        off = float(np.linalg.norm(got - want) / np.linalg.norm(want))
        found[f"phase {k + 1}, down"] = kit.Measured(off, float(-got[2]), float(-want[2]))
    return found


def unwrapped(run: Run) -> np.ndarray:
    """How far the free balls have come along the chute on average since the start [d], shape (t,)."""
    free, x = run.scene.held == FREE, run.trace["position"][..., 0]
    length = run.scene.domain.hi[0] - run.scene.domain.lo[0]
    steps = np.diff(x[:, free], axis=0)
    steps -= length * np.round(steps / length)
    return np.concatenate([[0.0], np.cumsum(steps.mean(axis=1))]) / DIAMETER


def stages(results: kit.Results, code: str) -> dict[str, kit.Measured]:
    """Whether the balls rest, flow and rest: ways [d] along the chute."""
    run = chute(results, code)
    way, time = unwrapped(run), run.trace["time"]
    at = [int(np.searchsorted(time, t - TRACE / 2)) for t in TIMES]
    flowed, last = way[at[1]] - way[at[0]], way[-1] - way[int(np.searchsorted(time, TIMES[2] - MEAN))]
    ratio = abs(last) / flowed if flowed > 0.5 else math.nan
    return {"way": kit.Measured(float(ratio), note=f"{flowed:.2f} d in the second phase")}


def _figure(results: kit.Results) -> plots.Figure:
    figure, (flow, force) = plots.figure(1, 2, width=plots.WHOLE, height=3.4)
    for code in results.codes():
        run = chute(results, code)
        assert run.history is not None
        time, look = run.history["time"].to_numpy(), plots.line_or_marks(code, len(run.history), lw=0.9)
        look["color"] = plots.color(code)
        mass = run.scene.masses[run.scene.held == FREE].sum()
        weight = mass * run.scene.gravity_at(run.history["step"].to_numpy())
        scale = mass * 9.81
        flow.plot(run.trace["time"], unwrapped(run), **{**look, "markevery": 5})
        for k, sign in ((0, 1), (2, -1)):
            force.plot(time, sign * forces(run)[:, k] / scale, **look)
            force.plot(time, sign * weight[:, k] / scale, color="black", lw=0.8, ls=":")
    force.set(xlabel="time [s]", ylabel="force on the base / weight", ylim=(-0.3, 1.6))
    flow.set(xlabel="time [s]", ylabel="mean way along the chute [d]")
    plots.legend(flow, lines=results.codes())
    return figure


CASE = kit.Case(
    name="rough_chute",
    title="Balls on a base of frozen ones: filled, tilted, laid flat again",
    purpose=(
        "Balls of 6 mm fall on frozen ones, come to rest, flow when gravity is tilted by 26 degrees, and"
        " stop when it is tilted back to 8. What is frozen stays where it is; the forces on it are those on"
        " the free balls, and at rest they carry the weight of each phase. Across changes of gravity and of"
        " friction, before rounding has grown, both codes move the same balls the same way."
    ),
    source="momentum balance; no measurement",
    variants=variants,
    checks=(
        kit.per_code(
            "largest displacement [m] and velocity [m/s] of a frozen ball", moved, tolerance=0.0,
            against="statement", reason="nothing is added to either",
            catches="a frozen ball that is kicked, or sorted to the place of a free one",
        ),
        kit.per_code(
            "force on the base by the history, plus those of contacts on the free balls / their weight",
            balance, tolerance=1e-12, against="action and reaction",
            reason="sums of some hundred forces, each computed at both balls or at one",
            catches="a contact seen from one side only, another effective mass on the two sides, gravity of"
            " another phase, weight of the base in the force",
        ),
        kit.per_code(
            "mean force on the base at rest, less the weight of the phase / weight",
            at_rest, tolerance=0.03, against="statics",
            reason="a mean over some periods of the vibration that is left; balls that still rock",
            catches="a phase with the gravity of another one, springs lost at its start: the bed creeps",
        ),
        kit.per_code(
            "way in the last 0.03 s / way in the tilted phase", stages, tolerance=0.02, against="rest",
            reason="26 degrees are above the angle of repose of spheres, 8 are below it",
            catches="a tilt that does not come, or does not end",
        ),
        kit.step_by_step(
            "positions in the short scene, largest difference / diameter", "position",
            lambda run: DIAMETER, prefix=SHORT, tolerance=1e-9,
            reason="rounding, multiplied by contacts of less than 0.05 s",
            catches="a frozen ball's mass in the damping, a phase one step apart, a set-up without springs",
        ),
    ),
    figures=(
        kit.Figure(
            "Flow and force",
            "Left: mean way of the free balls along the chute. Right: force on the base along the chute"
            " (lower lines) and down (upper lines); dotted: components of the weight in each phase.",
            _figure,
        ),
    ),
    features=(
        "normal hertz", "damping", "tangential history", "rotation", "gravity", "several radii", "periodic",
        "frozen particles", "phases", "bulk flow",
    ),
    order=58,
)  # fmt: skip
