"""Particles that leave while the solver runs."""

import numpy as np
import pytest

from gpudem import Simulation
from gpudem.driver import simulate as run
from gpudem.output.run import Run
from gpudem.scene import Scene
from gpudem.solver.solver import Solver
from tests.gpudem.beds import MATERIALS, PAIRS, finish, gas, same
from tests.gpudem.removals import draining
from tests.gpudem.test_restart import stopped_and_resumed

STEP = 2e-5


def parting(**changes) -> Scene:
    """Three balls without gravity; the first two leave through xhi, one after the other."""
    data = {
        "name": "parting", "materials": MATERIALS, "pairs": PAIRS[:1],
        "particles": {"source": "explicit", "radius": [0.01, 0.02, 0.03], "material": "ball",
                      "position": [(0.29901, 0, 0), (0.28001, 0.1, 0), (-0.2, 0, 0)],
                      "velocity": [(2.0, 0, 0), (1.0, 0, 0), (-1.0, 0, 0)]},
        "domain": {"lo": (-0.5, -0.5, -0.5), "hi": (0.3, 0.5, 0.5), "sides": {"xhi": "outflow"}},
        "solver": {"skin": 0.00101}, "time": {"step": STEP, "duration": 2000 * STEP},
        "output": {"trace_every": STEP, "history_every": STEP, "history": ["particles", "kinetic_energy"]},
    }  # fmt: skip
    return Scene(**{**data, **changes})


def test_the_step_in_which_a_particle_leaves():
    """Detects: a removal at another rebuild or in another step, ids or masses of another particle.

    The list is rebuilt in the step in which the fastest has moved more than half the skin, 0.505 mm, since
    the last one: at 2 m/s in steps 13, 26, ... The first is beyond the side after 25 steps and leaves in step
    26; then the fastest has 1 m/s: steps 52, 78, ... The second is beyond after 1000 and leaves in step 1014.
    """
    found = run(parting())
    assert found.trace is not None
    assert found.history is not None
    there = np.isfinite(found.trace["position"][..., 0])
    assert there[:26].all()
    assert not there[26:, 0].any()
    last = int(np.flatnonzero(there[:, 1])[-1])
    assert last + 1 == 1014
    assert there[:, 2].all()
    masses = parting().masses
    assert found.history.particles.tolist() == [3] * 26 + [2] * (last - 25) + [1] * (2000 - last)
    assert found.history.removed_xhi.eq(3 - found.history.particles).all()
    assert found.history.removed_mass_xhi.iloc[-1] == masses[0] + masses[1]
    energy = 0.5 * masses * np.array((4.0, 1.0, 1.0))
    assert found.history.kinetic_energy.iloc[-1] == pytest.approx(energy[2], rel=1e-12)
    assert found.timing.particles == round((3 * 25 + 2 * (last - 25) + 2000 - last) / 2000)


@pytest.fixture(scope="module")
def plain() -> dict[str, np.ndarray]:
    simulation = Solver(draining(), threads=1)
    frame = finish(simulation)
    left, mass = simulation.departures.totals()["xhi"]
    assert 100 < left < 900
    assert left == 1000 - len(frame["id"])
    assert mass == pytest.approx(np.delete(simulation.scene.masses, frame["id"] - 1).sum(), rel=1e-12)
    assert (np.diff(frame["id"]) > 1).any(), "ids of those that left are not used again"
    assert frame["id"][-1] == 1000
    assert frame["position"][:, 0].max() < 0.101 + 0.002
    return frame


@pytest.mark.parametrize("options", [{}, {"threads": 2}, {"chunk": 7}, {"chunk": 32}], ids=str)
def test_bit_identical(plain, options):
    """Detects: slices of the number before, launches beyond a rebuild, entries of those that left."""
    same(plain, finish(Solver(draining(), **{"threads": 1, **options})))


