"""Triangles from .stl, .obj, .ply, .vtk, .vtu and .npz files, in double precision.

    .stl         ASCII (one or several solids) or binary, told apart by the length of the file
    .obj, .ply   faces of any number of corners (in binary .ply all of the same); normals, colors, textures
                 and groups are left out
    .vtk, .vtu   cells of an unstructured grid; legacy .vtk also in ASCII
    .npz         arrays vertices (p, 3) and triangles (k, 3), rows from 0: what the folder of a run holds

A face of more than three corners becomes a fan of triangles about its first corner. Triangles keep the order
of the file; of a .ply file with faces of several sizes those of three corners come first. STL, OBJ and PLY
are read by trimesh, VTK by meshio.
"""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from gpudem.output.archive import ArchiveError, read_npz

#: (points in the unit of the file, shape (p, 3); rows of points of each triangle, shape (k, 3)).
Triangles = tuple[np.ndarray, np.ndarray]


def read_mesh(path: Path) -> Triangles:
    """The triangles of a file as they stand in it.

    Raises:
        ValueError: `file = PATH: ...`: not there, unknown suffix, truncated, broken, without faces.
    """
    reader = _READERS.get(path.suffix.lower())
    try:
        if not path.is_file():
            raise ValueError("is a folder" if path.is_dir() else "no such file")
        if reader is None:
            raise ValueError(f"unknown suffix; known: {', '.join(_READERS)}")
        if path.stat().st_size == 0:
            raise ValueError("is empty")
        return _checked(*reader(path))
    except ArchiveError as error:
        raise ValueError(f"file = {error}") from None
    except OSError as error:
        raise ValueError(f"file = {str(path)!r}: cannot be read: {error.strerror}") from None
    except MemoryError:
        raise ValueError(f"file = {str(path)!r}: does not fit in memory, or is broken") from None
    except ValueError as error:
        raise ValueError(f"file = {str(path)!r}: {error}") from None


def _checked(points: Any, rows: Any) -> Triangles:
    """Arrays of the right type and shape."""
    points = np.ascontiguousarray(points, dtype=np.float64)
    rows = np.ascontiguousarray(rows, dtype=np.int64)
    if len(rows) == 0:
        raise ValueError("holds no triangles")
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"has points of shape {points.shape}; must be (p, 3)")
    return points, rows


