"""Without a GPU: the kernels compile for sm_90, without spills, within the registers of half occupancy.

Catches CUDA-only compile errors, and a change that pushes a kernel into local memory.
"""

import pytest

from comparisons.bench.registers import find_ptxas, kernel_resources, step_kernel_resources
from gpudem.solver.neighbor_kernels import cell_kernel, count_kernel, fill_kernel, gather_kernel
from gpudem.solver.removal import exit_kernel
from gpudem.solver.spec import Spec

FULL = {"tangential": "history", "rotation": True, "gravity": True, "walls": ("plane",)}
EVERYTHING = {
    **FULL,
    "rolling": "cdt",
    "multi_material": True,
    "polydisperse": True,
    "periodic": (True,) * 3,
}
#: A mesh that turns, beside planes.
MESH = {**FULL, "meshes": "unique", "moving_walls": True, "turning_walls": True}
MESH_REGISTERS = {"float64": 144, "mixed": 136, "float32": 88}

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(find_ptxas() is None, reason="no ptxas (pip install 'gpudem[registers]')"),
]


@pytest.mark.parametrize(
    ("spec", "registers"),
    [
        (Spec(), 128),
        (Spec(**FULL), 128),
        (Spec(precision="mixed", **FULL), 128),
        (Spec(precision="float32", **FULL), 64),
        (Spec(normal="hooke", **EVERYTHING), 168),
        (Spec(normal="hertz/stiffness", limit_force=True, **FULL), 128),
        (Spec(normal="jkr", long_range=True, **FULL), 128),
        (Spec(**{**EVERYTHING, "rolling": "epsd", "cohesion": "sjkr"}), 168),
        (Spec(**{**FULL, "tangential": "history_rotated"}), 128),
        (Spec(**{**FULL, "tangential": "history_incremental"}), 128),
        (Spec(**{**FULL, "tangential": "history_capped"}), 128),
        (Spec(held=True, moved_groups=True, **FULL), 128),
        *((Spec(precision=p, **MESH), most) for p, most in MESH_REGISTERS.items()),
        (Spec(**{**MESH, "meshes": "liggghts"}), MESH_REGISTERS["float64"]),
        (Spec(normal="jkr", long_range=True, **MESH), MESH_REGISTERS["float64"]),
    ],
    ids=[
        "frictionless",
        "full",
        "full mixed",
        "full float32",
        "everything",
        "stiffness",
        "jkr",
        "sjkr with epsd",
        "history_rotated",
        "history_incremental",
        "history_capped",
        "groups",
        "mesh",
        "mesh mixed",
        "mesh float32",
        "mesh liggghts",
        "mesh jkr",
    ],
)
def test_no_spills(spec, registers):
    """64 registers keep 1024 of a multiprocessor's 2048 threads busy, 128 keep 512, 168 keep 384."""
    found = step_kernel_resources(spec)
    assert found.spill_bytes == 0
    assert found.stack_bytes == 0
    assert 16 < found.registers <= registers


@pytest.mark.parametrize(
    ("precision", "loads", "stores"), [("float64", 12, 5), ("mixed", 12, 5), ("float32", 10, 3)]
)
def test_motion_moves_in_words_of_16_bytes(precision, loads, stores):
    """Position, velocity, spin of a particle and of its neighbour: three vectors, each in two words or one.

    Catches a Body read number by number, as Warp does by itself, or whose size is not of whole words.
    """
    found = step_kernel_resources(Spec(precision=precision, **FULL))
    assert (found.wide_loads, found.wide_stores) == (loads, stores)


@pytest.mark.parametrize(
    "given",
    [
        FULL,
        EVERYTHING,
        {**EVERYTHING, "size_classes": True},
        MESH,
        {**FULL, "held": True, "moved_groups": True},
    ],
    ids=["full", "everything", "size classes", "mesh", "groups"],
)
def test_rebuild_without_spills(given):
    """The launches of a rebuild. Their stack holds the few numbers that are picked by axis at run time."""
    spec = Spec(**given)
    kernels = (cell_kernel, exit_kernel, gather_kernel, count_kernel, fill_kernel)
    for kernel in (make(spec) for make in kernels):
        found = kernel_resources(kernel)
        assert found.spill_bytes == 0
        assert found.stack_bytes <= 72, kernel.key  # 3 x 3 float64
        most = 128 if spec.meshes and kernel.key.endswith("entries") else 64  # a walk through a search tree
        most += 8 * (spec.held and kernel.key.endswith("fill_entries"))  # two more arrays; at rebuilds only
        assert 16 < found.registers <= most, kernel.key
