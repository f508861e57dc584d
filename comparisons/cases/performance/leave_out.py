"""What a scene leaves out: the same bed frictionless and with everything, arrays and speed side by side."""

from __future__ import annotations

import pandas

from comparisons.bench.beds import COUNT, FRICTIONLESS, bench_scene
from comparisons.cases.performance import specialized
from comparisons.harness.case import Case, Check, Figure, Finding, Measured, Results, Table, Tier, Variant
from gpudem.errors import GpudemError
from gpudem.output.run import Run

STEPS = {"quick": 200, "standard": 2000, "full": 10000}
PLAIN, FULL = "frictionless", "friction"
ONLY_FULL = ("angular_velocity", "spring")


def variants(tier: Tier) -> list[Variant]:
    steps, one = STEPS[tier], {"gpudem": {"threads": 1}}
    plain = bench_scene("settled", COUNT, steps, pairs=FRICTIONLESS)
    plain = plain.replace(particles={"angular_velocity": None})
    return [
        Variant(PLAIN, plain, ("gpudem",), one, timed=True),
        Variant(FULL, bench_scene("settled", COUNT, steps), ("gpudem",), one, timed=True),
        *specialized.variants(tier),
    ]


def _both(results: Results) -> tuple[Run, Run]:
    return results[PLAIN, "gpudem"], results[FULL, "gpudem"]


def _arrays(run: Run) -> dict[str, int]:
    """Bytes of each array."""
    return run.notes["arrays"]


def _kinds(run: Run) -> set[str]:
    return {name.split(".")[1] for name in _arrays(run)}


def left_over(results: Results) -> Measured:
    """Arrays of friction and spin that the frictionless scene has, or that the full one lacks."""
    plain, full = map(_kinds, _both(results))
    here, missing = sorted(plain & set(ONLY_FULL)), sorted(set(ONLY_FULL) - full)
    note = ", ".join(here + [f"{m} missing in full" for m in missing])
    return Measured(len(here) + len(missing), note=note)


def bytes_ratio(results: Results) -> float:
    """Bytes of the frictionless scene / those of the full one."""
    plain, full = (sum(_arrays(run).values()) for run in _both(results))
    return plain / full


def time_ratio(results: Results) -> float:
    """Stepping time of the frictionless scene / that of the full one."""
    plain, full = (run.timing.stepping_s for run in _both(results))
    return plain / full


def summary(results: Results) -> pandas.DataFrame:
    """Arrays, bytes and speed of the two scenes."""

    def column(run: Run) -> list[str]:
        needs = ", ".join(k for k, v in run.scene.needs.model_dump().items() if v)
        bytes_each, rate = sum(_arrays(run).values()) / run.timing.particles, run.timing.rate / 1e6
        return [needs, str(len(_arrays(run))), f"{bytes_each:.0f}", f"{rate:.2f}"]

    rows = ["needs", "arrays", "bytes per particle", "particle-steps per second [1e6], one core"]
    plain, full = map(column, _both(results))
    return pandas.DataFrame({"": rows, PLAIN: plain, FULL: full})


def array_table(results: Results) -> pandas.DataFrame:
    """Every array with its bytes per particle in both scenes."""
    n = results[FULL, "gpudem"].timing.particles
    plain, full = map(_arrays, _both(results))
    rows = [
        (name, f"{plain[name] / n:.1f}" if name in plain else "not there", f"{size / n:.1f}")
        for name, size in sorted(full.items(), key=lambda item: -item[1])
    ]
    return pandas.DataFrame(rows, columns=["array", f"{PLAIN} [B/particle]", f"{FULL} [B/particle]"])


