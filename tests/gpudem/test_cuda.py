"""A CUDA device against the CPU: the same physics, the same bits again, the same errors.

Each test runs twice: on the device, where there is one, and rehearsed, on the CPU with all that is a CUDA
device's own way (full list, chunks of launches as a graph, rebuilding within it). What the CPU makes of a
scene is kept in a file, for a machine that has a GPU and no CPU compiler.
"""

import time

import numpy as np
import pytest

from comparisons.bench.worker import measure
from gpudem.driver import simulate as run
from gpudem.errors import SimulationError
from gpudem.scene import Scene
from gpudem.simulation import Simulation
from gpudem.solver.device import wp
from gpudem.solver.solver import Solver
from tests.gpudem.beds import finish, same
from tests.gpudem.on_cpu import RUNS, SCENES, apart, columns, kept, less_precise, on_cpu, written
from tests.gpudem.test_failures import escaping
from tests.gpudem.test_neighbor_list import layers

pytestmark = pytest.mark.long

CPU = pytest.mark.skipif(not wp.is_cpu_available(), reason="no compiler for the CPU")
REHEARSED = {"device": "cpu", "threads": 1, "half_list": False, "chunk": 32, "rebuild_in_graph": True}
DEVICES = pytest.mark.parametrize(
    "where",
    [
        pytest.param(REHEARSED, id="rehearsed", marks=CPU),
        pytest.param({"device": "cuda:0"}, id="cuda", marks=pytest.mark.gpu),
    ],
)


def simulation(scene: Scene, where: dict, **options) -> Solver:
    made = Solver(scene, **{**where, **options})
    made.graphs = True
    return made


@CPU
@pytest.mark.parametrize("name", RUNS)
def test_what_is_kept_of_the_cpu_is_what_it_makes(name):
    """Catches a file that is older than the solver."""
    live, filed = on_cpu(name), kept(name)
    if name == "escaping":
        assert str(live["message"]) == str(filed["message"])
    else:
        assert set(live) == set(filed)
        assert apart(filed, live) < {"mixed": 1e-4, "float32": 1e-2}.get(name, 1e-10)


@DEVICES
@pytest.mark.parametrize("name", SCENES)
def test_agrees_with_the_cpu(name, where):
    """Against the half list of the CPU, before rounding has grown.

    Catches an array that is read before it is written, an index or a stride that only the CPU forgives, a
    branch of a law that the other compiler takes elsewhere, springs carried to the wrong particle. Rehearsed,
    where sums alone have another order, the bound is that of the window: the arithmetic of a GPU was seen to
    make 24 times that difference.
    """
    scene = SCENES[name]()
    there = simulation(scene, where)
    ours = finish(there)
    assert apart(on_cpu(name), ours) < (4e-12 if where is REHEARSED else 1e-10)
    assert there.neighbors.rebuilds > 10
    assert np.abs(ours["velocity"] - scene.state.velocity[ours["id"] - 1]).max() > 0.1


@DEVICES
@pytest.mark.parametrize(("precision", "tolerance"), [("mixed", 1e-4), ("float32", 1e-2)])
def test_less_precise_is_as_precise_as_on_the_cpu(precision, tolerance, where):
    """A bed that has begun to fall onto itself; rounding of 6e-8 grows a thousandfold.

    Catches a precision that is another on the device; float32 positions in mixed.
    """
    assert apart(on_cpu(precision), finish(simulation(less_precise(precision), where))) < tolerance


@DEVICES
def test_again_to_the_last_bit(where):
    """Repeated; without the rebuild within the graph; a launch at a time. Catches a race, an atomic sum, a
    sort that is not stable, a graph that does another thing than its launches.
    """
    scene = SCENES["gate"]()
    once = finish(simulation(scene, where))
    for options in ({}, {"rebuild_in_graph": False}, {"chunk": 1}, {"chunk": 7}):
        same(once, finish(simulation(scene, where, **options)))


