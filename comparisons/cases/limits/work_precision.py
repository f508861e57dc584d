"""Which code and option needs how much time for 1 % and 0.1 % error: thousands of contacts at once."""

from __future__ import annotations

import statistics

import numpy as np
import pandas

from comparisons.cases.limits import work_scenes as work
from comparisons.cases.limits.work_scenes import GROUPS, KINDS
from comparisons.harness.case import TIERS, Case, Check, Figure, Measured, Results, Table, Tier, Variant
from comparisons.metrics.trace import observed_order

#: Code or option -> (code, arguments of its run function, finest rung worth running).
OPTIONS = {
    "liggghts": ("liggghts", {"ranks": 1, "use_recorded": False}, 1280),
    "gpudem": ("gpudem", {"threads": 1}, 1280),
    "gpudem float32": ("gpudem", {"threads": 1, "precision": "float32"}, 1280),
    "gpudem path": ("gpudem", {"threads": 1, "integrator": "path"}, 320),
    "gpudem path mixed": ("gpudem", {"threads": 1, "integrator": "path", "precision": "mixed"}, 320),
}
#: (kinds, steps in a contact, pairs in a group, repeats)
PLAN = {
    "quick": (("normal",), (20, 80, 320), 50, 1),
    "standard": (tuple(KINDS), (10, 20, 40, 80, 160, 320, 640, 1280), 400, 2),
    "full": (tuple(KINDS), (10, 20, 40, 80, 160, 320, 640, 1280, 2560), 400, 3),
}
TARGETS = (0.01, 0.001)
#: Steps in a contact between which the order is fitted: the range people use.
FIT = (20, 320)
HALF = GROUPS.index(0.5)


def _label(option: str, kind: str, steps: int, repeat: int) -> str:
    return f"{kind}-{option.replace(' ', '_')}-{steps}-{repeat}"


def variants(tier: Tier) -> list[Variant]:
    kinds, ladder, pairs, repeats = PLAN[tier]
    made = {(kind, steps): work.scene(kind, steps, pairs) for kind in kinds for steps in ladder}
    return [
        Variant(_label(option, kind, steps, repeat), made[kind, steps], (code,), {code: arg}, timed=True)
        for kind in kinds for repeat in range(repeats) for steps in ladder
        for option, (code, arg, finest) in OPTIONS.items() if steps <= finest
    ]  # fmt: skip


