"""Neighbor search by size class: against all pairs, against a search with one class, and its work."""

import numpy as np
import pytest

from gpudem.scene import Scene, size_classes
from gpudem.scene.size_classes import CLASS_RATIO, class_radii, default_skin
from gpudem.solver.neighbor_list import NeighborList
from gpudem.solver.solver import Solver
from tests.gpudem.beds import MATERIALS
from tests.gpudem.test_neighbor_list import all_pairs, cloud, listed_pairs

FLOOR = {"kind": "plane", "name": "floor", "material": "wall", "point": (0, 0, 0), "normal": (0, 0, 1)}
OPEN, CLOSED, TWO_SIDES = (False, False, False), (True, True, True), (True, False, True)


def radii_of(kind: str, ratio: float, count: int) -> np.ndarray:
    """Largest radius 0.05 m, smallest that divided by `ratio`."""
    rng, top = np.random.default_rng(int(ratio)), 0.05
    if kind == "log-uniform":
        return top * ratio ** -np.r_[0, 1, rng.uniform(0, 1, count - 2)]
    if kind == "two sizes":
        return np.where(np.arange(count) % 20 == 0, top, top / ratio)
    if kind == "equal volumes":  # number ~ r^-4
        u = np.r_[0, 1, rng.uniform(0, 1, count - 2)]
        return top / ratio * (1 - u * (1 - ratio**-3.0)) ** (-1 / 3)
    return np.r_[np.full(count - 1, top / ratio), top]  # one large


@pytest.fixture(params=["full", "half", "half in blocks"])
def half_list(request, monkeypatch) -> bool:
    """The list of a CUDA device, of the CPU, and of the CPU with many particles."""
    if request.param == "half in blocks":
        monkeypatch.setattr("gpudem.solver.solver.block_size", lambda n, layers: 60)
    return request.param != "full"


@pytest.mark.parametrize(
    ("kind", "ratio", "size", "periodic"),
    [
        ("log-uniform", 3, (0.6, 0.5, 0.7), OPEN),
        ("log-uniform", 10, (0.5, 0.6, 0.7), CLOSED),
        ("log-uniform", 200, (0.7, 0.6, 0.5), CLOSED),
        ("two sizes", 10, (0.5, 0.9, 0.3), TWO_SIDES),
        ("two sizes", 50, (0.25, 0.26, 0.7), CLOSED),  # two cells of the large ones across: each once
        ("equal volumes", 50, (0.3, 0.3, 0.3), OPEN),
        ("equal volumes", 20, (0.3, 0.25, 0.4), CLOSED),
        ("one large", 50, (0.25, 0.3, 0.26), TWO_SIDES),
        ("one large", 200, (0.3, 0.25, 0.26), CLOSED),
    ],
)
def test_equals_all_pairs(kind, ratio, size, periodic, half_list, monkeypatch):
    """Detects a class searched within the reach of another, a row or a wrapped part missed, a pair twice."""
    monkeypatch.setattr(size_classes, "ROW_COST", 0.01)  # many classes
    scene = cloud(radii_of(kind, ratio, 900), size, periodic, seed=ratio)
    simulation = Solver(scene.replace(solver={"skin": 0.02}), half_list=half_list)
    simulation.neighbors.rebuild()
    expected = all_pairs(simulation.scene)
    assert simulation.neighbors.tuning()["size_classes"] > 1
    assert len(listed_pairs(simulation) ^ expected) == 0  # as a set it would be printed for minutes
    assert len(expected) > 300


# -- motion ------------------------------------------------------------------------------------------------


