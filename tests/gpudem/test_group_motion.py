"""Groups of particles with a motion."""

from typing import Any

import numpy as np
import pytest

from gpudem import Simulation
from gpudem.driver import simulate as run
from gpudem.scene import Scene
from gpudem.scene.groups import paths
from gpudem.solver.solver import Solver
from tests.gpudem.beds import MATERIALS, PAIRS, finish, same
from tests.gpudem.groups import on_base
from tests.gpudem.test_restart import stopped_and_resumed

MOTIONS: dict[str, list[dict[str, Any]]] = {
    "oscillate": [{"type": "oscillate", "amplitude": (0.001, 0, 0.001), "period": 0.02}],
    "turned while it rises": [{"type": "linear", "velocity": (0, 0, 0.05)},
                              {"type": "swing", "axis": (0, 1, 0), "point": (0.08, 0, 0.0), "amplitude": 0.02,
                               "period": 0.03}],
}  # fmt: skip


def shaken(motion: str = "oscillate", count: int = 100, **changes: Any) -> Scene:
    """Half of the base of `on_base` is frozen, the other half moves."""
    groups = [{"name": "base", "ids": np.arange(1, 200, 2), "frozen": True},
              {"name": "shaken", "ids": np.arange(2, 201, 2), "motion": MOTIONS[motion]}]  # fmt: skip
    domain = {"lo": (-0.001, -0.001, -0.004), "hi": (0.201, 0.051, 0.401)}
    return on_base(count, **{"groups": groups, "domain": domain, **changes})


@pytest.mark.parametrize("motion", MOTIONS)
def test_places_and_velocities(motion):
    """Detects: places a step apart, of another group or row, velocities half a step off, a spin left out."""
    scene = shaken(motion, output={"trace_every": 1e-3}, time={"step": 2e-5, "duration": 0.03})
    trace = run(scene).trace
    assert trace is not None
    rows = scene.groups[1].rows(scene)
    for k, step in enumerate(trace["step"].tolist()):
        pose = paths(scene)[0].at(step, 1)
        x = scene.state.position[rows] @ pose.rotation[0].T + pose.shift[0]
        assert np.abs(trace["position"][k, rows] - x).max() < 1e-16, step
        assert np.abs(trace["velocity"][k, rows] - pose.velocity_at(x)).max() < 1e-15, step
        assert np.abs(trace["angular_velocity"][k, rows] - pose.spin[0]).max() < 1e-15, step
    assert np.abs(trace["velocity"][:, rows]).max() > 0.01
    assert np.abs(trace["force"][-5:, rows]).max() > 0.01


def test_a_ball_pushed_by_a_moved_one():
    """Detects: the velocity of the moved ball left out, or its mass: damping as with a frozen ball."""
    scene = Scene(
        name="pushed", materials=MATERIALS, pairs=[{**PAIRS[0], "friction": 0.0}],
        particles={"source": "explicit", "position": [(0, 0, 0), (0.0201, 0, 0)], "radius": 0.01,
                   "material": "ball"},
        groups=[{"name": "pusher", "ids": [1], "motion": [{"type": "linear", "velocity": (1.0, 0, 0)}]}],
        domain={"lo": (-1, -1, -1), "hi": (1, 1, 1)}, time={"step": 1e-5, "duration": 5e-3},
        output={"trace_every": 1e-5},
    )  # fmt: skip
    trace = run(scene).trace
    assert trace is not None
    assert np.array_equal(trace["velocity"][:, 0], np.tile((1.0, 0, 0), (501, 1)))
    # damping of half the mass, motion of the whole: eta -> eta/sqrt(2), restitution 0.8^0.7 of Hertz
    assert trace["velocity"][-1, 1, 0] == pytest.approx(1 + 0.8**0.7, abs=0.02)
    assert not trace["force"][-1].any()


