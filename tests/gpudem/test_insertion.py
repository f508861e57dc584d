"""Particles inserted while the solver runs."""

import pickle
from typing import Any

import numpy as np
import pytest

from comparisons.oracles.mesh_shapes import rectangle
from gpudem import Simulation
from gpudem.driver import resume
from gpudem.driver import simulate as run
from gpudem.errors import SimulationError
from gpudem.output.run import Run
from gpudem.scene import Scene
from gpudem.solver.solver import Solver
from tests.gpudem.beds import MATERIALS, PAIRS, falling_bed, finish, gas, same
from tests.gpudem.insertions import filling, rain
from tests.gpudem.meshes import mesh
from tests.gpudem.test_restart import stopped_and_resumed

STEP = 2e-5


def falling(**changes: Any) -> Scene:
    """One ball at the start, one in step 5 and two in step 9, in free fall."""
    data: dict[str, Any] = {
        "name": "falling", "materials": MATERIALS, "pairs": PAIRS[:1],
        "particles": {"source": "explicit", "position": [(0.0, 0, 0)], "radius": 0.01, "material": "ball"},
        "insert": [
            {"kind": "list", "time": 9 * STEP, "position": [(0.1, 0, 0), (0.2, 0, 0)], "radius": 0.01,
             "material": "ball", "velocity": [(1.0, 0, 0), (0, 2.0, 0)]},
            {"kind": "list", "time": [5 * STEP], "position": [(0.3, 0, 0)], "radius": 0.02,
             "material": "ball", "velocity": [(0.0, 0, 3.0)]},
        ],
        "gravity": (0, 0, -9.81), "domain": {"lo": (-1, -1, -1), "hi": (1, 1, 1)},
        "time": {"step": STEP, "duration": 20 * STEP}, "output": {"trace_every": STEP, "history_every": STEP},
    }  # fmt: skip
    return Scene(**{**data, **changes})


def test_ids_steps_and_free_fall():
    """Detects: an insertion a step early or late, a missing or doubled half kick, ids out of order."""
    scene = falling()
    assert scene.arrival_steps.tolist() == [0, 5, 9, 9]
    assert [scene.count_at(step) for step in (0, 4, 5, 8, 9, 20)] == [1, 1, 2, 2, 4, 4]
    trace = run(scene).trace
    assert trace is not None
    for particle, begin in enumerate((0, 5, 9, 9)):
        x, v = trace["position"][:, particle], trace["velocity"][:, particle]
        assert np.isnan(x[:begin]).all()
        k = np.arange(21 - begin)[:, None]
        pull = np.array((0, 0, -9.81))
        # at the start the velocity is that of the full step, of an inserted ball that of half a step before
        half = 0 if begin == 0 else 0.5
        there = scene.state.position[particle] + k * STEP * scene.state.velocity[particle]
        there = there + (k * k / 2 + half * k) * STEP**2 * pull
        assert np.abs(x[begin:] - there).max() < 1e-15
        speed = scene.state.velocity[particle] + (k + half) * STEP * pull
        assert np.abs(v[begin:] - speed).max() < 1e-14


def test_columns_of_what_is_there(tmp_path):
    """Detects: a frame or history with particles that have not come, or a mass or radius of another one."""
    scene = falling(output={"frames_every": STEP, "history_every": STEP, "history": ["centre_x", "contacts"]})
    found = run(scene, tmp_path)
    for step, frame in enumerate(found.frames):
        assert frame["id"].tolist() == list(range(1, scene.count_at(step) + 1))
        assert np.array_equal(frame["radius"], scene.state.radius[: len(frame["id"])])
    assert found.history is not None
    mass, x = scene.masses, scene.state.position[:, 0] + 9 * STEP * np.array((0, 0, 0, 0))
    assert found.history.centre_x[0] == 0
    assert abs(found.history.centre_x[6] - mass[:2] @ x[:2] / mass[:2].sum()) < 1e-15
    assert found.timing.particles == scene.mean_count(20) == round((20 + 16 + 12 + 12) / 20)


def test_no_particles_at_the_start(tmp_path):
    """Detects: a launch, a reduction or a file that cannot be of no particles."""
    scene = falling(particles=None, output={"frames_every": STEP, "history_every": STEP})
    found = run(scene, tmp_path)
    assert found.history is not None
    assert found.history.centre_x.isna().sum() == 5
    assert found.history.kinetic_energy[:5].eq(0).all()
    assert [len(frame["id"]) for frame in found.frames] == [0] * 5 + [1] * 4 + [3] * 12
    assert found.frames[0]["position"].shape == (0, 3)
    assert type(found).load(tmp_path).scene == scene


