"""A CUDA device against the CPU: the same physics, the same bits again, the same errors.

Each test runs twice: on the device, where there is one, and rehearsed, on the CPU with all that is a CUDA
device's own way (full list, chunks of launches as a graph, rebuilding within it). What the CPU makes of a
scene is kept in a file, for a machine that has a GPU and no CPU compiler.
"""

import functools
import tempfile
import time
from collections.abc import Callable

import numpy as np
import pytest

from comparisons.bench_worker import measure
from gpudem.device import wp
from gpudem.errors import SimulationError
from gpudem.run import Run
from gpudem.scene import Scene
from gpudem.simulation import run
from gpudem.solver import Simulation
from tests.gpudem.beds import MATERIALS, PAIRS, falling_bed, gas
from tests.gpudem.on_cpu import RUNS, Table, apart, kept, on_cpu
from tests.gpudem.test_failures import escaping
from tests.gpudem.test_neighbor_list import layers
from tests.gpudem.test_vibration import shaken_bed

CPU = pytest.mark.skipif(not wp.is_cpu_available(), reason="no compiler for the CPU")
REHEARSED = {"device": "cpu", "threads": 1, "half_list": False, "chunk": 32, "rebuild_inside": True}
DEVICES = pytest.mark.parametrize(
    "where",
    [
        pytest.param(REHEARSED, id="rehearsed", marks=CPU),
        pytest.param({"device": "cuda:0"}, id="cuda", marks=pytest.mark.gpu),
    ],
)
ROLLS = [{**p, "rolling_friction": 0.2} for p in PAIRS]
OUTER, GATE = (wall.model_dump() for wall in falling_bed().walls)
SHORT = {"step": 2e-5, "duration": 0.015}


def bed(**changes) -> Scene:
    return falling_bed(1500, **{"time": SHORT, "walls": falling_bed().walls[:1], **changes})


def two_materials() -> Scene:
    """Of two radii as well, by turns."""
    state = bed().state
    several = {
        "source": "explicit", "position": state.position, "velocity": state.velocity,
        "radius": np.where(np.arange(1500) % 3 == 0, 0.002, 0.003),
        "material": tuple("ball" if i % 2 else "heavy" for i in range(1500)),
    }  # fmt: skip
    heavy = {"young": 2e7, "poisson": 0.25, "density": 7800.0}
    more = [
        {"materials": ("heavy", k), "restitution": 0.5, "friction": 0.2} for k in ("heavy", "ball", "wall")
    ]
    return bed(materials={**MATERIALS, "heavy": heavy}, pairs=[*PAIRS, *more], particles=several,
               time={"step": 1e-5, "duration": 0.015})  # fmt: skip


SCENES = {
    "gas": lambda: gas(time={"step": 2e-6, "duration": 0.004}),
    "friction": bed,
    "friction without history": lambda: bed(contact={"tangential": "no_history"}),
    "gate": lambda: bed(walls=[OUTER, {**GATE, "removed_at": 0.01}]),
    "path": lambda: bed(solver={"integrator": "path"}),
    "hooke": lambda: bed(contact={"normal": "hooke", "characteristic_velocity": 0.5}),
    "cdt": lambda: bed(contact={"rolling": "cdt"}, pairs=ROLLS),
    "epsd2": lambda: bed(contact={"rolling": "epsd2"}, pairs=ROLLS),
    "two materials": two_materials,
    "saw-tooth": lambda: shaken_bed(800, 0.0007, time={"step": 4e-5, "duration": 0.02}),
    "fast floor": lambda: shaken_bed(800, 0.0, time={"step": 4e-5, "duration": 0.02}),
}


def less_precise(precision: str) -> Scene:
    """A bed that has begun to fall onto itself."""
    return bed(solver={"precision": precision}, time={"step": 2e-5, "duration": 0.01})


def written() -> Scene:
    """With all output there is."""
    return shaken_bed(
        800, 0.0007, time={"step": 4e-5, "duration": 0.02},
        output={"frames_every": 0.004, "trace_every": 0.004, "history_every": 0.001},
    )  # fmt: skip


def columns(done: Run) -> Table:
    """History, trace and last frame of a run, of some of its particles."""
    found = {f"history {k}": done.history[k].to_numpy(float) for k in done.history}
    found |= {f"trace {k}": np.asarray(v, float) for k, v in done.trace.items()}
    found = {k: v[:, ::40] if v.ndim > 1 else v for k, v in found.items()}
    return (
        found
        | {f"frame {k}": v[::40] for k, v in done.frames[-1].items()}
        | {"frames": np.array([len(done.frames)])}
    )


def simulation(scene: Scene, where: dict, **options) -> Simulation:
    made = Simulation(scene, **{**where, **options})
    made.graphs = True
    return made


def finish(running: Simulation, before: int = 0) -> dict[str, np.ndarray]:
    """Run to the end, stopping `before` steps of it."""
    for first, last, planes in running.scene.segments:
        running.start(planes, write=first == 0)
        running.advance(last - first - 1 - before)
        if not before:
            running.write_step(last=True)
    running.close()
    return running.frame() if not before else {}


def same(a: dict[str, np.ndarray], b: dict[str, np.ndarray]) -> None:
    for column in a:
        assert np.array_equal(a[column], b[column]), column


def lost() -> Table:
    with pytest.raises(SimulationError) as error:
        finish(Simulation(escaping()))
    return {"message": np.array(str(error.value))}


def two_threads() -> Table:
    with tempfile.TemporaryDirectory() as folder:
        return columns(run(written(), folder, threads=2))


def of(scene: Callable[[], Scene]) -> Callable[[], Table]:
    return lambda: finish(Simulation(scene()))


RUNS |= {name: of(scene) for name, scene in SCENES.items()}
RUNS |= {precision: of(functools.partial(less_precise, precision)) for precision in ("mixed", "float32")}
RUNS |= {"layers": of(layers), "escaping": lost, "written": two_threads}


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
    branch of a law that the other compiler takes elsewhere, springs carried to the wrong particle.
    """
    scene = SCENES[name]()
    there = simulation(scene, where)
    ours = finish(there)
    assert apart(on_cpu(name), ours) < 1e-10
    assert there.neighbors.rebuilds > 10
    assert np.abs(ours["velocity"] - scene.state.velocity).max() > 0.1


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
    for options in ({}, {"rebuild_inside": False}, {"chunk": 1}, {"chunk": 7}):
        same(once, finish(simulation(scene, where, **options)))


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
    scene = bed()
    whole = finish(simulation(scene, where))
    first = simulation(scene, where)
    finish(first, before=200)
    second = simulation(scene, where)
    second.resume(first.saved())
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
