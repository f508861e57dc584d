"""gpudem.Simulation: stepping by hand, reading and writing by id, and how it ends."""

import gc
import os
import signal
import threading

import numpy as np
import pytest

import gpudem
from gpudem.errors import GpudemError, SimulationError
from gpudem.scene import Scene
from gpudem.solver.device import wp
from gpudem.solver.solver import Solver
from tests.gpudem.beds import PAIRS, falling_bed, finish, gas
from tests.gpudem.test_failures import escaping

SHORT = {"step": 2e-5, "duration": 0.012}
COLUMNS = ("position", "velocity", "angular_velocity", "force", "torque")


def bed(**changes) -> Scene:
    return falling_bed(600, **{"time": SHORT, **changes})


def state(sim: gpudem.Simulation) -> dict[str, np.ndarray]:
    return {name: sim.read(name).numpy() for name in COLUMNS}


@pytest.mark.parametrize("precision", ["float64", "mixed", "float32"])
def test_reading_changes_nothing_and_is_by_id(precision):
    """Catches a read in sorted order or at half a step, or one that changes the state."""
    scene = bed(solver={"precision": precision})
    frame = finish(Solver(scene))
    with gpudem.Simulation(scene) as sim:
        for _ in range(20):
            sim.step(30)
            before = state(sim)
            assert all(np.array_equal(before[k], v) for k, v in state(sim).items())
        assert sim.step_count == scene.n_steps
        assert sim.time == pytest.approx(scene.time.duration)
        for name in COLUMNS:
            assert np.array_equal(sim.read(name).numpy().astype(float), frame[name]), name
        assert np.array_equal(sim.read("mass").numpy(), scene.masses)
        assert np.array_equal(sim.read("radius").numpy(), scene.state.radius)
        assert np.array_equal(sim.read("material").numpy(), scene.state.material)


def test_at_the_start_forces_are_those_of_the_set_up():
    """Catches a first read of zeros, or of a step that was never done."""
    with gpudem.Simulation(bed()) as sim:
        assert sim.step_count == 0
        assert np.array_equal(sim.read("position").numpy(), bed().state.position)
        assert np.allclose(sim.read("force").numpy()[:, 2], -9.81 * bed().masses, rtol=1e-12)


def test_gates_go_when_they_should():
    """Through the removal of a gate, and past the duration; catches one that stays or goes early."""
    walls = [w.model_dump() for w in falling_bed().walls]
    scene = bed(walls=[walls[0], {**walls[1], "removed_at": 0.004}])
    frame = finish(Solver(scene))
    with gpudem.Simulation(scene) as sim:
        sim.run_until(0.004)  # ends just before the set-up without the gate
        sim.step(150)
        sim.run_until(0.012)
        assert np.array_equal(sim.read("position").numpy(), frame["position"])
        sim.step(100)
        assert sim.step_count == scene.n_steps + 100


def test_write_velocity_is_the_scene_that_starts_with_it():
    """Velocities written at the start: a start with them. Catches values in sorted order, a lost kick."""
    scene = bed()
    v = np.random.default_rng(2).normal(0, 0.2, (600, 3))
    explicit = {"source": "explicit", "material": "ball", "radius": 0.003, "position": scene.state.position,
                "velocity": v}  # fmt: skip
    with gpudem.Simulation(scene) as sim, gpudem.Simulation(bed(particles=explicit)) as other:
        sim.write("velocity", v)
        for s in (sim, other):
            s.step(200)
        for name in COLUMNS:
            assert np.allclose(sim.read(name).numpy(), other.read(name).numpy(), rtol=1e-9, atol=1e-12), name


@pytest.mark.parametrize("name", ["position", "velocity", "angular_velocity"])
def test_what_was_written_is_read(name):
    """Also in the middle of a run, after rebuilds, twice, and from an array on the device."""
    with gpudem.Simulation(bed()) as sim:
        sim.step(150)
        before = state(sim)
        new = before[name] + np.random.default_rng(1).uniform(-1e-6, 1e-6, (600, 3))
        sim.write(name, new)
        after = state(sim)
        assert np.array_equal(after[name], new)
        for other in {"position", "velocity", "angular_velocity"} - {name}:
            assert np.array_equal(after[other], before[other]), other
        sim.write(name, sim.read(name))
        assert np.array_equal(sim.read(name).numpy(), new)
        sim.step(1)
        dt, mass = sim.scene.time.step, sim.scene.masses[:, None]
        moved = dt * (after["velocity"] + 0.5 * dt * after["force"] / mass)  # half kick, drift
        assert np.allclose(sim.read("position").numpy(), after["position"] + moved, rtol=0, atol=1e-12)


def test_write_keeps_the_springs():
    """Writing back what was read leaves contact springs: catches a set-up that forgets the history."""
    with gpudem.Simulation(bed()) as sim:
        sim.run_until(0.012)
        before = sim.read("force").numpy()
        sim.write("position", sim.read("position"))
        after = sim.read("force").numpy()
    assert np.abs(before).max() > 2 * 9.81 * bed().masses[0]
    # the dashpots see full-step velocities at a set-up, half-step ones in a step
    assert np.abs(after - before).max() < 0.1 * np.abs(before).max()


