"""A run in two parts is the run in one, to the last bit.

Catches: a shear spring, wall spring, rolling torque or list left out of the file or assigned in another
order; velocities of the full step for those of the half step; a rebuild too many or too few; a gate that
closes again.
"""

import numpy as np
import pytest

from gpudem.driver import resume
from gpudem.driver import simulate as run
from gpudem.errors import GpudemError, SimulationError
from gpudem.output.restart import FILE, Restart
from gpudem.output.run import Run
from gpudem.scene import Scene
from gpudem.solver.solver import Solver
from tests.gpudem.beds import PAIRS, falling_bed, gas, same

ROLLS = [{**p, "rolling_friction": 0.2} for p in PAIRS]


class Stopped(Exception):
    pass


def stopped_and_resumed(scene: Scene, directory, at: int, **options) -> Run:
    """Stops the run at a step as a crash would; goes on from its last restart file."""

    def stop(step: int) -> None:
        if step > at:
            raise Stopped

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("gpudem.driver.PhaseTimer.__exit__", _reporting(stop))
        with pytest.raises(Stopped):
            run(scene, directory)
    assert Restart.load(directory).step <= at
    return resume(directory, **options)


def _reporting(look):
    from gpudem.driver import PhaseTimer

    plain = PhaseTimer.__exit__

    def leave(clock, *error):
        plain(clock, *error)
        if error[0] is None and clock._simulation:
            look(clock._simulation.step_count)

    return leave


SCENES = {
    "history and a gate": {},
    "path": {"solver": {"integrator": "path"}},
    "rolling torques": {"contact": {"rolling": "epsd2"}, "pairs": ROLLS},
    "float32": {"solver": {"precision": "float32"}},
}


@pytest.mark.parametrize("changes", SCENES.values(), ids=SCENES)
@pytest.mark.parametrize("stop", [0.0195, 0.0302, 0.0355], ids=["before", "at", "after the gate"])
def test_two_parts_are_one_run(tmp_path, changes, stop):
    output = {"frames_every": 0.01, "history_every": 0.001, "restart_every": 0.005}
    scene = falling_bed(600, output=output, **changes)
    whole = run(scene, tmp_path / "whole")
    parts = stopped_and_resumed(scene, tmp_path / "parts", at=scene.steps(stop))
    assert parts.notes["resumed_at_step"] == scene.steps(0.005 * int(stop / 0.005))
    assert np.array_equal(whole.frames.times, parts.frames.times)
    for a, b in zip(whole.frames, parts.frames, strict=True):
        same(a, b)
    assert whole.history is not None
    assert parts.history is not None
    assert whole.history.equals(parts.history)
    assert np.abs(a["angular_velocity"]).max() > 1.0
    assert parts.notes["rebuilds"] == whole.notes["rebuilds"]


def test_traces_go_on(tmp_path):
    scene = gas(time={"step": 2e-6, "duration": 0.004}, output={"trace_every": 1e-4, "restart_every": 1e-3})
    whole, parts = run(scene), stopped_and_resumed(scene, tmp_path, at=1600)
    assert whole.trace is not None
    assert parts.trace is not None
    for column in whole.trace:
        assert np.array_equal(whole.trace[column], parts.trace[column]), column
    assert Run.load(tmp_path).notes["resumed_at_step"] == 1500


def test_the_file_changes_nothing(tmp_path):
    """Writing restarts is no event in the run."""
    plain = falling_bed(300, output={"history_every": 0.001})
    a = run(plain).history
    b = run(plain.replace(output={"restart_every": 0.0011}), tmp_path).history
    assert a is not None
    assert a.equals(b)


def test_cores_may_change(tmp_path):
    scene = falling_bed(2500, time={"step": 2e-5, "duration": 0.02},
                        output={"history_every": 0.01, "restart_every": 0.005})  # fmt: skip
    whole = run(scene, threads=2).history
    parts = stopped_and_resumed(scene, tmp_path, at=600, threads=1).history
    assert whole is not None
    assert whole.equals(parts)


def test_no_file(tmp_path):
    with pytest.raises(GpudemError, match=r"no such file; .*output\.restart_every"):
        resume(tmp_path)


def test_a_broken_file(tmp_path):
    scene = falling_bed(50, time={"step": 2e-5, "duration": 2e-3}, output={"restart_every": 1e-3})
    run(scene, tmp_path)
    whole = (tmp_path / FILE).read_bytes()
    (tmp_path / FILE).write_bytes(whole[: len(whole) // 2])
    with pytest.raises(GpudemError, match=r"restart\.npz: .*truncated"):
        resume(tmp_path)


def test_a_state_of_another_scene():
    simulation = Solver(falling_bed(50))
    simulation.start()
    other = Solver(falling_bed(50), half_list=False)
    with pytest.raises(SimulationError, match="another scene, precision or kind of device"):
        other.load_state_dict(simulation.state_dict())
    with pytest.raises(SimulationError, match="another scene"):
        Solver(gas()).load_state_dict(simulation.state_dict())
