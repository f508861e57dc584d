"""Several threads a particle: as one thread but for the rounding of a sum in another order."""

import numpy as np
import pytest

from gpudem.solver.solver import Solver
from tests.gpudem.beds import falling_bed, finish, same
from tests.gpudem.on_cpu import apart
from tests.gpudem.test_mesh_everything import mesh, sides

REHEARSED = {"threads": 1, "half_list": False, "chunk": 32, "rebuild_in_graph": True}
#: A bed that hits the floor, and is rebuilt; short, before rounding has grown.
TIME = {"step": 2e-5, "duration": 0.006}
SCENES = {
    "plane": lambda **keys: falling_bed(700, walls=falling_bed().walls[:1], time=TIME, **keys),
    "mesh": lambda **keys: falling_bed(700, walls=[mesh(sides("xyz"))], time=TIME, **keys),
}


def run(scene, lanes: int, **options) -> tuple[dict[str, np.ndarray], int]:
    """The last frame, and the contacts in it."""
    solver = Solver(scene, **{**REHEARSED, **options}, lanes=lanes)
    solver.graphs = options.get("chunk", 32) > 1
    found = finish(solver)
    assert solver.neighbors.rebuilds > 3
    return found, solver.contact_count()


@pytest.mark.parametrize("name", SCENES)
def test_agrees_with_one_thread(name):
    """Detects entries that two lanes take, or none; sums or walls of a lane left out or taken twice; contacts
    counted by one lane alone.
    """
    scene = SCENES[name]()
    (one, contacts), (four, theirs) = run(scene, 1), run(scene, 4)
    assert apart(one, four) < 1e-13
    assert not np.array_equal(one["angular_velocity"], four["angular_velocity"])  # the sum is another
    assert theirs == contacts > 100
    assert np.abs(four["angular_velocity"]).max() > 1


def test_repeats_to_the_last_bit():
    """Again, launch by launch, on two cores, with output in between. Detects a sum whose order is left open,
    a lane that reads what another has not written yet, a kernel of output that sums in another order.
    """
    scene = SCENES["plane"]()
    once, contacts = run(scene, 8)
    same(once, run(scene, 8)[0])
    same(once, run(scene, 8, chunk=1, threads=2)[0])
    other = Solver(scene, **REHEARSED, lanes=8)
    other.start()
    while other.step_count < scene.n_steps - 60:
        other.advance(40)
        other.write_step()
    other.advance(scene.n_steps - 1 - other.step_count)
    other.write_step(last=True)
    same(once, other.frame())
    assert other.contact_count() == contacts


@pytest.mark.parametrize(("lanes", "options"), [(3, {}), (64, {}), (4, {"half_list": True})])
def test_numbers_that_cannot_be(lanes, options):
    with pytest.raises(ValueError, match=f"lanes = {lanes}: must be one of"):
        Solver(falling_bed(10), **options, lanes=lanes)
