"""Six scenes, each by the kernels built for it and by kernels that carry everything: bytes, time, motion."""

from __future__ import annotations

from typing import Any

import numpy as np

from comparisons.bench.beds import COUNT, FRICTIONLESS, MATERIALS, PAIRS, bed_scene, bench_scene
from comparisons.cases.gas import scenes as gases
from comparisons.kit import Measured, Results, Rows, Tier, Variant, largest
from gpudem.output.run import Run
from gpudem.scene import Contact, Material, Output, Pair, Scene, Time

STEPS, REPEATS, GAS = 1500, 3, 4913
#: Title -> whether kernels are specialized.
HOW = {"leaving out": True, "everything": False}


def _gas() -> Scene:
    """Elastic spheres without walls, gravity, friction or spin."""
    step = 2e-6
    return gases.gas_box(
        "gas", GAS, 0.3, 1,
        materials={"ball": Material(young=1e8, poisson=gases.POISSON, density=gases.DENSITY)},
        pairs=[Pair(materials=("ball", "ball"))], contact=Contact(tangential="off"),
        time=Time(step=step, duration=STEPS * step), output=Output(trace_every=STEPS * step),
    )  # fmt: skip


def _bed(**changes: Any) -> Scene:
    scene = bench_scene("settled", COUNT, STEPS, **changes)
    return scene.replace(output={"trace_every": STEPS * scene.time.step})


def _changed_bed(name: str, particles: dict[str, Any], **changes: Any) -> Scene:
    """The settled bed with other particles."""
    one = bench_scene("settled", COUNT, STEPS)
    duration = one.time.duration
    return bed_scene(
        name, one.model_dump()["particles"] | particles, gate=True, duration=duration,
        output={"trace_every": duration}, **changes,
    )  # fmt: skip


def scenes() -> dict[str, Scene]:
    """The scenes, by the physics that they have."""
    rolling = [{**pair, "rolling_friction": 0.1} for pair in PAIRS]
    one = bench_scene("settled", COUNT, STEPS)
    heavy = {**MATERIALS["polystyrene"], "density": 2 * MATERIALS["polystyrene"]["density"]}
    others = [
        {"materials": ("heavy", other), "restitution": 0.9, "friction": 0.3}
        for other in ("polystyrene", "heavy", "acrylic")
    ]
    radii = (
        np.random.default_rng(1).uniform(0.85, 1.0, len(one.state)) * one.model_dump()["particles"]["radius"]
    )
    return {
        "frictionless gas": _gas(),
        # without its dashpot, which at the set-up acts before there is a spring that friction 0 could cap
        "frictionless bed": _bed(pairs=FRICTIONLESS, contact={"tangential_damping": False}).replace(
            particles={"angular_velocity": None}
        ),
        "friction, one size": _bed(),
        "two materials": _changed_bed(
            "two_materials", {"material": ("polystyrene", "heavy") * (len(one.state) // 2)},
            pairs=PAIRS + others, materials={**MATERIALS, "heavy": heavy},
        ),
        "polydisperse": _changed_bed("polydisperse", {"radius": radii}),
        "rolling (epsd2)": _bed(pairs=rolling, contact={"rolling": "epsd2"}),
    }  # fmt: skip


def variants(tier: Tier) -> list[Variant]:
    """Full tier: each scene both ways, in turn, one core."""
    return [
        Variant(
            f"five_{number}_{k}_{repeat}", scene, ("gpudem",),
            {"gpudem": {"threads": 1, "specialize": specialize}}, timed=True,
        )
        for number, scene in enumerate(scenes().values() if tier == "full" else ())
        for repeat in range(REPEATS) for k, specialize in enumerate(HOW.values())
    ]  # fmt: skip


def _runs(results: Results) -> dict[str, list[list[Run]]]:
    """Scene -> runs of each way, by repeat."""
    return {
        name: [[results[f"five_{n}_{k}_{r}", "gpudem"] for r in range(REPEATS)] for k in range(len(HOW))]
        for n, name in enumerate(scenes())
    }


def _speed_up(runs: list[list[Run]]) -> np.ndarray:
    """Time with everything / time of what the scene needs, by repeat."""
    least, everything = (np.array([run.timing.stepping_s for run in each]) for each in runs)
    return everything / least


def least_gain(results: Results) -> Measured:
    """Least median over the scenes of time with everything / time of what the scene needs."""
    found = {name: float(np.median(_speed_up(runs))) for name, runs in _runs(results).items()}
    least, most = min(found, key=found.__getitem__), max(found, key=found.__getitem__)
    return Measured(found[least], note=f"{least}; largest {found[most]:.2f} ({most})")


def same_motion(results: Results) -> Measured:
    """Largest difference of velocities at the end, both ways / largest velocity."""
    found = {}
    for name, runs in _runs(results).items():
        least, everything = (each[0].trace["velocity"][-1] for each in runs)
        found[name] = float(np.abs(least - everything).max() / np.abs(least).max())
    return largest(found)


def table(results: Results) -> Rows:
    """Bytes a ball and time of each scene, both ways."""
    rows = []
    for name, both in _runs(results).items():
        row: dict[str, object] = {"scene": name}
        for title, runs in zip(HOW, both, strict=True):
            n = runs[0].timing.particles
            row[f"{title}: bytes a ball"] = f"{sum(runs[0].notes['arrays'].values()) / n:.0f}"
            row[f"{title}: us per ball and step"] = f"{np.median([1e6 / r.timing.rate for r in runs]):.3f}"
        ratio = _speed_up(both)
        row["time, everything / least"] = f"{np.median(ratio):.2f} ({ratio.min():.2f} to {ratio.max():.2f})"
        rows.append(row)
    return rows
