"""The C++ that Warp writes for a step: no vector is chosen from two in memory, in a loop or a law."""

import re
from pathlib import Path

import pytest

from gpudem.contact import registry
from gpudem.scene import Scene
from gpudem.solver.device import compile_kernels, find_device, wp
from gpudem.solver.spec import Spec
from gpudem.solver.step_kernel import step_kernel
from tests.gpudem.test_jkr import falling
from tests.gpudem.test_unequal_particles import FULL_TOO, LAWS, unlike
from tests.reference.scenes import AGREEMENT, OURS

#: Kernels to compile, if other tests have not: not in the fast part of the tests.
pytestmark = pytest.mark.long

#: Scenes of other tests, which compile the same kernels.
BY_NAME = AGREEMENT | OURS
ALIKE = (
    "periodic_bed", "hooke_stiffness_wall", "epsd_resting", "epsd3_resting", "sjkr_wall", "sjkr2_wall",
    "sjkr_reduce", "unlike_sjkr", "unlike_sjkr2", "history_rotated_resting", "history_incremental_resting",
    "history_capped_resting", "own_rolling_epsd2",
)  # fmt: skip


def mixed(scene: Scene) -> Scene:
    return scene.replace(solver={"precision": "mixed"})


SPECS = {
    **{f"unlike {law}": Spec.of(unlike(law), half_list=True) for law in LAWS},
    **{f"full list {law}": Spec.of(unlike(law)) for law in FULL_TOO},
    **{name: Spec.of(BY_NAME[name](), half_list=True) for name in ALIKE},
    "mixed": Spec.of(mixed(BY_NAME["hooke_wall"]()), half_list=True),
    "jkr": Spec.of(falling(1.0), half_list=True),
}


@pytest.mark.parametrize("spec", SPECS.values(), ids=SPECS)
def test_no_vector_is_chosen(spec):
    """Catches a vector given a new value within an `if`: right, but up to a third slower on a CPU."""
    kernel = step_kernel(spec)
    compile_kernels(find_device("cpu"), [kernel])
    sources = list(Path(wp.config.kernel_cache_dir or "").glob(f"wp_{kernel.module.name}_*/*.cpp"))
    assert sources
    for source in sources:
        functions = re.split(r"^(?=static )", source.read_text(), flags=re.MULTILINE)
        assert any("cpu_kernel_forward" in code for code in functions)
        for code in functions:
            vectors = set(re.findall(r"wp::vec_t<3, \S+> (var_\d+);", code))
            chosen = vectors.intersection(re.findall(r"(var_\d+) = wp::where\(", code))
            assert not chosen, code


@pytest.mark.parametrize("slot", ["normal", "tangential", "rolling", "cohesion"])
def test_every_law_is_looked_at(slot):
    assert set(registry.names(slot)) - {registry.OFF} <= {getattr(spec, slot) for spec in SPECS.values()}
