"""The search for start overlaps by size class, against every pair; its cost at sizes 1:50 and in a crowd."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from gpudem.scene import overlaps
from gpudem.scene.overlaps import Overlaps, find_overlaps
from tests.counting import calls


def brute_force(
    position: np.ndarray, radius: np.ndarray, period: np.ndarray, limit: float
) -> Overlaps | None:
    """The definition, pair by pair, with the nearest image."""
    i, j = np.triu_indices(len(radius), 1)
    d = position[i] - position[j]
    d -= period * np.round(d / np.where(period > 0, period, 1.0))
    overlap = radius[i] + radius[j] - np.linalg.norm(d, axis=1)
    share = overlap / np.minimum(radius[i], radius[j])
    k = int(np.argmax(share))
    if share[k] <= limit:
        return None
    return Overlaps(int((share > limit).sum()), True, (int(i[k]), int(j[k])), float(overlap[k]))


SIZES = {
    "equal": lambda rng, n: np.full(n, 0.02),
    "continuous 1:30": lambda rng, n: 0.004 * 30 ** rng.uniform(0, 1, n) ** 2,
    "1:1000": lambda rng, n: np.where(rng.uniform(size=n) < 0.02, 0.1, 1e-4 * rng.uniform(0.5, 1, n)),
    "powers of two": lambda rng, n: 0.05 * 2.0 ** -rng.integers(0, 7, n),
}


@pytest.mark.parametrize("periodic", [(0, 0, 0), (1, 0, 0), (1, 0, 1), (1, 1, 1)])
@pytest.mark.parametrize("sizes", SIZES)
@pytest.mark.parametrize("crowd", [60, -1e9], ids=["open", "crowded"])
def test_against_every_pair(
    sizes: str, periodic: tuple[int, int, int], crowd: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Catches a pair missed or counted twice between classes, over a side, an edge or a corner, and a limit
    by the larger radius; once with the search that takes any number of pairs, in many small pieces.
    """
    monkeypatch.setattr(overlaps, "CROWD", crowd)
    monkeypatch.setattr(overlaps, "PIECE", 300_000 if crowd > 0 else 50)
    rng, found_some = np.random.default_rng(5), 0
    for limit in (0.1, 0.9):
        radius = SIZES[sizes](rng, 400)
        period = np.array(periodic) * np.array([1.0, 0.9, 1.1])
        position = rng.uniform(0, 1, (400, 3)) * [1.0, 0.9, 1.1]
        found, expected = (
            find_overlaps(position, radius, period, limit),
            brute_force(position, radius, period, limit),
        )
        if expected is None or found is None:
            assert found is expected
            continue
        found_some += expected.count
        assert (found.count, found.complete, found.worst) == (expected.count, True, expected.worst)
        assert found.overlap == pytest.approx(expected.overlap, abs=1e-15)
    assert found_some > 10


def bed(side: int, ratio: float) -> tuple[np.ndarray, np.ndarray]:
    """side^3 balls of 1 mm on a lattice, and one `ratio` times as large beside them, without overlap."""
    grid = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), -1).reshape(-1, 3)
    position = np.vstack([2.1e-3 * grid, [[-ratio * 1e-3 - 0.002, 0.03, 0.03]]])
    return position - position.min(axis=0), np.append(np.full(side**3, 1e-3), ratio * 1e-3)


@pytest.mark.parametrize(("side", "ratio"), [(14, 50.0), (12, 1000.0)])
def test_one_large_ball_costs_little(side: int, ratio: float) -> None:
    """Memory as with equal sizes. A search of all within the reach of the largest takes gigabytes here."""
    peaks = []
    for position, radius in (bed(side, 1.0), bed(side, ratio)):
        tracemalloc.start()
        assert calls(find_overlaps, position, radius, np.zeros(3), 0.1) < 1000
        assert find_overlaps(position, radius, np.zeros(3), 0.1) is None
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 2 * peaks[0]


def test_all_in_one_place() -> None:
    """30 000 balls at one point are 450 million pairs: enough are counted, in bounded memory and time."""
    tracemalloc.start()
    found = find_overlaps(np.full((30_000, 3), 0.5), np.full(30_000, 1e-3), np.zeros(3), 0.1)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert found is not None
    assert found.count >= overlaps.ENOUGH
    assert not found.complete
    assert found.overlap == 2e-3
    assert peak < 1e8
