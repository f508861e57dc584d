"""The C++ that Warp writes for a step: no vector is chosen from two in memory, in a loop or a law."""

import re
from pathlib import Path

import pytest

from gpudem.contact import registry
from gpudem.solver.device import quiet, wp
from gpudem.solver.spec import Spec
from gpudem.solver.step_kernel import step_kernel

#: Ten kernels to write: not in the fast part of the tests.
pytestmark = pytest.mark.long

FULL = {"tangential": "history", "rotation": True, "gravity": True, "walls": ("plane",), "half_list": True}
MORE = {**FULL, "multi_material": True, "polydisperse": True, "periodic": (True, True, True)}
SPECS = {
    "mixed": {**FULL, "precision": "mixed"},
    "full list": {**FULL, "half_list": False},
    **{f"normal {name}": {**FULL, "normal": name} for name in registry.names("normal")},
    **{
        f"tangential {name}": {**FULL, "tangential": name}
        for name in registry.names("tangential")
        if name != registry.OFF
    },
    **{
        f"rolling {name}": {**MORE, "rolling": name}
        for name in registry.names("rolling")
        if name != registry.OFF
    },
    **{
        f"cohesion {name}": {**MORE, "cohesion": name}
        for name in registry.names("cohesion")
        if name != registry.OFF
    },
}


@pytest.mark.parametrize("spec", [Spec(**given) for given in SPECS.values()], ids=SPECS)
def test_no_vector_is_chosen(spec, tmp_path):
    """Catches a vector given a new value within an `if`: right, but up to a third slower on a CPU."""
    with quiet():  # that the code is for this machine alone
        wp.compile_aot_module(step_kernel(spec).module, device="cpu", module_dir=tmp_path)
    (source,) = Path(tmp_path).glob("*.cpp")
    functions = re.split(r"^(?=static )", source.read_text(), flags=re.MULTILINE)
    assert any("cpu_kernel_forward" in code for code in functions)
    for code in functions:
        vectors = set(re.findall(r"wp::vec_t<3, \S+> (var_\d+);", code))
        chosen = vectors.intersection(re.findall(r"(var_\d+) = wp::where\(", code))
        assert not chosen, code
