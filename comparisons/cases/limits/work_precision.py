"""Time that each code and option needs for an error of 1 % and of 0.1 %: thousands of contacts at once."""

from __future__ import annotations

import itertools
import statistics
from collections.abc import Callable
from typing import Any

import numpy as np

from comparisons import kit
from comparisons.cases.limits import work_scenes as work
from comparisons.cases.limits.work_scenes import GROUPS, KINDS
from comparisons.harness import codes
from comparisons.kit import LONG, TIERS
from comparisons.metrics.trace import observed_order
from comparisons.report import plots

HALF = kit.Configuration("gpudem", mark="o")
SINGLE = kit.Configuration("gpudem float32", "gpudem", {"precision": "float32"}, "float32", mark="s")
PATH = kit.Configuration("gpudem path", "gpudem", {"integrator": "path"}, "path", mark="v")
PATH_MIXED = kit.Configuration(
    "gpudem path mixed", "gpudem", {"integrator": "path", "precision": "mixed"}, "path_mixed", mark="^"
)
CONFIGURATIONS = kit.Configurations(HALF, SINGLE, PATH, PATH_MIXED, timed_on=1, brought=False)
#: Smallest step worth running with the integrator `path` [steps in a contact]; beyond, it is at rounding.
FINEST_PATH = 320
#: (kinds, steps in a contact, pairs in a group, repeats)
PLAN = {
    "quick": (("normal",), (20, 80, 320), 50, 1),
    "standard": (tuple(KINDS), (10, 20, 40, 80, 160, 320, 640, 1280), 400, 2),
    "full": (tuple(KINDS), (10, 20, 40, 80, 160, 320, 640, 1280), 400, 3),
}
TARGETS = (0.01, 0.001)
#: Steps in a contact between which the order is fitted: the usual range.
FIT = (20, 320)


def variants(tier: kit.Tier) -> list[kit.Variant]:
    """Repeats in turn. Codes that a user brings are not timed: another scheme has another order."""
    kinds, steps, pairs, repeats = PLAN[tier]
    scenes = {(kind, n): work.scene(kind, n, pairs) for kind in kinds for n in steps}
    made = []
    for kind, repeat, n in itertools.product(kinds, range(repeats), steps):
        own = CONFIGURATIONS.own if n <= FINEST_PATH else (HALF, SINGLE)
        made += CONFIGURATIONS.variants(f"{kind}-{n}-{repeat}", scenes[kind, n], own)
    return made


