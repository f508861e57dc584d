"""The tangential laws of the literature beside that of LIGGGHTS: what each changes, and by how much."""

from __future__ import annotations

import math

import numpy as np

from comparisons import kit
from comparisons.cases.tangential.scenes import (
    CYCLES,
    HIGH,
    KINDS,
    LAWS,
    LOW,
    PART,
    SHEAR,
    TURN_STEPS,
    cycle,
    impacts,
    of_wall,
    turning,
    wall_motion,
)
from comparisons.oracles.bodies import bodies
from comparisons.oracles.tangential import RULES, forces, spheres
from comparisons.report import plots
from gpudem.output.run import Run

TURNS = ("history", "history_rotated")
SPRINGS = ("history", "history_incremental")
OURS = ("gpudem",)


def turn_label(law: str, steps: int) -> str:
    return f"turning_{law}_{steps}"


def cycle_label(order: str, law: str) -> str:
    return f"cycle_{order.replace(' ', '_')}_{law}"


def variants(tier: kit.Tier) -> list[kit.Variant]:
    found = [kit.Variant(f"impacts_{law}", impacts(law), codes=OURS) for law in LAWS]
    found += [
        kit.Variant(turn_label(law, n), turning(law, n), codes=OURS) for law in TURNS for n in TURN_STEPS
    ]
    return found + [
        kit.Variant(cycle_label(order, law), cycle(law, order), codes=OURS)
        for order in CYCLES for law in SPRINGS
    ]  # fmt: skip


# -- measures ------------------------------------------------------------------------------------------------


def again(results: kit.Results, law: str) -> dict[str, float]:
    """Largest difference of the force from the oracle's for the same motion, by the largest force."""
    found = {}
    for label, run in results.of("gpudem"):
        if run.scene.contact.tangential != law:
            continue
        dt, rule = run.scene.time.step, RULES[law]
        if label.startswith("impacts"):
            for k in range(len(KINDS)):
                one = bodies(run.scene, 2 * k, 2 * k + 1)
                motion = spheres(one, run.trace or {}, (2 * k, 2 * k + 1), dt)
                found[f"{label}, pair {k + 1}"] = _apart(forces(one, motion, rule, dt), run, 2 * k)
        else:
            found[label] = _apart(forces(of_wall(run), wall_motion(run), rule, dt), run, 0)
    return found


def _apart(solved: tuple[np.ndarray, np.ndarray, np.ndarray], run: Run, row: int) -> float:
    push, shear, normal = solved
    got, want = run.trace["force"][:, row], push[:, None] * normal + shear
    return float(np.abs(got - want).max() / np.abs(shear).max())


def beyond(results: kit.Results, law: str) -> dict[str, float]:
    """Share of the time of each oblique impact in which the tangential force is beyond mu |F_n|."""
    run, found = results[f"impacts_{law}", "gpudem"], {}
    for k in range(len(KINDS)):
        _, shear, limit = shares(run, k)
        found[f"pair {k + 1}"] = float((shear > (1 + 1e-9) * limit).mean())
    return found


