"""The neighbour list against all pairs. Catches off-by-one cells, missed images, a reach too short."""

import numpy as np
import pytest

from gpudem.scene import Scene
from gpudem.solver.list_layout import packed
from gpudem.solver.neighbor_list import NeighborList, block_size, cell_grid
from gpudem.solver.solver import Solver
from tests.gpudem.beds import MATERIALS

PAIR = [{"materials": ("ball", "ball"), "restitution": 0.9, "friction": 0.0}]


def cloud(
    radii: np.ndarray, size: tuple[float, float, float], periodic: tuple[bool, bool, bool], seed: int
) -> Scene:
    position = np.random.default_rng(seed).uniform(0, 1, (len(radii), 3)) * np.array(size)
    return Scene(
        name="cloud", materials={"ball": MATERIALS["ball"]}, pairs=PAIR, allow=["overlap"],
        particles={"source": "explicit", "material": "ball", "radius": radii, "position": position},
        domain={"lo": (0, 0, 0), "hi": size, "periodic": periodic},
        time={"step": 1e-7, "duration": 1e-6},
    )  # fmt: skip


def listed_pairs(simulation: Solver) -> set[tuple[int, int]]:
    """What the list stands for, in both orders; a half list leaves out j before i in the same block."""
    p = simulation.state.particles
    ids, listed = p.id.numpy(), packed(simulation.state)
    start, entries = listed["start"], listed["neighbor"]
    owner = np.repeat(np.arange(simulation.state.n), np.diff(start))
    other = np.where(entries < 0, -entries - 1, entries)
    if simulation.spec.half_list:
        block = simulation.params.block
        within = owner // block == other // block
        assert (owner[within] < other[within]).all()
        owner, other = np.r_[owner, other[within]], np.r_[other, owner[within]]
    pairs = list(zip(ids[owner].tolist(), ids[other].tolist(), strict=True))
    assert len(pairs) == len(set(pairs))  # nobody twice
    return set(pairs)


@pytest.fixture(params=["full", "half", "half in blocks"])
def half_list(request, monkeypatch) -> bool:
    """The list of a CUDA device, of the CPU, and of the CPU with many particles."""
    if request.param == "half in blocks":
        monkeypatch.setattr("gpudem.solver.solver.block_size", lambda n, layers: 60)
    return request.param != "full"


def all_pairs(scene: Scene) -> set[tuple[int, int]]:
    x, r = scene.state.position, scene.state.radius
    d = x[:, None] - x[None]
    size = np.array(scene.domain.hi) - np.array(scene.domain.lo)
    d -= np.where(scene.domain.periodic, size * np.round(d / size), 0.0)
    near = (d**2).sum(axis=2) < (r[:, None] + r[None] + scene.skin) ** 2
    np.fill_diagonal(near, False)
    return {(int(i), int(j)) for i, j in np.argwhere(near)}


@pytest.mark.parametrize(
    ("ratio", "size", "periodic"),
    [
        (1, (0.1, 0.1, 0.1), (False, False, False)),
        (1, (0.1, 0.1, 0.1), (True, True, True)),
        (1, (0.1, 0.0161, 0.1), (False, True, False)),  # two cells across
        (1, (0.0161, 0.0241, 0.1), (True, True, False)),  # two and three cells across
        (1, (0.1, 0.05, 0.0321), (True, True, True)),  # slowest along x, fastest along z, four cells
        (5, (0.2, 0.2, 0.2), (True, False, True)),
        (50, (0.5, 0.5, 0.5), (True, True, True)),
    ],
)
def test_equals_all_pairs(ratio, size, periodic, half_list):
    rng = np.random.default_rng(ratio)
    radii = np.full(400, 0.003) if ratio == 1 else 0.1 * size[0] * ratio ** -rng.uniform(0, 1, 400)
    scene = cloud(radii, size, periodic, seed=ratio)
    simulation = Solver(scene, half_list=half_list)
    simulation.neighbors.rebuild()
    expected = all_pairs(scene)
    assert len(listed_pairs(simulation) ^ expected) == 0  # as a set it would be printed for minutes
    assert len(expected) > 100


def test_law_that_acts_across_a_gap(half_list, monkeypatch):
    """Detects cells as wide as the diameter and the skin only: neighbors two cells away are in range."""
    reach = 0.002
    monkeypatch.setattr(Scene, "contact_range", property(lambda scene: reach))
    scene = cloud(np.full(400, 0.003), (0.1, 0.1, 0.1), (False, True, False), seed=1)
    scene = scene.replace(solver={"skin": 1e-4})
    simulation = Solver(scene, half_list=half_list)
    simulation.neighbors.rebuild()
    found, skin = listed_pairs(simulation), scene.skin
    monkeypatch.setattr(Scene, "skin", property(lambda scene: skin + reach))
    assert len(found ^ all_pairs(scene)) == 0