def curve(
    results: kit.Results, one: kit.Configuration, kind: str, repeat: int = 0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(steps in a contact, stepping seconds, errors (steps, groups)) of one sweep of the step."""

    def compute() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        path = "integrator" in one.options
        steps = [n for n in PLAN[results.tier][1] if n <= FINEST_PATH or not path]
        runs = [one.run(results, f"{kind}-{n}-{repeat}") for n in steps]
        seconds = np.array([r.timing.stepping_s for r in runs])
        return np.array(steps), seconds, np.array([work.errors(results, r, kind) for r in runs])

    return results.once(("curve", one.title, kind, repeat), compute)


def order(results: kit.Results, one: kit.Configuration, kind: str, group: int) -> float:
    """Observed order in the time step of one group, over FIT."""
    steps, _, errors = curve(results, one, kind)
    fit = (steps >= FIT[0]) & (steps <= FIT[1])
    return observed_order(1 / steps[fit], errors[fit, group])


def ratios(
    results: kit.Results, one: kit.Configuration, reference: str, kind: str, group: int, target: float,
    cost: str,
) -> list[float]:  # fmt: skip
    """Cost ("time" or "steps") of a reference code / that of a configuration, same error, by repeat."""
    found = []
    for repeat in range(PLAN[results.tier][3]):
        costs = []
        for each in (*CONFIGURATIONS.of(reference), one):
            steps, seconds, errors = curve(results, each, kind, repeat)
            costs.append(work.cost_of(target, errors[:, group], seconds if cost == "time" else steps))
        found.append(costs[0] / costs[1])
    return found


def gain(results: kit.Results, reference: str, kind: str, cost: str) -> kit.Measured:
    """Cost of gpudem path / that of a reference code at 0.1 % error, largest over e below 0.6."""
    value, e = min(
        (statistics.median(ratios(results, PATH, reference, kind, g, 0.001, cost)), e)
        for g, e in enumerate(GROUPS) if e < 0.6
    )  # fmt: skip
    return kit.Measured(1 / value, measured=value, note=f"smallest gain at e = {e:g}")


def same_error(results: kit.Results, code: str, reference: str) -> dict[str, float]:
    """Largest relative difference of the errors of a reference code and of gpudem, same step and options."""
    apart = {}
    for kind in PLAN[results.tier][0]:
        ours, theirs = (curve(results, one, kind)[2] for one in (HALF, *CONFIGURATIONS.of(reference)))
        apart[kind] = float(np.abs(ours / theirs - 1).max())
    return apart


def _times(code: str, reference: str) -> tuple[kit.Finding, ...]:
    title = codes.title(reference)
    return () if codes.brought(code) else tuple(
        kit.Finding(
            f"stepping time of gpudem path / stepping time of {title} for 0.1 % error, {kind}",
            lambda results, kind=kind: gain(results, reference, kind, "time"), "1",
            "Same contacts, same run, one core; the largest over e = 0.3 and 0.5.", (code, reference), LONG,
        )
        for kind in ("normal", "oblique")
    )  # fmt: skip


def _order(
    one: kit.Configuration, kind: str, e: tuple[float, ...], expected: float, slack: float, why: str
) -> kit.Check:
    def measure(results: kit.Results) -> kit.Measured:
        orders = {group: order(results, one, kind, g) for g, group in enumerate(GROUPS) if group in e}
        note = ", ".join(f"{v:.2f} at e = {group:g}" for group, v in orders.items())
        if expected > 1:  # a higher order than promised is no error
            value = min(orders.values())
            return kit.Measured(max(0.0, expected - value), measured=value, expected=expected, note=note)
        value = max(orders.values(), key=lambda o: abs(o - expected))
        return kit.Measured(abs(value - expected), measured=value, expected=expected, note=note)

    name = one.title if one.code == "gpudem" else one.code
    return kit.Check(
        name=f"observed order of {name}, {kind}", measure=measure, tolerance=slack, unit="1",
        against="ODE (DOP853, rtol 1e-13)", mark="A", reason=why, needs=(one.code,),
        catches="an integrator of another order", tiers=LONG if kind != "normal" else TIERS,
    )  # fmt: skip


def _orders(code: str) -> tuple[kit.Check, ...]:
    made = []
    for one in CONFIGURATIONS.of(code):
        if "precision" in one.options:
            continue
        damped = (
            ((0.3, 0.5, 0.9), 2.0, 0.15, "second order; the worst of many phases scatters")
            if one is PATH
            else ((0.3, 0.5), 1.0, 0.25, "first order: half-step velocities in the dashpot")
        )
        made += [_order(one, kind, *damped) for kind in ("normal", "oblique")]
        made.append(_order(one, "normal", (1.0,), 2.0, 0.2, "elastic contacts are of second order"))
    return tuple(made)


def added_by_mixed(results: kit.Results, kind: str) -> kit.Measured:
    """Largest difference of the errors of path in float64 and in mixed."""
    exact, mixed = (curve(results, one, kind)[2] for one in (PATH, PATH_MIXED))
    return kit.Measured(float(np.abs(exact - mixed).max()), note=f"errors down to {exact.min():.2g}")


def lead(results: kit.Results) -> kit.Rows:
    """For 1 % and 0.1 %: steps and time of each reference code, and the ratios to those of gpudem."""

    def reached(value: float, digits: str) -> str:
        return "not reached" if np.isnan(value) else format(value, digits)

    def text(values: list[float]) -> str:
        if any(np.isnan(values)):
            return "not reached"
        spread = f" ({min(values):.1f} to {max(values):.1f})" if len(values) > 1 else ""
        return f"{statistics.median(values):.1f}{spread}"

    rows = []
    every = [(k, t, g) for k in PLAN[results.tier][0] for t in TARGETS for g in range(len(GROUPS))]
    for reference, (kind, target, g) in itertools.product(codes.references(results.codes()), every):
        where = (reference, kind, g, target)
        steps, seconds, errors = curve(results, CONFIGURATIONS.of(reference)[0], kind)
        needed, taken = (work.cost_of(target, errors[:, g], cost) for cost in (steps, seconds))
        rows.append({
            "contacts": kind.replace("_", " "), "error": f"{100 * target:g} %", "e": GROUPS[g],
            f"{codes.title(reference)}: steps per contact": reached(needed, ".0f"),
            "stepping [s]": reached(taken, ".3f"),
            "half_step: speed-up": text(ratios(results, HALF, *where, "time")),
            "path: factor of steps saved": text(ratios(results, PATH, *where, "steps")[:1]),
            "path: speed-up": text(ratios(results, PATH, *where, "time")),
        })  # fmt: skip
    return rows


def _panels(results: kit.Results, draw: Callable[[Any, str], None], xlabel: str) -> plots.Figure:
    """One panel for each kind of contact, errors upwards."""
    kinds = PLAN[results.tier][0]
    figure, axes = plots.figure(1, len(kinds), width=plots.WHOLE, height=3.6, squeeze=False, sharey=True)
    for ax, kind in zip(axes[0], kinds, strict=True):
        draw(ax, kind)
        ax.set(title=kind.replace("_", " "), xlabel=xlabel)
        plots.legend(ax, fontsize=6)
    axes[0, 0].set_ylabel("largest error of the trajectory / peak overlap")
    return figure


def draw_time(results: kit.Results) -> plots.Figure:
    def draw(ax: Any, kind: str) -> None:
        for one in CONFIGURATIONS.among(results.codes()):
            # the fastest repeat of each step: time taken by other programs is not the code's
            seconds = np.min([curve(results, one, kind, r)[1] for r in range(PLAN[results.tier][3])], axis=0)
            look = one.line(marker=one.mark, markersize=4, linestyle="-")
            if "integrator" in one.options:
                look["color"] = plots.SERIES[2]
            if "precision" in one.options:
                look["linestyle"] = ":"
            ax.loglog(seconds, curve(results, one, kind)[2][:, GROUPS.index(0.5)], **look)
        for target in TARGETS:
            ax.axhline(target, color="0.6", linewidth=0.6, linestyle=":")

    return _panels(results, draw, "stepping time [s], one core")


def draw_order(results: kit.Results) -> plots.Figure:
    def draw(ax: Any, kind: str) -> None:
        for g, e in enumerate(GROUPS):
            for one, line, mark, name in ((HALF, "--", "o", "half_step"), (PATH, "-", "^", "path")):
                steps, _, errors = curve(results, one, kind)
                label = f"e = {e:g}, {name}: order {order(results, one, kind, g):.2f}"
                look = {"marker": mark, "markersize": 4, "color": plots.SERIES[g], "label": label}
                ax.loglog(steps, errors[:, g], line, **look)

    return _panels(results, draw, "steps in an elastic contact")


CASE = kit.Case(
    name="work_precision",
    title="What an accurate contact costs",
    purpose=(
        "Thousands of simultaneous impacts, each of which begins at a different phase of a time step: so many"
        " that the run time is that of the arithmetic, and the error shown is that of the worst impact."
        " LIGGGHTS and gpudem's integrator half_step, which is the same scheme, evaluate the dashpot with"
        " half-step velocities: they are of first order, however smooth the law is. gpudem's integrator path"
        " uses the exact integral of the damping force along the path of the overlap, which also removes the"
        " singular start of overlap^(1/4) and the jump at first contact: second order, with damping and with"
        " Coulomb friction. Where the law itself jumps (by default the tangential dashpot acts in stick and"
        " not in slip) no scheme of fixed step is of second order; this is shown as well."
    ),
    source="Exact motion: the contact ODE by DOP853, rtol 1e-13, from primary inputs.",
    variants=variants,
    checks=(
        kit.PerCode(_orders),
        kit.per_pair(
            "error of {other} and of gpudem half_step, largest relative difference on any rung", same_error,
            brought=False, tolerance=1e-6,
            reason="with equal options the two agree to rounding (1e-13 of the overlap), while their errors"
                " are 1e-6 and more",
            catches="another law or another order of operations",
        ),
        *(
            kit.per_pair(
                f"steps of gpudem path / steps of {{other}} for 0.1 % error, {kind}",
                lambda results, code, other, kind=kind: gain(results, other, kind, "steps"),
                brought=False, tolerance=1 / 3, tiers=LONG,
                reason="the integrator of second order must need at most a third of the steps",
                catches="damping evaluated at the wrong time or position: first order instead of second",
            )
            for kind in ("normal", "oblique")
        ),
        *(
            kit.Check(
                name=f"what mixed precision adds to the error of path, {kind} / peak overlap",
                measure=lambda results, kind=kind: added_by_mixed(results, kind), tolerance=1e-5, unit="1",
                against="path in float64", mark="R", tiers=tiers,
                reason="forces are rounded to 6e-8, the mean damping force over a step to ten to a hundred"
                " times that: together a hundredth of an error of 0.1 %",
                catches="an overlap or a position in float32: 1e-3 and more",
            )
            for kind, tiers in (("normal", TIERS), ("oblique", LONG))
        ),
    ),
    findings=(kit.PerPair(_times),),
    figures=(
        kit.Figure(
            "Error against run time, e = 0.5",
            "One core each, the fastest repeat; thin gray lines: 1 % and 0.1 %. oblique: Coulomb's limit is"
            " kept (limit_force on, tangential_damping off); oblique default: LIGGGHTS' default law. Errors"
            " of float32 do not fall below the rounding of its positions; those of mixed, with positions and"
            " velocities in float64, do.",
            draw_time, section="lead",
        ),
        kit.Figure(
            "Error against steps in a contact",
            "half_step (dashed) is of first order wherever there is damping; path (solid) is of second"
            " order.",
            draw_order, section="lead",
        ),
    ),
    tables=(
        kit.Table(
            "For 1 % and 0.1 % error",
            "Largest error of the trajectory / peak overlap. Times of one core; speed-up relative to"
            " LIGGGHTS: median of the repeats (smallest to largest). A row is a contact law, an error and a"
            " restitution e.",
            lead, section="lead",
        ),
    ),
    features=("normal hertz", "damping", "tangential history", "limit_force", "integrator path", "float32",
              "mixed precision"),
    order=5,
)  # fmt: skip
