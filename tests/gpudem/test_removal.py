"""Particles that leave while the solver runs."""

from typing import Any

import numpy as np
import pytest

from gpudem import Simulation
from gpudem.driver import simulate as run
from gpudem.output import observables
from gpudem.output.run import Run
from gpudem.output.view import DeviceView
from gpudem.scene import Scene
from gpudem.solver import guards
from gpudem.solver.solver import Solver
from tests.gpudem.beds import MATERIALS, PAIRS, finish, gas, same
from tests.gpudem.removals import conveyor, draining
from tests.gpudem.test_insertion import falling
from tests.gpudem.test_restart import stopped_and_resumed

STEP = 2e-5
PLANE = {"name": "gate", "point": (0.08, 0, 0), "normal": (1, 0, 0)}


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
    rate = found.history.removal_rate_xhi
    assert rate[26] == pytest.approx(masses[0] / STEP)
    assert rate.sum() * STEP == pytest.approx(masses[0] + masses[1])
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
    output = {"frames_every": 0.01, "history_every": 0.001, "restart_every": 0.0005, "flow": [PLANE]}
    return removing(output=output)


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
    assert whole.history[["removed_xhi", "removed_corner", "removed_old"]].iloc[-1].min() > 5
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
    gone = whole.history[["removed_xhi", "removed_corner", "removed_old"]].sum(axis=1)
    assert (np.array(come) - counts == gone[::10]).all()
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


def test_energy_that_leaves():
    """Balls that fly out below the origin: what is there and what has left are what was there at the start.

    Detects: energy at half-step velocities, without spin, of other particles; a warning of growing energy
    where negative potential energy leaves.
    """
    grid = np.stack(np.meshgrid(*[np.arange(4)] * 3, indexing="ij"), -1).reshape(-1, 3)
    rng = np.random.default_rng(3)
    scene = parting(
        particles={"source": "explicit", "material": "ball", "radius": 0.003,
                   "position": 0.01 * grid - (0.015, 0.015, 0.1), "velocity": rng.normal(0, 0.01, (64, 3)),
                   "angular_velocity": rng.normal(0, 300.0, (64, 3))},
        walls=[], domain={"lo": (-0.1, -0.1, -0.11), "hi": (0.1, 0.1, 0.1), "sides": {"zlo": "outflow"}},
        gravity=(0, 0, -9.81), time={"step": 2e-5, "duration": 0.06}, output={"history_every": 0.001},
    )  # fmt: skip
    with Simulation(scene, threads=1) as sim:
        left, total = sim._solver.departures, []
        for _ in range(6):
            sim.step(500)
            names = ("kinetic_energy", "rotational_energy", "potential_energy")
            total.append(sum(sim.observe(name) for name in names) + left.energy.sum())
        assert total == pytest.approx([total[0]] * 6, rel=1e-12)
        assert 10 < len(left) < 64
        assert left.energy_up_to(np.array([0, 3000])).tolist() == [0, pytest.approx(left.energy.sum())]
    found = run(scene)
    assert not any("energy" in warning for warning in found.warnings)
    (warning,) = guards.energy_warnings(scene, found.history, 0.0)
    assert warning.startswith("energy grew")


def test_members_of_a_moving_group():
    """They leave and are counted like every other; what is stated of the group is of those that are there.

    Detects: a member that stays for ever or leaves at another rebuild, weight or force of one that has left,
    an energy that leaves of a velocity that gravity has changed.
    """
    scene = conveyor()
    found = run(scene, threads=1)
    assert found.trace is not None
    assert found.history is not None
    x, belt = found.trace["position"], scene.groups[0].rows(scene)
    there = np.isfinite(x[..., 0])
    assert not there[-1, :4].any()
    assert there[-1, 4]
    for row in belt:
        last = int(np.flatnonzero(there[:, row])[-1])
        assert 0.3 < x[last, row, 0] + scene.time.step < 0.3 + scene.skin / 2 + 2 * scene.time.step
    assert found.history.removed_xhi.eq(5 - there.sum(axis=1)).all()
    pull = found.trace["force"][:, belt] - scene.masses[belt, None] * np.array(scene.gravity)
    pushed = np.nansum(pull, axis=1)
    assert np.abs(found.history[[f"force_belt_{a}" for a in "xyz"]] - pushed).max(axis=None) < 1e-12
    assert np.abs(pushed[~there[:, 0]]).max() > 0.1, "forces on the others after the first member has left"
    with Simulation(scene, threads=1) as sim:
        sim.step(scene.n_steps)
        left = sim._solver.departures
        at = x[left.step[belt] - 1, belt] + scene.time.step * np.array((1.0, 0, -0.1))
        energy = scene.masses[belt] * ((1 + 0.01) / 2 + 9.81 * at[:, 2])
        assert left.energy[belt] == pytest.approx(energy, rel=1e-12)


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


REGIONS: dict[str, dict[str, Any]] = {
    "block": {"kind": "block", "lo": (-0.4, -0.4, -0.4), "hi": (-0.1, 0.1, 0.3)},
    "ball": {"kind": "sphere", "center": (0.2, 0.1, 0.1), "radius": 0.22},
    "tube": {"kind": "cylinder", "point": (-0.1, 0.2, -0.3), "axis": (1, 1, 2), "length": 0.5,
             "radius": 0.15},
    "cone": {"kind": "cone", "point": (0.1, -0.4, 0.0), "axis": (0, 1, 0), "length": 0.5, "radius": 0.3,
             "end_radius": 0.05},
}  # fmt: skip