def bed_with_large_balls() -> Scene:
    """Two spinning balls, 20 times as large as the others, fall into a layer of these on a floor."""
    rng = np.random.default_rng(4)
    grid = 2.02e-3 * np.array([(i, j, k) for k in range(3) for j in range(12) for i in range(12)])
    small = grid + np.array([0.002, 0.002, 0.00101]) + rng.uniform(-1e-5, 1e-5, grid.shape)
    radius = np.r_[np.full(len(small), 0.001), 0.02, 0.02]
    velocity = np.r_[rng.normal(0, 0.05, small.shape), [(0.3, 0, -0.6), (0, 0.4, -0.5)]]
    return Scene(
        name="sizes", materials={"ball": MATERIALS["ball"], "wall": MATERIALS["wall"]},
        pairs=[
            {"materials": ("ball", name), "restitution": 0.5, "friction": 0.4} for name in ("ball", "wall")
        ],
        particles={
            "source": "explicit", "material": "ball", "radius": radius, "velocity": velocity,
            "position": np.r_[small, [(0.012, 0.012, 0.0272), (0.014, 0.018, 0.0685)]],
            "angular_velocity": rng.normal(0, 5, (len(radius), 3)),
        },
        gravity=(0, 0, -9.81),
        walls=[FLOOR],
        domain={"lo": (-0.1, -0.1, -0.001), "hi": (0.13, 0.13, 0.12)},
        time={"step": 2e-6, "duration": 0.002}, solver={"skin": 1e-4},
    )  # fmt: skip


def run(steps: int = 600, **options) -> Solver:
    simulation = Solver(bed_with_large_balls(), **{"threads": 1, **options})
    simulation.start()
    simulation.advance(steps - 1)
    simulation.write_step()
    return simulation


@pytest.fixture(scope="module")
def one_class() -> Solver:
    """The run with one class, whatever the sizes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(size_classes, "CLASS_RATIO", 1e9)
        simulation = run()
    assert not simulation.spec.size_classes
    return simulation


def test_same_motion_as_with_one_class(one_class, half_list):
    """The same pairs in another order of addition. Detects history lost, doubled or reversed at a rebuild."""
    simulation = run(half_list=half_list)
    assert simulation.spec.size_classes
    assert simulation.neighbors.rebuilds > 5
    assert simulation.contact_count() > 200
    here, there = simulation.frame(), one_class.frame()
    springs = simulation.state.particles.spring.numpy()
    assert np.abs(springs).max() > 1e-7
    for name in ("position", "velocity", "angular_velocity", "force", "torque"):
        scale = np.abs(there[name]).max()
        assert np.abs(here[name] - there[name]).max() < 1e-9 * scale, name


def test_threads_and_restart_are_bit_identical(monkeypatch):
    """Detects an order of entries that depends on threads, and cells not made anew for the stored blocks."""
    with monkeypatch.context() as patch:
        patch.setattr("gpudem.solver.solver.block_size", lambda n, layers: 60)
        whole, threads = run(), run(threads=2)
        half = Solver(bed_with_large_balls(), threads=1)
        half.start()
        half.advance(300)
        stored = half.state_dict()
    second = Solver(bed_with_large_balls(), threads=1)
    second.load_state_dict(stored)
    second.advance(299)
    second.write_step()
    assert second.neighbors.rebuilds == whole.neighbors.rebuilds > stored["counts"][1] > 1
    for other in (threads, second):
        for name, values in whole.frame().items():
            assert np.array_equal(values, other.frame()[name]), name


def test_rebuilt_within_a_graph():
    """Bit for bit as by the host. Detects cells that only the host's rebuild sets."""
    plain, inside = run(half_list=False), run(half_list=False, chunk=32, rebuild_in_graph=True)
    assert plain.neighbors.rebuilds == inside.neighbors.rebuilds > 5
    for name, values in plain.frame().items():
        assert np.array_equal(values, inside.frame()[name]), name


# -- classes and their cost --------------------------------------------------------------------------------


def test_classes():
    """Detects equal spheres that pay for classes, a class without a particle, a largest radius left out."""
    assert class_radii(np.full(9, 0.003), 0.001).tolist() == [0.003]
    assert class_radii(np.array([1.0, CLASS_RATIO, 1.5]), 0.3).tolist() == [CLASS_RATIO]
    assert class_radii(np.r_[np.full(5000, 1.0), 50.0], 0.3).tolist() == [1.0, 50.0]
    assert class_radii(np.r_[np.full(5000, 1.0), 2.1, 50.0], 0.3)[-1] == 50.0
    assert class_radii(np.array([1.0, 2.1]), 0.3).tolist() == [2.1]  # two particles: nothing to search
    many = np.random.default_rng(1).lognormal(0, 0.6, 5000)
    tops = class_radii(many, 0.3)
    assert tops[-1] == many.max()
    assert (np.diff(tops) > 0).all()
    assert 1 < len(tops) < 8


