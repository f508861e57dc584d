"""Mixed precision with the full list, as CUDA devices run it, on the CPU: forces within float32 rounding.

There the overlap is (reach^2 - r^2)/(reach + r), the numerator in float64. Detects: a numerator or a
difference of positions or velocities rounded to float32 before it is taken, a reach of equal radii, a factor
of two; with the half list the same of its own formula.

One force takes some twelve roundings of u = 2^-24: overlap 4 u, sqrt(R* overlap) 5 u, products 3 u; the bound
is 16 u = 1e-6. A difference in float32 would leave u reach/overlap, 100 u to 1e7 u here.
"""

import numpy as np
import pytest

from gpudem.scene import Scene
from gpudem.solver.solver import Solver
from tests.gpudem.beds import finish
from tests.reference.scenes import AGREEMENT

pytestmark = pytest.mark.long

U = 2.0**-24
#: Overlaps as a share of the smaller radius.
SHARES = np.logspace(-7, -2, 11)
RADII = ((0.003, 0.003), (0.003, 0.001), (0.0013, 0.0031))
DIRECTIONS = np.array([[1.0, 0, 0], [0.36, -0.48, 0.8], [-0.6, 0.0, -0.8]])
CELL = 0.02


def touching(origin: float, radii=RADII, materials=("soft", "hard"), drift: float = 0.0, **more) -> Scene:
    """Pairs at rest but for `drift` [m/s], at every overlap, direction and pair of radii, at `origin` [m].

    With a drift they all move at it, and the second of each pair 1 um/s to 1 mm/s slower.
    """
    position, radius, velocity = [], [], []
    for a, (share, direction, (r, s)) in enumerate(
        (share, direction, pair) for share in SHARES for direction in DIRECTIONS for pair in radii
    ):
        centre = origin + CELL * np.array([a % 5 + 0.5, a // 5 % 5 + 0.5, a // 25 + 0.5])
        apart = r + s - share * min(r, s)
        position += [centre, centre - apart * direction]
        radius += [r, s]
        velocity += [np.full(3, drift), np.full(3, drift * (1 - share))]
    names = [materials[k % len(materials)] for k in range(len(radius))]
    return Scene(**{
        "name": "touching",
        "materials": {"soft": {"young": 5e6, "poisson": 0.34, "density": 1768.0},
                      "hard": {"young": 9e7, "poisson": 0.2, "density": 7800.0}},
        "pairs": [{"materials": p, "restitution": 0.5, "friction": 0.3}
                  for p in (("soft", "soft"), ("soft", "hard"), ("hard", "hard"))],
        "particles": {"source": "explicit", "position": position, "radius": radius, "material": names,
                      "velocity": velocity},
        "domain": {"lo": (origin - CELL,) * 3, "hi": (origin + 7 * CELL,) * 3},
        "time": {"step": 1e-7, "duration": 2e-6},
        **more,
    })  # fmt: skip


def forces(scene: Scene, precision: str, half_list: bool) -> dict[str, np.ndarray]:
    """Set-up forces and torques, by id."""
    solver = Solver(scene.replace(solver={"precision": precision}), half_list=half_list)
    solver.start(write=True)
    found = solver.frame()
    solver.close()
    return found


def relative(found: np.ndarray, exact: np.ndarray) -> float:
    """Largest difference of a vector by its own length."""
    return float((np.linalg.norm(found - exact, axis=1) / np.linalg.norm(exact, axis=1)).max())


@pytest.mark.parametrize("half_list", [False, True], ids=["full list", "half list"])
@pytest.mark.parametrize("origin", [0.0, 1000.0])
def test_forces_of_small_overlaps(origin, half_list):
    """The positions are the same float64 numbers for both, so that 1000 m from the origin changes nothing."""
    scene = touching(origin)
    exact = forces(scene, "float64", True)["force"]
    found = forces(scene, "mixed", half_list)["force"]
    assert np.linalg.norm(exact, axis=1).min() > 0
    assert relative(found, exact) < 16 * U
    assert relative(found, exact) > U / 4  # it was not float64


@pytest.mark.parametrize("half_list", [False, True], ids=["full list", "half list"])
def test_damping_sees_small_differences_of_large_velocities(half_list):
    """All move at 3 m/s along each axis, pairs differ by 0.3 um/s and more."""
    scene = touching(0.0, drift=3.0)
    still, exact = forces(touching(0.0), "float64", True), forces(scene, "float64", True)
    found = forces(scene, "mixed", half_list)
    assert relative(found["force"], exact["force"]) < 16 * U
    assert relative(exact["force"], still["force"]) > 1e-2  # damping and dashpots take part in it


@pytest.mark.parametrize("half_list", [False, True], ids=["full list", "half list"])
def test_one_radius_and_material(half_list):
    """The kernel of equal particles has no arrays of radii."""
    scene = touching(0.0, radii=((0.003, 0.003),), materials=("soft",))
    exact = forces(scene, "float64", True)["force"]
    assert relative(forces(scene, "mixed", half_list)["force"], exact) < 16 * U


#: Column -> largest difference by its largest value: the sum of some hundred forces, each 1e-6 off, as for
#: the half list in test_precision.py.
BOUNDS = {"position": 1e-7, "velocity": 1e-6, "angular_velocity": 1e-6}


@pytest.mark.parametrize("name", ["two_sizes", "periodic_crossing", "epsd2_wall", "gate_removal"])
def test_motion_in_the_full_list(name):
    """Contacts with springs, rolling torques, walls, gates and periodic sides from touch to rebound."""
    scene = AGREEMENT[name]()
    exact = finish(Solver(scene))
    found = finish(Solver(scene.replace(solver={"precision": "mixed"}), half_list=False))
    for column, bound in BOUNDS.items():
        scale = max(np.abs(exact[column]).max(), 1e-300)
        assert np.abs(found[column] - exact[column]).max() / scale < bound, column
    assert not np.array_equal(found["velocity"], exact["velocity"])


def test_motion_far_from_the_origin():
    """Ten steps of all pairs 1000 m away: they go where those of float64 go."""
    scene = touching(1000.0, drift=3.0)
    exact = finish(Solver(scene))
    found = finish(Solver(scene.replace(solver={"precision": "mixed"}), half_list=False))
    for column in ("velocity", "angular_velocity"):
        scale = np.abs(exact[column]).max()
        assert np.abs(found[column] - exact[column]).max() < 1e-6 * scale, column
    assert np.abs(found["position"] - exact["position"]).max() < 1e-12
