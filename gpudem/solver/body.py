# pyright: reportInvalidTypeForm=false
"""The struct `Body`: what moves of a particle, side by side in memory, and how a step reads and writes it.

position [m]; velocity [m/s], angular_velocity [rad/s]: half a step behind it; velocity_ahead,
angular_velocity_ahead: predicted half a step ahead, with integrator "path" only.

A GPU moves 16 bytes of a thread as fast as 4 or 8, but Warp loads a struct number by number. So the access
is in native code: on CUDA in whole 16-byte words, to which a Body is padded; elsewhere member by member.
"""

import functools
from typing import Any

import warp as wp

from gpudem.contact.types import WIDE
from gpudem.solver.spec import Spec

#: Bytes that one load of a CUDA thread takes at most.
WORD = 16


def body_fields(spec: Spec) -> tuple[str, ...]:
    """The vectors of a Body, in order."""
    fields = ["position", "velocity", *(["angular_velocity"] * spec.rotation)]
    fields += ["velocity_ahead"] * spec.path + ["angular_velocity_ahead"] * (spec.path and spec.rotation)
    return tuple(fields)


def body_struct(spec: Spec) -> Any:
    """The struct `Body` of a Spec; with a full list, as on a GPU, padded to whole words."""
    fields, (size, _) = body_fields(spec), _word(spec)
    return _struct(WIDE[spec.precision], fields, 0 if spec.half_list else -3 * len(fields) % size)


@functools.cache
def _struct(wide: Any, fields: tuple[str, ...], padding: int) -> Any:
    """One object for one layout: Warp takes kernels of equal text for one, and arrays by the object."""
    members: dict[str, Any] = dict.fromkeys(fields, wp.types.vector(3, wide))
    members |= {f"pad_{k}": wide for k in range(padding)}
    return wp.struct(type("Body", (), {"__annotations__": members}))


def _vector(spec: Spec) -> Any:
    return wp.types.vector(3, WIDE[spec.precision])


def _word(spec: Spec) -> tuple[int, str]:
    """(numbers in a word, CUDA's name for it)."""
    size = WORD // wp.types.type_size_in_bytes(WIDE[spec.precision])
    return size, f"{'double' if size == 2 else 'float'}{size}"


def read_code(spec: Spec, field: str) -> str:
    """C++ that returns one vector of Body i, zeros for a field that it does not have."""
    fields, (size, word) = body_fields(spec), _word(spec)
    if field not in fields:
        return "return {};"
    first = 3 * fields.index(field)  # mutate: first_word
    words = range(first // size, (first + 2) // size + 1)
    loads = "".join(f"const {word} w{k} = __ldg(words + {k});\n" for k in words)
    numbers = ", ".join(f"w{k // size}.{'xyzw'[k % size]}" for k in range(first, first + 3))
    return f"""
#if defined(__CUDA_ARCH__)
const {word}* words = reinterpret_cast<const {word}*>(bodies.data + i);
{loads}return {{{numbers}}};
#else
return bodies.data[i].{field};
#endif
"""


def write_code(spec: Spec) -> str:
    """C++ that writes every vector of Body i from the variable of its name."""
    fields, (size, word) = body_fields(spec), _word(spec)
    numbers = [f"{field}[{k}]" for field in fields for k in range(3)]
    numbers += ["0"] * (-len(numbers) % size)
    stores = "".join(
        f"words[{k // size}] = make_{word}({', '.join(numbers[k : k + size])});\n"
        for k in range(0, len(numbers), size)
    )
    members = "".join(f"bodies.data[i].{field} = {field};\n" for field in fields)
    return f"""
#if defined(__CUDA_ARCH__)
{word}* words = reinterpret_cast<{word}*>(bodies.data + i);
{stores}#else
{members}#endif
"""


@functools.cache
def body_reader(spec: Spec, field: str) -> Any:
    """A function (bodies, i) -> that vector of Body i; zeros for a field that it does not have.

    `bodies` must not be written in the same launch: CUDA reads it through the cache for constants.
    """
    Body, vec3 = body_struct(spec), _vector(spec)

    @wp.func_native(read_code(spec, field))
    def read(bodies: wp.array[Body], i: wp.int32) -> vec3: ...

    return read


@functools.cache
def body_writer(spec: Spec) -> Any:
    """A function (bodies, i, position, velocity, ...): writes Body i, but what it has no field for."""
    Body, vec3 = body_struct(spec), _vector(spec)

    @wp.func_native(write_code(spec))
    def write(
        bodies: wp.array[Body],
        i: wp.int32,
        position: vec3,
        velocity: vec3,
        angular_velocity: vec3,
        velocity_ahead: vec3,
        angular_velocity_ahead: vec3,
    ): ...

    return write
