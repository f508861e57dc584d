"""Without a GPU: the kernels compile for sm_90, without spills, within the registers of half occupancy.

Catches CUDA-only compile errors, and a change that pushes a kernel into local memory.
"""

import pytest

from comparisons.bench.beds import bench_scene
from comparisons.bench.registers import (
    KernelResources,
    find_ptxas,
    kernel_resources,
    step_kernel_resources,
)
from gpudem.solver.launch_bounds import THREADS, blocks_in_flight
from gpudem.solver.neighbor_kernels import (
    cell_kernel,
    cell_starts,
    count_kernel,
    fill_kernel,
    gather_kernel,
)
from gpudem.solver.removal import exit_kernel
from gpudem.solver.spec import Spec
from gpudem.solver.step_kernel import step_kernel

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
        (Spec(**{**MESH, "meshes": "liggghts"}), 152),  # its rule at obtuse corners reads one weight more
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


@pytest.mark.parametrize(("precision", "least"), [("mixed", 0.5), ("float64", 0.375), ("float32", 0.5)])
def test_threads_in_flight_in_the_flowing_bed(precision, least):
    """A plain step: 64 registers in mixed precision, 80 in float64, nothing spilled to memory.

    Detects a law or an array that takes more registers, a block that takes more shared memory than that of
    its neighbors leaves, a compiler that ignores the bounds.
    """
    found = step_kernel_resources(
        Spec.of(bench_scene("flowing", 10_000, 1, solver={"precision": precision})), plain=True
    )
    assert found.spill_bytes == found.stack_bytes == 0
    assert found.occupancy(THREADS) >= least
    assert found.registers <= {"mixed": 64, "float64": 80, "float32": 64}[precision]


@pytest.mark.parametrize("precision", ["mixed", "float64", "float32"])
@pytest.mark.parametrize(
    "given",
    [
        {},
        {**EVERYTHING, "normal": "hooke"},
        {**EVERYTHING, "rolling": "epsd", "cohesion": "sjkr"},
        {**FULL, "normal": "jkr", "long_range": True},
        {**FULL, "held": True, "moved_groups": True},
        {**FULL, "integrator": "path"},
        MESH,
        {**MESH, "meshes": "liggghts"},
    ],
    ids=["frictionless", "everything", "sjkr with epsd", "jkr", "groups", "path", "mesh", "mesh liggghts"],
)
def test_plain_steps_keep_their_blocks_in_flight_without_spills(given, precision):
    """Detects bounds that a scene's laws do not fit into."""
    spec = Spec(precision=precision, **given)
    found = step_kernel_resources(spec, plain=True)
    assert found.spill_bytes == found.stack_bytes == 0
    assert found.occupancy(THREADS) >= blocks_in_flight(spec) * THREADS / 2048


@pytest.mark.parametrize(("precision", "lanes"), [("mixed", 4), ("mixed", 8), ("float64", 8)])
def test_lanes_compile_without_spills(precision, lanes):
    """Several threads a particle. Detects code for CUDA alone that does not compile; sums that spill."""
    found = kernel_resources(step_kernel(Spec(precision=precision, **FULL), True, lanes))
    assert found.spill_bytes == found.stack_bytes == 0
    assert found.occupancy(THREADS) >= blocks_in_flight(Spec(precision=precision, **FULL)) * THREADS / 2048


def test_occupancy_of_known_kernels():
    """As Nsight Compute gave them on an H100: 76 registers 37 %, 94 registers 25 %, both with 256 threads."""

    def occupancy(registers: int, threads: int, shared: int = 0) -> float:
        return KernelResources(registers, 0, 0, 0, 0, shared).occupancy(threads)

    assert occupancy(76, 256) == 0.375
    assert occupancy(94, 256) == 0.25
    assert occupancy(32, 128) == 1.0
    assert occupancy(64, 128, 56 * 1024) == 4 * 128 / 2048


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


def test_cell_starts_without_spills():
    """Catches a search of the sorted keys that needs a stack, or registers that keep threads out."""
    found = kernel_resources(cell_starts)
    assert (found.spill_bytes, found.stack_bytes) == (0, 0)
    assert found.registers <= 40