def _attempt(read: Callable[[], Any], kind: str) -> Any:
    """What a library reads. Raises ValueError for whatever it raises, also where it would end the program."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # numpy, of numbers that do not parse
            return read()
    except (OSError, MemoryError):
        raise
    except (Exception, SystemExit) as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise ValueError(f"truncated or broken {kind} ({reason})") from None


def _joined(parts: Iterable[dict[str, Any]], kind: str) -> Triangles:
    """The parts of a file as trimesh gives them, one after the other."""
    points, rows, count = [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], 0
    for part in parts:
        vertices, faces = np.asarray(part["vertices"], float)[:, :3], np.asarray(part["faces"])
        if faces.size and faces.dtype.kind not in "iu":
            raise ValueError(f"truncated or broken {kind} (rows of points that are not whole numbers)")
        points.append(vertices)
        rows.append(fan(faces.astype(np.int64)) + count)
        count += len(vertices)
    return np.concatenate(points), np.concatenate(rows)


def fan(faces: np.ndarray) -> np.ndarray:
    """Triangles (k (c - 2), 3) of k faces of c corners, shape (k, c)."""
    if len(faces) == 0 or faces.shape[1] < 3:
        return np.zeros((0, 3), np.int64)
    corners = [faces[:, [0, c, c + 1]] for c in range(1, faces.shape[1] - 1)]
    return np.stack(corners, axis=1).reshape(-1, 3)


def _parts(found: dict[str, Any]) -> list[dict[str, Any]]:
    parts = found["geometry"].values() if "geometry" in found else [found]
    return [part for part in parts if "faces" in part]


# -- the formats ---------------------------------------------------------------------------------------------


def _stl(path: Path) -> Triangles:
    from trimesh.exchange import stl

    content = path.read_bytes()
    stated = int.from_bytes(content[80:84], "little")
    if len(content) != 84 + 50 * stated:
        if b"\0" in content:
            raise ValueError(
                f"truncated or broken binary STL: {len(content)} bytes; must be 84 + 50 x the number of"
                f" triangles, which it gives as {stated}"
            )
        return _ascii_stl(content)
    found = _attempt(lambda: stl.load_stl_binary(io.BytesIO(content)), "binary STL")
    return _joined(_parts(found), "binary STL")


def _ascii_stl(content: bytes) -> Triangles:
    from trimesh.exchange import stl

    lines = [line.strip().lower() for line in content.splitlines()]
    if not re.match(rb"\s*solid", content, re.IGNORECASE):
        raise ValueError("not an STL file: neither binary nor text that begins with 'solid'")
    # names of solids are left out: they may hold any word
    lines = [line.split()[0] if line.startswith((b"solid", b"endsolid")) else line for line in lines if line]
    facets = sum(line.startswith(b"facet") for line in lines)
    if not lines or lines[-1] != b"endsolid":
        raise ValueError(f"truncated ASCII STL: {facets} facets, and no 'endsolid' at the end")
    line = next((k for k, text in enumerate(content.splitlines(), 1) if not _vertex(text)), 0)
    if line:
        raise ValueError(f"broken ASCII STL: line {line} is no corner of three numbers")
    if sum(text.startswith(b"vertex") for text in lines) != 3 * facets:
        raise ValueError(f"broken ASCII STL: not every one of its {facets} facets has three corners")
    found = _attempt(lambda: stl.load_stl_ascii(io.BytesIO(b"\n".join(lines) + b"\n")), "ASCII STL")
    return _joined(_parts(found), "ASCII STL")


def _vertex(line: bytes) -> bool:
    """Not a corner, or one of three numbers."""
    words = line.split()
    if not words or words[0].lower() != b"vertex":
        return True
    try:
        return len([float(word) for word in words[1:]]) == 3
    except ValueError:
        return False


def _obj(path: Path) -> Triangles:
    from trimesh.exchange import obj

    content = path.read_bytes()
    if b"\0" in content:
        raise ValueError("not an OBJ file: it is not text")

    def read() -> Any:
        return obj.load_obj(io.BytesIO(content), group_material=False, skip_materials=True)

    return _joined(_parts(_attempt(read, "OBJ"))[::-1], "OBJ")  # trimesh gives the last part first


def _ply(path: Path) -> Triangles:
    from trimesh.exchange import ply

    content = path.read_bytes()

    def read() -> Any:
        return ply.load_ply(io.BytesIO(content), fix_texture=False, skip_materials=True)

    points, rows = _joined(_parts(_attempt(read, "PLY")), "PLY")
    stated = re.search(rb"^element face (\d+)", content, re.MULTILINE)
    if stated is not None and len(rows) < int(stated[1]):
        raise ValueError(f"truncated or broken PLY: less than the {int(stated[1])} faces that it states")
    return points, rows


def _vtk(path: Path) -> Triangles:
    import meshio

    reader = meshio.vtu.read if path.suffix.lower() == ".vtu" else meshio.vtk.read
    mesh = _attempt(lambda: reader(str(path)), "VTK")
    volumes = [block.type for block in mesh.cells if block.dim > 2]
    if volumes:
        raise ValueError(f"holds cells of type {volumes[0]}; must be triangles, quads or polygons")
    rows = [fan(np.asarray(block.data)) for block in mesh.cells if block.dim == 2]
    points = np.asarray(mesh.points, float)
    return points, np.concatenate(rows) if rows else np.zeros((0, 3), np.int64)


def _npz(path: Path) -> Triangles:
    arrays = read_npz(path)
    missing = [name for name in ("vertices", "triangles") if name not in arrays]
    if missing:
        raise ValueError(f"array {missing[0]} needed; found: {', '.join(arrays) or 'none'}")
    points, rows = arrays["vertices"], arrays["triangles"]
    if rows.dtype.kind not in "iu" or rows.ndim != 2 or rows.shape[1] != 3:
        raise ValueError(f"triangles: {rows.dtype} of shape {rows.shape}; must be integers (k, 3)")
    if points.dtype.kind not in "iuf":
        raise ValueError(f"vertices: {points.dtype}; must be numbers (p, 3)")
    return points, rows


_READERS = {".stl": _stl, ".obj": _obj, ".ply": _ply, ".vtk": _vtk, ".vtu": _vtk, ".npz": _npz}
