"""Cohesion of pairs and walls step by step against another code; adhesion against closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np

from comparisons import kit
from comparisons.cases.cohesion.scenes import (
    DEPTH,
    KINDS,
    LAWS,
    RADIUS,
    SHARES,
    SINGLE,
    WORKS,
    adhesion,
    drops,
    rebound,
    row,
    sticky,
)
from comparisons.oracles.bodies import bodies
from comparisons.oracles.cohesion import circle, linear
from comparisons.report import plots
from gpudem.output.run import Run

#: Label -> law and switches of the impacts.
IMPACTS: dict[str, dict[str, Any]] = {law: {"law": law} for law in LAWS}
IMPACTS |= {f"{law}_reduce": {"law": law, "tangential_reduce": True} for law in LAWS}
IMPACTS |= {"no_cohesion": {"law": "off"}}
DROPS = "jkr"


def variants(tier: kit.Tier) -> list[kit.Variant]:
    found = [kit.Variant(f"impacts_{label}", sticky(**stated)) for label, stated in IMPACTS.items()]
    found += [kit.Variant(f"still_{law}", sticky(law, still=True)) for law in LAWS]
    return [*found, kit.Variant(DROPS, drops(), codes=("gpudem",))]


def still(run: Run) -> str:
    """Why a run shows nothing."""
    return "" if np.abs(run.trace["force"]).max() > 1e-3 else "no contact"


def contacts() -> list[tuple[str, int, int | str]]:
    """(what it is, particle, partner) of the contacts at rest."""
    found: list[tuple[str, int, int | str]] = []
    for k, (radii, materials) in enumerate(KINDS):
        sizes = f"{radii[0] * 1e3:g} and {radii[1] * 1e3:g} mm"
        found.append((f"{' / '.join(materials)}, {sizes}", 2 * k, 2 * k + 1))
    for k, (radius, material) in enumerate(SINGLE):
        first = 2 * len(KINDS) + 2 * k
        what = f"{material}, {radius * 1e3:g} mm"
        found += [(f"{what}, floor", first, "floor"), (f"{what}, tube", first + 1, "floor")]
    return found


def at_rest(results: kit.Results, code: str, law: str) -> dict[str, kit.Compared]:
    """Force [N] at the set-up beside Hertz' less cohesion, which the geometry of the spheres gives."""
    run, found = results[f"still_{law}", code], {}
    area = {"sjkr": circle, "sjkr2": linear}[law]
    for what, i, other in contacts():
        both = bodies(run.scene, i, other)
        overlap = DEPTH * min(both.radius)
        names = run.scene.materials
        material = list(names)[run.scene.state.material[i]]
        partner = list(names)[run.scene.state.material[other]] if isinstance(other, int) else "floor"
        pair = run.scene.pair(material, partner)
        assert pair is not None
        distance = (sum(both.radius) if isinstance(other, int) else both.radius[0]) - overlap
        pull = (pair.model_extra or {})["cohesion_energy_density"] * area(distance, *both.radius)
        want = both.normal_constant * overlap**1.5 - pull
        inward = run.trace["force"][0, i]
        got = float(np.linalg.norm(inward)) * np.sign(want)
        found[what] = got, want
    return found


def _drop(results: kit.Results) -> Run:
    return results[DROPS, "gpudem"]


def _left(run: Run, particle: int) -> float:
    """Speed [m/s] away from the floor at the end; 0 for one that stays within the breaking gap."""
    work = particle // len(SHARES)
    gap = run.trace["position"][-1, particle, 2] - RADIUS
    return float(run.trace["velocity"][-1, particle, 2]) if gap > adhesion(run.scene, work).gap else 0.0


def restitution(results: kit.Results) -> dict[str, kit.Compared]:
    """Of each drop, beside sqrt(1 - (sticking speed / speed)^2): its energy error by the energy lost."""
    run, found = _drop(results), {}
    for k, w in enumerate(WORKS):
        for j, share in enumerate(SHARES):
            got = _left(run, row(k, j)) / (share * adhesion(run.scene, k).sticking_speed)
            found[f"w = {w:g} J/m2, {share:g} of the sticking speed"] = kit.Measured(
                abs(got**2 - rebound(share) ** 2) * share**2, got, rebound(share)
            )
    return found


