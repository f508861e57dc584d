"""Hooks: called at the right steps with the full-step state, without a trace in the run that they look at."""

from __future__ import annotations

import math

import numpy as np
import pytest

import gpudem
from gpudem import driver
from gpudem.errors import GpudemError
from gpudem.output.restart import Restart
from gpudem.output.run import Run
from tests.gpudem.beds import falling_bed, gas, same

OUTPUT = {"trace_every": 0.01, "history_every": 0.005}


def test_called_at_their_steps_across_a_gate():
    """From t = 0 to the end, each step once, the gate's removal (step 1500) too; two hooks in their order."""
    calls: list[tuple[str, int]] = []
    hooks = [
        gpudem.every(0.005, lambda sim: calls.append(("a", sim.step_count))),
        gpudem.every(0.0075, lambda sim: calls.append(("b", sim.step_count))),
    ]
    gpudem.simulate(falling_bed(60), hooks=hooks)
    expected = {(k, "a") for k in range(0, 2001, 250)} | {(k, "b") for k in range(0, 2001, 375)}
    assert [(step, name) for name, step in calls] == sorted(expected)


@pytest.mark.parametrize("interval", [2e-5, 7 * 2e-5, 0.0061])
def test_reading_changes_nothing(interval, tmp_path):
    """To the last bit, with friction and a gate. Catches a step that differs where it is looked at."""
    seen = []

    def read(sim):
        seen.append(float(sim.read("velocity").numpy()[:, 2].min()))
        sim.read("position"), sim.read("force")

    one = falling_bed(300, output=OUTPUT | {"frames_every": 0.02})
    plain = gpudem.simulate(one, tmp_path / "a")
    watched = gpudem.simulate(one, tmp_path / "b", hooks=[gpudem.every(interval, read)])
    for a, b in zip(plain.frames, watched.frames, strict=True):
        same(a, b)
    assert plain.history is not None
    assert plain.history.equals(watched.history)
    assert min(seen) < -0.3
    assert len(set(seen)) > 0.9 * len(seen)


def test_the_state_is_that_of_the_full_step():
    """What a hook reads is what the trace holds."""
    seen = {}

    def read(sim):
        seen[sim.step_count] = sim.read("position").numpy(), sim.read("velocity").numpy()

    one = gas(time={"step": 2e-6, "duration": 1e-3}, output={"trace_every": 1e-4})
    trace = gpudem.simulate(one, hooks=[gpudem.every(1e-4, read)]).trace
    assert trace is not None
    assert list(seen) == trace["step"].tolist()
    for k, (x, v) in enumerate(seen.values()):
        assert np.array_equal(x, trace["position"][k])
        assert np.array_equal(v, trace["velocity"][k])


def test_after_a_restart(tmp_path):
    """A resumed run calls them after the step of the restart file, and not again for those before."""

    class Stopping(Restart):
        def save(self, directory):
            super().save(directory)
            if self.step >= 1000:
                raise KeyboardInterrupt

    one = falling_bed(60, output={"restart_every": 0.01})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(driver, "Restart", Stopping)
        with pytest.raises(KeyboardInterrupt):
            gpudem.simulate(one, tmp_path)
    calls: list[int] = []
    gpudem.resume(tmp_path, hooks=[gpudem.every(0.005, lambda sim: calls.append(sim.step_count))])
    assert calls == [1250, 1500, 1750, 2000]


@pytest.mark.parametrize("error", [ValueError("enough"), KeyboardInterrupt()])
def test_what_a_hook_raises_ends_the_run_and_the_results_are_saved(error, tmp_path):
    def stop(sim):
        if sim.step_count >= 500:
            raise error

    with pytest.raises(type(error)):
        gpudem.simulate(falling_bed(60, output=OUTPUT), tmp_path, hooks=[gpudem.every(0.005, stop)])
    run = Run.load(tmp_path)
    assert run.history is not None
    assert run.history.step.tolist() == [0, 250, 500]
    assert run.notes.get("failed", run.notes.get("interrupted_at_step")) in ("enough", 500)


@pytest.mark.parametrize("interval", [0.0, -1.0, math.nan, math.inf])
def test_an_interval_must_be_a_time(interval):
    with pytest.raises(GpudemError, match="must be a finite number > 0"):
        gpudem.every(interval, print)
    with pytest.raises(GpudemError, match="not a function"):
        gpudem.every(0.1, "print")  # type: ignore[arg-type]


def test_a_rounded_interval_is_a_warning():
    """1.4 steps are 1, and said to be."""
    hooks = [gpudem.every(2.8e-5, lambda sim: None), gpudem.every(3 * 2e-5, lambda sim: None)]
    run = gpudem.simulate(falling_bed(10, time={"step": 2e-5, "duration": 1e-4}), hooks=hooks)
    assert [w for w in run.warnings if "hook" in w] == [
        "hook every 2.8e-05 s: rounded to whole steps, called every 2e-05 s"
    ]


def test_a_hook_may_write():
    """Before, at and after the removal of a gate: the bits of a simulation stepped by hand."""

    def kick(sim):
        if sim.step_count in (500, 1500, 1600):
            sim.write("velocity", 0.5 * sim.read("velocity").numpy())

    one = falling_bed(60, output={"trace_every": 0.04})
    trace = gpudem.simulate(one, hooks=[gpudem.every(0.002, kick)]).trace
    assert trace is not None
    with gpudem.Simulation(one) as sim:
        for steps in (500, 1000, 100, 400):
            sim.step(steps)
            kick(sim)
        assert np.array_equal(trace["position"][-1], sim.read("position").numpy())
        assert np.array_equal(trace["velocity"][-1], sim.read("velocity").numpy())
    plain = gpudem.simulate(one).trace
    assert plain is not None
    assert np.abs(plain["position"][-1] - trace["position"][-1]).max() > 1e-3