@pytest.fixture(scope="module")
def plain() -> dict[str, np.ndarray]:
    frame = finish(Solver(filling(), threads=1))
    assert len(frame["id"]) == 1000
    assert np.abs(frame["force"]).max() > 1e-3
    return frame


@pytest.mark.parametrize("options", [{}, {"threads": 2}, {"chunk": 7}, {"chunk": 32}], ids=str)
def test_bit_identical(plain, options):
    """Detects: slices of the number before, launches beyond the step of an insertion, a stale list."""
    same(plain, finish(Solver(filling(), **{"threads": 1, **options})))


@pytest.mark.parametrize("chunk", [1, 7, 32])
@pytest.mark.parametrize("inside", [False, True], ids=["by the host", "within the chunk"])
def test_bit_identical_with_a_full_list(chunk, inside):
    """As on a GPU. Detects: a rebuild within a chunk that sorts particles which have not come."""
    one, other = (
        finish(Solver(filling(300), threads=1, half_list=False, **options))
        for options in ({}, {"chunk": chunk, "rebuild_in_graph": inside})
    )
    same(one, other)


@pytest.mark.parametrize("seed", range(10))
def test_two_parts_are_one_run(tmp_path, seed):
    """Detects: a restart that inserts again, or not at all, or with the springs of others."""
    output = {"frames_every": 0.01, "history_every": 0.001, "restart_every": 0.0005}
    scene = filling(100, output=output)
    stop = int(np.random.default_rng(seed).integers(30, scene.n_steps - 10))
    whole = run(scene, tmp_path / "whole", threads=1)
    parts = stopped_and_resumed(scene, tmp_path / "parts", at=stop)
    for a, b in zip(whole.frames, parts.frames, strict=True):
        same(a, b)
    assert whole.history is not None
    assert parts.history is not None
    assert whole.history.equals(parts.history)
    assert not any("energy grew" in warning for warning in whole.warnings)


def test_springs_of_the_others_go_on():
    """Detects: an insertion taken for a set-up, which adds a half kick and evaluates springs twice.

    A ball far away is inserted while the bed settles: the others do not feel it, to the last bit but for the
    order of sums, which the list gives.
    """
    bed = {"time": {"step": STEP, "duration": 0.02}, "walls": falling_bed().model_dump()["walls"][:1]}
    far = {
        "kind": "list",
        "time": 0.011,
        "position": [(0.19, 0.045, 0.39)],
        "radius": 0.003,
        "material": "ball",
    }
    alone, joined = (
        finish(Solver(falling_bed(300, insert=insert, **bed), threads=1)) for insert in ([], [far])
    )
    moved = np.abs(alone["velocity"]).max()
    for column in ("position", "velocity", "angular_velocity"):
        assert np.abs(alone[column] - joined[column][:300]).max() < 1e-11 * max(
            moved, np.abs(alone[column]).max()
        )


def test_through_periodic_sides():
    """Detects: an image count of another particle, a cell of a place outside."""
    start = gas().state
    scene = gas(
        insert=[{"kind": "list", "time": np.arange(1, 6) * 1e-3, "radius": 0.0012, "material": "ball",
                 "position": [(0.0001, 0.0001 + 0.01 * k, 0.0001) for k in range(5)],
                 "velocity": [(-0.5, 0.1, -0.2)] * 5}],
        allow=("overlap", "large_overlap"),
    )  # fmt: skip
    simulation = Solver(scene, threads=1)
    frame = finish(simulation)
    moved = simulation.column("unwrapped_position")[len(start) :] - scene.state.position[len(start) :]
    assert np.abs(moved).max() > 0.006
    assert len(frame["id"]) == len(start) + 5


def test_simulation_by_hand():
    """Detects: arrays of the number at the end, values written to places of particles that are to come."""
    with Simulation(falling()) as sim:
        assert sim.read("position").shape == (1,)
        sim.step(6)
        assert sim.read("velocity").shape == sim.read("mass").shape == (2,)
        sim.write("velocity", np.array([(0, 0, 0), (0, 7.0, 0)]))
        sim.step(4)
        v = sim.read("velocity").numpy()
        assert v.shape == (4, 3)
        assert v[1, 1] == pytest.approx(7.0, abs=1e-12)
        assert v[3, 1] == pytest.approx(2.0, abs=1e-12)
        assert sim.observe("kinetic_energy") > 0


