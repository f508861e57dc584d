"""What a scene leaves out: the same bed frictionless and with everything, arrays and speed side by side."""

from __future__ import annotations

from collections.abc import Callable

import pandas

from comparisons import kit
from comparisons.bench.beds import COUNT, FRICTIONLESS, bench_scene
from comparisons.cases.performance import specialized
from comparisons.report import plots
from gpudem.errors import GpudemError
from gpudem.output.run import Run

STEPS = {"quick": 200, "standard": 2000, "full": 10000}
PLAIN, FULL = "frictionless", "friction"
ONLY_FULL = {"angular_velocity", "spring"}


def variants(tier: kit.Tier) -> list[kit.Variant]:
    steps, one = STEPS[tier], {"gpudem": {"threads": 1}}
    plain = bench_scene("settled", COUNT, steps, pairs=FRICTIONLESS)
    plain = plain.replace(particles={"angular_velocity": None})
    return [
        kit.Variant(PLAIN, plain, ("gpudem",), one, timed=True),
        kit.Variant(FULL, bench_scene("settled", COUNT, steps), ("gpudem",), one, timed=True),
        *specialized.variants(tier),
    ]


def _both(results: kit.Results) -> tuple[Run, Run]:
    return results[PLAIN, "gpudem"], results[FULL, "gpudem"]


def _bytes(run: Run) -> pandas.Series:
    """Bytes of each array for a particle."""
    return pandas.Series(run.notes["arrays"], dtype=float) / run.timing.particles


def _kind(array: str) -> str:
    return array.split(".")[1]


def left_over(results: kit.Results) -> kit.Measured:
    """Arrays of friction and spin that the frictionless scene has, or that the full one lacks."""
    plain, full = (set(map(_kind, run.notes["arrays"])) for run in _both(results))
    wrong = sorted(plain & ONLY_FULL) + [f"{m} missing in full" for m in sorted(ONLY_FULL - full)]
    return kit.Measured(len(wrong), note=", ".join(wrong))


def ratio(results: kit.Results, of: Callable[[Run], float]) -> float:
    """of(run) of the frictionless scene / that of the full one."""
    plain, full = map(of, _both(results))
    return plain / full


def summary(results: kit.Results) -> kit.Rows:
    """Arrays, bytes and speed of the two scenes."""

    def column(run: Run) -> dict[str, str]:
        return {
            "needs": ", ".join(k for k, v in run.scene.needs.model_dump().items() if v),
            "arrays": str(len(_bytes(run))),
            "bytes per particle": f"{_bytes(run).sum():.0f}",
            "particle-steps per second [1e6], one core": f"{run.timing.rate / 1e6:.2f}",
        }

    plain, full = map(column, _both(results))
    return [{"": name, PLAIN: text, FULL: full[name]} for name, text in plain.items()]


def array_table(results: kit.Results) -> kit.Rows:
    """Every array with its bytes per particle in both scenes."""
    plain, full = map(_bytes, _both(results))
    return [
        {"array": name, f"{PLAIN} [B/particle]": f"{plain[name]:.1f}" if name in plain else "not there",
         f"{FULL} [B/particle]": f"{size:.1f}"}
        for name, size in sorted(full.items(), key=lambda item: -item[1])
    ]  # fmt: skip


def kernel_table(results: kit.Results) -> kit.Rows:
    """Registers, spills and occupancy of a step without output in both scenes, compiled for sm_90."""
    from comparisons.bench.registers import find_ptxas, step_kernel_resources
    from gpudem.solver.launch_bounds import THREADS
    from gpudem.solver.spec import Spec

    if find_ptxas() is None:
        return [{"note": "left out: no ptxas here (pip install 'gpudem[registers]')"}]
    rows = []
    for label, run in zip((PLAIN, FULL), _both(results), strict=True):
        for precision in ("float64", "mixed", "float32"):
            spec = Spec.of(run.scene.replace(solver={"precision": precision}))
            try:
                found = step_kernel_resources(spec, plain=True)
            except GpudemError as error:  # an older assembler than Warp's PTX: a fact about this machine
                return [{"note": f"{str(error).splitlines()[0]}; pip install 'gpudem[registers]'"}]
            rows.append({
                "scene": label, "precision": precision, "registers": found.registers,
                "spilled [B]": found.spill_bytes, "stack [B]": found.stack_bytes,
                "shared memory of a block [B]": found.shared_bytes,
                "threads in flight [%]": f"{100 * found.occupancy(THREADS):.1f}",
            })  # fmt: skip
    return rows