def test_work_is_the_energy_gained():
    """A ball hit elastically: what it gains is the work of what hits it.

    Detects: the work left out, with its sign turned, or with the force of gravity in it.
    """
    scene = Scene(
        name="hit", materials=MATERIALS, pairs=[{**PAIRS[0], "friction": 0.0, "restitution": 1.0}],
        particles={"source": "explicit", "position": [(0, 0, 0), (0.0201, 0.003, 0)], "radius": 0.01,
                   "material": "ball"},
        groups=[{"name": "pusher", "ids": [1], "motion": [{"type": "linear", "velocity": (1.0, 0, 0.5)}]}],
        gravity=(0, 0, -9.81),
        output={"history_every": 1e-5, "trace_every": 1e-5, "group_forces": ["pusher"]},
        domain={"lo": (-1, -1, -1), "hi": (1, 1, 1)}, time={"step": 1e-6, "duration": 6e-3},
    )  # fmt: skip
    found = run(scene)
    assert found.trace is not None
    assert found.history is not None
    v, z = found.trace["velocity"][:, 1], found.trace["position"][:, 1, 2]
    energy = scene.masses[1] * ((v**2).sum(axis=1) / 2 + 9.81 * z)
    assert not found.history.force_pusher_x.iloc[-1]
    assert energy[-1] - energy[0] > 0.01
    assert found.history.work_pusher.iloc[-1] == pytest.approx(energy[-1] - energy[0], rel=1e-6)


@pytest.mark.parametrize("half_list", [True, False])
def test_work_of_forces_and_torques(half_list):
    """The sums on the device against those of every step of a trace, of two groups that turn and rise.

    Detects: forces of partners that a half list adds later, the torque left out, work of the other group.
    """
    turn = {"type": "swing", "axis": (0, 1, 0), "point": (0.12, 0, 0), "amplitude": 0.02, "period": 0.02}
    groups = [{"name": "shaken", "ids": np.arange(1, 101), "motion": MOTIONS["turned while it rises"]},
              {"name": "spun", "ids": np.arange(101, 201), "motion": [turn]}]  # fmt: skip
    scene = shaken(groups=groups, time={"step": 2e-5, "duration": 0.015})
    held, total = scene.held, np.zeros(2)
    with Simulation.of_solver(Solver(scene, threads=1, half_list=half_list)) as sim:
        sim._solver.start(write=True)
        for _ in range(scene.n_steps):
            sim.step()
            force, torque, v, w = (
                sim.read(name).numpy() for name in ("force", "torque", "velocity", "angular_velocity")
            )
            force = force - scene.masses[:, None] * np.array(scene.gravity)
            power = np.sum(force * v, axis=1) + np.sum(torque * w, axis=1)
            total -= [power[held == k].sum() * 2e-5 for k in (1, 2)]
        works = sim.view(sim.step_count).group_works
    assert np.abs(total).min() > 1e-7
    assert [works["shaken"], works["spun"]] == pytest.approx(total.tolist(), rel=1e-9)


@pytest.fixture(scope="module")
def plain() -> dict[str, np.ndarray]:
    return finish(Solver(shaken("turned while it rises"), threads=1))


@pytest.mark.parametrize("options", [{"threads": 2}, {"chunk": 7}], ids=str)
def test_bit_identical(plain, options):
    """Detects: a pose of another launch of a chunk, a place at the start of another particle after a sort."""
    same(plain, finish(Solver(shaken("turned while it rises"), **{"threads": 1, **options})))


@pytest.mark.parametrize("seed", range(2))
def test_two_parts_are_one_run(tmp_path, seed):
    """Detects: a restart whose groups begin their motion anew."""
    output = {"frames_every": 0.01, "history_every": 0.001, "restart_every": 0.0005}
    scene = shaken(output=output)
    stop = int(np.random.default_rng(seed).integers(30, scene.n_steps - 10))
    whole = run(scene, tmp_path / "whole", threads=1)
    parts = stopped_and_resumed(scene, tmp_path / "parts", at=stop)
    for a, b in zip(whole.frames, parts.frames, strict=True):
        same(a, b)
    assert whole.scene == type(whole).load(tmp_path / "whole").scene
    assert scene.hash != shaken("turned while it rises", output=output).hash


def test_through_a_periodic_side():
    """Detects: a moved ball that jumps back, or is moved in twice."""
    scene = Scene(
        name="round", materials=MATERIALS, pairs=PAIRS[:1],
        particles={"source": "explicit", "position": [(0.08, 0, 0), (0.0, 0.2, 0)], "radius": 0.01,
                   "material": "ball"},
        groups=[{"name": "mover", "ids": [1], "motion": [{"type": "linear", "velocity": (10.0, 0, 0)}]}],
        domain={"lo": (-0.1, -1, -1), "hi": (0.1, 1, 1), "periodic": (True, False, False)},
        time={"step": 1e-5, "duration": 0.05}, output={"trace_every": 1e-4},
    )  # fmt: skip
    trace = run(scene).trace
    assert trace is not None
    x = (0.08 + 10 * trace["time"] + 0.1) % 0.2 - 0.1
    assert np.abs(trace["position"][:, 0, 0] - x).max() < 1e-14
