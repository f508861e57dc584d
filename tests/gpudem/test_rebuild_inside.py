"""Chunks of launches, and rebuilds that the host does not wait for, as on a GPU: the same to the last bit."""

import numpy as np
import pytest

from gpudem.errors import SimulationError
from gpudem.scene import Scene
from gpudem.solver.device import wp
from gpudem.solver.neighbor_kernels import cell_start_threads, cell_starts
from gpudem.solver.neighbor_list import NeighborList
from gpudem.solver.solver import Solver
from tests.gpudem.beds import falling_bed, finish, same
from tests.gpudem.test_failures import escaping
from tests.gpudem.test_neighbor_list import layers
from tests.gpudem.test_vibration import shaken_bed


def end(scene: Scene, graphs: bool = False, **options) -> tuple[dict[str, np.ndarray], int]:
    """The last frame, and how many rebuilds there were."""
    simulation = Solver(scene, **{"threads": 1, "half_list": False, **options})
    simulation.graphs = graphs
    frame = finish(simulation)
    assert bool(simulation._graphs) == graphs
    return frame, simulation.neighbors.rebuilds


@pytest.mark.parametrize(
    "options",
    [
        {"chunk": 32}, {"chunk": 7}, {"chunk": 32, "graphs": True}, {"chunk": 7, "graphs": True},
        {"chunk": 32, "threads": 2}, {"chunk": 32, "half_list": True},
    ],
    ids=lambda options: ", ".join(f"{k} {v}" for k, v in options.items()),
)  # fmt: skip
def test_bit_identical(options, monkeypatch):
    """With looks after every step, or none within a chunk; `graphs`: replayed as recorded.

    Catches a rebuild that leaves arrays on the wrong side, is not asked for, is asked for twice, loses
    springs; launches after it was asked for that go on; steps counted wrong.
    """
    scene = falling_bed(800, time={"step": 2e-5, "duration": 0.034})
    half = {"half_list": options.get("half_list", False)}
    plain, often = end(scene, **half)
    by_host, rebuild = [], NeighborList.rebuild
    monkeypatch.setattr(NeighborList, "rebuild", lambda self: (by_host.append(1), rebuild(self)))
    inside, within = end(scene, rebuild_in_graph=True, **options)
    same(plain, inside)
    assert often == within > 30
    assert len(by_host) < 0.1 * within, "the host waited"


@pytest.mark.parametrize("amplitude", [0.0, 0.0007])
def test_with_a_moving_floor(amplitude):
    """Catches touches and rises of a floor that stay where their particle was before the rebuild."""
    scene = shaken_bed(800, amplitude, time={"step": 4e-5, "duration": 0.04})
    (plain, often), (inside, within) = end(scene), end(scene, chunk=32, rebuild_in_graph=True)
    same(plain, inside)
    assert often == within > 10


@pytest.mark.parametrize("graphs", [False, True])
def test_a_list_that_grows(graphs, monkeypatch):
    """No room for the list: the chunk launched with the rebuild does nothing, and the host finishes the list.

    Catches steps done on half a list, a second search that loses the order of the old springs, a graph that
    still points to the smaller arrays.
    """
    finished, finish_suspended = [], NeighborList.finish_suspended
    monkeypatch.setattr(
        NeighborList, "finish_suspended", lambda self: (finished.append(1), finish_suspended(self))
    )
    (plain, _), (inside, _) = end(layers()), end(layers(), graphs, chunk=32, rebuild_in_graph=True)
    assert finished
    same(plain, inside)


def test_chunks_end_where_the_list_does(monkeypatch):
    """Few launches do nothing, and few chunks are needed, once it is known how long a list holds.

    Catches chunks that are cut without regard to the last list: then half of the longest chunk is launched
    for nothing at each rebuild, or the host looks after every few steps.
    """
    chunks, launch = [], Solver._launch_chunk

    def listen(self: Solver, steps: int) -> int:
        chunks.append((steps, launch(self, steps)))
        return chunks[-1][1]

    monkeypatch.setattr(Solver, "_launch_chunk", listen)
    scene = falling_bed(800, time={"step": 2e-5, "duration": 0.034})
    _, rebuilds = end(scene, chunk=64, rebuild_in_graph=True)
    launched, done = np.array(chunks).sum(axis=0)
    assert done > 0.9 * scene.n_steps
    assert launched - done < 0.1 * done
    assert len(chunks) < 1.6 * rebuilds


def test_what_is_wrong_is_said_as_ever():
    """Catches a lost particle that goes unnoticed, or is told at another step."""
    told = []
    for options in ({}, {"chunk": 32, "rebuild_in_graph": True}):
        with pytest.raises(SimulationError) as error:
            end(escaping(), **options)
        told.append(str(error.value))
    assert told[0] == told[1]
    assert "left the domain" in told[0]


@pytest.mark.parametrize("cells", [1, 31, 32, 33, 500])
@pytest.mark.parametrize("n", [0, 1, 70])
@pytest.mark.parametrize("exits", [0, 3])
def test_cell_starts(n, cells, exits):
    """Catches a cell between two particles that are far apart, before the first or behind the last, whose
    start nobody writes; a particle that leaves, whose key is beyond the cells, counted as one of a cell.
    """
    random = np.random.default_rng(n + cells)
    for share in (1.0, 0.1):
        keys = np.sort(random.integers(int(cells * (1 - share)), cells + exits, n)).astype(np.int32)
        given, starts = wp.array(keys, device="cpu"), wp.full(cells + 1, -1, device="cpu")
        wp.launch(
            cell_starts,
            cell_start_threads(n, cells),
            inputs=[n, cells, given],
            outputs=[starts],
            device="cpu",
        )
        assert np.array_equal(starts.numpy(), np.searchsorted(keys, np.arange(cells + 1)))
