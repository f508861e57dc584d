"""What LIGGGHTS 3.8.0 does that its user may not expect: each behavior with deck and size.

Standard tier: five flows of 5000 balls x 8000 steps, some 10 s each; the rest takes seconds.
"""

from __future__ import annotations

import numpy as np

from comparisons import kit
from comparisons.cases.liggghts_findings import checks, scenes
from comparisons.cases.liggghts_findings.checks import BOTH, CHECKS, FINDINGS, FLOW, OURS, THEIRS
from comparisons.cases.single_contact import head_on
from comparisons.cases.single_contact.meetings import ladder
from comparisons.kit import number
from comparisons.metrics.trace import observed_order
from comparisons.report import plots
from gpudem.scene import Scene


def _deviating(label: str, scene: Scene, deviation: str) -> kit.Variant:
    return kit.Variant(label, scene, (THEIRS,), {THEIRS: {"deviation": deviation}})


def _path(label: str, scene: Scene) -> kit.Variant:
    return kit.Variant(label, scene, (OURS,), {OURS: {"integrator": "path"}})


def variants(tier: kit.Tier) -> list[kit.Variant]:
    steps = {label: head_on.scene(dt) for label, dt in ladder(tier, head_on.FLIGHT).items()}
    out = [
        kit.Variant("hop", scenes.hop()),
        _deviating("hop_default_factor", scenes.hop(), "default_contact_distance_factor"),
        *(kit.Variant(law, scenes.slide(law)) for law in scenes.LAWS),
        kit.Variant("smooth_floor", scenes.smooth_floor(dashpot=False)),
        kit.Variant("smooth_floor_dashpot", scenes.smooth_floor(dashpot=True), (OURS,)),
        *(kit.Variant(label, scene) for label, scene in steps.items()),
        *(_path(f"path_{label}", scene) for label, scene in steps.items()),
        kit.Variant("collide", scenes.collide()),
        kit.Variant("collide_quiet", scenes.collide(every=800), (OURS,)),
        _deviating("collide_two_runs", scenes.collide(), "two_runs"),
        _deviating("leave", scenes.leave(), "unguarded"),
        _deviating("coincide", scenes.coincide(), "unguarded"),
        _deviating("burst", scenes.burst(), "unguarded"),
        kit.Variant("still", scenes.still()),
        _deviating("still_raw", scenes.still(), "raw_frames"),
    ]
    if tier == "quick":
        return out
    return [
        *out,
        kit.Variant("flow", scenes.flow()),
        _deviating("flow_default_factor", scenes.flow(), "default_contact_distance_factor"),
        _path("flow_path", scenes.flow()),
        kit.Variant("flow_coulomb", scenes.flow("coulomb"), (OURS,)),
    ]


#: Run -> (run that it is compared with, label).
FLOWS = {
    ("flow", OURS): (FLOW, "rounding: gpudem, our deck"),
    ("flow_default_factor", THEIRS): (FLOW, "spring kept: LIGGGHTS, default deck"),
    ("flow_path", OURS): (("flow", OURS), "damping along the path: gpudem, path"),
    ("flow_coulomb", OURS): (("flow", OURS), "friction capped: gpudem, limit_force, no dashpot"),
}


def hop(results: kit.Results) -> plots.Figure:
    figure, (top, low) = plots.figure(2, 1, height=4.4, sharex=True)
    kept, reset = results["hop_default_factor", THEIRS], results["hop", THEIRS]
    time = 1e3 * reset.trace["time"]
    for run, look, label in ((reset, OURS, "our deck"), (kept, THEIRS, "default deck")):
        x = run.trace["position"]
        gap = 1e6 * (np.linalg.norm(x[:, 1] - x[:, 0], axis=1) - 2 * scenes.RADIUS)
        top.plot(time, gap, **plots.style(look, label=f"LIGGGHTS, {label}", markevery=25))
    top.axhline(0, color=plots.SOFT, linewidth=0.7)
    top.set_ylabel("gap [µm]")
    plots.legend(top)
    for column, arm, label, color in (
        ("velocity", 1.0, "velocity", plots.SERIES[2]),
        ("angular_velocity", scenes.RADIUS, "R x spin", plots.SERIES[3]),
    ):
        change = arm * np.linalg.norm(kept.trace[column] - reset.trace[column], axis=-1).max(axis=1)
        low.semilogy(time, np.maximum(change, 1e-18), color=color, label=label)
    low.set(xlabel="time [ms]", ylabel="default - our deck [m/s]")
    plots.legend(low)
    return figure


