"""Figures and tables of a scene."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from comparisons.harness import codes
from comparisons.harness.case import Results, Unmeasured
from comparisons.metrics import bulk, contacts, parting
from comparisons.report import plots
from comparisons.scene_case import analysis, checks
from comparisons.scene_case import plan as plans
from comparisons.scene_case.plan import Plan

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

#: Points of a curve at most.
POINTS = 1500


def ran(results: Results, label: str = plans.SCENE) -> list[str]:
    """Codes that ran a variant."""
    return [code for code in codes.CODES if (label, code) in results.runs]


def _thin(count: int) -> np.ndarray:
    return np.unique(np.linspace(0, count - 1, min(count, POINTS)).astype(int))


def difference(results: Results, plan: Plan) -> Figure:
    """Largest difference of positions in time, of codes and of perturbed runs, with what is allowed."""
    limits = analysis.envelope(results, plan)
    figure, axes = plots.figure(width=plots.WHOLE, height=3.8)
    scale, some = analysis.diameter(plan.scene), _thin(len(limits.time))
    time = limits.time[some]
    envelope = limits.measured["position"][some] / scale
    axes.semilogy(
        time, envelope, color=plots.SOFT, lw=0.9, label="gpudem, starts perturbed by rounding: envelope"
    )
    axes.semilogy(
        time, analysis.FACTOR * envelope, **plots.TOLERANCE, label=f"allowed: {analysis.FACTOR:g} times that"
    )
    for k, (code, other) in enumerate(codes.pairs(ran(results))):
        found = analysis.agreement(results, plan, code, other)
        label = f"{codes.title(code)} and {codes.title(other)}"
        axes.semilogy(
            time, np.maximum(found.difference[some], 1e-18), color=plots.SERIES[k], lw=1.3, label=label
        )
        if found.parting is not None:
            axes.axvline(
                found.parting.time, color=plots.SERIES[k], lw=1.0, ls="-.", label=f"{label} separate"
            )
    if (plans.HALF, "gpudem") in results.runs:
        when, half = analysis.halving(results, plan)
        chosen = _thin(len(when))
        axes.semilogy(
            when[chosen], np.maximum(half[chosen], 1e-18), color=plots.SERIES[2], lw=0.9, ls=":",
            label="gpudem, step and half the step",
        )  # fmt: skip
    if math.isfinite(limits.horizon):
        axes.axvline(limits.horizon, color=plots.INK, lw=0.9, ls=":", label="horizon")
    axes.set(xlabel="time [s]", ylabel="largest difference of positions / diameter")
    plots.legend(axes, loc="best")
    return figure


def histories(results: Results, plan: Plan) -> Figure:
    """Energies, contacts, center of mass and front of each code; over seeds as bands where there are any."""
    up, flow = bulk.axes(plan.scene, analysis.trace(results[plans.SCENE, ran(results)[0]]))
    figure, axes = plots.figure(2, 2, width=plots.WHOLE, height=5.0, sharex=True)
    seeds = [label for label in analysis.seed_labels(plan) if ran(results, label)]
    labels = seeds or [plans.SCENE]
    for code in ran(results, labels[0]):
        rows = [_series(results, label, code, up, flow) for label in labels if (label, code) in results.runs]
        for name, panel in zip(rows[0], axes.flat, strict=False):
            time, first = rows[0][name]
            if len(rows) > 1:
                plots.band(panel, time, [row[name][1] for row in rows], code)
            else:
                panel.plot(time, first, **plots.style(code, markevery=max(1, len(time) // 25)))
            panel.set_ylabel(name)
    for panel in axes[1]:
        panel.set_xlabel("time [s]")
    for panel in axes.flat:
        panel.set_visible(panel.has_data())
    plots.legend(axes[0, 0])
    return figure


def _series(results: Results, label: str, code: str, up: int | None, flow: int):
    run = results[label, code]
    trace = analysis.trace(run)
    chosen = _thin(len(trace["time"]))
    part = {k: v[chosen] for k, v in trace.items()}
    energy, mass = bulk.energies(run.scene, part), run.scene.masses
    found = {"kinetic energy [J]": (part["time"], energy["kinetic"])}
    if run.history is not None and "contacts" in run.history:
        found["contacts"] = (run.history["time"].to_numpy(), run.history["contacts"].to_numpy())
    for axis in [flow] if up is None else [flow, up]:
        if not run.scene.domain.periodic[axis]:
            there = np.isfinite(part["position"][..., axis])
            total = np.where(there.any(axis=1), there @ mass, np.nan)
            center = np.nan_to_num(part["position"][..., axis]) @ mass / total
            found[f"center of mass along {'xyz'[axis]} [m]"] = (part["time"], center)
    return found


def profiles(results: Results, plan: Plan) -> Figure:
    """Height along the flow and distribution of overlaps at the end of the runs."""
    up, flow = bulk.axes(plan.scene, analysis.trace(results[plans.SCENE, ran(results)[0]]))
    if len(plan.scene.state) < bulk.MANY or up is None:
        raise Unmeasured("profiles need gravity and many particles")
    seeds = [label for label in analysis.seed_labels(plan) if ran(results, label)]
    labels = seeds or [plans.SCENE]
    quantiles = np.linspace(0, 1, 101)
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.2)
    for code in ran(results, labels[0]):
        heights, depths, at = [], [], np.zeros(0)
        for label in [lab for lab in labels if (lab, code) in results.runs]:
            run = results[label, code]
            trace = analysis.trace(run)
            at, height = bulk.height_profile(run.scene, trace["position"][-1], up, flow, 16)
            heights.append(height)
            state = parting.state_of(run.scene, trace["position"][-1], float(trace["time"][-1]))
            share = bulk.overlaps(run.scene, state)
            depths.append(np.quantile(share, quantiles) if len(share) else 0 * quantiles)
        plots.band(left, at, heights, code)
        plots.band(right, quantiles, depths, code)
    left.set(xlabel=f"{'xyz'[flow]} [m]", ylabel="height at the end [m]")
    right.set(xlabel="share of contacts", ylabel="overlap / radius at the end at most")
    plots.legend(left)
    return figure


def summary(results: Results, plan: Plan) -> pandas.DataFrame:
    """What was chosen and found, as quantity and value."""
    import pandas

    limits, scene = analysis.envelope(results, plan), plan.scene
    growth, end = limits.growth, float(limits.time[-1])
    memory = len(scene.state) * plan.times * plans.ENTRY
    rate = f"no exponential growth: by a factor of {growth.factor:.2g} in the whole run"
    if growth.rate:
        fit = f"tenfold every {growth.decade:.3g} s (r² = {growth.correlation:.2f})"
        rate = f"{growth.rate:.4g} 1/s: {fit}"
    rows = [
        (
            "trace of the comparison",
            f"{plan.times} times, every {plan.stride} steps, {memory / 1e6:.3g} MB a run",
        ),
        ("perturbation that stands for rounding", f"{plans.rounding(scene):.2g} m"),
        ("growth of a rounding difference", rate),
        ("horizon", f"{limits.horizon:.6g} s" if limits.horizon <= end else f"none within {end:.6g} s"),
    ]
    for code, other in codes.pairs(ran(results)):
        found = analysis.agreement(results, plan, code, other)
        pair = f"{codes.title(code)} and {codes.title(other)}"
        rows.append((f"{pair}: largest difference until the horizon", f"{found.largest:.3g} diameters"))
        where = found.parting
        rows.append((f"{pair}: first difference beyond rounding", where.sentence if where else "none"))
        if where and where.before < where.time:
            rows.append((f"{pair}: last time without it", f"{where.before:.6g} s"))
    time, half = analysis.halving(results, plan)
    inside = time <= limits.horizon
    rows.append(
        (
            "half the step: largest change of positions until the horizon",
            f"{half[inside].max():.3g} diameters",
        )
    )
    return pandas.DataFrame(rows, columns=["quantity", "found"])


def sanity(results: Results, plan: Plan) -> pandas.DataFrame:
    """Each code by itself: conservation, overlap, contacts, time and memory."""
    import pandas

    rows = []
    for code in ran(results):
        found, timing = analysis.sanity(results, plan, code), results[plans.SCENE, code].timing
        defined = checks.energy_defined(plan.scene)
        change = (found.energy - found.energy[0]) / (found.scale if defined and found.scale else math.nan)
        momentum = found.momentum if not (plan.scene.walls or plan.scene.groups) else math.nan
        rows.append(
            (
                codes.title(code), float(found.contacts.max()), found.overlap, _known(np.nanmax, change),
                _known(np.nanmin, change), _known(np.nanmax, found.work), momentum,
                timing.peak_memory_bytes / 2**20,
            )
        )  # fmt: skip
    columns = [
        "code", "contacts, most", "overlap / radius", "energy, largest gain / kinetic",
        "energy, largest loss / kinetic", "work of walls, most [J]", "momentum, change",
        "peak memory of the process [MiB]",
    ]  # fmt: skip
    return pandas.DataFrame(rows, columns=columns)


def _known(of: Callable[[np.ndarray], float], values: np.ndarray) -> float:
    """A number of those values that are known; NaN if none is."""
    return float(of(values)) if np.isfinite(values).any() else math.nan


def distributions(results: Results, plan: Plan) -> pandas.DataFrame:
    """Every metric of each pair: means, spread, difference, p before and after the correction."""
    import pandas

    rows = []
    complete = [code for code in codes.CODES if analysis.has_seeds(results, plan, code)]
    for code, other in codes.pairs(complete if not analysis.no_last_state(plan) else []):
        for name, c in analysis.distributions(results, plan, code, other).items():
            pair = f"{codes.title(code)} / {codes.title(other)}"
            rows.append((pair, name, *c.mean, *c.spread, c.difference, c.half_width, c.p, c.corrected))
    if not rows:
        raise Unmeasured(
            "no runs over seeds: single runs are compared to the end, or there is no second code"
        )
    columns = [
        "codes", "metric", "mean, first", "mean, second", "spread, first", "spread, second", "difference",
        "± (95 %)", "p (Welch)", "p (corrected)",
    ]  # fmt: skip
    return pandas.DataFrame(rows, columns=columns)


def ladder(results: Results, plan: Plan) -> dict[str, tuple[list[float], list[float], list[float]]]:
    """Code and precision -> (steps [s], stepping times [s], errors / diameter) against its smallest step."""
    found: dict[str, tuple[list[float], list[float], list[float]]] = {}
    made = plans.rungs(plan, analysis.resolved(results, plan))
    reference = made[-1][0]
    for label, step, precision, _ in made[:-1]:
        for code in ran(results, label):
            if (reference, code) not in results.runs:
                continue
            run, best = results[label, code], analysis.trace(results[reference, code])
            count = min(len(best["time"]), len(analysis.trace(run)["time"]))
            shift = contacts.nearest_image(
                analysis.trace(run)["position"][:count] - best["position"][:count], parting.period(plan.scene)
            )
            error = float(np.linalg.norm(shift, axis=2).max()) / analysis.diameter(plan.scene)
            key = f"{code} {precision}" if code == "gpudem" else code
            for values, value in zip(
                found.setdefault(key, ([], [], [])), (step, run.timing.stepping_s, error), strict=True
            ):
                values.append(value)
    return found


def work_precision(results: Results, plan: Plan) -> Figure:
    """Error against stepping time."""
    found = {key: (seconds, errors) for key, (_, seconds, errors) in ladder(results, plan).items()}
    return plots.work_precision(found, ylabel="largest error of positions / diameter")


def work_table(results: Results, plan: Plan) -> pandas.DataFrame:
    """Step, time and error of each run of the ladder."""
    import pandas

    rows = [
        (*_split(key), step, seconds, error)
        for key, values in ladder(results, plan).items()
        for step, seconds, error in zip(*values, strict=True)
    ]
    columns = ["code", "precision", "step [s]", "stepping [s]", "largest error / diameter"]
    return pandas.DataFrame(rows, columns=columns)


def _split(key: str) -> tuple[str, str]:
    code, _, precision = key.partition(" ")
    return codes.title(code), precision or "float64"