def draw_bytes(results: kit.Results) -> plots.Figure:
    figure, axes = plots.figure(width=plots.WHOLE, height=3.4)
    totals = {
        label: _bytes(run).groupby(_kind).sum()
        for label, run in zip((PLAIN, FULL), _both(results), strict=True)
    }
    pandas.DataFrame(totals).rename(lambda kind: kind.replace("_", " ")).plot.bar(ax=axes, width=0.76, rot=60)
    axes.set_ylabel("bytes per particle, all copies")
    for label in axes.get_xticklabels():
        label.set_ha("right")
    return figure


CASE = kit.Case(
    name="leave_out",
    title="What a scene leaves out",
    purpose=(
        "Kernels and arrays are built for what a scene needs. The same settled bed of 5000 spheres without"
        " friction and with it: the first has no spin, no shear springs and no history of walls, in memory or"
        " in code, and is faster. Equal spheres of one material have no array of radius, mass or material in"
        " either."
    ),
    source="gpudem's own arrays, as allocated; registers from NVIDIA's assembler, no GPU needed.",
    variants=variants,
    checks=(
        kit.Check(
            name="arrays of friction and spin in the frictionless scene, or missing in the full one",
            measure=left_over, tolerance=0, unit="arrays", against="the scene's needs", mark="R",
            reason="exact", catches="arrays allocated for physics that the scene does not have",
        ),
        kit.Check(
            name="bytes, frictionless / full",
            measure=lambda results: ratio(results, lambda run: sum(run.notes["arrays"].values())),
            tolerance=0.7, unit="1", mark="R", against="the full scene",
            reason="springs (24 B an entry, two copies) and spin are more than 30 % of the full scene",
            catches="history kept without tangential forces",
        ),
        kit.Check(
            name="velocities, with everything less without / largest, over six scenes",
            measure=specialized.same_motion, tolerance=1e-6, unit="1", mark="R", tiers=("full",),
            against="kernels that carry everything",
            reason="products in another order: rounding, which a gas multiplies at each collision",
            catches="physics left out that the scene has",
        ),
    ),
    findings=(
        kit.Finding(
            "stepping time, frictionless / full",
            lambda results: ratio(results, lambda run: run.timing.stepping_s), "1",
            "One core, one after the other; about 0.6 on an idle machine.", tiers=("standard", "full"),
        ),
        kit.Finding(
            "time with everything / time of what a scene needs, least over six scenes",
            specialized.least_gain, "1",
            "The same scene in turn, one core; above 1 the specialized kernel is faster.", tiers=("full",),
        ),
    ),
    figures=(
        kit.Figure(
            "Bytes per particle by array",
            "Springs and angular velocities exist only where there is friction.", draw_bytes,
        ),
    ),
    tables=(
        kit.Table(
            "What leaving out buys",
            "Each scene by the kernels built for it and by kernels that carry friction springs, rolling"
            " torques, and radius, mass and material of each ball; some 5000 balls, one core, float64; median"
            " and range of three runs in turn.",
            specialized.table, tiers=("full",), recorded=True,
        ),
        kit.Table("Both scenes", "One core, float64, 5000 spheres settled behind the gate.", summary),
        kit.Table(
            "Every array",
            "Bytes per particle; `next` is what a step or a rebuild writes; `list.*` are working copies.",
            array_table,
        ),
        kit.Table(
            "Step kernel on sm_90",
            "Of steps without output: registers of a thread, bytes spilled to memory, shared memory of a"
            " block of 128 threads, and how many threads are in flight of those that a multiprocessor could"
            " hold; no GPU needed.",
            kernel_table,
        ),
    ),
    features=("leaving out", "CUDA compile"),
    order=80,
)  # fmt: skip