def sliding(results: kit.Results) -> plots.Figure:
    figure, axes = plots.figure(height=3.6)
    names = {
        "default": "default", "limit_force": "limit_force on", "dashpot_off": "tangential_damping off",
        "coulomb": "both",
    }  # fmt: skip
    for (law, name), color in zip(names.items(), plots.SERIES, strict=False):
        ours, theirs = (100 * scenes.excess(results[law, code]) for code in (OURS, THEIRS))
        axes.plot(scenes.SLIDES, ours, color=color, label=name)
        axes.plot(scenes.SLIDES, theirs, "o", color=color, mfc="none", ms=7)
    axes.axhline(0, **plots.TOLERANCE)
    axes.set(xlabel="restitution e [1]", ylabel="friction above µ (1 + e) v$_n$ [%]")
    plots.legend(axes)
    return figure


def half_step(results: kit.Results) -> plots.Figure:
    figure, axes = plots.figure(height=3.6)
    path = {"color": plots.SERIES[2], "marker": "s", "markersize": 4.5}
    for prefix, code, label, more in (
        ("dt_", THEIRS, "LIGGGHTS", {}), ("dt_", OURS, "gpudem, half_step", {}),
        ("path_dt_", OURS, "gpudem, path", path),
    ):  # fmt: skip
        labels = results.labels(prefix=prefix)
        steps = [results[each, code].scene.time.step for each in labels]
        found = [checks.impact_error(results, each, code) for each in labels]
        order = observed_order(steps, found)
        axes.loglog(steps, found, **plots.style(code, label=f"{label}, order {order:.2f}", **more))
    axes.set(xlabel="time step [s]", ylabel="velocity error / impact speed")
    plots.legend(axes)
    return figure


def flow(results: kit.Results) -> plots.Figure:
    figure, axes = plots.figure(width=plots.WHOLE, height=3.6)
    for (one, (two, label)), color in zip(FLOWS.items(), plots.SERIES, strict=False):
        time, found = scenes.energy_gap(results, one, two)
        axes.semilogy(time[1:], np.maximum(found[1:], 1e-16), color=color, label=label)
    axes.set(xlabel="time since the gate was removed [s]", ylabel="|difference of kinetic energy| / energy")
    plots.legend(axes, loc="lower right")
    return figure


def _in_flow(results: kit.Results, run: tuple[str, str]) -> str:
    if run not in results.runs:
        return "standard tier"
    early = checks.flow_gap(results, run, FLOWS[run][0], scenes.EARLY)
    return f"{number(early, 2)} of the kinetic energy within 0.05 s"


