"""Every law, wall and option of the solver against an independent NumPy statement of LIGGGHTS' formulas.

Catches: a wrong sign, factor, effective mass or radius, a lever arm, a missing projection of the spring, a
spring kept after separation, full-step velocities where half-step ones belong, a wrong nearest image.
"""

import numpy as np
import pytest

from gpudem.driver import simulate as run
from gpudem.output.run import TRACE_COLUMNS
from gpudem.solver.solver import Solver
from tests.gpudem.beds import finish
from tests.reference.emulator import emulate
from tests.reference.scenes import AGREEMENT, OURS, two_spheres

#: Rounding: the same operations in another order; 1e-15, in a bed, where collisions multiply it, 1e-12.
TOLERANCE = {"periodic_bed": 1e-10}


@pytest.mark.parametrize("name", [*AGREEMENT, *OURS])
def test_agrees_to_rounding(name):
    scene = (AGREEMENT | OURS)[name]()
    ours, theirs = run(scene).trace, emulate(scene)
    for column in TRACE_COLUMNS:
        scale = max(np.abs(theirs[column]).max(), 1e-300)
        assert np.abs(ours[column] - theirs[column]).max() / scale < TOLERANCE.get(name, 1e-12), column
    assert np.abs(ours["velocity"][-1] - ours["velocity"][0]).max() > 0.01  # something happened


def test_the_comparison_can_fail():
    ours, theirs = run(two_spheres(pair={"friction": 0.31})).trace, emulate(two_spheres())
    assert np.abs(ours["velocity"] - theirs["velocity"]).max() > 1e-4


def test_float32_agrees_to_its_own_rounding():
    """Positions are rounded once a step, at most steps x eps/2 x |x|; that error feeds the velocities."""
    scene = two_spheres()
    ours, theirs = run(scene, precision="float32").trace, emulate(scene)
    bound = scene.n_steps * np.finfo(np.float32).eps / 2 * np.abs(theirs["position"]).max()
    assert np.abs(ours["position"] - theirs["position"]).max() < bound
    assert np.abs(ours["velocity"] - theirs["velocity"]).max() < 2e-3
    assert np.abs(ours["velocity"] - theirs["velocity"]).max() > 1e-9  # it was float32


@pytest.mark.slow  # two launches of kernels of the full list for each law; the half list is tested above
@pytest.mark.parametrize("name", [name for name in OURS if name.endswith("resting")])
def test_both_sides_of_a_contact_agree(name):
    """Detects a law that is not antisymmetric: with a full list each side computes its own force."""
    half, full = (finish(Solver(OURS[name](), half_list=choice)) for choice in (True, False))
    for column in ("position", "velocity", "angular_velocity"):
        scale = np.abs(half[column]).max()
        assert np.abs(half[column] - full[column]).max() < 1e-11 * scale, column
