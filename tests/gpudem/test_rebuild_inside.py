"""The list rebuilt between two launches of a chunk, as within a GPU's graph: the same to the last bit."""

import numpy as np
import pytest

from gpudem.errors import SimulationError
from gpudem.scene import Scene
from gpudem.solver.device import wp
from gpudem.solver.neighbor_list import NeighborList
from gpudem.solver.scan import GROUP, ExclusiveScan
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

    Catches a rebuild that leaves the arrays swapped, is not asked for, is asked for twice, loses springs; a
    condition that the recording has settled once for all; steps counted wrong.
    """
    scene = falling_bed(800, time={"step": 2e-5, "duration": 0.034})
    half = {"half_list": options.get("half_list", False)}
    plain, often = end(scene, **half)
    by_host, rebuild = [], NeighborList.rebuild
    monkeypatch.setattr(NeighborList, "rebuild", lambda self: (by_host.append(1), rebuild(self)))
    inside, within = end(scene, rebuild_in_graph=True, **options)
    same(plain, inside)
    assert often == within > 30
    assert len(by_host) < 0.4 * within, "not within the chunk"


@pytest.mark.parametrize("amplitude", [0.0, 0.0007])
def test_with_a_moving_floor(amplitude):
    """Catches touches and rises of a floor that stay where their particle was before the rebuild."""
    scene = shaken_bed(800, amplitude, time={"step": 4e-5, "duration": 0.04})
    (plain, often), (inside, within) = end(scene), end(scene, chunk=32, rebuild_in_graph=True)
    same(plain, inside)
    assert often == within > 10


@pytest.mark.parametrize("graphs", [False, True])
def test_a_list_that_grows(graphs, monkeypatch):
    """No room amid a chunk: nothing more is done there, and the host goes on from half way.

    Catches steps done on half a list, a second search that loses the order of the old springs, a graph that
    still points to the smaller arrays.
    """
    gone_on, stopped = [], NeighborList.is_suspended

    def listen(self: NeighborList) -> bool:
        gone_on.append(stopped(self))
        return gone_on[-1]

    monkeypatch.setattr(NeighborList, "is_suspended", listen)
    (plain, _), (inside, _) = end(layers()), end(layers(), graphs, chunk=32, rebuild_in_graph=True)
    assert any(gone_on)
    same(plain, inside)


@pytest.mark.parametrize("fails", ["capture_if", "capture_launch"])
def test_a_driver_that_takes_no_branch(fails, monkeypatch):
    """Refused as it is recorded, or when it is first launched: the host rebuilds, says so, and nothing else
    changes. Catches arrays left swapped by half a recording, steps lost, a fallback that nobody is told of.
    """
    refused, takes = [], getattr(wp, fails)

    def refuse(*given, **options):
        if not refused or fails == "capture_if":
            refused.append(given)
            raise RuntimeError("no conditional nodes")
        return takes(*given, **options)

    scene = falling_bed(800, time={"step": 2e-5, "duration": 0.034})
    plain, often = end(scene)
    monkeypatch.setattr(wp, fails, refuse)
    with pytest.warns(UserWarning, match="not within: no conditional nodes") as told:
        instead, by_host = end(scene, graphs=True, chunk=32, rebuild_in_graph=True)
    same(plain, instead)
    assert often == by_host
    assert len(told) == len(refused) == 1


def test_what_is_wrong_is_said_as_ever():
    """Catches a lost particle that goes unnoticed, or is told at another step."""
    told = []
    for options in ({}, {"chunk": 32, "rebuild_in_graph": True}):
        with pytest.raises(SimulationError) as error:
            end(escaping(), **options)
        told.append(str(error.value))
    assert told[0] == told[1]
    assert "left the domain" in told[0]


@pytest.mark.parametrize("n", [1, 63, 64, 65, 4095, 4096, 4097, 300_000])
def test_exclusive_scan(n):
    """Catches a group left out or counted twice at the edge of a level."""
    values = np.random.default_rng(n).integers(0, 30, n).astype(np.int32)
    given, starts = wp.array(values, device="cpu"), wp.zeros(n, dtype=wp.int32, device="cpu")
    scan = ExclusiveScan(given, starts)
    scan.run()
    assert np.array_equal(starts.numpy(), np.cumsum(values) - values)
    assert len(scan.levels[-1][0]) <= GROUP