def test_regions_and_a_plane():
    """Detects: a region of another place or size, a plane of the other side, exits mixed up."""
    place = np.stack(np.meshgrid(*3 * [np.linspace(-0.45, 0.45, 10)], indexing="ij"), axis=-1).reshape(-1, 3)
    place = place + np.random.default_rng(3).uniform(-0.02, 0.02, place.shape)
    removals = [{"name": name, "every": STEP, "region": region} for name, region in REGIONS.items()]
    removals += [{"name": "above", "every": STEP, "point": (0, 0.1, 0.3), "normal": (0, 3, 4)}]
    scene = parting(
        particles={"source": "explicit", "position": place, "radius": 0.001, "material": "ball"},
        domain={"lo": (-0.5, -0.5, -0.5), "hi": (0.5, 0.5, 0.5)}, remove=removals,
        output={"frames_every": STEP}, time={"step": STEP, "duration": 2 * STEP},
    )  # fmt: skip
    simulation = Solver(scene)
    left = set(finish(simulation)["id"].tolist())
    inside = [stated.region.depth(place) >= 0 for stated in scene.remove if stated.region is not None]
    inside.append((place - (0, 0.1, 0.3)) @ (0, 3, 4) > 0)
    first = np.where(np.any(inside, axis=0), np.argmax(inside, axis=0), -1)
    assert np.array_equal(simulation.departures.exit, first)
    assert left == set((np.flatnonzero(first < 0) + 1).tolist())
    assert min(np.bincount(first[first >= 0])) > 10
    assert set(simulation.departures.step[first >= 0].tolist()) == {1}


def test_age():
    """Detects: an age counted from the start, a decision in other steps, balls of the start that leave."""
    scene = falling(remove=[{"name": "old", "every": 3 * STEP, "age": 5 * STEP}])
    found = run(scene)
    assert found.trace is not None
    there = np.isfinite(found.trace["position"][..., 0])
    # inserted in step 5: at least 5 steps old in step 12, a multiple of 3; in step 9: in step 15
    for particle, (begin, end) in enumerate([(0, 21), (5, 12), (9, 15), (9, 15)]):
        assert np.flatnonzero(there[:, particle]).tolist() == list(range(begin, end))
    assert found.history is not None
    assert found.history.removed_old.tolist() == [0] * 12 + [1] * 3 + [3] * 6


def test_flow():
    """Detects: a flow of the wrong sign, of what came beyond the plane, or lost with what leaves.

    The first ball is beyond x = 0.29 from the start, the second passes it after 0.00999 m, in step 500, and
    leaves in step 1014; the third passes x = -0.2101 the other way after 0.0101 m, in step 506.
    """
    planes = [
        {"name": "right", "point": (0.29, 0, 0), "normal": (5, 0, 0)},
        {"name": "left", "point": (-0.2101, 0, 0), "normal": (1, 0, 0)},
    ]
    scene = parting(output={"history_every": STEP, "history": ["particles"], "flow": planes})
    history, masses = run(scene).history, scene.masses
    assert history is not None
    for name, step, count in (("right", 500, 1), ("left", 506, -1)):
        passed = history[f"flow_count_{name}"].to_numpy()
        assert passed[0] == 0
        assert np.flatnonzero(np.diff(passed)).tolist() == [step - 1], name
        assert passed[-1] == count
    assert history.flow_mass_right.iloc[-1] == masses[1]
    assert history.flow_mass_left.iloc[-1] == -masses[2]
    assert history.flow_rate_left.sum() * STEP == pytest.approx(-masses[2])


def removing(count: int = 100, **changes) -> Scene:
    """`draining`, from which a block and age take particles too."""
    block = {"kind": "block", "lo": (0, 0, 0), "hi": (0.03, 0.05, 0.01)}
    stated = [
        {"name": "corner", "every": 2.1e-3, "region": block},
        {"name": "old", "every": 1e-3, "age": 0.02},
    ]
    return draining(count, **{"remove": stated, **changes})


@pytest.mark.parametrize("options", [{"threads": 2}, {"chunk": 32}], ids=str)
def test_removing_is_bit_identical(options):
    """Detects: launches beyond the step of a decision, a decision for the rebuild before or after it."""
    one, other = Solver(removing(600), threads=1), Solver(removing(600), **{"threads": 1, **options})
    same(finish(one), finish(other))
    assert np.array_equal(one.departures.step, other.departures.step)
    assert min(left for left, _mass in one.departures.totals().values()) > 20


def test_removing_in_graphs_is_bit_identical():
    """The same with graphs and rebuilds within them, as on a GPU. Detects: a graph of the number before."""
    frames = []
    for chunk, inside in ((1, False), (32, True)):
        simulation = Solver(removing(200), threads=1, half_list=False, chunk=chunk, rebuild_in_graph=inside)
        simulation.graphs = inside
        frames.append(finish(simulation))
    same(*frames)


@pytest.mark.gpu
def test_agrees_on_cuda(plain):
    """Detects: an index that only the CPU forgives, rows by id of those that were there before."""
    frame = finish(Solver(draining(), device="cuda:0"))
    assert np.array_equal(frame["id"], plain["id"])
    assert np.abs(frame["position"] - plain["position"]).max() < 1e-6


def test_reductions_on_a_device():
    """Detects: masses and radii of particles that have left in sums that a device does."""
    with Simulation(parting()) as sim:
        scalars: dict[str, Any] = {}
        for steps, left in ((10, 0), (90, 1), (1000, 2)):
            sim.step(steps)
            solver = sim._solver
            there = DeviceView(
                sim.scene, sim.step_count, sim._column, scalars,
                rows=solver.rows, removed=solver.departures.totals,
            )  # fmt: skip
            assert len(there) == 3 - left
            assert there.total("mass") == sim.scene.masses[left:].sum()
            for name in ("kinetic_energy", "centre_x", "particles", "front_x"):
                assert observables.get(name)(there) == pytest.approx(sim.observe(name), rel=1e-14), name
