"""The list in slices of 32 particles: where entries lie, that padding is never read, and how it is saved."""

import numpy as np
import pytest

from gpudem.scene import Scene
from gpudem.solver.list_layout import first_places, packed, places, spread
from gpudem.solver.solver import Solver
from gpudem.solver.spec import Spec
from tests.gpudem.beds import falling_bed, finish, same
from tests.gpudem.on_cpu import apart
from tests.gpudem.test_mesh_everything import mesh, sides

SHORT = {"step": 2e-5, "duration": 0.016}
WALLS = falling_bed().walls


def bed(walls: object = WALLS[:1], **changes) -> Scene:
    return falling_bed(700, walls=walls, time=SHORT, **changes)


def lists(n: int, longest: int) -> dict[str, np.ndarray]:
    """Lists of random lengths, some of them empty, of n particles; part of each are walls."""
    rng = np.random.default_rng(n)
    length = rng.integers(0, longest + 1, n) * (rng.random(n) < 0.9)
    start = np.concatenate([[0], np.cumsum(length)]).astype(np.int32)
    walls = (rng.random(n) * length).astype(np.int32)
    return {
        "start": start, "wall_start": start[1:] - walls,
        "neighbor": rng.integers(-n, n, start[-1]), "spring": rng.normal(size=(start[-1], 3)),
    }  # fmt: skip


@pytest.mark.parametrize("n", [1, 31, 32, 33, 100])
def test_places_of_a_full_list_in_slices(n):
    """Entry m of the 32 particles of a slice side by side, padded to the longest of the slice. Detects slices
    that overlap, a last slice without room, entries of one particle next to each other.
    """
    spec, given = Spec(walls=("plane",), tangential="history"), lists(n, 9)
    found, length = spread(spec, given), np.diff(given["start"])
    for i in range(n):
        for m in range(length[i]):
            at = found["start"][i // 32] + 32 * m + i % 32
            assert found["neighbor"][at] == given["neighbor"][given["start"][i] + m]
            assert (found["spring"][at] == given["spring"][given["start"][i] + m]).all()
    width = np.diff(found["start"])
    assert (width == [32 * length[k : k + 32].max() for k in range(0, n, 32)]).all()
    assert len(found["neighbor"]) == width.sum()
    ahead = (found["wall_start"] - first_places(spec, found["start"], n)) // 32
    assert (ahead == given["wall_start"] - given["start"][:-1]).all()


@pytest.fixture(params=["plane", "mesh"])
def running(request) -> Solver:
    solver = Solver(bed() if request.param == "plane" else bed([mesh(sides("xyz"))]), half_list=False)
    solver.start()
    return solver


def test_the_device_lays_a_list_out_as_the_host_does(running):
    """After some rebuilds. Detects a slice wider or narrower than its longest list, a length that is not that
    of the list, walls that begin elsewhere.
    """
    running.advance(500)
    p = running.state.particles
    expected = spread(running.spec, packed(running.state))
    for name in ("start", "count", "wall_start"):
        assert (getattr(p, name).numpy() == expected[name]).all(), name
    at = places(first_places(running.spec, p.start.numpy(), 700), p.count.numpy(), 32)
    assert (p.neighbor.numpy()[at] == expected["neighbor"][at]).all()
    assert len(set(np.unique(p.count.numpy()))) > 5
    assert np.count_nonzero(p.neighbor.numpy()[at] < 0) > 100


@pytest.mark.parametrize("rule", ["unique", "liggghts"])
def test_triangles_of_a_full_list_are_those_of_a_half_list(rule):
    """Before rounding has grown. Detects triangles within reach that are looked for at other places."""
    scene = bed([mesh(sides("xyz"))], contact={"mesh_contacts": rule})
    half, full = (finish(Solver(scene, half_list=choice)) for choice in (True, False))
    assert apart(half, full) < 1e-9
    assert np.abs(full["angular_velocity"]).max() > 1


def test_padding_is_never_read(running):
    """Behind its entries every list holds the last of them again, a wall in contact or its first wall, with a
    spring that is no number. Detects a loop that goes on into the padding, in a step or at a rebuild.
    """
    running.advance(300)
    p, rebuilds, n = running.state.particles, running.neighbors.rebuilds, 700
    first, count = first_places(running.spec, p.start.numpy(), n), p.count.numpy()
    room = np.repeat(np.diff(p.start.numpy()) // 32, 32)[:n] - count
    behind = places(first + 32 * count, room, 32)
    last = p.neighbor.numpy()[first + 32 * np.maximum(count - 1, 0)]
    last = np.maximum(np.where(last < 0, -last - 1, last), n)
    p.neighbor.numpy()[behind] = -np.repeat(last, room) - 1
    p.spring.numpy()[behind] = np.nan
    assert len(behind) > 300
    running.advance(799 - 300)
    running.write_step(last=True)
    assert running.neighbors.rebuilds > rebuilds + 3
    same(finish(Solver(running.scene, half_list=False)), running.frame())


def test_a_saved_state_does_not_depend_on_the_layout(running):
    """One particle after the other, as before there were slices. Detects a file for this layout alone."""
    running.advance(300)
    saved, n = running.state_dict(), 700
    assert saved["start"].shape == (n + 1,)
    assert len(saved["neighbor"]) == len(saved["spring"]) == saved["start"][-1]
    assert "count" not in saved
    other = Solver(running.scene, half_list=False)
    other.load_state_dict(saved)
    again = other.state_dict()
    assert saved.keys() == again.keys()
    for name in saved:
        assert np.array_equal(saved[name], again[name]), name
