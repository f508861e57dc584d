"""The struct Body as a GPU reads and writes it, in 16-byte words; on the CPU, with CUDA's types made up."""

import numpy as np
import pytest

from gpudem.solver.body import WORD, body_fields, body_struct, read_code, write_code
from gpudem.solver.device import wp
from gpudem.solver.spec import Spec
from gpudem.solver.state import structs

SHIM = """
struct double2 { double x, y; };
struct float4 { float x, y, z, w; };
auto __ldg = [](const auto* p) { return *p; };
auto make_double2 = [](double x, double y) { return double2{x, y}; };
auto make_float4 = [](float x, float y, float z, float w) { return float4{x, y, z, w}; };
(void)__ldg; (void)make_double2; (void)make_float4;
#if 1"""
SPECS = {
    f"{precision} {'with' if rotation else 'without'} spin, {integrator}": Spec(
        precision=precision, rotation=rotation, integrator=integrator
    )
    for precision in ("float64", "mixed", "float32")
    for rotation in (False, True)
    for integrator in ("half_step", "path")
}


def as_on_a_gpu(code: str) -> str:
    assert "#if defined(__CUDA_ARCH__)" in code
    return code.replace("#if defined(__CUDA_ARCH__)", SHIM)


@pytest.mark.parametrize("spec", SPECS.values(), ids=SPECS)
def test_words_hold_what_members_hold(spec):
    """Catches a number taken from or put into the wrong half of a word, a field one word off."""
    Body, fields = body_struct(spec), body_fields(spec)
    vec3 = structs(spec.precision).wide3
    rng = np.random.default_rng(0)
    bodies = np.zeros(7, dtype=Body.numpy_dtype())
    assert bodies.dtype.itemsize % WORD == 0
    for field in fields:
        bodies[field] = rng.normal(size=(7, 3))
    now, after = wp.array(bodies, dtype=Body, device="cpu"), wp.zeros(7, dtype=Body, device="cpu")

    @wp.func_native(as_on_a_gpu(write_code(spec)))
    def write(
        bodies: wp.array[Body],
        i: wp.int32,
        position: vec3,
        velocity: vec3,
        angular_velocity: vec3,
        velocity_ahead: vec3,
        angular_velocity_ahead: vec3,
    ): ...

    @wp.kernel(module="unique", enable_backward=False)
    def copy(now: wp.array[Body], given: wp.array2d[vec3], after: wp.array[Body]):
        i = wp.tid()
        write(after, i, given[0, i], given[1, i], given[2, i], given[3, i], given[4, i])

    names = ("position", "velocity", "angular_velocity", "velocity_ahead", "angular_velocity_ahead")
    given = np.stack([bodies[name] if name in fields else np.full((7, 3), np.nan) for name in names])
    wp.launch(copy, 7, inputs=[now, wp.array(given, dtype=vec3, device="cpu")], outputs=[after], device="cpu")
    for field in fields:
        assert np.array_equal(after.numpy()[field], bodies[field]), field

    for field in fields:
        code = as_on_a_gpu(read_code(spec, field))

        @wp.func_native(code)
        def read(bodies: wp.array[Body], i: wp.int32) -> vec3: ...

        @wp.kernel(module="unique", enable_backward=False)
        def pick(now: wp.array[Body], out: wp.array[vec3]):
            i = wp.tid()
            out[i] = read(now, i)

        out = wp.zeros(7, dtype=vec3, device="cpu")
        wp.launch(pick, 7, inputs=[now], outputs=[out], device="cpu")
        assert np.array_equal(out.numpy(), bodies[field]), field


def test_padded_for_gpus_alone():
    """Catches memory spent on padding where nothing is gained by it."""
    for spec in SPECS.values():
        half = Spec(**{**vars(spec), "half_list": True})
        itemsize = 4 if spec.precision == "float32" else 8
        assert body_struct(half).numpy_dtype()["itemsize"] == 3 * itemsize * len(body_fields(spec))
