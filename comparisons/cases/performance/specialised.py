"""Five scenes, each by the kernels built for it and by kernels that carry everything: bytes, time, motion."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from comparisons.bench.beds import COUNT, FRICTIONLESS, MATERIALS, PAIRS, bed_scene, bench_scene
from comparisons.cases.gas import scenes as gases
from comparisons.harness.case import Measured, Results, Tier, Variant
from gpudem.output.run import Run
from gpudem.scene import Contact, Material, Output, Pair, Scene, Time

if TYPE_CHECKING:
    import pandas

TIERS: tuple[Tier, ...] = ("full",)
STEPS, REPEATS, GAS = 1500, 3, 4913
HOW = ("leaving out", "everything")


def _gas() -> Scene:
    """Elastic spheres without walls, gravity, friction or spin."""
    step = 2e-6
    return gases.gas_box(
        "gas", GAS, 0.3, 1,
        materials={"ball": Material(young=1e8, poisson=gases.POISSON, density=gases.DENSITY)},
        pairs=[Pair(materials=("ball", "ball"))], contact=Contact(tangential="off"),
        time=Time(step=step, duration=STEPS * step), output=Output(trace_every=STEPS * step),
    )  # fmt: skip


def _bed(**changes) -> Scene:
    scene = bench_scene("settled", COUNT, STEPS, **changes)
    return scene.replace(output={"trace_every": STEPS * scene.time.step})


def _two_materials() -> Scene:
    """Every other ball as heavy again."""
    heavy = {**MATERIALS["polystyrene"], "density": 2 * MATERIALS["polystyrene"]["density"]}
    one = bench_scene("settled", COUNT, STEPS)
    particles = one.particles.model_dump()
    particles["material"] = ("polystyrene", "heavy") * (len(one.state) // 2)
    others = [
        {"materials": ("heavy", other), "restitution": 0.9, "friction": 0.3}
        for other in ("polystyrene", "heavy", "acrylic")
    ]
    return bed_scene(
        "two_materials", particles, gate=True, duration=one.time.duration, pairs=PAIRS + others,
        materials={**MATERIALS, "heavy": heavy}, output={"trace_every": one.time.duration},
    )  # fmt: skip


def _polydisperse() -> Scene:
    """Radii from 0.85 to 1 of the bed's, one for each ball."""
    one = bench_scene("settled", COUNT, STEPS)
    particles = one.particles.model_dump()
    rng = np.random.default_rng(1)
    particles["radius"] = rng.uniform(0.85, 1.0, len(one.state)) * particles["radius"]
    return bed_scene(
        "polydisperse", particles, gate=True, duration=one.time.duration,
        output={"trace_every": one.time.duration},
    )  # fmt: skip


def scenes() -> dict[str, Scene]:
    """The five, and the frictionless bed."""
    rolling = [{**pair, "rolling_friction": 0.1} for pair in PAIRS]
    return {
        "frictionless gas": _gas(),
        # without its dashpot, which at the set-up acts before there is a spring that friction 0 could cap
        "frictionless bed": _bed(pairs=FRICTIONLESS, contact={"tangential_damping": False}).replace(
            particles={"angular_velocity": None}
        ),
        "friction, one size": _bed(),
        "two materials": _two_materials(),
        "polydisperse": _polydisperse(),
        "rolling (epsd2)": _bed(pairs=rolling, contact={"rolling": "epsd2"}),
    }


def variants(tier: Tier) -> list[Variant]:
    """Each scene both ways, in turn, one core."""
    made = []
    for number, scene in enumerate(scenes().values() if tier in TIERS else ()):
        for repeat in range(REPEATS):
            for k, _ in enumerate(HOW):
                options = {"gpudem": {"threads": 1, "specialize": not k}}
                made.append(Variant(f"five_{number}_{k}_{repeat}", scene, ("gpudem",), options, timed=True))
    return made


def _runs(results: Results, number: int, how: int) -> list[Run]:
    return [results[f"five_{number}_{how}_{repeat}", "gpudem"] for repeat in range(REPEATS)]


def slower(results: Results) -> np.ndarray:
    """(scenes, repeats) time with everything / time of what the scene needs."""
    times = [
        [[r.timing.stepping_s for r in _runs(results, n, how)] for how in range(2)]
        for n in range(len(scenes()))
    ]
    return np.array([np.array(everything) / np.array(least) for least, everything in times])


def least_gain(results: Results) -> Measured:
    """Least median over the scenes of time with everything / time of what the scene needs."""
    found = np.median(slower(results), axis=1)
    names = list(scenes())
    k = int(found.argmin())
    return Measured(float(found[k]), note=f"{names[k]}; largest {found.max():.2f} ({names[found.argmax()]})")


def same_motion(results: Results) -> Measured:
    """Largest difference of velocities at the end, both ways / largest velocity."""
    found = {}
    for number, name in enumerate(scenes()):
        least, everything = (_runs(results, number, how)[0].trace["velocity"][-1] for how in range(2))
        found[name] = float(np.abs(least - everything).max() / np.abs(least).max())
    worst = max(found, key=lambda n: found[n])
    return Measured(found[worst], note=f"largest in {worst}")


def table(results: Results) -> pandas.DataFrame:
    """Bytes a ball and time of each scene, both ways."""
    import pandas

    rows, ratios = [], slower(results)
    for number, name in enumerate(scenes()):
        row: dict[str, object] = {"scene": name}
        for how, title in enumerate(HOW):
            runs = _runs(results, number, how)
            n = runs[0].timing.particles
            row[f"{title}: bytes a ball"] = f"{sum(runs[0].notes['arrays'].values()) / n:.0f}"
            micro = [1e6 * r.timing.stepping_s / r.timing.steps / n for r in runs]
            row[f"{title}: us a ball and step"] = f"{np.median(micro):.3f}"
        row["time, everything / least"] = (
            f"{np.median(ratios[number]):.2f} ({ratios[number].min():.2f} to {ratios[number].max():.2f})"
        )
        rows.append(row)
    return pandas.DataFrame(rows)