@DEVICES
def test_output_changes_nothing(where):
    """To the last bit. Catches a kernel of plain steps that rounds otherwise than that of steps with output,
    or that leaves something out which the next step needs.
    """
    scene = SCENES["friction"]()
    once, other = finish(simulation(scene, where)), simulation(scene, where)
    other.start()
    while other.step_count < scene.n_steps - 60:
        other.advance(40)
        other.write_step()
        other.write_step()
    other.advance(scene.n_steps - 1 - other.step_count)
    other.write_step(last=True)
    same(once, other.frame())


@DEVICES
def test_a_list_that_grows_within_a_graph(where):
    """Catches a graph that writes beyond its list, or goes on pointing at the smaller one."""
    running = simulation(layers(), where)
    room = running.neighbors.capacity
    assert apart(on_cpu("layers"), finish(running)) < 1e-10
    assert running.neighbors.capacity > room


@DEVICES
def test_a_lost_particle_is_named_as_on_the_cpu(where):
    """Catches an error that the device keeps to itself, or tells at another step."""
    with pytest.raises(SimulationError) as error:
        finish(simulation(escaping(), where))
    assert str(error.value) == str(on_cpu("escaping")["message"])


@DEVICES
def test_goes_on_from_a_saved_state(where):
    """Catches an array that is not brought back to the device."""
    scene = SCENES["friction"]()
    whole = finish(simulation(scene, where))
    first = simulation(scene, where)
    first.start()
    first.advance(scene.n_steps - 200 - 1)
    second = simulation(scene, where)
    second.load_state_dict(first.state_dict())
    second.advance(200)
    second.write_step(last=True)
    same(whole, second.frame())


@pytest.mark.parametrize(
    "device", [pytest.param("cpu", marks=CPU), pytest.param("cuda:0", marks=pytest.mark.gpu)]
)
def test_output_of_a_run(device, tmp_path):
    """Histories, traces and frames, read back while the run goes on. Catches rows of another step than they
    say, of another particle, or of a device that had not finished.
    """
    done = run(written(), tmp_path, device=device)
    assert done.timing.device.startswith(device)
    assert apart(on_cpu("written"), columns(done)) < 1e-9


@pytest.mark.gpu
@pytest.mark.timing
@pytest.mark.parametrize(("precision", "least"), [("mixed", 1e9), ("float64", 5e8)])
def test_rate_of_a_large_flowing_bed(precision, least):
    """A million balls with shear history, on a device as fast as an H100. Catches a host that is asked
    between launches, spilled registers, loads that are not wide.
    """
    name = wp.get_device("cuda:0").name
    if not any(fast in name for fast in ("H100", "H200", "B100", "B200")):
        pytest.skip(f"the rate is asked of an H100; here is {name}")
    steps = 2000
    done = measure("flowing", 1_000_000, steps, 1, "cuda:0", precision, time.time())
    assert 1_000_000 * steps / done.stepping_s > least


@DEVICES
def test_a_simulation_is_read_and_written_by_id(where):
    """On the device, by id; catches a read of a step that has not ended, a write that is lost."""
    scene = SCENES["friction"]()
    solver = simulation(scene, where)
    solver.start(write=True)
    with Simulation.of_solver(solver) as sim:
        sim.step(150)
        frame = solver.frame()
        for name in ("position", "velocity", "angular_velocity", "force", "torque"):
            array = sim.read(name)
            assert array.device == solver.device
            assert np.array_equal(array.numpy(), frame[name]), name
        before = sim.observe("kinetic_energy")
        assert before == pytest.approx(0.5 * scene.masses @ (frame["velocity"] ** 2).sum(axis=1), rel=1e-12)
        sim.write("velocity", 0.5 * frame["velocity"])
        assert sim.observe("kinetic_energy") == pytest.approx(before / 4, rel=1e-12)
        v, f = sim.read("velocity").numpy(), sim.read("force").numpy()
        sim.step(1)
        dt = scene.time.step
        drift = dt * (v + 0.5 * dt * f / scene.masses[:, None])
        assert np.allclose(sim.read("position").numpy(), frame["position"] + drift, rtol=0, atol=1e-12)
