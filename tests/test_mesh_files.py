"""Files of triangles: each format gives the same ones to the last bit, each broken file its message."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from gpudem.scene.mesh_files import read_mesh

#: A square of two triangles and a roof over it; coordinates that need 17 digits.
POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1]]) / 3 + np.pi * 1e-3
ROWS = np.array([[0, 1, 2], [0, 2, 3], [0, 1, 4], [1, 2, 4]])
QUADS = "f 1 2 3 4\n"


def ascii_stl(corners: np.ndarray, name: str = "drum") -> str:
    facets = []
    for triangle in corners:
        lines = "\n".join("      vertex " + " ".join(f"{c:.17g}" for c in corner) for corner in triangle)
        facets.append(f"  facet normal 0 0 1\n    outer loop\n{lines}\n    endloop\n  endfacet")
    return f"solid {name}\n" + "\n".join(facets) + f"\nendsolid {name}\n"


def binary_stl(corners: np.ndarray, header: bytes = b"") -> bytes:
    parts = [header.ljust(80, b"\0"), struct.pack("<I", len(corners))]
    for triangle in corners.astype("<f4"):
        parts.append(np.zeros(3, "<f4").tobytes() + triangle.tobytes() + b"\0\0")
    return b"".join(parts)


def obj(points: np.ndarray, faces: str) -> str:
    return "".join("v " + " ".join(f"{c:.17g}" for c in p) + "\n" for p in points) + faces


FACES = "".join("f " + " ".join(str(v + 1) for v in row) + "\n" for row in ROWS)
PLY_HEADER = (
    "ply\nformat ascii 1.0\ncomment made by hand\nelement vertex 5\nproperty double x\nproperty double y\n"
    "property double z\nelement face {n}\nproperty list uchar int {key}\nend_header\n"
)


def ply(key: str = "vertex_indices", rows: str = "") -> str:
    rows = rows or "".join("3 " + " ".join(map(str, row)) + "\n" for row in ROWS)
    points = "".join(" ".join(f"{c:.17g}" for c in p) + "\n" for p in POINTS)
    return PLY_HEADER.format(n=len(rows.splitlines()), key=key) + points + rows


def read(path: Path, content: str | bytes) -> np.ndarray:
    """Corners of the triangles of a file of this content."""
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    points, rows = read_mesh(path)
    return points[rows]


TEXT = {
    "ascii.stl": ascii_stl(POINTS[ROWS]),
    "crlf.stl": ascii_stl(POINTS[ROWS]).replace("\n", "\r\n"),
    "upper.STL": ascii_stl(POINTS[ROWS]).upper().replace("E-", "e-"),
    "two_solids.stl": ascii_stl(POINTS[ROWS[:2]], "a") + ascii_stl(POINTS[ROWS[2:]], "b"),
    "odd_names.stl": ascii_stl(POINTS[ROWS], "vertex facet 1 endsolid normal"),
    "no_name.stl": "\n" + ascii_stl(POINTS[ROWS], ""),
    "plain.obj": obj(POINTS, FACES),
    "crlf.obj": ("# comment\n" + obj(POINTS, FACES)).replace("\n", "\r\n"),
    "groups.obj": obj(POINTS, "g a\nusemtl x\n" + FACES[:24] + "g b\nusemtl y\ns off\n" + FACES[24:]),
    "textures.obj": obj(POINTS, "vt 0 0\nvn 0 0 1\n" + FACES.replace("f 1", "f 1/1/1").replace(" 2", " 2/1/1")
                        .replace(" 3", " 3/1/1").replace(" 4", " 4/1/1").replace(" 5", " 5/1/1")),
    "backwards.obj": obj(POINTS, "".join("f " + " ".join(str(v - 5) for v in row) + "\n" for row in ROWS)),
    "plain.ply": ply(),
    "other_key.ply": ply("vertex_index"),
}  # fmt: skip


@pytest.mark.parametrize("name", TEXT)
def test_text_is_read_to_the_last_bit_in_order(name, tmp_path):
    """Catches a float32 reader (1e-9 is lost), CRLF, names taken for words, a second solid left out."""
    assert np.array_equal(read(tmp_path / name, TEXT[name]), POINTS[ROWS])


@pytest.mark.parametrize("header", [b"", b"solid made by a CAD program", b"facet normal \n vertex 1 2 3"])
def test_binary_stl_also_with_solid_in_its_header(header, tmp_path):
    corners = read(tmp_path / "b.stl", binary_stl(POINTS[ROWS], header))
    assert corners.dtype == np.float64
    assert np.array_equal(corners, POINTS[ROWS].astype(np.float32))


@pytest.mark.parametrize("name", ["b.ply", "b.vtk", "a.vtk", "old.vtk", "b.vtu"])
def test_what_meshio_writes(name, tmp_path):
    """Binary and ASCII, triangles and quads in two blocks: the quad becomes a fan about its first corner."""
    import meshio

    cells = [("triangle", ROWS[2:]), ("quad", np.array([[0, 1, 2, 3]])), ("line", np.array([[0, 1]]))]
    if name == "b.ply":
        meshio.write(tmp_path / name, meshio.Mesh(POINTS, [("triangle", ROWS)]), binary=True)
        expected = POINTS[ROWS]
    else:
        mesh, expected = meshio.Mesh(POINTS, cells), POINTS[ROWS[[2, 3, 0, 1]]]
        if name == "old.vtk":
            meshio.vtk.write(tmp_path / name, mesh, fmt_version="4.2")
        else:
            meshio.write(tmp_path / name, mesh, binary=name.startswith("b"))
    points, rows = read_mesh(tmp_path / name)
    assert np.array_equal(points[rows], expected)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("q.obj", obj(POINTS, QUADS)),
        ("mixed.obj", obj(POINTS, QUADS + "f 1 2 5\n")),
        ("q.ply", ply(rows="4 0 1 2 3\n")),
        ("mixed.ply", ply(rows="4 0 1 2 3\n3 0 1 4\n")),
    ],
)
def test_polygons_become_fans(name, content, tmp_path):
    corners = read(tmp_path / name, content)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    flat = np.ptp(corners[:, :, 2], axis=1) == 0
    assert area[flat].sum() == pytest.approx(2 / 9, rel=1e-12)
    assert len(corners) == (3 if "mixed" in name else 2)


def test_a_pentagon_is_three_triangles(tmp_path):
    angle = np.arange(5) * 2 * np.pi / 5
    points = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    corners = read(tmp_path / "p.obj", obj(points, "f 1 2 3 4 5\n"))
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert normal[:, 2].sum() / 2 == pytest.approx(2.5 * np.sin(2 * np.pi / 5), rel=1e-12)
    assert len(corners) == 3


def test_an_archive(tmp_path):
    np.savez(tmp_path / "m.npz", vertices=POINTS, triangles=ROWS)
    points, rows = read_mesh(tmp_path / "m.npz")
    assert np.array_equal(points[rows], POINTS[ROWS])


STL = ascii_stl(POINTS[ROWS])
BAD = [
    ("empty.stl", b"", "is empty"),
    ("a.step", b"ISO-10303-21;", "unknown suffix; known: .stl, .obj, .ply, .vtk, .vtu, .npz"),
    ("text.stl", b"Dear reader,\n", "not an STL file: neither binary nor text that begins with 'solid'"),
    ("cut.stl", STL[: len(STL) // 2].encode(), "truncated ASCII STL: 2 facets, and no 'endsolid' at the end"),
    ("short.stl", STL.replace("      vertex", "      vertx", 1).encode(),
     "broken ASCII STL: not every one of its 4 facets has three corners"),
    ("word.stl", STL.replace("vertex 0.00", "vertex O.00", 1).encode(),
     "broken ASCII STL: line 4 is no corner of three numbers"),
    ("no_facet.stl", b"solid a\nendsolid a\n", "holds no triangles"),
    ("cut_binary.stl", binary_stl(POINTS[ROWS])[:-10],
     "broken binary STL: 274 bytes; must be 84 + 50 x the number of triangles, which it gives as 4"),
    ("no_face.obj", obj(POINTS, "").encode(), "holds no triangles"),
    ("beyond.obj", obj(POINTS, "f 1 2 9\n").encode(), "truncated or broken OBJ"),
    ("binary.obj", bytes(200), "not an OBJ file: it is not text"),
    ("no_face.ply", ply(rows="3 0 1 2\n").replace("face 1", "face 0").encode(), "holds no triangles"),
    ("cut.ply", ply()[:-20].encode(), "truncated or broken PLY"),
    ("text.ply", b"Dear reader,\n", "truncated or broken PLY"),
    ("text.vtk", b"Dear reader,\n", "truncated or broken VTK"),
    ("text.vtu", b"Dear reader,\n", "truncated or broken VTK"),
    ("text.npz", b"Dear reader,\n", "not an .npz archive, or truncated"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "content", "message"), BAD, ids=[row[0] for row in BAD])
def test_a_bad_file_is_named_with_what_is_wrong(name, content, message, tmp_path, capsys):
    """One ValueError, no exit of the program, nothing printed: catches a reader's own ways to fail."""
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"^file = ") as error:
        read_mesh(path)
    assert message in str(error.value)
    assert str(path) in str(error.value)
    assert capsys.readouterr() == ("", "")


def test_what_is_no_file(tmp_path):
    with pytest.raises(ValueError, match=r"file = .*gone\.stl': no such file"):
        read_mesh(tmp_path / "gone.stl")
    (tmp_path / "folder.stl").mkdir()
    with pytest.raises(ValueError, match="is a folder"):
        read_mesh(tmp_path / "folder.stl")


def test_cells_with_a_volume_are_refused(tmp_path):
    import meshio

    mesh = meshio.Mesh(POINTS, [("tetra", np.array([[0, 1, 2, 4]]))])
    mesh.write(tmp_path / "t.vtk")
    with pytest.raises(ValueError, match="holds cells of type tetra; must be triangles, quads or polygons"):
        read_mesh(tmp_path / "t.vtk")


def test_an_archive_of_other_arrays(tmp_path):
    for arrays, message in [
        ({"vertices": POINTS}, "array triangles needed; found: vertices"),
        ({"vertices": POINTS, "triangles": ROWS / 2}, "must be integers"),
        ({"vertices": POINTS[:, :2], "triangles": ROWS}, r"has points of shape \(5, 2\)"),
    ]:
        np.savez(tmp_path / "m.npz", **arrays)
        with pytest.raises(ValueError, match=message):
            read_mesh(tmp_path / "m.npz")
