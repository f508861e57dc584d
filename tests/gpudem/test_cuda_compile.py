"""Without a GPU: the step kernels compile for sm_90, without spills, within the registers of half occupancy.

Catches CUDA-only compile errors, and a change that pushes a kernel into local memory.
"""

import pytest

from comparisons.resources import find_ptxas, step_kernel_resources
from gpudem.spec import Spec

FULL = {"tangential": "history", "rotation": True, "gravity": True, "walls": True}
EVERYTHING = {
    **FULL,
    "rolling": "cdt",
    "several_materials": True,
    "several_radii": True,
    "periodic": (True,) * 3,
}

pytestmark = pytest.mark.skipif(find_ptxas() is None, reason="no ptxas (pip install nvidia-cuda-nvcc)")


@pytest.mark.parametrize(
    ("spec", "registers"),
    [
        (Spec(), 128),
        (Spec(**FULL), 128),
        (Spec(precision="mixed", **FULL), 128),
        (Spec(precision="float32", **FULL), 64),
        (Spec(normal="hooke", **EVERYTHING), 168),
        (Spec(normal="hertz/stiffness", limit_force=True, **FULL), 128),
    ],
    ids=["frictionless", "full", "full mixed", "full float32", "everything", "stiffness"],
)
def test_no_spills(spec, registers):
    """64 registers keep 1024 of a multiprocessor's 2048 threads busy, 128 keep 512, 168 keep 384."""
    found = step_kernel_resources(spec)
    assert found.spill_bytes == 0
    assert found.stack_bytes == 0
    assert 16 < found.registers <= registers