def pull_off(results: kit.Results) -> dict[str, kit.Compared]:
    """Largest attraction of those that leave, by 3/2 pi w R*."""
    run = _drop(results)
    return {
        f"w = {w:g} J/m2, {share:g} of the sticking speed":
            (-float(run.trace["force"][:, row(k, j), 2].min()), adhesion(run.scene, k).pull_off)
        for k, w in enumerate(WORKS) for j, share in enumerate(SHARES) if share > 1
    }  # fmt: skip


def path(results: kit.Results) -> dict[str, float]:
    """Distance of the force from the oracle's at the same overlap, where the surfaces touch or hold."""
    run, found = _drop(results), {}
    for k, w in enumerate(WORKS):
        one, at = adhesion(run.scene, k), row(k, len(SHARES) - 1)
        overlap, force = RADIUS - run.trace["position"][:, at, 2], run.trace["force"][:, at, 2]
        held = np.flatnonzero(force != 0)
        off = [abs(force[i] - one.force_at(overlap[i])) for i in held if overlap[i] > -0.999 * one.gap]
        found[f"w = {w:g} J/m2"] = max(off) / one.pull_off if len(off) > 100 else float("nan")
    return found


def _curves(results: kit.Results) -> plots.Figure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.8)
    run = _drop(results)
    for k, w in enumerate(WORKS):
        one, at, shade = adhesion(run.scene, k), row(k, SHARES.index(2.5)), plots.SERIES[k]
        overlap, force = RADIUS - run.trace["position"][:, at, 2], run.trace["force"][:, at, 2]
        held = np.flatnonzero(force != 0)
        radii = np.linspace(one.last_radius, one.radius(float(overlap.max())), 200)
        exact = np.array([[one.overlap(a) / one.gap, one.force(a) / one.pull_off] for a in radii]).T
        shown = held[:: max(1, len(held) // 60)]
        left.plot(*exact, color=shade, lw=0.9, label=f"w = {w:g} J/m\u00b2")
        left.plot(overlap[shown] / one.gap, force[shown] / one.pull_off, **plots.marks("gpudem", color=shade))
        speeds = [_left(run, row(k, j)) / (s * one.sticking_speed) for j, s in enumerate(SHARES)]
        right.plot(SHARES, speeds, **plots.marks("gpudem", color=shade))
    line = np.linspace(0.5, SHARES[-1], 400)
    right.plot(line, [rebound(s) for s in line], color=plots.color("oracle"), lw=0.9)
    left.set(xlabel="overlap / breaking gap", ylabel="force / pull-off force", title="one contact")
    right.set(xlabel="impact speed / sticking speed", ylabel="restitution", title="drops")
    plots.legend(left, points=["gpudem"])
    return figure


def _impacts(results: kit.Results) -> plots.Figure:
    """Normal force of the first pair over time, with and without cohesion."""
    figure, axes = plots.figure(width=plots.WHOLE, height=3.4)
    for shade, label in zip(plots.SERIES, ("no_cohesion", *LAWS), strict=False):
        for code in results.codes(f"impacts_{label}"):
            trace = results[f"impacts_{label}", code].trace
            d = trace["position"][:, 0] - trace["position"][:, 1]
            n = d / np.linalg.norm(d, axis=1)[:, None]
            force = np.sum(trace["force"][:, 0] * n, axis=1)
            look = plots.line_or_marks(code, len(force), color=shade)
            text = label.replace("_", " ") if look["linestyle"] == "-" else None
            axes.plot(1e3 * trace["time"], force, **look, label=text)
    axes.set(xlabel="time [ms]", ylabel="normal force [N]")
    plots.legend(axes, lines=results.codes())
    return figure


CASE = kit.Case(
    name="cohesive_contact", title="Cohesion and adhesion in one contact",
    purpose="The two cohesion laws of LIGGGHTS, an attraction in proportion to an area of overlap, act"
    " between spheres of unequal radii and materials, at a plane and in a tube, in oblique impacts with"
    " friction and rolling resistance; the limits of both leave cohesion out, or count it with"
    " tangential_reduce."
    " The codes agree to rounding at every step. Adhesion (jkr) is gpudem's own: drops on a floor follow"
    " the law of Johnson, Kendall and Roberts on loading and unloading, pull with 3/2 pi w R at most,"
    " lose the same energy at any speed, and stick below the speed at which that is all they have.",
    source="LIGGGHTS manual, gran_cohesion_sjkr and sjkr2; Johnson, Kendall and Roberts, Proc. R. Soc. A 324"
    " (1971) 301; Thornton and Ning, Powder Technol. 99 (1998) 154.",
    variants=variants,
    checks=(
        *(
            kit.step_by_step(
                f"{column.replace('_', ' ')}: largest difference over the trace / largest value", column,
                lambda run, column=column: float(np.abs(run.trace[column]).max()), prefix="impacts_",
                defect=still, tolerance=1e-10, unit="1",
                reason="same law, same scheme: rounding of 1500 steps, which contacts multiply",
                catches="an area of a pair, plane or tube, a sign, a limit with or without cohesion",
            )
            for column in ("velocity", "angular_velocity", "force", "torque")
        ),
        *(
            kit.per_code(
                f"{law}, at rest: force, relative error",
                lambda results, code, law=law: at_rest(results, code, law),
                tolerance=1e-11, against="geometry of the spheres",
                reason="one evaluation: rounding of 1e-16 of a radius in an overlap of 3 % of it, and of a"
                " difference of two forces",
                catches="an area or effective radius of unequal spheres or a wall that is wrong in all codes",
            )
            for law in LAWS
        ),
        kit.check(
            "jkr: force at the same overlap, to and fro, largest difference / pull-off force", path,
            tolerance=1e-9, against="oracle (root finding in the contact radius)", needs=("gpudem",),
            reason="rounding: 1e-16 of a radius in an overlap of 1e-3 of it, times the stiffness by the"
            " pull-off force and the gap, 1e3",
            catches="another root of the quartic, a damped or hysteretic path, a shifted overlap",
        ),
        kit.check(
            "jkr: largest attraction / (3/2 pi w R*), relative error", pull_off,
            tolerance=1e-3, against="closed form", needs=("gpudem",),
            reason="a row each 1 us: within 1 % of the gap from the least force, which is flat there",
            catches="w of each surface (factor 2), a wrong R*, the force at the break (5/9) for the largest",
        ),
        kit.check(
            "jkr: restitution, largest error in energy / energy lost", restitution,
            tolerance=0.03, against="closed form sqrt(1 - (sticking speed / speed)^2)", needs=("gpudem",),
            reason="the forces jump where a contact begins and breaks, and a step there is not whole: at most"
            " (4/3 + 5/6) pi w R v dt, 1.5 % of the energy lost for the fastest drop, at each end",
            catches="a contact that breaks at touch (nothing sticks), attracts before touch, or breaks late",
        ),
    ),
    figures=(
        kit.Figure(
            "Adhesive contact",
            "Left: force over overlap, one drop for each work of adhesion, all on one curve in these units;"
            " line: exact, crosses: gpudem. Right: restitution; below the sticking speed no drop leaves.",
            _curves,
        ),
        kit.Figure(
            "Normal force of a pair with and without cohesion",
            "Lines: gpudem; symbols: the other codes. Cohesion begins with touch and ends with parting.",
            _impacts,
        ),
    ),
    tables=(
        kit.table(
            "Force at rest under sjkr", "Hertz less cohesion, at the start.",
            lambda results, code: {"force [N]": at_rest(results, code, "sjkr")}, rows="contact",
            reference="geometry",
        ),
    ),
    features=(
        "normal hertz", "normal jkr", "cohesion sjkr", "cohesion sjkr2", "rolling epsd", "tangential history",
        "several materials", "several radii", "sphere-sphere", "wall plane", "wall cylinder", "rotation",
        "damping",
    ),
    order=43,
)  # fmt: skip