def curve(
    results: Results, option: str, kind: str, repeat: int = 0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(steps in a contact, stepping seconds, errors (rungs, groups)) of one ladder."""

    def compute() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        code, _, finest = OPTIONS[option]
        ladder = [s for s in PLAN[results.tier][1] if s <= finest]
        runs = [results[_label(option, kind, s, repeat), code] for s in ladder]
        seconds = np.array([r.timing.stepping_s for r in runs])
        return np.array(ladder), seconds, np.array([work.errors(results, r, kind) for r in runs])

    return results.once(("curve", option, kind, repeat), compute)


def _repeats(results: Results) -> range:
    return range(PLAN[results.tier][3])


def ratios(results: Results, option: str, kind: str, group: int, target: float, cost: str) -> list[float]:
    """Cost of LIGGGHTS over that of an option for the same error, each repeat; cost: "time" or "steps"."""
    found = []
    for repeat in _repeats(results):
        costs = []
        for who in ("liggghts", option):
            steps, seconds, errors = curve(results, who, kind, repeat)
            costs.append(work.cost_of(target, errors[:, group], seconds if cost == "time" else steps))
        found.append(costs[0] / costs[1])
    return found


def _fewer(kind: str, cost: str, least: float) -> Check:
    def measure(results: Results) -> Measured:
        worst = [
            (statistics.median(ratios(results, "gpudem path", kind, g, 0.001, cost)), GROUPS[g])
            for g in range(len(GROUPS)) if GROUPS[g] < 0.6
        ]  # fmt: skip
        value, e = min(worst)
        return Measured(1 / value, measured=value, note=f"the least gain is at e = {e:g}")

    what = "steps" if cost == "steps" else "stepping time"
    return Check(
        name=f"{what} of gpudem path / {what} of LIGGGHTS for 0.1 % error, {kind.replace('_', ' ')}",
        measure=measure, tolerance=1 / least, unit="1", against="LIGGGHTS, same contacts, same run", mark="X",
        reason=f"the better integrator is to need at least {least:g} times less",
        catches="damping evaluated at the wrong time or place: order one instead of two",
        needs=("gpudem", "liggghts"), tiers=("standard", "full"),
    )  # fmt: skip


def _order(
    option: str, kind: str, groups: tuple[float, ...], expected: float, slack: float, why: str
) -> Check:
    def measure(results: Results) -> Measured:
        steps, _, errors = curve(results, option, kind)
        fit = (steps >= FIT[0]) & (steps <= FIT[1])
        orders = {
            GROUPS[g]: observed_order(1 / steps[fit], errors[fit, g])
            for g in range(len(GROUPS)) if GROUPS[g] in groups
        }  # fmt: skip
        note = ", ".join(f"{v:.2f} at e = {e:g}" for e, v in orders.items())
        if expected > 1:  # falling faster than promised is no fault
            value = min(orders.values())
            return Measured(max(0.0, expected - value), measured=value, expected=expected, note=note)
        value = max(orders.values(), key=lambda o: abs(o - expected))
        return Measured(abs(value - expected), measured=value, expected=expected, note=note)

    return Check(
        name=f"observed order of {option}, {kind}", measure=measure, tolerance=slack, unit="1",
        against="ODE (DOP853, rtol 1e-13)", mark="A", reason=why,
        catches="an integrator of another order", needs=(OPTIONS[option][0],),
        tiers=("standard", "full") if kind != "normal" else ("quick", "standard", "full"),
    )  # fmt: skip


def same_error(results: Results) -> Measured:
    """Largest relative difference of LIGGGHTS' and gpudem's errors on equal rungs, equal options."""
    worst = 0.0
    for kind in PLAN[results.tier][0]:
        ours, theirs = (curve(results, who, kind)[2] for who in ("gpudem", "liggghts"))
        worst = max(worst, float(np.abs(ours / theirs - 1).max()))
    return Measured(worst)


def lead(results: Results) -> pandas.DataFrame:
    """For 1 % and 0.1 %: LIGGGHTS' steps and time, and how many times less gpudem needs."""

    def times(values: list[float]) -> str:
        if any(np.isnan(values)):
            return "not reached"
        spread = f" ({min(values):.1f} to {max(values):.1f})" if len(values) > 1 else ""
        return f"{statistics.median(values):.1f}{spread}"

    rows = []
    for kind in PLAN[results.tier][0]:
        for target in TARGETS:
            for g, e in enumerate(GROUPS):
                steps, seconds, errors = curve(results, "liggghts", kind)
                needed = work.cost_of(target, errors[:, g], steps)
                taken = work.cost_of(target, errors[:, g], seconds)
                rows.append(
                    {
                        "contacts": kind.replace("_", " "), "error": f"{100 * target:g} %", "e": e,
                        "LIGGGHTS: steps a contact": "not reached" if np.isnan(needed) else f"{needed:.0f}",
                        "stepping [s]": "not reached" if np.isnan(taken) else f"{taken:.3f}",
                        "half_step: time, times less": times(
                            ratios(results, "gpudem", kind, g, target, "time")
                        ),
                        "path: steps, times fewer": times(
                            ratios(results, "gpudem path", kind, g, target, "steps")[:1]
                        ),
                        "path: time, times less": times(
                            ratios(results, "gpudem path", kind, g, target, "time")
                        ),
                    }
                )  # fmt: skip
    return pandas.DataFrame(rows)


def draw_time(results: Results):
    from comparisons.report import plots

    kinds = PLAN[results.tier][0]
    figure, axes = plots.figure(1, len(kinds), width=plots.WHOLE, height=3.6, squeeze=False, sharey=True)
    for ax, kind in zip(axes[0], kinds, strict=True):
        for nth, option in enumerate(OPTIONS):
            # the quickest repeat of each rung: what others on the machine took is not the code's
            seconds = np.min([curve(results, option, kind, r)[1] for r in _repeats(results)], axis=0)
            errors = curve(results, option, kind)[2]
            look = plots.style(
                option.split()[0], marker="osv^D"[nth], markersize=4, linestyle="-", label=option
            )
            if "path" in option:
                look |= {"color": plots.SERIES[2]}
            if option.endswith(("float32", "mixed")):
                look |= {"linestyle": ":"}
            ax.loglog(seconds, errors[:, HALF], **look)
        for target in TARGETS:
            ax.axhline(target, color="0.6", linewidth=0.6, linestyle=":")
        ax.set(title=kind.replace("_", " "), xlabel="stepping time [s], one core")
    axes[0, 0].set_ylabel("largest error of the trajectory / peak overlap")
    plots.legend(axes[0, 0])
    return figure


def mixed_adds(results: Results, kind: str) -> Measured:
    """Largest difference of the errors of `path` in mixed and in float64 / peak overlap, over rungs and e."""
    exact, mixed = (curve(results, option, kind)[2] for option in ("gpudem path", "gpudem path mixed"))
    return Measured(float(np.abs(exact - mixed).max()), note=f"errors down to {exact.min():.2g}")


def _mixed(kind: str) -> Check:
    return Check(
        name=f"what mixed precision adds to the error of path, {kind} / peak overlap",
        measure=lambda results: mixed_adds(results, kind), tolerance=1e-5, unit="1",
        against="path in float64", mark="R", tiers=("standard", "full") if kind != "normal" else TIERS,
        reason="forces carry 6e-8 and the mean of the damping over a step ten to a hundred times that; a"
        " hundredth of the error at 0.1 %",
        catches="an overlap or a position in float32: 1e-3 and more",
    )  # fmt: skip


def draw_order(results: Results):
    from comparisons.report import plots

    kinds = PLAN[results.tier][0]
    figure, axes = plots.figure(1, len(kinds), width=plots.WHOLE, height=3.6, squeeze=False, sharey=True)
    for ax, kind in zip(axes[0], kinds, strict=True):
        for g, e in enumerate(GROUPS):
            for option, line, mark in (("gpudem", "--", "o"), ("gpudem path", "-", "^")):
                steps, _, errors = curve(results, option, kind)
                fit = (steps >= FIT[0]) & (steps <= FIT[1])
                order = observed_order(1 / steps[fit], errors[fit, g])
                name = f"e = {e:g}, {'path' if 'path' in option else 'half_step'}: order {order:.2f}"
                ax.loglog(
                    steps, errors[:, g], line, marker=mark, markersize=4, color=plots.SERIES[g], label=name
                )
        ax.set(title=kind.replace("_", " "), xlabel="steps in an elastic contact")
        plots.legend(ax, fontsize=6)
    axes[0, 0].set_ylabel("largest error of the trajectory / peak overlap")
    return figure


BOTH = ("gpudem", "liggghts")

CASE = Case(
    name="work_precision",
    title="What an accurate contact costs",
    purpose=(
        "Thousands of impacts at once, each touching at another moment within a step, so that time is"
        " arithmetic and the error is that of the worst. LIGGGHTS, and gpudem's half_step option that"
        " equals it, see the dashpot with half-step velocities: first order, however smooth the law."
        " gpudem's path option takes the damping force by its exact integral along the path of the overlap,"
        " which also removes the singular start of overlap^(1/4) and the jump into contact: second order,"
        " with damping and with Coulomb friction. Where the law itself jumps (the default law switches its"
        " tangential dashpot on in stick and off in slip) no fixed-step scheme keeps order two; it is shown"
        " too."
    ),
    source="Exact motion: the contact ODE by DOP853, rtol 1e-13, from primary inputs.",
    variants=variants,
    checks=(
        Check(
            name="error of LIGGGHTS and of gpudem half_step, largest relative difference on any rung",
            measure=same_error, tolerance=1e-6, unit="1", against="LIGGGHTS", mark="X", needs=BOTH,
            reason="equal options agree to rounding (1e-13 of the overlap) beside errors of 1e-6 and more",
            catches="another law or another order of operations than LIGGGHTS'",
        ),
        *(_order("gpudem path", kind, (0.3, 0.5, 0.9), 2.0, 0.15,
                 "second order; the worst of many onsets scatters it a little")
          for kind in ("normal", "oblique")),
        *(_order(option, kind, (0.3, 0.5), 1.0, 0.25, "first order: half-step velocities in the dashpot")
          for option in ("gpudem", "liggghts") for kind in ("normal", "oblique")),
        *(_order(option, "normal", (1.0,), 2.0, 0.2, "elastic contacts keep order two")
          for option in ("gpudem", "gpudem path", "liggghts")),
        *(_mixed(kind) for kind in ("normal", "oblique")),
        _fewer("normal", "steps", 3.0), _fewer("oblique", "steps", 3.0),
        _fewer("normal", "time", 2.0), _fewer("oblique", "time", 2.0),
    ),
    figures=(
        Figure(
            "Error against run time, e = 0.5",
            "One core each, the quickest repeat. Dotted: 1 % and 0.1 %. float32 stops where the rounding of"
            " its positions begins; mixed, with positions and velocities in float64, goes on.",
            draw_time, needs=BOTH, section="lead",
        ),
        Figure(
            "Error against steps in a contact",
            "half_step (dashed) is first order wherever there is damping; path (full) is second.",
            draw_order, section="lead",
        ),
    ),
    tables=(
        Table(
            "For 1 % and 0.1 % error",
            "Largest error of the trajectory / peak overlap. Times of one core; ratios to LIGGGHTS, median of"
            " the repeats and (least to most).",
            lead, needs=BOTH, section="lead",
        ),
    ),
    features=("normal hertz", "damping", "tangential history", "limit_force", "integrator path", "float32",
              "mixed precision"),
    order=5,
)  # fmt: skip
