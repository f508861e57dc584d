"""The law of Park et al. (2014) as printed: the restitution that results, and a heap without memory."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from comparisons import kit
from comparisons.cases.dam_break import checks, paper_scenes
from comparisons.cases.dam_break import scenes as dam
from comparisons.cases.single_contact.checks import step_by_step
from comparisons.cases.single_contact.meetings import Meeting, overlap, relative_velocity
from comparisons.kit import LONG
from comparisons.metrics import pile
from comparisons.metrics import trace as measure
from comparisons.report import plots

MEETINGS = [Meeting(f"{v:g} m/s", 2 * k, 2 * k + 1) for k, v in enumerate(paper_scenes.SPEEDS)]
#: Label -> (memory, damping of equation 11 as printed), and the name in figures.
HEAPS = {
    "heap_printed": (False, True, "no memory, damping as printed"),
    "heap_forgets": (False, False, "no memory, e = 0.9"),
    "heap_keeps": (True, False, "memory, e = 0.9"),
}
#: The last part of the run [s], in which a heap should be at rest.
LATE = 0.2


def variants(tier: kit.Tier) -> list[kit.Variant]:
    made = [
        kit.Variant(f"impacts_{n}", paper_scenes.impacts(paper_scenes.FLIGHT / (n + 0.5)))
        for n in ((12, 50) if tier == "quick" else (12, 50, 150))
    ]
    if tier != "quick":
        made += [kit.Variant(name, paper_scenes.heap(*choice)) for name, (*choice, _) in HEAPS.items()]
    return made


def rebounds(results: kit.Results, code: str) -> list[float]:
    """Restitution of each impact of the finest run; NaN where the balls have not separated."""
    run, up = results[results.finest("impacts"), code], np.array([0.0, 0.0, 1.0])
    found = [(measure.rebound(relative_velocity(run, m), up), overlap(run, m)[-1]) for m in MEETINGS]
    return [e if last < 0 else np.nan for e, last in found]


def against_ode(results: kit.Results, code: str) -> dict[str, kit.Measured]:
    """Relative error of 1 - e at each speed."""
    found = {}
    for speed, got in zip(paper_scenes.SPEEDS, rebounds(results, code), strict=True):
        want = paper_scenes.restitution(speed, False)
        found[f"{speed:g} m/s"] = kit.Measured(abs((1 - got) / (1 - want) - 1), got, want)
    return found


def late_energy(results: kit.Results, label: str, code: str) -> float:
    """Mean kinetic energy of the last 0.2 s [J]."""
    time, energy = dam.kinetic(results[label, code])
    return float(energy[time > time[-1] - LATE].mean())


def centre(results: kit.Results, label: str, code: str) -> np.ndarray:
    """Center of mass at the end [m]."""
    frame = results[label, code].frames[-1]
    return pile.centre_of_mass(frame["position"], frame["radius"])


def without_memory(
    name: str, unit: str, of: Callable[[kit.Results, str, str], float], **fields: Any
) -> kit.PerCode:
    """of(results, label, code) of the heap without memory / that of the heap with it; `unit`: 1e-3 of its."""

    def measure(results: kit.Results, code: str) -> kit.Measured:
        without, memory = (of(results, label, code) for label in ("heap_forgets", "heap_keeps"))
        note = f"{1e3 * without:.3g} {unit} and {1e3 * memory:.3g} {unit}"
        return kit.Measured(without / memory, note=note)

    return kit.per_code(
        name, measure, against="the law with memory", mark="R", tiers=LONG,
        catches="`no_history` that stores something, `history` that loses it", **fields,
    )  # fmt: skip


def _restitution_table(results: kit.Results) -> kit.Rows:
    found = {plots.name(code): rebounds(results, code) for code in results.codes()}
    return [
        {"speed [m/s]": speed, "stated restitution": paper_scenes.PUT_IN,
         "ODE, gamma sqrt(R h) v": f"{paper_scenes.restitution(speed, False):.8g}",
         "ODE, gamma sqrt(R) h v": f"{paper_scenes.restitution(speed, True):.8g}"}
        | {code: f"{e[k]:.8g}" for code, e in found.items()}
        for k, speed in enumerate(paper_scenes.SPEEDS)
    ]  # fmt: skip


def _heap_table(results: kit.Results) -> kit.Rows:
    return [
        {"law": name, "code": plots.name(code), "center of mass x [mm]": 1e3 * center[0],
         "center of mass z [mm]": 1e3 * center[2],
         "kinetic energy at the end [mJ]": 1e3 * late_energy(results, label, code)}
        for label, (_, _, name) in HEAPS.items() for code in results.codes(label)
        for center in [centre(results, label, code)]
    ]  # fmt: skip


def _figure(results: kit.Results) -> plots.Figure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.8)
    for k, (label, (_, _, name)) in enumerate(HEAPS.items()):
        for code in results.codes(label):
            time, energy = dam.kinetic(results[label, code])
            look = {"ls": "-" if code == "gpudem" else (0, (4, 2)), "lw": 1.2, "color": plots.SERIES[k]}
            left.semilogy(time[time > 0], energy[time > 0], label=f"{name}, {plots.name(code)}", **look)
            right.plot(1e3 * dam.PROFILE_AT, 1e3 * dam.heights(results, label, code), **look)
    left.set(xlabel="time after the gate is removed [s]", ylabel="kinetic energy [J]")
    right.set(xlabel="x [mm]", ylabel="height at the end [mm]")
    plots.legend(left, fontsize=7.5)
    return figure


CASE = kit.Case(
    name="paper_law",
    title="The paper's contact law as printed",
    purpose=(
        "The law of Park et al. as it is printed. Its damping (equations 7, 11, 12) combines the formula of a"
        " linear spring with a Hertz coefficient, and the units do not match: in SI units a stated"
        " restitution of 0.9 results in 0.9998, or in 0.999999 by the other reading of equation 7. Its"
        " friction (equation 8) has the displacement of one step only, which is a viscous force k_s dt v: no"
        " heap can come to rest with it, and its coefficient is proportional to the time step. Equations 6, 7"
        " and 8 are exactly hertz/stiffness with no_history; k_s is Mindlin's, which the paper does not"
        " print. A small dam break shows both, beside the same law with contact history."
    ),
    source="Park, Jun, Sohn and Lee, Trans. KSME, 2014, equations 6 to 12; ODE: DOP853.",
    variants=variants,
    checks=(
        *step_by_step(MEETINGS, spin=False, prefix="impacts_"),
        kit.per_code(
            "what an impact loses, 1 - e, largest relative error", against_ode, tolerance=5e-3,
            against="ODE (DOP853, rtol 1e-12)",
            reason="only 2e-4 of the speed is lost, the error of the scheme is a hundredth of it",
            catches="a gamma_n that is not gamma/m*, another power of the overlap",
        ),
        without_memory(
            "kinetic energy at the end, heap without memory / with memory", "mJ", late_energy, lo=10.0,
            tolerance=1e6, reason="without contact history a heap creeps: measured values are 20 to 200",
        ),
        without_memory(
            "height of the center of mass at the end, without memory / with memory", "mm",
            lambda *run: centre(*run)[2], lo=0.5, tolerance=0.95, reason="a heap that creeps is lower",
        ),
        checks.early(
            "heaps: center of mass in the first 0.07 s, largest distance between the codes / diameter",
            prefix="heap_", tiers=LONG, reason="rounding, before chaos",
            catches="another form of `no_history`, with many contacts at once",
        ),
    ),
    findings=(
        kit.PerCode(
            lambda code: kit.Finding(
                f"restitution that comes out where 0.9 was put in, lowest at 0.1 to 3 m/s ({code})",
                lambda results: kit.Measured(min(rebounds(results, code)), expected=paper_scenes.PUT_IN),
                "1", "The printed equations, taken in SI units, make the balls almost elastic.", (code,),
            )
        ),
    ),
    figures=(
        kit.Figure(
            "A heap without contact history",
            "Left: kinetic energy; without contact history the heap continues to creep. Right: the heap at"
            " the end. After the first tenths of a second the codes agree in the shape of the heap, not ball"
            " by ball.",
            _figure, tiers=LONG,
        ),
    ),
    tables=(
        kit.Table(
            "Restitution", "Resulting restitution; the second reading of equation 7 cannot be stated in the"
                " codes.",
            _restitution_table,
        ),
        kit.Table(
            "Heaps", "515 balls of 20 mm, reduced modulus, 1.5 s after the gate is"
                " removed.", _heap_table, tiers=LONG
        ),
    ),
    features=("normal hertz/stiffness", "tangential no_history", "damping", "sphere-sphere", "bulk flow"),
    order=48,
)  # fmt: skip