def test_list_grows(half_list):
    """2000 neighbours a particle do not fit the first allocation."""
    scene = cloud(np.full(300, 0.003), (0.01, 0.01, 0.01), (False, False, False), seed=1)
    simulation = Solver(scene, half_list=half_list)
    simulation.neighbors.rebuild()
    assert len(listed_pairs(simulation) ^ all_pairs(scene)) == 0
    assert simulation.neighbors.capacity > 16 * 300


def layers() -> Scene:
    """Layers of spinning, touching balls close up: 8 neighbours each at first, then more than 16."""
    grid = 0.0059 * np.array([(i, j) for i in range(6) for j in range(6)])
    position = [(x, y, 0.03 + 0.0125 * k) for k in range(4) for x, y in grid]
    return Scene(
        name="layers", materials={"ball": MATERIALS["ball"]}, pairs=[{**PAIR[0], "friction": 0.4}],
        particles={
            "source": "explicit", "material": "ball", "radius": 0.003, "position": position,
            "velocity": [(0, 0, 0.2 * (1.5 - k)) for k in range(4) for _ in grid],
            "angular_velocity": np.random.default_rng(5).normal(0, 20, (144, 3)),
        },
        domain={"lo": (0, 0, 0), "hi": (0.0354, 0.0354, 0.1), "periodic": (True, True, False)},
        solver={"skin": 0.006}, time={"step": 2e-5, "duration": 0.024},
    )  # fmt: skip


def test_springs_outlive_a_list_that_grows(monkeypatch, half_list):
    """Bit for bit the same as with room from the start. Catches springs that the old list still held."""

    def end(room: int) -> tuple[np.ndarray, bool]:
        allocate = NeighborList._allocate
        grown = []

        def roomy(self: NeighborList, capacity: int) -> None:
            grown.append(self.rebuilds)
            allocate(self, room * capacity)

        with monkeypatch.context() as patch:
            patch.setattr(NeighborList, "_allocate", roomy)
            simulation = Solver(layers(), threads=1, half_list=half_list)
            simulation.start()
            simulation.advance(layers().n_steps - 1)
            simulation.write_step()
        assert np.abs(simulation.state.particles.spring.numpy()).max() > 1e-7
        return simulation.frame()["angular_velocity"], max(grown) > 1

    (tight, grew), (roomy, stayed) = end(1), end(8)
    assert grew
    assert not stayed
    assert np.array_equal(tight, roomy)


def test_cells_of_a_large_empty_domain_are_few():
    scene = cloud(np.full(10, 0.003), (1.0, 1.0, 1.0), (False, False, False), seed=1)
    large = scene.replace(domain={"hi": (1000.0, 1000.0, 1000.0)})
    cells, _ = cell_grid(large)
    assert np.prod(cells) <= 2 * 10 + 4096


def test_sorted_slowest_along_the_longest_extent():
    """Catches layers taken from the domain, which may be mostly empty, or the longest axis sorted fastest."""
    scene = cloud(np.full(400, 0.003), (0.3, 0.05, 0.1), (False, False, False), seed=3)
    wide = scene.replace(domain={"lo": (0, 0, 0), "hi": (0.3, 0.05, 3.0)})
    simulation = Solver(wide)
    simulation.neighbors.rebuild()
    assert simulation.neighbors.tuning()["slowest_first"] == "xzy"
    x = simulation.state.now.numpy()["position"][:, 0]
    assert (np.diff(x) > -wide.skin - 0.006 - 0.3 / simulation.params.cells[0]).all()
    assert listed_pairs(simulation) == all_pairs(wide)


@pytest.mark.parametrize(("layers", "blocks"), [(7.9, 1), (16.0, 2), (31.0, 2), (64.0, 8), (1e4, 64)])
def test_blocks_are_eight_layers_or_more(layers, blocks):
    """Catches blocks so thin that most pairs lie across."""
    assert -(-100_000 // block_size(100_000, layers)) == blocks
    assert block_size(900, layers) == 900


def test_crossings_stay_with_their_particle():
    """Small balls fly freely through periodic sides and are sorted anew: unwrapped, each is at x + v t.

    Detects: counts of crossings that stay at a place of the sorted order, or count the wrong way.
    """
    rng, n = np.random.default_rng(5), 60
    x, v = rng.uniform(0, 0.05, (n, 3)), rng.uniform(-20, 20, (n, 3))
    scene = Scene(
        name="free", materials={"ball": MATERIALS["ball"]}, pairs=PAIR,
        particles={"source": "explicit", "material": "ball", "radius": 1e-5, "position": x, "velocity": v},
        domain={"lo": (0, 0, 0), "hi": (0.05, 0.05, 0.05), "periodic": (True, True, True)},
        time={"step": 4e-7, "duration": 8e-3}, solver={"skin": 2e-3}, allow=["time_step", "speed"],
    )  # fmt: skip
    solver = Solver(scene)
    solver.start(write=True)
    solver.advance(scene.n_steps - 1)
    solver.write_step()
    unwrapped = solver.column("unwrapped_position")
    solver.close()
    assert np.abs(unwrapped - scene.state.position).max() > 2 * 0.05
    assert np.abs(unwrapped - (scene.state.position + v * 8e-3)).max() < 1e-9