@pytest.mark.parametrize("ratio", [10, 50, 200])
def test_default_skin_and_list_of_small_particles(ratio):
    """Detects 0.3 of the largest radius as skin: each small particle would list 100 neighbors and more."""
    assert default_skin(np.array([0.001, 0.002])) == 0.3 * 0.002
    radius = np.r_[np.full(3000, 0.001), 0.001 * ratio]
    side = 2.2e-3 * 3000 ** (1 / 3)
    position = np.random.default_rng(1).uniform(0, side, (3001, 3))
    scene = cloud(radius, (side,) * 3, OPEN, seed=1).replace(particles={"position": position})
    assert scene.skin == pytest.approx(0.0003, rel=0.07)
    simulation = Solver(scene)
    simulation.neighbors.rebuild()
    lengths = np.sort(np.diff(simulation.state.particles.start.numpy()))
    assert 1 < lengths[:-1].mean() < 10


def work(simulation: Solver) -> tuple[float, float]:
    """Rows of cells that a particle looks up, and distances that it computes, on average, for a full list."""
    neighbors, p = simulation.neighbors, simulation.params
    scene, start = simulation.scene, neighbors.cell_start.numpy()
    fast, middle, slow = p.axes
    rows = distances = 0
    for x, radius in zip(scene.state.position, scene.state.radius, strict=True):
        for grid in neighbors.grids.numpy():
            reach = radius + grid["radius"] + scene.skin
            rate, cells = grid["inv_cell_size"], grid["cells"]
            first = np.maximum(np.floor((x - reach - scene.domain.lo) * rate), 0).astype(int)
            last = np.minimum(np.floor((x + reach - scene.domain.lo) * rate), cells - 1).astype(int)
            b, c = np.meshgrid(*(range(first[k], last[k] + 1) for k in (middle, slow)))
            slab, layer = np.divmod(c, grid["layers"])
            row = slab * grid["slab_keys"] + grid["first"] + (layer * cells[middle] + b) * cells[fast]
            rows += row.size
            distances += int((start[row + last[fast] + 1] - start[row + first[fast]]).sum())
    return rows / len(scene.state), distances / len(scene.state)


@pytest.mark.parametrize("kind", ["one large", "equal volumes"])
def test_work_is_near_that_of_equal_sizes(kind):
    """Equal spheres look up 9 rows and compute some 40 distances each, with one class up to 1500 here."""
    radius = radii_of(kind, 50, 1500)
    side = (4 / 3 * np.pi * (radius**3).sum() / 0.5) ** (1 / 3)
    scene = cloud(radius, (side,) * 3, OPEN, seed=1)
    if kind == "one large":  # as dense as a bed around it
        side = 0.05 + 1500 ** (1 / 3) * 0.002
        scene = cloud(radius, (side,) * 3, OPEN, seed=1)
    simulation = Solver(scene)
    simulation.neighbors.rebuild()
    rows, distances = work(simulation)
    assert 4 < rows < 20
    assert 2 < distances < 100
    assert simulation.neighbors.cells < 8 * 1500 + 4096 * len(simulation.neighbors.grids)


def test_list_grows_once(monkeypatch):
    """A large particle with thousands of neighbors: the list gets room for all of them at once."""
    capacities = []
    allocate = NeighborList._allocate
    monkeypatch.setattr(
        NeighborList, "_allocate", lambda self, n: (capacities.append(n), allocate(self, n))[1]
    )
    radius = np.r_[np.full(1500, 0.001), 0.05]
    position = np.random.default_rng(2).uniform(0, 0.06, (1501, 3))
    scene = cloud(radius, (0.06, 0.06, 0.06), OPEN, seed=3)
    scene = scene.replace(particles={"position": position}, solver={"skin": 0.02})
    simulation = Solver(scene)
    for _ in range(3):
        simulation.neighbors.rebuild()
    assert len(capacities) == 2
    assert len(listed_pairs(simulation) ^ all_pairs(scene)) == 0