def summary(results: kit.Results) -> kit.Rows:
    hop_gap = checks.gap(("hop_default_factor", THEIRS), checks.HOP, 1e-3)(results)
    again = checks.gap(("collide_two_runs", THEIRS), checks.COLLIDE, 1.0)(results)
    above = dict(zip(scenes.SLIDES, scenes.excess(results["default", THEIRS]), strict=True))
    share = scenes.tangential_share(results["smooth_floor", THEIRS])
    label, burst = results.finest("dt_"), results["burst", THEIRS]
    theirs = checks.impact_error(results, label, THEIRS)
    ours = checks.impact_error(results, f"path_{label}", OURS)
    exact, points, off = scenes.points_error(results["still_raw", THEIRS])
    depth = float(np.median((np.abs(points - exact) / exact)[exact > 0]))
    rows = [
        ("The shear spring of a pair survives separation until the list is rebuilt.",
         f"{number(hop_gap, 2)} mm/s from the second hop on, at 200 mm/s",
         _in_flow(results, ("flow_default_factor", THEIRS)),
         "deck: contact_distance_factor 1.01; gpudem"),
        ("Friction is limited by mu |Fn| in tension too; the dashpot is added after the limit.",
         f"{100 * above[0.3]:.0f} % above mu (1 + e) vn at e = 0.3, {100 * above[0.9]:.1f} % at 0.9",
         _in_flow(results, ("flow_coulomb", OURS)) + " at e = 0.9",
         "limit_force with tangential_damping = false, in both codes"),
        ("Beside pairs with friction, contacts without it have a tangential dashpot at each set-up.",
         f"{100 * share:.0f} % of the normal force at t = 0", "at the start, and at each removal of a gate",
         "gpudem, unless contact.frictionless_dashpot = true; a scene in which no pair has friction"),
        ("Damping uses half-step velocities: first order.",
         f"velocity error {number(theirs, 2)}, integrator path {number(ours, 2)}, step {label[3:]} s",
         _in_flow(results, ("flow_path", OURS)) + " at 6 % of the Rayleigh time",
         "gpudem: solver.integrator = path"),
        ("Each run command repeats the set-up: one step's forces at full-step velocities; springs stay.",
         f"{number(again, 2)} of the impact speed", "one step for each run command",
         "deck: one run command for each set of walls; gpudem: output sets nothing up"),
        ("Particles that leave are dropped, exit status 0, no message.", "1 of 2",
         f"{burst.notes['lost']} of {burst.timing.particles} of a bed that blew up",
         "deck: thermo_modify lost error; gpudem: an error that names the particle"),
        ("NaN continues to exit status 0, no message.", "2 of 2 particles", "not measured",
         "our runner watches the output; gpudem: an error that names the particle"),
        ("VTK points are float32.", f"{1e9 * off.max():.2g} nm",
         f"overlaps of a settled bed, softened 600 times, off by {100 * depth:.2g} % (median)",
         "deck: a float64 column of the same file, from which our frames are made"),
    ]  # fmt: skip
    columns = ["property of LIGGGHTS 3.8.0", "size in one contact", "in 5000 balls", "avoided by"]
    return [dict(zip(columns, row, strict=True)) for row in rows]


CASE = kit.Case(
    name="liggghts_findings",
    title="Properties of LIGGGHTS that affect a comparison",
    purpose=(
        "Properties of LIGGGHTS that a user who compares or calibrates with it should know, with their size."
        " Each is reproduced by a deck that is printed below; the table names the line of our decks, or the"
        " option or law of gpudem, that avoids it. By default gpudem follows LIGGGHTS' law, since that is"
        " what is compared (friction, half-step damping), and offers the alternative as an option. None of"
        " them makes LIGGGHTS unfit for use: each changes a flow as rounding does, only earlier; whether"
        " means are shifted is tested over the seeds of the dam break."
    ),
    source="LIGGGHTS 3.8.0 as Debian has it, run here; its manual.",
    variants=variants,
    checks=CHECKS,
    findings=FINDINGS,
    figures=(
        kit.Figure(
            "A ball bounces on a ball",
            "The first impact is the same; in the second, the default deck starts with the spring that the"
            " first left.",
            hop, needs=(THEIRS,),
        ),
        kit.Figure(
            "Friction above Coulomb's limit",
            "Impacts that slide throughout. Lines: gpudem, rings: LIGGGHTS, equal for each option. The"
            " restitution is the measured one. With both options friction takes up to 1.5 % less, since the"
            " first contact sticks.",
            sliding, needs=BOTH,
        ),
        kit.Figure(
            "Damping at half steps",
            "Head-on pairs, e = 0.3 to 0.9, largest error against the exact solution.",
            half_step, needs=BOTH,
        ),
        kit.Figure(
            "In a flow",
            "5000 balls after the removal of the gate, each property against the same flow without it. The"
            " curve of rounding shows the growth by chaos: after 0.15 s all runs differ by about one per"
            " cent, as any two runs do.",
            flow, tiers=kit.LONG, needs=BOTH,
        ),
    ),
    tables=(
        kit.Table(
            "Properties of LIGGGHTS that affect a comparison",
            "Size in one contact and in a flow of 5000 balls, and what avoids each of them.",
            summary, needs=BOTH, section="limits",
        ),
    ),
    features=(
        "tangential history", "tangential damping", "damping", "limit_force", "integrator path",
        "lost particles and NaN", "frames",
    ),
    order=70,
)  # fmt: skip
