"""VTU frames and the .pvd that lists them with physical time: the output of every code, and its reader.

A frame is a table: column name -> array, in order of particle id. Columns: id, material, position [m],
velocity [m/s], angular_velocity [rad/s], radius [m], force [N], torque [N m].
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

import numpy as np

from gpudem.errors import GpudemError
from gpudem.output.atomic import replacing

Frame = dict[str, np.ndarray]


PVD = "run.pvd"


class FrameError(GpudemError):
    """A frame file is missing, truncated or not what it should be."""


def write_vtu(path: Path, frame: Frame) -> None:
    """One frame as binary XML unstructured grid of vertices; points and the array `position` are float64."""
    import meshio

    n = len(frame["position"])
    data: dict[str, Any] = {k: np.ascontiguousarray(v) for k, v in frame.items()}
    mesh = meshio.Mesh(data["position"], [("vertex", np.arange(n).reshape(-1, 1))], point_data=data)
    with replacing(path) as partial:
        mesh.write(partial, file_format="vtu", binary=True, compression=None)


def read_vtu(path: Path) -> Frame:
    """The arrays of a .vtu file as they stand in it. Raises FrameError naming the file."""
    return read_vtu_and_cells(path)[0]


def read_vtu_and_cells(path: Path) -> tuple[Frame, Frame]:
    """As `read_vtu`, and the arrays that the file has for its cells. Raises FrameError."""
    import meshio

    if not path.is_file():
        raise FrameError(f"{path}: no such frame")
    try:
        if empty := _without_points(path):
            return empty, {}
        mesh = meshio.read(path, file_format="vtu")
    except (Exception, SystemExit) as error:  # meshio raises many kinds, and exits on some broken files
        raise FrameError(f"{path}: truncated or corrupted VTU ({type(error).__name__}: {error})") from error
    frame = {"points": np.asarray(mesh.points), **{k: np.asarray(v) for k, v in mesh.point_data.items()}}
    return frame, {k: np.concatenate(parts) for k, parts in mesh.cell_data.items()}


def _without_points(path: Path) -> Frame | None:
    """The arrays of a file without points, which meshio cannot read; None for any other file."""
    with path.open("rb") as file:
        if b'NumberOfPoints="0"' not in file.read(1000):
            return None
    frame: Frame = {"points": np.empty((0, 3))}
    for array in ElementTree.parse(path).getroot().iterfind("UnstructuredGrid/Piece/PointData/DataArray"):
        width = int(array.get("NumberOfComponents", "1"))
        dtype = np.int64 if "Int" in array.get("type", "") else np.float64
        frame[array.attrib["Name"]] = np.empty((0, width) if width > 1 else 0, dtype)
    return frame


def write_pvd(path: Path, entries: list[tuple[float, int, str]]) -> None:
    """A ParaView collection of (time [s], part, file)."""
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1", byte_order="LittleEndian")
    collection = ElementTree.SubElement(root, "Collection")
    for time, part, name in entries:
        ElementTree.SubElement(collection, "DataSet", timestep=repr(time), part=str(part), file=name)
    ElementTree.indent(root)
    with replacing(path) as partial:
        ElementTree.ElementTree(root).write(partial, xml_declaration=True)


def read_pvd(path: Path) -> list[tuple[float, int, str]]:
    """What `write_pvd` wrote. Raises FrameError: missing, broken, or naming a file outside its folder."""
    if not path.is_file():
        raise FrameError(f"{path}: no such file; the run wrote no frames here")
    try:
        sets = ElementTree.parse(path).getroot().findall("Collection/DataSet")
        entries = [(float(s.attrib["timestep"]), int(s.attrib["part"]), s.attrib["file"]) for s in sets]
    except OSError as error:
        raise FrameError(f"{path}: cannot be read: {error.strerror}") from error
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        raise FrameError(f"{path}: truncated or corrupted ({type(error).__name__}: {error})") from error
    for _, _, name in entries:
        windows = PureWindowsPath(name)  # takes / and \ for separators
        if PurePosixPath(name).is_absolute() or windows.anchor or ".." in windows.parts:
            raise FrameError(f"{path}: file = {name!r} is outside the folder of the run; not read")
    return entries
