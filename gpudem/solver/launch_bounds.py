"""Threads of a block of the step kernel on CUDA, and how many blocks a multiprocessor is to keep in flight.

A step waits for memory most of the time, so a multiprocessor needs many threads to change between. They share
65 536 registers: the compiler is told how many blocks are wanted and keeps to the registers that leaves a
thread. What does not fit goes to shared memory, which is as near as the cache (Warp's
`enable_cuda_smem_spilling`), as far as the compiler uses it; beyond that it would go to memory, so scenes
whose laws need more get fewer blocks. tests/gpudem/test_cuda_compile.py holds what comes out.
"""

from __future__ import annotations

from gpudem.solver.spec import Spec

#: Threads of a block. On an H100 a step took 4 to 8 % less time with 128 than with 256 (float64: 12 %).
THREADS = 128


def blocks_in_flight(spec: Spec) -> int:
    """Blocks of `THREADS` that a multiprocessor of 2048 threads is to hold: 4, 6 or 8.

    8 leave a thread 64 registers (half of all threads in flight), 6 leave 80 (37 %), 4 leave 128 (25 %).
    """
    if spec.precision == "float32":
        return 8
    if spec.meshes:
        return 4
    # laws and properties whose intermediate values take registers
    more = spec.rolling != "off" or spec.cohesion != "off" or spec.per_particle_mass or spec.path
    more = more or spec.adhesive or bool(spec.wall_laws) or spec.moved_groups or spec.turning_walls
    if spec.precision == "mixed":
        return 6 if more else 8
    return 4 if more else 6