@pytest.mark.parametrize(
    ("name", "values", "message"),
    [
        ("color", np.zeros((600, 3)), "write: cannot set 'color'; known: position, velocity, angular_vel"),
        ("velocity", np.zeros((600, 2)), "has shape (600, 2)"),
        ("velocity", np.zeros(600), "has shape (600,)"),
        ("velocity", np.zeros((600, 3), complex), "type complex128"),
        ("velocity", np.full((600, 3), np.nan), "velocity of particle 1 = [nan, nan, nan] is not finite"),
        ("position", np.full((600, 3), 7.0), "of particle 1 = [7.0, 7.0, 7.0] is outside the domain"),
    ],
)
def test_write_refuses(name, values, message):
    with gpudem.Simulation(bed()) as sim:
        before = state(sim)
        with pytest.raises(GpudemError) as error:
            sim.write(name, values)
        assert message in str(error.value)
        assert all(np.array_equal(before[k], v) for k, v in state(sim).items())


def test_read_and_step_refuse():
    with gpudem.Simulation(gas()) as sim:
        with pytest.raises(GpudemError, match="no array 'speed'; known: position, velocity"):
            sim.read("speed")
        with pytest.raises(GpudemError, match="angular_velocity has no effect"):
            sim.write("angular_velocity", np.zeros((120, 3)))
        for steps in (-1, 1.5, True, "3"):
            with pytest.raises(GpudemError, match="must be a whole number of 0 or more"):
                sim.step(steps)  # type: ignore[arg-type]
        sim.step(10)
        with pytest.raises(GpudemError, match="has passed; the simulation is at 2e-05 s"):
            sim.run_until(1e-5)


def test_observables_are_those_of_a_history():
    """Catches an observable of half a step, or of another order of the particles."""
    scene = bed(output={"history_every": 0.004})
    history = gpudem.simulate(scene).history
    with gpudem.Simulation(scene) as sim:
        for row in history.itertuples():
            sim.run_until(row.time)
            for name in ("kinetic_energy", "rotational_energy", "contacts", "centre_z"):
                assert sim.observe(name) == getattr(row, name), (name, row.time)
        with pytest.raises(GpudemError, match="no observable 'heat'"):
            sim.observe("heat")


def test_a_hook_may_write():
    """Velocities halved within a run: catches a write that the run's own loop overrides or does twice."""
    found = []

    def halve(sim):
        if sim.step_count == 300:
            sim.write("velocity", 0.5 * sim.read("velocity").numpy())
        found.append(sim.observe("kinetic_energy"))

    scene = bed(output={"history_every": 0.012})
    run = gpudem.simulate(scene, hooks=[gpudem.every(100 * 2e-5, halve)])
    with gpudem.Simulation(scene) as sim:
        sim.step(300)
        before = sim.observe("kinetic_energy")
        sim.write("velocity", 0.5 * sim.read("velocity").numpy())
        assert found[3] == sim.observe("kinetic_energy") == pytest.approx(before / 4)
        sim.step(300)
        assert run.history.kinetic_energy.iloc[-1] == sim.observe("kinetic_energy") == found[-1]


def test_other_libraries_take_the_arrays():
    """DLPack and NumPy: without a copy on the CPU."""
    with gpudem.Simulation(gas()) as sim:
        x = sim.read("position")
        assert isinstance(x, wp.array)
        assert np.array_equal(np.from_dlpack(x), x.numpy())


def test_periodic_positions_lie_within():
    with gpudem.Simulation(gas()) as sim:
        for _ in range(20):
            sim.step(100)
            x = sim.read("position").numpy()
            assert (x >= 0).all()
            assert (x < 0.05).all()


def test_use_after_close_and_after_an_error():
    """Catches a wait for threads that have ended."""
    sim = gpudem.Simulation(bed(), threads=2)
    sim.close()
    sim.close()
    for use in (lambda: sim.step(), lambda: sim.read("position"), lambda: sim.write("velocity", 0)):
        with pytest.raises(GpudemError, match="cannot be used any more: it was closed"):
            use()
    with gpudem.Simulation(escaping()) as lost:
        with pytest.raises(SimulationError, match="left the domain"):
            lost.step(100_000)
        with pytest.raises(GpudemError, match="it ended with SimulationError: particle"):
            lost.step()


def test_no_thread_is_left(monkeypatch):
    """Dropped without `close`, closed, or ended by an error."""
    monkeypatch.setattr("gpudem.solver.solver.block_size", lambda n, layers: 100)
    before = set(threading.enumerate())
    sim = gpudem.Simulation(bed(), threads=2)
    sim.step(5)
    (own,) = set(threading.enumerate()) - before
    del sim
    gc.collect()
    own.join(10)
    assert not own.is_alive()


def test_interrupted_and_continued():
    """Ctrl-C in a notebook cell: the next cell goes on, to the bits of a run in one."""
    scene = bed(time={"step": 2e-5, "duration": 0.1})
    with gpudem.Simulation(scene) as whole, gpudem.Simulation(scene) as sim:
        timer = threading.Timer(0.05, os.kill, (os.getpid(), signal.SIGINT))
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            sim.step(10_000_000)
        timer.join()
        done = sim.step_count
        assert 0 < done < 10_000_000
        whole.step(done)
        for s in (whole, sim):
            s.step(40)
        for name in COLUMNS:
            assert np.array_equal(whole.read(name).numpy(), sim.read(name).numpy()), name


def test_friction_pairs_are_used():
    """The bed above has friction, so that springs matter in these tests."""
    assert PAIRS[0]["friction"] > 0