def kernel_table(results: Results) -> pandas.DataFrame:
    """Registers and spills of the step kernel of both scenes, compiled for sm_90."""
    from comparisons.bench.registers import find_ptxas, step_kernel_resources
    from gpudem.solver.spec import Spec

    if find_ptxas() is None:
        return pandas.DataFrame({"note": ["left out: no ptxas here (pip install 'gpudem[registers]')"]})
    rows = []
    for label, run in zip((PLAIN, FULL), _both(results), strict=True):
        for precision in ("float64", "float32"):
            try:
                found = step_kernel_resources(Spec.of(run.scene.replace(solver={"precision": precision})))
            except GpudemError as error:  # an older assembler than Warp's PTX: a fact about this machine
                note = f"{str(error).splitlines()[0]}; pip install 'gpudem[registers]'"
                return pandas.DataFrame({"note": [note]})
            rows.append((label, precision, found.registers, found.spill_bytes, found.stack_bytes))
    return pandas.DataFrame(rows, columns=["scene", "precision", "registers", "spilled [B]", "stack [B]"])


def draw_bytes(results: Results):
    from comparisons.report import plots

    plain, full = _both(results)
    kinds = sorted(_kinds(full))
    figure, axes = plots.figure(width=plots.WHOLE, height=3.4)
    for shift, label, run in ((-0.2, PLAIN, plain), (0.2, FULL, full)):
        totals = dict.fromkeys(kinds, 0.0)
        for name, size in _arrays(run).items():
            totals[name.split(".")[1]] += size / run.timing.particles
        axes.bar([k + shift for k in range(len(kinds))], list(totals.values()), width=0.38, label=label)
    axes.set_xticks(range(len(kinds)), [k.replace("_", " ") for k in kinds], rotation=60, ha="right")
    axes.set_ylabel("bytes per particle, all copies")
    axes.legend()
    return figure


CASE = Case(
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
        Check(
            name="arrays of friction and spin in the frictionless scene, or missing in the full one",
            measure=left_over, tolerance=0, unit="arrays", against="the scene's needs", mark="R",
            reason="exact", catches="arrays allocated for physics that the scene does not have",
        ),
        Check(
            name="bytes, frictionless / full", measure=bytes_ratio, tolerance=0.7, unit="1", mark="R",
            against="the full scene",
            reason="springs (24 B an entry, two copies) and spin are more than 30 % of the full scene",
            catches="history kept without tangential forces",
        ),
        Check(
            name="velocities, with everything less without / largest, over six scenes",
            measure=specialized.same_motion, tolerance=1e-6, unit="1", mark="R", tiers=("full",),
            against="kernels that carry everything",
            reason="products in another order: rounding, which a gas multiplies at each collision",
            catches="physics left out that the scene has",
        ),
    ),
    findings=(
        Finding(
            "stepping time, frictionless / full", time_ratio, "1",
            "One core, one after the other; about 0.6 on an idle machine.", tiers=("standard", "full"),
        ),
        Finding(
            "time with everything / time of what a scene needs, least over six scenes",
            specialized.least_gain, "1",
            "The same scene in turn, one core; above 1 the specialized kernel is faster.", tiers=("full",),
        ),
    ),
    figures=(
        Figure(
            "Bytes per particle by array",
            "Springs and angular velocities exist only where there is friction.", draw_bytes,
        ),
    ),
    tables=(
        Table(
            "What leaving out buys",
            "Each scene by the kernels built for it and by kernels that carry friction springs, rolling"
            " torques, and radius, mass and material of each ball; some 5000 balls, one core, float64; median"
            " and range of three runs in turn.",
            specialized.table, tiers=("full",), recorded=True,
        ),
        Table("Both scenes", "One core, float64, 5000 spheres settled behind the gate.", summary),
        Table(
            "Every array",
            "Bytes per particle; `next` is what a step or a rebuild writes; `list.*` are working copies.",
            array_table,
        ),
        Table("Step kernel on sm_90", "Registers of a thread, bytes spilled; no GPU needed.", kernel_table),
    ),
    features=("leaving out", "CUDA compile"),
    order=80,
)  # fmt: skip
