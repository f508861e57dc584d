"""Checks of the case `liggghts_findings`: each behaviour is there, and we are free of it."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.cases.liggghts_findings import scenes as findings
from comparisons.cases.single_contact import head_on
from comparisons.cases.single_contact.meetings import errors
from comparisons.harness.case import Check, Measured, Results, Tier
from comparisons.metrics import trace
from gpudem.errors import GpudemError
from gpudem.output.run import Run
from gpudem.scene import Scene

OURS, THEIRS = "gpudem", "liggghts"
BOTH = (OURS, THEIRS)
BENCH: tuple[Tier, ...] = ("standard", "full")
#: A check of the form "at least lo": there is no upper bound.
ANY = 1e9
SAME = "same law, same scheme: rounding is all that is left"


def refusals(scene: Scene) -> dict[str, str]:
    """What gpudem and LIGGGHTS behind our guards say of a scene that must not pass; "" where they pass it."""
    from gpudem import driver
    from reference import liggghts

    def ours(folder: Path) -> Run:
        return driver.simulate(scene, folder)

    def theirs(folder: Path) -> Run:
        return liggghts.run(scene, folder, use_recorded=False)

    said: dict[str, str] = {}
    for code, run in ((OURS, ours), (THEIRS, theirs)):
        with tempfile.TemporaryDirectory() as folder:
            try:
                run(Path(folder))
                said[code] = ""
            except GpudemError as error:
                said[code] = str(error).splitlines()[0]
    return said


def refused(results: Results, label: str) -> dict[str, str]:
    """`refusals` of a variant, once."""
    return results.once(("refused", label), lambda: refusals(results[label, THEIRS].scene))


def silent(results: Results, label: str, what: str) -> Measured:
    """How many particles were lost, or 1 for NaN, in a run that ended with status 0 and no word; else NaN."""
    run = results[label, THEIRS]
    notes = run.notes
    quiet = notes["exit_status"] == 0 and not notes["errors"] and notes["steps"] == run.scene.n_steps
    found = float(notes[what]) if quiet else float("nan")
    left = f"{notes['particles']} of {run.timing.particles} particles at step {notes['steps']}"
    return Measured(found, note=f"exit status {notes['exit_status']}, {left}, {len(run.warnings)} warnings")


def _passed(results: Results, label: str) -> Measured:
    said = refused(results, label)
    return Measured(float(sum(not text for text in said.values())), note="; ".join(said.values()))


def _worst_excess(results: Results, law: str, code: str) -> Measured:
    found = findings.excess(results[law, code])
    k = int(np.abs(found).argmax())
    return Measured(
        float(np.abs(found[k])), float(found[k]), 0.0, note=f"largest at e = {findings.SLIDES[k]:g}"
    )


def _quiet(results: Results) -> float:
    """Last velocities of gpudem with output at every step, and at the end alone: largest difference [m/s]."""
    dense, sparse = (results[label, OURS].trace for label in ("collide", "collide_quiet"))
    return float(np.abs(dense["velocity"][-1] - sparse["velocity"][-1]).max())


def _points(results: Results) -> Measured:
    exact, points, error = findings.points_error(results["still_raw", THEIRS])
    changed = int(((exact > 0) != (points > 0)).sum())
    typical = float(np.median(exact[exact > 0]))
    return Measured(
        float(error.max()), note=f"{changed} of {(exact > 0).sum()} contacts change; overlap {typical:.2g} m"
    )


def _frames(results: Results) -> float:
    """Last frame of gpudem and of LIGGGHTS as converted, same scene: largest difference of position [m]."""
    ours, theirs = (results["still", code].frames[-1]["position"] for code in BOTH)
    return float(np.abs(ours - theirs).max())


def impact_error(results: Results, label: str, code: str) -> float:
    """Largest velocity error / impact speed over the damped pairs of `head_on`, against the ODE."""
    run = results[label, code]
    return max(errors(results, run, m)["velocity"] for m in head_on.DAMPED)


def _half_step(results: Results) -> Measured:
    label = results.finest("dt_")
    theirs, ours = impact_error(results, label, THEIRS), impact_error(results, f"path_{label}", OURS)
    return Measured(theirs / ours, theirs, ours, note=f"step {label[3:]} s, e = 0.3 to 0.9")


def order(results: Results, prefix: str, code: str) -> float:
    """Observed order in the step of `impact_error`."""
    labels = results.labels(prefix=prefix)
    steps = [results[label, code].scene.time.step for label in labels]
    return trace.observed_order(steps, [impact_error(results, label, code) for label in labels])


def flow_gap(results: Results, a: tuple[str, str], b: tuple[str, str], until: float) -> float:
    """Largest difference of kinetic energy between two flows up to a time [s] / that energy."""
    time, found = findings.energy_gap(results, a, b)
    return float(found[(time >= findings.MOVING) & (time <= until)].max())


def gap(a: tuple[str, str], b: tuple[str, str], scale: float) -> Callable[[Results], float]:
    """Measure: largest difference of velocity between two runs / `scale` [m/s]."""
    return lambda results: findings.velocity_gap(results[a], results[b], scale)


def _there(
    name: str, measure: Any, lo: float, reason: str, catches: str, tolerance: float = ANY, **more
) -> Check:
    """The behaviour is there, at least so large."""
    needs = more.pop("needs", (THEIRS,))
    return Check(
        name=name, measure=measure, lo=lo, tolerance=tolerance, unit=more.pop("unit", "1"),
        against=more.pop("against", "LIGGGHTS, our deck"), mark="X", needs=needs, reason=reason,
        catches=catches, **more,
    )  # fmt: skip


def _free(name: str, measure: Any, tolerance: float, reason: str, catches: str, **more) -> Check:
    """gpudem, or LIGGGHTS with our line in the deck, is free of it."""
    needs = more.pop("needs", BOTH)
    return Check(
        name=name, measure=measure, tolerance=tolerance, unit=more.pop("unit", "1"),
        against=more.pop("against", "LIGGGHTS, our deck"), mark="X", needs=needs, reason=reason,
        catches=catches, **more,
    )  # fmt: skip


HOP, COLLIDE, FLOW = ("hop", THEIRS), ("collide", THEIRS), ("flow", THEIRS)
GONE = "a guard of ours that is no longer needed: LIGGGHTS would have changed"

CHECKS: tuple[Check, ...] = (
    _there(
        "spring kept: velocity of the hopping ball, default deck against ours / impact speed",
        gap(("hop_default_factor", THEIRS), HOP, findings.HOP), 1e-3,
        "the second impact starts with the spring of the first", GONE,
    ),
    _free(
        "spring reset: velocity of the hopping ball, our deck against gpudem / impact speed",
        gap(HOP, ("hop", OURS), findings.HOP), 1e-9, SAME, "a spring that gpudem keeps after separation",
    ),
    _there(
        "run twice: velocity, `run 300` and `run 500` against `run 800` / impact speed",
        gap(("collide_two_runs", THEIRS), COLLIDE, 1.0), 1e-8,
        "the set-up repeats the forces of one step with full-step velocities; above 1e-3 the springs would be"
        " lost as well", GONE, tolerance=1e-3,
    ),
    _free(
        "run once: velocity, LIGGGHTS against gpudem / impact speed",
        gap(COLLIDE, ("collide", OURS), 1.0), 1e-9, SAME, "another order of the set-up in gpudem",
    ),
    _free(
        "output of gpudem at every step, and at the end alone: difference of the last velocities",
        _quiet, 0.0, "an exact statement: output reads the state, it sets nothing up",
        "output that disturbs the run", unit="m/s", needs=(OURS,), against="gpudem itself",
    ),
    *(
        _there(
            f"sliding: excess over mu (1 + e) v_n, options {law}, largest over e",
            lambda results, law=law: _worst_excess(results, law, THEIRS), lo,
            why, "an option that has changed its meaning", against="Coulomb's line",
        )
        for law, lo, why in (
            ("default", 0.1, "friction by |F_n| while the contact pulls, and a dashpot above the cap"),
            ("limit_force", 0.01, "the dashpot alone is left"),
            ("dashpot_off", 0.01, "the pull alone is left"),
        )
    ),
    *(
        _free(
            f"sliding: distance from mu (1 + e) v_n with limit_force and without tangential dashpot ({code})",
            lambda results, code=code: _worst_excess(results, "coulomb", code), 2e-2,
            "the first touch sticks until the spring is loaded, so that friction takes 1.5 % less at e = 0.3",
            "friction not capped at mu F_n", needs=(code,), against="Coulomb's line",
        )
        for code in BOTH
    ),
    _there(
        "friction 0: tangential over normal force at the set-up, LIGGGHTS",
        lambda results: findings.tangential_share(results["smooth_floor", THEIRS]), 0.1,
        "the spring is at rest, so that the contact sticks, and the dashpot is not capped by mu Fn = 0", GONE,
        against="no friction, no tangential force",
    ),
    _free(
        "friction 0: tangential over normal force at the set-up, gpudem",
        lambda results: findings.tangential_share(results["smooth_floor", OURS]), 0.0,
        "an exact statement", "a dashpot without regard to friction", needs=(OURS,),
        against="no friction, no tangential force",
    ),
    _free(
        "friction 0: velocity, gpudem with contact.frictionless_dashpot against LIGGGHTS / speed",
        gap(("smooth_floor_dashpot", OURS), ("smooth_floor", THEIRS), 0.1), 1e-9, SAME,
        "an option that is not LIGGGHTS' way",
    ),
    _there(
        "half-step damping: error of LIGGGHTS / error of gpudem's integrator `path`, finest step",
        _half_step, 5.0, "order 1 against 1.3, from a lower start: the ratio grows with the number of steps",
        "an integrator `path` that is no better", needs=BOTH, against="ODE (DOP853, rtol 1e-13)",
    ),
    _there(
        "half-step damping: observed order of LIGGGHTS in the time step",
        lambda results: order(results, "dt_", THEIRS), 0.85, "first order", GONE, tolerance=1.15,
        against="ODE (DOP853, rtol 1e-13)",
    ),
    _there(
        "flow, spring kept: kinetic energy by the default deck against ours, up to 0.05 s / energy",
        lambda results: flow_gap(results, ("flow_default_factor", THEIRS), FLOW, findings.EARLY), 1e-6,
        "between two decks of LIGGGHTS that differ in nothing else", GONE, tolerance=0.1, tiers=BENCH,
    ),
    _free(
        "flow, spring reset: kinetic energy by gpudem against our deck, up to 0.05 s / energy",
        lambda results: flow_gap(results, ("flow", OURS), FLOW, findings.EARLY), 1e-6,
        "rounding, grown by some hundred thousand collisions", "a spring kept or lost", tiers=BENCH,
    ),
    *(
        _there(
            f"silence: {name}", lambda results, label=label, what=what: silent(results, label, what), lo,
            "LIGGGHTS' default is to go on", "a LIGGGHTS that says so", unit=unit, against="nothing said",
        )
        for name, label, what, lo, unit in (
            ("particles lost by the end of a run with exit status 0", "leave", "lost", 1, "particles"),
            ("a run to exit status 0 in which all is NaN", "coincide", "nan", 1, "runs"),
            ("particles lost by a bed of 5000 that blew up, exit status 0", "burst", "lost", 50, "particles"),
        )
    ),
    *(
        _free(
            f"silence broken: codes that pass {name} without an error",
            lambda results, label=label: _passed(results, label), 0.0, "an exact statement",
            "a guard that does not guard", unit="codes", needs=(THEIRS,), against="an error that names it",
        )
        for name, label in (("a lost particle", "leave"), ("NaN", "coincide"), ("a burst bed", "burst"))
    ),
    _there(
        "float32 in VTK points: largest distance from the position in the same file",
        _points, 1e-9, "half a unit in the last place of float32 at 0.2 m is 7e-9 m",
        "VTK output that has become double", unit="m", against="float64 column of the same file",
        tolerance=1e-7,
    ),
    _free(
        "positions in our frames, gpudem against LIGGGHTS, ten steps of a settled bed",
        _frames, 1e-12, "rounding over ten steps; a float32 would be 7e-9 m off",
        "positions taken from the VTK points", unit="m",
    ),
)  # fmt: skip
