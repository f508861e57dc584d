"""Of the case `liggghts_findings`: the size of each behavior of LIGGGHTS (findings), and that gpudem, or
LIGGGHTS with the line of our deck, is free of it (checks).
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from comparisons import kit
from comparisons.cases.liggghts_findings import scenes
from comparisons.cases.single_contact import head_on
from comparisons.cases.single_contact.meetings import errors
from comparisons.metrics import trace
from gpudem.errors import GpudemError
from gpudem.scene import Scene

OURS, THEIRS = "gpudem", "liggghts"
BOTH = (OURS, THEIRS)
HOP, COLLIDE, FLOW = ("hop", THEIRS), ("collide", THEIRS), ("flow", THEIRS)


def accepted(scene: Scene) -> dict[str, str]:
    """What gpudem and LIGGGHTS with our guards say of a scene that must not pass; "" where they accept it."""
    from gpudem import driver
    from reference import liggghts

    messages: dict[str, str] = {}
    with tempfile.TemporaryDirectory() as folder:
        for code, run in {
            OURS: lambda: driver.simulate(scene, Path(folder, OURS)),
            THEIRS: lambda: liggghts.run(scene, Path(folder, THEIRS), use_recorded=False),
        }.items():
            try:
                run()
                messages[code] = ""
            except GpudemError as error:
                messages[code] = str(error).splitlines()[0]
    return messages


def _accepted(results: kit.Results, label: str) -> kit.Measured:
    messages = results.once(("accepted", label), lambda: accepted(results[label, THEIRS].scene))
    return kit.Measured(float(sum(not m for m in messages.values())), note="; ".join(messages.values()))


def silent(results: kit.Results, label: str, what: str) -> kit.Measured:
    """Particles lost, or 1 for NaN, in a run that ended with status 0 and no message; otherwise NaN."""
    run = results[label, THEIRS]
    notes = run.notes
    quiet = notes["exit_status"] == 0 and not notes["errors"] and notes["steps"] == run.scene.n_steps
    left = f"{notes['particles']} of {run.timing.particles} particles at step {notes['steps']}"
    note = f"exit status {notes['exit_status']}, {left}, {len(run.warnings)} warnings"
    return kit.Measured(float(notes[what]) if quiet else float("nan"), note=note)


def _excess(results: kit.Results, law: str, code: str) -> kit.Measured:
    found = zip(scenes.SLIDES, scenes.excess(results[law, code]), strict=True)
    return kit.largest({f"e = {e:g}": kit.Measured(abs(x), float(x), 0.0) for e, x in found})


def _output(results: kit.Results) -> float:
    dense, sparse = (results[label, OURS].trace for label in ("collide", "collide_quiet"))
    return float(np.abs(dense["velocity"][-1] - sparse["velocity"][-1]).max())


def _points(results: kit.Results) -> kit.Measured:
    exact, points, error = scenes.points_error(results["still_raw", THEIRS])
    changed = int(((exact > 0) != (points > 0)).sum())
    typical = float(np.median(exact[exact > 0]))
    note = f"{changed} of {(exact > 0).sum()} contacts change; overlap {typical:.2g} m"
    return kit.Measured(float(error.max()), note=note)


def _frames(results: kit.Results) -> float:
    ours, theirs = (results["still", code].frames[-1]["position"] for code in BOTH)
    return float(np.abs(ours - theirs).max())


def impact_error(results: kit.Results, label: str, code: str) -> float:
    """Largest velocity error / impact speed over the damped pairs of `head_on`, against the ODE."""
    run = results[label, code]
    return max(errors(results, run, m)["velocity"] for m in head_on.DAMPED)


def _half_step(results: kit.Results) -> kit.Measured:
    label = results.finest("dt_")
    theirs, ours = impact_error(results, label, THEIRS), impact_error(results, f"path_{label}", OURS)
    return kit.Measured(theirs / ours, theirs, ours, note=f"step {label[3:]} s, e = 0.3 to 0.9")


def order(results: kit.Results, prefix: str, code: str) -> float:
    labels = results.labels(prefix=prefix)
    steps = [results[label, code].scene.time.step for label in labels]
    return trace.observed_order(steps, [impact_error(results, label, code) for label in labels])


def flow_gap(results: kit.Results, a: tuple[str, str], b: tuple[str, str], until: float) -> float:
    """Largest difference of kinetic energy between two flows up to a time [s] / that energy."""
    time, found = scenes.energy_gap(results, a, b)
    return float(found[(time >= scenes.MOVING) & (time <= until)].max())


def gap(a: tuple[str, str], b: tuple[str, str], scale: float) -> Callable[[kit.Results], float]:
    """Measure: largest difference of velocity between two runs / `scale` [m/s]."""
    return lambda results: trace.largest_difference(
        results[a].trace["velocity"], results[b].trace["velocity"], scale
    )


def _check(
    name: str, measure: Any, tolerance: float, catches: str, reason: str = "same law and scheme: rounding",
    unit: str = "1", against: str = "LIGGGHTS, our deck", needs: tuple[str, ...] = BOTH, tiers=kit.TIERS,
) -> kit.Check:  # fmt: skip
    """By default between gpudem and LIGGGHTS with our deck, to rounding."""
    return kit.Check(name, measure, tolerance, unit, against, "X", reason, catches, needs, tiers)


CHECKS: tuple[kit.Check, ...] = (
    _check(
        "spring reset: velocity of the hopping ball, our deck against gpudem / impact speed",
        gap(HOP, ("hop", OURS), scenes.HOP), 1e-9, "a spring that gpudem keeps after separation",
    ),
    _check(
        "run once: velocity, LIGGGHTS against gpudem / impact speed", gap(COLLIDE, ("collide", OURS), 1.0),
        1e-9, "another order of the set-up in gpudem",
    ),
    _check(
        "output of gpudem at every step, and at the end alone: difference of the last velocities", _output,
        0.0, "output that disturbs the run", "exact", unit="m/s", needs=(OURS,), against="gpudem itself",
    ),
    *(
        _check(
            f"sliding: distance from mu (1 + e) v_n with limit_force and without tangential dashpot ({code})",
            lambda results, code=code: _excess(results, "coulomb", code), 2e-2,
            "friction not limited to mu F_n",
            "the first contact sticks until the spring is loaded: 1.5 % less friction at e = 0.3",
            needs=(code,), against="Coulomb's limit",
        )
        for code in BOTH
    ),
    _check(
        "friction 0: tangential over normal force at the set-up, gpudem",
        lambda results: scenes.tangential_share(results["smooth_floor", OURS]), 0.0,
        "a dashpot that ignores friction", "exact", needs=(OURS,), against="no friction, no tangential force",
    ),
    _check(
        "friction 0: velocity, gpudem with contact.frictionless_dashpot against LIGGGHTS / speed",
        gap(("smooth_floor_dashpot", OURS), ("smooth_floor", THEIRS), 0.1), 1e-9,
        "an option that differs from LIGGGHTS",
    ),
    _check(
        "flow, spring reset: kinetic energy by gpudem against our deck, up to 0.05 s / energy",
        lambda results: flow_gap(results, ("flow", OURS), FLOW, scenes.EARLY), 1e-6, "a spring kept or lost",
        "rounding, grown over some hundred thousand collisions", tiers=kit.LONG,
    ),
    *(
        _check(
            f"silence broken: codes that pass {name} without an error",
            lambda results, label=label: _accepted(results, label), 0.0, "a guard that does not detect it",
            "exact", unit="codes", needs=(THEIRS,), against="an error that names it",
        )
        for name, label in (("a lost particle", "leave"), ("NaN", "coincide"), ("a burst bed", "burst"))
    ),
    _check(
        "positions in our frames, gpudem against LIGGGHTS, ten steps of a settled bed", _frames, 1e-12,
        "positions taken from the VTK points", "rounding over ten steps; a float32 would be 7e-9 m off",
        unit="m",
    ),
)  # fmt: skip


def _finding(
    name: str, measure: Any, sentence: str, unit: str = "1", needs=(THEIRS,), **more: Any
) -> kit.Finding:
    return kit.Finding(name, measure, unit, sentence, needs, **more)


FINDINGS: tuple[kit.Finding, ...] = (
    _finding(
        "spring kept: velocity of the hopping ball, default deck against ours / impact speed",
        gap(("hop_default_factor", THEIRS), HOP, scenes.HOP),
        "The second impact starts with the spring of the first.",
    ),
    _finding(
        "run twice: velocity, `run 300` and `run 500` against `run 800` / impact speed",
        gap(("collide_two_runs", THEIRS), COLLIDE, 1.0),
        "The set-up repeats the forces of one step with full-step velocities; the springs are not lost, which"
        " would be above 1e-3.",
    ),
    *(
        _finding(
            f"sliding: excess over mu (1 + e) v_n, options {law}, largest over e",
            lambda results, law=law: _excess(results, law, THEIRS), sentence,
        )
        for law, sentence in (
            ("default", "Friction limited by mu |F_n| in tension too, and a dashpot added after the limit."),
            ("limit_force", "Only the effect of the dashpot remains."),
            ("dashpot_off", "Only the effect of the tensile force remains."),
        )
    ),
    _finding(
        "friction 0: tangential over normal force at the set-up, LIGGGHTS",
        lambda results: scenes.tangential_share(results["smooth_floor", THEIRS]),
        "The spring is at rest, so that the contact sticks, and mu Fn = 0 does not limit the dashpot.",
    ),
    _finding(
        "half-step damping: error of LIGGGHTS / error of gpudem's integrator `path`, finest step", _half_step,
        "The ratio grows with the number of steps: order 1 against 1.3, from a lower start.", needs=BOTH,
    ),
    _finding(
        "half-step damping: observed order of LIGGGHTS in the time step",
        lambda results: order(results, "dt_", THEIRS), "Against the ODE (DOP853, rtol 1e-13): first order.",
    ),
    _finding(
        "flow, spring kept: kinetic energy by the default deck against ours, up to 0.05 s / energy",
        lambda results: flow_gap(results, ("flow_default_factor", THEIRS), FLOW, scenes.EARLY),
        "Two decks of LIGGGHTS that differ in nothing else.", tiers=kit.LONG,
    ),
    *(
        _finding(
            f"silence: {name}", lambda results, label=label, what=what: silent(results, label, what),
            "LIGGGHTS' default is to continue without a message.", unit,
        )
        for name, label, what, unit in (
            ("particles lost by the end of a run with exit status 0", "leave", "lost", "particles"),
            ("a run to exit status 0 in which all is NaN", "coincide", "nan", "runs"),
            ("particles lost by a bed of 5000 that blew up, exit status 0", "burst", "lost", "particles"),
        )
    ),
    _finding(
        "float32 in VTK points: largest distance from the position in the same file", _points,
        "Half a unit in the last place of float32 at 0.2 m is 7e-9 m.", "m",
    ),
)  # fmt: skip
