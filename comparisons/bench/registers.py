"""What the CUDA compiler makes of a kernel, without a GPU: registers and spills for one architecture."""

from __future__ import annotations

import dataclasses
import re
import shutil
import subprocess
import tempfile
from importlib.metadata import PackageNotFoundError, files
from pathlib import Path
from typing import Any

from gpudem.errors import GpudemError
from gpudem.solver.spec import Spec
from gpudem.solver.step_kernel import step_kernel


@dataclasses.dataclass(frozen=True)
class KernelResources:
    """Of one thread: registers; bytes spilled to local memory; bytes of stack; 16-byte loads and stores.

    Of a block: bytes of shared memory.
    """

    registers: int
    spill_bytes: int
    stack_bytes: int
    wide_loads: int
    wide_stores: int
    shared_bytes: int

    def occupancy(self, threads: int) -> float:
        """Share of the 2048 threads of a multiprocessor of sm_90 that are in flight in blocks of so many.

        Four parts with 16 384 registers each, given to a warp of 32 threads in units of 256; 32 blocks at
        most; 228 KiB of shared memory, of which each block takes 1 KiB beside its own (CUDA C++ Programming
        Guide, compute capability 9.0).
        """
        warp_registers = -(-32 * self.registers // 256) * 256
        warps = 4 * (16384 // warp_registers)
        blocks = min(32, 2048 // threads, warps // (threads // 32))
        blocks = min(blocks, 228 * 1024 // (1024 + self.shared_bytes))
        return blocks * threads / 2048


def find_ptxas() -> str | None:
    """The PTX assembler of the package nvidia-cuda-nvcc, or of an installed CUDA toolkit."""
    try:
        found = [f for f in files("nvidia-cuda-nvcc") or [] if f.name == "ptxas"]
        if found:
            return str(found[0].locate())
    except PackageNotFoundError:
        pass
    return shutil.which("ptxas")


def step_kernel_resources(spec: Spec, architecture: int = 90, plain: bool = False) -> KernelResources:
    """`kernel_resources` of the step kernel of a Spec; `plain`: of the one without set-up and output."""
    return kernel_resources(step_kernel(spec, plain), architecture)


def kernel_resources(kernel: Any, architecture: int = 90) -> KernelResources:
    """Compile a kernel, alone in its module, for sm_<architecture> and read the assembler's report.

    Raises GpudemError where there is no assembler, or it refuses the code.
    """
    import warp

    from gpudem.solver.device import quiet

    ptxas = find_ptxas()
    if ptxas is None:
        raise GpudemError("no ptxas: pip install 'gpudem[registers]'")
    with tempfile.TemporaryDirectory() as folder, quiet():
        ptx = Path(
            warp.compile_aot_module(kernel.module, arch=architecture, module_dir=folder, use_ptx=True)[0]
        )
        ptx.write_bytes(ptx.read_bytes().rstrip(b"\0"))  # Warp ends the text with a NUL that ptxas refuses
        text = ptx.read_text()
        command = [ptxas, "-v", f"-arch=sm_{architecture}", str(ptx), "-o", str(Path(folder) / "out.cubin")]
        report = subprocess.run(command, capture_output=True, text=True, check=False)
    if report.returncode:
        raise GpudemError(f"ptxas: {report.stderr.strip()}")
    entry = report.stderr[report.stderr.index("Compiling entry function") :]

    def number(pattern: str) -> int:
        match = re.search(pattern, entry)
        if match is None:
            raise GpudemError(f"ptxas: no {pattern!r} in its report:\n{report.stderr}")
        return int(match.group(1))

    return KernelResources(
        registers=number(r"Used (\d+) registers"),
        spill_bytes=number(r"(\d+) bytes spill stores") + number(r"(\d+) bytes spill loads"),
        stack_bytes=number(r"(\d+) bytes stack frame"),
        wide_loads=len(re.findall(r"\bld\.global\.nc\.(v2\.f64|v4\.f32)\b", text)),
        wide_stores=len(re.findall(r"\bst\.global\.(v2\.f64|v4\.f32)\b", text)),
        shared_bytes=number(r"(\d+) bytes smem") if "bytes smem" in entry else 0,
    )
