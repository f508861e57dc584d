"""The law of Park et al. (2014) as printed: the restitution that comes out, and a heap without memory."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from comparisons.cases.dam_break import checks as dam_checks
from comparisons.cases.dam_break import paper_scenes as paper_law
from comparisons.cases.dam_break import scenes as dam
from comparisons.cases.single_contact.checks import CODES, step_by_step
from comparisons.cases.single_contact.meetings import Meeting, overlap, relative_velocity
from comparisons.harness.case import Case, Check, Figure, Measured, Results, Table, Tier, Variant
from comparisons.metrics import pile
from comparisons.metrics import trace as measure
from comparisons.report import plots

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure as MatplotlibFigure

BENCH: tuple[Tier, ...] = ("standard", "full")
MEETINGS = [Meeting(f"{v:g} m/s", 2 * k, 2 * k + 1) for k, v in enumerate(paper_law.SPEEDS)]
#: Label -> (memory, damping of equation 11 as printed), and the name in figures.
HEAPS = {
    "heap_printed": (False, True, "no memory, damping as printed"),
    "heap_forgets": (False, False, "no memory, e = 0.9"),
    "heap_keeps": (True, False, "memory, e = 0.9"),
}
#: The last part of the run [s], in which a heap should be at rest.
LATE = 0.2


def variants(tier: Tier) -> list[Variant]:
    out = [
        Variant(f"impacts_{n}", paper_law.impacts(paper_law.FLIGHT / (n + 0.5)))
        for n in ((12, 50) if tier == "quick" else (12, 50, 150))
    ]
    if tier != "quick":
        out += [
            Variant(name, paper_law.heap(memory, printed)) for name, (memory, printed, _) in HEAPS.items()
        ]
    return out


def rebounds(results: Results, code: str) -> list[float]:
    """Restitution of each impact of the finest run; NaN where the balls have not parted."""
    run = results[results.finest("impacts"), code]
    out = []
    for m in MEETINGS:
        v = relative_velocity(run, m)
        out.append(measure.rebound(v, np.array([0.0, 0.0, 1.0])) if overlap(run, m)[-1] < 0 else np.nan)
    return out


def _against_ode(results: Results, code: str) -> Measured:
    got, want = rebounds(results, code), [paper_law.restitution(v, False) for v in paper_law.SPEEDS]
    lost = [abs((1 - a) / (1 - b) - 1) for a, b in zip(got, want, strict=True)]
    k = int(np.argmax(lost))
    return Measured(lost[k], got[k], want[k], note=f"largest at {paper_law.SPEEDS[k]:g} m/s")


def _lowest(results: Results, code: str) -> Measured:
    got = rebounds(results, code)
    return Measured(min(got), min(got), paper_law.PUT_IN, note="at 3 m/s")


def kinetic(results: Results, label: str, code: str) -> tuple[np.ndarray, np.ndarray]:
    """(time after the gate goes [s], kinetic energy with spin [J])."""
    run = results[label, code]
    table = run.history
    assert table is not None
    energy = table["kinetic_energy"] + table["rotational_energy"]
    return table["time"].to_numpy() - dam.opening(run), energy.to_numpy()


def late(results: Results, label: str, code: str) -> float:
    """Mean kinetic energy of the last 0.2 s [J]."""
    time, energy = kinetic(results, label, code)
    return float(energy[time > time[-1] - LATE].mean())


def centre_height(results: Results, label: str, code: str) -> float:
    """Height of the centre of mass at the end [m]."""
    frame = results[label, code].frames[-1]
    return float(pile.centre_of_mass(frame["position"], frame["radius"])[2])


def _creep(results: Results, code: str) -> Measured:
    forgets, keeps = (late(results, label, code) for label in ("heap_forgets", "heap_keeps"))
    return Measured(forgets / keeps, note=f"{1e3 * forgets:.2g} mJ and {1e3 * keeps:.2g} mJ")


def _sunk(results: Results, code: str) -> Measured:
    forgets, keeps = (centre_height(results, label, code) for label in ("heap_forgets", "heap_keeps"))
    return Measured(forgets / keeps, note=f"{1e3 * forgets:.1f} mm and {1e3 * keeps:.1f} mm")


def _early(results: Results) -> Measured:
    found = {}
    for label in HEAPS:
        time, distance = dam_checks.apart(results, label)
        size = 2 * results[label, "gpudem"].scene.state.radius.max()
        found[label] = float(distance[time <= dam.EARLY].max() / size)
    worst = max(found, key=lambda label: found[label])
    return Measured(found[worst], note=f"largest in {worst}")


def _per_code(code: str) -> tuple[Check, ...]:
    return (
        Check(
            name=f"what an impact loses, 1 - e, largest relative error ({code})",
            measure=lambda results: _against_ode(results, code), tolerance=5e-3, unit="1",
            against="ODE (DOP853, rtol 1e-12)", mark="A", needs=(code,),
            reason="only 2e-4 of the speed is lost, and the scheme is wrong by less than a hundredth of it",
            catches="a gamma_n that is not gamma/m*, another power of the overlap",
        ),
        Check(
            name=f"restitution that comes out where 0.9 was put in, lowest at 0.1 to 3 m/s ({code})",
            measure=lambda results: _lowest(results, code), lo=0.999, tolerance=1.0, unit="1",
            against="Park et al. 2014", mark="R", needs=(code,),
            reason="not a success: the size of what the printed equations do, taken in SI units",
            catches="a silent correction of the printed law",
        ),
        Check(
            name=f"kinetic energy at the end, heap without memory / with memory ({code})",
            measure=lambda results: _creep(results, code), lo=10.0, tolerance=1e6, unit="1",
            against="the law with memory", mark="R", needs=(code,), tiers=BENCH,
            reason="not a success: how much a heap without memory still moves",
            catches="`no_history` that keeps something, `history` that forgets",
        ),
        Check(
            name=f"height of the centre of mass at the end, without memory / with memory ({code})",
            measure=lambda results: _sunk(results, code), lo=0.5, tolerance=0.95, unit="1",
            against="the law with memory", mark="R", needs=(code,), tiers=BENCH,
            reason="not a success: a heap that creeps is lower",
            catches="`no_history` that keeps something, `history` that forgets",
        ),
    )  # fmt: skip


def _restitution_table(results: Results) -> pandas.DataFrame:
    import pandas

    columns = {
        "speed [m/s]": list(paper_law.SPEEDS),
        "put in": [paper_law.PUT_IN] * len(paper_law.SPEEDS),
        "ODE, gamma sqrt(R h) v": [paper_law.restitution(v, False) for v in paper_law.SPEEDS],
        "ODE, gamma sqrt(R) h v": [paper_law.restitution(v, True) for v in paper_law.SPEEDS],
    }
    columns |= {code: rebounds(results, code) for code in results.codes()}
    return pandas.DataFrame(columns).map(lambda x: f"{x:.8g}")


def _heap_table(results: Results) -> pandas.DataFrame:
    import pandas

    rows = []
    for label, (_, _, name) in HEAPS.items():
        for code in results.codes(label):
            frame = results[label, code].frames[-1]
            far = pile.centre_of_mass(frame["position"], frame["radius"])[0]
            rows.append(
                (name, code, 1e3 * far, 1e3 * centre_height(results, label, code),
                 1e3 * late(results, label, code))
            )  # fmt: skip
    names = ["law", "by", "centre of mass x [mm]", "centre of mass z [mm]", "kinetic energy at the end [mJ]"]
    return pandas.DataFrame(rows, columns=names)


def _figure(results: Results) -> MatplotlibFigure:
    figure, (left, right) = plots.figure(1, 2, width=plots.WHOLE, height=3.8)
    for k, (label, (_, _, name)) in enumerate(HEAPS.items()):
        for code in results.codes(label):
            time, energy = kinetic(results, label, code)
            dash = "-" if code == "gpudem" else (0, (4, 2))
            keep = time > 0
            text = f"{name}, {plots.name(code)}"
            left.semilogy(time[keep], energy[keep], ls=dash, lw=1.2, color=plots.SERIES[k], label=text)
            heights = dam.heights(results, label, code, dam.PROFILE_AT)
            right.plot(1e3 * dam.PROFILE_AT, 1e3 * heights, ls=dash, lw=1.2, color=plots.SERIES[k])
    left.set(xlabel="time after the gate goes [s]", ylabel="kinetic energy [J]")
    right.set(xlabel="x [mm]", ylabel="height at the end [mm]")
    plots.legend(left, fontsize=7.5)
    return figure


CASE = Case(
    name="paper_law",
    title="The paper's contact law as printed",
    purpose=(
        "What the law of Park et al. does, taken at its word. Damping (equations 7, 11, 12) joins a linear"
        " spring's formula to a Hertz coefficient, and the units do not fit. In SI units 0.9 goes in and"
        " 0.9998 comes out: the balls are almost elastic; by the other reading of equation 7, 0.999999. Its"
        " friction (equation 8) knows the displacement of one step only, which is a viscous force k_s dt v:"
        " no heap can rest on it, and the coefficient shrinks with the time step. Equations 6, 7 and 8 map"
        " exactly onto hertz/stiffness with no_history, in both codes; k_s is Mindlin's, which the paper does"
        " not print. A small dam break shows both, and beside them the same law with springs that remember."
    ),
    source="Park, Jun, Sohn and Lee, Trans. KSME, 2014, equations 6 to 12; ODE: DOP853.",
    variants=variants,
    checks=(
        *step_by_step(MEETINGS, spin=False, prefix="impacts_"),
        *(check for code in CODES for check in _per_code(code)),
        Check(
            name="heaps: centre of mass in the first 0.07 s, largest distance between the codes / diameter",
            measure=_early, tolerance=1e-10, unit="1", against="LIGGGHTS", mark="X", needs=CODES, tiers=BENCH,
            reason="rounding, before chaos", catches="`no_history` of another form in a bulk of contacts",
        ),
    ),
    figures=(
        Figure(
            "A heap without memory",
            "Left: kinetic energy; without memory it lasts, and the heap creeps flat. Right: what is left"
            " of the heap at the end. Beyond the first tenths of a second the codes agree as heaps, not ball"
            " by ball.",
            _figure, tiers=BENCH,
        ),
    ),
    tables=(
        Table("Restitution", "What comes out; the second reading cannot be stated in the codes.",
              _restitution_table),
        Table("Heaps", "515 balls of 20 mm, softened, 1.5 s after the gate goes.", _heap_table, tiers=BENCH),
    ),
    features=("normal hertz/stiffness", "tangential no_history", "damping", "sphere-sphere", "bulk flow"),
    order=48,
)  # fmt: skip