@pytest.mark.parametrize("chunk", [1, 7, 32])
@pytest.mark.parametrize("inside", [False, True], ids=["by the host", "within the chunk"])
def test_bit_identical_with_a_full_list(chunk, inside):
    """As on a GPU. Detects: a rebuild within a chunk that goes on with particles that leave."""
    one, other = (
        finish(Solver(draining(300), threads=1, half_list=False, **options))
        for options in ({}, {"chunk": chunk, "rebuild_in_graph": inside})
    )
    assert len(one["id"]) < 650  # of 700
    same(one, other)


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Run:
    return run(recorded(), tmp_path_factory.mktemp("whole"), threads=1)


def recorded() -> Scene:
    output = {"frames_every": 0.01, "history_every": 0.001, "restart_every": 0.0005}
    return draining(100, output=output)


@pytest.mark.parametrize("seed", range(10))
def test_two_parts_are_one_run(whole, tmp_path, seed):
    """Detects: a restart that has forgotten who has left, or lets them come back."""
    stop = int(np.random.default_rng(seed).integers(30, recorded().n_steps - 10))
    parts = stopped_and_resumed(recorded(), tmp_path, at=stop)
    for a, b in zip(whole.frames, parts.frames, strict=True):
        same(a, b)
    assert whole.history is not None
    assert parts.history is not None
    assert whole.history.equals(parts.history)
    assert whole.history.removed_xhi.iloc[-1] > 50
    assert whole.timing.particles == parts.timing.particles


def test_run_directory(whole):
    """Detects: a folder that cannot be read again, a frame with particles that have left."""
    again = Run.load(whole.directory)
    assert again.scene == whole.scene
    assert again.history is not None
    assert whole.history is not None
    assert again.history.equals(whole.history)
    counts = [len(frame["id"]) for frame in again.frames]
    come = [whole.scene.count_at(step) for step in whole.history.step[::10]]
    assert (np.array(come) - counts == whole.history.removed_xhi[::10]).all()
    for frame in again.frames:
        assert np.array_equal(frame["radius"], whole.scene.state.radius[frame["id"] - 1])


def test_simulation_by_hand():
    """Detects: values written to or read from the places of those that have left."""
    with Simulation(parting()) as sim:
        sim.step(100)
        assert sim.read("id").numpy().tolist() == [2, 3]
        assert sim.read("radius").numpy().tolist() == [0.02, 0.03]
        assert sim.read("position").numpy()[:, 1].tolist() == [0.1, 0.0]
        sim.write("velocity", [(0, 5.0, 0), (0, 7.0, 0)])
        sim.step(10)
        assert sim.read("velocity").numpy()[:, 1].tolist() == [5.0, 7.0]
        assert sim.view(sim.step_count).removed == {"xhi": (1, sim.scene.masses[0])}


def test_a_closed_side_is_still_an_error():
    """Detects: sides that are all open where one is."""
    scene = parting(domain={"lo": (-0.21, -0.5, -0.5), "hi": (0.3, 0.5, 0.5), "sides": {"xhi": "outflow"}})
    with pytest.raises(Exception, match="particle 3 left the domain"):
        run(scene)


def test_none_left():
    """Detects: a launch, a reduction or a view that cannot be of no particles."""
    sides = {"xhi": "outflow", "xlo": "outflow"}
    found = run(parting(domain={"lo": (-0.21, -0.5, -0.5), "hi": (0.3, 0.5, 0.5), "sides": sides}))
    assert found.history is not None
    assert found.history.particles.iloc[-1] == 0
    assert found.history.kinetic_energy.iloc[-1] == 0
    assert found.history[["removed_xlo", "removed_xhi"]].iloc[-1].tolist() == [1, 2]


def test_through_periodic_sides():
    """Detects: a removal by positions that are not moved in yet, image counts of others."""
    scene = gas(domain={"lo": (0, 0, 0), "hi": (0.05, 0.05, 0.05), "periodic": (True, True, False),
                        "sides": {"zlo": "outflow", "zhi": "outflow"}})  # fmt: skip
    simulation = Solver(scene, threads=1)
    frame = finish(simulation)
    left = simulation.departures.totals()
    assert left["zlo"][0] > 20  # the gas fills the lower half
    moved = simulation.column("unwrapped_position") - scene.state.position[frame["id"] - 1]
    assert np.abs(moved).max() < 0.05
    assert np.abs(moved).max() > 0.01
