"""What a scene leaves out: the same bed frictionless and with everything, arrays and speed side by side."""

from __future__ import annotations

import pandas

from comparisons.bench.beds import COUNT, FRICTIONLESS, bench_scene
from comparisons.cases.performance import specialised
from comparisons.harness.case import Case, Check, Figure, Measured, Results, Table, Tier, Variant
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
        *specialised.variants(tier),
    ]


def _arrays(results: Results, label: str) -> dict[str, int]:
    return results[label, "gpudem"].notes["arrays"]


def _kinds(results: Results, label: str) -> set[str]:
    return {name.split(".")[1] for name in _arrays(results, label)}


def left_over(results: Results) -> Measured:
    """Arrays of friction and spin that the frictionless scene carries all the same."""
    here = sorted(_kinds(results, PLAIN) & set(ONLY_FULL))
    missing = sorted(set(ONLY_FULL) - _kinds(results, FULL))
    return Measured(
        len(here) + len(missing), note=", ".join(here + [f"{m} missing in full" for m in missing])
    )


def bytes_ratio(results: Results) -> Measured:
    """Bytes of the frictionless scene over those of the full one."""
    plain, full = (sum(_arrays(results, label).values()) for label in (PLAIN, FULL))
    return Measured(plain / full)


def time_ratio(results: Results) -> Measured:
    """Stepping time of the frictionless scene over that of the full one."""
    plain, full = (results[label, "gpudem"].timing.stepping_s for label in (PLAIN, FULL))
    return Measured(plain / full)


def summary(results: Results) -> pandas.DataFrame:
    """Arrays, bytes and speed of the two scenes."""

    def column(run: Run) -> list[str]:
        arrays, n = run.notes["arrays"], run.timing.particles
        needs = ", ".join(k for k, v in run.scene.needs.model_dump().items() if v)
        bytes_each, rate = sum(arrays.values()) / n, run.timing.rate / 1e6
        return [needs, str(len(arrays)), f"{bytes_each:.0f}", f"{rate:.2f}"]

    rows = ["needs", "arrays", "bytes per particle", "particle-steps per second [1e6], one core"]
    table = {label: column(results[label, "gpudem"]) for label in (PLAIN, FULL)}
    return pandas.DataFrame({"": rows, **table})


def array_table(results: Results) -> pandas.DataFrame:
    """Every array with its bytes per particle in both scenes."""
    plain, full = _arrays(results, PLAIN), _arrays(results, FULL)
    n = results[FULL, "gpudem"].timing.particles
    names = sorted(full, key=lambda name: -full[name])
    cell = {True: lambda v: f"{v / n:.1f}", False: lambda v: "not there"}
    return pandas.DataFrame(
        {
            "array": names,
            f"{PLAIN} [B/particle]": [cell[name in plain](plain.get(name)) for name in names],
            f"{FULL} [B/particle]": [f"{full[name] / n:.1f}" for name in names],
        }
    )


def kernel_table(results: Results) -> pandas.DataFrame:
    """Registers and spills of the step kernel of both scenes, compiled for sm_90."""
    from comparisons.bench.registers import find_ptxas, step_kernel_resources
    from gpudem.solver.spec import Spec

    if find_ptxas() is None:
        return pandas.DataFrame({"note": ["left out: no ptxas here (pip install 'gpudem[registers]')"]})
    rows = []
    for label in (PLAIN, FULL):
        for precision in ("float64", "float32"):
            scene = results[label, "gpudem"].scene.replace(solver={"precision": precision})
            try:
                found = step_kernel_resources(Spec.of(scene))
            except GpudemError as error:  # an older assembler than Warp's PTX: a fact about this machine
                return pandas.DataFrame(
                    {"note": [f"{str(error).splitlines()[0]}; pip install 'gpudem[registers]'"]}
                )
            rows.append((label, precision, found.registers, found.spill_bytes, found.stack_bytes))
    return pandas.DataFrame(rows, columns=["scene", "precision", "registers", "spilled [B]", "stack [B]"])


def draw_bytes(results: Results):
    from comparisons.report import plots

    n = results[FULL, "gpudem"].timing.particles
    kinds = sorted({*_kinds(results, FULL)})
    figure, axes = plots.figure(width=plots.WHOLE, height=3.4)
    for shift, label in ((-0.2, PLAIN), (0.2, FULL)):
        arrays = _arrays(results, label)
        totals = [sum(v for k, v in arrays.items() if k.split(".")[1] == kind) / n for kind in kinds]
        axes.bar([k + shift for k in range(len(kinds))], totals, width=0.38, label=label)
    axes.set_xticks(range(len(kinds)), [k.replace("_", " ") for k in kinds], rotation=60, ha="right")
    axes.set_ylabel("bytes per particle, all copies")
    axes.legend()
    return figure


CASE = Case(
    name="leave_out",
    title="What a scene leaves out",
    purpose=(
        "Kernels and arrays are built for what a scene needs. The same settled bed of 5000 spheres once"
        " without friction and once with: the first carries no spin, no shear springs and no walls' history,"
        " in memory or in code, and is faster for it. Equal spheres of one material carry no radius, mass or"
        " material array in either."
    ),
    source="gpudem's own arrays, as allocated; registers from NVIDIA's assembler, no GPU needed.",
    variants=variants,
    checks=(
        Check(
            name="arrays of friction and spin in the frictionless scene, or missing in the full one",
            measure=left_over, tolerance=0, unit="arrays", against="the scene's needs", mark="R",
            reason="an exact statement", catches="arrays allocated for physics that the scene does not have",
        ),
        Check(
            name="bytes, frictionless / full", measure=bytes_ratio, tolerance=0.7, unit="1", mark="R",
            against="the full scene",
            reason="springs (24 B an entry, two copies) and spin are more than 30 % of the full scene",
            catches="history kept without tangential forces",
        ),
        Check(
            name="stepping time, frictionless / full", measure=time_ratio, tolerance=0.9, unit="1", mark="R",
            against="the full scene, one core, one after the other", tiers=("standard", "full"),
            reason="about 0.6 on an idle machine; 0.9 leaves room for a busy one",
            catches="branches of friction left in the frictionless kernel",
        ),
        Check(
            name="time with everything / time of what a scene needs, least over six scenes",
            measure=specialised.least_gain, lo=1.0, tolerance=10.0, unit="1", mark="R", tiers=("full",),
            against="the same scene, kernels that carry everything; in turn, one core",
            reason="what is left out costs nothing, so that nothing may be gained by carrying it",
            catches="a specialised kernel that is no faster than the general one",
        ),
        Check(
            name="velocities, with everything less without / largest, over six scenes",
            measure=specialised.same_motion, tolerance=1e-6, unit="1", mark="R", tiers=("full",),
            against="kernels that carry everything",
            reason="products in another order: rounding, which a gas multiplies at each collision",
            catches="physics left out that the scene has",
        ),
    ),
    figures=(
        Figure(
            "Bytes per particle by array",
            "Springs and angular velocities exist only where there is friction.",
            draw_bytes,
        ),
    ),
    tables=(
        Table(
            "What leaving out buys",
            "Each scene by the kernels built for it and by kernels that carry friction springs, rolling"
            " torques, and radius, mass and material of each ball; some 5000 balls, one core, float64; median"
            " and range of three runs in turn.",
            specialised.table, tiers=("full",), recorded=True,
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
