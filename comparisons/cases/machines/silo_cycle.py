"""A silo is filled, rests, is opened, and runs empty through an open side of the domain; every ball counts.

Particle-steps of each code: 2.5e6 a silo; one (quick tier), 5 (standard and full).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from comparisons import kit
from comparisons.cases import over_seeds
from comparisons.cases.machines.hopper_scenes import DIAMETER, SOFT, SPREAD, statement, step
from comparisons.harness import codes
from comparisons.kit import LONG
from comparisons.metrics import statistics
from comparisons.report import plots
from gpudem.output.run import Run
from gpudem.scene import Domain, Explicit, FlowPlane, Output, Scene, Time

#: Width along x and depth along y of the silo, width of its slot [d].
WIDTH, DEPTH, SLOT = 8.0, 4.15, 5.0
#: Balls of a layer along x and y; layers; time between two [s]; height [d] and speed [m/s] of a layer.
LAYER, LAYERS, EVERY, HEIGHT, SPEED = (6, 3), 12, 0.012, 20.0, 1.0
#: Times [s]: the gate goes, the run ends.
OPENS, ENDS = 0.30, 1.20
#: Depth [d] of the open side below the floor.
FALL = 3.0
SEEDS: dict[kit.Tier, int] = {"quick": 1, "standard": 5, "full": 5}
#: Ball by ball the codes are compared up to here [s]: the lowest layers have landed on one another.
EARLY = 0.09
#: The open side.
SIDE = "zlo"
#: The scene in which balls leave before rounding has grown; its trace has every so many steps.
CHUTE, CHUTE_EVERY = "chute", 4
#: Plane below the slot through which flow is counted.
SLOT_PLANE = FlowPlane(name="slot", point=(0.0, 0.0, -1.5 * DIAMETER), normal=(0.0, 0.0, -1.0))
#: Interval [s] of history and trace of a silo.
INTERVAL = 0.002


def poured(seed: int) -> dict[str, Any]:
    """The balls as they come, layer by layer, with random sizes and places."""
    rng, pitch = np.random.default_rng(seed), 1.25 * DIAMETER
    x, y = (pitch * (np.arange(n) - (n - 1) / 2) for n in LAYER)
    layer = np.stack(
        [a.ravel() for a in np.meshgrid(x, y)] + [np.full(x.size * y.size, HEIGHT * DIAMETER)], 1
    )
    count = LAYERS * len(layer)
    shift = 0.05 * DIAMETER
    return {
        "kind": "list", "material": "grain", "time": 0.001 + np.repeat(EVERY * np.arange(LAYERS), len(layer)),
        "position": np.tile(layer, (LAYERS, 1)) + rng.uniform(-shift, shift, (count, 3)),
        "velocity": np.tile((0.0, 0.0, -SPEED), (count, 1)) + rng.normal(0, 0.05, (count, 3)),
        "radius": DIAMETER / 2 * (1 + rng.uniform(-SPREAD, SPREAD, count)),
    }  # fmt: skip


def scene(seed: int = 1) -> Scene:
    """A silo with a flat bottom and a slot across its depth; a gate half a radius below the bottom."""
    x, y, slot = (DIAMETER * size / 2 for size in (WIDTH, DEPTH, SLOT))
    low, top, out = -FALL * DIAMETER, (HEIGHT + 2) * DIAMETER, DIAMETER
    vertices = [
        (a, b, 0.0)
        for part in ((-x - out, -slot), (slot, x + out))
        for a in part
        for b in (-y - out, y + out)
    ]
    triangles = [(k, k + 2, k + 3) for k in (0, 4)] + [(k, k + 3, k + 1) for k in (0, 4)]
    stated = statement("silo_cycle", f"{LAYERS * LAYER[0] * LAYER[1]} balls, seed {seed}", SOFT, None)
    return Scene(
        **stated, insert=[poured(seed)],
        walls=[
            {"kind": "box", "name": "silo", "material": "grain", "sides": ["xlo", "xhi", "ylo", "yhi"],
             "lo": (-x, -y, low), "hi": (x, y, top)},
            {"kind": "mesh", "name": "bottom", "material": "grain", "vertices": vertices,
             "triangles": triangles},
            {"kind": "plane", "name": "gate", "material": "grain", "point": (0, 0, -DIAMETER / 4),
             "normal": (0, 0, 1), "removed_at": OPENS},
        ],
        domain=Domain(lo=(-1.1 * x, -1.1 * y, low), hi=(1.1 * x, 1.1 * y, top), sides={SIDE: "outflow"}),
        time=Time(step=step(SOFT), duration=ENDS),
        output=Output(trace_every=INTERVAL, history_every=INTERVAL, flow=(SLOT_PLANE,),
                      history=("particles", "kinetic_energy", "contacts", "centre_z")),
    )  # fmt: skip


def chute() -> Scene:
    """Balls of three sizes slide and roll down a slope to an open side, with some contacts on the way."""
    rng, pitch = np.random.default_rng(7), 1.1 * DIAMETER
    x, y = (pitch * (np.arange(n) + 0.6) for n in (8, 4))
    places = (
        np.stack([a.ravel() for a in np.meshgrid(x, y)], 1) + rng.uniform(-0.03, 0.03, (32, 2)) * DIAMETER
    )
    radius = DIAMETER / 2 * np.array([0.94, 1.0, 1.06])[np.arange(32) % 3]
    stated = statement("chute", "32 balls run down a slope and leave", SOFT, None)
    size, every = (10 * DIAMETER, 5 * DIAMETER, 4 * DIAMETER), CHUTE_EVERY * step(SOFT)
    particles = Explicit(
        position=np.column_stack([places, radius]), radius=radius, material="grain",
        velocity=rng.normal(0, 0.05, (32, 3)) * (1, 1, 0) - (0.2, 0, 0),
    )  # fmt: skip
    return Scene(
        **{**stated, "particles": particles, "gravity": (-5.0, 0.0, -8.0)},
        walls=[{"kind": "box", "name": "chute", "material": "grain", "sides": ["xhi", "ylo", "yhi", "zlo"]}],
        domain=Domain(lo=(0, 0, 0), hi=size, sides={"xlo": "outflow"}),
        time=Time(step=step(SOFT), duration=0.12),
        output=Output(trace_every=every, history_every=every, history=("particles", "contacts")),
    )  # fmt: skip


def variants(tier: kit.Tier) -> list[kit.Variant]:
    silos = [kit.Variant(f"silo_{k}", scene(k)) for k in range(1, SEEDS[tier] + 1)]
    return [kit.Variant(CHUTE, chute()), *silos]


def absent(run: Run) -> np.ndarray:
    """Of each row of the trace: the balls that have come and are not there, shape (t, n)."""
    come = run.scene.arrival_steps <= run.trace["step"][:, None]
    return come & np.isnan(run.trace["position"][..., 0])


def exit_of(run: Run) -> str:
    """The name of the open side."""
    return run.scene.exits[0].name


def counted(results: kit.Results, code: str) -> dict[str, kit.Measured]:
    """Balls that have left by the history, against those missing in the trace at the same times; NaN where
    nothing leaves. Beside it: those that have come less those that are there.
    """
    found = {}
    for label, run in results.of(code):
        gone, history = absent(run), run.history
        left, there = history[f"removed_{exit_of(run)}"].to_numpy(), history["particles"].to_numpy()
        come = np.array([run.scene.count_at(int(s)) for s in history["step"]])
        off = np.abs(left - gone.sum(axis=1)) + np.abs(come - there - left)
        value = float(off.max()) if left[-1] > 0 else float("nan")
        found[label] = kit.Measured(value, note=f"{left[-1]} of {come[-1]} left, {there[-1]} stay")
    return found


def weighed(results: kit.Results, code: str) -> dict[str, float]:
    """Mass that has left by the history, against the mass of the balls missing in the trace / mass of all."""
    found = {}
    for label, run in results.of(code):
        gone = absent(run) @ run.scene.masses
        left = run.history[f"removed_mass_{exit_of(run)}"].to_numpy()
        found[label] = (
            float(np.abs(left - gone).max() / run.scene.masses.sum()) if gone[-1] > 0 else float("nan")
        )
    return found


def back_again(results: kit.Results, code: str) -> dict[str, float]:
    """Balls that are there again after they have left."""
    return {
        label: float((absent(run)[:-1] & ~absent(run)[1:]).any(axis=0).sum())
        for label, run in results.of(code)
    }


def elsewhere(results: kit.Results, code: str) -> dict[str, kit.Measured]:
    """How far from the side a ball can have left, at most [d]: its free flight from the last row with it."""
    found = {}
    for label, run in results.of(code):
        gone, axis = absent(run), "xyz".index(exit_of(run)[0])
        rows = np.argmax(gone, axis=0) - 1
        balls = np.flatnonzero(gone[-1])
        rows, interval = rows[balls], run.trace["time"][1]
        x, v = (run.trace[name][rows, balls, axis] for name in ("position", "velocity"))
        reached = x + v * interval + 0.5 * run.scene.gravity[axis] * interval**2
        ahead = (reached - run.scene.domain.lo[axis]).max(initial=-np.inf) / DIAMETER
        beyond = (run.scene.domain.lo[axis] - np.nanmin(run.trace["position"][..., axis])) / DIAMETER
        limit = (run.scene.skin / 2 + np.abs(v).max(initial=0.0) * run.scene.time.step) / DIAMETER
        found[label] = kit.Measured(
            max(ahead, beyond - limit), note=f"{len(balls)} balls, {beyond:.2g} d beyond"
        )
    return found


def together(results: kit.Results, code: str, other: str) -> kit.Measured:
    """Rows of the trace of the chute in which a ball is there in one code and not in the other."""
    ours, theirs = (absent(results[CHUTE, c]) for c in (code, other))
    gone = int(ours[-1].sum())
    note = f"{gone} of {ours.shape[1]} left, {len(ours)} rows"
    return kit.Measured(float((ours != theirs).sum()) if gone > 10 else float("nan"), note=note)


def until(run: Run) -> np.ndarray:
    """Positions of a silo's balls up to EARLY, of the chute's to the end."""
    rows = slice(None) if CHUTE in run.scene.name else run.trace["time"] <= EARLY
    return np.nan_to_num(run.trace["position"][rows])


def left(results: kit.Results, label: str, code: str) -> tuple[np.ndarray, np.ndarray]:
    """Time after the gate goes [s], and share of the mass that has left."""
    run = results[label, code]
    share = run.history[f"removed_mass_{exit_of(run)}"].to_numpy() / run.scene.masses.sum()
    return run.history["time"].to_numpy() - OPENS, share


def curves(results: kit.Results, code: str, other: str) -> dict[str, float]:
    """Largest difference of the shares of the mass that have left, of each silo."""
    return {
        label: float(np.abs(left(results, label, code)[1] - left(results, label, other)[1]).max())
        for label in results.labels(code, other, prefix="silo")
    }


def samples(results: kit.Results, code: str) -> dict[str, np.ndarray]:
    """Metric -> its values over the silos of one code."""
    found: dict[str, list[float]] = {"time until half has left [s]": [], "mass that stays / mass": []}
    rate = found.setdefault("rate between 10 and 60 % [1/s]", [])
    for label in results.labels(code, prefix="silo"):
        time, share = left(results, label, code)
        first, half, last = (float(time[np.argmax(share >= level)]) for level in (0.1, 0.5, 0.6))
        found["time until half has left [s]"].append(half)
        found["mass that stays / mass"].append(1 - float(share[-1]))
        rate.append(0.5 / (last - first))
    return {name: np.array(values) for name, values in found.items()}


def compared(results: kit.Results, code: str, other: str) -> dict[str, statistics.Comparison]:
    """Metric -> comparison over the seeds."""
    return results.once(
        ("compared", code, other),
        lambda: statistics.compare(samples(results, code), samples(results, other)),
    )


def passed(results: kit.Results, code: str) -> dict[str, kit.Measured]:
    """Balls that have passed the plane below the slot by the history, against those that are below it in the
    trace or have left; NaN where none passes.
    """
    found = {}
    for label in results.labels(code, prefix="silo"):
        run = results[label, code]
        low = absent(run) | (np.nan_to_num(run.trace["position"][..., 2]) < SLOT_PLANE.point[2])
        counted = run.history["flow_count_slot"].to_numpy()
        weighed = run.history["flow_mass_slot"].to_numpy() - low @ run.scene.masses
        off = np.abs(counted - low.sum(axis=1)) + np.abs(weighed) / run.scene.masses.sum()
        value = float(off.max()) if counted[-1] > 0 else float("nan")
        found[label] = kit.Measured(value, note=f"{counted[-1]} balls")
    return found


def at_end(results: kit.Results, code: str) -> dict[str, kit.Measured]:
    """Share of the balls that leave in the last tenth of a second of a silo; NaN where half has not left."""
    found = {}
    for label in results.labels(code, prefix="silo"):
        run = results[label, code]
        gone = run.history[f"removed_{exit_of(run)}"].to_numpy()
        late = gone[-1] - gone[-1 - round(0.1 / INTERVAL)]
        share = gone[-1] / len(run.scene.state)
        found[label] = kit.Measured(
            late / len(run.scene.state) if share > 0.5 else float("nan"), note=f"{share:.1%} have left"
        )
    return found


def _figure(results: kit.Results) -> plots.Figure:
    figure, (mass, there) = plots.figure(1, 2, width=plots.WHOLE, height=3.6)
    for code in results.codes():
        for k, label in enumerate(results.labels(code, prefix="silo")):
            time, share = left(results, label, code)
            look = plots.line_or_marks(code, len(time), color=plots.SERIES[k], lw=1.0)
            mass.plot(time, share, **look)
            run = results[label, code]
            there.plot(run.history["time"], run.history["particles"], **look)
    mass.set(xlabel="time after the gate goes [s]", ylabel="share of the mass that has left", xlim=(0, None))
    there.set(xlabel="time [s]", ylabel="balls that are there")
    plots.legend(mass, lines=results.codes())
    return figure


def _table(results: kit.Results) -> kit.Rows:
    rows = []
    for code in results.codes():
        for label, run in results.of(code):
            history, name = run.history, exit_of(run)
            rows.append({
                "scene": label, "code": plots.name(code), "came": run.scene.count_at(run.scene.n_steps),
                "left": int(history[f"removed_{name}"].iloc[-1]), "stay": int(history["particles"].iloc[-1]),
                "mass that left [g]": 1e3 * float(history[f"removed_mass_{name}"].iloc[-1]),
            })  # fmt: skip
    return rows


def _seeds_table(results: kit.Results) -> kit.Rows:
    return [
        row
        for a, b in codes.pairs(results.codes())
        for row in over_seeds.rows(compared(results, a, b), plots.name(a), plots.name(b))
    ]


CASE = kit.Case(
    name="silo_cycle",
    title="A silo is filled, rests and runs empty",
    purpose=(
        "Balls of 6 mm, of sizes that differ by 8 %, are inserted layer by layer into a flat-bottomed silo"
        " with a slot, come to rest on a gate, and leave through an open side when the gate goes."
        " Every ball that came is counted: it has left, or it stays on the bottom beside the slot. On a slope"
        " where balls leave before rounding has grown, the codes lose the same balls in the same steps."
    ),
    source="conservation of mass; no measurement",
    variants=variants,
    checks=(
        kit.per_code(
            "balls that left by the history against those missing in the trace, and against those that came"
            " less those that are there",
            counted, tolerance=0.0, against="conservation",
            reason="counts of the same balls", catches="a ball lost without being counted, or counted twice",
        ),
        kit.per_code(
            "mass that left by the history against that of the balls missing in the trace / mass of all",
            weighed, tolerance=1e-12, against="conservation",
            reason="sums of some hundred masses in another order",
            catches="the mass of another ball, a mean mass in the place of each ball's",
        ),
        kit.per_code(
            "balls that are there again after they have left", back_again, tolerance=0.0,
            against="conservation", reason="ids are not used again",
            catches="an id given to a ball that is inserted later",
        ),
        kit.per_code(
            "flow through a plane below the slot by the history against balls below it or gone in the trace:"
            " balls + mass / mass of all",
            passed, tolerance=1e-12, against="conservation", reason="counts and sums of the same balls",
            catches="balls that leave taken for ones that come back, a flow of the wrong sign",
        ),
        kit.per_code(
            "how far inside the open side a ball can have left, or beyond it have stayed / diameter",
            elsewhere, tolerance=0.05, against="rule of removal",
            reason="free flight from the last row of the trace ends beyond the side, a contact on the way"
            " slows a ball by less; beyond it a ball moves half a skin and a step at most",
            catches="a ball removed inside the domain, or kept until long after it has left",
        ),
        kit.per_code(
            "share of the balls that leave in the last 0.1 s of a silo", at_end, tolerance=0.02,
            against="rest",
            reason="what stays lies beside the slot; without rolling friction a few balls still roll",
            catches="a run that ends while the silo still runs; balls that creep over the edge",
        ),
        kit.per_pair(
            "chute: rows of the trace in which a ball is there in one code only", together, tolerance=0.0,
            half_step=True,
            reason="same law, scheme and rule of rebuilds: positions differ by rounding, steps not at all",
            catches="a ball that leaves at another rebuild, or by its surface; the wrong one of two",
        ),
        kit.step_by_step(
            "positions on the chute to the end, and in the silo until 0.09 s, largest difference / diameter",
            "position", lambda run: DIAMETER, read=until, tolerance=1e-9,
            reason="rounding, multiplied by contacts of less than 0.1 s",
            catches="a force of a ball that has left, properties of another ball after a removal",
        ),
        kit.per_pair(
            "share of the mass that has left: largest difference between the codes", curves, tolerance=0.2,
            reason="a flow is chaotic: silos of four seeds in either code differ by up to 0.11",
            catches="a slot or a gate at another place, balls that leave late",
        ),
        kit.per_pair(
            "smallest corrected p over all metrics: difference between codes against spread within",
            lambda results, code, other: over_seeds.smallest_p(
                compared(results, code, other), SEEDS[results.tier]
            ),
            lo=over_seeds.ALPHA, tolerance=1.0, tiers=LONG,
            reason="exact permutation test of the largest standardized difference over all metrics (Westfall"
            " and Young), no significant difference at 0.01",
            catches="any bias of the discharge beyond the scatter of seeds",
        ),
    ),
    figures=(
        kit.Figure(
            "Discharge",
            "Left: share of the mass that has left after the gate goes. Right: number of balls in the silo,"
            " which are inserted in layers, rest, and leave.",
            _figure,
        ),
    ),
    tables=(
        kit.Table(
            "Balls that came, left and stay", "Of each run at its end; came = left + stay.", _table,
        ),
        kit.Table(
            "Discharge over the seeds", "Over seeds; p corrected for all metrics by permutation.",
            _seeds_table, tiers=LONG,
        ),
    ),
    features=(
        "normal hertz", "damping", "tangential history", "rotation", "gravity", "several radii", "wall mesh",
        "wall plane", "gate", "insertion", "open sides", "bulk flow",
    ),
    order=57,
)  # fmt: skip