def shares(run: Run, k: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(time [s], tangential force, mu |F_n| [N]) while the k-th pair touches."""
    one, force = bodies(run.scene, 2 * k, 2 * k + 1), run.trace["force"][:, 2 * k]
    motion = spheres(one, run.trace or {}, (2 * k, 2 * k + 1), run.scene.time.step)
    push = np.sum(force * motion.normal, axis=1)
    shear = np.linalg.norm(force - push[:, None] * motion.normal, axis=1)
    held = motion.overlap > 0
    return run.trace["time"][held], shear[held], one.friction * np.abs(push[held])


def shear_of(run: Run) -> np.ndarray:
    """Size of the tangential force on the sphere at the wall, at every step [N]."""
    normal, force = wall_motion(run).normal, run.trace["force"][:, 0]
    return np.linalg.norm(force - np.sum(force * normal, axis=1)[:, None] * normal, axis=1)


def after_a_turn(results: kit.Results, law: str) -> dict[str, kit.Compared]:
    """Tangential force after a whole turn by that before it, less 1, beside cos(a)^n - 1 or 0."""
    found = {}
    for n in TURN_STEPS:
        shear = shear_of(results[turn_label(law, n), "gpudem"])
        lost = math.cos(2 * math.pi / n) ** n - 1 if law == "history" else 0.0
        got = shear[-1] / shear[-1 - n] - 1
        found[f"{n} steps"] = kit.Measured(abs(got - lost), got, lost)
    return found


def stiffness(run: Run, overlap: float) -> float:
    """k_t [N/m] of the wall's contact at an overlap [m]."""
    return of_wall(run).tangential_constant * math.sqrt(overlap)


def work(results: kit.Results, law: str) -> dict[str, kit.Compared]:
    """Work [J] that the wall does on the spring in a cycle, by what the spring stores when loaded, k_t d^2/2:
    positive is lost, negative is gained. Beside the difference of the stored energies.
    """
    found = {}
    for order in CYCLES:
        run = results[cycle_label(order, law), "gpudem"]
        deep, flat = stiffness(run, HIGH), stiffness(run, LOW)
        first = order == "sheared when loaded"
        want = (1 - flat / deep) * (1.0 if first == (law == "history") else -1.0)
        force, place = run.trace["force"][:, 0, 0], _wall_place(run)
        done = float(np.sum((force[1:] + force[:-1]) / 2 * np.diff(place)))
        got = done / (deep * SHEAR**2 / 2)
        found[order] = kit.Measured(abs(got - want), got, want)
    return found


def _wall_place(run: Run) -> np.ndarray:
    """How far the wall has moved along x [m] as its contact sees it: the sum of its velocity at each step."""
    facts = run.scene.walls[0].model_dump()["motion"][0]
    time, speed = np.array(facts["time"]), np.array(facts["velocity"])[:, 0]
    now = np.interp(run.trace["time"], time, speed)
    return np.concatenate([[0.0], np.cumsum(now[1:] * run.scene.time.step)])


def held(results: kit.Results, law: str) -> kit.Measured:
    """Tangential force after unloading at constant shear, by that before: (LOW/HIGH)^(1/2) or 1."""
    run = results[cycle_label("sheared when loaded", law), "gpudem"]
    shear = shear_of(run)
    got, want = shear[3 * PART] / shear[2 * PART], math.sqrt(LOW / HIGH) if law == "history" else 1.0
    return kit.Measured(abs(got - want), got, want)


# -- figures -------------------------------------------------------------------------------------------------


def _turns(results: kit.Results) -> plots.Figure:
    figure, axes = plots.figure()
    for shade, n in zip(plots.SERIES, TURN_STEPS, strict=False):
        for law, line in zip(TURNS, ("-", "--"), strict=True):
            shear = shear_of(results[turn_label(law, n), "gpudem"])[-1 - n :]
            text = f"{law}, {n} steps"
            axes.plot(np.arange(n + 1) / n, shear / shear[0], line, color=shade, label=text)
    axes.set(xlabel="turns of the normal", ylabel="tangential force / that at the start")
    plots.legend(axes)
    return figure


def _cycles(results: kit.Results) -> plots.Figure:
    figure, both = plots.figure(1, 2, width=plots.WHOLE, height=3.6, sharey=True)
    for axes, order in zip(both, CYCLES, strict=True):
        for law, shade, line in zip(SPRINGS, plots.SERIES, ("-", "--"), strict=False):
            run = results[cycle_label(order, law), "gpudem"]
            axes.plot(1e6 * _wall_place(run), 1e3 * run.trace["force"][:, 0, 0], line, color=shade, label=law)
        axes.set(xlabel="shear displacement [um]", title=order)
    both[0].set_ylabel("tangential force [mN]")
    plots.legend(both[0])
    return figure


def _limits(results: kit.Results) -> plots.Figure:
    figure, axes = plots.figure(width=plots.WHOLE, height=3.4)
    for law, shade, line in zip(LAWS, plots.SERIES, ("-", "--", ":", "-"), strict=False):
        time, shear, limit = shares(results[f"impacts_{law}", "gpudem"], 0)
        axes.plot(1e3 * time, 1e3 * shear, line, color=shade, label=law)
        if law == LAWS[-1]:
            axes.plot(1e3 * time, 1e3 * limit, color="k", lw=0.7, label="mu |F_n|")
    axes.set(xlabel="time [ms]", ylabel="tangential force [mN]")
    plots.legend(axes)
    return figure


CASE = kit.Case(
    name="tangential_laws", title="Tangential laws: what their differences do",
    purpose="Four shear springs with history differ in one thing each from that of LIGGGHTS (`history`):"
    " `history_rotated` keeps the length of the spring while the normal turns, `history_incremental` adds up"
    " force with the stiffness of each step, `history_capped` limits spring and dashpot together. In a"
    " contact whose normal makes a whole turn, projecting the spring shortens it by cos(a) in each step of"
    " angle a, which vanishes with the step. Sheared when loaded and sheared back after unloading, a contact"
    " loses energy under `history` and gains the same under `history_incremental`; the other way about the"
    " signs change: neither is elastic. In a damped impact only `history_capped` stays within Coulomb's"
    " limit.",
    source="Thornton, Cummins and Cleary, Powder Technol. 233 (2013) 30; Walton and Braun, J. Rheol. 30"
    " (1986) 949; Elata and Berryman, Mech. Mater. 24 (1996) 229; Luding, Granul. Matter 10 (2008) 235.",
    variants=variants,
    checks=(
        *(
            kit.check(
                f"{law}: force at every step, largest difference / largest tangential force",
                lambda results, law=law: again(results, law),
                tolerance=1e-11, against="oracle (NumPy, the same motion)",
                reason="rounding: 1e-16 of a radius in an overlap of 1 % of it, by a tangential force of a"
                " tenth of the normal one, and the spring's sum of 1500 slides",
                catches="another rule of the spring, its limit or its dashpot; a spring kept at set-up",
            )
            for law in LAWS
        ),
        kit.check(
            "history_capped: time beyond mu |F_n| / duration of contact",
            lambda results: beyond(results, "history_capped"), tolerance=0.0, against="closed form",
            reason="the limit is exact; beyond begins at 1e-9 of it, for rounding",
            catches="a dashpot that is added after the limit",
        ),
        kit.check(
            "history: time beyond mu |F_n| / duration of contact",
            lambda results: beyond(results, "history"), lo=0.02, tolerance=0.98, against="closed form",
            reason="its dashpot is not capped, or the check before would hold for any law",
            catches="impacts in which the limit on the whole force makes no difference",
        ),
        *(
            kit.check(
                f"{law}: tangential force after a turn / before, error",
                lambda results, law=law: after_a_turn(results, law),
                tolerance=1e-4, against="closed form", reason=f"the sphere moves by 1e-5 of the shear of"
                f" {SHEAR:g} m, and its spin is set to the wall's to rounding",
                catches="a spring that is projected where it should be turned, or turned twice",
            )
            for law in TURNS
        ),
        *(
            kit.check(
                f"{law}: work of a cycle / energy of the loaded spring, error",
                lambda results, law=law: work(results, law),
                tolerance=1e-4, against="closed form",
                reason="the sphere moves by 1e-5 of the shear; force over displacement is made of lines",
                catches="a stiffness of another step, a spring that is scaled on unloading",
            )
            for law in SPRINGS
        ),
        *(
            kit.check(
                f"{law}: tangential force after unloading at constant shear / before, error",
                lambda results, law=law: held(results, law),
                tolerance=1e-4, against="closed form",
                reason="the sphere moves by 1e-5 of the shear",
                catches="a spring that is scaled with the overlap, or is not",
            )
            for law in SPRINGS
        ),
    ),
    figures=(
        kit.Figure(
            "A spring in a contact whose normal makes a turn",
            "Nothing slides: what the spring loses, it loses by being projected in each step.", _turns,
        ),
        kit.Figure(
            "Shear at two overlaps",
            "The area of a loop is the energy lost (clockwise) or gained in the cycle.", _cycles,
        ),
        kit.Figure(
            "Tangential force in an oblique impact",
            "The first pair. A sticking contact under an uncapped dashpot is beyond mu |F_n|, which is drawn"
            " for the last law.", _limits,
        ),
    ),
    features=(
        "normal hertz", "tangential history", "tangential history_rotated", "tangential history_incremental",
        "tangential history_capped", "damping", "rotation", "several materials", "several radii",
        "sphere-sphere", "wall plane", "motion",
    ),
    order=33,
)  # fmt: skip
