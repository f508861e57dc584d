"""Keep of a library with CUDA code what one architecture runs, so that it packs small; its size stays.

    python tools/gpu/trim.py LIBRARY 90        # sm_90: H100, H200, GH200

A compiled CUDA library carries its device code once for each architecture, in containers ("fat binaries") of
the ELF section .nv_fatbin. The driver reads the header of each entry and loads the one that fits its card.
Here the headers stay and the code of all other architectures becomes zeros.
"""

from __future__ import annotations

import struct
import sys
from pathlib import Path

MAGIC = 0xBA55ED50
#: Kind of an entry: 1 is PTX, 2 is machine code.
MACHINE_CODE = 2


def section(data: bytes | bytearray, name: str) -> tuple[int, int]:
    """(offset, size) [bytes] of a section of a 64-bit ELF file. Raises ValueError: there is none."""
    if data[:5] != b"\x7fELF\x02":
        raise ValueError("not a 64-bit ELF file")
    table, each, count, names = (
        *struct.unpack_from("<Q", data, 0x28),
        *struct.unpack_from("<HHH", data, 0x3A),
    )
    strings = struct.unpack_from("<Q", data, table + names * each + 0x18)[0]
    for at in range(table, table + count * each, each):
        start = strings + struct.unpack_from("<I", data, at)[0]
        if data[start : data.index(b"\0", start)] == name.encode():
            offset, size = struct.unpack_from("<QQ", data, at + 0x18)
            return offset, size
    raise ValueError(f"no section {name}")


def trim(data: bytearray, arch: int) -> int:
    """Zero the device code of all architectures but `arch`, in place; returns the bytes of zeros.

    Raises ValueError: no CUDA code, or a container without machine code of that architecture.
    """
    at, size = section(data, ".nv_fatbin")
    end, zeros = at + size, 0
    while at < end:
        if struct.unpack_from("<I", data, at)[0] != MAGIC:
            at += 8  # containers begin at multiples of 8
            continue
        header, length = struct.unpack_from("<HQ", data, at + 6)
        entry, at = at + header, at + header + length
        kept = 0
        while entry < at:
            kind, _, skip, payload = struct.unpack_from("<HHIQ", data, entry)
            target = struct.unpack_from("<I", data, entry + 28)[0]
            start, entry = entry + skip, entry + skip + payload
            if kind == MACHINE_CODE and target == arch:
                kept += 1
            else:
                data[start:entry] = bytes(payload)
                zeros += payload
        if not kept:
            raise ValueError(f"no machine code for sm_{arch} in a container that ends at byte {at}")
    return zeros


def main(library: str, arch: str) -> None:
    """Trim a file."""
    path = Path(library)
    data = bytearray(path.read_bytes())
    zeros = trim(data, int(arch))
    path.write_bytes(data)
    print(f"{path.name}: {zeros / 2**20:.1f} MiB of other architectures than sm_{arch} left out")


if __name__ == "__main__":
    main(*sys.argv[1:])