def test_forces_on_walls_while_particles_come():
    """Detects: a sum over the list entries of particles that have not come."""
    floor = mesh(rectangle(np.zeros(3), np.array((0.1, 0, 0)), np.array((0, 0.05, 0))), "floor")
    walls = [*falling_bed().model_dump()["walls"], floor]
    output = {"history_every": 0.002, "wall_forces": ["floor"]}
    alone, joined = (
        run(filling(300, insert=insert, walls=walls, output=output), threads=1).history
        for insert in ([], [rain(1, time=0.03)])
    )
    assert alone is not None
    assert joined is not None
    assert alone.force_floor_z[:15].abs().max() > 0.01
    scale = alone.force_floor_z.abs().max()  # the order of the particles is another one: rounding
    assert np.abs(alone.force_floor_z[:15] - joined.force_floor_z[:15]).max() < 1e-9 * scale


def test_memory_and_rate_count_what_is_there(tmp_path):
    """Detects: particle-steps of particles that are not there."""
    scene = falling(output={"frames_every": 20 * STEP, "restart_every": 10 * STEP})
    run(scene, tmp_path)
    assert resume(tmp_path).timing.particles == scene.mean_count(scene.n_steps)


def test_a_part_of_a_run_counts_its_own_steps():
    """Detects: an interrupted run whose particle-steps are those of the whole one."""
    scene = falling()
    assert [scene.mean_count(steps) for steps in (0, 4, 6, 12)] == [1, 1, round(8 / 6), round(28 / 12)]


def test_a_file_is_read_once(tmp_path):
    """Detects: a folder that holds other insertions than were run, or those of an older run."""
    path = tmp_path / "rain.csv"
    path.write_text("time,x,y,z,radius\n1e-4,0.3,0,0,0.01\n2e-4,0.5,0,0,0.01\n")
    scene = falling(insert=[{"kind": "list", "path": str(path), "material": "ball"}])
    path.unlink()
    run(scene, tmp_path / "run")
    assert (tmp_path / "run" / "insert_0.npz").is_file()
    resumed = pickle.loads(pickle.dumps(scene))
    assert resumed == Run.load(tmp_path / "run").scene == scene
    run(falling(), tmp_path / "run")
    assert not (tmp_path / "run" / "insert_0.npz").exists()


def test_damping_of_a_ball_that_comes_in_contact():
    """Detects: with `path`, a ball inserted in contact whose velocity ahead is 0: half the damping."""
    fall = {"position": [(0.0, 0, 0.0099)], "radius": 0.01, "material": "ball", "velocity": [(0.0, 0, -1.0)]}
    floor = {"kind": "plane", "name": "floor", "material": "ball", "point": (0, 0, 0), "normal": (0, 0, 1)}
    common = {"walls": [floor], "solver": {"integrator": "path"}, "gravity": (0, 0, 0)}
    there = run(falling(particles={"source": "explicit", **fall}, insert=[], **common)).trace
    comes = run(falling(particles=None, insert=[{"kind": "list", "time": 5 * STEP, **fall}], **common)).trace
    assert there is not None
    assert comes is not None
    pushed = there["force"][0, 0, 2]
    assert comes["force"][5, 0, 2] == pytest.approx(pushed, rel=0.02)  # its velocity is of half a step before
    slow = {**fall, "velocity": [(0.0, 0, 0.0)]}
    still = run(falling(particles={"source": "explicit", **slow}, insert=[], **common)).trace
    assert still is not None
    assert still["force"][0, 0, 2] < 0.7 * pushed  # most of it is damping


def test_an_insertion_into_a_bed_is_named():
    """Detects: a message that blames the material or the time step, or that names another insertion."""
    other = {"kind": "list", "time": STEP, "position": [(0.5, 0, 0)], "radius": 0.01, "material": "ball"}
    into = {**other, "time": 6 * STEP, "position": [(0.0, 0.001, 0)]}
    with pytest.raises(
        SimulationError, match=r"insert\[1\] inserts particle 3 in this step where particle 1 is"
    ):
        run(falling(insert=[other, into]))
    with pytest.raises(SimulationError, match=r"\(step 6\); insert\[0\] inserts particle 3 in this step"):
        run(falling(insert=[into, other]))


def test_a_late_one_warns():
    """Detects: a particle that never comes, or a rounded time, without a word."""
    late = {**rain(1), "time": 1.0}
    found = run(filling(20, insert=[late])).warnings
    assert any("insert: 40 particles would be inserted after the end of the run" in w for w in found), found
    rounded = {**rain(1), "time": 0.00013}
    found = run(filling(20, insert=[rounded])).warnings
    assert any("rounded to whole steps" in w and "0.00013 s to step 6" in w for w in found), found
